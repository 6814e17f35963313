"""The nodes and edges ahead of a robot, as the JSON of VDA 5050.

Routes are long, and most of a route is the same from message to message: a node keeps its number as
the robot comes nearer. So the text of a route is made once, and messages take what is left of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import msgspec

from automaton.engine.state import NIL
from automaton.floor.floor_plan import FloorPlan

EMPTY: Final = msgspec.Raw(b"[]")


class RouteState(NamedTuple):
    """What a robot's route ahead follows from."""

    i: int  # where the robot is stored
    cell: int  # where it is, or the cell that it leaves
    moves: int | None  # those begun for its order; None without one
    claim: int  # the cell that it enters, or NIL
    driven: int  # steps of the route
    length: int  # steps that it has
    route_hash: int


def route_columns(robots: Any, index: Any) -> Iterator[tuple[int, ...]]:
    """Return the last four entries of RouteState of each robot, stored at `index`."""
    arrays = (robots.claim, robots.route_index, robots.route_length, robots.route_hash)
    return zip(*(array[index].tolist() for array in arrays), strict=True)


class NodeNames(dict[int, str]):
    """The node of each cell, x_y; made when it is asked for."""

    def __init__(self, floor_plan: FloorPlan) -> None:
        self._floor_plan = floor_plan

    def __missing__(self, cell: int) -> str:
        x, y = self._floor_plan.xy(cell)
        name = self[cell] = f"{x}_{y}"
        return name


class RouteAhead:
    """One robot's route ahead."""

    def __init__(self, names: NodeNames, offsets: tuple[int, int, int, int]) -> None:
        self._names = names
        self._offsets = offsets  # from a cell to its neighbours
        self._key: tuple[int, ...] = ()
        self._cells: list[int] = []  # before each step of the route
        self._nodes: list[bytes] = []  # behind it
        self._edges: list[bytes] = []
        self._shown: RouteState | None = None  # for which the last two texts were made,
        self._texts = EMPTY, EMPTY  # nodes and edges

    def ahead(self, robots: Any, state: RouteState) -> tuple[int, msgspec.Raw, msgspec.Raw]:
        """The number of the last node, and the nodes and edges ahead; `robots` has the routes."""
        is_between = state.claim != NIL
        begun = int(is_between) if state.moves is None else state.moves
        last = 2 * (begun - is_between)
        if not is_between and state.driven >= state.length:
            return last, EMPTY, EMPTY
        if state != self._shown:
            self._shown = state
            self._renew(robots, state, begun - state.driven)
            nodes = self._nodes[state.driven : state.length]
            edges = self._edges[state.driven : state.length]
            if is_between:
                nodes.insert(0, self._node(state.claim, 2 * begun))
                edges.insert(0, self._edge(state.cell, state.claim, 2 * begun - 1))
            self._texts = _listed(nodes), _listed(edges)
        return last, *self._texts

    def _renew(self, robots: Any, state: RouteState, offset: int) -> None:
        """Make the texts of a route again if it is another one; `offset`: moves before its first step."""
        i, index, length = state.i, state.driven, state.length
        key = (state.route_hash, length, offset)
        start = int(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
        start = start if state.claim == NIL else state.claim
        if key == self._key and self._cells[index : index + 1] == [start]:
            return
        self._key = key
        self._cells = [NIL] * index + [start]
        self._nodes, self._edges = [b""] * index, [b""] * index  # those that it has left behind
        for step, direction in enumerate(robots.route[i, index:length].tolist(), index + 1):
            to = start + self._offsets[direction]
            self._cells.append(to)
            self._nodes.append(self._node(to, 2 * (offset + step)))
            self._edges.append(self._edge(start, to, 2 * (offset + step) - 1))
            start = to

    def _node(self, cell: int, number: int) -> bytes:
        return b'{"nodeId":"%b","sequenceId":%d,"released":true}' % (
            self._names[cell].encode(),
            number,
        )

    def _edge(self, one: int, other: int, number: int) -> bytes:
        return b'{"edgeId":"%b-%b","sequenceId":%d,"released":true}' % (
            self._names[one].encode(),
            self._names[other].encode(),
            number,
        )


def _listed(entries: list[bytes]) -> msgspec.Raw:
    return msgspec.Raw(b"[%b]" % b",".join(entries))
