"""Pictures in half blocks: two pixels in a character, each with a colour of its own.

A pixel is one cell on the step "half" of the ladder. The steps beyond are drawn so while a layer
colours the floor; a pixel is then as large as half a character of braille, so that switching the
layer on moves nothing. On a layer robots are dots, and between them its colour is still seen.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import KIND_MASK, LOOK_COUNT
from automaton.engine.state import NIL
from automaton.floor.cells import (
    BAY,
    CHARGER,
    DESTINATION,
    DOCK,
    FLOOR,
    STATION,
    TRACK,
    TURNTABLE,
    WALL,
)
from tui.render import robot_marks as fleet
from tui.render import styles
from tui.render.blocks import Part, blocks, part_of
from tui.render.braille_view import draw_over
from tui.render.camera import Camera, Rectangle
from tui.render.cell_looks import (
    FAR_LOAD,
    FAR_SHELF,
    KIND_COLOURS,
    STORING_KINDS,
    colour_of,
    look,
)
from tui.render.cell_view import heat_codes
from tui.render.glyphs import Codes, GlyphSet, code
from tui.render.scene import Floor, Scene
from tui.render.shelf_marks import full_shelves, pods_in
from tui.render.styles import style
from tui.render.tints import paint_tints, sign_tints
from tui.render.trails import goal_lines

Colours = NDArray[np.uint8]
# These show in a pixel of many cells, the last one first.
STATION_KINDS = (BAY, CHARGER, DESTINATION, DOCK, STATION)
DRIVEN = (FLOOR, TRACK, TURNTABLE)


HEATS = range(styles.COLOUR_HEAT_1, styles.COLOUR_HEAT_8 + 1)
LAYER_COLOURS = (*HEATS, *range(styles.COLOUR_ZONE_0, styles.COLOUR_ZONE_7 + 1))
# Colours of what stands on the floor, and the braille dots of its upper and lower half.
DOTTED = (
    *(FAR_SHELF, FAR_LOAD, styles.COLOUR_WALL, styles.COLOUR_BAY, styles.COLOUR_CHARGER),
    *(styles.COLOUR_DESTINATION, styles.COLOUR_DOCK, styles.COLOUR_STATION),
)
TOP_DOTS, BOTTOM_DOTS = 0x1B, 0xE4
TOP_PAIR, BOTTOM_PAIR = 0x11, 0x84  # of an empty shelf


def pixel_picture(scene: Scene, camera: Camera, glyphs: GlyphSet) -> Codes:
    """(rows, columns) the characters that show some of the floor."""
    part, k = part_of(camera), camera.zoom.across
    whole = floor_in_pixels(scene.floor, camera.shown, k)
    pixels = whole[2 * part.top : 2 * part.bottom, part.left : part.right].copy()
    canvas = Pixels(pixels, part, camera)
    if k == 1:
        for full in (full_shelves, pods_in):
            canvas.flat[full(scene, camera.visible())] = FAR_LOAD
    signed = draw_layer(canvas, scene)
    canvas.paint(scene.zone_cells, styles.COLOUR_MARKED)
    if scene.tints is not None or scene.values is not None:
        codes = paired(pixels, glyphs)
        if scene.tints is not None:
            codes = sign_tints(codes, pixels, thin=signed and glyphs.shaded)
        draw_over(codes, part, scene, camera, glyphs, grounds(pixels))
        return codes
    if scene.snapshot is not None:
        for cells in scene.shut_cells:
            canvas.paint(cells, styles.COLOUR_TURNTABLE)
        canvas.paint(scene.trails.reshape(-1), styles.COLOUR_TRAIL)
        canvas.paint(goal_lines(scene)[0], styles.COLOUR_GOAL_LINE)
        canvas.paint(np.asarray(scene.route, np.int32), styles.COLOUR_ROUTE)
        draw_robots(canvas, scene)
    if scene.cursor is not None:
        canvas.paint(np.array([scene.cursor], np.int32), styles.COLOUR_CURSOR)
    return paired(pixels, glyphs)


def paired(pixels: Colours, glyphs: GlyphSet) -> Codes:
    """(rows / 2, columns) the characters of these pixels."""
    upper, lower = pixels[0::2].astype(np.intp), pixels[1::2]
    codes: Codes = pairs(glyphs)[upper * len(styles.COLOURS) + lower]
    return codes


def grounds(pixels: Colours) -> Colours:
    """(rows / 2, columns) the background for what stands on a layer: of two heats the greater."""
    backgrounds = np.where(np.isin(pixels, LAYER_COLOURS), pixels, np.uint8(styles.COLOUR_FLOOR))
    return np.maximum(backgrounds[0::2], backgrounds[1::2])


@lru_cache(maxsize=3)
def pairs(glyphs: GlyphSet) -> Codes:
    """The character of each pair of colours, upper * colours + lower.

    What stands on the floor is dotted, what lies over it or moves is solid: that tells robots from
    shelves where there are no colours. Beside something solid the other half is plain floor.
    """
    colours, floor = len(styles.COLOURS), styles.COLOUR_FLOOR
    upper, lower = np.divmod(np.arange(colours * colours), colours)
    standing = np.isin(np.arange(colours), [floor, *DOTTED])
    top = np.where(standing[upper] & ~standing[lower], floor, upper)
    bottom = np.where(standing[lower] & ~standing[upper], floor, lower)
    codes = code(style(top, bottom), glyphs.upper_half)
    codes = np.where(top == floor, code(style(bottom, floor), glyphs.lower_half), codes)
    codes = np.where(top == bottom, code(style(top, floor), glyphs.full), codes)
    fg = np.maximum(upper, lower)  # the table of colours ends with what matters most
    pattern = _dots(TOP_DOTS, TOP_PAIR)[upper] | _dots(BOTTOM_DOTS, BOTTOM_PAIR)[lower]
    dotted = code(style(fg, floor), np.array(glyphs.braille)[pattern])
    codes = np.where(standing[upper] & standing[lower], dotted, codes).astype(np.uint32)
    return _shades(codes, upper, lower, glyphs) if glyphs.shaded else codes


def _shades(
    codes: Codes, upper: NDArray[np.intp], lower: NDArray[np.intp], glyphs: GlyphSet
) -> Codes:
    """Pairs of heat by the shade of the greater level, which stands for the whole character."""
    levels = [
        np.where(np.isin(half, list(HEATS)), half - styles.COLOUR_HEAT_0, 0)
        for half in (upper, lower)
    ]
    level = np.maximum(*levels)
    return np.where(level > 0, heat_codes(glyphs)[level], codes)


def _dots(full: int, pair: int) -> NDArray[np.uint8]:
    """(colours,) the dots of each colour that stands on the floor; fewer for an empty shelf."""
    dots = np.zeros(len(styles.COLOURS), np.uint8)
    dots[list(DOTTED)] = full
    dots[FAR_SHELF] = pair
    return dots


@lru_cache(maxsize=16)
def floor_in_pixels(floor: Floor, shown: Rectangle, k: int) -> Colours:
    """The whole floor without robots and loads, k x k cells in a pixel, whole characters."""
    rows, columns = slice(shown.top, shown.bottom), slice(shown.left, shown.right)
    kind = floor.floor_plan.kind[rows, columns]
    if k == 1:
        foregrounds = np.array([_pixel_colour(number) for number in range(LOOK_COUNT)], np.uint8)
        pixels = foregrounds[floor.looks[rows, columns]]
    else:
        area = blocks(np.ones(kind.shape, np.uint8), k)
        pixels = np.full(area.shape, styles.COLOUR_FLOOR, np.uint8)
        inner = floor.looks[rows, columns] == look(WALL)
        solid = np.isin(kind, STORING_KINDS) | inner
        pixels[2 * blocks(solid, k) >= area] = FAR_SHELF
        for station in STATION_KINDS:
            pixels[blocks(kind == station, k) > 0] = KIND_COLOURS[station]
    return np.pad(pixels, ((0, len(pixels) % 2), (0, 0)), constant_values=styles.COLOUR_FLOOR)


def _pixel_colour(number: int) -> int:
    """Floor and rails are dark: only what stands on the floor has a colour."""
    kind = number & KIND_MASK
    if kind in DRIVEN or kind not in KIND_COLOURS:
        return styles.COLOUR_FLOOR
    return FAR_SHELF if kind in STORING_KINDS else colour_of(number)


class Pixels:
    """The pixels on the screen, while they are painted."""

    def __init__(self, pixels: Colours, part: Part, camera: Camera) -> None:
        self.pixels, self.part, self.camera = pixels, part, camera
        self.k = camera.zoom.across
        self.flat = pixels.reshape(-1)

    def at(self, cells: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
        """Index of the pixel of those cells that are on the screen, and which of them they are."""
        y, x = np.divmod(cells, np.int32(self.camera.floor_plan.stride))
        shown, (rows, columns) = self.camera.shown, self.pixels.shape
        y = (y - shown.top) // self.k - 2 * self.part.top
        x = (x - shown.left) // self.k - self.part.left
        inside = (cells >= 0) & (y >= 0) & (y < rows) & (x >= 0) & (x < columns)
        which = np.flatnonzero(inside)
        return (y * columns + x)[which], which

    def paint(self, cells: NDArray[np.int32], fg: int) -> None:
        self.flat[self.at(cells)[0]] = fg

    def reduced(self, values: NDArray[Any], rest: int) -> NDArray[Any]:
        """(rows, columns of pixels) the largest value in each pixel, `rest` beyond the floor."""
        camera, part, k = self.camera, self.part, self.k
        top, left = camera.shown.top, camera.shown.left
        rows, columns = self.pixels.shape
        y, x = top + 2 * part.top * k, left + part.left * k
        values = values.reshape(camera.floor_plan.kind.shape)
        values = values[
            y : min(y + rows * k, camera.shown.bottom), x : min(x + columns * k, camera.shown.right)
        ]
        values = values if k == 1 else blocks(values, k, over=np.maximum)
        missing = rows - len(values)
        return np.pad(values, ((0, missing), (0, 0)), constant_values=rest)


def draw_layer(canvas: Pixels, scene: Scene) -> bool:
    """Heat, or zones; whether these have signs of their own."""
    if scene.tints is not None:
        paint_tints(canvas.pixels, canvas.reduced(scene.tints, NIL))
    elif scene.values is not None:
        levels = scene.levels(canvas.reduced(scene.values, 0))
        hot = levels > 0
        canvas.pixels[hot] = styles.COLOUR_HEAT_0 + levels[hot]
    return bool(scene.map_layer.paint_pixels(canvas, scene))


def draw_robots(canvas: Pixels, scene: Scene) -> None:
    """Each robot as a pixel in the colour of its state, of several in that of the worst."""
    seen = fleet.robots_of(scene)
    index, which = canvas.at(seen.cell)
    order = np.argsort(seen.state[which], kind="stable")
    canvas.flat[index[order]] = seen.colour[which[order]]
    chosen = np.asarray(scene.marked, np.int32)
    canvas.paint(seen.cell[chosen], styles.COLOUR_MARKED)
    if scene.selected != NIL:
        canvas.paint(seen.cell[[scene.selected]], styles.COLOUR_SELECTED)
