"""A floor as a graph: nodes where something can be decided, and the edges between them.

v#######^###      A cell with one way in and one way out that run straight on is not a node, unless
>>>>>>>>└──t      it is a station or a charger, or moves take longer on one side of it. An edge
                  leads over such cells to the next node, in one direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError
from automaton.floor.cells import CHARGER, DIRECTIONS, STATION
from automaton.floor.floor_plan import FloorPlan

LONGEST_LIST = 3  # cells in an error


class FloorEdge(NamedTuple):
    """A way between two nodes, in this direction alone."""

    start: int  # flat cells
    end: int
    cells: int  # moves
    min_ticks: int  # that each of its moves takes at least


class FloorGraph(NamedTuple):
    """Nodes and edges in reading order."""

    nodes: list[int]  # flat cells
    edges: list[FloorEdge]
    alone: list[int]  # drivable cells that no way leads to or from: no nodes


def floor_graph(floor_plan: FloorPlan) -> FloorGraph:
    """Return the graph of a floor. Raises InputError where a cell holds more than one robot."""
    crowded = np.flatnonzero(floor_plan.drivable & (floor_plan.capacity != 1))
    if len(crowded):
        places = ", ".join(
            str(list(floor_plan.xy(cell))) for cell in crowded[:LONGEST_LIST].tolist()
        )
        more = ", ..." if len(crowded) > LONGEST_LIST else ""
        raise InputError(
            f"{len(crowded):,} cells of the floor hold more than one robot ({places}{more}); a node of a "
            "graph holds one"
        )
    exits = floor_plan.exits.reshape(-1)
    ticks = _ticks(floor_plan)
    incoming = _incoming(floor_plan)
    used = (exits | incoming) != 0
    straight = _straight_on(floor_plan, exits, incoming, ticks)
    nodes = np.flatnonzero(used & ~straight)
    edges = []
    for start in nodes.tolist():
        for direction in range(len(DIRECTIONS)):
            if exits[start] >> direction & 1:
                edges.append(_edge(floor_plan, straight, start, direction, ticks))
    alone = np.flatnonzero(floor_plan.drivable.reshape(-1) & ~used)
    return FloorGraph(nodes.tolist(), edges, alone.tolist())


def _ticks(floor_plan: FloorPlan) -> npt.NDArray[np.uint16]:
    """(cells, 4) ticks that a move out of a cell takes at least, by direction."""
    if len(floor_plan.min_move_ticks):
        return floor_plan.min_move_ticks
    return np.zeros((floor_plan.kind.size, len(DIRECTIONS)), np.uint16)


def _incoming(floor_plan: FloorPlan) -> npt.NDArray[np.uint8]:
    """(cells,) directions of travel in which a cell is entered, as bits."""
    exits = floor_plan.exits.reshape(-1)
    incoming = np.zeros_like(exits)
    for direction, offset in enumerate(floor_plan.offsets):
        # np.roll wraps round, but only through the border, which has no exits.
        incoming |= np.roll(exits & np.uint8(1 << direction), offset)
    return incoming


def _straight_on(
    floor_plan: FloorPlan,
    exits: npt.NDArray[np.uint8],
    incoming: npt.NDArray[np.uint8],
    ticks: npt.NDArray[np.uint16],
) -> npt.NDArray[np.bool_]:
    """(cells,) whether one way leads in and one out, straight on, at one speed."""
    kind = floor_plan.kind.reshape(-1)
    straight = np.zeros(kind.size, np.bool_)
    for direction, offset in enumerate(floor_plan.offsets):
        before = np.roll(ticks[:, direction], offset)
        straight |= (
            (exits == 1 << direction) & (exits == incoming) & (before == ticks[:, direction])
        )
    out: npt.NDArray[np.bool_] = straight & (kind != STATION) & (kind != CHARGER)
    return out


def _edge(
    floor_plan: FloorPlan,
    straight: npt.NDArray[np.bool_],
    start: int,
    direction: int,
    ticks: npt.NDArray[np.uint16],
) -> FloorEdge:
    """The edge that leaves a node in a direction."""
    offset = floor_plan.offsets[direction]
    end, cells = start + offset, 1
    while straight[end]:
        end, cells = end + offset, cells + 1
    return FloorEdge(start, end, cells, int(ticks[start, direction]))
