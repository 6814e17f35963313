"""Where each robot is drawn, which way it looks, and the state that gives it its colour."""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.world.state import CHARGE, NIL
from tui.render import styles
from tui.render.glyphs import GlyphSet
from tui.render.scene import Scene

# States of a robot, the worse the higher: the worst one gives a shared character its colour.
PARKED: Final = 0
CHARGING: Final = 1
EMPTY: Final = 2
LOADED: Final = 3
WAITS: Final = 4
DEADLOCK: Final = 5
SELECTED: Final = 6
INKS: Final = np.array(
    [
        *(styles.PARKED, styles.CHARGING, styles.ROBOT, styles.LOADED),
        *(styles.WAITS, styles.FAULT, styles.SELECTED),
    ],
    np.uint32,
)

# Shapes of a robot in its heading.
HOLLOW: Final = 0
FILLED: Final = 1
SQUARE: Final = 2


class Robots(NamedTuple):
    """The fleet as it is drawn; all (n,), by identity."""

    cell: NDArray[np.int32]  # its bay's if it is there; NIL: it cannot be drawn
    state: NDArray[np.uint8]
    direction: NDArray[np.uint8]
    shape: NDArray[np.uint8]


def robots_of(scene: Scene) -> Robots:
    """The robots of a scene's snapshot."""
    assert scene.snapshot is not None
    fleet = scene.snapshot.robots
    loaded = fleet.load != NIL
    parked = fleet.parked != 0
    state = np.where(loaded, np.uint8(LOADED), np.uint8(EMPTY))
    state[fleet.cause != 0] = WAITS
    state[parked] = PARKED
    state[fleet.action == CHARGE] = CHARGING
    state[fleet.ring != 0] = DEADLOCK
    shape = loaded.astype(np.uint8)
    shape[parked] = SQUARE
    cell = np.where(fleet.cell == NIL, fleet.bay, fleet.cell)
    return Robots(cell, state, directions(scene), shape)


def directions(scene: Scene) -> NDArray[np.uint8]:
    """(n,) 0 to 3: the way each robot faces or, if its heading does not tell, drives."""
    assert scene.snapshot is not None
    fleet, headings = scene.snapshot.robots, scene.floor.headings
    if headings == 4:
        return np.asarray(fleet.heading & 3, np.uint8)
    if headings == 1:
        return np.asarray(fleet.travel & 3, np.uint8)
    # On rails: the way it came, or its new axis once it has turned.
    came = fleet.travel & 1 == fleet.heading
    return np.where(came, fleet.travel & 3, fleet.heading).astype(np.uint8)


def shapes(glyphs: GlyphSet) -> NDArray[np.uint32]:
    """(shapes, 4) glyphs by shape and direction."""
    return np.array([glyphs.robot, glyphs.loaded, [glyphs.parked] * 4], np.uint32)


@lru_cache(maxsize=4)
def names(glyphs: GlyphSet, robots: int, width: int) -> NDArray[np.uint32]:
    """(robots, width) the digits of each identity, blanks behind."""
    table = np.full((robots, width), glyphs.blank, np.uint32)
    for identity in range(robots):
        for column, digit in enumerate(str(identity)[:width]):
            table[identity, column] = glyphs.digits[int(digit)]
    return table
