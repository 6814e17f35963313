"""Steered fleets under each rule of following: no plan that the world refuses, and no standstill."""

from __future__ import annotations

import numpy as np
import pytest
from flow_floors import RULES, drawn_fleet
from no_deadlock import trials
from small_runs import SmallRun

from automaton.engine.state import ACTION_BLOCKED, ACTION_MOVE, GOAL_CHARGE, LAYER_RIGHT_OF_WAY
from automaton.runs.simulation import Simulation
from automaton.scenario.fleet import FleetType
from automaton.scenario.schema import Durations
from automaton.world.resolve import resolve
from strategies.right_of_way.epibt.epibt import Epibt
from strategies.right_of_way.pibt.pibt import Pibt
from strategies.right_of_way.pibt.pibt_state import dead_ends_that_hold
from strategies.right_of_way.right_of_way_parameters import EpibtParameters, PibtParameters

STEERING = {"pibt": Pibt, "epibt": Epibt}
BOTH = pytest.mark.parametrize("name", STEERING)
GOAL = GOAL_CHARGE  # where there is no charger, a robot simply stays there


def drive(name, picture, ticks, following, move=1, strategy=None, **options):
    """Robots with goals by name, A=(x, y); returns the run and, by robot, the tick of its arrival."""
    goals = {robot: options.pop(robot) for robot in list(options) if robot.isupper()}
    run = SmallRun(
        picture,
        strategies={"right_of_way": strategy or STEERING[name](PARAMETERS[name]())},
        following=following,
        durations=Durations(move=move),
        kinematics="differential",
        **options,
    )
    robots = run.world.robots
    for robot, cell in goals.items():
        robots.goal_type[run.index(robot)] = GOAL
        robots.goal_cell[run.index(robot)] = run.floor_plan.cell(*cell)
    arrived = {}
    for tick in range(1, ticks + 1):
        run.tick()
        for robot in goals:
            if robots.cell[run.index(robot)] == robots.goal_cell[run.index(robot)]:
                arrived.setdefault(robot, tick)
    assert run.world.tally.illegal[LAYER_RIGHT_OF_WAY] == 0
    return run, arrived


PARAMETERS = {"pibt": PibtParameters, "epibt": EpibtParameters}


def refused(run):
    return int(run.world.tally.ticks[:, ACTION_BLOCKED].sum())


def moves(run):
    return int(run.world.tally.operations[:, ACTION_MOVE].sum())


FULL_RING = {"A": (1, 1), "B": (0, 1), "C": (0, 0), "D": (1, 0)}


def test_a_full_ring_of_long_moves_rotates_in_a_convoy():
    run, arrived = drive("pibt", "AB\nDC", 40, "convoy", move=3, **FULL_RING)
    assert set(arrived) == set("ABCD") and refused(run) == 0


@BOTH
@pytest.mark.parametrize(("following", "move"), [("handover", 3), ("none", 1), ("none", 2)])
def test_a_full_ring_that_does_not_rotate_is_not_tried(name, following, move):
    run, _ = drive(name, "AB\nDC", 40, following, move=move, **FULL_RING)
    assert moves(run) == 0 and refused(run) == 0


@BOTH
@pytest.mark.parametrize("following", RULES)
def test_who_is_pushed_makes_way_and_who_pushes_is_never_refused(name, following):
    """B, which has nothing to do, goes on before A, or to the side."""
    run, arrived = drive(name, "AB...\n.###.\n.....", 60, following, move=3, A=(4, 0))
    assert set(arrived) == {"A"} and refused(run) == 0


@pytest.mark.parametrize(("following", "gap"), [("none", 4), ("handover", 3), ("convoy", 2)])
def test_a_file_moves_up_as_closely_as_the_rule_lets_it(following, gap):
    """ABC>: moves of 2 ticks pass a cell every 4, 3 or 2 ticks."""
    picture = ".ABC.........\n.###########.\n............."
    run, arrived = drive("pibt", picture, 80, following, move=2, C=(12, 0), B=(11, 0), A=(10, 0))
    assert arrived["B"] - arrived["C"] == gap - 2 and arrived["A"] - arrived["B"] == gap - 2
    assert refused(run) == 0


def test_a_slow_robot_ahead_is_not_followed_in_the_tick_in_which_it_sets_out():
    """Under handover a fast robot waits until the slow one gives up its cell."""
    types = (
        FleetType(name="fast", robots=1),
        FleetType(name="slow", robots=1, move_time_factor=4),
    )
    goals = {"A": (4, 0), "B": (5, 0)}
    run, arrived = drive("pibt", "AB....\n.####.\n......", 22, "handover", types=types, **goals)
    assert arrived == {"A": 16, "B": 16} and refused(run) == 0


def test_two_robots_head_on_break_their_deadlock():
    """A.B between walls: after its patience one of them goes into the pocket below."""
    goals = {"A": (2, 0), "B": (0, 0)}
    patient = Pibt(PibtParameters(deadlock_patience=10))
    run, arrived = drive("pibt", "A.B\n#.#", 400, "convoy", move=2, strategy=patient, **goals)
    assert set(arrived) == {"A", "B"} and refused(run) == 0
    assert run.run.counted["deadlocks_resolved"] > 0
    run, arrived = drive("pibt", "A.B\n#.#", 60, "convoy", move=2, **goals)
    assert len(arrived) < 2 and run.run.counted == {"deadlocks_resolved": 0}


def test_epibt_breaks_deadlocks_in_a_crowd():
    settings = ("fleet.robots=200", "durations.move=2", "stop.max_duration=1500")
    done = []
    for patience in (64, 10_000):
        choice = f"strategy.right_of_way={{name: epibt, deadlock_patience: {patience}}}"
        run = Simulation(resolve("random-400", (*settings, choice)))
        run.run()
        done.append((run.counted["deadlocks_resolved"] > 0, int(run.world.tally.visits.sum())))
    assert [broken for broken, _ in done] == [True, False] and done[0][1] > done[1][1]


@pytest.mark.parametrize(("number", "visits"), [(100278, 150), (100395, 350)])
def test_epibt_does_not_let_robots_keep_each_other_from_their_goals(number, visits):
    """One that goes home again and again before another; six that want into a pocket with one in it."""
    findings, figures = trials("epibt", 1, number)
    assert not findings and figures["visits"] > visits


@pytest.mark.parametrize("number", [100538, 100690])
def test_robots_that_turn_round_in_an_aisle_for_two_are_not_caught_across_it(number):
    findings, _ = trials("pibt", 1, number)
    assert not findings


@pytest.mark.parametrize(("move", "seed"), [(1, 6), (2, 2), (2, 10), (3, 6)])
def test_pibt_gets_all_robots_through_a_block_and_a_lift(move, seed):
    """Blocks that idle robots keep full, a lift whose next robot is pushed away, ranks that change."""
    run = Simulation(resolve("bad-day", (f"durations.move={move}",)), seed)
    run.run(until=8000)
    assert run.finished


@pytest.mark.parametrize("right_of_way", ["pibt", "epibt"])
def test_a_block_that_is_never_full_lets_idle_robots_stay(right_of_way):
    block = "floor={blocks: [{cells: {from: [0, 0], to: [12, 5]}, max_robots: 50}]}"
    run = Simulation(resolve("bad-day", (block, f"strategy.right_of_way={right_of_way}")), 1)
    run.run(until=3000)
    assert run.finished


def test_the_dead_end_rule_ends_where_too_few_places_are_left_outside():
    """The floor has 10 places outside its dead end of 2."""
    run = SmallRun("A...\n.##.\n....\n.###\n.###", strategies={"right_of_way": Pibt()})
    ends = [dead_ends_that_hold(run.world.grid, robots).total for robots in (2, 3)]
    assert ends == [1, 0]


@BOTH
def test_no_fleet_stands_still_on_random_floors(name):
    """A sample of tests/proofs/no_deadlock.py, half of it recorded, validated and counted again."""
    findings, figures = trials(name, 60_000, 1, record=30_000)
    assert findings == [] and figures["visits"] > 100


def test_drawn_fleets_are_of_all_kinds():
    drawn = [one for seed in range(40) if (one := drawn_fleet(seed, "pibt", 100)) is not None]
    scenarios = [one.scenario for one in drawn]
    assert {one.world.following for one in scenarios} == set(RULES)
    assert {one.fleet.kinematics for one in scenarios} == {"differential", "omni"}
    assert set("#.=<>^v") <= set("".join(one.layout["picture"] for one in scenarios))
    assert any(one.battery for one in scenarios) and any(one.faults.delays for one in scenarios)
    assert any(one.fleet.types for one in scenarios)
    assert np.ptp([one.durations.move for one in scenarios]) == 4
