"""Robots as they are drawn where a cell is several rows high.

A character is two pixels, one above the other, so that a cell of 6 x 3 characters has 6 x 6 of them.
The front of a robot that drives is pointed, that of one that waits is flat, and one that is parked,
charges or is down has no front. Its sign is near the front, its number in the middle, its load lies
behind in a colour of its own, and where it has a battery a bar shows the charge.

    ####..     drives east      ######     waits       .####.     is parked
    #####.                      ######                 ######
    ##12##                      ##12##                 ##12##
    ######                      ######                 ######
    #LLL#.                      #LLL##                 ######
    ----..                      ----##                 .####.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

# What a pixel shows; BAR + j is pixel j of the bar of the battery.
OUTSIDE: Final = 0
BODY: Final = 1
LOAD: Final = 2
BAR: Final = 3

# Outlines.
POINTED: Final = 0
FLAT: Final = 1
ROUND: Final = 2  # without a front

EAST, SOUTH, WEST, NORTH = range(4)
MARGIN_HEIGHT: Final = 5  # rows of a cell from which on robots leave a pixel above and below
BAR_HEIGHT: Final = 3  # rows of a cell from which on there is room for the bar
POINT: Final = 3  # pixels that a pointed front is deep, at most; a quarter of large robots


class Sprites(NamedTuple):
    """Drawings for one size of a cell, by outline, load (0, 1) and direction."""

    upper: NDArray[np.uint8]  # (3, 2, 4, characters) what the upper pixel of each shows
    lower: NDArray[np.uint8]  # the same of the lower ones
    sign: NDArray[np.intp]  # (3, 4) the character of the sign
    number: NDArray[np.intp]  # (3, 4) the first character of the number
    room: NDArray[np.intp]  # (3, 4) characters for the number
    bar: NDArray[np.intp]  # (3, 4) pixels of the bar


class _Box(NamedTuple):
    """Pixels x in [left, right), y in [top, bottom)."""

    left: int
    top: int
    right: int
    bottom: int


@lru_cache(maxsize=16)
def sprites(width: int, height: int, bar: bool) -> Sprites:
    """Robots in cells of width x height characters, with the bar of a battery or without."""
    upper = np.zeros((3, 2, 4, height * width), np.uint8)
    lower = np.zeros_like(upper)
    sign, number, room, bars = (np.zeros((3, 4), np.intp) for _ in range(4))
    for outline in (POINTED, FLAT, ROUND):
        for direction in range(4):
            way = NORTH if outline == ROUND else direction
            place = sign[outline, direction] = _sign(width, height, way)
            row, first, last = _number_row(width, height, way)
            first += row * width + first == place
            last -= row * width + last - 1 == place
            number[outline, direction], room[outline, direction] = row * width + first, last - first
            for load in (0, 1):
                pixels = _pixels(width, height, outline, way, bool(load), bar)
                upper[outline, load, direction] = pixels[0::2].reshape(-1)
                lower[outline, load, direction] = pixels[1::2].reshape(-1)
            bars[outline, direction] = np.count_nonzero(pixels >= BAR)
    return Sprites(upper, lower, sign, number, room, bars)


def _pixels(
    width: int, height: int, outline: int, direction: int, load: bool, bar: bool
) -> NDArray[np.uint8]:
    """(2 height, width) what each pixel shows."""
    pixels = np.zeros((2 * height, width), np.uint8)
    box = _body(width, height)
    pixels[box.top : box.bottom, box.left : box.right] = BODY
    if outline == POINTED:
        _point(pixels, direction)
    elif outline == ROUND:
        for x in (box.left, box.right - 1):
            pixels[[box.top, box.bottom - 1], x] = OUTSIDE
    if load:
        rows, columns = _load(width, height, direction)
        area = pixels[2 * rows.start : 2 * rows.stop, columns]
        area[area == BODY] = LOAD
    if bar and height >= BAR_HEIGHT:
        row = pixels[box.top if direction == SOUTH else box.bottom - 1]
        here = np.flatnonzero(row)
        row[here] = BAR + np.arange(len(here))
    return pixels


def _body(width: int, height: int) -> _Box:
    """The pixels of a robot without its point."""
    across = int(height >= MARGIN_HEIGHT - 1 and width > 4)
    down = int(height >= MARGIN_HEIGHT)
    return _Box(across, down, width - across, 2 * height - down)


def _columns(width: int, height: int) -> tuple[int, int]:
    """The first column of the body, and the one behind it."""
    box = _body(width, height)
    return box.left, box.right


def _point(pixels: NDArray[np.uint8], direction: int) -> None:
    """Cut the corners of the front; a point reaches into the margin, as far as there is one."""
    turned = np.rot90(pixels, direction + 1)  # the front is above
    front = int(np.flatnonzero(turned.any(axis=1))[0])
    columns = np.flatnonzero(turned[front])
    left, right = int(columns[0]), int(columns[-1]) + 1
    deep = max(min((right - left) // 2 - 1, max(POINT, (right - left) // 4)), 0)
    if front:
        front -= 1
        turned[front, left:right] = BODY
    for row in range(deep):
        cut = deep - row
        turned[front + row, left : left + cut] = turned[front + row, right - cut : right] = OUTSIDE


def _number_row(width: int, height: int, direction: int) -> tuple[int, int, int]:
    """The row of the number, its first column, and the one behind its last."""
    first, last = _columns(width, height)
    if height == 2:
        ends = {EAST: (0, width - 1), WEST: (1, width)}
        return int(direction == NORTH), *ends.get(direction, (first, last))
    return height // 2 if direction == SOUTH else (height - 1) // 2, first, last


def _sign(width: int, height: int, direction: int) -> int:
    """The character of the sign."""
    row, first, last = _number_row(width, height, direction)
    middle = (width - 1) // 2
    if height == 2:
        column = {EAST: width - 2, WEST: 1}.get(direction, middle)
        return (0 if direction == NORTH else 1) * width + column
    if direction == EAST:
        return row * width + last - 1
    if direction == WEST:
        return row * width + first
    return (row + (1 if direction == SOUTH else -1)) * width + middle


def _load(width: int, height: int, direction: int) -> tuple[slice, slice]:
    """Rows and columns of the characters that show the load."""
    row, first, last = _number_row(width, height, direction)
    if height == 2:
        wide = max(width // 2, 1)
        if direction == EAST:
            return slice(1, 2), slice(0, wide)
        row = row if direction in (SOUTH, NORTH) else 1
        return slice(row, row + 1), slice(width - wide, width)
    high = (height - 1) // 2
    wide = max((last - first) * 2 // 3, 2)
    left = first + (last - first - wide) // 2
    rows = slice(row - high, row) if direction == SOUTH else slice(row + 1, row + 1 + high)
    return rows, slice(left, left + wide)
