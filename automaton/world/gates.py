"""The gates of a floor at tick 0, and all their closings, which are drawn before the run."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from automaton.engine.facilities import Gates
from automaton.engine.state import GATE_DOOR, GATE_LIFT, NEVER, NIL, Array
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.changing_floor import Block, Lift
from automaton.scenario.schema import Scenario
from automaton.world.gate_cells import (
    MAX_CLOSINGS,
    Gate,
    cells_of,
    check_starts_at_gates,
    closings_of,
    gates_of,
    mouths_of,
    shares,
    too_many_closings,
)
from automaton.world.resolved import Resolved

REPLAN_AFTER_S = 30  # unless the scenario says

NO_GATES = dict.fromkeys("gcexarny", 0)


def build_gates(resolved: Resolved, starts: Array, seed: int, tick_us: int) -> Gates:
    """The gates at tick 0. `starts`: flat cells of robots that begin on the floor. Raises InputError."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    gates = list(gates_of(scenario.floor))
    if not gates:
        return Gates.sized(NO_GATES)
    check_starts_at_gates(scenario, floor_plan, starts.tolist())
    cells = [cells_of(gate, floor_plan) for gate in gates]
    mouths = [  # of lifts; empty for other gates
        mouths_of(inside, floor_plan) if gate.kind == GATE_LIFT else []
        for gate, inside in zip(gates, cells, strict=True)
    ]
    cell_first, cell_gate, cell_index = gates_by_cell(cells, mouths, floor_plan)
    closings = [closings_of(gate, number, scenario, seed) for number, gate in enumerate(gates)]
    first_closing = np.cumsum([0, *map(len, closings)])
    if first_closing[-1] > MAX_CLOSINGS:
        raise InputError(too_many_closings(int(first_closing[-1])))
    count, n = len(gates), scenario.fleet.robots
    most = int(np.diff(cell_first).max())
    sizes = {"g": count, "c": floor_plan.kind.size, "r": n, "n": n, "y": n * most}
    has_doors = [gate.kind in (GATE_DOOR, GATE_LIFT) for gate in gates]
    return Gates.sized(
        sizes,
        kind=np.array([gate.kind for gate in gates], np.uint8),
        cell_first=cell_first,
        cell_gate=cell_gate,
        cell_index=cell_index,
        first_closing=first_closing.astype(np.int32),
        closings=np.concatenate(closings).reshape(-1, 2),
        replan_after=replan_after(scenario, tick_us),
        cabin_ticks=cabin_ticks(gates, cells, mouths, floor_plan),
        open_from=np.where(has_doors, NEVER, 0).astype(np.int64),
        mouth=np.array([one[0] if one else NIL for one in mouths], np.int32),
        **columns_of(gates),
    )


def columns_of(gates: list[Gate]) -> dict[str, Array]:
    """The properties of gates, by the fields of Gates."""
    sections: list[Any] = [gate.section for gate in gates]

    def column(dtype: Any, *names: str) -> Array:
        values = [
            next((getattr(one, name) for name in names if hasattr(one, name)), 0)
            for one in sections
        ]
        return np.array(values, dtype)

    most = [one.max_robots if isinstance(one, Block) else isinstance(one, Lift) for one in sections]
    one_way = [isinstance(one, Block) and one.direction == "same" for one in sections]
    return {
        "known": column(np.uint8, "known"),
        "max_robots": np.array(most, np.int32),
        "same_way": np.array(one_way, np.uint8),
        "opening_ticks": column(np.int64, "opening_time", "door_time"),
        "hold_ticks": column(np.int64, "hold_open"),
        "travel_ticks": column(np.int64, "travel_time"),
    }


def gates_by_cell(
    cells: list[list[int]], mouths: list[list[int]], floor_plan: FloorPlan
) -> tuple[Array, Array, Array]:
    """The gates of each cell, cell by cell, and in a lift the index of the last mouth up to the cell.

    A cell between two mouths counts as the first of them on the path of the shaft. With fleet.when_idle:
    leave, a towed robot may come back there, and calls the cabin to that mouth.
    """
    pairs = sorted((cell, number) for number, inside in enumerate(cells) for cell in inside)
    count = np.bincount([cell for cell, _ in pairs], minlength=floor_plan.kind.size)
    place = [  # NIL in other gates, which have no mouths
        dict(zip(inside, (np.cumsum(np.isin(inside, ways_in)) - 1).tolist(), strict=True))
        for inside, ways_in in zip(cells, mouths, strict=True)
    ]
    index = [place[number][cell] for cell, number in pairs]
    return (
        np.concatenate([[0], np.cumsum(count)]).astype(np.int32),
        np.array([number for _, number in pairs], np.int32),
        np.array(index, np.int32),
    )


def cabin_ticks(
    gates: list[Gate], cells: list[list[int]], mouths: list[list[int]], floor_plan: FloorPlan
) -> Array:
    """(C, 4) int32: ticks of the moves in shafts.

    The moves from one mouth to the next share the travel time equally; the last one also takes the rest.
    """
    ticks = np.zeros((floor_plan.kind.size, 4), np.int32)
    for gate, shaft, ways_in in zip(gates, cells, mouths, strict=True):
        if not isinstance(gate.section, Lift):
            continue
        open_cells = set(ways_in)
        for path in (shaft, shaft[::-1]):
            places = [place for place, cell in enumerate(path) if cell in open_cells]
            for begin, end in itertools.pairwise(places):
                share, last = shares(gate.section.travel_time, end - begin)
                for place in range(begin, end):
                    way = floor_plan.offsets.index(path[place + 1] - path[place])
                    ticks[path[place], way] = share
                ticks[path[end - 1], way] = last
    return ticks


def replan_after(scenario: Scenario, tick_us: int) -> Array:
    """The ticks after which robots are rerouted around closings; empty if never."""
    after = scenario.floor.replan_after
    if after is None:
        return np.zeros(0, np.int64)
    if isinstance(after, str):
        after = max(1, round(REPLAN_AFTER_S * 1_000_000 / tick_us)) if tick_us else REPLAN_AFTER_S
    return np.array([after], np.int64)
