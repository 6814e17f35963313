"""Robots coloured by something else than their state: order, type, service zone, battery, wait.

Shapes go on to show the state, and robots in wait cycles or down keep the colour of that. Kinds have
eight colours in turn, amounts five that grow brighter (darker in the light theme).
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import (
    DRAW_EMPTY,
    DRAW_FAULT,
    DRAW_LOADED,
    DRAW_PARKED,
    STATE_COLOURS,
    cell_of,
    robot_looks,
)
from automaton.engine.observation import is_waiting, waited_ticks
from automaton.engine.state import BATTERY_FULL, NIL
from tui.render import styles
from tui.render.glyphs import GLYPH_BITS, GLYPHS, Codes, Entries, GlyphSet, code
from tui.render.scene import Scene
from tui.render.styles import style

COLOURINGS: Final = {  # by name, and what it is called in the palette and in messages
    "state": "what they do",
    "order": "the order they work on",
    "type": "their type",
    "zone": "their service zone",
    "battery": "the charge of their battery",
    "waiting": "how long they have waited",
}
WAITED: Final = (1, 10, 50, 200)  # ticks from which on levels 1 to 4 of a wait begin
CLASS_COUNT: Final = len(styles.CLASSES)
LEVEL_COUNT: Final = len(styles.LEVELS)
# Rows of tui.render.robot_marks.BODY_COLOURS behind those of the states.
DRAW_CLASS: Final = len(STATE_COLOURS)
DRAW_LEVEL: Final = DRAW_CLASS + CLASS_COUNT
DRAW_ALARM: Final = DRAW_LEVEL + LEVEL_COUNT  # in a wait cycle, or down
OTHER_COLOURS: Final = (*styles.CLASSES, *styles.LEVELS, styles.COLOUR_FAULT)


def is_possible(scene: Scene, colouring: str) -> bool:
    """Whether the robots of a floor differ in it."""
    if colouring == "type":
        return bool(scene.floor.type_names)
    if colouring == "zone":
        return scene.service_zones is not None
    return colouring != "battery" or scene.floor.battery


def coloured(scene: Scene, state: NDArray[np.uint8], rest: int, alarm: int) -> NDArray[np.uint8]:
    """(n,) what gives each robot its colour; `rest`: the state of one without, `alarm`: that stays."""
    if scene.colouring == "state" or not is_possible(scene, scene.colouring):
        return state
    values = _values(scene)
    first = DRAW_LEVEL if scene.colouring in ("battery", "waiting") else DRAW_CLASS
    drawn = np.where(values == NIL, rest, first + values).astype(np.uint8)
    drawn[state == alarm] = DRAW_ALARM
    return drawn


def _values(scene: Scene) -> NDArray[np.int64]:
    """(n,) the colour of each robot among those of its kind, or NIL."""
    assert scene.snapshot is not None
    fleet = scene.snapshot.robots
    if scene.colouring == "battery":
        return np.clip(
            fleet.charge.astype(np.int64) * LEVEL_COUNT // BATTERY_FULL, 0, LEVEL_COUNT - 1
        )
    if scene.colouring == "waiting":
        waited = waited_ticks(fleet.cause, fleet.since, scene.snapshot.tick)
        waited = np.where(is_waiting(fleet.cause), waited, 0)
        return np.searchsorted(WAITED, waited, "right").astype(np.int64)
    if scene.colouring == "type":  # a robot with a load has another row of durations
        return (fleet.type.astype(np.int64) % len(scene.floor.type_names)) % CLASS_COUNT
    number = fleet.order if scene.colouring == "order" else fleet.service_zone
    return np.where(number == NIL, NIL, number % CLASS_COUNT).astype(np.int64)


def colour_entries(scene: Scene, sign: int) -> Entries:
    """What the colours mean, for the legend; each is shown with this glyph."""

    def shown(colours: range) -> tuple[int, ...]:
        return tuple(int(code(style(one, styles.COLOUR_FLOOR), sign)) for one in colours)

    if scene.colouring in ("order", "zone"):
        half = CLASS_COUNT // 2
        none = shown(range(styles.COLOUR_PARKED, styles.COLOUR_PARKED + 1))
        return [
            (shown(styles.CLASSES[:half]), f"by {scene.colouring}: {CLASS_COUNT} colours in turn,"),
            (shown(styles.CLASSES[half:]), "those of one number always the same"),
            (none, f"no {scene.colouring}"),
        ]
    if scene.colouring == "type":
        names = [*enumerate(scene.floor.type_names)]
        return [(shown(styles.CLASSES[n % CLASS_COUNT :][:1]), f"type {name}") for n, name in names]
    return [(shown(styles.LEVELS[n : n + 1]), words) for n, words in enumerate(_level_words(scene))]


def _level_words(scene: Scene) -> list[str]:
    """What each of the levels means."""
    if scene.colouring == "battery":
        step = 100 // LEVEL_COUNT
        return [f"battery {step * n} to {step * (n + 1)} %" for n in range(LEVEL_COUNT)]
    ends = [f"{begin} to {end - 1}" for begin, end in pairwise(WAITED)]
    waited = [*ends, f"{WAITED[-1]} or more"]
    return ["does not wait", *(f"has waited {ticks} ticks" for ticks in waited)]


# Where each robot is drawn, which way it looks, and the state that gives it its colour.


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
