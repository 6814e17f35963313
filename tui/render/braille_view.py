"""Pictures in braille: k x k cells in each dot, 2 x 4 dots in a character.

A character has one colour. Where robots are, it shows them alone, in the colour of the worst: a few
robots fill their characters or a half of them, many are dots. Elsewhere it shows the structure of the
floor in faint colours: a dot of which half the cells are shelves or walls is set, and stations stand
out of what surrounds them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import DETAIL_OUTSIDE
from automaton.engine.state import NIL
from automaton.floor.cells import BAY, CHARGER, DESTINATION, DOCK, STATION, WALL
from tui.render import robot_marks as fleet
from tui.render import styles
from tui.render.blocks import Part, blocks, part_of
from tui.render.camera import Camera, Rectangle
from tui.render.cell_looks import FAR_SHELF, STORING_KINDS, look
from tui.render.glyphs import DOT_BITS, Codes, GlyphSet, code
from tui.render.scene import Floor, Scene
from tui.render.styles import style
from tui.render.trails import goal_lines

Backgrounds = int | NDArray[np.uint8]  # one for all characters of a part, or one for each
HALVES = np.array([0x1B, 0xE4], np.uint8)  # the dots of the upper and the lower half of a character
STATION_COLOURS = (
    (BAY, styles.COLOUR_BAY),
    (CHARGER, styles.COLOUR_CHARGER),
    (DESTINATION, styles.COLOUR_DESTINATION),
    (DOCK, styles.COLOUR_DOCK),
    (STATION, styles.COLOUR_STATION),
)


def far_picture(scene: Scene, camera: Camera, glyphs: GlyphSet) -> Codes:
    """(rows, columns) the characters that show some of the floor."""
    part = part_of(camera)
    base = floor_in_dots(scene.floor, camera.shown, camera.zoom.across // 2, glyphs)
    codes = base[part.top : part.bottom, part.left : part.right].copy()
    if scene.map_layer.arrows and scene.values is not None:
        draw_flow(codes, part, scene, scene.values, camera, glyphs)
    draw_dots(codes, part, camera, glyphs, scene.zone_cells, styles.COLOUR_MARKED)
    draw_over(codes, part, scene, camera, glyphs)
    return codes


def draw_over(
    codes: Codes,
    part: Part,
    scene: Scene,
    camera: Camera,
    glyphs: GlyphSet,
    backgrounds: Backgrounds = styles.COLOUR_FLOOR,
) -> None:
    """The route, the robots and the cursor, on these backgrounds."""
    if scene.snapshot is not None:
        draw_paths(codes, part, scene, camera, glyphs, backgrounds)
        route = np.asarray(scene.route, np.int32)
        draw_dots(codes, part, camera, glyphs, route, styles.COLOUR_ROUTE, backgrounds)
        draw_robots(codes, part, scene, camera, glyphs, backgrounds)
    if scene.cursor is not None:
        spots = Dots(np.array([scene.cursor], np.int32), part, camera).index
        codes.reshape(-1)[spots] = fleet.with_cursor(codes.reshape(-1)[spots])


@lru_cache(maxsize=16)
def floor_in_dots(floor: Floor, shown: Rectangle, k: int, glyphs: GlyphSet) -> Codes:
    """The whole floor without robots."""
    looks = floor.looks[shown.top : shown.bottom, shown.left : shown.right]
    kind = floor.floor_plan.kind[shown.top : shown.bottom, shown.left : shown.right]
    shelves = np.isin(kind, STORING_KINDS)
    walls = (kind == WALL) & (looks != look(WALL, DETAIL_OUTSIDE))
    area = blocks(np.ones(kind.shape, np.uint8), k)
    pattern = _patterns(2 * blocks(shelves | walls, k) >= area)
    across, down = 2 * k, 4 * k
    more_walls = blocks(walls, across, down) > blocks(shelves, across, down)
    fg = np.where(more_walls, styles.COLOUR_WALL, FAR_SHELF)
    for station, its_fg in STATION_COLOURS:
        dots = _patterns(blocks(kind == station, k) > 0)
        fg = np.where(dots, its_fg, fg)
        pattern = np.where(dots, dots, pattern)
    codes: Codes = code(style(fg, styles.COLOUR_FLOOR), np.array(glyphs.braille)[pattern])
    return np.asarray(codes, np.uint32)


def _patterns(dots: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The braille pattern of each 2 x 4 dots."""
    rows, columns = dots.shape
    padded = np.pad(dots, ((0, -rows % 4), (0, -columns % 2)))
    cells = padded.reshape(padded.shape[0] // 4, 4, padded.shape[1] // 2, 2)
    return np.asarray((cells * DOT_BITS[None, :, None, :]).sum(axis=(1, 3)), np.uint8)


class Dots:
    """Cells as characters of a part of the picture and dots in them."""

    def __init__(self, cells: NDArray[np.int32], part: Part, camera: Camera) -> None:
        y, x = np.divmod(cells, np.int32(camera.floor_plan.stride))
        y, x = y - camera.shown.top, x - camera.shown.left
        if camera.zoom.kind == "pixels":
            row, column, bit = (y >> 1) - part.top, x - part.left, HALVES[y & 1]
        else:
            k = camera.zoom.across // 2
            y, x = y // k, x // k
            row, column, bit = (y >> 2) - part.top, (x >> 1) - part.left, DOT_BITS[y & 3, x & 1]
        rows, columns = part.bottom - part.top, part.right - part.left
        inside = (cells >= 0) & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        self.which = np.flatnonzero(inside)
        self.index = (row * columns + column)[self.which]
        self.bit = bit[self.which]

    def patterns(self, size: int) -> NDArray[np.uint8]:
        """The pattern of the character of each of these cells."""
        pattern = np.zeros(size, np.uint8)
        np.bitwise_or.at(pattern, self.index, self.bit)
        found: NDArray[np.uint8] = pattern[self.index]
        return found


def draw_paths(
    codes: Codes,
    part: Part,
    scene: Scene,
    camera: Camera,
    glyphs: GlyphSet,
    backgrounds: Backgrounds = styles.COLOUR_FLOOR,
) -> None:
    """Trails of robots and lines to their goals."""
    trails, (cells, _) = scene.trails.reshape(-1), goal_lines(scene)
    draw_dots(codes, part, camera, glyphs, trails, styles.COLOUR_TRAIL, backgrounds)
    draw_dots(codes, part, camera, glyphs, cells, styles.COLOUR_GOAL_LINE, backgrounds)


def draw_robots(
    codes: Codes,
    part: Part,
    scene: Scene,
    camera: Camera,
    glyphs: GlyphSet,
    backgrounds: Backgrounds = styles.COLOUR_FLOOR,
) -> None:
    """The robots; marked ones and the selected one on backgrounds of their own."""
    seen = fleet.robots_of(scene)
    dots = Dots(seen.cell, part, camera)
    flat = codes.reshape(-1)
    order = np.argsort(seen.state[dots.which], kind="stable")  # the worst is written last
    colours = np.zeros(flat.size, np.uint32)
    colours[dots.index[order]] = seen.colour[dots.which[order]]
    on_layer = camera.zoom.kind == "pixels" or not isinstance(backgrounds, int)
    rows, columns = camera.size()
    mark = fleet.far_mark(len(seen.cell), rows * columns, on_layer)
    signs, solid = robot_signs(glyphs, dots.patterns(flat.size), mark)
    fg = colours[dots.index]
    plain = style(fg, _at(backgrounds, dots))
    flat[dots.index] = code(np.where(solid, style(styles.COLOUR_FLOOR, fg), plain), signs)
    for robots, bg in (
        (scene.marked, styles.COLOUR_MARKED),
        ((scene.selected,), styles.COLOUR_SELECTED),
    ):
        chosen = np.asarray(robots, np.int32)
        chosen = chosen[chosen != NIL]
        if chosen.size:
            spots = Dots(seen.cell[chosen], part, camera).index
            flat[spots] = styles.with_background(flat[spots], bg)


def robot_signs(
    glyphs: GlyphSet, patterns: NDArray[np.uint8], mark: int
) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
    """(k,) glyphs of characters with robots on these dots, and which are filled with their colour."""
    upper, lower = (patterns & half != 0 for half in HALVES)
    solid = np.full(patterns.shape, mark == fleet.MARK_FULL)
    if mark == fleet.MARK_DOT:
        return np.array(glyphs.fleet, np.uint32)[patterns], solid
    if mark == fleet.MARK_HALF:
        solid = upper & lower
    halves = np.where(upper, glyphs.fleet_half[0], glyphs.fleet_half[1])
    return np.where(solid, glyphs.fleet_full, halves).astype(np.uint32), solid


def draw_dots(
    codes: Codes,
    part: Part,
    camera: Camera,
    glyphs: GlyphSet,
    cells: NDArray[np.int32],
    fg: int,
    backgrounds: Backgrounds = styles.COLOUR_FLOOR,
) -> None:
    """Cells as dots of one colour; what else their characters showed gives way."""
    if not cells.size:
        return
    dots = Dots(cells, part, camera)
    flat = codes.reshape(-1)
    signs = np.array(glyphs.braille)[dots.patterns(flat.size)]
    flat[dots.index] = code(style(fg, _at(backgrounds, dots)), signs)


def _at(backgrounds: Backgrounds, dots: Dots) -> Backgrounds:
    """The backgrounds of these characters."""
    return backgrounds if isinstance(backgrounds, int) else backgrounds.reshape(-1)[dots.index]


def draw_flow(
    codes: Codes,
    part: Part,
    scene: Scene,
    strongest: NDArray[np.int32],
    camera: Camera,
    glyphs: GlyphSet,
) -> None:
    """An arrow for each character: where most robots of its cells went."""
    from tui.render.cell_view import flow_codes

    assert scene.snapshot is not None and scene.snapshot.flow is not None
    zoom, shown = camera.zoom, camera.shown
    values = np.column_stack([scene.snapshot.flow, strongest])
    rows = slice(shown.top + part.top * zoom.down, shown.top + part.bottom * zoom.down)
    columns = slice(shown.left + part.left * zoom.across, shown.left + part.right * zoom.across)
    values = values.reshape(*scene.floor.looks.shape, 5)[: shown.bottom, : shown.right][
        rows, columns
    ]
    moves = blocks(values[..., :4], zoom.across, zoom.down)
    levels = scene.levels(blocks(values[..., 4], zoom.across, zoom.down, np.maximum))
    here = levels > 0
    directions = moves[here].argmax(axis=1)
    codes[here] = flow_codes(glyphs)[levels[here], directions]
