"""Robots that leave the floor when they are done, where they stand, and may come back."""

from __future__ import annotations

import numpy as np
import pytest

from automaton.engine.record_codes import EXECUTED_ILLEGAL
from automaton.history.live_run import LiveRun
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.pictures import picture_of, world_from
from automaton.runs.simulation import Simulation
from automaton.strategy.api import (
    CMD_DROP_AT,
    CMD_PARK,
    CMD_RETREAT,
    CMD_TAKE_ORDER,
    NIL,
    ORDER_WAITING,
    InputError,
    Strategy,
    dropoff_cell,
    pickup_cell,
)
from automaton.verification.validator import validate_stored
from automaton.verification.verification import verify_recording
from automaton.world.resolve import resolve

FLOOR = """
name: leaving
layout:
  picture: |
    {aisle}
    irrrrrrd
fleet: {robots: 2, kinematics: omni, start: [[1, 0], [5, 0]], when_idle: leave}
orders: {list: [{from: [0, 1], to: [3, 1]}, {from: [0, 1], to: [4, 1]}, {from: [0, 1], to: [2, 1]}]}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: parked, max_duration: 200}
measure: {}
"""


@pytest.fixture
def scenario(tmp_path):
    def written(*settings, aisle="~~~~~~~~"):
        path = tmp_path / "scenario.yaml"
        path.write_text(FLOOR.replace("{aisle}", aisle))
        return resolve(path, settings)

    return written


def ran(resolved, until=None):
    simulation = Simulation(resolved)
    simulation.run(until)
    return simulation


class Late(Strategy):
    """Robot 0 alone works, and takes order k in tick 20 k + 1 or later."""

    layer = "allocation"
    period = 1

    def decide(self, view, batch, decisions, memory, workspace):
        out, robots = decisions.allocation, view.robots
        for k in range(batch.count):
            i = batch.robot[k]
            load, order = robots.load[i], int((view.orders.state != ORDER_WAITING).sum())
            if load != NIL and robots.slot[i] == NIL:
                out.command[k], out.slot[k] = CMD_DROP_AT, view.orders.target[load]
                out.goal_cell[k] = dropoff_cell(view, 0, out.slot[k], -1)
            elif robots.order[i] != NIL or robots.busy[i]:
                continue
            elif i == 0 and order < 3 and view.clock.tick > 20 * order:
                out.command[k], out.order[k] = CMD_TAKE_ORDER, order
                out.goal_cell[k] = pickup_cell(view, 0, view.orders.current_slot[order], -1)
            else:
                out.command[k] = CMD_PARK


class Wrong(Strategy):
    """Answers what is not allowed, whenever there is a robot to be asked for."""

    layer = "right_of_way"
    period = 1

    def decide(self, view, batch, decisions, memory, workspace):
        decisions.right_of_way.command[: batch.count] = CMD_RETREAT
        decisions.right_of_way.value[: batch.count] = -1


def test_who_would_leave_and_loses_the_tick_is_not_parked_any_more(scenario):
    one = "orders.list=[{from: [0, 1], to: [3, 1]}]"
    wrong = "strategy.right_of_way=test_leave_when_idle:Wrong"
    resolved = scenario(one, wrong, "stop.max_duration=1")
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    simulation.run()
    robots = simulation.world.robots
    assert robots.executed.tolist() == [EXECUTED_ILLEGAL, EXECUTED_ILLEGAL]
    assert robots.parked.tolist() == [1, 0]  # robot 0 was given an order, and is where it began
    # The actions are the same for both: the state tells who is about to leave.
    assert validate_stored(recorder.recording()).violations == []


def test_who_is_done_is_off_the_floor_where_it_stood(scenario):
    resolved = scenario()
    simulation = ran(resolved)
    robots, cell = simulation.world.robots, resolved.floor_plan.cell
    assert simulation.finished and simulation.tick == simulation.world.orders.delivered.max() + 1
    assert robots.cell.tolist() == [NIL, NIL] and robots.parked.tolist() == [1, 1]
    assert robots.home.tolist() == [cell(2, 0), cell(4, 0)]
    assert "A off the floor at (2, 0)" in picture_of(simulation)


def test_robots_without_a_task_leave_in_the_first_tick(scenario):
    one = "orders.list=[{from: [0, 1], to: [3, 1]}]"
    simulation = ran(scenario(one), until=1)
    assert simulation.world.robots.cell[1] == NIL
    assert ran(scenario(one)).finished


def test_a_cell_given_up_by_leaving_is_free_for_others(scenario):
    # Narrow aisle: robot 1 stands between the dock and where robot 0 has to go.
    settings = (
        "orders.list=[{from: [0, 1], to: [6, 1]}]",
        "fleet.start=[[0, 0], [3, 0]]",
    )
    assert ran(scenario(*settings, aisle="........")).finished
    parked = ran(scenario(*settings, "fleet.when_idle=park", aisle="........"))
    assert not parked.finished


@pytest.mark.parametrize("kinematics", ["omni", "differential"])
@pytest.mark.parametrize("aisle", ["~~~~~~~~", "========", "........"])
def test_who_gets_an_order_later_comes_back_where_it_left(scenario, kinematics, aisle):
    resolved = scenario(
        "strategy.allocation=test_leave_when_idle:Late",
        f"fleet.kinematics={kinematics}",
        aisle=aisle,
    )
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    cells, seen = simulation.world.robots.cell, []
    while not simulation.finished and simulation.tick < 200:
        simulation.run(simulation.tick + 1)
        seen.append(int(cells[0]))
    assert simulation.finished
    gone = np.array(seen) == NIL
    comings = np.flatnonzero(gone[:-1] & ~gone[1:]) + 1  # index of the tick
    assert (comings + 1).tolist() == [21, 41]
    assert simulation.world.orders.dispatched.tolist() == [1, 21, 41]
    # It came back where the order before had ended.
    ended = [resolved.floor_plan.cell(x, 0) for x in (3, 4)]
    assert simulation.world.orders.dispatched_from[1:].tolist() == ended
    verification = verify_recording(recorder.recording())
    assert verification.passed, verification.report.violations or verification.difference
    assert verification.report.counts["left_bay"] == 2


def test_pictures_hold_who_is_off_the_floor(scenario):
    resolved = scenario("strategy.allocation=first-come")
    for tick in (1, 5, 12, 16, 20, 30):
        simulation = ran(resolved, until=tick)
        restored = world_from(picture_of(simulation), resolved)
        assert restored.digest == simulation.digest
        restored.run()
        simulation.run()
        assert restored.digest == simulation.digest


def test_the_digest_tells_where_a_robot_left(scenario):
    simulation = ran(scenario())
    before = simulation.digest
    simulation.world.robots.home[0] += 1
    assert simulation.digest != before


def test_the_past_can_be_looked_at_again(scenario):
    run = LiveRun(scenario(), 1)
    run.show(40)
    states = {}
    for tick in (40, 25, 8, 33):
        run.show(tick)
        states[tick] = run.shown.world.robots.home.tolist(), run.shown.digest
    for tick, (home, digest) in states.items():
        fresh = ran(scenario(), until=tick)
        assert (fresh.world.robots.home.tolist(), fresh.digest) == (home, digest)


def test_the_validator_refuses_who_leaves_with_an_order(scenario):
    resolved = scenario()
    recorder = MemoryRecorder(resolved)
    Simulation(resolved, on_record=recorder).run()
    recording = recorder.recording()
    fleet = recording.header["scenario"]["fleet"]
    assert validate_stored(recording).valid
    fleet["when_idle"] = "park"
    texts = [violation.text for violation in validate_stored(recording).violations]
    assert "parks although it is not at home" in texts


def test_leaving_does_not_go_with_bays(tmp_path):
    with pytest.raises(InputError, match="robots that begin in parking bays park there"):
        resolve("tabletop-mini", ["fleet.when_idle=leave"])
