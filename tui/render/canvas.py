"""The cells on the screen while they are painted: (rows, columns, characters of a cell) codes.

The characters of a cell are in reading order. Its sign stands in one of them: in the first where a
cell is one row high, else in the middle.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tui.render import styles
from tui.render.camera import Camera, Rectangle
from tui.render.cell_looks import cell_codes, sign_place
from tui.render.glyphs import Codes, GlyphSet, code
from tui.render.scene import Floor, Scene
from tui.render.styles import style

Cells = NDArray[np.int32]


@lru_cache(maxsize=8)
def empty_floor(floor: Floor, seen: Rectangle, width: int, height: int, glyphs: GlyphSet) -> Codes:
    """(rows, columns, height x width) not to be written to; kept until the camera moves."""
    looks = floor.looks[seen.top : seen.bottom, seen.left : seen.right]
    return cell_codes(glyphs, width, height)[looks]


class Canvas:
    """The cells on the screen, while they are painted."""

    def __init__(self, scene: Scene, camera: Camera, glyphs: GlyphSet) -> None:
        self.scene, self.glyphs = scene, glyphs
        self.seen = camera.visible()
        self.width, self.height = camera.zoom.width, camera.zoom.height
        self.sign = sign_place(self.width, self.height)
        self.stride = camera.floor_plan.stride
        self.codes = empty_floor(scene.floor, self.seen, self.width, self.height, glyphs).copy()
        self.flat = self.codes.reshape(-1, self.height * self.width)

    def picture(self) -> Codes:
        """(rows, columns of characters) what is painted."""
        rows, columns = self.codes.shape[:2]
        cells = self.codes.reshape(rows, columns, self.height, self.width)
        return cells.swapaxes(1, 2).reshape(rows * self.height, columns * self.width)

    def at(self, cells: Cells) -> tuple[Cells, NDArray[np.intp]]:
        """Index into the canvas of those cells that are on it, and which of them they are."""
        y, x = np.divmod(cells, self.stride)
        y -= self.seen.top
        x -= self.seen.left
        rows, columns = self.codes.shape[:2]
        # Negative numbers are large ones without a sign; NIL is in row -1.
        inside = (y.view(np.uint32) < rows) & (x.view(np.uint32) < columns)
        which = np.flatnonzero(inside)
        index: Cells = y[which] * columns + x[which]
        return index, which

    def cells(self, values: NDArray[Any]) -> NDArray[Any]:
        """The part on the screen of an array over all cells, (C,) or (C, n)."""
        seen = self.seen
        whole = values.reshape(*self.scene.floor.looks.shape, *values.shape[1:])
        return whole[seen.top : seen.bottom, seen.left : seen.right]

    def set_background(self, index: NDArray[Any], bg: int | NDArray[Any]) -> None:
        """Give cells another background."""
        self.flat[index] = styles.with_background(self.flat[index], bg)

    def set_foreground(self, index: Cells, fg: int) -> None:
        """Give cells another colour on the plain background."""
        glyph = self.flat[index] & np.uint32(0xFFFF)
        self.flat[index] = code(style(fg, styles.COLOUR_FLOOR), glyph)
