"""Where each robot is drawn, which way it looks, and the state that gives it its colour."""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.robot_looks import directions as read_directions
from automaton.engine.robot_status import BATTERY_PERCENT, STATUS_FAILED, STATUS_TOWED
from automaton.engine.robot_status import STATUS_DEPLETED as DRAINED
from automaton.engine.state import NIL
from automaton.evidence.history.charging_words import charging
from tui.render import styles
from tui.render.colouring import OTHER_COLOURS, coloured
from tui.render.glyphs import GLYPH_BITS, GLYPHS, Codes, GlyphSet, code
from tui.render.scene import Scene
from tui.render.styles import style

# States of a robot, the worse the higher: the worst one gives a shared character its colour.
DRAW_PARKED: Final = 0
DRAW_CHARGING: Final = 1
DRAW_EMPTY: Final = 2
DRAW_LOADED: Final = 3
DRAW_LOW_BATTERY: Final = 4  # its battery is
DRAW_WAITING: Final = 5
DRAW_DEADLOCK: Final = 6  # and down
DRAW_SELECTED: Final = 7
STATE_COLOURS: Final = np.array(
    [
        *(
            styles.COLOUR_PARKED,
            styles.COLOUR_CHARGING,
            styles.COLOUR_ROBOT,
            styles.COLOUR_LOADED,
            styles.COLOUR_LOW_BATTERY,
        ),
        *(styles.COLOUR_WAITING, styles.COLOUR_FAULT, styles.COLOUR_SELECTED),
        *OTHER_COLOURS,
    ],
    np.uint32,
)

# Shapes of a robot in its heading.
SHAPE_HOLLOW: Final = 0
SHAPE_FILLED: Final = 1
SHAPE_SQUARE: Final = 2
SHAPE_PLUG: Final = 3  # charges
SHAPE_VOID: Final = 4  # battery empty
SHAPE_CROSS: Final = 5  # broken
SHAPE_THIN: Final = 6  # battery low
SHAPE_BOXED: Final = 7  # battery low, with a load
LOW_CHARGE: Final = 20 * BATTERY_PERCENT


class Robots(NamedTuple):
    """The fleet as it is drawn; all (n,), by identity."""

    cell: NDArray[np.int32]  # its parking bay's if it is there; NIL: it cannot be drawn
    state: NDArray[np.uint8]
    direction: NDArray[np.uint8]
    shape: NDArray[np.uint8]
    colour: NDArray[np.uint32]


def colours_of(scene: Scene, state: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(n,) the colour of each robot of the scene: that of its state, or of what colours robots."""
    return STATE_COLOURS[coloured(scene, state, DRAW_PARKED, DRAW_DEADLOCK)]


def body_colours(scene: Scene, robots: Robots) -> NDArray[np.uint32]:
    """(n,) the same where a robot's load has a colour of its own."""
    state = np.where(robots.state == DRAW_LOADED, np.uint8(DRAW_EMPTY), robots.state)
    return colours_of(scene, state)


def robots_of(scene: Scene) -> Robots:
    """The robots of a scene's snapshot."""
    assert scene.snapshot is not None
    fleet = scene.snapshot.robots
    loaded = fleet.load != NIL
    parked = fleet.parked != 0
    state = np.where(loaded, np.uint8(DRAW_LOADED), np.uint8(DRAW_EMPTY))
    state[fleet.cause != 0] = DRAW_WAITING
    state[parked] = DRAW_PARKED
    state[fleet.wait_cycle_ticks != 0] = DRAW_DEADLOCK
    shape = loaded.astype(np.uint8)
    shape[parked] = SHAPE_SQUARE
    if scene.floor.battery:
        draw_batteries(scene, state, shape)
    if scene.floor.loads_may_lie:
        draw_out_of_order(scene, state, shape)
    cell = np.where(fleet.cell == NIL, fleet.bay, fleet.cell)
    return Robots(cell, state, directions(scene), shape, colours_of(scene, state))


def draw_batteries(scene: Scene, state: NDArray[np.uint8], shape: NDArray[np.uint8]) -> None:
    """Robots that charge, and such as have little energy left; who waits keeps the colour for it."""
    assert scene.snapshot is not None
    fleet = scene.snapshot.robots
    plugged = charging(fleet)
    state[plugged], shape[plugged] = DRAW_CHARGING, SHAPE_PLUG
    low = (fleet.charge < LOW_CHARGE) & ~plugged
    state[low] = np.maximum(state[low], DRAW_LOW_BATTERY)
    shape[low] = np.where(fleet.load[low] != NIL, SHAPE_BOXED, SHAPE_THIN)


def draw_out_of_order(scene: Scene, state: NDArray[np.uint8], shape: NDArray[np.uint8]) -> None:
    """Robots that are down, and such as were towed, which show in a parking bay alone."""
    assert scene.snapshot is not None
    status = scene.snapshot.robots.status
    for down, sign in ((DRAINED, SHAPE_VOID), (STATUS_FAILED, SHAPE_CROSS)):
        state[status == down], shape[status == down] = DRAW_DEADLOCK, sign
    state[status >= STATUS_TOWED], shape[status >= STATUS_TOWED] = DRAW_PARKED, SHAPE_CROSS


def directions(scene: Scene) -> NDArray[np.uint8]:
    """(n,) 0 to 3: the way each robot faces or, if its heading does not tell, drives."""
    assert scene.snapshot is not None
    return read_directions(scene.snapshot.robots, scene.floor.headings)


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
