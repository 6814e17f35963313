"""The whole floor in a few characters, with a frame round the part that is on the screen."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from tui.render import styles
from tui.render.blocks import part_of
from tui.render.braille_view import draw_dots
from tui.render.camera import Camera, Rectangle
from tui.render.compose import compose
from tui.render.glyphs import Codes, GlyphSet
from tui.render.scene import NO_CELLS, Scene

BLANK: Final = np.uint32(0xFFFFFFFF)  # no code: nothing of the frame


class Minimap:
    """An overview of rows x columns characters, in braille; made once for a size of the map."""

    def __init__(self, camera: Camera, rows: int, columns: int) -> None:
        self.camera = Camera(camera.floor_plan, rows, columns)
        while self.camera.zoom.kind != "dots":
            self.camera.zoom_out()
        self._framed: tuple[object, Codes] | None = None  # the frame, and where it lies

    def picture(self, scene: Scene, main: Camera, glyphs: GlyphSet) -> Codes:
        """(rows, columns) codes; a frame goes round what `main` shows."""
        codes = compose(scene.with_(layer="", route=NO_CELLS, cursor=None), self.camera, glyphs)
        key = main.visible(), self.camera.key, glyphs
        if self._framed is None or self._framed[0] != key:
            self._framed = key, self._frame(main, glyphs, codes.shape)
        frame = self._framed[1]
        return np.where(frame == BLANK, codes, frame)

    def _frame(self, main: Camera, glyphs: GlyphSet, shape: tuple[int, ...]) -> Codes:
        """The frame alone."""
        part = part_of(self.camera)
        inside = np.full((part.bottom - part.top, part.right - part.left), BLANK, np.uint32)
        draw_dots(
            inside, part, self.camera, glyphs, edge(main.visible(), main), styles.COLOUR_CURSOR
        )
        frame = np.full(shape, BLANK, np.uint32)
        top, left = part.top - self.camera.top, part.left - self.camera.left
        frame[top : top + inside.shape[0], left : left + inside.shape[1]] = inside
        return frame

    def cell_at(self, row: int, column: int) -> int | None:
        """The cell to centre on after a click."""
        return self.camera.cell_at(row, column)


def edge(seen: Rectangle, camera: Camera) -> NDArray[np.int32]:
    """The outermost cells of a rectangle."""
    rows, columns = np.arange(seen.top, seen.bottom), np.arange(seen.left, seen.right)
    stride = camera.floor_plan.stride
    sides = [rows * stride + column for column in (seen.left, seen.right - 1)]
    sides += [row * stride + columns for row in (seen.top, seen.bottom - 1)]
    return np.concatenate(sides).astype(np.int32)
