"""Blocks of cells as characters: which of them are on the screen, and sums over them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tui.render.camera import Camera


class Part(NamedTuple):
    """Characters of the picture of the whole floor: rows [top, bottom), columns [left, right)."""

    top: int
    left: int
    bottom: int
    right: int


def part_of(camera: Camera) -> Part:
    """Those on the screen."""
    rows, columns = camera.size()
    top, left = max(camera.top, 0), max(camera.left, 0)
    bottom = min(camera.top + camera.rows, rows)
    right = min(camera.left + camera.columns, columns)
    return Part(top, left, max(bottom, top), max(right, left))


def blocks(
    values: NDArray[Any], across: int, down: int | None = None, over: np.ufunc = np.add
) -> NDArray[Any]:
    """The sum (or another reduction) over each block of cells; those at the edges are smaller."""
    down = across if down is None else down
    if values.dtype == bool or values.dtype == np.uint8:
        values = values.astype(np.int32)
    rows = np.arange(0, values.shape[0], down)
    columns = np.arange(0, values.shape[1], across)
    reduced: NDArray[Any] = over.reduceat(over.reduceat(values, rows, axis=0), columns, axis=1)
    return reduced
