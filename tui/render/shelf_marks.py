"""The shelves and storage cells on the screen, and which of them hold a load or a pod."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from automaton.floor.cells import SHELF, STORAGE
from tui.render.camera import Rectangle
from tui.render.scene import Floor, Scene


class Shelves(NamedTuple):
    """Shelves, or storage cells, within a rectangle of cells."""

    slot: NDArray[np.int32]
    at: NDArray[np.intp]  # index into the cells of the rectangle


@lru_cache(maxsize=8)
def shelves_in(floor: Floor, visible: Rectangle, kind: int = SHELF) -> Shelves:
    """Those of one kind; kept until the camera moves."""
    rows, columns = slice(visible.top, visible.bottom), slice(visible.left, visible.right)
    slots = floor.slot_in.reshape(floor.looks.shape)[rows, columns].reshape(-1)
    index = np.flatnonzero(floor.floor_plan.kind[rows, columns].reshape(-1) == kind)
    index = index[slots[index] != NIL]
    return Shelves(slots[index], index)


def pods_in(scene: Scene, visible: Rectangle) -> NDArray[np.intp]:
    """The storage cells in which a pod stands, in cells of the rectangle."""
    return full_shelves(scene, visible, STORAGE)


def full_shelves(scene: Scene, visible: Rectangle, kind: int = SHELF) -> NDArray[np.intp]:
    """Those with a load, in cells of the rectangle; before the run begins, as they are drawn."""
    shelves = shelves_in(scene.floor, visible, kind)
    if scene.snapshot is not None:
        full = scene.snapshot.slots.content[shelves.slot] != NIL
    else:
        full = scene.floor.floor_plan.loads.reshape(-1)[scene.floor.slots_cell[shelves.slot]] != 0
    at: NDArray[np.intp] = shelves.at[full]
    return at
