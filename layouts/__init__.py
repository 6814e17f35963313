"""Floors and scenarios as data, and the generators of floors by the name that a scenario gives them."""

from pkgutil import extend_path
from typing import Final

# A folder `layouts` beside a scenario adds modules to this package, and hides none of them.
__path__[:] = extend_path(__path__, __name__)

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
