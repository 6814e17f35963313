"""The generators of floors by the name that a scenario gives them."""

from __future__ import annotations

from typing import Final

# name: "module:Class"; a class is a msgspec struct of parameters with `build() -> FloorPlan`.
GENERATORS: Final[dict[str, str]] = {
    "tabletop": "layouts.tabletop:Tabletop",
    "racks": "layouts.racks:Racks",
    "depots": "layouts.depots:Depots",
    "factory": "layouts.factory:Factory",
    "random": "layouts.random_floor:RandomFloor",
    "rooms": "layouts.random_floor:Rooms",
    "aisles": "layouts.aisles:Aisles",
    "sorting": "layouts.sorting:Sorting",
    "shelf-blocks": "layouts.shelf_blocks:ShelfBlocks",
}
