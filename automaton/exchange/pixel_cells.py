"""Cells of an image of a floor: where the centre of a robot may be, and which cells hang together.

    pixels  #######      cells, two pixels each way      A robot's centre keeps half its width away
            #.....#      . .                             from what is occupied. A cell is free where
            #.#####      |                               such a pixel is left in it; an exit leads
            #.#          .                               where such pixels touch across the border.

Pixels and cells hang together with their four neighbours. (h, w) are rows and columns of pixels,
(H, W) of cells, k pixels each way.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.exchange.problem import connected_parts

Mask = npt.NDArray[np.bool_]


class PixelCells(NamedTuple):
    """The cells of an image, cropped to those that are free."""

    free: Mask  # (H, W)
    east: Mask  # (H, W) whether an exit leads to the cell beside it
    south: Mask  # (H, W) likewise below it
    offset: tuple[int, int]  # pixels to the right of and below which the grid of cells begins
    first: tuple[int, int]  # column and row of the image, in pixels, where the first cell begins
    reached: int  # pixels that a robot's centre reaches
    pixels_kept: int  # of those, pixels that cells keep
    pieces: tuple[int, int]  # of these pixels, and of the cells
    passages_lost: int  # borders between two free cells that pixels cross, and no kept ones


def centres(open_: Mask, reach: int) -> Mask:
    """(h, w) pixels within whose Chebyshev distance `reach` all are open; outside none is."""
    if 2 * reach + 1 > min(open_.shape):
        return np.zeros_like(open_)
    window = 2 * reach + 1
    blocked = any_within(any_within(~open_, window, 0), window, 1)
    out = np.zeros_like(open_)
    out[reach : out.shape[0] - reach, reach : out.shape[1] - reach] = ~blocked
    return out


def reach_of(width: Fraction, pixel: Fraction) -> int:
    """Pixels that the centre of a robot of this width keeps away from what is occupied."""
    return max(0, ceil(width / (2 * pixel) - Fraction(1, 2)))


def any_within(mask: Mask, window: int, axis: int) -> Mask:
    """Whether any of `window` pixels along an axis is set, for each place where all of them exist."""
    rows = mask if axis == 0 else mask.T
    length = 1
    while 2 * length <= window:  # doubled, so that a wide window costs no more than its logarithm
        rows = rows[:-length] | rows[length:]
        length *= 2
    if length < window:
        rest = window - length
        rows = rows[:-rest] | rows[rest:]
    return rows if axis == 0 else rows.T


def cells_of(centre: Mask, k: int) -> PixelCells | None:
    """The cells of k x k pixels; None where a robot's centre can be nowhere."""
    if not centre.any():
        return None
    dx, dy = best_offset(centre, k)
    pixels, first = _on_grid(centre, k, dx, dy)
    largest = _largest_pieces(pixels, k)
    free = np.asarray(_by_cell(largest, k).any(axis=(1, 3)))
    east, south = _crossings(largest, k)
    crossed = [int(np.count_nonzero(mask)) for mask in _crossings(pixels, k)]
    return PixelCells(
        free=free,
        east=east,
        south=south,
        offset=(dx, dy),
        first=first,
        reached=int(np.count_nonzero(centre)),
        pixels_kept=int(np.count_nonzero(largest)),
        pieces=(int(connected_parts(centre).max()), len(piece_sizes(free, east, south))),
        passages_lost=sum(crossed) - int(np.count_nonzero(east)) - int(np.count_nonzero(south)),
    )


def best_offset(centre: Mask, k: int) -> tuple[int, int]:
    """The offset with most free cells: x, y in pixels; ties the upper, then the left one."""
    padded = np.pad(centre, k - 1)
    # [i, j]: it begins at i - k + 1, j - k + 1.
    windows = any_within(any_within(padded, k, 0), k, 1)
    height, width = (-(-size // k) * k for size in windows.shape)
    rounded_up = np.zeros((height, width), bool)
    rounded_up[: windows.shape[0], : windows.shape[1]] = windows
    cells = rounded_up.reshape(height // k, k, width // k, k).sum(axis=(0, 2), dtype=np.int64)
    dy, dx = divmod(int(np.roll(cells, (1, 1), (0, 1)).argmax()), k)
    return dx, dy


def _on_grid(centre: Mask, k: int, dx: int, dy: int) -> tuple[Mask, tuple[int, int]]:
    """The pixels of the cells around those that are set, and where the first cell begins."""
    top, bottom = _span(np.flatnonzero(centre.any(axis=1)), k, dy)
    left, right = _span(np.flatnonzero(centre.any(axis=0)), k, dx)
    pixels = np.zeros((bottom - top, right - left), bool)
    part = centre[max(top, 0) : bottom, max(left, 0) : right]
    y, x = max(-top, 0), max(-left, 0)
    pixels[y : y + part.shape[0], x : x + part.shape[1]] = part
    return pixels, (left, top)


def _span(places: npt.NDArray[np.intp], k: int, offset: int) -> tuple[int, int]:
    """Where the first cell begins and the last one ends."""
    begin = (int(places[0]) - offset) // k * k + offset
    return begin, begin + ((int(places[-1]) - begin) // k + 1) * k


def _by_cell(pixels: Mask, k: int) -> Mask:
    """Return (H, k, W, k) pixels by cell."""
    height, width = pixels.shape
    return pixels.reshape(height // k, k, width // k, k)


def _largest_pieces(pixels: Mask, k: int) -> Mask:
    """The largest piece in each cell, of equal ones the first as one reads."""
    parts = connected_parts(pixels, k)
    size = np.bincount(parts.reshape(-1))
    begins = parts != 0
    begins[:, 1:] &= parts[:, 1:] != parts[:, :-1]
    at = np.flatnonzero(begins)  # a pixel of each part is enough
    rows, columns = np.divmod(at, parts.shape[1])
    cell = np.zeros(len(size), np.int64)
    cell[parts.reshape(-1)[at]] = rows // k * (parts.shape[1] // k) + columns // k
    by_size = 1 + np.lexsort((-size[1:], cell[1:]))  # stable: the first as one reads comes first
    _, best = np.unique(cell[by_size], return_index=True)
    is_kept = np.zeros(len(size), bool)
    is_kept[by_size[best]] = True
    pixels_kept: Mask = is_kept[parts]
    return pixels_kept


def _crossings(pixels: Mask, k: int) -> tuple[Mask, Mask]:
    """(H, W) each: whether set pixels touch across the border to the east, and to the south."""
    cells = _by_cell(pixels, k)
    east, south = (np.zeros((cells.shape[0], cells.shape[2]), bool) for _ in range(2))
    east[:, :-1] = (cells[:, :, :-1, -1] & cells[:, :, 1:, 0]).any(axis=1)
    south[:-1] = (cells[:-1, -1] & cells[1:, 0]).any(axis=2)
    return east, south


def piece_sizes(free: Mask, east: Mask, south: Mask) -> npt.NDArray[np.int64]:
    """How many cells each piece has, by the number that `pieces_of` gives it, from 1."""
    sizes: npt.NDArray[np.int64] = np.bincount(pieces_of(free, east, south).reshape(-1))[1:]
    return sizes


def pieces_of(free: Mask, east: Mask, south: Mask) -> npt.NDArray[np.int32]:
    """(H, W) the piece of each cell that exits connect, from 1 as one reads; 0: it is not free."""
    height, width = free.shape
    ways = np.zeros((2 * height - 1, 2 * width - 1), bool)  # cells, and the ways between them
    ways[::2, ::2] = free
    ways[::2, 1::2] = east[:, :-1]
    ways[1::2, ::2] = south[:-1]
    return connected_parts(ways)[::2, ::2]
