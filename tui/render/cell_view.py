"""Pictures with one or more characters per cell.

They are painted from the bottom up: empty floor, loads, layer, the selected robot's route, claims of
long moves, robots, cursor.

    -+-}12     in cells of one row, a robot is in the first column, its number in the others
     |         in cells of several rows, it is drawn, see tui.render.drawn_robots

Trails and lines to goals are dim:

    . . o o >       a trail behind a robot, without the cell of the robot
    > - - \\ . .
          . \\ O     a line from a robot to its goal cell, also through shelves and walls
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import KIND_MASK
from automaton.engine.state import NIL
from automaton.floor.floor_plan import (
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
    draw_exits,
    flow_codes,
    framed,
    heat_codes,
    line_glyphs,
    look,
)
from tui.render.scene import DETAIL_FULL_SHELF, DETAIL_POD, NO_CELLS, Scene, ShownFloor
from tui.render.styles import GLYPH_BITS, GLYPHS, Codes, GlyphSet, code, style

MAX_LINE_CELLS: Final = 100_000  # in all lines together: 8 ms; further robots get no line


def near_picture(scene: Scene, camera: Camera, glyphs: GlyphSet) -> Codes:
    """(rows, columns of characters) all cells that are at least partly visible."""
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
        index, _ = canvas.at(scene.ghosts)
        draw_sign(canvas, index, styles.COLOUR_DIM, glyphs.ghost)
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


# Loads: visible shelves and storage cells that hold a load or a pod.


def draw_loads(canvas: Canvas) -> None:
    """Draw shelves that hold a load, and pods in storage."""
    codes = cell_codes(canvas.glyphs, canvas.width, canvas.height)
    full = full_shelves(canvas.scene, canvas.seen)
    canvas.flat[full] = codes[look(SHELF, DETAIL_FULL_SHELF)]
    canvas.flat[pods_in(canvas.scene, canvas.seen)] = codes[look(STORAGE, DETAIL_POD)]


def full_shelves(scene: Scene, visible: CellRectangle, kind: int = SHELF) -> NDArray[np.intp]:
    """Indices in the rectangle of shelves with a load; before the run, as in the layout."""
    shelves = shelves_in(scene.floor, visible, kind)
    if scene.snapshot is not None:
        full = scene.snapshot.slots.content[shelves.slot] != NIL
    else:
        full = scene.floor.floor_plan.loads.reshape(-1)[scene.floor.slots_cell[shelves.slot]] != 0
    at: NDArray[np.intp] = shelves.at[full]
    return at


def pods_in(scene: Scene, visible: CellRectangle) -> NDArray[np.intp]:
    """Indices in the rectangle of storage cells with a pod."""
    return full_shelves(scene, visible, STORAGE)


class Shelves(NamedTuple):
    """Shelves, or storage cells, within a rectangle of cells."""

    slot: NDArray[np.int32]
    at: NDArray[np.intp]  # index into the cells of the rectangle


@lru_cache(maxsize=8)
def shelves_in(floor: ShownFloor, visible: CellRectangle, kind: int = SHELF) -> Shelves:
    """The shelves of one kind; cached while the camera stays."""
    rows, columns = slice(visible.top, visible.bottom), slice(visible.left, visible.right)
    slots = floor.slot_in.reshape(floor.looks.shape)[rows, columns].reshape(-1)
    index = np.flatnonzero(floor.floor_plan.kind[rows, columns].reshape(-1) == kind)
    index = index[slots[index] != NIL]
    return Shelves(slots[index], index)


# Layers.


def draw_layer(canvas: Canvas) -> None:
    """Draw the layer of the scene."""
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
    signs = scene.map_layer.signs(scene, canvas.seen, 1, 1, canvas.glyphs)
    if signs is not None:
        index = np.flatnonzero(signs)
        canvas.flat[index, canvas.sign] = signs.reshape(-1)[index]


def draw_flow(canvas: Canvas, index: NDArray[np.intp], levels: NDArray[np.uint8]) -> None:
    """Draw an arrow in the direction in which most robots left a cell; more moves are brighter."""
    snapshot = canvas.scene.snapshot
    assert snapshot is not None and snapshot.flow is not None
    flow = canvas.cells(snapshot.flow).reshape(-1, 4)
    canvas.flat[index, canvas.sign] = flow_codes(canvas.glyphs)[levels, flow[index].argmax(axis=1)]


def keep_heat(canvas: Canvas, ground: Codes) -> None:
    """Keep the layer's background under signs that were drawn over hot or tinted cells.

    Without colours, the layer's own sign fills the blanks of such cells. That sign is recognized by
    equal foreground and background; other characters, such as a station's number, fill nothing.
    """
    fg, heat = np.divmod(ground >> np.uint32(GLYPH_BITS), np.uint32(len(styles.COLOUR_TABLE)))
    hot = (heat > styles.COLOUR_HEAT_0) & (heat < styles.COLOUR_FLOOR_MARK)
    bg = (canvas.flat >> np.uint32(GLYPH_BITS)) % np.uint32(len(styles.COLOUR_TABLE))
    over = hot & (canvas.flat != ground) & (bg == styles.COLOUR_FLOOR)
    blank = over & (fg == heat) & (canvas.flat & GLYPHS == canvas.glyphs.blank)
    canvas.flat[over] = styles.with_background(canvas.flat[over], heat[over])
    canvas.flat[blank] = ground[blank]


# Zones as tints and letters, for any layer.
#
# Without colours, letters distinguish adjacent zones: fff+gg


def draw_tints(canvas: Canvas, zone_tints: NDArray[np.int8]) -> None:
    """Tint cells by zone. Free floor has a letter that is visible only without colours.

    A straight track shows the letter in its own colour. Other cells keep their signs, with the
    letter beside them.
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
    """Paint pixels in the tints of their zones."""
    inside = tints != NIL
    pixels[inside] = TINT_COLOURS[tints[inside]]


def sign_tints(codes: Codes, pixels: NDArray[np.uint8], thin: bool = False) -> Codes:
    """Write the letter of a tint, visible without colours only, where both halves have that tint.

    thin: ways are at most half a character wide, and there are no colours. Then one tinted half is
    enough, and stations show their signs.
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


# Loads on the floor, closed cells, trails, goals and routes.


def draw_left_loads(canvas: Canvas) -> None:
    """Draw loads that robots had to leave on the floor."""
    index, _ = canvas.at(canvas.scene.left_loads)
    draw_sign(canvas, index, styles.COLOUR_LOADED, canvas.glyphs.left_load)


def draw_gates(canvas: Canvas) -> None:
    """Draw closed cells and shut doors."""
    signs = (canvas.glyphs.closed, canvas.glyphs.door)
    for cells, sign in zip(canvas.scene.shut_cells, signs, strict=True):
        index, _ = canvas.at(cells)
        draw_sign(canvas, index, styles.COLOUR_FAULT, sign)


def draw_sign(canvas: Canvas, index: Cells, fg: int, sign: int) -> None:
    """Draw a sign in some cells, with a frame where cells have several rows."""
    if canvas.height > 1:
        canvas.flat[index] = framed(canvas.glyphs, canvas.width, canvas.height, fg)
    canvas.flat[index, canvas.sign] = code(style(fg, styles.COLOUR_FLOOR), sign)


def draw_paths(canvas: Canvas) -> None:
    """Draw trails and lines to goals."""
    scene, glyphs = canvas.scene, canvas.glyphs
    if scene.trails.size:
        index, _ = canvas.at(scene.trails.reshape(-1))
        canvas.flat[index, 0] = code(style(styles.COLOUR_TRAIL, styles.COLOUR_FLOOR), glyphs.trail)
    cells, ways = goal_lines(scene)
    index, which = canvas.at(cells)
    signs = np.array([ord(sign) for sign in "-|\\/"])[ways[which]]
    canvas.flat[index, 0] = code(style(styles.COLOUR_GOAL_LINE, styles.COLOUR_FLOOR), signs)


def goal_lines(scene: Scene) -> tuple[NDArray[np.int32], NDArray[np.int8]]:
    """(k,) cells between robots and their goal cells, and the direction of the line in each.

    Directions: 0 along x, 1 along y, 2 and 3 the falling and the rising diagonal. The lines are
    Bresenham's, computed for all robots together by rounding.
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
    """Draw the rest of the selected robot's route, and its goal."""
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
    """(cells,) the sides through which a route enters and leaves each of its cells."""
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
    _, number = np.unique(route, return_inverse=True)  # a route may visit a cell twice
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
    """Draw the cells that robots claim ahead during moves of several ticks."""
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
    """Draw each robot in its cell, or a number for several robots."""
    scene = canvas.scene
    robots = fleet.robots_of(scene)
    index, which = canvas.at(robots.cell)
    marks = fleet.marks_of(scene, len(robots.cell))
    drawing = fleet.RobotDrawing(canvas.glyphs, canvas.width, canvas.height, scene.floor.battery)
    canvas.flat[index] = fleet.robot_codes(drawing, robots, which, marks[which])
    draw_crowds(canvas, index, which, robots, marks)


def draw_crowds(
    canvas: Canvas,
    index: Cells,
    which: NDArray[np.intp],
    robots: fleet.DrawnRobots,
    marks: NDArray[np.uint32],
) -> None:
    """Write the number of robots in each cell with several (+ from ten), in the worst colour."""
    count = np.bincount(index, minlength=len(canvas.flat))
    several = count[index] > 1
    if not several.any():
        return
    index, which = index[several], which[several]
    order = np.argsort(robots.state[which], kind="stable")  # the last one wins: the worst
    index, which = index[order], which[order]
    mark = np.zeros(len(canvas.flat), np.uint32)
    np.maximum.at(mark, index, marks[which])  # of any robot in the cell
    colour = robots.colour[which]
    digit = np.array([*canvas.glyphs.digits, ord("+")])[np.minimum(count[index], 10)]
    crowds = style(styles.COLOUR_FLOOR, colour)
    canvas.flat[index] = code(crowds, canvas.glyphs.blank)[:, None]
    canvas.flat[index, canvas.sign] = code(fleet.sign_styles(colour, mark[index]), digit)
