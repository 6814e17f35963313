"""Drawn robots: their places, directions, colours and sprites.

Robots are coloured by state or by something else: order, type, service zone, battery, wait. Shapes
then still show the state, and robots in wait cycles or down keep their alarm colour. Classes use
eight colours in rotation; amounts use five, each brighter than the last (darker in the light theme).

Where a cell has several rows, a character is two pixels, one above the other: a cell of 6 x 3
characters has 6 x 6 pixels. A driving robot has a pointed front, a waiting one a flat front; a robot
that is parked, charging or down has no front. The sign is near the front, the number in the middle,
the load behind in its own colour. With batteries, a bar shows the charge.

    ####..     drives east      ######     waits       .####.     is parked
    #####.                      ######                 ######
    ##12##                      ##12##                 ##12##
    ######                      ######                 ######
    #LLL#.                      #LLL##                 ######
    ----..                      ----##                 .####.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.drawings import looks
from automaton.drawings.looks import (
    DRAW_FAULT,
    DRAW_PARKED,
    STATE_COLOURS,
    cell_of,
    robot_looks,
)
from automaton.engine.observation import is_waiting, waited_ticks
from automaton.engine.state import BATTERY_FULL, NIL
from tui.render import styles
from tui.render.scene import Scene
from tui.render.styles import GLYPH_BITS, GLYPHS, Codes, Entries, GlyphSet, code, style

COLOURINGS: Final = {  # by name: their words in the palette and in messages
    "state": "what they do",
    "order": "the order they work on",
    "type": "their type",
    "zone": "their service zone",
    "battery": "the charge of their battery",
    "waiting": "how long they have waited",
}

WAITED: Final = (1, 10, 50, 200)  # ticks at which levels 1 to 4 of a wait begin

CLASS_COUNT: Final = len(styles.CLASS_COLOURS)
LEVEL_COUNT: Final = len(styles.LEVEL_COLOURS)

# Rows of BODY_COLOURS after those of the states.
DRAW_CLASS: Final = len(STATE_COLOURS)
DRAW_LEVEL: Final = DRAW_CLASS + CLASS_COUNT
DRAW_ALARM: Final = DRAW_LEVEL + LEVEL_COUNT  # in a wait cycle, or down
DRAW_GREY: Final = DRAW_ALARM + 1  # on heat, whose hues are those of robots

# By state, worse states last: the worst robot determines the colour of a shared character.
BODY_COLOURS: Final = np.array(
    [
        *(
            styles.COLOUR_PARKED,
            styles.COLOUR_IDLE,
            styles.COLOUR_CHARGING,
            styles.COLOUR_ROBOT,
            styles.COLOUR_LOADED,
            styles.COLOUR_LOW_BATTERY,
        ),
        *(styles.COLOUR_WAITING, styles.COLOUR_FAULT),
        *(*styles.CLASS_COLOURS, *styles.LEVEL_COLOURS, styles.COLOUR_FAULT),
        styles.COLOUR_TEXT,
    ],
    np.uint32,
)

# The mark of a robot where a character holds many cells.
MARK_FULL: Final = 0  # a whole character
MARK_HALF: Final = 1  # half of one
MARK_DOT: Final = 2  # a dot of braille
FEW: Final = 16  # characters of the picture per robot from which a robot takes a whole one
SOME: Final = 4  # or half of one

# Content of a pixel; BAR + j is pixel j of the battery bar.
OUTSIDE: Final = 0
BODY: Final = 1
LOAD: Final = 2
BAR: Final = 3

# Outlines.
POINTED: Final = 0
FLAT: Final = 1
ROUND: Final = 2  # without a front

EAST, SOUTH, WEST, NORTH = range(4)

MARGIN_HEIGHT: Final = 5  # rows of a cell from which robots have a margin above and below
BAR_HEIGHT: Final = 3  # rows of a cell from which the bar fits
POINT: Final = 3  # maximum depth of a pointed front in pixels; a quarter of large robots

HEADLESS: Final = (
    *(looks.SHAPE_SQUARE, looks.SHAPE_PLUG, looks.SHAPE_VOID, looks.SHAPE_CROSS, looks.SHAPE_RING),
)
# The foreground of blanks, which unlike signs are never underlined.
BLANK_INK: Final = styles.COLOUR_VOID

Colours = NDArray[np.uint32]


class DrawnRobots(NamedTuple):
    """The drawn fleet; all (n,), by identity."""

    cell: NDArray[np.int32]  # its cell or parking bay; NIL: not drawn
    state: NDArray[np.uint8]
    direction: NDArray[np.uint8]
    shape: NDArray[np.uint8]
    colour: NDArray[np.uint32]
    loaded: NDArray[np.bool_]
    waits: NDArray[np.bool_]  # also for an order
    charge: NDArray[np.int32]

    def of(self, which: NDArray[np.intp]) -> DrawnRobots:
        """Some of them."""
        arrays: list[Any] = [array[which] for array in self]
        return DrawnRobots(*arrays)


class RobotDrawing(NamedTuple):
    """How robots are drawn in cells of width x height characters."""

    glyphs: GlyphSet
    width: int
    height: int
    battery: bool  # they run on batteries
    numbered: bool = True  # where there is room


def robots_of(scene: Scene) -> DrawnRobots:
    """The robots of a scene's snapshot."""
    assert scene.snapshot is not None
    fleet, floor = scene.snapshot.robots, scene.floor
    looks = robot_looks(fleet, floor.headings, floor.battery, floor.faults)
    colour = colours_of(scene, looks.state)
    place = cell_of(fleet), looks.state, looks.direction, looks.shape, colour
    return DrawnRobots(*place, fleet.load != NIL, fleet.cause != 0, fleet.charge)


def colours_of(scene: Scene, state: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(n,) the colour of each robot, by its state or by the scene's colouring."""
    return BODY_COLOURS[coloured(scene, state)]


def marks_of(scene: Scene, robots: int) -> NDArray[np.uint32]:
    """(n,) the colour that marks each robot, around its own; 0: not marked."""
    marks = np.zeros(robots, np.uint32)
    for chosen, colour in (
        (scene.marked, styles.COLOUR_MARKED),
        ((scene.selected,), styles.COLOUR_SELECTED),
    ):
        which = np.asarray(chosen, np.int32)
        marks[which[which != NIL]] = colour
    return marks


def sign_styles(colour: Colours, marks: Colours) -> Colours:
    """The styles of signs on robots: cut out of their colour or, if marked, in it on the mark's."""
    return np.where(marks, style(colour, marks), style(styles.COLOUR_FLOOR, colour))


def shape_glyphs(glyphs: GlyphSet) -> NDArray[np.uint32]:
    """(shapes, 4) glyphs by shape and direction."""
    still = (glyphs.parked, glyphs.charging, glyphs.drained, glyphs.fault)
    return np.array(
        [
            *(glyphs.robot, glyphs.loaded, *([one] * 4 for one in still)),
            *(glyphs.low, glyphs.low_loaded, [glyphs.idle] * 4),
        ],
        np.uint32,
    )


@lru_cache(maxsize=4)
def number_glyphs(glyphs: GlyphSet, robots: int, width: int) -> NDArray[np.uint32]:
    """(robots, width) the digits of each identity, then blanks; only blanks if not all fit."""
    table = np.full((robots, width), glyphs.blank, np.uint32)
    for identity in range(robots if robots <= 10**width else 0):
        for column, digit in enumerate(str(identity)):
            table[identity, column] = glyphs.digits[int(digit)]
    return table


def with_cursor(codes: Codes) -> Codes:
    """The same signs on the cursor's background; the sign of a robot takes its body's colour."""
    fg, bg = np.divmod(codes >> np.uint32(GLYPH_BITS), np.uint32(len(styles.COLOUR_TABLE)))
    body = (bg >= styles.COLOUR_PARKED) | (bg == styles.COLOUR_TEXT)
    on_robot = body & (fg < styles.COLOUR_TRACK)
    foregrounds = style(np.where(on_robot, bg, fg), styles.COLOUR_CURSOR)
    return np.asarray(code(foregrounds, codes & GLYPHS), np.uint32)


def far_mark(robots: int, characters: int, on_layer: bool) -> int:
    """The mark of robots in a picture of the whole floor with this number of characters.

    On a layer a robot takes at most half a character, so that the layer remains visible.
    """
    if robots * FEW <= characters and not on_layer:
        return MARK_FULL
    return MARK_HALF if robots * SOME <= characters else MARK_DOT


# Colourings other than by state.


def is_possible(scene: Scene, colouring: str) -> bool:
    """Whether the robots of this scene can differ in `colouring`."""
    if colouring == "type":
        return bool(scene.floor.type_names)
    if colouring == "zone":
        return scene.service_zones is not None
    return colouring != "battery" or scene.floor.battery


def is_grey(scene: Scene) -> bool:
    """Whether robots are grey, so that only the heat of a layer has colours."""
    return scene.values is not None and scene.shaded and scene.colouring == "state"


def coloured(scene: Scene, state: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(n,) each robot's index into BODY_COLOURS."""
    if is_grey(scene):
        return np.where(state == DRAW_FAULT, DRAW_ALARM, DRAW_GREY).astype(np.uint8)
    if scene.colouring == "state" or not is_possible(scene, scene.colouring):
        return state
    values = _values(scene)
    first = DRAW_LEVEL if scene.colouring in ("battery", "waiting") else DRAW_CLASS
    drawn = np.where(values == NIL, DRAW_PARKED, first + values).astype(np.uint8)
    drawn[state == DRAW_FAULT] = DRAW_ALARM
    return drawn


def _values(scene: Scene) -> NDArray[np.int64]:
    """(n,) each robot's index among the class or level colours, or NIL."""
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
    if scene.colouring == "type":  # types with a load have their own numbers, after the others
        return (fleet.type.astype(np.int64) % len(scene.floor.type_names)) % CLASS_COUNT
    number = fleet.order if scene.colouring == "order" else fleet.service_zone
    return np.where(number == NIL, NIL, number % CLASS_COUNT).astype(np.int64)


def colour_entries(scene: Scene, sign: int) -> Entries:
    """The meanings of the colours for the legend, each shown with this glyph."""

    def shown(colours: range) -> tuple[int, ...]:
        return tuple(int(code(style(one, styles.COLOUR_FLOOR), sign)) for one in colours)

    if scene.colouring in ("order", "zone"):
        half = CLASS_COUNT // 2
        none = shown(range(styles.COLOUR_PARKED, styles.COLOUR_PARKED + 1))
        return [
            (
                shown(styles.CLASS_COLOURS[:half]),
                f"by {scene.colouring}: {CLASS_COUNT} colours in turn,",
            ),
            (shown(styles.CLASS_COLOURS[half:]), "those of one number always the same"),
            (none, f"no {scene.colouring}"),
        ]
    if scene.colouring == "type":
        names = [*enumerate(scene.floor.type_names)]
        return [
            (shown(styles.CLASS_COLOURS[n % CLASS_COUNT :][:1]), f"type {name}")
            for n, name in names
        ]
    return [
        (shown(styles.LEVEL_COLOURS[n : n + 1]), words)
        for n, words in enumerate(_level_words(scene))
    ]


def _level_words(scene: Scene) -> list[str]:
    """The meaning of each level."""
    if scene.colouring == "battery":
        step = 100 // LEVEL_COUNT
        return [f"battery {step * n} to {step * (n + 1)} %" for n in range(LEVEL_COUNT)]
    ends = [f"{begin} to {end - 1}" for begin, end in pairwise(WAITED)]
    waited = [*ends, f"{WAITED[-1]} or more"]
    return ["does not wait", *(f"has waited {ticks} ticks" for ticks in waited)]


# The characters of robots, from their sprites, colours, numbers and charge.


def robot_codes(
    drawing: RobotDrawing, robots: DrawnRobots, which: NDArray[np.intp], marks: Colours
) -> Codes:
    """(k, characters of a cell) codes of the robots `which`; marks: (k,), see `marks_of`.

    In a cell of one row: a sign, and beside it a load mark or the number. A drawn robot that is
    marked has the mark's colour around its outline and behind its sign.
    """
    fleet_size, robots = len(robots.cell), robots.of(which)
    if drawing.height == 1:
        return signed_robots(drawing, robots, fleet_size, which, marks)
    drawings = sprites(drawing.width, drawing.height, drawing.battery)
    shape, direction = robots.shape, robots.direction.astype(np.intp)
    outline = np.where(np.isin(shape, HEADLESS), ROUND, np.where(robots.waits, FLAT, POINTED))
    load = robots.loaded.astype(np.intp)
    colours = pixel_colours(drawing, robots, drawings.bar[outline, direction])
    colours[:, OUTSIDE] = np.where(marks, marks, colours[:, OUTSIDE])
    robot = np.arange(len(which))[:, None]
    above = drawings.upper[outline, load, direction]
    below = drawings.lower[outline, load, direction]
    upper, lower = colours[robot, above], colours[robot, below]
    codes = paired(drawing.glyphs, upper, lower)
    if drawing.glyphs.shaded:  # without colours, signs show the load
        cargo = (above == LOAD) & (below == LOAD)
        codes[cargo] = code(style(styles.COLOUR_FLOOR, lower[cargo]), drawing.glyphs.cargo)
    sign = drawings.sign[outline, direction]
    glyph = shape_glyphs(drawing.glyphs)[shape, direction]
    row = np.arange(len(which))
    codes[row, sign] = code(sign_styles(ground(upper[row, sign], lower[row, sign]), marks), glyph)
    if drawing.numbered:
        starts, room = drawings.number[outline, direction], drawings.room[outline, direction]
        draw_numbers(drawing, codes, fleet_size, which, (starts, room), (upper, lower))
    return codes


def signed_robots(
    drawing: RobotDrawing,
    robots: DrawnRobots,
    fleet_size: int,
    which: NDArray[np.intp],
    marks: Colours,
) -> Codes:
    """(k, width) codes of these robots in cells of one row; `which`: their identities."""
    glyphs, width = drawing.glyphs, drawing.width
    codes = np.empty((len(which), width), np.uint32)
    glyph = shape_glyphs(glyphs)[robots.shape, robots.direction]
    codes[:, 0] = code(sign_styles(robots.colour, marks), glyph)
    beside = np.full((len(which), width - 1), glyphs.blank, np.uint32)
    if width == 2:
        beside[robots.loaded] = glyphs.cargo
    elif width > 2 and drawing.numbered:
        beside = number_glyphs(glyphs, fleet_size, width - 1)[which]
    codes[:, 1:] = code(style(styles.COLOUR_FLOOR, robots.colour)[:, None], beside)
    return codes


def pixel_colours(drawing: RobotDrawing, robots: DrawnRobots, bar: NDArray[np.intp]) -> Colours:
    """(k, BAR + width) the colours of each robot's pixels, by their content.

    bar: (k,) length in pixels of a full battery's bar.
    """
    body, charge = robots.colour, robots.charge
    colours = np.full((len(body), BAR + drawing.width), styles.COLOUR_FLOOR, np.uint32)
    colours[:, BODY] = body
    on_load = body == styles.COLOUR_LOADED
    colours[:, LOAD] = np.where(on_load, styles.COLOUR_TEXT, styles.COLOUR_LOADED)
    if drawing.battery:
        pixels = -(-charge.astype(np.int64) * bar // BATTERY_FULL)
        full = np.where(charge < looks.LOW_CHARGE, styles.COLOUR_LOW_BATTERY, styles.COLOUR_DONE)
        lit = np.arange(drawing.width) < pixels[:, None]
        colours[:, BAR:] = np.where(lit, full[:, None], styles.COLOUR_FLOOR)
    return colours


def paired(glyphs: GlyphSet, upper: Colours, lower: Colours) -> Codes:
    """The characters of pairs of pixels; equal pixels are a coloured blank, also in ASCII."""
    floor = styles.COLOUR_FLOOR
    codes = code(style(upper, lower), glyphs.upper_half)
    codes = np.where(upper == floor, code(style(lower, floor), glyphs.lower_half), codes)
    plain = np.where(upper == floor, floor, BLANK_INK)
    codes = np.where(upper == lower, code(style(plain, lower), glyphs.blank), codes)
    return np.asarray(codes, np.uint32)


def ground(upper: Colours, lower: Colours) -> Colours:
    """The background for text on pairs of pixels."""
    return np.where(lower == styles.COLOUR_FLOOR, upper, lower)


def draw_numbers(
    drawing: RobotDrawing,
    codes: Codes,
    fleet_size: int,
    which: NDArray[np.intp],
    places: tuple[NDArray[np.intp], NDArray[np.intp]],
    colours: tuple[Colours, Colours],
) -> None:
    """Write the numbers of robots, centred in their room, where they fit and leave a gap."""
    digits = len(str(max(fleet_size - 1, 0)))
    if digits >= drawing.width:
        return  # they would run into those of adjacent robots
    (starts, room), (upper, lower) = places, colours
    names = number_glyphs(drawing.glyphs, fleet_size, digits)[which]
    first = starts + (room - digits + 1) // 2
    for column in range(digits):
        here = np.flatnonzero((room >= digits) & (names[:, column] != drawing.glyphs.blank))
        place = first[here] + column
        bg = ground(upper[here, place], lower[here, place])
        codes[here, place] = code(style(styles.COLOUR_FLOOR, bg), names[here, column])


# Sprites.


class Sprites(NamedTuple):
    """Drawings for one size of a cell, by outline, load (0, 1) and direction."""

    upper: NDArray[np.uint8]  # (3, 2, 4, characters) content of upper pixels
    lower: NDArray[np.uint8]  # content of lower pixels
    sign: NDArray[np.intp]  # (3, 4) character of the sign
    number: NDArray[np.intp]  # (3, 4) first character of the number
    room: NDArray[np.intp]  # (3, 4) characters for the number
    bar: NDArray[np.intp]  # (3, 4) pixels of the bar


class _Box(NamedTuple):
    """Pixels x in [left, right), y in [top, bottom)."""

    left: int
    top: int
    right: int
    bottom: int


@lru_cache(maxsize=16)
def sprites(width: int, height: int, bar: bool) -> Sprites:
    """Robots in cells of width x height characters, with or without a battery bar."""
    upper = np.zeros((3, 2, 4, height * width), np.uint8)
    lower = np.zeros_like(upper)
    sign, number, room, bars = (np.zeros((3, 4), np.intp) for _ in range(4))
    for outline in (POINTED, FLAT, ROUND):
        for direction in range(4):
            way = NORTH if outline == ROUND else direction
            place = sign[outline, direction] = _sign(width, height, way)
            row, first, last = _number_row(width, height, way)
            first += row * width + first == place
            last -= row * width + last - 1 == place
            number[outline, direction], room[outline, direction] = row * width + first, last - first
            for load in (0, 1):
                pixels = _pixels(width, height, outline, way, bool(load), bar)
                upper[outline, load, direction] = pixels[0::2].reshape(-1)
                lower[outline, load, direction] = pixels[1::2].reshape(-1)
            bars[outline, direction] = np.count_nonzero(pixels >= BAR)
    return Sprites(upper, lower, sign, number, room, bars)


def _pixels(
    width: int, height: int, outline: int, direction: int, load: bool, bar: bool
) -> NDArray[np.uint8]:
    """(2 height, width) the content of each pixel."""
    pixels = np.zeros((2 * height, width), np.uint8)
    box = _body(width, height)
    pixels[box.top : box.bottom, box.left : box.right] = BODY
    if outline == POINTED:
        _point(pixels, direction)
    elif outline == ROUND:
        for x in (box.left, box.right - 1):
            pixels[[box.top, box.bottom - 1], x] = OUTSIDE
    if load:
        rows, columns = _load(width, height, direction)
        area = pixels[2 * rows.start : 2 * rows.stop, columns]
        area[area == BODY] = LOAD
    if bar and height >= BAR_HEIGHT:
        row = pixels[box.top if direction == SOUTH else box.bottom - 1]
        here = np.flatnonzero(row)
        row[here] = BAR + np.arange(len(here))
    return pixels


def _body(width: int, height: int) -> _Box:
    """The pixels of a robot without its point."""
    across = int(height >= MARGIN_HEIGHT - 1 and width > 4)
    down = int(height >= MARGIN_HEIGHT)
    return _Box(across, down, width - across, 2 * height - down)


def _columns(width: int, height: int) -> tuple[int, int]:
    """The columns [first, end) of the body."""
    box = _body(width, height)
    return box.left, box.right


def _point(pixels: NDArray[np.uint8], direction: int) -> None:
    """Cut the corners of the front; the point extends into the margin, if there is one."""
    turned = np.rot90(pixels, direction + 1)  # the front is at the top
    front = int(np.flatnonzero(turned.any(axis=1))[0])
    columns = np.flatnonzero(turned[front])
    left, right = int(columns[0]), int(columns[-1]) + 1
    deep = max(min((right - left) // 2 - 1, max(POINT, (right - left) // 4)), 0)
    if front:
        front -= 1
        turned[front, left:right] = BODY
    for row in range(deep):
        cut = deep - row
        turned[front + row, left : left + cut] = turned[front + row, right - cut : right] = OUTSIDE


def _number_row(width: int, height: int, direction: int) -> tuple[int, int, int]:
    """The row of the number, and its columns [first, end)."""
    first, last = _columns(width, height)
    if height == 2:
        ends = {EAST: (0, width - 1), WEST: (1, width)}
        return int(direction == NORTH), *ends.get(direction, (first, last))
    return height // 2 if direction == SOUTH else (height - 1) // 2, first, last


def _sign(width: int, height: int, direction: int) -> int:
    """The character of the sign."""
    row, first, last = _number_row(width, height, direction)
    middle = (width - 1) // 2
    if height == 2:
        column = {EAST: width - 2, WEST: 1}.get(direction, middle)
        return (0 if direction == NORTH else 1) * width + column
    if direction == EAST:
        return row * width + last - 1
    if direction == WEST:
        return row * width + first
    return (row + (1 if direction == SOUTH else -1)) * width + middle


def _load(width: int, height: int, direction: int) -> tuple[slice, slice]:
    """Rows and columns of the characters that show the load."""
    row, first, last = _number_row(width, height, direction)
    if height == 2:
        wide = max(width // 2, 1)
        if direction == EAST:
            return slice(1, 2), slice(0, wide)
        row = row if direction in (SOUTH, NORTH) else 1
        return slice(row, row + 1), slice(width - wide, width)
    high = (height - 1) // 2
    wide = max((last - first) * 2 // 3, 2)
    left = first + (last - first - wide) // 2
    rows = slice(row - high, row) if direction == SOUTH else slice(row + 1, row + 1 + high)
    return rows, slice(left, left + wide)
