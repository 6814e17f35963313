"""Where each robot is drawn, which way it looks, and the state that gives it its colour."""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import (
    DRAW_EMPTY,
    DRAW_FAULT,
    DRAW_LOADED,
    DRAW_PARKED,
    cell_of,
    robot_looks,
)
from tui.render import styles
from tui.render.colouring import OTHER_COLOURS, coloured
from tui.render.glyphs import GLYPH_BITS, GLYPHS, Codes, GlyphSet, code
from tui.render.scene import Scene
from tui.render.styles import style

# By state, the worse the higher: the worst one gives a shared character its colour.
BODY_COLOURS: Final = np.array(
    [
        *(
            styles.COLOUR_PARKED,
            styles.COLOUR_CHARGING,
            styles.COLOUR_ROBOT,
            styles.COLOUR_LOADED,
            styles.COLOUR_LOW_BATTERY,
        ),
        *(styles.COLOUR_WAITING, styles.COLOUR_FAULT),
        *OTHER_COLOURS,
    ],
    np.uint32,
)


class Robots(NamedTuple):
    """The fleet as it is drawn; all (n,), by identity."""

    cell: NDArray[np.int32]  # its parking bay's if it is there; NIL: it cannot be drawn
    state: NDArray[np.uint8]
    direction: NDArray[np.uint8]
    shape: NDArray[np.uint8]
    colour: NDArray[np.uint32]


def colours_of(scene: Scene, state: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(n,) the colour of each robot of the scene: that of its state, or of what colours robots."""
    return BODY_COLOURS[coloured(scene, state, DRAW_PARKED, DRAW_FAULT)]


def body_colours(scene: Scene, robots: Robots) -> NDArray[np.uint32]:
    """(n,) the same where a robot's load has a colour of its own."""
    state = np.where(robots.state == DRAW_LOADED, np.uint8(DRAW_EMPTY), robots.state)
    return colours_of(scene, state)


def robots_of(scene: Scene) -> Robots:
    """The robots of a scene's snapshot."""
    assert scene.snapshot is not None
    fleet, floor = scene.snapshot.robots, scene.floor
    looks = robot_looks(fleet, floor.headings, floor.battery, floor.faults)
    colour = colours_of(scene, looks.state)
    return Robots(cell_of(fleet), looks.state, looks.direction, looks.shape, colour)


def shapes(glyphs: GlyphSet) -> NDArray[np.uint32]:
    """(shapes, 4) glyphs by shape and direction."""
    still = (glyphs.parked, glyphs.charging, glyphs.drained, glyphs.fault)
    return np.array(
        [
            *(glyphs.robot, glyphs.loaded, *([one] * 4 for one in still)),
            *(glyphs.low, glyphs.low_loaded),
        ],
        np.uint32,
    )


# What a robot is from afar, where a character holds many cells.
MARK_FULL: Final = 0  # a whole character
MARK_HALF: Final = 1  # half of one
MARK_DOT: Final = 2  # a dot of braille
FEW: Final = 16  # characters of the picture for each robot from which on it takes a whole one
SOME: Final = 4  # and half of one


def far_mark(robots: int, characters: int, on_layer: bool) -> int:
    """How a fleet is drawn on a picture of the whole floor with so many characters.

    On a layer a robot is half a character at most, so that the layer is seen beside it.
    """
    if robots * FEW <= characters and not on_layer:
        return MARK_FULL
    return MARK_HALF if robots * SOME <= characters else MARK_DOT


def with_cursor(codes: Codes) -> Codes:
    """The same on the background of the cursor; a robot's colour becomes that of its signs."""
    fg, bg = np.divmod(codes >> np.uint32(GLYPH_BITS), np.uint32(len(styles.COLOURS)))
    on_robot = (bg >= styles.COLOUR_PARKED) & (fg < styles.COLOUR_TRACK)
    foregrounds = style(np.where(on_robot, bg, fg), styles.COLOUR_CURSOR)
    return np.asarray(code(foregrounds, codes & GLYPHS), np.uint32)


@lru_cache(maxsize=4)
def names(glyphs: GlyphSet, robots: int, width: int) -> NDArray[np.uint32]:
    """(robots, width) the digits of each identity, blanks behind."""
    table = np.full((robots, width), glyphs.blank, np.uint32)
    for identity in range(robots):
        for column, digit in enumerate(str(identity)[:width]):
            table[identity, column] = glyphs.digits[int(digit)]
    return table
