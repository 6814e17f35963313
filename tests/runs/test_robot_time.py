"""Where the time of robots went: each tick of each robot is used for one thing."""

from __future__ import annotations

from contextlib import suppress

import msgspec
import pytest
from small_runs import SmallRun
from whole_floors import drawn_whole, resolved_whole

from automaton.engine.state import GOAL_STOP
from automaton.errors import InputError
from automaton.runs.headless import run_once
from automaton.runs.metric_catalogue import USE_MEANINGS, time_shares
from automaton.runs.metrics import counted, metrics_by_robot, metrics_of, uses_of_run, uses_of_time
from automaton.runs.periods import Period, PeriodMarks
from automaton.runs.simulation import Simulation
from automaton.strategy.api import CMD_STEP, Strategy
from automaton.world.resolve import resolve
from automaton.world.resolved import Resolved

SCENARIOS = [
    ("tabletop-1", []),
    ("tabletop-mini", ["strategy.right_of_way=pibt"]),
    ("goods-mini", []),
    ("bad-day", []),
    ("depots", []),
]


@pytest.mark.parametrize("until", [1, 10, 333, 1000])
@pytest.mark.parametrize("name, settings", SCENARIOS)
def test_all_uses_together_are_the_time_of_the_fleet(
    name: str, settings: list[str], until: int
) -> None:
    check_uses(resolve(name, settings), until)


@pytest.mark.parametrize("seed", range(15))
def test_so_they_are_on_floors_that_nobody_drew(seed: int) -> None:
    for until in (1, 77, 400):
        check_uses(whole(seed), until)


@pytest.mark.parametrize("seed", range(8))
def test_in_periods_they_are_the_time_of_the_fleet_too(seed: int) -> None:
    resolved = whole(seed)
    for period in run_once(resolved, until=300, every=60).periods:
        uses = period[Period._fields.index("on_orders") : Period._fields.index("stations")]
        assert sum(uses) == pytest.approx(resolved.scenario.fleet.robots), period
        assert min(uses) > -0.1, period


def check_uses(resolved: Resolved, until: int) -> None:
    run = Simulation(resolved)
    run.run(until)
    uses = uses_of_run(run)
    assert sum(uses.values()) == run.tick * resolved.scenario.fleet.robots
    assert all(ticks >= 0 for ticks in uses.values()), uses
    figures, robots = metrics_of(run), metrics_by_robot(run)
    for name in (name for name in figures if name.startswith("lost_")):
        assert figures[name] == sum(row[name] for row in robots) == uses[name]
    shares = (row["utilization"] for row in robots)
    on_orders = ("driving_loaded", "driving_empty", "turning", "handling")
    assert sum(shares) * run.tick == pytest.approx(sum(uses[name] for name in on_orders))
    assert uses.keys() <= USE_MEANINGS.keys()
    assert sum(share for _, share, _ in time_shares(uses)) == pytest.approx(1)


def whole(seed: int) -> Resolved:
    """A drawn scenario with everything on that `check` accepts."""
    for attempt in range(50):
        with suppress(InputError, msgspec.ValidationError):
            return resolved_whole(drawn_whole(100 * seed + attempt))
    raise AssertionError("no scenario could be drawn")


def driver(picture: str, way: str) -> SmallRun:
    """One robot that drives a way for an order."""
    floor = SmallRun(picture, kinematics="differential")
    floor.send("A", way)
    floor.world.robots.goal_type[:] = GOAL_STOP
    floor.world.robots.goal_cell[:] = 0  # nowhere on its way
    return floor


def making_way(floor: SmallRun) -> int:
    return int(floor.world.time_use.making_way.sum())


def test_a_move_there_and_back_is_made_for_others() -> None:
    floor = driver("A...", "EE").tick(2)
    assert making_way(floor) == 0
    floor = driver("A...", "EWE").tick(7)
    # East, two turns, west, two turns, east: two moves are undone, and each move needs its turns.
    assert making_way(floor) == 2


def test_what_is_undone_later_counts_in_the_period_in_which_it_was_driven() -> None:
    floor, marks = driver("A...", "EWE"), PeriodMarks(1)
    for _ in range(7):
        marks.look(floor.tick().run)
    periods = marks.periods(floor.run)
    assert [one.in_traffic for one in periods] == [1, 0, 0, 1, 0, 0, 0]
    assert [one.on_orders for one in periods] == [0, 1, 1, 0, 1, 1, 1]


def test_beyond_the_periods_that_are_counted_apart_moves_count_when_they_are_undone() -> None:
    """East at first, east again and west later: the first is undone by the third, as it was apart."""
    for begin, in_traffic in ((0, [1, 0, 0, 1]), (1021, [1, 0, 0, 1]), (1023, [0, 0, 0, 2])):
        floor, marks = driver("A...", "EWE"), PeriodMarks(1)
        floor.world.time_use.period[0] = begin
        for _ in range(7):
            marks.look(floor.tick().run)
        periods = marks.periods(floor.run)
        assert [one.in_traffic for one in periods] == [*in_traffic, 0, 0, 0]
        assert sum(one.on_orders for one in periods) == 5


class Steps(Strategy):
    """Right of way: robot 0 steps in one direction after the other."""

    layer = "right_of_way"
    period = 1

    def __init__(self, *directions: int) -> None:
        super().__init__()
        self.directions = list(directions)

    def wait_ranges(self):
        return (1, 1, 1, 1, 255)

    def decide(self, view, batch, decisions, memory, workspace):
        for k in range(batch.count if self.directions else 0):
            decisions.right_of_way.command[k] = CMD_STEP
            decisions.right_of_way.value[k] = self.directions.pop(0)


@pytest.mark.parametrize(("directions", "wasted"), [((0,), 0), ((1, 0, 0), 2)])
def test_turns_that_a_move_does_not_need_lead_nowhere(
    directions: tuple[int, ...], wasted: int
) -> None:
    """It faces east: south, back to east and then the move east, or the move east alone."""
    floor = SmallRun(
        "A.\n..", kinematics="differential", strategies={"right_of_way": Steps(*directions)}
    )
    robots = floor.world.robots
    robots.heading[:], robots.goal_type[:], robots.goal_cell[:] = 0, GOAL_STOP, 0
    floor.tick(len(directions))
    assert floor.floor_plan.xy(int(robots.cell[0])) == (1, 0)
    assert making_way(floor) == wasted


@pytest.mark.parametrize(("ticks", "wasted"), [(1, 0), (2, 2), (3, 2), (8, 8)])
def test_turns_to_and_fro_are_lost_before_the_robot_moves(ticks: int, wasted: int) -> None:
    """It faces east and turns south, east, south, and so on, as in a livelock."""
    floor = SmallRun(
        "A.\n..", kinematics="differential", strategies={"right_of_way": Steps(*[1, 0] * 4)}
    )
    robots = floor.world.robots
    robots.heading[:], robots.goal_type[:], robots.goal_cell[:] = 0, GOAL_STOP, 0
    floor.tick(ticks)
    assert int(uses_of_time(floor.world).making_way.sum()) == wasted
    assert counted(floor.run).sums["on_orders"] == ticks - wasted
