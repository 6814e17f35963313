"""Pictures in which every cell has one or more characters of its own.

They are painted from below: the empty floor, loads, the layer, the selected robot's route, claims
of long moves, robots, the cursor.

    ─┼─▶12     a robot stands in the first column of its cell, its number in the others
     │
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from automaton.floor.cells import SHELF, STORAGE
from tui.render import robot_marks as fleet
from tui.render import styles
from tui.render.camera import Camera
from tui.render.canvas import Canvas, Cells
from tui.render.cell_looks import cell_codes, look
from tui.render.field import HEAT_LEVELS
from tui.render.glyphs import GLYPH_BITS, GLYPHS, Codes, GlyphSet, code
from tui.render.scene import DETAIL_FULL_SHELF, DETAIL_POD, Scene
from tui.render.shelf_marks import full_shelves, pods_in
from tui.render.styles import style
from tui.render.tints import draw_tints
from tui.render.trails import draw_paths

FLOW_LEVELS = (0, 5, 5, 5, 5, 6, 6, 7, 8)  # of heat: thin arrows would not show in its first ones


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
        draw_robots(canvas)
    if scene.shaded:
        keep_heat(canvas, ground)
    if scene.zone != NIL:
        canvas.set_background(canvas.at(scene.zone_cells)[0], styles.COLOUR_MARKED)
    if scene.snapshot is not None:
        draw_chosen(canvas)
    if scene.cursor is not None:
        index, _ = canvas.at(np.array([scene.cursor], np.int32))
        canvas.set_background(index, styles.COLOUR_CURSOR)
    rows, columns, width = canvas.codes.shape
    return canvas.codes.reshape(rows, columns * width)


def draw_loads(canvas: Canvas) -> None:
    """Shelves that hold a load, and pods in storage."""
    codes = cell_codes(canvas.glyphs, canvas.width)
    full = full_shelves(canvas.scene, canvas.seen)
    canvas.flat[full] = codes[look(SHELF, DETAIL_FULL_SHELF)]
    canvas.flat[pods_in(canvas.scene, canvas.seen)] = codes[look(STORAGE, DETAIL_POD)]


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
    canvas.flat[index, 0] = flow_codes(canvas.glyphs)[levels, flow[index].argmax(axis=1)]


@lru_cache(maxsize=2)
def heat_codes(glyphs: GlyphSet) -> Codes:
    """(HEAT_LEVELS,) foreground and background are equal: the shade is seen only where there are no
    colours.
    """
    foregrounds = styles.COLOUR_HEAT_0 + np.arange(HEAT_LEVELS)
    return np.array(code(style(foregrounds, foregrounds), np.array(glyphs.ramp)), np.uint32)


@lru_cache(maxsize=2)
def flow_codes(glyphs: GlyphSet) -> Codes:
    """(HEAT_LEVELS, 4) arrows."""
    foregrounds = style(styles.COLOUR_HEAT_0 + np.array(FLOW_LEVELS), styles.COLOUR_FLOOR)
    return np.array(code(foregrounds[:, None], np.array(glyphs.arrow)[None, :]), np.uint32)


# Robots.


def draw_left_loads(canvas: Canvas) -> None:
    """Loads that lie on the floor where robots had to leave them."""
    index, _ = canvas.at(canvas.scene.left_loads)
    canvas.flat[index, 0] = code(
        style(styles.COLOUR_LOADED, styles.COLOUR_FLOOR), canvas.glyphs.left_load
    )


def draw_gates(canvas: Canvas) -> None:
    """Cells that are closed now, and doors that are shut."""
    signs = (canvas.glyphs.closed, canvas.glyphs.door)
    for cells, sign in zip(canvas.scene.shut_cells, signs, strict=True):
        index, _ = canvas.at(cells)
        canvas.flat[index, 0] = code(style(styles.COLOUR_FAULT, styles.COLOUR_FLOOR), sign)


def draw_route(canvas: Canvas) -> None:
    """The cells that the selected robot has still to drive through, and where it is going."""
    scene, glyphs = canvas.scene, canvas.glyphs
    route = np.asarray(scene.route, np.int32)
    if not route.size:
        return
    index, _ = canvas.at(route)
    canvas.flat[index, 0] = code(style(styles.COLOUR_ROUTE, styles.COLOUR_FLOOR), glyphs.route)
    index, _ = canvas.at(route[-1:])
    canvas.flat[index, 0] = code(style(styles.COLOUR_ROUTE, styles.COLOUR_FLOOR), glyphs.stand)
    goal = scene.goal_cell
    if goal != NIL:
        index, _ = canvas.at(np.array([goal], np.int32))
        canvas.set_foreground(index, styles.COLOUR_ROUTE)


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
    canvas.flat[index, 0] = code(style(styles.COLOUR_DIM, styles.COLOUR_FLOOR), arrows)


def draw_robots(canvas: Canvas) -> None:
    """Each robot in the cell where it is; a number where there are several."""
    scene, glyphs = canvas.scene, canvas.glyphs
    seen = fleet.robots_of(scene)
    index, which = canvas.at(seen.cell)
    state = seen.state[which]
    glyph = fleet.shapes(glyphs)[seen.shape[which], seen.direction[which]]
    foregrounds = style(fleet.STATE_COLOURS[state], styles.COLOUR_FLOOR)
    canvas.flat[index, 0] = code(foregrounds, glyph)
    if canvas.width == 2:
        assert scene.snapshot is not None
        mark = np.where(scene.snapshot.robots.load[which] != NIL, glyphs.cargo, glyphs.blank)
        canvas.flat[index, 1] = code(foregrounds, mark)
    elif canvas.width > 2:
        names = fleet.names(glyphs, len(seen.cell), canvas.width - 1)
        canvas.flat[index, 1:] = code(foregrounds[:, None], names[which])
    draw_crowds(canvas, index, state)


def keep_heat(canvas: Canvas, ground: Codes) -> None:
    """What is drawn on a hot or a tinted cell stands on it; without colours its sign fills the rest.

    A sign has the foreground of its background; other characters, such as a station's number, fill
    nothing.
    """
    fg, heat = np.divmod(ground >> np.uint32(GLYPH_BITS), np.uint32(len(styles.COLOURS)))
    hot = (heat > styles.COLOUR_HEAT_0) & (heat < styles.COLOUR_FLOOR_MARK)
    bg = (canvas.flat >> np.uint32(GLYPH_BITS)) % np.uint32(len(styles.COLOURS))
    over = hot & (canvas.flat != ground) & (bg == styles.COLOUR_FLOOR)
    blank = over & (fg == heat) & (canvas.flat & GLYPHS == canvas.glyphs.blank)
    canvas.flat[over] = styles.with_background(canvas.flat[over], heat[over])
    canvas.flat[blank] = ground[blank]


def draw_chosen(canvas: Canvas) -> None:
    """Marked robots and the selected one on backgrounds of their own."""
    scene = canvas.scene
    assert scene.snapshot is not None
    robots_now = scene.snapshot.robots
    for robots, bg in (
        (scene.marked, styles.COLOUR_MARKED),
        ((scene.selected,), styles.COLOUR_SELECTED),
    ):
        chosen = np.asarray(robots, np.int32)
        chosen = chosen[chosen != NIL]
        cell, bay = robots_now.cell[chosen], robots_now.bay[chosen]
        spots, _ = canvas.at(np.where(cell == NIL, bay, cell))
        canvas.set_background(spots, bg)
        canvas.flat[spots] = without_shades(canvas.flat[spots])


def without_shades(codes: Codes) -> Codes:
    """Blanks for the shades of heat, which are seen on another background than their own."""
    fg = (codes >> np.uint32(GLYPH_BITS)) // np.uint32(len(styles.COLOURS))
    shade = (fg >= styles.COLOUR_HEAT_0) & (fg < styles.COLOUR_HEAT_0 + HEAT_LEVELS)
    return np.where(shade, codes & ~GLYPHS, codes)


def draw_crowds(canvas: Canvas, index: Cells, state: NDArray[np.uint8]) -> None:
    """The number of robots in each cell that holds several (+ from ten), in the worst colour."""
    count = np.bincount(index, minlength=len(canvas.flat))
    several = count[index] > 1
    if not several.any():
        return
    index, state = index[several], state[several]
    order = np.argsort(state, kind="stable")  # the worst is written last
    index, foregrounds = index[order], fleet.STATE_COLOURS[state[order]]
    digit = np.array([*canvas.glyphs.digits, ord("+")])[np.minimum(count[index], 10)]
    canvas.flat[index] = code(style(styles.COLOUR_FLOOR, foregrounds), canvas.glyphs.blank)[:, None]
    canvas.flat[index, 0] = code(style(styles.COLOUR_FLOOR, foregrounds), digit)
