"""Stops that take time, and orders that bring a load over stops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.observation import EVENT_NAMES
from automaton.engine.state import LAYER_ALLOCATION
from automaton.history.event_history import EventHistory
from automaton.runs.metrics import metrics_of
from automaton.runs.pictures.pictures import picture_of, world_from
from automaton.runs.simulation import Simulation
from automaton.strategy import lookup
from automaton.strategy.api import (
    ACTION_SERVE,
    CMD_DROP_AT,
    CMD_TAKE_ORDER,
    ORDER_STARTED,
    ORDER_WAITING,
    REASON_PICKED,
    REASON_SERVED,
    InputError,
    Strategy,
)
from automaton.verification.verification import verify_recording
from automaton.world.resolved import Resolved

STRATEGY = {"allocation": "first-come", "right_of_way": "wait"}
CORRIDOR = "t......t"
HANDLING = {"pick": 2, "drop": 3}


def orders(
    *lines: dict[str, Any], start: Sequence[tuple[int, int]] = ((0, 0),), **parts: Any
) -> Resolved:
    """Orders on a corridor with a station at each end."""
    parts = {"strategy": STRATEGY, "durations": HANDLING, "picture": CORRIDOR, **parts}
    return scene(parts.pop("picture"), list(start), orders={"list": list(lines)}, **parts)


def stop(x: int, ticks: int) -> dict[str, Any]:
    return {"at": (x, 0), "for": ticks}


def played(resolved: Resolved) -> Simulation:
    run = Simulation(resolved)
    run.run()
    assert run.finished
    return run


BROUGHT = {"from": (0, 0), "to": (7, 0), "stops": [stop(3, 4), (5, 0)]}


def test_a_stop_that_takes_time_is_done_in_its_last_tick() -> None:
    run = played(orders({"stops": [stop(3, 5), (5, 0)]}))
    assert run.world.stops.done.tolist() == [8, 10], "three moves, five ticks there, two moves"
    assert run.world.tally.ticks[0, ACTION_SERVE].sum() == 5
    assert run.world.tally.operations[0, ACTION_SERVE].sum() == 1


def test_who_stands_there_begins_at_once() -> None:
    run = played(orders({"stops": [stop(0, 4)]}))
    assert run.world.stops.done.tolist() == [4]


def test_two_stops_in_one_cell_take_the_time_of_both() -> None:
    run = played(orders({"stops": [stop(0, 2), stop(0, 1), stop(0, 3)]}))
    assert run.world.stops.done.tolist() == [2, 3, 6]


def test_a_load_stays_on_its_robot_at_the_stops() -> None:
    run = Simulation(orders(BROUGHT))
    loads = []
    for tick in range(1, 15):
        run.run(until=tick)
        loads.append(int(run.world.robots.load[0]))
    assert loads == [0] * 13 + [-1], "picked up in tick 1, set down in tick 14"
    assert run.world.stops.done.tolist() == [9, 11]
    assert run.world.orders.delivered.tolist() == [14]


def test_a_stop_where_the_load_was_picked_up_begins_after_the_pick() -> None:
    assert played(orders({**BROUGHT, "stops": [(0, 0)]})).world.stops.done.tolist() == [2]
    assert played(orders({**BROUGHT, "stops": [stop(0, 3)]})).world.stops.done.tolist() == [5]


class Asked(Strategy):
    """Allocation that takes order 0 and brings it, and notes why it was asked."""

    layer = "allocation"
    period = 1

    def __init__(self, drops_in: int = 0) -> None:
        super().__init__()
        self.reasons: list[tuple[int, int]] = []
        self.drops_in = drops_in  # a tick in which it wants the load dropped, whatever it is asked

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        out, tick = decisions.allocation, int(view.clock.tick)
        for k in range(batch.count):
            reason = int(batch.reason[k])
            if tick == 1:
                out.command[k], out.order[k], out.goal_cell[k] = (
                    CMD_TAKE_ORDER,
                    0,
                    view.slots.cell[0],
                )
            elif reason in (REASON_PICKED, REASON_SERVED) or tick == self.drops_in:
                self.reasons.append((tick, reason))
                out.command[k], out.slot[k], out.goal_cell[k] = CMD_DROP_AT, 1, view.slots.cell[1]


def with_allocation(resolved: Resolved, allocation: Strategy) -> Simulation:
    names = {"routing": "shortest", "right_of_way": "wait"}
    others = [
        lookup.load(layer, name)(lookup.parameters_type(layer, name)())
        for layer, name in names.items()
    ]
    return Simulation(resolved, strategies=[None, None, allocation, *others])


def test_where_a_load_goes_is_asked_after_its_last_stop() -> None:
    asked = Asked()
    run = with_allocation(orders(BROUGHT), asked)
    run.run()
    assert asked.reasons == [(12, REASON_SERVED)]
    assert run.finished and run.world.tally.illegal.sum() == 0


def test_a_load_with_stops_left_may_not_be_dropped() -> None:
    run = with_allocation(orders(BROUGHT), Asked(drops_in=4))
    run.run()
    assert run.world.tally.illegal[LAYER_ALLOCATION] == 1
    assert run.finished


def test_an_order_whose_first_stop_is_begun_is_its_robots() -> None:
    run = Simulation(orders({"stops": [stop(3, 5), (5, 0)]}))
    run.run(until=3)
    assert run.world.orders.state[0] == ORDER_WAITING
    run.run(until=4)
    assert run.world.orders.state[0] == ORDER_STARTED


def test_a_load_that_a_robot_had_to_leave_goes_on_with_the_stops_that_are_left() -> None:
    faults = {"list": [{"robot": 0, "at": 7}], "tow_after": 1}
    ways = ".........\n.t......t\n........."
    moved = {"from": (1, 1), "to": (8, 1), "stops": [{"at": (2, 1), "for": 2}, (6, 1)]}
    resolved = orders(moved, start=[(1, 1), (0, 0)], picture=ways, faults=faults)
    run, recorder = recorded_run(resolved)
    assert run.finished
    assert run.world.orders.legs[0] == 2
    assert run.world.stops.done[0] < 7 < run.world.stops.done[1], "the first one is not repeated"
    found = verify_recording(recorder.recording())
    assert found.report.violations == [] and found.difference is None


@pytest.mark.parametrize("allocation", ["first-come", "shortest-job", "greedy"])
@pytest.mark.parametrize("right_of_way", ["retreat", "pibt"])
def test_runs_are_verified_and_come_out_equal_again(allocation: str, right_of_way: str) -> None:
    picture = "t.....t\n.##.##.\nt.....t"
    lines = [
        {"from": (0, 0), "to": (6, 2), "stops": [{"at": (3, 1), "for": 3}, (0, 2)]},
        {"stops": [{"at": (6, 0), "for": 4}, {"at": (0, 1), "for": 1}], "release": 3},
        {"from": (6, 2), "to": (0, 0), "stops": [(6, 2), {"at": (3, 0), "for": 2}]},
        {"from": (6, 0), "to": (0, 2), "release": 9},
    ] * 4
    faults = {"failure_probability": 0.004, "tow_after": 3, "repair_time": 5}
    fleet = {"robots": 3, "kinematics": "differential", "start": [(0, 0), (6, 2), (3, 1)]}
    resolved = scene(
        picture,
        [(0, 0)],
        orders={"list": lines},
        fleet=fleet,
        faults=faults,
        durations={"turn": 2, **HANDLING},
        strategy={"allocation": allocation, "right_of_way": right_of_way},
        measure={},
    )
    run, recorder = recorded_run(resolved, seed=5)
    found = verify_recording(recorder.recording())
    assert found.report.violations == [] and found.difference is None
    assert run.finished and found.report.counts["serve"] >= 16
    assert metrics_of(run)["delay"] >= 0


def test_a_robot_alone_is_not_late() -> None:
    run = played(orders(BROUGHT, measure={}))
    assert metrics_of(run)["task_time"] == 14
    assert metrics_of(run)["delay"] == 0


@pytest.mark.parametrize("tick", [2, 4, 7, 9, 12])
def test_the_state_at_a_stop_is_written_and_read(tick: int) -> None:
    resolved = orders(BROUGHT)
    run = Simulation(resolved)
    run.run(until=tick)
    picture = picture_of(run)
    again = world_from(picture, resolved)
    assert picture_of(again) == picture
    assert again.digest == run.digest


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ({"from": (0, 0), "to": (0, 0), "stops": [(3, 0)]}, "leave both out"),
        ({"from": (0, 0), "stops": [(3, 0)]}, "the key 'to' is missing"),
        ({"from": (0, 0), "to": (7, 0), "stops": [(3, 4)]}, r"the stop \[3, 4\] lies outside"),
    ],
)
def test_bad_stops_are_named(line: dict[str, Any], sentence: str) -> None:
    with pytest.raises((InputError, ValueError), match=sentence):
        orders(line)


def test_events_tell_of_the_stops_of_a_load() -> None:
    history = EventHistory()
    run = Simulation(orders(BROUGHT), on_observe=history)
    run.run()
    told = [history.event(k) for k in range(len(history.events))]
    names = [(e.tick, EVENT_NAMES[e.code]) for e in told]
    assert [one for one in names if one[1] in ("picked up", "visited", "delivered")] == [
        (1, "picked up"),
        (9, "visited"),
        (11, "visited"),
        (14, "delivered"),
    ]
