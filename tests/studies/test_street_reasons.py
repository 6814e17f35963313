"""What each street is worth, for whom, and which streets can be left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from street_designs import design_of, planted, resolved_on, runs_of

from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import EAST, NORTH, WEST, FloorPlan
from automaton.runs.simulation import Simulation
from automaton.studies.street_search.designs import StreetDesign
from automaton.studies.street_search.reasons import (
    ComparedRuns,
    Reason,
    fewer,
    lead_times_by_group,
    reasons,
    share_of,
    streets_of,
    sum_of_largest,
    summed_by_group,
    with_groups,
    without_street,
)

HALL = "......\n" * 4
SHELVES = ".......\n.##.##.\n......."
SCREENING, SEEDS = range(100, 108), range(40)


def drawn(picture: str, *streets: Any) -> tuple[StreetDesign, FloorPlan]:
    floor_plan = draw_floor(picture)
    return design_of(floor_plan, *streets), floor_plan


def names(design: StreetDesign, floor_plan: FloorPlan) -> list[str]:
    return [f"{one.name(floor_plan)}, {one.preference}" for one in streets_of(design, floor_plan)]


# Streets.


def test_rows_and_columns_whose_stretches_agree_are_streets() -> None:
    streets = ("row", 0, "west", 2.1), ("row", 1, "west", 3), ("column", 3, "north", 1.5)
    assert names(*drawn(SHELVES, *streets)) == [
        "row 0, east 2.1 times as cheap",
        "column 3, south 1.5 times as cheap",
    ]
    assert names(*drawn("..#..", ("row", 0, "west", 4))) == ["row 0, east 4 times as cheap"]


def test_stretches_that_disagree_are_streets_of_their_own() -> None:
    design, floor_plan = drawn("...#...", ("row", 0, "west", 4))
    design.moves[[floor_plan.cell(x, 0) for x in (4, 5)], EAST] = 300
    design.moves[[floor_plan.cell(x, 0) for x in (5, 6)], WEST] = 150
    assert names(design, floor_plan) == [
        "row 0, columns 0 to 2, east 4 times as cheap",
        "row 0, columns 4 to 6, west 2 times as cheap",
    ]
    design.moves[[floor_plan.cell(x, 0) for x in (4, 5)], EAST] = 100
    assert names(design, floor_plan) == ["row 0, east 1.5 to 4 times as cheap"]


def test_equal_weights_are_no_street_and_closed_moves_are_a_one_way_street() -> None:
    design, floor_plan = drawn(HALL, ("row", 1, "west", 5), ("row", 1, "east", 5))
    assert names(design, floor_plan) == []
    design.closed[[floor_plan.cell(2, y) for y in range(1, 4)], NORTH] = True
    assert names(design, floor_plan) == ["column 2, one-way south"]


def test_without_a_street_both_directions_cost_their_geometric_mean_and_are_open() -> None:
    design, floor_plan = drawn(HALL, ("row", 1, "west", 9))
    design.closed[floor_plan.cell(1, 1), WEST] = True
    [street] = streets_of(design, floor_plan)
    other = without_street(design, street, floor_plan)
    cells = [floor_plan.cell(x, 1) for x in range(6)]
    assert (
        other.moves[cells[:-1], EAST].tolist() == [300] * 5 == other.moves[cells[1:], WEST].tolist()
    )
    assert not other.closed.any() and design.closed.any()
    assert (other.moves != design.moves).sum() == 10


# What they are worth.

STREETS = [("row", y, "west", 4) for y in range(3)]


def prefers(design: StreetDesign, floor_plan: FloorPlan, row: int) -> bool:
    cell = floor_plan.cell(2, row)
    return bool(design.moves[cell, WEST] > design.moves[cell, EAST])


def reasons_of(worth: Sequence[float], noise: float, metric: str = "throughput") -> list[Reason]:
    """The reasons of a design with three rows that are worth this."""
    design, floor_plan = drawn(HALL, *STREETS)
    rows = enumerate(worth)
    by_row = dict(rows)

    def total(one: StreetDesign) -> float:
        return sum(by_row[y] * prefers(one, floor_plan, y) for y in by_row)

    return reasons(design, floor_plan, planted(total, metric, noise), SCREENING, SEEDS)


def test_a_street_without_effect_is_named_and_the_others_are_worth_what_they_are() -> None:
    found = reasons_of((0.0, 0.05, -0.02), noise=0.4)
    lines = [one.street.stretches[0].cells[0] for one in found]
    floor_plan = drawn(HALL)[1]
    assert [floor_plan.xy(cell)[1] for cell in lines] == [1, 0, 2]
    assert [one.has_effect for one in found] == [True, False, True]
    assert [one.may_go for one in found] == [False, True, False]
    # With the street against without it: 103 / 98, and 103 / 105.
    assert found[0].gain == pytest.approx(0.05 / 0.98, abs=0.004)
    assert found[2].gain == pytest.approx(-0.02 / 1.05, abs=0.004)
    assert sum_of_largest(found, 2) == pytest.approx(found[0].gain + found[1].gain)


def test_intervals_hold_for_all_streets_together() -> None:
    worth = reasons_of((0.0, 0.05, -0.02), noise=0.4)[0].worth
    assert worth is not None and worth.difference.level == pytest.approx(1 - 0.05 / 3)


def test_runs_that_are_the_same_without_a_street_are_no_effect() -> None:
    found = reasons_of((0.0, 0.05, 0.0), noise=0.0)
    assert [one.has_effect for one in found] == [True, False, False]
    assert [one.gain for one in found[1:]] == [0, 0]


def test_of_many_streets_those_with_clear_effects_are_confirmed_with_fresh_seeds() -> None:
    rows = 60
    design, floor_plan = drawn("......\n" * rows, *(("row", y, "west", 4) for y in range(rows)))
    worth = {4: 0.05, 5: -0.03, 6: 0.02}
    compared = planted(
        lambda one: sum(gain * prefers(one, floor_plan, y) for y, gain in worth.items()), noise=0.4
    )
    asked = []

    def runs(designs: Any, seeds: Any, robots: Any = None) -> Any:
        asked.append((len(designs), set(seeds)))
        return compared.runs(designs, seeds, robots)

    found = reasons(design, floor_plan, compared._replace(runs=runs), SCREENING, SEEDS)
    (all_streets, screening), (few, fresh) = asked
    assert all_streets == 61 and 11 <= few < 20 and screening == {*SCREENING} and fresh == {*SEEDS}
    confirmed = [one for one in found if one.is_confirmed]
    assert found[: few - 1] == confirmed and len(found) == rows
    named = [one.street.name(floor_plan) for one in found if one.has_effect]
    assert named == ["row 4", "row 6", "row 5"]
    assert {one.worth.difference.n for one in found if one.worth} == {8, 40}
    assert sum_of_largest(found, 99) == pytest.approx(sum(one.gain for one in confirmed))


def test_a_street_that_lowers_the_makespan_gains() -> None:
    found = reasons_of((-0.05, 0.0, 0.03), noise=0.3, metric="makespan")
    assert [np.sign(one.gain) for one in found if one.has_effect] == [1, -1]
    assert found[0].worth is not None and share_of(found[0].worth).value < 0


def test_runs_that_did_not_finish_are_left_out() -> None:
    design, floor_plan = drawn(HALL, STREETS[0])

    def runs(designs: Any, seeds: Any, robots: Any = None) -> Any:
        return [
            [
                {"throughput": None if seed < 20 else 5.0 + seed, "finished": number == 0}
                for seed in seeds
            ]
            for number in range(len(designs))
        ]

    [one] = reasons(design, floor_plan, ComparedRuns(runs, "throughput", True), (), SEEDS)
    assert one.worth is None and not one.has_effect and not one.may_go


def test_several_fleets_count_equally() -> None:
    design, floor_plan = drawn(HALL, STREETS[0])

    def runs(designs: Any, seeds: Any, robots: Any = None) -> Any:
        gain = {10: 0.1, 100: 0.2}[robots]
        return [
            [{"throughput": robots * (1 + gain * prefers(one, floor_plan, 0))} for _ in seeds]
            for one in designs
        ]

    [one] = reasons(
        design, floor_plan, ComparedRuns(runs, "throughput", True, (10, 100)), (), SEEDS
    )
    without = (1 / 1.1 + 1 / 1.2) / 2
    assert one.gain == pytest.approx(1 / without - 1)


def test_in_runs_a_street_on_which_no_robot_drives_changes_nothing() -> None:
    """Robots that go round a ring one way do not meet head-on; no robot gets to row 4."""
    resolved = resolved_on(
        "t....t\n.####.\nt....t\n######\n......",
        fleet={
            "robots": 8,
            "kinematics": "omni",
            "start": [[x, y] for x in range(1, 5) for y in (0, 2)],
        },
        orders={"generator": "stations", "count": 5000},
        strategy={"allocation": "greedy", "right_of_way": "pibt"},
        stop={"when": "never", "max_duration": 300},
    )
    ring = ("row", 0, "west", 3), ("row", 2, "east", 3), ("row", 4, "west", 3)
    design, plan = design_of(resolved.floor_plan, *ring), resolved.floor_plan
    first, *others = reasons(design, plan, runs_of(resolved), (), range(4))
    assert first.gain > 0.02
    [useless] = [one for one in others if one.street.name(plan) == "row 4"]
    assert useless.changes_nothing and useless.may_go


# Fewer streets.


def left_out(worth: Any) -> Any:
    design, floor_plan = drawn(HALL, *STREETS)
    ranked = reasons_of((0.0, 0.05, 0.0), noise=0.2)
    compared = planted(lambda one: worth([prefers(one, floor_plan, y) for y in range(3)]))
    found = fewer(design, floor_plan, ranked, compared, range(8))
    return found, [prefers(found.design, floor_plan, y) for y in range(3)]


def test_streets_with_a_small_effect_are_left_out_together() -> None:
    found, rows = left_out(lambda rows: 0.05 * rows[1] + 0.001 * rows[2])
    assert found.is_kept and len(found.removed) == 2 and rows == [False, True, False]
    floor_plan = drawn(HALL)[1]
    assert found.design.moves[floor_plan.cell(2, 0)].tolist() == [100] * 4


def test_they_stay_if_together_they_matter() -> None:
    found, rows = left_out(lambda rows: 0.05 * (rows[0] or rows[2]))
    assert not found.is_kept and rows == [True] * 3
    assert share_of(found.change).value == pytest.approx(-0.05 / 1.05)


# Whom they serve.


def test_orders_are_grouped_by_their_stations_or_by_the_parts_of_the_floor() -> None:
    floor_plan = draw_floor("t.....\n......\n.....t")
    begin, end = floor_plan.stations
    away = floor_plan.cell(5, 0)
    ends = np.array([[begin, end], [begin, end], [end, begin], [begin, away], [away, away]])
    times = np.array([5, 7, 20, 9, 3])
    assert dict(summed_by_group(floor_plan, ends[:, 0], ends[:, 1], times)) == {
        "from station 1 to station 2 ticks": 12,
        "from station 1 to station 2 orders": 2,
        "from station 2 to station 1 ticks": 20,
        "from station 2 to station 1 orders": 1,
        "from the north-west to the north-east ticks": 9,
        "from the north-west to the north-east orders": 1,
        "within the north-east ticks": 3,
        "within the north-east orders": 1,
    }


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"orders": {"generator": "stations", "count": 20}},
        {"layout": {"picture": "t..t\n.pq.\n...."}, "orders": {"lines": {"count": 6}}},
    ],
)
def test_all_delivered_orders_of_a_run_are_counted(changes: Any) -> None:
    picture = "t...t\n.....\n..t.."
    changes = {"stop": {"when": "delivered", "max_duration": 2000}} | changes
    simulation = Simulation(resolved_on(picture, **changes), 5)
    sums = lead_times_by_group(simulation)
    orders = simulation.world.orders
    done = orders.delivered >= 0
    assert done.any()
    assert sum(n for key, n in sums.items() if key.endswith("orders")) == done.sum()
    ticks = (orders.delivered - orders.release_tick)[done].sum()
    assert sum(n for key, n in sums.items() if key.endswith("ticks")) == ticks
    between = changes.get("orders", {}).get("generator") == "stations"
    assert all(key.startswith("from station") == between for key in sums)


def test_the_orders_that_gain_and_lose_most_are_named() -> None:
    """The street makes orders from A to B faster, those from B to A slower, others not at all."""
    ranked = reasons_of((0.0, 0.05, -0.02), noise=0.4)
    design, floor_plan = drawn(HALL, *STREETS)

    def lead_times(designs: Any, seeds: Any) -> Any:
        draws = np.random.default_rng(3)

        def run(one: StreetDesign) -> dict[str, float]:
            street = prefers(one, floor_plan, 1)
            noise = draws.normal(0, 1, 3)
            return {
                "from A to B ticks": 10 * (50 - 5 * street + noise[0]),
                "from A to B orders": 10,
                "from B to A ticks": 10 * (50 + 4 * street + noise[1]),
                "from B to A orders": 10,
                "from A to C ticks": 10 * (50 + noise[2]),
                "from A to C orders": 10,
            }

        return [[run(one) for _ in seeds] for one in designs]

    first, second, third = with_groups(ranked, design, floor_plan, lead_times, SEEDS)
    assert first.saves is not None and first.costs is not None
    assert (first.saves.name, first.costs.name) == ("from A to B", "from B to A")
    assert first.saves.change.value == pytest.approx(-0.1, abs=0.02)
    assert first.costs.change.value == pytest.approx(0.08, abs=0.02)
    assert second == ranked[1]  # without effect: not looked at
    assert third.saves is third.costs is None
