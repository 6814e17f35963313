"""Distance tables hold what Dijkstra finds from every pose, in every encoding, and make room in time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures
from reference_costs import CostSet
from reference_paths import FAR, HEADINGS

from automaton.engine.distance_tables import (
    JOINT,
    POSE16,
    POSE32,
    SPLIT,
    STOP_NO_ROOM,
    DistanceTables,
    least_table_bytes,
)
from automaton.engine.state import MAY_TURN, NIL, Array
from automaton.engine.table_building import Costs, build_tables, bytes_taken, renew
from automaton.engine.table_rows import cost_in, row_to
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.robot_types import RobotType, floor_by_type
from automaton.world.prepared_floor import floor_for

SYMBOLS = ".....++--||==~><v^##"
LARGE = 1 << 20  # bytes: room for all tables of these floors


@dataclass
class Case:
    """A floor, and one or two sets of costs on it; the second one is for robots with a closed area.

    And perhaps with kinematics of their own.
    """

    floor_plan: FloorPlan
    kinematics: str
    step: list[int]  # by set
    turn: list[int]
    closed: tuple[tuple[int, int, int, int], ...] = ()
    weights: int | None = None  # the seed of costs by cell and direction: so many times `step`
    factors: tuple[int, ...] = (1, 2, 6)
    room: int = LARGE
    beside: str | None = None  # kinematics of the second set, if not those of the first

    @property
    def drives(self) -> list[str]:
        """The kinematics of each set."""
        return [self.kinematics, self.beside or self.kinematics][: len(self.step)]

    @cached_property
    def plans(self) -> tuple[FloorPlan, ...]:
        types = (RobotType(), RobotType("tug", closed=self.closed))[: len(self.step)]
        return floor_by_type(self.floor_plan, types).floor_plans

    @cached_property
    def steps(self) -> Array:
        """(S,), or (S, C, 4)"""
        step = np.array(self.step, np.int64)
        if self.weights is None:
            return step
        shape = (len(step), self.floor_plan.kind.size, 4)
        factors = np.random.default_rng(self.weights).choice(self.factors, shape)
        return np.asarray(step[:, None, None] * factors)

    def tables(self) -> DistanceTables:
        types = tuple(RobotType(kinematics=one) for one in self.drives)  # type: ignore[arg-type]
        grid = floor_for(self.floor_plan, "undirected", types).grid
        cells = range(self.floor_plan.kind.size)
        turns = [
            [CostSet(self.floor_plan, one, 1, 1).may_turn(c) for c in cells] for one in self.drives
        ]
        may_turn = np.where(turns, MAY_TURN, 0).astype(np.uint8)
        flags = np.stack([plan.exits.reshape(-1) for plan in self.plans]) | may_turn
        costs = Costs(flags, self.steps, np.array(self.turn, np.int64), grid.type_headings)
        return build_tables(grid, costs, self.room, np.zeros(1, np.int64))

    def expected(self, cost_set: int, goal: int) -> dict[tuple[int, int], int]:
        steps = self.steps[cost_set]
        weights = (
            {(c, d): int(steps[c, d]) for c, d in np.ndindex(*steps.shape)} if steps.ndim else 0
        )
        step = weights or int(steps)
        plan = self.plans[cost_set]
        return CostSet(plan, self.drives[cost_set], step, self.turn[cost_set]).costs_to(goal)

    def poses(self, headings: int) -> list[tuple[int, int]]:
        cells = np.flatnonzero(self.floor_plan.drivable.reshape(-1)).tolist()
        return [(cell, heading) for cell in cells for heading in range(headings)]

    def found(
        self, tables: DistanceTables, row: int, cost_set: int = 0
    ) -> dict[tuple[int, int], int]:
        """By pose; a heading they do not distinguish costs what the one does that they have."""
        apart = HEADINGS[self.drives[cost_set]]
        costs = {pose: int(cost_in(tables, row, *pose)) for pose in self.poses(apart)}
        for cell, heading in self.poses(max(HEADINGS[one] for one in self.drives)):
            assert cost_in(tables, row, cell, heading) == costs[cell, heading % apart]
        return {pose: cost for pose, cost in costs.items() if cost < FAR}


@st.composite
def cases(draw: Any) -> Case:
    width = draw(st.integers(1, 6))
    lines = draw(pictures(SYMBOLS, width, draw(st.integers(1, 6)))).split("\n")
    if all(set(line) == {"#"} for line in lines):
        lines.append("." * width)
    sets = draw(st.integers(1, 2))
    factor = draw(st.sampled_from([1, 1, 1, 300, 3000, 9000]))
    corner = st.integers(0, 5)
    return Case(
        draw_floor("\n".join(lines)),
        draw(st.sampled_from(["rail", "differential", "differential", "omni"])),
        [factor * draw(st.integers(1, 3)) for _ in range(sets)],
        [draw(st.one_of(st.integers(0, 3), st.integers(0, 30))) for _ in range(sets)],
        (tuple(min(draw(corner), end) for end in (width - 1, len(lines) - 1) * 2),),  # type: ignore[arg-type]
        draw(st.one_of(st.none(), st.integers(0, 99))),
        draw(st.sampled_from([(1, 2, 6), (1, 300), (2, 20_000, 3), tuple(range(1, 60))])),
        draw(st.sampled_from([1, 300, LARGE])),
        draw(st.sampled_from([None, *HEADINGS])),
    )


@settings(max_examples=examples(100))
@given(cases(), st.randoms(use_true_random=False))
def test_tables_hold_what_dijkstra_finds_from_every_pose(case: Case, random: Any) -> None:
    """Asked for in any sequence; those that are kept for the tick are still right at its end."""
    tables = case.tables()
    goals = sorted({cell for cell, _ in case.poses(1)})
    for tick in range(1, 4):
        kept: dict[int, tuple[int, int]] = {}
        for _ in range(4):
            cost_set, goal = random.randrange(len(case.step)), random.choice(goals)
            keeps = len(kept) < tables.status.rows - 1 and random.random() < 0.5
            row = int(row_to(tables, cost_set, goal, tick, keeps))
            if row == NIL:  # a wider encoding has less room
                assert keeps or kept
                assert tables.stop[0] == STOP_NO_ROOM
                return
            assert case.found(tables, row, cost_set) == case.expected(cost_set, goal)
            if keeps:
                kept[row] = cost_set, goal
        for row, (cost_set, goal) in kept.items():
            assert case.found(tables, row, cost_set) == case.expected(cost_set, goal)


CROSSING = """\
.....
.#.#.
.....
.#.#.
....."""


@pytest.mark.parametrize(
    ("kinematics", "step", "turn", "encoding", "bytes_per_cell"),
    [
        ("differential", 1, 1, JOINT, 2),
        ("differential", 400, 1, JOINT, 2),  # 19 patterns: costs below 3,449
        ("differential", 9000, 9000, JOINT, 2),  # the same as 1 and 1
        ("differential", 500, 1, SPLIT, 3),
        ("differential", 31, 2, JOINT, 2),  # 85 patterns: below 771
        ("differential", 101, 2, SPLIT, 3),
        ("differential", 10_001, 3, POSE32, 16),
        ("differential", 1, 4, POSE16, 8),
        ("omni", 1, 1, POSE16, 2),
        ("omni", 9_001, 1, POSE16, 2),  # a step is the unit
        ("rail", 1, 22, POSE16, 4),
    ],
)
def test_the_narrowest_encoding_that_holds_the_costs_is_taken(
    kinematics: str, step: int, turn: int, encoding: int, bytes_per_cell: int
) -> None:
    """From corner to corner of CROSSING it is 8 steps and a turn; 21 cells."""
    case = Case(draw_floor(CROSSING), kinematics, [step], [turn])
    tables = case.tables()
    near, far = case.floor_plan.cell(2, 2), case.floor_plan.cell(0, 0)
    first = int(row_to(tables, 0, near, 1, True))
    last = int(row_to(tables, 0, far, 1, True))
    assert tables.status.encoding == encoding
    assert 2 * tables.status.words == pytest.approx(21 * bytes_per_cell, abs=1)
    assert case.found(tables, first) == case.expected(0, near)
    assert case.found(tables, last) == case.expected(0, far)


def room_for(tables: int, cells: int) -> int:
    return tables * least_table_bytes(cells, 4, 1)


def test_the_hand_spares_what_is_kept_and_takes_what_nobody_has_looked_at() -> None:
    """Room for 12 tables of 12 cells: 11 that may be kept, and one that is for single look-ups."""
    case = Case(draw_floor("." * 12), "differential", [1], [1], room=room_for(12, 12))
    tables, start = case.tables(), case.floor_plan.cell(0, 0)
    kept = [int(row_to(tables, 0, start + k, 1, True)) for k in range(10)]
    assert kept == list(range(10))
    assert row_to(tables, 0, start + 10, 1, False) == 10
    assert row_to(tables, 0, start + 11, 1, False) == 10  # the only one that may go
    assert tables.row_of[start + 10] == NIL
    assert row_to(tables, 0, start + 10, 1, True) == 10
    assert row_to(tables, 0, start + 11, 1, False) == 11  # all others are kept
    assert row_to(tables, 0, start + 3, 1, True) == 3
    assert row_to(tables, 0, start + 11, 2, True) == 0  # in the next tick any may go
    assert tables.status.taken == 11
    assert tables.stop[0] == 0


def test_a_run_whose_tick_keeps_more_tables_than_fit_is_given_up() -> None:
    case = Case(draw_floor("." * 12), "differential", [1], [1], room=room_for(9, 12))
    tables, start = case.tables(), case.floor_plan.cell(0, 0)
    rows = [int(row_to(tables, 0, start + k, 1, True)) for k in range(9)]
    assert rows == [*range(8), NIL]
    assert tables.stop[0] == STOP_NO_ROOM
    assert cost_in(tables, NIL, start, 0) == FAR


def test_memory_is_taken_as_tables_are_asked_for() -> None:
    tables = Case(draw_floor("." * 12), "differential", [1], [1]).tables()
    assert bytes_taken(tables) == 0
    for goal in (14, 15, 14):
        row_to(tables, 0, goal, 1, False)
    assert bytes_taken(tables) == 2 * room_for(1, 12)


def test_how_much_room_a_run_has_does_not_depend_on_runs_before_it() -> None:
    """What is found stays for the next run, but not the wider encoding that another run needed."""
    for step, stays in ((1, True), (500, False)):
        case = Case(draw_floor(CROSSING), "differential", [step], [1])
        tables, goal = case.tables(), case.floor_plan.cell(0, 0)
        row_to(tables, 0, goal, 1, True)
        renew(tables)
        assert (tables.row_of[goal] != NIL) == stays
        assert (tables.kept_in == NIL).all()
        assert case.found(tables, int(row_to(tables, 0, goal, 1, True))) == case.expected(0, goal)


def test_an_array_of_weights_may_have_any_number_of_distinct_costs_from_1_on() -> None:
    case = Case(draw_floor(CROSSING), "omni", [1], [1])
    case.__dict__["steps"] = np.arange(196).reshape(1, 49, 4)
    tables, goal = case.tables(), case.floor_plan.cell(0, 0)
    assert case.found(tables, int(row_to(tables, 0, goal, 1, True))) == case.expected(0, goal)
    case.__dict__["steps"] = np.zeros((1, 49, 4), int)
    with pytest.raises(ValueError, match="must cost at least 1"):
        case.tables()
