"""Pictures in which every cell has one or more characters of its own.

They are painted from below: the empty floor, loads, the layer, the selected robot's route, claims
of long moves, robots, the cursor.

    -+-}12     in cells of one row a robot stands in the first column, its number in the others
     |         in cells of several rows it is drawn, see tui.render.drawn_robots

Trails and lines to goals are dim:

    . . o o >       a trail behind a robot, the cell where it is left out
    > - - \\ . .
          . \\ O     a line from a robot to the cell of its goal; it leads through shelves and walls
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import KIND_MASK
from automaton.engine.state import NIL
from automaton.floor.cells import (
    EXIT_EAST,
    EXIT_NORTH,
    EXIT_SOUTH,
    EXIT_WEST,
    FLOOR,
    SHELF,
    STORAGE,
    TRACK,
)
from tui.render import drawn_robots as fleet
from tui.render import styles
from tui.render.camera import Camera, CellRectangle
from tui.render.cell_looks import (
    TINT_COLOURS,
    TINT_LETTERS,
    TRANSFER_COLOUR,
    Canvas,
    Cells,
    cell_codes,
    draw_box,
    draw_exits,
    flow_codes,
    heat_codes,
    line_glyphs,
    look,
)
from tui.render.scene import DETAIL_FULL_SHELF, DETAIL_POD, NO_CELLS, Scene, ShownFloor
from tui.render.styles import GLYPH_BITS, GLYPHS, Codes, GlyphSet, code, style

MAX_LINE_CELLS: Final = 100_000  # of all lines together: 8 ms; the robots that follow have none

BodyAndInk = tuple[NDArray[np.uint32], NDArray[np.uint32]]  # (n,) each


def near_picture(scene: Scene, camera: Camera, glyphs: GlyphSet) -> Codes:
    """(rows, columns of characters) the visible cells, whole ones."""
    canvas = Canvas(scene, camera, glyphs)
    draw_loads(canvas)
    draw_layer(canvas)
    ground = canvas.flat.copy()
    if scene.snapshot is not None:
        draw_left_loads(canvas)
        draw_gates(canvas)
        draw_paths(canvas)
        draw_route(canvas)
        draw_claims(canvas)
    if len(scene.zone_cells):
        canvas.set_background(canvas.at(scene.zone_cells)[0], styles.COLOUR_MARKED)
    if scene.snapshot is not None:
        draw_robots(canvas)
    if scene.shaded:
        keep_heat(canvas, ground)
    if scene.cursor is not None:
        index, _ = canvas.at(np.array([scene.cursor], np.int32))
        canvas.flat[index] = fleet.with_cursor(canvas.flat[index])
    return canvas.picture()


# Loads: shelves and storage cells on the screen that hold a load or a pod.


def draw_loads(canvas: Canvas) -> None:
    """Shelves that hold a load, and pods in storage."""
    codes = cell_codes(canvas.glyphs, canvas.width, canvas.height)
    full = full_shelves(canvas.scene, canvas.seen)
    canvas.flat[full] = codes[look(SHELF, DETAIL_FULL_SHELF)]
    canvas.flat[pods_in(canvas.scene, canvas.seen)] = codes[look(STORAGE, DETAIL_POD)]


def full_shelves(scene: Scene, visible: CellRectangle, kind: int = SHELF) -> NDArray[np.intp]:
    """Those with a load, in cells of the rectangle; before the run begins, as they are drawn."""
    shelves = shelves_in(scene.floor, visible, kind)
    if scene.snapshot is not None:
        full = scene.snapshot.slots.content[shelves.slot] != NIL
    else:
        full = scene.floor.floor_plan.loads.reshape(-1)[scene.floor.slots_cell[shelves.slot]] != 0
    at: NDArray[np.intp] = shelves.at[full]
    return at


def pods_in(scene: Scene, visible: CellRectangle) -> NDArray[np.intp]:
    """The storage cells in which a pod stands, in cells of the rectangle."""
    return full_shelves(scene, visible, STORAGE)


class Shelves(NamedTuple):
    """Shelves, or storage cells, within a rectangle of cells."""

    slot: NDArray[np.int32]
    at: NDArray[np.intp]  # index into the cells of the rectangle


@lru_cache(maxsize=8)
def shelves_in(floor: ShownFloor, visible: CellRectangle, kind: int = SHELF) -> Shelves:
    """Those of one kind; kept until the camera moves."""
    rows, columns = slice(visible.top, visible.bottom), slice(visible.left, visible.right)
    slots = floor.slot_in.reshape(floor.looks.shape)[rows, columns].reshape(-1)
    index = np.flatnonzero(floor.floor_plan.kind[rows, columns].reshape(-1) == kind)
    index = index[slots[index] != NIL]
    return Shelves(slots[index], index)


# Layers.


def draw_layer(canvas: Canvas) -> None:
    """The layer of the scene on the cells that robots drive on."""
    scene = canvas.scene
    if scene.tints is not None:
        draw_tints(canvas, scene.tints)
    elif scene.values is not None:
        levels = scene.levels(canvas.cells(scene.values)).reshape(-1)
        index = np.flatnonzero(levels)
        if scene.shaded:
            canvas.flat[index] = heat_codes(canvas.glyphs)[levels[index], None]
        else:
            draw_flow(canvas, index, levels[index])


def draw_flow(canvas: Canvas, index: NDArray[np.intp], levels: NDArray[np.uint8]) -> None:
    """An arrow in the direction in which most robots left a cell, the brighter the more did."""
    snapshot = canvas.scene.snapshot
    assert snapshot is not None and snapshot.flow is not None
    flow = canvas.cells(snapshot.flow).reshape(-1, 4)
    canvas.flat[index, canvas.sign] = flow_codes(canvas.glyphs)[levels, flow[index].argmax(axis=1)]


def keep_heat(canvas: Canvas, ground: Codes) -> None:
    """What is drawn on a hot or a tinted cell stands on it; without colours its sign fills the rest.

    A sign has the foreground of its background; other characters, such as a station's number, fill
    nothing.
    """
    fg, heat = np.divmod(ground >> np.uint32(GLYPH_BITS), np.uint32(len(styles.COLOUR_TABLE)))
    hot = (heat > styles.COLOUR_HEAT_0) & (heat < styles.COLOUR_FLOOR_MARK)
    bg = (canvas.flat >> np.uint32(GLYPH_BITS)) % np.uint32(len(styles.COLOUR_TABLE))
    over = hot & (canvas.flat != ground) & (bg == styles.COLOUR_FLOOR)
    blank = over & (fg == heat) & (canvas.flat & GLYPHS == canvas.glyphs.blank)
    canvas.flat[over] = styles.with_background(canvas.flat[over], heat[over])
    canvas.flat[blank] = ground[blank]


# Zones as tints and letters, whatever layer they are of.
#
# Where there are no colours, or the same ones, a letter tells touching zones apart: ddd+ee


def draw_tints(canvas: Canvas, zone_tints: NDArray[np.int8]) -> None:
    """Cells tinted by zone. Free floor bears a letter that is seen without colours only.

    A straight track bears it in its own colour; other cells keep their signs and bear it beside.
    """
    layer = canvas.scene.map_layer
    tints = canvas.cells(zone_tints).reshape(-1)
    looks = canvas.cells(canvas.scene.floor.looks.reshape(-1)).reshape(-1)
    index = np.flatnonzero(tints != NIL)
    tint = tints[index]
    canvas.set_background(index, TINT_COLOURS[tint][:, None])
    letters, foregrounds = TINT_LETTERS[tint], TINT_COLOURS[tint]
    plain = (looks[index] & KIND_MASK if layer.whole_floor else looks[index]) == FLOOR
    rails = looks[index] & KIND_MASK == TRACK
    canvas.flat[index[plain], canvas.sign] = code(style(foregrounds, foregrounds), letters)[plain]
    tracks = style(np.full(len(index), styles.COLOUR_TRACK), foregrounds)
    canvas.flat[index[rails], canvas.sign] = code(tracks, letters)[rails]
    if canvas.width > 1:
        beside = canvas.flat[index, 1] & GLYPHS == canvas.glyphs.blank
        signed = beside & ~plain & ~rails
        canvas.flat[index[signed], 1] = code(style(foregrounds, foregrounds), letters)[signed]
    layer.draw_signs(canvas, tints, looks)


def paint_tints(pixels: NDArray[np.uint8], tints: NDArray[np.int8]) -> None:
    """Pixels in the tints of their zones."""
    inside = tints != NIL
    pixels[inside] = TINT_COLOURS[tints[inside]]


def sign_tints(codes: Codes, pixels: NDArray[np.uint8], thin: bool = False) -> Codes:
    """A character whose halves have one tint bears its letter, unseen where there are colours.

    thin: ways are no wider than half a character, and there are no colours: one half is enough, and
    stations bear their signs.
    """
    top = pixels[0::2]
    whole = (top == pixels[1::2]) & np.isin(top, TINT_COLOURS)
    if thin:
        bottom = pixels[1::2]
        whole = np.isin(top, TINT_COLOURS) | np.isin(bottom, TINT_COLOURS)
        top = np.where(np.isin(top, TINT_COLOURS), top, bottom)
    letter_of: NDArray[Any] = np.zeros(len(styles.COLOUR_TABLE), np.uint32)
    letter_of[TINT_COLOURS] = TINT_LETTERS
    fg = top[whole].astype(np.uint32)
    signed = codes.copy()
    signed[whole] = (style(fg, fg) << np.uint32(GLYPH_BITS)) | letter_of[fg]
    if thin:
        for sign, its_fg in (
            (GlyphSet.station, styles.COLOUR_DIM),
            (GlyphSet.transfer, TRANSFER_COLOUR),
        ):
            here = (pixels[0::2] == its_fg) | (pixels[1::2] == its_fg)
            signed[here] = code(style(its_fg, styles.COLOUR_FLOOR), sign)
    return signed


# What lies on the floor, and where robots came from and are going.


def draw_left_loads(canvas: Canvas) -> None:
    """Loads that lie on the floor where robots had to leave them."""
    index, _ = canvas.at(canvas.scene.left_loads)
    draw_sign(canvas, index, styles.COLOUR_LOADED, canvas.glyphs.left_load)


def draw_gates(canvas: Canvas) -> None:
    """Cells that are closed now, and doors that are shut."""
    signs = (canvas.glyphs.closed, canvas.glyphs.door)
    for cells, sign in zip(canvas.scene.shut_cells, signs, strict=True):
        index, _ = canvas.at(cells)
        draw_sign(canvas, index, styles.COLOUR_FAULT, sign)


def draw_sign(canvas: Canvas, index: Cells, fg: int, sign: int) -> None:
    """A sign in some cells; where they are several rows high it has a frame."""
    if canvas.height > 1:
        dots = np.zeros((4 * canvas.height, 2 * canvas.width), bool)
        draw_box(dots)
        canvas.flat[index] = code(style(fg, styles.COLOUR_FLOOR), line_glyphs(canvas.glyphs, dots))
    canvas.flat[index, canvas.sign] = code(style(fg, styles.COLOUR_FLOOR), sign)


def draw_paths(canvas: Canvas) -> None:
    """Trails and lines, where each cell has characters of its own."""
    scene, glyphs = canvas.scene, canvas.glyphs
    if scene.trails.size:
        index, _ = canvas.at(scene.trails.reshape(-1))
        canvas.flat[index, 0] = code(style(styles.COLOUR_TRAIL, styles.COLOUR_FLOOR), glyphs.trail)
    cells, ways = goal_lines(scene)
    index, which = canvas.at(cells)
    signs = np.array([ord(sign) for sign in "-|\\/"])[ways[which]]
    canvas.flat[index, 0] = code(style(styles.COLOUR_GOAL_LINE, styles.COLOUR_FLOOR), signs)


def goal_lines(scene: Scene) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
    """(k,) cells between robots and the cells of their goals, and how the line leads through each.

    0 along x, 1 along y, 2 and 3 the falling and the rising diagonal. Lines are those of Bresenham,
    by rounding; all of them are made at once.
    """
    if scene.snapshot is None or not scene.lines:
        return NO_CELLS, np.zeros(0, np.int8)
    fleet, stride = scene.snapshot.robots, scene.floor.floor_plan.stride
    there = (fleet.cell != NIL) & (fleet.goal_cell != NIL)
    if scene.lines == "selected":
        there &= np.arange(len(there)) == scene.selected
    start, goal = fleet.cell[there].astype(np.int64), fleet.goal_cell[there].astype(np.int64)
    dy, dx = goal // stride - start // stride, goal % stride - start % stride
    length = np.maximum(np.abs(dx), np.abs(dy))
    length[np.cumsum(length) > MAX_LINE_CELLS] = 0
    between = np.maximum(length - 1, 0)
    line = np.repeat(np.arange(len(start)), between)
    step = 1 + np.arange(len(line)) - np.repeat(np.cumsum(between) - between, between)
    x, y = (np.rint(step * by[line] / length[line]).astype(np.int64) for by in (dx, dy))
    cells = start[line] + y * stride + x
    along = np.abs(dx) > 2 * np.abs(dy), np.abs(dy) > 2 * np.abs(dx)
    way = np.select(along, [0, 1], np.where(dx * dy > 0, 2, 3)).astype(np.int8)
    return cells.astype(np.int32), way[line]


def draw_route(canvas: Canvas) -> None:
    """The cells that the selected robot has still to drive through, and where it is going."""
    scene, glyphs = canvas.scene, canvas.glyphs
    route = np.asarray(scene.route, np.int32)
    if not route.size:
        return
    fg = style(styles.COLOUR_ROUTE, styles.COLOUR_FLOOR)
    index, which = canvas.at(route)
    if canvas.height > 1:
        lines = route_glyphs(glyphs, canvas.width, canvas.height)[route_exits(route, canvas.stride)]
        drawn = lines[which]
        canvas.flat[index] = np.where(drawn, code(fg, drawn), canvas.flat[index])
    else:
        canvas.flat[index, 0] = code(fg, glyphs.route)
    index, _ = canvas.at(route[-1:])
    canvas.flat[index, canvas.sign] = code(fg, glyphs.stand)
    goal = scene.goal_cell
    if goal != NIL:
        index, _ = canvas.at(np.array([goal], np.int32))
        canvas.set_foreground(index, styles.COLOUR_ROUTE)


def route_exits(route: Cells, stride: int) -> NDArray[np.uint8]:
    """(cells,) the sides over which a route comes into each of its cells and leaves it."""
    exits = np.zeros(len(route), np.uint8)
    step = np.diff(route)
    for change, out, into in (
        (1, EXIT_EAST, EXIT_WEST),
        (stride, EXIT_SOUTH, EXIT_NORTH),
        (-1, EXIT_WEST, EXIT_EAST),
        (-stride, EXIT_NORTH, EXIT_SOUTH),
    ):
        exits[:-1][step == change] |= out
        exits[1:][step == change] |= into
    _, number = np.unique(route, return_inverse=True)  # a route may come to a cell twice
    both = np.zeros(len(route), np.uint8)
    np.bitwise_or.at(both, number, exits)
    return both[number]


@lru_cache(maxsize=8)
def route_glyphs(glyphs: GlyphSet, width: int, height: int) -> NDArray[np.uint32]:
    """(16, height x width) lines from the middle of a cell to its sides, by exits; 0: nothing."""
    table = np.zeros((16, height * width), np.uint32)
    for exits in range(16):
        dots = np.zeros((4 * height, 2 * width), bool)
        draw_exits(dots, exits)
        table[exits] = line_glyphs(glyphs, dots)
    return table


def draw_claims(canvas: Canvas) -> None:
    """The cells that robots hold ahead of them during a move of several ticks."""
    assert canvas.scene.snapshot is not None
    robots = canvas.scene.snapshot.robots
    held = np.flatnonzero(robots.claim != NIL)
    if not held.size:
        return
    index, which = canvas.at(robots.claim[held])
    step = (robots.claim - robots.cell)[held[which]]
    direction = np.select([step == 1, step == -1, step > 0], [0, 2, 1], 3)
    arrows = np.array(canvas.glyphs.arrow)[direction]
    canvas.flat[index, canvas.sign] = code(style(styles.COLOUR_DIM, styles.COLOUR_FLOOR), arrows)


# Robots.


def draw_robots(canvas: Canvas) -> None:
    """Each robot in the cell where it is; a number where there are several."""
    scene = canvas.scene
    robots = fleet.robots_of(scene)
    index, which = canvas.at(robots.cell)
    if canvas.height > 1:
        body, ink = chosen_colours(scene, fleet.body_colours(scene, robots))
        canvas.flat[index] = fleet.drawn_robots(canvas, robots, which, body[which], ink[which])
    else:
        body, ink = chosen_colours(scene, robots.colour)
        draw_signs(canvas, robots, index, which, style(ink, body)[which])
    draw_crowds(canvas, index, which, robots.state, chosen_colours(scene, robots.colour))


def draw_signs(
    canvas: Canvas,
    robots: fleet.DrawnRobots,
    index: Cells,
    which: NDArray[np.intp],
    robot_styles: NDArray[np.uint32],
) -> None:
    """Robots in cells of one row: a sign, and a mark for the load or the number beside it."""
    scene, glyphs = canvas.scene, canvas.glyphs
    glyph = fleet.shape_glyphs(glyphs)[robots.shape[which], robots.direction[which]]
    canvas.flat[index, 0] = code(robot_styles, glyph)
    if canvas.width == 2:
        assert scene.snapshot is not None
        mark = np.where(scene.snapshot.robots.load[which] != NIL, glyphs.cargo, glyphs.blank)
        canvas.flat[index, 1] = code(robot_styles, mark)
    elif canvas.width > 2:
        names = fleet.number_glyphs(glyphs, len(robots.cell), canvas.width - 1)
        canvas.flat[index, 1:] = code(robot_styles[:, None], names[which])


def chosen_colours(scene: Scene, colour: NDArray[np.uint32]) -> BodyAndInk:
    """The colours of robots and of what is written on them; those of chosen ones change places."""
    body, ink = colour.copy(), np.full_like(colour, styles.COLOUR_FLOOR)
    for robots, bg in (
        (scene.marked, styles.COLOUR_MARKED),
        ((scene.selected,), styles.COLOUR_SELECTED),
    ):
        chosen = np.asarray(robots, np.int32)
        chosen = chosen[chosen != NIL]
        body[chosen], ink[chosen] = bg, colour[chosen]
    return body, ink


def draw_crowds(
    canvas: Canvas,
    index: Cells,
    which: NDArray[np.intp],
    state: NDArray[np.uint8],
    colours: BodyAndInk,
) -> None:
    """The number of robots in each cell that holds several (+ from ten), in the worst colour."""
    count = np.bincount(index, minlength=len(canvas.flat))
    several = count[index] > 1
    if not several.any():
        return
    index, which = index[several], which[several]
    body, ink = (colour[which] for colour in colours)
    chosen = ink != styles.COLOUR_FLOOR
    order = np.lexsort((state[which], chosen))  # the worst, or one that is chosen, is written last
    index = index[order]
    crowds = style(ink[order], body[order])
    digit = np.array([*canvas.glyphs.digits, ord("+")])[np.minimum(count[index], 10)]
    canvas.flat[index] = code(crowds, canvas.glyphs.blank)[:, None]
    canvas.flat[index, canvas.sign] = code(crowds, digit)
