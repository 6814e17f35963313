"""Whether the vehicles of a layout fit its cells, and the speeds of its edges the ticks: sentences.

A robot takes one cell. Vehicles longer than a cell are not simulated: robots then drive and queue
closer together than the vehicles can.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Final

from automaton.errors import InputError
from automaton.exchange.graphs.fit import CANDIDATES, Fit, Speeds, exact, fit_graph
from automaton.exchange.graphs.graph import Graph
from automaton.exchange.imported_floor import EdgeRow, ImportOptions
from automaton.units import count

SPEED_ERROR: Final = 0.1  # share of an edge's speed; larger errors are named
FINER_TICKS: Final = range(2, 11)  # parts of a tick that are tried
SIZE_STEP: Final = CANDIDATES[0] - CANDIDATES[1]  # metres between two sizes of cells
LARGEST: Final = 2  # cells up to this many times the length of a vehicle are tried
SIZES_TRIED: Final = 40  # of them about so many
ACCEPTED: Final = 0.5  # the largest error of an edge in a suggestion


def size_of(graph: Graph, options: ImportOptions) -> tuple[Fraction | None, Fraction | None]:
    """Length and width of the largest vehicle in metres; None: unknown. --robot is a length."""
    lengths = [exact(one.length) for one in graph.vehicles if one.length]
    widths = [exact(one.width) for one in graph.vehicles if one.width]
    length = options.robot or max(lengths, default=None)
    return length, max(widths, default=None)


def fit_vehicles(graph: Graph, options: ImportOptions) -> Fit:
    """Return a graph on cells, each of which holds a vehicle if its size is known and this is possible.

    Of the accepted cells up to LARGEST times as long as a vehicle, the one that changes the edges least;
    otherwise the largest accepted cell. Raises InputError as `fit_graph` does.
    """
    largest = max((side for side in size_of(graph, options) if side), default=None)
    if options.cell is None and largest is not None:
        best = cell_for(graph, largest)
        if best is not None and _error(best) <= options.accept:
            return fit_graph(graph, best.cell, options.accept)
    return fit_graph(graph, options.cell, options.accept)


def cell_for(graph: Graph, length: Fraction) -> Fit | None:
    """Return the cell that holds a vehicle and changes the edges least; of equal ones the smallest.

    None if nodes or edges are in each other's way in all of them.
    """
    step = max(SIZE_STEP, math.ceil(length / (SIZES_TRIED * SIZE_STEP)) * SIZE_STEP)
    first = math.ceil(length / SIZE_STEP) * SIZE_STEP
    best: Fit | None = None
    for number in range(math.floor((LARGEST * length - first) / step) + 1):
        try:
            fit = fit_graph(graph, first + number * step, ACCEPTED)
        except InputError:
            continue  # two nodes in a cell, or roads in each other's way
        if best is None or round(_error(fit) - _error(best), 9) < 0:
            best = fit
    return best


def size_notes(graph: Graph, fit: Fit, options: ImportOptions) -> list[str]:
    """A sentence if the vehicles are larger than a cell, or if their size is unknown."""
    length, width = size_of(graph, options)
    cell = f"{float(fit.cell):g} m"
    if length is None and width is None:
        return [
            f"the file does not give the size of vehicles: a robot takes one cell of {cell}; set "
            "--robot to the length of a vehicle, such as --robot 1.6m"
        ]
    largest = max(side for side in (length, width) if side is not None)
    if largest <= fit.cell:
        return []
    is_length = length is not None and length > fit.cell
    what = f"{float(largest):g} m {'long' if is_length else 'wide'}"
    text = (
        f"vehicles are {what}, but a cell is {cell}: a robot takes one cell, so robots drive and "
        "queue closer together than these vehicles can"
    )
    return [f"{text}; {_larger_cells(graph, largest)}"]


def _larger_cells(graph: Graph, length: Fraction) -> str:
    """The cell that holds a vehicle and changes the edges least, or the edge that prevents it."""
    best = cell_for(graph, length)
    if best is None:
        return f"in cells of {float(length):g} m or more, nodes or edges are in each other's way"
    edge, cell = graph.edges[best.worst], float(best.cell)
    changed = f"the edge {edge.name} ({edge.metres:.4g} m) by {100 * best.error[best.worst]:+.1f} %"
    if best.refusal:
        return f"cells that hold a vehicle change edges too much: {cell:g} m, the best, changes {changed}"
    accept = math.ceil(100 * _error(best) - 1e-9)
    return f"--cell {cell:g}m --accept {accept}% makes cells that hold a vehicle, and changes {changed}"


def _error(fit: Fit) -> float:
    return float(abs(fit.error[fit.worst]))


def speed_notes(graph: Graph, rows: tuple[EdgeRow, ...], speeds: Speeds) -> list[str]:
    """A sentence if whole ticks change the speed of an edge by more than SPEED_ERROR."""
    wrong = [row for row in rows if abs(row.speed_error) > SPEED_ERROR]
    if not wrong:
        return []
    worst = max(wrong, key=lambda row: (abs(row.speed_error), row.name))
    tick = float(speeds.tick)
    drawn, wanted = (
        x / tick for x in (worst.drawn / worst.ticks, worst.metres / worst.ticks_wanted)
    )
    more = count(len(wrong) - 1, "more edge")
    others = f"; {more} {'are' if wrong[2:] else 'is'} more than 10 % off" if wrong[1:] else ""
    text = (
        f"rounded to whole cells and ticks, the speed of the edge {worst.name} is {drawn:.3g} m/s "
        f"instead of {wanted:.3g} m/s ({100 * worst.speed_error:+.0f} %){others}"
    )
    finer = _finer_tick(speeds)
    return [f"{text}; --tick {float(finer):.4g}s keeps all within 10 %" if finer else text]


def _finer_tick(speeds: Speeds) -> Fraction | None:
    """The longest part of a tick with which all edges keep their speeds, or None."""
    for parts in FINER_TICKS:
        tick = Fraction(f"{float(speeds.tick / parts):.4g}")
        finer = speeds._replace(tick=tick)
        if all(
            abs(float(speeds.cell / (finer.ticks(speed) * tick * speed)) - 1) <= SPEED_ERROR
            for speed in set(speeds.of_edge)
        ):
            return tick
    return None
