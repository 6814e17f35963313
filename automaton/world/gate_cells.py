"""The gates of a scenario: closings, doors, blocks and lifts; their cells, and when cells are closed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.engine.state import GATE_BLOCK, GATE_CLOSING, GATE_DOOR, GATE_LIFT
from automaton.errors import Finding, InputError, Keys
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.changing_floor import (
    Block,
    ChangingFloor,
    Closing,
    Door,
    Lift,
    MeanGap,
    cells_of_set,
)
from automaton.scenario.durations import Distribution
from automaton.scenario.schema import MAX_MOVE_TICKS, Scenario
from automaton.units import ticks_and_time, unit

CELL_KEYS: Final = {GATE_CLOSING: "cells", GATE_DOOR: "at", GATE_BLOCK: "cells", GATE_LIFT: "shaft"}
MAX_CLOSINGS: Final = 4_000_000  # per run

Array = npt.NDArray[Any]


class Gate(NamedTuple):
    """A gate as a scenario has it."""

    kind: int  # GATE_*
    section: Closing | Door | Block | Lift
    keys: Keys  # keys of its section
    name: str  # in messages


def gates_of(floor: ChangingFloor) -> Iterator[Gate]:
    """All gates in the order of their numbers."""
    for number, closing in enumerate(floor.closed):
        yield Gate(GATE_CLOSING, closing, ("floor", "closed", number), f"closing {number + 1}")
    for number, door in enumerate(floor.doors):
        yield Gate(GATE_DOOR, door, ("floor", "doors", number), f"door {number + 1}")
    for number, block in enumerate(floor.blocks):
        yield Gate(GATE_BLOCK, block, ("floor", "blocks", number), f"block {number + 1}")
    for number, lift in enumerate(floor.lifts):
        yield Gate(GATE_LIFT, lift, ("floor", "lifts", number), f"lift {number + 1}")


def cells_of(gate: Gate, floor_plan: FloorPlan) -> list[int]:
    """The flat cells of a gate in which robots may stand; those of a path in its order.

    Raises InputError without file and line for cells that do not fit the floor.
    """
    section = gate.section
    if isinstance(section, Door):
        cells = cells_of_set(gate.name, (section.at,), floor_plan)
    elif isinstance(section, Lift):
        cells = cells_of_set(gate.name, section.shaft, floor_plan)
    else:
        cells = cells_of_set(gate.name, section.cells, floor_plan)
    drivable = [cell for cell in cells if floor_plan.drivable.flat[cell]]
    is_path = isinstance(section, Lift) or (
        isinstance(section, Block) and section.direction == "same"
    )
    if is_path:
        check_path(gate.name, cells, floor_plan)
    elif not drivable:
        raise InputError(f"{gate.name} has no cell in which robots can stand")
    return drivable


def check_path(name: str, cells: list[int], floor_plan: FloorPlan) -> None:
    """Check that robots drive from each cell of a path to the next, or back. Raises InputError."""
    for index, cell in enumerate(cells):
        x, y = floor_plan.xy(cell)
        if not floor_plan.drivable.flat[cell]:
            kind = floor_plan.kind_of(cell).name
            raise InputError(f"{name} must be a path, but [{x}, {y}] is a cell of kind {kind}")
        if index and not are_joined(floor_plan, cells[index - 1], cell):
            u, v = floor_plan.xy(cells[index - 1])
            raise InputError(
                f"{name} must be a path, but no robot drives from [{u}, {v}] to [{x}, {y}]"
            )


def are_joined(floor_plan: FloorPlan, cell: int, other: int) -> bool:
    """Whether robots drive from one cell to a neighbour, or back."""
    if other - cell not in floor_plan.offsets:
        return False
    way = floor_plan.offsets.index(other - cell)
    out, back = (
        floor_plan.exits.flat[cell] >> way & 1,
        floor_plan.exits.flat[other] >> (way ^ 2) & 1,
    )
    return bool(out or back)


def mouths_of(shaft: list[int], floor_plan: FloorPlan) -> list[int]:
    """The cells of a shaft over which robots enter or leave, in its order."""
    inside = set(shaft)
    return [
        cell
        for cell in shaft
        if any(
            other not in inside
            and floor_plan.drivable.flat[other]
            and are_joined(floor_plan, cell, other)
            for other in floor_plan.neighbours(cell)
        )
    ]


def moves_between(shaft: list[int], mouths: list[int]) -> list[int]:
    """The number of moves from each mouth to the next."""
    places = [shaft.index(mouth) for mouth in mouths]
    return np.diff(places).tolist()


def shares(travel_ticks: int, moves: int) -> tuple[int, int]:
    """The ticks of a move from one mouth to the next, and of the last move, which also takes the rest."""
    share = travel_ticks // moves
    return share, travel_ticks - share * (moves - 1)


# The closings of cells: all are computed before the run; random ones depend on its seed.


def closings_of(gate: Gate, number: int, scenario: Scenario, seed: int) -> Array:
    """(k, 2) int64: first tick and end (exclusive) of the closings of a gate until the run ends."""
    closing, end = gate.section, scenario.stop.max_duration
    if not isinstance(closing, Closing):
        return np.zeros((0, 2), np.int64)
    if isinstance(closing.every, MeanGap):
        return random_closings(closing, closing.every.mean, number, seed, end)
    assert isinstance(closing.ticks, int), "checked: by schedule"
    ticks = scheduled_closings(closing, end)
    begins = np.arange(ticks.start, ticks.stop, ticks.step, dtype=np.int64)
    return np.stack([begins, begins + closing.ticks], axis=1)


def random_closings(closing: Closing, mean: float, number: int, seed: int, end: int) -> Array:
    """Random closings: address (CLOSINGS, row, 2 k) is the gap before closing k, 2 k + 1 its length."""
    # These need Numba, unlike the checks of most scenarios.
    from automaton.engine.random_numbers import STREAM_CLOSINGS
    from automaton.world.draws import drawn_durations, geometric

    rows: list[Array] = []
    tick, first, count = 0, 0, 256
    while tick <= end and first <= MAX_CLOSINGS:
        k = np.arange(first, first + count)
        gaps = geometric(mean, seed, STREAM_CLOSINGS, number, 2 * k)
        if isinstance(closing.ticks, Distribution):
            address = STREAM_CLOSINGS, np.full(count, number), 2 * k + 1
            drawn = drawn_durations(closing.ticks, count, seed, address)
            lengths = np.maximum(np.floor(drawn + 0.5).astype(np.int64), 1)
        else:
            lengths = np.full(count, closing.ticks)
        ends = tick + np.cumsum(gaps + lengths)
        rows.append(np.stack([ends - lengths, ends], axis=1))
        tick, first, count = int(ends[-1]), first + count, min(2 * count, 65_536)
    closings = np.concatenate(rows)
    begun: Array = closings[closings[:, 0] <= end].astype(np.int64)
    return begun


def scheduled_closings(closing: Closing, end: int) -> range:
    """The first ticks of the scheduled closings until the last tick of a run."""
    assert closing.begin is not None, "checked: by schedule"
    assert not isinstance(closing.every, MeanGap), "checked: by schedule"
    return range(closing.begin, max(end, closing.begin) + 1, closing.every or end + 1)


def find_too_many_closings(scenario: Scenario) -> tuple[Gate, str] | None:
    """The first gate that closes too often with the scenario's seed, and the sentence."""
    count = 0
    for number, gate in enumerate(gates_of(scenario.floor)):
        if isinstance(gate.section, Closing):
            if isinstance(gate.section.every, MeanGap):
                count += len(closings_of(gate, number, scenario, scenario.seed))
            else:
                count += len(scheduled_closings(gate.section, scenario.stop.max_duration))
        if count > MAX_CLOSINGS:
            return gate, too_many_closings(count)
    return None


def too_many_closings(count: int) -> str:
    """The sentence about cells that close more often than a run can hold."""
    return (
        f"cells close {count:,} times before stop.max_duration, at most {MAX_CLOSINGS:,} are "
        "allowed; reduce stop.max_duration or increase every"
    )


# Whether gates fit the floor: their cells, and the number of robots that begin in them.


def check_gates(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Gates lie on the floor, shafts are paths and share no cells."""
    owner: dict[int, Gate] = {}
    for gate in gates_of(scenario.floor):
        try:
            cells = cells_of(gate, floor_plan)
        except InputError as error:
            yield Finding((*gate.keys, CELL_KEYS[gate.kind]), error.message)
            continue
        if isinstance(gate.section, Lift):
            yield from check_lift(gate, gate.section, cells, floor_plan, owner, scenario)
    if too_many := find_too_many_closings(scenario):
        gate, text = too_many
        yield Finding((*gate.keys, CELL_KEYS[gate.kind]), text)
    for name, level in scenario.floor.levels.items():
        for key, (x, y) in (("from", level.first), ("to", level.last)):
            if not floor_plan.holds(x, y):
                text = f"the corner [{x}, {y}] of the level {name} lies outside the floor"
                yield Finding(("floor", "levels", name, key), f"{text} {floor_plan.extent}")


def check_lift(
    gate: Gate,
    lift: Lift,
    shaft: list[int],
    floor_plan: FloorPlan,
    owner: dict[int, Gate],
    scenario: Scenario,
) -> Iterator[Finding]:
    """A lift has mouths at both ends, shares no cells, and has time for the moves between its mouths.

    `owner`: the lift of each cell; the cells of this lift are added.
    """
    keys = (*gate.keys, CELL_KEYS[gate.kind])
    for cell in shaft:
        x, y = floor_plan.xy(cell)
        if cell in owner:
            text = f"{gate.name} and {owner[cell].name} both contain the cell [{x}, {y}]"
            yield Finding(keys, text)
        owner[cell] = gate
    mouths = mouths_of(shaft, floor_plan)
    for end in (shaft[0], shaft[-1]):
        if end not in mouths:
            x, y = floor_plan.xy(end)
            yield Finding(keys, f"{gate.name} has no way out at its end [{x}, {y}]")
    if len(mouths) < 2:
        yield Finding(keys, f"{gate.name} has only one cell; a lift needs a mouth at each end")
        return
    moves = moves_between(shaft, mouths)
    if lift.travel_time < max(moves):
        time = ticks_and_time(lift.travel_time, unit(scenario.units.tick))
        text = f"{gate.name} takes {time} from one mouth to the next (travel_time), less than the"
        yield Finding(keys, f"{text} {max(moves)} moves between them")
    most = max(shares(lift.travel_time, count)[1] for count in moves)
    if most > MAX_MOVE_TICKS:
        text = f"a move in {gate.name} takes {most:,} ticks, its share of travel_time; at most"
        yield Finding((*gate.keys, "travel_time"), f"{text} {MAX_MOVE_TICKS:,} are allowed")


def cells_to_start(scenario: Scenario, floor_plan: FloorPlan, cells: Array) -> Array:
    """The flat cells of a list in which robots may begin, one in each, in the order of the list.

    No cell in a shaft, and in a block no more cells than it holds robots.
    """
    is_open = np.ones(len(cells), np.bool_)
    for gate in gates_of(scenario.floor):
        if gate.kind in (GATE_BLOCK, GATE_LIFT):
            inside = np.flatnonzero(is_open & np.isin(cells, cells_of(gate, floor_plan)))
            most = gate.section.max_robots if isinstance(gate.section, Block) else 0
            is_open[inside[most:]] = False
    return cells[is_open]


def check_homes(
    scenario: Scenario, floor_plan: FloorPlan, homes: Iterable[int], *barred: int
) -> None:
    """No robot begins or parks in a gate of the kinds `barred`. Raises InputError."""
    for gate in gates_of(scenario.floor):
        if gate.kind in barred:
            for cell in sorted({*homes} & {*cells_of(gate, floor_plan)}):
                x, y = floor_plan.xy(cell)
                raise InputError(f"a robot would begin or park at [{x}, {y}], in {gate.name}")


def check_starts_at_gates(scenario: Scenario, floor_plan: FloorPlan, starts: list[int]) -> None:
    """No more robots begin in a block than it holds. Raises InputError.

    `starts`: the flat cells of robots that begin on the floor.
    """
    for gate in gates_of(scenario.floor):
        if not isinstance(gate.section, Block):
            continue
        cells, most = set(cells_of(gate, floor_plan)), gate.section.max_robots
        count = sum(cell in cells for cell in starts)
        if count > most:
            robots = "robots begin" if count > 1 else "robot begins"
            raise InputError(f"{count} {robots} in {gate.name}, which holds at most {most}")
