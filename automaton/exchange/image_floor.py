"""Import a map of ROS: pixels become cells, and cells become a scenario.

    pixels  #######      cells, two pixels each way      A robot's centre keeps half its width away
            #.....#      . .                             from what is occupied. A cell is free where
            #.#####      |                               such a pixel is left in it; an exit leads
            #.#          .                               where such pixels touch across the border.

Pixels and cells are connected with their four neighbours. (h, w) are rows and columns of pixels, (H, W)
of cells; a cell has k x k pixels.
"""

from __future__ import annotations

import re
from fractions import Fraction
from math import ceil, floor
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.imported_floor import (
    FREE,
    ROUTING,
    WALL,
    ImportedFloor,
    ImportOptions,
    ImportReport,
    check_size,
)
from automaton.exchange.problem import connected_parts
from automaton.exchange.ros_map import Mask, RosMap, read_ros_map
from automaton.floor.floor_plan import DIRECTIONS, EXIT_EAST, EXIT_NORTH, EXIT_SOUTH, EXIT_WEST
from automaton.strategy.lookup import IMPORTED, default_for
from automaton.units import count

FORMAT: Final = "map of ROS"
MAX_CELL_PIXELS: Final = 500  # pixels along a cell
MAX_MOVE: Final = 10_000  # ticks of a move
USUAL_SPEED: Final = Fraction(1)  # m/s, where the options give none
RUN_TIME: Final = "1 h"
TOUR_ORDERS: Final = {"generator": "tours", "count": 100}
BOX: Final = "·╶╷┌╴─┐┬╵└│├┘┴┤┼"  # by exits: bit d leads in direction d
BITS: Final = (EXIT_EAST, EXIT_SOUTH, EXIT_WEST, EXIT_NORTH)


def read_image_floor(path: Path, options: ImportOptions) -> ImportedFloor:
    """Read a map of ROS as a floor of cells. Raises InputError."""
    ros_map = read_ros_map(path)
    file, pixel = str(path), ros_map.resolution
    k = _pixels_of_a_cell(options, pixel, ros_map.free.shape, file)
    cell = k * pixel
    open_ = ros_map.free | ros_map.unknown if options.unknown == "free" else ros_map.free
    cells = cells_of(centres(open_, reach_of(options.robot or cell, pixel)), k)
    if cells is None:
        return _nothing_left(ros_map, options.robot or cell)
    check_size(cells.free.shape[1], cells.free.shape[0], file, "use a larger --cell")
    exits = _exits(cells)
    picture, legend = _drawn(cells.free, exits)
    robots = _starts(cells, options.robots or 1, file)
    sections = {
        "name": re.sub(r"[^\w. -]", "-", path.stem)[:200] or "map",
        "summary": f"{count(len(robots), 'robot')} on {cells.free.shape[1]} x {cells.free.shape[0]} "
        f"cells of {metres(cell)}, imported.",
        "fleet": {"robots": len(robots), "kinematics": "omni", "start": robots},
        **_times(cell, options, file),
        "orders": TOUR_ORDERS if exits.any() else {"list": [{"stops": [robots[0]]}]},
        "strategy": {"allocation": default_for("allocation", IMPORTED), "routing": ROUTING},
        "stop": {"when": "delivered", "max_duration": options.ticks or RUN_TIME},
        "seed": 1,
    }
    report = ImportReport(
        FORMAT,
        _facts(ros_map, open_, cells, len(robots)),
        lost=_lost(ros_map),
        notes=_notes(ros_map, options),
        picture=picture,
    )
    return ImportedFloor(picture, legend, sections, report, comments=_comments(ros_map, cells))


def metres(length: Fraction) -> str:
    """A length as text, without an exponent."""
    return f"{float(length):.9f}".rstrip("0").rstrip(".") + " m"


def _pixels_of_a_cell(
    options: ImportOptions, pixel: Fraction, shape: tuple[int, ...], file: str
) -> int:
    cell = options.cell
    if cell is None and options.robot is not None:
        cell = pixel * -(-options.robot // pixel)
    if cell is None:
        raise InputError(
            f"an image has no cell size: set --cell to whole pixels of {metres(pixel)}",
            file,
        )
    if cell % pixel:
        lower = cell // pixel * pixel
        near = [metres(one) for one in (lower, lower + pixel) if one]
        raise InputError(
            f"--cell {metres(cell)} is not a whole number of pixels of {metres(pixel)}: use "
            f"{' or '.join(near)}",
            file,
        )
    k = int(cell / pixel)
    if k > min(MAX_CELL_PIXELS, *shape):
        raise InputError(
            f"--cell {metres(cell)} is {k:,} pixels; the image has {shape[1]:,} x {shape[0]:,} "
            f"pixels, and a cell has at most {MAX_CELL_PIXELS} per side",
            file,
        )
    return k


def _nothing_left(ros_map: RosMap, robot: Fraction) -> ImportedFloor:
    free = int(np.count_nonzero(ros_map.free))
    refusal = (
        f"no free cell is left: a robot of {metres(robot)} does not fit on "
        f"{count(free, 'free pixel')}"
    )
    report = ImportReport(FORMAT, {"pixels_free": free}, lost=_lost(ros_map), refusal=refusal)
    return ImportedFloor("", {}, {}, report)


def _exits(cells: PixelCells) -> npt.NDArray[np.uint8]:
    """(H, W) exits of each cell."""
    exits = np.zeros(cells.free.shape, np.uint8)
    exits |= EXIT_EAST * cells.east.astype(np.uint8)
    exits |= EXIT_SOUTH * cells.south.astype(np.uint8)
    exits[:, 1:] |= EXIT_WEST * cells.east[:, :-1].astype(np.uint8)
    exits[1:] |= EXIT_NORTH * cells.south[:-1].astype(np.uint8)
    return exits


def _drawn(
    free: npt.NDArray[np.bool_], exits: npt.NDArray[np.uint8]
) -> tuple[str, dict[str, dict[str, Any]]]:
    """The picture and its legend: cells without exits to all free neighbours have open sides."""
    beside = np.zeros(free.shape, np.uint8)
    beside[:, :-1] |= EXIT_EAST * free[:, 1:].astype(np.uint8)
    beside[:-1] |= EXIT_SOUTH * free[1:].astype(np.uint8)
    beside[:, 1:] |= EXIT_WEST * free[:, :-1].astype(np.uint8)
    beside[1:] |= EXIT_NORTH * free[:-1].astype(np.uint8)
    wrong = free & (exits != beside)
    symbols = np.where(free, FREE, WALL)
    symbols = np.where(wrong, np.array(list(BOX))[exits], symbols)
    legend: dict[str, dict[str, Any]] = {}
    for bits in np.unique(exits[wrong]).tolist():
        names = [name for name, bit in zip(DIRECTIONS, BITS, strict=True) if bits & bit]
        legend[BOX[bits]] = {"kind": "floor", "opens" if names else "exits": names}
    return "".join("".join(row) + "\n" for row in symbols.tolist()), legend


def _starts(cells: PixelCells, robots: int, file: str) -> list[list[int]]:
    """[x, y] of each robot, spread over the largest piece; of equal pieces the first."""
    pieces = pieces_of(cells.free, cells.east, cells.south)
    places = np.argwhere(pieces == 1 + np.bincount(pieces.reshape(-1))[1:].argmax())
    if robots > len(places):
        text = f"--robots {robots}, but the largest piece of the floor has {len(places):,} cells"
        raise InputError(text, file)
    chosen = places[np.arange(robots) * len(places) // robots]
    return [[x, y] for y, x in chosen.tolist()]


def _times(cell: Fraction, options: ImportOptions, file: str) -> dict[str, dict[str, Any]]:
    """Units and durations: without --tick, a tick is the time of a move."""
    speed = options.speed or USUAL_SPEED
    tick = options.tick or cell / speed
    move = floor(cell / speed / tick + Fraction(1, 2))
    if not 1 <= move <= MAX_MOVE:
        raise InputError(
            f"a move over {metres(cell)} would take {move:,} ticks, but 1 to {MAX_MOVE:,} are "
            "allowed: change --tick or --speed",
            file,
        )
    seconds = metres(tick).removesuffix("m") + "s"
    return {"units": {"tick": seconds, "cell": metres(cell)}, "durations": {"move": move}}


def _facts(
    ros_map: RosMap, open_: npt.NDArray[np.bool_], cells: PixelCells, robots: int
) -> dict[str, float]:
    height, width = cells.free.shape
    pixels = {
        "free": int(np.count_nonzero(open_)),
        "reached": cells.reached,
        "kept": cells.pixels_kept,
    }
    area = ros_map.resolution**2
    return {
        "columns": width,
        "rows": height,
        "robots": robots,
        "cells": int(np.count_nonzero(cells.free)),
        **{f"pixels_{name}": number for name, number in pixels.items()},
        **{f"m2_{name}": round(float(number * area), 4) for name, number in pixels.items()},
        "offset_x": cells.offset[0],
        "offset_y": cells.offset[1],
        "pieces_before": cells.pieces[0],
        "pieces_after": cells.pieces[1],
        "passages_lost": cells.passages_lost,
    }


def _lost(ros_map: RosMap) -> dict[str, int]:
    unknown = int(np.count_nonzero(ros_map.unknown))
    lost = {"pixels of unknown area": unknown} if unknown else {}
    if any(ros_map.origin):
        lost["origin (kept only in a comment)"] = 1
    return lost | {f"key {key}": 1 for key in ros_map.unread}


def _notes(ros_map: RosMap, options: ImportOptions) -> tuple[str, ...]:
    notes = []
    if ros_map.unknown.any():
        notes.append(f"unknown area counts as {'free' if options.unknown == 'free' else 'wall'}")
    if ros_map.mode == "scale":
        notes.append("mode scale is read as trinary")
    return tuple(notes)


def _comments(ros_map: RosMap, cells: PixelCells) -> tuple[str, ...]:
    x, y, yaw = ros_map.origin
    height, width = ros_map.free.shape
    left, top = cells.first
    return (
        f"Image of {width} x {height} pixels of {metres(ros_map.resolution)}; its lower left pixel is at "
        f"x {x:g} m, y {y:g} m, yaw {yaw:g}.",
        f"Cell (0, 0) begins at pixel column {left}, row {top} from the upper left.",
    )


# Pixels as cells.


class PixelCells(NamedTuple):
    """The cells of an image, cropped to those that are free."""

    free: Mask  # (H, W)
    east: Mask  # (H, W) whether an exit leads to the cell to the east
    south: Mask  # (H, W) likewise to the south
    offset: tuple[int, int]  # x, y of the first grid line, in pixels
    first: tuple[int, int]  # column and row of the image, in pixels, where the first cell begins
    reached: int  # pixels that a robot's centre reaches
    pixels_kept: int  # number of those pixels that the cells keep
    pieces: tuple[int, int]  # number of connected pieces of these pixels, and of the cells
    passages_lost: int  # borders between cells that reached pixels cross, but no kept pixels


def centres(open_: Mask, reach: int) -> Mask:
    """(h, w) pixels with only open pixels within Chebyshev distance `reach`; outside, none is open."""
    if 2 * reach + 1 > min(open_.shape):
        return np.zeros_like(open_)
    window = 2 * reach + 1
    blocked = any_within(any_within(~open_, window, 0), window, 1)
    out = np.zeros_like(open_)
    out[reach : out.shape[0] - reach, reach : out.shape[1] - reach] = ~blocked
    return out


def reach_of(width: Fraction, pixel: Fraction) -> int:
    """The least distance, in pixels, of the centre of a robot of this width from occupied pixels."""
    return max(0, ceil(width / (2 * pixel) - Fraction(1, 2)))


def any_within(mask: Mask, window: int, axis: int) -> Mask:
    """Whether any of `window` pixels along an axis is set, for each window inside the image."""
    rows = mask if axis == 0 else mask.T
    length = 1
    while 2 * length <= window:  # doubling: the cost grows with the logarithm of the window
        rows = rows[:-length] | rows[length:]
        length *= 2
    if length < window:
        rest = window - length
        rows = rows[:-rest] | rows[rest:]
    return rows if axis == 0 else rows.T


def cells_of(centre: Mask, k: int) -> PixelCells | None:
    """The cells of k x k pixels; None if no pixel is open for the centre of a robot."""
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
    """The offset with the most free cells: x, y in pixels; ties: uppermost, then leftmost."""
    padded = np.pad(centre, k - 1)
    # [i, j]: the window that begins at i - k + 1, j - k + 1.
    windows = any_within(any_within(padded, k, 0), k, 1)
    height, width = (-(-size // k) * k for size in windows.shape)
    rounded_up = np.zeros((height, width), bool)
    rounded_up[: windows.shape[0], : windows.shape[1]] = windows
    cells = rounded_up.reshape(height // k, k, width // k, k).sum(axis=(0, 2), dtype=np.int64)
    dy, dx = divmod(int(np.roll(cells, (1, 1), (0, 1)).argmax()), k)
    return dx, dy


def _on_grid(centre: Mask, k: int, dx: int, dy: int) -> tuple[Mask, tuple[int, int]]:
    """The pixels of the cells around the set pixels, and the begin of the first cell."""
    top, bottom = _span(np.flatnonzero(centre.any(axis=1)), k, dy)
    left, right = _span(np.flatnonzero(centre.any(axis=0)), k, dx)
    pixels = np.zeros((bottom - top, right - left), bool)
    part = centre[max(top, 0) : bottom, max(left, 0) : right]
    y, x = max(-top, 0), max(-left, 0)
    pixels[y : y + part.shape[0], x : x + part.shape[1]] = part
    return pixels, (left, top)


def _span(places: npt.NDArray[np.intp], k: int, offset: int) -> tuple[int, int]:
    """The begin of the first cell and the end of the last one."""
    begin = (int(places[0]) - offset) // k * k + offset
    return begin, begin + ((int(places[-1]) - begin) // k + 1) * k


def _by_cell(pixels: Mask, k: int) -> Mask:
    """Return (H, k, W, k) pixels by cell."""
    height, width = pixels.shape
    return pixels.reshape(height // k, k, width // k, k)


def _largest_pieces(pixels: Mask, k: int) -> Mask:
    """The largest piece in each cell; of equal ones the first in reading order."""
    parts = connected_parts(pixels, k)
    size = np.bincount(parts.reshape(-1))
    begins = parts != 0
    begins[:, 1:] &= parts[:, 1:] != parts[:, :-1]
    at = np.flatnonzero(begins)  # one pixel of each part is enough
    rows, columns = np.divmod(at, parts.shape[1])
    cell = np.zeros(len(size), np.int64)
    cell[parts.reshape(-1)[at]] = rows // k * (parts.shape[1] // k) + columns // k
    by_size = 1 + np.lexsort((-size[1:], cell[1:]))  # stable: reading order
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
    """The number of cells of each piece, by its number from `pieces_of`, from 1."""
    sizes: npt.NDArray[np.int64] = np.bincount(pieces_of(free, east, south).reshape(-1))[1:]
    return sizes


def pieces_of(free: Mask, east: Mask, south: Mask) -> npt.NDArray[np.int32]:
    """(H, W) the connected piece of each cell, from 1 in reading order; 0: not free."""
    height, width = free.shape
    ways = np.zeros((2 * height - 1, 2 * width - 1), bool)  # cells, and the ways between them
    ways[::2, ::2] = free
    ways[::2, 1::2] = east[:, :-1]
    ways[1::2, ::2] = south[:-1]
    return connected_parts(ways)[::2, ::2]
