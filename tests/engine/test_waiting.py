"""Why a robot waits, told on floors where exactly that happens; wait cycles; where time was lost."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from small_runs import SmallRun

from automaton.engine.observation import (
    CAUSE_NOT_WAITING,
    CAUSE_REDESIGN,
    CAUSES,
    DEADLOCK_TICKS,
    EVENT_DEADLOCK,
    EVENT_WAIT_CYCLE,
    LOST_EVER,
    LOST_LATELY,
    MEMORY_TICKS,
    congestion_of,
)
from automaton.runs.simulation import Simulation
from automaton.scenario.fleet import FleetType
from automaton.scenario.schema import Battery, Drain, Durations, Fault, Faults, WorldRules
from automaton.strategy.api import (
    BATTERY_FULL,
    CMD_HOLD,
    CMD_RETREAT,
    CMD_STEP,
    CMD_WAIT,
    GOAL_CHARGE,
    GOAL_PICK,
    NIL,
    Strategy,
)
from automaton.world.resolve import resolve


class Answers(Strategy):
    """Right of way: the verb and value of each robot, in every tick."""

    layer = "right_of_way"
    period = 1

    def __init__(self, **given: tuple[int, int]) -> None:
        super().__init__()
        self.given = {ord(name) - ord("A"): answer for name, answer in given.items()}

    def wait_ranges(self):
        return (1, 1, 1, 1, 255)

    def decide(self, view, batch, decisions, memory, workspace):
        for k in range(batch.count):
            who = int(view.robots.identity[batch.robot[k]])
            if who in self.given:
                decisions.right_of_way.command[k], decisions.right_of_way.value[k] = self.given[who]


# Causes


def test_a_robot_that_drives_or_works_does_not_wait() -> None:
    floor = SmallRun("A..", {"A": "EE"}).tick()
    assert floor.why("A") == ("none", "", None)


def test_queue() -> None:
    floor = SmallRun("ABC", {"A": "E", "B": "E"}).tick()
    assert floor.why("A") == ("queue", "B", (1, 0))
    assert floor.why("B") == ("idle ahead", "C", (2, 0))


def test_head_on() -> None:
    floor = SmallRun("AB", {"A": "E", "B": "W"}).tick()
    assert floor.why("A") == ("head-on", "B", (1, 0)) and floor.why("B") == ("head-on", "A", (0, 0))
    floor.tick()  # the wait that was drawn is over: a retry
    assert floor.cause("A") == floor.cause("B") == "head-on"


def test_head_on_without_a_route() -> None:
    """A retreat that finds no way waits for what is ahead, and not for its goal, which is free."""
    answers = Answers(A=(CMD_WAIT, 3))
    floor = SmallRun("AB.\n##C", {"A": "EE", "B": "W"}, strategies={"right_of_way": answers})
    floor.world.robots.route_length[floor.index("A")] = 0
    floor.tick()
    assert floor.why("A") == ("head-on", "B", (1, 0)) and floor.blocker("B") == "A"
    assert floor.ring("A") == floor.ring("B") == 1


def test_a_wait_without_a_route_where_a_way_is_open() -> None:
    floor = SmallRun("A..", {"A": "EE"}, strategies={"right_of_way": Answers(A=(CMD_WAIT, 3))})
    floor.world.robots.route_length[floor.index("A")] = 0
    assert floor.tick().why("A") == ("random wait", "", None)


def test_at_work() -> None:
    floor = SmallRun(
        "A..\n.B.", {"A": "SE", "B": "E"}, kinematics="differential", durations=Durations(turn=9)
    )
    robots = floor.world.robots
    robots.heading[:] = 1
    floor.tick()
    assert floor.cause("A") == "none"  # it drives south
    robots.heading[floor.index("A")] = 0
    floor.tick()
    assert floor.why("A") == ("working ahead", "B", (1, 1)), "B turns"


def test_passing() -> None:
    ways, rules = {"A": "E", "B": "EE"}, WorldRules(following="handover")
    floor = SmallRun("AB..", ways, durations=Durations(move=4), rules=rules).tick()
    assert floor.cause("B") == "none"
    assert floor.why("A") == ("driving ahead", "B", (1, 0)), "a long move holds both cells"


def test_driving_on_behind_a_slower_robot() -> None:
    types = (
        FleetType(name="quick", robots=1),
        FleetType(name="slow", robots=1, move_time_factor=4),
    )
    floor = SmallRun("AB..", {"A": "E", "B": "EE"}, types=types).tick()
    for _ in range(3):
        assert floor.why("A") == ("driving ahead", "B", (1, 0)), "it arrives with B"
        assert floor.cause("B") == "none"
        floor.tick()
    assert floor.cause("A") == "none", "the last tick is its own"


def test_in_the_way_of_a_robot_with_nothing_to_do() -> None:
    floor = SmallRun("AB", {"A": "E"}).tick()
    assert floor.why("A") == ("idle ahead", "B", (1, 0))
    assert floor.why("B") == ("no order", "", None)


def test_in_the_way_of_a_parked_robot() -> None:
    floor = SmallRun("AB", {"A": "E"})
    floor.world.robots.parked[floor.index("B")] = 1
    assert floor.tick().why("A") == ("idle ahead", "B", (1, 0))
    assert floor.why("B") == ("none", "", None)


def test_lost_contest() -> None:
    floor = SmallRun("A.B", {"A": "E", "B": "W"}).tick()
    loser, winner = ("A", "B") if floor.cause("B") == "none" else ("B", "A")
    assert floor.why(loser) == ("vertex conflict", winner, (1, 0))


def test_lane() -> None:
    # A drives east through the aisle and has to turn there, while B comes the other way.
    floor = SmallRun(
        "A=B\n...", {"A": "ES", "B": "W"}, kinematics="differential", durations=Durations(turn=3)
    )
    floor.world.robots.heading[:] = [0, 2]
    floor.world.robots.travel[:] = [0, 2]
    floor.tick().tick()
    assert floor.why("A") == ("lane", "B", (1, 0))


def test_who_turns_in_an_aisle_holds_both_lanes() -> None:
    floor = SmallRun(
        "A=B\n.=.",
        {"A": "ES"},
        kinematics="differential",
        durations=Durations(turn=5),
    )
    floor.world.robots.heading[:] = floor.world.robots.travel[:] = [0, 2]
    floor.tick(2)
    floor.send("B", "W")
    floor.tick()
    assert floor.cause("A") == "none" and floor.why("B") == ("working ahead", "A", (1, 0))


def test_bay() -> None:
    floor = SmallRun("b.\nb.", start="parking-bays")
    robots = floor.world.robots
    home = int(robots.home[0])
    robots.goal_type[0], robots.goal_cell[0] = GOAL_PICK, home
    robots.cell[1], robots.parked[1] = home, 0
    floor.world.traffic.occupancy[home] &= ~np.uint16(96)
    floor.tick()
    assert floor.why("A") == ("bay", "B", floor.floor_plan.xy(home))


def test_wait_drawn() -> None:
    floor = SmallRun("AB.", {"A": "E"}, waits=(9, 9, 9, 9, 255)).tick()
    floor.send("B", "E")
    floor.tick()  # B has left while A still waits
    assert floor.why("A") == ("random wait", "", (1, 0))


def test_just_freed() -> None:
    floor = SmallRun("AB.", {"A": "E", "B": "E"}, following="none").tick()
    assert floor.cause("B") == "none"
    assert floor.why("A") == ("following conflict", "", (1, 0))


def test_withdrawal() -> None:
    floor = SmallRun(
        "A..", {"A": "E"}, strategies={"right_of_way": Answers(A=(CMD_RETREAT, 2))}
    ).tick()
    assert floor.why("A") == ("retreat", "", None)


def test_no_order() -> None:
    assert SmallRun("A..").tick().why("A") == ("no order", "", None)


def test_no_place() -> None:
    floor = SmallRun("A$d")
    robots = floor.world.robots
    robots.load[0] = robots.order[0] = 0
    assert floor.tick().why("A") == ("no drop-off slot", "", None)


def test_no_route() -> None:
    floor = SmallRun("A..")
    floor.send("A", "")
    floor.world.robots.goal_cell[0] += 2
    assert floor.tick().why("A") == ("no route", "", (2, 0))


def test_illegal_answer() -> None:
    floor = SmallRun("A#.", strategies={"right_of_way": Answers(A=(CMD_STEP, 0))}).tick()
    assert floor.why("A") == ("illegal decision", "", None)


def test_in_line_before_a_charger() -> None:
    battery = Battery(drain=Drain(move=1.0), charge_rate=1.0, initial_charge=50.0)
    floor = SmallRun("A.Bc", {"A": "EEE", "B": "E"}, battery=battery)
    for name in "AB":
        i = floor.index(name)
        floor.world.robots.goal_type[i] = GOAL_CHARGE
        floor.world.robots.goal_cell[i] = floor.floor_plan.cell(3, 0)
        floor.world.robots.charge_target[i] = BATTERY_FULL
    for _ in range(3):
        floor.tick()
    assert floor.cause("B") == "none"
    assert floor.why("A") == ("charger", "B", (3, 0))


def test_an_empty_battery() -> None:
    battery = Battery(drain=Drain(move=10.0), charge_rate=1.0, initial_charge=15.0)
    floor = SmallRun("A..", {"A": "EE"}, battery=battery).tick()
    assert floor.cause("A") == "none"
    assert floor.tick().why("A") == ("empty battery", "", None)


def test_broken_down() -> None:
    faults = Faults(listed=(Fault(robot=0, at=2),))
    floor = SmallRun("A...", {"A": "EEE"}, faults=faults).tick()
    assert floor.cause("A") == "none"
    floor.tick()  # the move that it begins in this tick is its last
    assert floor.tick().why("A") == ("broken down", "", None)


def test_driving_slowly_is_lost_time_but_no_wait() -> None:
    rules = WorldRules(slowdown="zones")
    floor = SmallRun("##.####\nB.A.C.D", {"C": "E"}, rules=rules).tick()
    observation, i = floor.run.observation, floor.index("C")
    for _ in range(2):  # its move takes 2 ticks: one more than its duration
        assert observation.cause[i] == CAUSE_NOT_WAITING
        told = {
            CAUSES[cause].name: observation.lost[i, cause]
            for cause in np.flatnonzero(observation.lost[i])
        }
        assert told == {"reduced speed": 1}
        floor.tick()


def test_redesign() -> None:
    run = Simulation(resolve("factory"), on_observe=Simulation.empty_observation)
    run.run(until=100)
    i = int(np.flatnonzero(run.world.robots.parked == 0)[0])
    run.world.service_zones.halt[i] = run.world.clock.halted_until = 110
    run.run(until=108)
    assert CAUSES[run.observation.cause[i]].name == "redesign" and run.observation.blocker[i] == NIL
    run.run(until=115)
    assert (
        run.observation.cause[i] == CAUSE_NOT_WAITING
        and run.observation.lost[i, CAUSE_REDESIGN] == 10
    )


class HoldsBack(Strategy):
    """Lets robots stay, though they would like to go east."""

    layer = "right_of_way"
    steers = True
    period = 1

    def decide(self, view, batch, decisions, memory, workspace):
        out, count = decisions.right_of_way, batch.count
        out.command[:count], out.value[:count] = CMD_HOLD, 0


def test_held_back() -> None:
    floor = SmallRun("A.BC", strategies={"right_of_way": HoldsBack()}).tick()
    assert floor.why("A") == ("held back", "", (1, 0))
    assert floor.why("B") == ("queue", "C", (3, 0))


def test_every_cause_has_a_floor_here() -> None:
    others = ("test_pod_waits.py", "test_delays.py", "test_gates.py")
    files = (
        Path(__file__).parents[1] / "calibration/test_observed_run.py",
        Path(__file__),
        *(Path(__file__).with_name(name) for name in others),
    )
    told = set().union(*(file.read_text().split('"') for file in files))
    assert {cause.name for cause in CAUSES} <= told


# What looks alike


@pytest.mark.parametrize("mouth", ["=", "~"])
def test_a_swap_with_a_cell_for_several_robots_is_head_on_for_both(mouth: str) -> None:
    floor = SmallRun(f"A{mouth}B", {"B": "WW"}).tick()
    assert floor.cause("B") == "none"
    floor.send("A", "EE")
    floor.tick()
    assert floor.why("A") == ("head-on", "B", (1, 0))  # its lane is free: they may not swap
    assert floor.why("B") == ("head-on", "A", (0, 0))
    assert floor.ring("A") == floor.ring("B") == 1


def test_a_turn_in_an_aisle_that_right_of_way_asks_for() -> None:
    floor = SmallRun(
        "A=B\n.=.",
        {"A": "E", "B": "W"},
        kinematics="differential",
        strategies={"right_of_way": Answers()},
    )
    floor.world.robots.heading[:] = floor.world.robots.travel[:] = [0, 2]
    floor.tick()
    assert floor.cause("A") == floor.cause("B") == "none", "they are in the aisle side by side"
    floor.answers.given = {0: (CMD_STEP, 1)}
    floor.tick()
    assert floor.why("A") == ("lane", "B", (1, 0))


def test_who_stands_before_a_turn_does_not_wait_for_itself() -> None:
    floor = SmallRun(
        "A.\n..",
        {"A": "S"},
        kinematics="differential",
        strategies={"right_of_way": Answers(A=(CMD_WAIT, 3))},
    )
    floor.world.robots.heading[:] = 0
    floor.tick()
    assert floor.why("A") == ("random wait", "", (0, 0))
    assert floor.ring("A") == 0 and floor.events() == []


def test_after_idleness_a_wait_begins_anew() -> None:
    floor = SmallRun("AB").tick(40)
    floor.send("A", "E")
    floor.tick()
    assert floor.cause("A") == "idle ahead"
    assert floor.run.tick - floor.run.observation.since[floor.index("A")] == 1
    assert floor.run.tick - floor.run.observation.since[floor.index("B")] == 41


def test_the_congestion_of_a_cell_halves_from_time_to_time() -> None:
    floor = SmallRun("AB", {"A": "E"}).tick(MEMORY_TICKS - 1)
    cell = floor.floor_plan.cell(0, 0)
    lost_ticks_by_cell = floor.run.observation.lost_ticks_by_cell[cell]
    assert lost_ticks_by_cell[LOST_LATELY] == lost_ticks_by_cell[LOST_EVER] == MEMORY_TICKS - 1
    floor.tick()
    assert lost_ticks_by_cell[LOST_LATELY] == (MEMORY_TICKS - 1) // 2 + 1
    assert lost_ticks_by_cell[LOST_EVER] == MEMORY_TICKS
    faded = congestion_of(
        floor.run.observation.lost_ticks_by_cell, floor.run.tick + 2 * MEMORY_TICKS
    )
    assert faded[cell] == lost_ticks_by_cell[LOST_LATELY] // 4


# Wait cycles


def test_a_ring_of_four_that_cannot_turn() -> None:
    ring = {"A": "E", "B": "S", "C": "W", "D": "N"}
    floor = SmallRun("AB\nDC", ring, following="none", waits=(500, 500, 500, 500, 255)).tick()
    for robot, ahead in zip("ABCD", "BCDA", strict=True):
        assert floor.cause(robot) == "queue" and floor.blocker(robot) == ahead
        assert floor.ring(robot) == 1
    assert [tuple(event)[:3] for event in floor.events()] == [(1, EVENT_WAIT_CYCLE, 0)]
    assert floor.events()[0].value == 4


def test_a_circle_that_lasts_is_a_deadlock_once() -> None:
    floor = SmallRun(".AB", {"A": "E", "B": "W"}, waits=(500, 500, 500, 500, 255))
    floor.tick(DEADLOCK_TICKS - 1)
    assert [event.code for event in floor.events()] == [EVENT_WAIT_CYCLE]
    floor.tick(40)
    assert [tuple(event) for event in floor.events()] == [
        (1, EVENT_WAIT_CYCLE, 0, NIL, 2),
        (DEADLOCK_TICKS, EVENT_DEADLOCK, 0, NIL, 2),
    ]
    assert floor.ring("A") == floor.ring("B") == DEADLOCK_TICKS + 39


def test_with_another_robot_in_it_it_is_another_circle() -> None:
    floor = SmallRun("AB\nDC", {"A": "E", "B": "W"}, waits=(1, 1, 1, 1, 255)).tick(30)
    assert floor.ring("A") == floor.ring("B") == 30
    for robot, route in {"B": "S", "C": "W", "D": "N"}.items():
        floor.send(robot, route)
    floor.world = floor.world.replaced(rules=floor.world.rules.replaced(following=0))
    floor.tick(3)
    assert {floor.ring(robot) for robot in "ABCD"} == {floor.ring("C")} and floor.ring("C") <= 3


def test_who_waits_for_a_circle_is_no_member() -> None:
    floor = SmallRun("CAB", {"A": "E", "B": "W", "C": "E"}).tick()
    assert floor.cause("C") == "queue" and floor.ring("C") == 0 and floor.ring("A") == 1


def test_circles_of_one_tick_are_told_by_identity_however_robots_are_stored() -> None:
    told = set()
    for storage in permutations(range(4)):
        floor = SmallRun("AB\nCD", {"A": "E", "B": "W", "C": "E", "D": "W"}, storage=storage).tick()
        told.add(tuple(event.robot for event in floor.events()))
    assert told == {(0, 2)}
