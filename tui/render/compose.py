"""The picture of a scene seen by a camera: one code for each character of the screen.

tui.render.cell_view draws pictures with one or more characters per cell. Pictures with several cells
per character are here.

Half blocks: two pixels per character, each with its own colour. At the step "half" of the ladder, a
pixel is one cell; at "1.5x0.75" a cell is one or two pixels wide and high. Smaller steps use half
blocks while a layer colours the floor; a pixel then covers half a character, so that switching the
layer on moves nothing. On a layer robots are dots, with the layer's colour between them.

Braille: k x k cells per dot and 2 x 4 dots per character, which has one colour. A character with
robots shows only these, in the colour of the worst: few robots fill whole or half characters, many
are dots. Other characters show the structure of the floor in faint colours: a dot is set if at least
half of its cells are shelves or walls (all of them at the edge of a block), and stations stand out
from their surroundings. At "quadrants" the dots of robots are quarters of a character.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import DETAIL_INSIDE, KIND_MASK, LOOK_COUNT, beside
from automaton.engine.state import NIL
from automaton.floor.floor_plan import BAY, CHARGER, DESTINATION, DOCK, STATION, WALL
from tui.render import drawn_robots as fleet
from tui.render import styles
from tui.render.camera import (
    CHARACTER_DOTS,
    Camera,
    CellRectangle,
    PicturePart,
    Zoom,
    blocks,
    dot_blocks,
    middle_cell,
    part_of,
    shown_rectangle,
)
from tui.render.cell_looks import (
    CELL_COLOURS,
    DRIVEN,
    FAR_LOAD,
    FAR_SHELF,
    STORING_KINDS,
    Pixels,
    colour_of,
    flow_codes,
    heat_codes,
    look,
)
from tui.render.cell_view import (
    full_shelves,
    goal_lines,
    near_picture,
    paint_tints,
    pods_in,
    sign_tints,
)
from tui.render.scene import NO_CELLS, Scene, ShownFloor
from tui.render.styles import DOT_BITS, GLYPH_BITS, GLYPHS, Codes, GlyphSet, code, style

Colours = NDArray[np.uint8]  # by pixel, or by character

# Kinds that win in a pixel or dot of many cells, the last one over the others.
STATION_KINDS = (BAY, CHARGER, DESTINATION, DOCK, STATION)

HEATS = range(styles.COLOUR_HEAT_1, styles.COLOUR_HEAT_8 + 1)
LAYER_COLOURS = (*HEATS, *range(styles.COLOUR_ZONE_0, styles.COLOUR_ZONE_7 + 1))
GROUND_COLOURS = (styles.COLOUR_FLOOR, *LAYER_COLOURS)

# Colours of objects standing on the floor, and the braille dots of their upper and lower half.
DOTTED = (
    *(FAR_SHELF, FAR_LOAD, styles.COLOUR_WALL, styles.COLOUR_BAY, styles.COLOUR_CHARGER),
    *(styles.COLOUR_DESTINATION, styles.COLOUR_DOCK, styles.COLOUR_STATION),
)
TOP_DOTS, BOTTOM_DOTS = 0x1B, 0xE4
TOP_PAIR, BOTTOM_PAIR = 0x11, 0x84  # for an empty shelf

HALVES = np.array([0x1B, 0xE4], np.uint8)  # the dots of the upper and the lower half of a character

# Robots whose signs are not underlined.
SIGN_STYLED = tuple({*styles.ROBOT_COLOURS} - {styles.COLOUR_WAITING, styles.COLOUR_FAULT})

BLANK: Final = np.uint32(0xFFFFFFFF)  # no code: outside the frame


def compose(scene: Scene, camera: Camera, glyphs: GlyphSet, out: Codes | None = None) -> Codes:
    """(camera.rows, camera.columns) codes; `out` is overwritten and returned if given."""
    if out is None or out.shape != (camera.rows, camera.columns):
        out = np.empty((camera.rows, camera.columns), np.uint32)
    kind, top, left = camera.zoom.kind, max(-camera.top, 0), max(-camera.left, 0)
    if kind == "cells":
        part, zoom = near_picture(scene, camera, glyphs), camera.zoom
        if zoom.down > 1:
            part = with_half_rows(part, glyphs)
        above = camera.top % zoom.height if camera.top > 0 else 0  # rows cut off
        before = camera.left % zoom.width if camera.left > 0 else 0  # columns cut off
        part = part[above : above + camera.rows, before : before + camera.columns]
    elif kind == "pixels" or scene.shaded:
        part = pixel_picture(scene, camera, glyphs)
    else:
        part = far_picture(scene, camera, glyphs)
    rows = min(part.shape[0], camera.rows - top)
    columns = min(part.shape[1], camera.columns - left)
    if (rows, columns) != out.shape:
        out[:] = code(style(styles.COLOUR_VOID, styles.COLOUR_VOID), glyphs.blank)
    out[top : top + rows, left : left + columns] = part[:rows, :columns]
    write_levels(out, scene.floor, camera)
    for number, cell in enumerate(scene.slow_places, 1):
        if (place := camera.place_of(cell)) is not None:
            mark = style(styles.COLOUR_FLOOR, styles.COLOUR_MARKED)
            out[place] = code(mark, glyphs.digits[number])
    return out


def write_levels(out: Codes, floor: ShownFloor, camera: Camera) -> None:
    """Write the names of levels above the floor, where there is a blank row."""
    for name, cell in floor.levels if camera.top < 0 else ():
        place = camera.place_of(cell)
        if place is not None and place[0]:
            words = np.array(styles.text(name)[: camera.columns - place[1]], np.uint32)
            dim = style(styles.COLOUR_DIM, styles.COLOUR_VOID)
            out[-camera.top - 1, place[1] : place[1] + len(words)] = code(dim, words)


def with_half_rows(rows: Codes, glyphs: GlyphSet) -> Codes:
    """Rows of cells, 1.5 rows of characters each: between two of them both share a row."""
    if len(rows) % 2:
        rest = code(style(styles.COLOUR_FLOOR, styles.COLOUR_FLOOR), glyphs.blank)
        rows = np.vstack((rows, np.full_like(rows[:1], rest)))
    pairs = rows.reshape(-1, 2, rows.shape[1])
    grounds = (pairs >> np.uint32(GLYPH_BITS)) % np.uint32(len(styles.COLOUR_TABLE))
    shared = fleet.paired(glyphs, grounds[:, 0], grounds[:, 1])
    low, high = np.minimum(grounds[:, 0], grounds[:, 1]), np.maximum(grounds[:, 0], grounds[:, 1])
    two = (low > styles.COLOUR_FLOOR) & (low < high)
    # One style for two colours, whichever is above.
    signs = np.where(grounds[:, 0] < grounds[:, 1], glyphs.upper_half, glyphs.lower_half)
    shared = np.where(two, code(style(low, high), signs), shared)
    if not glyphs.shaded:  # the style of the robot's sign, which costs no bytes
        for beside, body, sign in ((1, 0, glyphs.lower_half), (0, 1, glyphs.upper_half)):
            inked = np.isin(grounds[:, body], SIGN_STYLED if body else list(styles.ROBOT_COLOURS))
            inked &= grounds[:, beside] == styles.COLOUR_FLOOR
            cut_out = code(style(styles.COLOUR_FLOOR, grounds[:, body]), sign)
            shared = np.where(inked, cut_out, shared)
    walls = pairs & GLYPHS == glyphs.wall
    dots = walls[:, 0] * HALVES[0] | walls[:, 1] * HALVES[1]
    half = code(style(styles.COLOUR_WALL, styles.COLOUR_FLOOR), np.array(glyphs.braille)[dots])
    shared = np.where((dots > 0) & (grounds == styles.COLOUR_FLOOR).all(axis=1), half, shared)
    shared = np.where(walls.all(axis=1), pairs[:, 0], shared)
    return np.stack((pairs[:, 0], shared, pairs[:, 1]), axis=1).reshape(-1, rows.shape[1])


# Pictures in braille.


def far_picture(scene: Scene, camera: Camera, glyphs: GlyphSet) -> Codes:
    """(rows, columns) the visible characters of the floor in braille."""
    part = part_of(camera)
    base = floor_in_dots(scene.floor, camera.shown, camera.zoom, glyphs)
    canvas = DotCanvas(
        base[part.top : part.bottom, part.left : part.right].copy(), part, camera, glyphs
    )
    if scene.map_layer.arrows and scene.values is not None:
        draw_flow(canvas, scene, scene.values)
    if (signs := layer_signs(scene, camera, glyphs)) is not None:
        canvas.codes[:] = np.where(signs, signs, canvas.codes)
    canvas.draw(scene.zone_cells, styles.COLOUR_MARKED)
    draw_over(canvas, scene)
    return canvas.codes


@lru_cache(maxsize=16)
def floor_in_dots(floor: ShownFloor, shown: CellRectangle, zoom: Zoom, glyphs: GlyphSet) -> Codes:
    """The whole floor without robots."""
    kind = floor.floor_plan.kind[shown.top : shown.bottom, shown.left : shown.right]
    shelves = np.isin(kind, STORING_KINDS)
    walls = kind == WALL
    pattern = _patterns(standing_dots(floor, shown, zoom, CHARACTER_DOTS[zoom.kind]), zoom)
    across, down = zoom.across, zoom.down
    more_walls = blocks(walls, across, down) > blocks(shelves, across, down)
    fg = np.where(more_walls, styles.COLOUR_WALL, FAR_SHELF)
    for station in STATION_KINDS:
        dots = _patterns(dot_blocks(kind == station, zoom) > 0, zoom)
        fg = np.where(dots, CELL_COLOURS[station], fg)
        pattern = np.where(dots, dots, pattern)
    codes: Codes = code(style(fg, styles.COLOUR_FLOOR), np.array(glyphs.braille)[pattern])
    return np.asarray(codes, np.uint32)


def standing_dots(
    floor: ShownFloor, shown: CellRectangle, zoom: Zoom, dots: tuple[int, int]
) -> NDArray[np.bool_]:
    """The dots that show shelves and walls, `dots` rows and columns of them in a character.

    Half of a dot's cells suffice; of walls around blocks, all, so that narrow aisles remain visible.
    """
    inside = floor.looks == look(WALL, DETAIL_INSIDE)
    kind, in_blocks = (
        cells[shown.top : shown.bottom, shown.left : shown.right]
        for cells in (floor.floor_plan.kind, beside(inside))
    )
    standing = np.isin(kind, (*STORING_KINDS, WALL))
    area = dot_blocks(np.ones(kind.shape, np.uint8), zoom, dots)
    half = 2 * dot_blocks(standing & ~in_blocks, zoom, dots) >= area
    return np.asarray(half | (dot_blocks(standing, zoom, dots) == area))


def bits_of(zoom: Zoom) -> NDArray[np.uint8]:
    """By row and column of a dot: its bits in a pattern of braille."""
    rows, columns = CHARACTER_DOTS[zoom.kind]
    bits = DOT_BITS.reshape(rows, 4 // rows, columns, 2 // columns)
    return np.asarray(bits.sum(axis=(1, 3)), np.uint8)


def _patterns(dots: NDArray[np.bool_], zoom: Zoom) -> NDArray[np.uint8]:
    """The braille pattern of the dots of each character."""
    high, wide = CHARACTER_DOTS[zoom.kind]
    rows, columns = dots.shape
    padded = np.pad(dots, ((0, -rows % high), (0, -columns % wide)))
    cells = padded.reshape(padded.shape[0] // high, high, padded.shape[1] // wide, wide)
    return np.asarray((cells * bits_of(zoom)[None, :, None, :]).sum(axis=(1, 3)), np.uint8)


class DotCanvas:
    """A surface of characters with many cells each."""

    def __init__(
        self,
        codes: Codes,
        part: PicturePart,
        camera: Camera,
        glyphs: GlyphSet,
        backgrounds: Colours | None = None,
    ) -> None:
        """`backgrounds`: one per character if a layer is shown; None: the plain floor."""
        self.codes, self.part, self.camera, self.glyphs = codes, part, camera, glyphs
        self.flat = codes.reshape(-1)
        self.on_layer = backgrounds is not None
        plain = np.full(self.flat.size, styles.COLOUR_FLOOR, np.uint8)
        self.backgrounds = plain if backgrounds is None else backgrounds.reshape(-1)

    def dots(self, cells: NDArray[np.int32]) -> Dots:
        """The places of cells on the canvas."""
        return Dots(cells, self.part, self.camera)

    def draw(self, cells: NDArray[np.int32], fg: int) -> None:
        """Draw cells as dots of one colour, in place of what their characters showed."""
        if not cells.size:
            return
        dots = self.dots(cells)
        signs = np.array(self.glyphs.braille)[dots.patterns(self.flat.size)]
        self.flat[dots.index] = code(style(fg, self.backgrounds[dots.index]), signs)


class Dots:
    """Cells as characters in a part of the picture, and dots in these."""

    def __init__(self, cells: NDArray[np.int32], part: PicturePart, camera: Camera) -> None:
        y, x = np.divmod(cells, np.int32(camera.floor_plan.stride))
        y, x = y - camera.shown.top, x - camera.shown.left
        zoom, (high, wide) = camera.zoom, CHARACTER_DOTS[camera.zoom.kind]
        row, y = np.divmod(y * high // zoom.down, high)
        column, x = np.divmod(x * wide // zoom.across, wide)
        row, column, bit = row - part.top, column - part.left, bits_of(zoom)[y, x]
        rows, columns = part.bottom - part.top, part.right - part.left
        inside = (cells >= 0) & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        self.which = np.flatnonzero(inside)
        self.index = (row * columns + column)[self.which]
        self.bit = bit[self.which]

    def patterns(self, size: int) -> NDArray[np.uint8]:
        """For each cell the pattern of its character, with the dots of all these cells."""
        pattern = np.zeros(size, np.uint8)
        np.bitwise_or.at(pattern, self.index, self.bit)
        found: NDArray[np.uint8] = pattern[self.index]
        return found


def draw_over(canvas: DotCanvas, scene: Scene) -> None:
    """Draw trails, lines to goals, ghosts, the route, robots and the cursor."""
    if scene.snapshot is not None:
        canvas.draw(scene.trails.reshape(-1), styles.COLOUR_TRAIL)
        canvas.draw(goal_lines(scene)[0], styles.COLOUR_GOAL_LINE)
        canvas.draw(scene.ghosts, styles.COLOUR_DIM)
        canvas.draw(np.asarray(scene.route, np.int32), styles.COLOUR_ROUTE)
        draw_robots(canvas, scene)
    if scene.cursor is not None:
        spots = canvas.dots(np.array([scene.cursor], np.int32)).index
        canvas.flat[spots] = fleet.with_cursor(canvas.flat[spots])


def draw_robots(canvas: DotCanvas, scene: Scene) -> None:
    """Draw robots; marked and selected ones in their colours on that of the mark."""
    drawn, flat = fleet.robots_of(scene), canvas.flat
    dots = canvas.dots(drawn.cell)
    order = np.argsort(drawn.state[dots.which], kind="stable")  # the last one wins: the worst
    colours = np.zeros(flat.size, np.uint32)
    colours[dots.index[order]] = drawn.colour[dots.which[order]]
    on_layer = canvas.camera.zoom.kind == "pixels" or canvas.on_layer
    rows, columns = canvas.camera.size()
    mark = fleet.far_mark(len(drawn.cell), rows * columns, on_layer)
    quarters = canvas.camera.zoom.kind == "quarters" and not canvas.on_layer
    signs, solid = robot_signs(canvas.glyphs, dots.patterns(flat.size), mark, quarters)
    fg = colours[dots.index]
    plain = style(fg, canvas.backgrounds[dots.index])
    flat[dots.index] = code(np.where(solid, style(styles.COLOUR_FLOOR, fg), plain), signs)
    marks = np.zeros(flat.size, np.uint32)
    np.maximum.at(marks, dots.index, fleet.marks_of(scene, len(drawn.cell))[dots.which])
    spots = np.flatnonzero(marks)
    full = flat[spots] & GLYPHS == canvas.glyphs.fleet_full
    sign = np.where(full, canvas.glyphs.fleet_half[0], flat[spots] & GLYPHS)
    flat[spots] = code(style(colours[spots], marks[spots]), sign)


def robot_signs(
    glyphs: GlyphSet, patterns: NDArray[np.uint8], mark: int, quarters: bool = False
) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
    """(k,) glyphs of characters with robots on these dots, and whether robots fill them."""
    upper, lower = (patterns & half != 0 for half in HALVES)
    solid = np.full(patterns.shape, mark == fleet.MARK_FULL)
    if mark == fleet.MARK_DOT:
        dots = glyphs.fleet_quarters if quarters else glyphs.fleet
        return np.array(dots, np.uint32)[patterns], solid
    if mark == fleet.MARK_HALF:
        solid = upper & lower
    halves = np.where(upper, glyphs.fleet_half[0], glyphs.fleet_half[1])
    return np.where(solid, glyphs.fleet_full, halves).astype(np.uint32), solid


def draw_flow(canvas: DotCanvas, scene: Scene, strongest: NDArray[np.int32]) -> None:
    """Draw an arrow per character, in the direction of most moves out of its cells."""
    assert scene.snapshot is not None and scene.snapshot.flow is not None
    zoom, shown, part = canvas.camera.zoom, canvas.camera.shown, canvas.part
    values = np.column_stack([scene.snapshot.flow, strongest])
    rows = slice(shown.top + part.top * zoom.down, shown.top + part.bottom * zoom.down)
    columns = slice(shown.left + part.left * zoom.across, shown.left + part.right * zoom.across)
    values = values.reshape(*scene.floor.looks.shape, 5)[: shown.bottom, : shown.right]
    values = values[rows, columns]
    moves = blocks(values[..., :4], zoom.across, zoom.down)
    levels = scene.levels(blocks(values[..., 4], zoom.across, zoom.down, np.maximum))
    here = levels > 0
    directions = moves[here].argmax(axis=1)
    canvas.codes[here] = flow_codes(canvas.glyphs)[levels[here], directions]


def layer_signs(scene: Scene, camera: Camera, glyphs: GlyphSet) -> Codes | None:
    """The layer's own signs for the characters of the part on the screen."""
    zoom, part = camera.zoom, part_of(camera)
    across, down = (1, 1) if zoom.is_enlarged else (zoom.across, zoom.down)
    signs: Codes | None = scene.map_layer.signs(scene, camera.shown, across, down, glyphs)
    if signs is None:
        return None
    if zoom.is_enlarged:
        rows, columns = np.arange(part.top, part.bottom), np.arange(part.left, part.right)
        y = middle_cell(rows, zoom.down, zoom.height)
        x = middle_cell(columns, zoom.across, zoom.width)
        most = np.array(signs.shape) - 1  # the last character may extend beyond the last cell
        return np.asarray(signs[np.ix_(np.minimum(y, most[0]), np.minimum(x, most[1]))])
    return signs[part.top : part.bottom, part.left : part.right]


# Robots and other contents of one cell alone, for a legend.


def robot_pictures(
    scene: Scene, zoom: Zoom, glyphs: GlyphSet, robots: fleet.DrawnRobots, mark: int = 0
) -> Codes:
    """(k, rows, columns) each of these robots as drawn without a number in the floor's first cell.

    Where two cells share a row, it is left to `cell_picture`.
    mark: the colour that marks them, or 0.
    """
    count = len(robots.cell)
    if zoom.kind == "cells":
        size = glyphs, zoom.width, zoom.text_rows
        drawing = fleet.RobotDrawing(*size, scene.floor.battery, numbered=False)
        marks = np.full(count, mark, np.uint32)
        codes = fleet.robot_codes(drawing, robots, np.arange(count), marks)
        shape = count, zoom.text_rows, zoom.width
        return codes.reshape(shape)
    if paints_pixels(scene, zoom):
        halves = np.array([robots.colour, np.full(count, mark or styles.COLOUR_FLOOR)], np.uint8)
        return paired(halves, glyphs).reshape(count, 1, 1)
    shown = shown_rectangle(scene.floor.floor_plan)
    rows, columns = zoom.size((shown.bottom - shown.top, shown.right - shown.left))
    fleet_size = 0 if scene.snapshot is None else len(scene.snapshot.robots.cell)
    on_layer = zoom.kind == "pixels" or scene.shaded
    filled = fleet.far_mark(fleet_size, rows * columns, on_layer)
    quarters = zoom.kind == "quarters" and not on_layer
    sign, solid = robot_signs(glyphs, bits_of(zoom)[:1, 0], filled, quarters)
    if mark:
        sign = np.where(sign == glyphs.fleet_full, glyphs.fleet_half[0], sign)
        styled = style(robots.colour, mark)
    else:
        over = style(styles.COLOUR_FLOOR, robots.colour)
        styled = np.where(solid, over, style(robots.colour, styles.COLOUR_FLOOR))
    return code(styled, sign).reshape(count, 1, 1)


def far_sign(scene: Scene, zoom: Zoom, glyphs: GlyphSet, fg: int, stands: bool = False) -> int:
    """The code of something of this colour in the first cell, if it `stands` in the whole character."""
    floor = styles.COLOUR_FLOOR
    if paints_pixels(scene, zoom) or (stands and scene.shaded):
        return int(pairs(glyphs)[fg * len(styles.COLOUR_TABLE) + (fg if stands else floor)])
    dots = 255 if stands else int(bits_of(zoom)[0, 0])
    return int(code(style(fg, floor), glyphs.braille[dots]))


def paints_pixels(scene: Scene, zoom: Zoom) -> bool:
    """Whether robots and overlays are pixels: on a layer, they are dots unless pixels are enlarged."""
    layered = scene.tints is not None or scene.values is not None
    return zoom.is_enlarged or (zoom.kind == "pixels" and not layered)


def cell_picture(codes: Codes, zoom: Zoom, glyphs: GlyphSet) -> Codes:
    """A cell (rows, columns) as shown at a zoom, without blank rows above and below it."""
    if zoom.down > 1:
        codes = with_half_rows(codes, glyphs)[:2]
    grounds = (codes >> np.uint32(GLYPH_BITS)) % np.uint32(len(styles.COLOUR_TABLE))
    blank = (codes & GLYPHS == glyphs.blank) & (grounds == styles.COLOUR_FLOOR)
    rows = np.flatnonzero(~blank.all(axis=1))
    return codes[rows[0] : rows[-1] + 1] if len(rows) else codes[:1]


# Pictures in half blocks.


def pixel_picture(scene: Scene, camera: Camera, glyphs: GlyphSet) -> Codes:
    """(rows, columns) the visible characters of the floor in half blocks."""
    zoom, part = camera.zoom, part_of(camera)
    if zoom.is_enlarged:
        part = cells_of(part, camera)
    by_cell = zoom.is_enlarged or zoom.across == 1
    whole = floor_in_pixels(scene.floor, camera.shown, None if by_cell else zoom)
    pixels = whole[2 * part.top : 2 * part.bottom, part.left : part.right].copy()
    canvas = Pixels(pixels, part, camera)
    if by_cell:
        for full in (full_shelves, pods_in):
            canvas.flat[full(scene, camera.visible())] = FAR_LOAD
    signed = draw_layer(canvas, scene)
    canvas.paint(scene.zone_cells, styles.COLOUR_MARKED)
    signs = layer_signs(scene, camera, glyphs)
    layered = scene.tints is not None or scene.values is not None or signs is not None
    if layered and not zoom.is_enlarged:
        codes = paired(pixels, glyphs)
        if signs is not None:
            codes = np.where(signs, signs, codes)
        if scene.tints is not None:
            codes = sign_tints(codes, pixels, thin=signed and glyphs.shaded)
        draw_over(DotCanvas(codes, part, camera, glyphs, grounds(pixels)), scene)
        return codes
    if scene.snapshot is not None:
        for cells in scene.shut_cells:
            canvas.paint(cells, styles.COLOUR_TURNTABLE)
        canvas.paint(scene.trails.reshape(-1), styles.COLOUR_TRAIL)
        canvas.paint(goal_lines(scene)[0], styles.COLOUR_GOAL_LINE)
        canvas.paint(scene.ghosts, styles.COLOUR_DIM)
        canvas.paint(np.asarray(scene.route, np.int32), styles.COLOUR_ROUTE)
        draw_robot_pixels(canvas, scene)
    if scene.cursor is not None:
        canvas.paint(np.array([scene.cursor], np.int32), styles.COLOUR_CURSOR)
    if not zoom.is_enlarged:
        return paired(pixels, glyphs)
    pixels = enlarged(pixels, camera)
    codes = paired(pixels, glyphs)
    if signs is not None:
        empty = np.isin(pixels, GROUND_COLOURS)
        codes = np.where((signs != 0) & empty[0::2] & empty[1::2], signs, codes)
    return sign_tints(codes, pixels) if scene.tints is not None else codes


def cells_of(part: PicturePart, camera: Camera) -> PicturePart:
    """The cells in part of an enlarged picture, as characters of the step "half"."""
    zoom, visible, shown = camera.zoom, camera.visible(), camera.shown
    bottom = min(-(-part.bottom * zoom.down // zoom.height), camera.height)
    top, left = (visible.top - shown.top) // 2, visible.left - shown.left
    return PicturePart(top, left, -(-bottom // 2), visible.right - shown.left)


def enlarged(pixels: Colours, camera: Camera) -> Colours:
    """Pixels of cells, repeated so that they fill their characters."""
    zoom, part = camera.zoom, part_of(camera)
    rows, columns = 2 * (part.bottom - part.top), part.right - part.left
    y = middle_cell(np.arange(rows), zoom.down, 2 * zoom.height)
    x = middle_cell(np.arange(columns), zoom.across, zoom.width)
    below = np.pad(pixels, ((0, 2), (0, 1)), constant_values=styles.COLOUR_FLOOR)
    return below[np.ix_(np.minimum(y, len(pixels)), np.minimum(x, pixels.shape[1]))]


def draw_layer(canvas: Pixels, scene: Scene) -> bool:
    """Paint heat or zones; returns whether the layer draws its own signs."""
    if scene.tints is not None:
        paint_tints(canvas.pixels, canvas.reduced(scene.tints, NIL))
    elif scene.values is not None:
        levels = scene.levels(canvas.reduced(scene.values, 0))
        hot = levels > 0
        canvas.pixels[hot] = styles.COLOUR_HEAT_0 + levels[hot]
    return bool(scene.map_layer.paint_pixels(canvas, scene))


def draw_robot_pixels(canvas: Pixels, scene: Scene) -> None:
    """Paint robots as pixels in the colour of their state, the worst if several share one.

    A mark is beside the robot, in the other half of its character: that of a selected robot always,
    others unless a robot is there.
    """
    drawn = fleet.robots_of(scene)
    index, which = canvas.at(drawn.cell)
    order = np.argsort(drawn.state[which], kind="stable")
    canvas.flat[index[order]] = drawn.colour[which[order]]
    marks = fleet.marks_of(scene, len(drawn.cell))[which]
    columns = canvas.pixels.shape[1]
    beside = np.where(index // columns % 2, index - columns, index + columns)
    shown = (marks > 0) & ((marks == styles.COLOUR_SELECTED) | ~np.isin(beside, index))
    canvas.flat[beside[shown]] = marks[shown]


@lru_cache(maxsize=16)
def floor_in_pixels(floor: ShownFloor, shown: CellRectangle, zoom: Zoom | None) -> Colours:
    """The whole floor without robots and loads, in whole characters; None: a cell per pixel."""
    rows, columns = slice(shown.top, shown.bottom), slice(shown.left, shown.right)
    kind = floor.floor_plan.kind[rows, columns]
    if zoom is None:
        foregrounds = np.array([_pixel_colour(number) for number in range(LOOK_COUNT)], np.uint8)
        pixels = foregrounds[floor.looks[rows, columns]]
    else:
        dots = CHARACTER_DOTS["pixels"]
        standing = standing_dots(floor, shown, zoom, dots)
        shelves = dot_blocks(np.isin(kind, STORING_KINDS), zoom, dots)
        walls = dot_blocks(kind == WALL, zoom, dots) > shelves
        pixels = np.where(walls, np.uint8(styles.COLOUR_WALL), np.uint8(FAR_SHELF))
        pixels[~standing] = styles.COLOUR_FLOOR
        for station in STATION_KINDS:
            pixels[dot_blocks(kind == station, zoom, dots) > 0] = CELL_COLOURS[station]
    return np.pad(pixels, ((0, len(pixels) % 2), (0, 0)), constant_values=styles.COLOUR_FLOOR)


def _pixel_colour(number: int) -> int:
    """The colour of objects that stand on the floor; floor and rails stay dark."""
    kind = number & KIND_MASK
    if kind in DRIVEN or kind not in CELL_COLOURS:
        return styles.COLOUR_FLOOR
    return FAR_SHELF if kind in STORING_KINDS else colour_of(number)


def paired(pixels: Colours, glyphs: GlyphSet) -> Codes:
    """(rows / 2, columns) the characters of these pixels."""
    upper, lower = pixels[0::2].astype(np.intp), pixels[1::2]
    codes: Codes = pairs(glyphs)[upper * len(styles.COLOUR_TABLE) + lower]
    return codes


@lru_cache(maxsize=3)
def pairs(glyphs: GlyphSet) -> Codes:
    """The character of each pair of colours, upper * colours + lower.

    Objects standing on the floor are dotted, overlays and robots are solid: so robots differ from
    shelves even without colours. A dotted half beside a solid one shows plain floor.
    """
    colours, floor = len(styles.COLOUR_TABLE), styles.COLOUR_FLOOR
    upper, lower = np.divmod(np.arange(colours * colours), colours)
    standing = np.isin(np.arange(colours), [floor, *DOTTED])
    top = np.where(standing[upper] & ~standing[lower], floor, upper)
    bottom = np.where(standing[lower] & ~standing[upper], floor, lower)
    codes = code(style(top, bottom), glyphs.upper_half)
    codes = np.where(top == floor, code(style(bottom, floor), glyphs.lower_half), codes)
    codes = np.where(top == bottom, code(style(top, floor), glyphs.full), codes)
    fg = np.maximum(upper, lower)  # the most important colours are last
    pattern = _dots(TOP_DOTS, TOP_PAIR)[upper] | _dots(BOTTOM_DOTS, BOTTOM_PAIR)[lower]
    dotted = code(style(fg, floor), np.array(glyphs.braille)[pattern])
    codes = np.where(standing[upper] & standing[lower], dotted, codes).astype(np.uint32)
    return _shades(codes, upper, lower, glyphs) if glyphs.shaded else codes


def _shades(
    codes: Codes, upper: NDArray[np.intp], lower: NDArray[np.intp], glyphs: GlyphSet
) -> Codes:
    """Show pairs of heat by the shade of the higher level, for the whole character."""
    levels = [
        np.where(np.isin(half, list(HEATS)), half - styles.COLOUR_HEAT_0, 0)
        for half in (upper, lower)
    ]
    level = np.maximum(*levels)
    return np.where(level > 0, heat_codes(glyphs)[level], codes)


def _dots(full: int, pair: int) -> NDArray[np.uint8]:
    """(colours,) the dots of each colour of DOTTED; fewer for an empty shelf."""
    dots = np.zeros(len(styles.COLOUR_TABLE), np.uint8)
    dots[list(DOTTED)] = full
    dots[FAR_SHELF] = pair
    return dots


def grounds(pixels: Colours) -> Colours:
    """(rows / 2, columns) the backgrounds on a layer: the higher of two heats."""
    backgrounds = np.where(np.isin(pixels, LAYER_COLOURS), pixels, np.uint8(styles.COLOUR_FLOOR))
    return np.maximum(backgrounds[0::2], backgrounds[1::2])


# The whole floor in a few characters, with a frame around the part on the screen.


class Minimap:
    """An overview of rows x columns characters in braille, made once per size of the map."""

    def __init__(self, camera: Camera, rows: int, columns: int) -> None:
        self.camera = Camera(camera.floor_plan, rows, columns)
        while self.camera.zoom.kind != "dots":
            self.camera.zoom_out()
        self._framed: tuple[object, Codes] | None = None  # its key and the frame

    def picture(self, scene: Scene, main: Camera, glyphs: GlyphSet) -> Codes:
        """(rows, columns) codes, with a frame around the part that `main` shows."""
        codes = compose(scene.with_(layer="", route=NO_CELLS, cursor=None), self.camera, glyphs)
        key = main.visible(), self.camera.key, glyphs
        if self._framed is None or self._framed[0] != key:
            self._framed = key, self._frame(main, glyphs, codes.shape)
        frame = self._framed[1]
        return np.where(frame == BLANK, codes, frame)

    def _frame(self, main: Camera, glyphs: GlyphSet, shape: tuple[int, ...]) -> Codes:
        """The frame, without the floor."""
        part = part_of(self.camera)
        inside = np.full((part.bottom - part.top, part.right - part.left), BLANK, np.uint32)
        canvas = DotCanvas(inside, part, self.camera, glyphs)
        canvas.draw(edge(main.visible(), main), styles.COLOUR_CURSOR)
        frame = np.full(shape, BLANK, np.uint32)
        top, left = part.top - self.camera.top, part.left - self.camera.left
        frame[top : top + inside.shape[0], left : left + inside.shape[1]] = inside
        return frame

    def cell_at(self, row: int, column: int) -> int | None:
        """The cell to centre on after a click."""
        return self.camera.cell_at(row, column)


def edge(seen: CellRectangle, camera: Camera) -> NDArray[np.int32]:
    """The outermost cells of a rectangle."""
    rows, columns = np.arange(seen.top, seen.bottom), np.arange(seen.left, seen.right)
    stride = camera.floor_plan.stride
    sides = [rows * stride + column for column in (seen.left, seen.right - 1)]
    sides += [row * stride + columns for row in (seen.top, seen.bottom - 1)]
    return np.concatenate(sides).astype(np.int32)
