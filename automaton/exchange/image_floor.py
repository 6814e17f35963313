"""The floor of a map of ROS: pixels become cells, cells become a scenario (`pixel_cells`)."""

from __future__ import annotations

import re
from fractions import Fraction
from math import floor
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.exchange.imported_floor import (
    ALLOCATION,
    FREE,
    ROUTING,
    WALL,
    ImportedFloor,
    ImportOptions,
    ImportReport,
    check_size,
)
from automaton.exchange.ros_map import (
    PixelCells,
    RosMap,
    cells_of,
    centres,
    pieces_of,
    reach_of,
    read_ros_map,
)
from automaton.floor.cells import DIRECTIONS, EXIT_EAST, EXIT_NORTH, EXIT_SOUTH, EXIT_WEST
from automaton.units import count

FORMAT: Final = "map of ROS"
MAX_CELL: Final = 500  # pixels along a cell
MAX_MOVE: Final = 10_000  # ticks of a move
SPEED: Final = Fraction(1)  # m/s, where the options give none
RUN_TIME: Final = "1 h"
TOURS: Final = {"generator": "tours", "count": 100}
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
    check_size(cells.free.shape[1], cells.free.shape[0], file, "take a larger --cell")
    exits = _exits(cells)
    picture, legend = _drawn(cells.free, exits)
    robots = _starts(cells, options.robots or 1, file)
    sections = {
        "name": re.sub(r"[^\w. -]", "-", path.stem)[:200] or "map",
        "summary": f"{count(len(robots), 'robot')} on {cells.free.shape[1]} x {cells.free.shape[0]} "
        f"cells of {metres(cell)}, imported.",
        "fleet": {"robots": len(robots), "kinematics": "omni", "start": robots},
        **_times(cell, options, file),
        "orders": TOURS if _has_neighbours(exits) else {"list": [{"stops": [robots[0]]}]},
        "strategy": {"allocation": ALLOCATION, "routing": ROUTING},
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
            f"an image does not say how large a cell is: give --cell, in whole pixels of {metres(pixel)}",
            file,
        )
    if cell % pixel:
        lower = cell // pixel * pixel
        near = [metres(one) for one in (lower, lower + pixel) if one]
        raise InputError(
            f"--cell {metres(cell)} is not in whole pixels of {metres(pixel)}: take {' or '.join(near)}",
            file,
        )
    k = int(cell / pixel)
    if k > min(MAX_CELL, *shape):
        raise InputError(
            f"--cell {metres(cell)} is {k:,} pixels; the image has {shape[1]:,} x {shape[0]:,} of them, "
            f"and a cell {MAX_CELL} each way at most",
            file,
        )
    return k


def _nothing_left(ros_map: RosMap, robot: Fraction) -> ImportedFloor:
    free = int(np.count_nonzero(ros_map.free))
    refusal = (
        f"nothing is left: a robot of {metres(robot)} fits nowhere on {count(free, 'free pixel')}"
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
    """The picture and its legend: cells from which no exit leads to some free neighbour open sides."""
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


def _has_neighbours(exits: npt.NDArray[np.uint8]) -> bool:
    return bool(exits.any())


def _starts(cells: PixelCells, robots: int, file: str) -> list[list[int]]:
    """[x, y] of each robot: all over the largest piece, of equal ones the first."""
    pieces = pieces_of(cells.free, cells.east, cells.south)
    places = np.argwhere(pieces == 1 + np.bincount(pieces.reshape(-1))[1:].argmax())
    if robots > len(places):
        text = f"--robots {robots}, but the largest piece of the floor has {len(places):,} cells"
        raise InputError(text, file)
    chosen = places[np.arange(robots) * len(places) // robots]
    return [[x, y] for y, x in chosen.tolist()]


def _times(cell: Fraction, options: ImportOptions, file: str) -> dict[str, dict[str, Any]]:
    """Units and durations: without --tick a robot takes one for a cell."""
    speed = options.speed or SPEED
    tick = options.tick or cell / speed
    move = floor(cell / speed / tick + Fraction(1, 2))
    if not 1 <= move <= MAX_MOVE:
        raise InputError(
            f"a move over {metres(cell)} would take {move:,} ticks; it takes 1 to {MAX_MOVE:,}: "
            "change --tick or --speed",
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
        lost["origin, but for a comment"] = 1
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
