"""The looks of cells, and the surfaces on which they are painted.

A cell of several rows is drawn in thin, faint lines, so that robots stand out: braille dots, 2 x 4
per character, on a grid of 2 width x 4 height dots. A cell of one row is a sign, and at smaller zooms
a block of dots or a pixel.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import (
    DETAIL_ONE_WAY,
    DETAIL_SHIFT,
    KIND_MASK,
    LOOK_COUNT,
    place_labels,
)
from automaton.floor.floor_plan import (
    ALONG_X,
    ALONG_Y,
    BAY,
    CHARGER,
    DESTINATION,
    DOCK,
    EXIT_EAST,
    EXIT_NORTH,
    EXIT_SOUTH,
    EXIT_WEST,
    FLOOR,
    RACK,
    SHELF,
    STATION,
    STORAGE,
    TRACK,
    TURNTABLE,
    WALL,
)
from tui.render import styles
from tui.render.camera import Camera, CellRectangle, PicturePart, dot_blocks
from tui.render.scene import (
    DETAIL_FULL_SHELF,
    DETAIL_PASSING,
    DETAIL_POD,
    DETAIL_UNLIMITED,
    HEAT_LEVELS,
    Scene,
    ShownFloor,
)
from tui.render.styles import ASCII, DOT_BITS, GLYPHS, Codes, GlyphSet, code, style

CELL_COLOURS = {  # by kind of cell
    WALL: styles.COLOUR_WALL,
    FLOOR: styles.COLOUR_FLOOR_MARK,
    TRACK: styles.COLOUR_TRACK,
    TURNTABLE: styles.COLOUR_TURNTABLE,
    SHELF: styles.COLOUR_SHELF,
    DESTINATION: styles.COLOUR_DESTINATION,
    CHARGER: styles.COLOUR_CHARGER,
    BAY: styles.COLOUR_BAY,
    RACK: styles.COLOUR_RACK,
    DOCK: styles.COLOUR_DOCK,
    STATION: styles.COLOUR_STATION,
    STORAGE: styles.COLOUR_FLOOR_MARK,
}

# At small zooms shelves and storage are blocks of dots like walls. They have the hue of loads, so that
# they differ from walls; it is faint, so that robots stand out.
STORING_KINDS = (SHELF, RACK, STORAGE)
FAR_SHELF = styles.COLOUR_FAR_SHELF
FAR_LOAD = styles.COLOUR_LOAD

DRIVEN = (FLOOR, TRACK, TURNTABLE)

SIGNLESS_KINDS: Final = (SHELF, RACK, STORAGE, BAY, TRACK, TURNTABLE)  # their outlines suffice

# The six colours that differ most under all three kinds of colour blindness, in both themes; the
# last is rarely needed.
TINTS: Final = (
    *(styles.COLOUR_ZONE_0, styles.COLOUR_ZONE_1, styles.COLOUR_ZONE_2),
    *(styles.COLOUR_ZONE_5, styles.COLOUR_ZONE_7, styles.COLOUR_ZONE_4),
)
TINT_CODES: Final = tuple(map(ord, "fghjkl"))  # by tint, without colours; no ASCII signs
TINT_COLOURS: Final = np.array(TINTS, np.uint32)
TINT_LETTERS: Final = np.array(TINT_CODES, np.uint32)
TRANSFER_COLOUR: Final = styles.COLOUR_TEXT  # of a station between two zones

FLOW_LEVELS = (0, 5, 5, 5, 5, 6, 6, 7, 8)  # of heat; the lowest would hide thin arrows

Dots = NDArray[np.bool_]  # (4 height, 2 width)
Cells = NDArray[np.int32]


# The characters of a cell of the empty floor, by look, for every size in characters.


def look(kind: int, detail: int = 0) -> int:
    """The number of a look."""
    return kind | detail << DETAIL_SHIFT


def colour_of(number: int) -> int:
    """The colour of a look."""
    kind, detail = number & KIND_MASK, number >> DETAIL_SHIFT
    if kind == SHELF and detail == DETAIL_FULL_SHELF:
        return styles.COLOUR_LOAD
    if kind == STORAGE and detail == DETAIL_POD:
        return styles.COLOUR_LOAD
    if kind == FLOOR and detail:
        return styles.COLOUR_FLOW
    return CELL_COLOURS[kind]


def sign_place(width: int, height: int) -> int:
    """The character of a cell that shows its sign, in reading order."""
    return 0 if height == 1 else (height - 1) // 2 * width + (width - 1) // 2


@lru_cache(maxsize=16)
def cell_codes(glyphs: GlyphSet, width: int, height: int = 1) -> NDArray[np.uint32]:
    """(LOOK_COUNT, height x width) codes. In a cell of one row, a robot replaces the sign."""
    table = np.zeros((LOOK_COUNT, height * width), np.uint32)
    for number in range(LOOK_COUNT):
        kind, detail = number & KIND_MASK, number >> DETAIL_SHIFT
        if kind not in CELL_COLOURS:
            continue  # a number without a kind
        first, rest = _characters(glyphs, kind, detail)
        fg = style(colour_of(number), styles.COLOUR_FLOOR)
        if height > 1:
            table[number] = code(fg, drawn_cell(glyphs, width, height, kind, detail, first, rest))
        else:
            table[number] = [code(fg, glyph) for glyph in [first] + [rest] * (width - 1)]
    return table


def _characters(glyphs: GlyphSet, kind: int, detail: int) -> tuple[int, int]:
    """The first character of a cell, and the filling of the others."""
    blank, line = glyphs.blank, glyphs.track[0]
    if kind == WALL:
        return glyphs.wall, glyphs.wall
    if kind == FLOOR:
        marks = {DETAIL_PASSING: glyphs.passing, DETAIL_UNLIMITED: glyphs.unlimited}
        marks |= {DETAIL_ONE_WAY + d: glyphs.one_way[d] for d in range(4)}
        return marks.get(detail, glyphs.floor), blank
    if kind == TRACK and not detail & ALONG_X:
        return glyphs.track[1], blank
    if kind in (TRACK, TURNTABLE):
        sign = glyphs.crossing if detail & ALONG_Y else line
        sign = glyphs.turntable if kind == TURNTABLE else sign
        return sign, line if detail & EXIT_EAST else blank
    if kind == SHELF:
        return glyphs.load if detail == DETAIL_FULL_SHELF else glyphs.shelf, blank
    if kind == STORAGE:
        return glyphs.pod if detail == DETAIL_POD else glyphs.storage, blank
    signs = {
        DESTINATION: glyphs.destination,
        CHARGER: glyphs.charger,
        BAY: glyphs.bay,
        RACK: glyphs.rack,
        DOCK: glyphs.dock,
        STATION: glyphs.station,
    }
    return signs[kind], blank


def drawn_cell(
    glyphs: GlyphSet, width: int, height: int, kind: int, detail: int, first: int, rest: int
) -> NDArray[np.uint32]:
    """(height x width) glyphs of a cell of several rows: an outline, and a sign where it fits."""
    if kind == WALL:
        return np.full(height * width, rest, np.uint32)
    if glyphs is ASCII and kind in STORING_KINDS:
        return filled(glyphs, width, height, first)
    frames = glyphs is not ASCII  # ASCII has no outlines
    cells = line_glyphs(glyphs, outline(kind, detail, width, height, frames))
    if kind not in SIGNLESS_KINDS or glyphs is ASCII or (kind == TURNTABLE and height > 2):
        cells[sign_place(width, height)] = first
    return cells


def filled(glyphs: GlyphSet, width: int, height: int, sign: int) -> NDArray[np.uint32]:
    """(height x width) a cell filled with its sign, except its edges."""
    cells = np.full((height, width), glyphs.blank, np.uint32)
    cells[: max(height - 1, 2), 1:-1] = sign
    return cells.reshape(-1)


# Outlines, as dots.


def outline(kind: int, detail: int, width: int, height: int, frames: bool = True) -> Dots:
    """The lines of a look, see `looks_of`; without frames only those of tracks."""
    dots = np.zeros((4 * height, 2 * width), bool)
    if kind in (TRACK, TURNTABLE):
        draw_exits(dots, detail, step=2)
    if not frames:
        return dots
    if kind == TURNTABLE:
        draw_ring(dots)
    elif kind in (SHELF, RACK):
        draw_box(dots)
    elif kind == STORAGE:
        draw_box(dots, step=2)
    elif kind == DESTINATION:
        draw_box(dots)
        dots[1, 2:-2] = False  # open above: loads go in
    elif kind in (BAY, CHARGER, DOCK, STATION):
        draw_corners(dots)
    if kind == RACK:
        dots[2:-2, dots.shape[1] // 2] = True
    if (kind == SHELF and detail == DETAIL_FULL_SHELF) or (
        kind == STORAGE and detail == DETAIL_POD
    ):
        fill(dots)
    return dots


def centre(dots: Dots) -> tuple[int, int]:
    """Row and column of the dot where ways through a cell meet, in the sign's character."""
    rows, columns = dots.shape
    return (rows // 4 - 1) // 2 * 4 + 2, (columns // 2 - 1) // 2 * 2 + 1


def draw_exits(dots: Dots, exits: int, step: int = 1) -> None:
    """Draw lines from the centre to some sides; with step 2 every second dot."""
    y, x = centre(dots)
    below, right = dots[y:, x], dots[y, x:]
    above, left = dots[y::-1, x], dots[y, x::-1]
    ways = ((EXIT_EAST, right), (EXIT_SOUTH, below), (EXIT_WEST, left), (EXIT_NORTH, above))
    for side, line in ways:
        if exits & side:
            line[::step] = True


def draw_box(dots: Dots, step: int = 1) -> None:
    """Draw a frame with a margin of one dot; with step 2 every second dot."""
    dots[1:-1:step, [1, -2]] = True
    dots[[1, -2], 1:-1:step] = True


def framed(glyphs: GlyphSet, width: int, height: int, fg: int) -> Codes:
    """(height x width) a frame of this colour."""
    dots = np.zeros((4 * height, 2 * width), bool)
    draw_box(dots)
    return code(style(fg, styles.COLOUR_FLOOR), line_glyphs(glyphs, dots))


def draw_corners(dots: Dots) -> None:
    """Draw the corners of such a frame."""
    rows, columns = dots.shape
    draw_box(dots)
    dots[rows // 4 + 1 : -rows // 4 - 1] = False
    dots[:, columns // 4 + 1 : -columns // 4 - 1] = False


def draw_ring(dots: Dots) -> None:
    """Draw a ring around the centre, and clear its inside."""
    y, x = centre(dots)
    rows, columns = np.indices(dots.shape)
    radius = min(y, x, dots.shape[0] - 1 - y, dots.shape[1] - 1 - x)
    distance = np.hypot(rows - y, columns - x)
    dots[distance < radius] = False
    dots[(distance > radius - 0.5) & (distance < radius + 0.5)] = True


def fill(dots: Dots) -> None:
    """Fill the inside of a frame, up to its sides if it is narrow."""
    side = 3 if dots.shape[1] > 6 else 2
    dots[3:-3, side:-side] = True


def line_glyphs(glyphs: GlyphSet, dots: Dots) -> NDArray[np.uint32]:
    """(height x width) the characters that show these dots."""
    rows, columns = dots.shape[0] // 4, dots.shape[1] // 2
    grid = dots.reshape(rows, 4, columns, 2)
    pattern = (grid * DOT_BITS[None, :, None, :]).sum(axis=(1, 3))
    lines = np.array([glyphs.blank, *glyphs.lines[1:]], np.uint32)
    cells: NDArray[np.uint32] = lines[pattern].reshape(-1)
    return cells


# Levels of a layer.


@lru_cache(maxsize=2)
def heat_codes(glyphs: GlyphSet) -> Codes:
    """(HEAT_LEVELS,) with equal foreground and background: shades show only without colours."""
    foregrounds = styles.COLOUR_HEAT_0 + np.arange(HEAT_LEVELS)
    return np.array(code(style(foregrounds, foregrounds), np.array(glyphs.ramp)), np.uint32)


@lru_cache(maxsize=2)
def flow_codes(glyphs: GlyphSet) -> Codes:
    """(HEAT_LEVELS, 4) arrows."""
    foregrounds = style(styles.COLOUR_HEAT_0 + np.array(FLOW_LEVELS), styles.COLOUR_FLOOR)
    return np.array(code(foregrounds[:, None], np.array(glyphs.arrow)[None, :]), np.uint32)


# Surfaces: the cells on the screen during painting.


@lru_cache(maxsize=8)
def empty_floor(
    floor: ShownFloor, seen: CellRectangle, width: int, height: int, glyphs: GlyphSet
) -> Codes:
    """(rows, columns, height x width) read-only; cached while the camera stays."""
    looks = floor.looks[seen.top : seen.bottom, seen.left : seen.right]
    codes = cell_codes(glyphs, width, height)[looks]
    stride = floor.floor_plan.stride
    for cell, (kind, names) in place_labels(floor.place_names, stride).items():
        y, x = divmod(cell, stride)
        if seen.top <= y < seen.bottom and seen.left <= x < seen.right:
            write_name(codes[y - seen.top, x - seen.left], kind, names, glyphs, width, height)
    return codes


def write_name(
    cell: Codes, kind: str, names: list[str], glyphs: GlyphSet, width: int, height: int
) -> None:
    """Write the first name that fits beside a place's sign or, in cells of three rows, below it."""
    at = sign_place(width, height)
    signs = {"door": glyphs.open_door, "lift": glyphs.lift, "closing": glyphs.closing}
    if kind in signs:
        cell[at] = code(style(styles.COLOUR_TURNTABLE, styles.COLOUR_FLOOR), signs[kind])
    room = width - 2 if height > 2 else width - 1 - at % width
    short = next((name for name in names if len(name) <= room), "")
    if short:
        at += width - 1 - len(short) // 2 if height > 2 else 0
        dim = style(styles.COLOUR_DIM, styles.COLOUR_FLOOR)
        cell[at + 1 : at + 1 + len(short)] = code(dim, np.array(styles.text(short)))


class Canvas:
    """A surface with characters for each cell: (rows, columns, characters of a cell) codes.

    The characters of a cell are in reading order. The sign is in the first one if a cell has one
    row, else in the middle.
    """

    def __init__(self, scene: Scene, camera: Camera, glyphs: GlyphSet) -> None:
        self.scene, self.glyphs = scene, glyphs
        self.seen = camera.visible()
        self.width, self.height = camera.zoom.width, camera.zoom.text_rows
        self.sign = sign_place(self.width, self.height)
        self.stride = camera.floor_plan.stride
        self.codes = empty_floor(scene.floor, self.seen, self.width, self.height, glyphs).copy()
        self.flat = self.codes.reshape(-1, self.height * self.width)

    def picture(self) -> Codes:
        """The painted characters, (rows, columns)."""
        rows, columns = self.codes.shape[:2]
        cells = self.codes.reshape(rows, columns, self.height, self.width)
        return cells.swapaxes(1, 2).reshape(rows * self.height, columns * self.width)

    def at(self, cells: Cells) -> tuple[Cells, NDArray[np.intp]]:
        """For the cells on the canvas: their indices into it, and their indices in `cells`."""
        y, x = np.divmod(cells, self.stride)
        y -= self.seen.top
        x -= self.seen.left
        rows, columns = self.codes.shape[:2]
        # As unsigned, negative numbers are large; NIL is in row -1.
        inside = (y.view(np.uint32) < rows) & (x.view(np.uint32) < columns)
        which = np.flatnonzero(inside)
        index: Cells = y[which] * columns + x[which]
        return index, which

    def cells(self, values: NDArray[Any]) -> NDArray[Any]:
        """The visible part of an array over all cells, (C,) or (C, n)."""
        seen = self.seen
        whole = values.reshape(*self.scene.floor.looks.shape, *values.shape[1:])
        return whole[seen.top : seen.bottom, seen.left : seen.right]

    def set_background(self, index: NDArray[Any], bg: int | NDArray[Any]) -> None:
        """Set the background of cells."""
        self.flat[index] = styles.with_background(self.flat[index], bg)

    def set_foreground(self, index: Cells, fg: int) -> None:
        """Set the colour of cells, on the plain background."""
        glyph = self.flat[index] & GLYPHS
        self.flat[index] = code(style(fg, styles.COLOUR_FLOOR), glyph)


class Pixels:
    """A surface of pixels, two per character, each one colour for its cells.

    Where a step enlarges pixels, here they are cells, to be enlarged later.
    """

    def __init__(self, pixels: NDArray[np.uint8], part: PicturePart, camera: Camera) -> None:
        self.pixels, self.part, self.camera = pixels, part, camera
        zoom = camera.zoom
        self.down, self.across = (2, 1) if zoom.is_enlarged else (zoom.down, zoom.across)
        self.flat = pixels.reshape(-1)

    def at(self, cells: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
        """For the cells on the screen: indices of their pixels, and their indices in `cells`."""
        y, x = np.divmod(cells, np.int32(self.camera.floor_plan.stride))
        shown, (rows, columns) = self.camera.shown, self.pixels.shape
        y = (y - shown.top) * 2 // self.down - 2 * self.part.top
        x = (x - shown.left) // self.across - self.part.left
        inside = (cells >= 0) & (y >= 0) & (y < rows) & (x >= 0) & (x < columns)
        which = np.flatnonzero(inside)
        return (y * columns + x)[which], which

    def paint(self, cells: NDArray[np.int32], fg: int) -> None:
        self.flat[self.at(cells)[0]] = fg

    def reduced(self, values: NDArray[Any], rest: int) -> NDArray[Any]:
        """(rows, columns of pixels) the largest value in each pixel, `rest` beyond the floor."""
        camera, part = self.camera, self.part
        rows, columns = self.pixels.shape
        y, x = camera.shown.top + part.top * self.down, camera.shown.left + part.left * self.across
        bottom, right = y + rows // 2 * self.down, x + columns * self.across
        values = values.reshape(camera.floor_plan.kind.shape)
        values = values[y : min(bottom, camera.shown.bottom), x : min(right, camera.shown.right)]
        if self.across > 1:
            values = dot_blocks(values, camera.zoom, (2, 1), over=np.maximum)
        missing = rows - len(values)
        return np.pad(values, ((0, missing), (0, 0)), constant_values=rest)
