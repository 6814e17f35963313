"""Where robots came from and where they are going: trails of cells, and lines to goals, all dim.

. . o o >       a trail behind a robot, the cell where it is left out
> - - \\ . .
      . \\ O     a line from a robot to the cell of its goal; it leads through shelves and walls
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from tui.render import styles
from tui.render.glyphs import code
from tui.render.scene import NO_CELLS, Scene
from tui.render.styles import style

if TYPE_CHECKING:
    from tui.render.canvas import Canvas

MAX_LINE_CELLS: Final = 100_000  # of all lines together: 8 ms; the robots that follow have none
LINES: Final = ("", "selected", "all")  # whose goals lines lead to


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
