"""Pictures of the grid: a world as text, a text as a world, floors, and stories for tests.

picture_of, world_from    a whole world: the floor with its robots, and a line for each of them
floor_picture             a floor alone, as `draw_floor` reads it (imports no Numba)
Story                     a few robots on a tiny floor, moved tick by tick, for tests
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from automaton.floor.drawn_floors import floor_drawing, floor_legend, floor_picture
from automaton.floor.floor_plan import FloorPlan

if TYPE_CHECKING:
    from automaton.runs.pictures.pictures import Story, moved, picture_of, world_from

__all__ = [
    "Story",
    "drawn",
    "floor_drawing",
    "floor_legend",
    "floor_picture",
    "moved",
    "picture_of",
    "world_from",
]

# Worlds need Numba, floors do not: import these names when first used.
_WORLDS = {
    "picture_of": "automaton.runs.pictures.pictures",
    "world_from": "automaton.runs.pictures.pictures",
    "Story": "automaton.runs.pictures.pictures",
    "moved": "automaton.runs.pictures.pictures",
}


def __getattr__(name: str) -> Any:
    if name not in _WORLDS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_WORLDS[name]), name)


def drawn(subject: Any) -> str:
    """The picture of a FloorPlan, a Simulation, or a Story."""
    if isinstance(subject, FloorPlan):
        return floor_picture(subject)
    picture = getattr(subject, "picture", None)
    if isinstance(picture, str):  # in a Simulation `picture` is a method
        return picture
    from automaton.runs.pictures.pictures import picture_of

    return picture_of(subject)
