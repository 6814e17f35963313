"""One-way streets: moves against streets are closed where all ways that robots need remain.

    candidate  a direction of a stretch that costs CLOSING_RATIO times the opposite one, or more
    closed     one after another, those with the largest ratio times traffic first; each only if every
               cell that robots need still has its ways to and from the others
    reopened   those that do better open, in pairs of runs
    kept       the one-way design, if with fresh seeds it costs less than MOST_LOSS of the metric

An edge without which the floor would fall apart stays two-way: of a graph without such bridges all
edges can be directed so that it stays strongly connected (Robbins 1939).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.floor.floor_plan import STORAGE, FloorPlan
from automaton.floor.reachability import has_storage, reached_along, to_and_from
from automaton.scenario.changing_floor import Lift
from automaton.scenario.robot_types import RobotType, floor_by_type, rows_of
from automaton.studies.street_search.designs import StreetDesign, Stretch, stretches
from automaton.studies.street_search.reasons import Change, ComparedRuns, edges_of, move_ratio
from automaton.world.floor_parts import places_of, queue_path
from automaton.world.gate_cells import cells_of, gates_of
from automaton.world.resolved import Resolved

CLOSING_RATIO: Final = 4.0
MOST_LOSS: Final = 0.01  # of the metric, at the lower end of its interval
TRIED_RUNS: Final = 8  # of a closed stretch that is tried open; all runs only if these are better
Mask = NDArray[np.bool_]


# The ways that robots need.


class NeededWays:
    """The ways between the cells that the robots of a scenario need, by type and load.

    Robots need every cell that they reach and come back from: they may be pushed there. On rails a way
    leads from and to an axis of travel, because robots turn on turntables only. With storage, whatever
    is reached from a cell and back without driving through storage is a way.
    """

    def __init__(self, resolved: Resolved) -> None:
        """`resolved`: the scenario with its design, so that moves that it closes are not needed."""
        scenario, floor_plan = resolved.scenario, resolved.floor_plan
        self.floor_plan = floor_plan
        rows = {(one.closed, one.rail): one for one in rows_of(resolved.fleet.types, True)}
        self.types: tuple[RobotType, ...] = tuple(rows.values())
        needed: Mask = np.logical_or.reduce(resolved.fleet.within, axis=0)
        needed[places_of(scenario, floor_plan)] = True
        self.needed = needed
        self.moves = np.zeros((floor_plan.kind.size, 4), np.bool_)  # of station queues and lifts
        for station in scenario.stations.values():
            cells = [floor_plan.cell(*station.at)]
            cells += queue_path(floor_plan, station.at, station.queue)
            for ahead, cell in itertools.pairwise(cells):
                self.moves[cell, floor_plan.offsets.index(ahead - cell)] = True
        for lift in (gate for gate in gates_of(scenario.floor) if isinstance(gate.section, Lift)):
            shaft = np.array(cells_of(lift, floor_plan))  # robots come out at any of its mouths
            for direction, offset in enumerate(floor_plan.offsets):
                self.moves[shaft, direction] = self.moves[shaft - offset, direction] = True
        # Type, cell and axis from which ways begin and to which they lead; (4, cells) cells on them.
        self.ways: list[tuple[int, int, int, Mask]] = []
        by_type = floor_by_type(floor_plan, self.types)
        for number, plan in enumerate(by_type.floor_plans):
            self.find_ways(number, plan, self.needed & ~by_type.closed[number])

    def find_ways(self, number: int, floor_plan: FloorPlan, left: Mask) -> None:
        """Add the ways of a type to and from cells of each connected part; `left` is modified.

        Aisles come first: a cell of storage may have ways to aisles that have none to each other. On
        rails two cells may have ways to a third one, but none to each other: stations all count.
        """
        storage = floor_plan.kind.reshape(-1) == STORAGE
        while left.any():
            aisles = left & ~storage
            cell = int(np.argmax(aisles if aisles.any() else left))
            left[cell] = False
            for axis in (0, 1) if self.types[number].rail else (0,):
                cells = self.cells_on_ways(floor_plan, number, cell, axis)
                covered: Mask = np.logical_and(cells[:2].any(axis=0), cells[2:].any(axis=0))
                covered[floor_plan.stations] &= not self.types[number].rail
                left &= ~covered
                self.ways.append((number, cell, axis, cells))

    def cells_on_ways(self, floor_plan: FloorPlan, number: int, cell: int, axis: int) -> Mask:
        """(4, cells) needed cells reached from a cell, by axis, and those from which it is reached."""
        rail = self.types[number].rail
        if has_storage(floor_plan):
            return np.stack([to_and_from(floor_plan, cell, rail) & self.needed] * 4)
        starts = ([cell], []) if axis == 0 else ([], [cell])
        ways = [reached_along(floor_plan, starts, rail, back) for back in (False, True)]
        cells: Mask = np.concatenate(ways) & self.needed
        return cells

    def remain(self, closed: Mask) -> bool:
        """Whether all ways remain; `closed`: (cells, 4) the moves that are closed."""
        if (closed & self.moves).any():
            return False
        plans = floor_by_type(with_closed(self.floor_plan, closed), self.types).floor_plans
        return not any(
            (cells & ~self.cells_on_ways(plans[number], number, cell, axis)).any()
            for number, cell, axis, cells in self.ways
        )


def with_closed(floor_plan: FloorPlan, closed: Mask) -> FloorPlan:
    """The floor without some moves, (cells, 4)."""
    shut = (closed << np.arange(4)).sum(axis=1).astype(np.uint8).reshape(floor_plan.exits.shape)
    return floor_plan.with_exits(floor_plan.exits & ~shut)


def bridges(floor_plan: FloorPlan) -> Mask:
    """(cells, 4) moves over edges without which the floor falls apart (Tarjan 1974)."""
    exits, offsets = floor_plan.exits.reshape(-1), floor_plan.offsets
    linked = [
        (exits >> d & 1 != 0) | (np.roll(exits, -offset) >> (d ^ 2) & 1 != 0)
        for d, offset in enumerate(offsets)
    ]
    ways = [[d for d in range(4) if linked[d][cell]] for cell in range(exits.size)]
    marks = np.zeros((exits.size, 4), np.bool_)
    entered, low = [0] * exits.size, [0] * exits.size  # number of visit from 1; lowest reached
    visits = 0
    for root in range(exits.size):
        if entered[root] or not ways[root]:
            continue
        visits += 1
        entered[root] = low[root] = visits
        path = [(root, -1, iter(ways[root]))]  # cell, direction by which it was entered, rest
        while path:
            cell, came, rest = path[-1]
            for d in rest:
                ahead = cell + offsets[d]
                if d == came ^ 2:
                    continue
                if entered[ahead]:
                    low[cell] = min(low[cell], entered[ahead])
                    continue
                visits += 1
                entered[ahead] = low[ahead] = visits
                path.append((ahead, d, iter(ways[ahead])))
                break
            else:
                path.pop()
                if path:
                    before = path[-1][0]
                    low[before] = min(low[before], low[cell])
                    if low[cell] > entered[before]:
                        marks[before, came] = marks[cell, came ^ 2] = True
    return marks


# ClosedDirection.


class ClosedDirection(NamedTuple):
    """A direction of a stretch that may be closed."""

    stretch: Stretch
    cells: NDArray[np.int64]  # where its moves begin
    direction: int
    weight: float  # its cost as a multiple of the opposite direction's, times the traffic


class OneWay(NamedTuple):
    """A design with one-way streets, and whether it is good enough."""

    design: StreetDesign  # one-way if `is_kept`, else as it was
    closings: tuple[ClosedDirection, ...]  # of the one-way design
    reopened: tuple[ClosedDirection, ...]  # better open
    two_way: tuple[ClosedDirection, ...]  # would cut off ways that robots need
    change: Change | None  # of the metric against the design as it was; None: nothing to compare
    is_kept: bool


def flow_of(resolved: Resolved, seeds: Sequence[int]) -> NDArray[np.float64]:
    """(cells, 4) moves in a run out of each cell by direction, the mean over seeds."""
    from automaton.runs.simulation import Simulation

    flow = np.zeros((resolved.floor_plan.kind.size, 4))
    for seed in seeds:
        simulation = Simulation(resolved, seed, on_observe=Simulation.empty_observation)
        simulation.run()
        flow += simulation.observation.flow
    return flow / len(seeds)


def closing_candidates(
    design: StreetDesign, floor_plan: FloorPlan, flow: NDArray[np.float64]
) -> list[ClosedDirection]:
    """Directions that cost at least CLOSING_RATIO times the opposite, by ratio times traffic.

    `flow`: (cells, 4) moves in a run.
    """
    candidates = []
    for stretch in stretches(floor_plan):
        begin, end = edges_of(stretch, floor_plan)
        one_way = design.closed[begin, stretch.along] | design.closed[end, stretch.along ^ 2]
        begin, end = begin[~one_way], end[~one_way]
        if not len(begin):
            continue
        ratio = move_ratio(design, begin, end, stretch.along)
        if max(ratio, 1 / ratio) < CLOSING_RATIO:
            continue
        cells, direction = (end, stretch.along ^ 2) if ratio > 1 else (begin, stretch.along)
        traffic = flow[begin, stretch.along].sum() + flow[end, stretch.along ^ 2].sum()
        candidates.append(
            ClosedDirection(stretch, cells, direction, max(ratio, 1 / ratio) * traffic)
        )
    return sorted(candidates, key=lambda one: -one.weight)


def closed_where_possible(
    design: StreetDesign, ways: NeededWays, candidates: Sequence[ClosedDirection]
) -> tuple[list[ClosedDirection], list[ClosedDirection]]:
    """The candidates that can be closed together, without their bridges; and the others."""
    closed, possible, two_way = design.closed.copy(), [], []
    is_bridge = bridges(with_closed(ways.floor_plan, closed))
    for one in candidates:
        one = one._replace(cells=one.cells[~is_bridge[one.cells, one.direction]])
        tried = closed.copy()
        tried[one.cells, one.direction] = True
        if len(one.cells) and ways.remain(tried):
            closed = tried
            possible.append(one)
        else:
            two_way.append(one)
    return possible, two_way


def with_closings(design: StreetDesign, closings: Sequence[ClosedDirection]) -> StreetDesign:
    """The design with some further moves closed."""
    closed = design.closed.copy()
    for one in closings:
        closed[one.cells, one.direction] = True
    return design._replace(closed=closed)


def one_way(
    design: StreetDesign,
    ways: NeededWays,
    flow: NDArray[np.float64],
    compared: ComparedRuns,
    select: Sequence[int],
    held_out: Sequence[int],
) -> OneWay:
    """Make the streets of a design one-way where that costs little.

    `flow`: (cells, 4) moves in a run; `select`, `held_out`: seeds.
    """
    candidates = closing_candidates(design, ways.floor_plan, flow)
    closings, two_way = closed_where_possible(design, ways, candidates)
    if not closings:
        return OneWay(design, (), (), tuple(two_way), None, False)
    trial = with_closings(design, closings)
    others = [
        with_closings(design, [other for other in closings if other is not one]) for one in closings
    ]
    better = list(range(len(closings)))
    for seeds, gain in ((select[:TRIED_RUNS], compared.gain), (select, compared.least_gain)):
        changes = compared.effects([others[one] for one in better], trial, seeds)
        tried = zip(better, changes, strict=True)
        better = [number for number, one in tried if one is not None and gain(one) > 0]
    reopened = [closings[number] for number in better]
    closings = [one for number, one in enumerate(closings) if number not in better]
    trial = with_closings(design, closings)
    change = compared.effects([trial], design, held_out)[0] if closings else None
    is_kept = change is not None and compared.least_gain(change) > -MOST_LOSS
    used = trial if is_kept else design
    return OneWay(used, tuple(closings), tuple(reopened), tuple(two_way), change, is_kept)
