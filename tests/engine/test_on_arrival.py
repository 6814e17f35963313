"""Picks and drops of 0 ticks happen as the robot arrives, so that a task takes as long as its moves."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from handmade_recordings import E, played, rules
from handmade_recordings import header as drawn

from automaton.engine.observation import EVENT_DELIVERED, EVENT_ORDER_TAKEN
from automaton.engine.observation import EVENT_PICKED as PICKED
from automaton.engine.record_codes import (
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    DROPPED_ON_ARRIVAL,
    ENTERED_PARKING_BAY,
    EXECUTED_DROP,
    EXECUTED_PICK,
    PICKED_ON_ARRIVAL,
)
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_TURN,
    ORDER_CARRIED,
)
from automaton.history.event_history import EventHistory
from automaton.history.playback import Playback
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.verification import action_text, verify_recording
from automaton.world.resolve import Resolved, resolve

# The shelf is served from (1, 0), the destination from (4, 0).
FLOOR = """\
.....
#s##d"""
ORDERS = {"list": [{"from": [1, 1], "to": [4, 1]}]}
AT_ONCE = {"pick": 0, "drop": 0}


def scenario(x: int, picture: str = FLOOR, **parts: Any) -> Resolved:
    """One robot that starts in column x of the upper row."""
    given = {"name": "arrival", "layout": {"picture": picture}, "orders": ORDERS}
    fleet = {"robots": 1, "kinematics": "omni", "start": [[x, 0]]}
    stop = {"when": "delivered", "max_duration": 100}
    return resolve(msgspec.convert({"fleet": fleet, "stop": stop, **given, **parts}, Scenario))


def run(resolved: Resolved) -> tuple[Simulation, MemoryRecorder]:
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    simulation.run()
    recorder.flush()
    return simulation, recorder


def actions(recorder: MemoryRecorder) -> list[int]:
    frames = [
        frame.content["executed"][:, 0].tolist()
        for frame in recorder.frames
        if frame.kind == FRAME_KIND_TICKS
    ]
    return [did for frame in frames for did in frame]


@pytest.mark.parametrize(
    ("pick", "drop", "ticks"), [(0, 0, 4), (0, 2, 6), (3, 0, 7), (1, 1, 6), (0, 1, 5)]
)
def test_a_task_takes_as_long_as_its_moves(pick: int, drop: int, ticks: int) -> None:
    """One move to the shelf, three to the destination; a load is delivered as its drop begins."""
    simulation, recorder = run(scenario(0, durations={"pick": pick, "drop": drop}))
    begins = ticks - max(0, drop - 1)
    assert int(simulation.world.orders.delivered[0]) == begins
    expected = [E | PICKED_ON_ARRIVAL] if not pick else [E, EXECUTED_PICK] + [0] * (pick - 1)
    expected += [E, E, E | DROPPED_ON_ARRIVAL] if not drop else [E, E, E, EXECUTED_DROP]
    assert actions(recorder) == expected


def test_where_no_move_precedes_it_costs_a_tick() -> None:
    simulation, recorder = run(scenario(1, durations=AT_ONCE))
    assert actions(recorder) == [EXECUTED_PICK, E, E, E | DROPPED_ON_ARRIVAL]
    assert simulation.tick == 4
    close = FLOOR.replace("#s##d", "#sd##")
    near = {"list": [{"from": [1, 1], "to": [2, 1]}]}
    _, recorder = run(scenario(1, close, durations=AT_ONCE, orders=near))
    assert actions(recorder) == [EXECUTED_PICK, E | DROPPED_ON_ARRIVAL]


def test_at_the_end_of_a_long_move() -> None:
    _, recorder = run(scenario(0, durations={"move": 3, **AT_ONCE}))
    assert actions(recorder) == [
        E,
        0,
        PICKED_ON_ARRIVAL,
        E,
        0,
        0,
        E,
        0,
        0,
        E,
        0,
        DROPPED_ON_ARRIVAL,
    ]


def test_a_robot_need_not_face_the_slot() -> None:
    fleet = {"robots": 1, "kinematics": "differential", "start": [[0, 0]]}
    simulation, _ = run(scenario(0, durations={"turn": 5, **AT_ONCE}, fleet=fleet))
    assert simulation.tick == 4 and simulation.world.tally.operations[0, ACTION_TURN].sum() == 0


def test_metrics_and_events_agree() -> None:
    resolved = scenario(0, durations=AT_ONCE)
    event_history = EventHistory()
    simulation = Simulation(resolved, on_observe=event_history)
    simulation.run()
    operations, ticks = simulation.world.tally.operations[0], simulation.world.tally.ticks[0]
    assert (operations[ACTION_PICK].tolist(), operations[ACTION_DROP].tolist()) == ([1, 0], [0, 1])
    assert ticks[ACTION_PICK].sum() == ticks[ACTION_DROP].sum() == 0
    assert ticks[ACTION_MOVE].tolist() == [1, 3]
    figures = metrics_of(simulation)
    assert figures["operations"] == 6 and figures["utilization"] == 1
    told = [
        (tick, code)
        for tick, code, *_ in event_history.events.tolist()
        if code in (PICKED, EVENT_DELIVERED)
    ]
    assert told == [(1, PICKED), (4, EVENT_DELIVERED)]
    assert not simulation.observation.lost.any()


def test_an_order_to_come_may_be_taken_and_done_in_one_tick() -> None:
    here = {"list": [{"from": [2, 0], "to": [2, 0]}]}
    event_history = EventHistory()
    resolved = scenario(1, "..t", orders=here, durations=AT_ONCE)
    Simulation(resolved, on_observe=event_history).run()
    told = [event[:4] for event in event_history.events.tolist()]
    assert told == [[1, EVENT_ORDER_TAKEN, 0, 0], [1, EVENT_DELIVERED, 0, 0]]


@pytest.mark.parametrize(
    "parts",
    [
        {"durations": AT_ONCE},
        {"durations": {"move": 2, **AT_ONCE}},
        {"durations": AT_ONCE, "world": {"slowdown": "zones", "extra_tick_probability": 0.5}},
    ],
)
def test_recorded_verified_and_played_again(parts: dict[str, Any]) -> None:
    simulation, recorder = run(scenario(0, **parts))
    recording = recorder.recording()
    found = verify_recording(recording)
    assert found.passed and [str(violation) for violation in found.report.violations] == []
    assert found.report.counts["pick"] == found.report.counts["drop"] == 1
    playback = Playback(recording.header, recording.stored())
    playback.go_to(simulation.tick)
    assert playback.simulation.digest == simulation.digest


@pytest.mark.parametrize("name", ["tabletop-1", "crossing"])
def test_whole_fleets(name: str) -> None:
    resolved = resolve(name, ("durations.pick=0", "durations.drop=0", "stop.max_duration=1500"))
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    arrived = []
    while not simulation.finished and simulation.tick < 1500:
        simulation.run(simulation.tick + 1)
        robots = simulation.world.robots
        picked = (robots.executed & PICKED_ON_ARRIVAL) != 0
        assert (simulation.world.orders.state[robots.load[picked]] == ORDER_CARRIED).all()
        arrived.append(int(picked.sum()))
    assert sum(arrived) > 5 and simulation.world.clock.tick > 50
    assert validated(recorder) == []


def validated(recorder: MemoryRecorder) -> list[str]:
    report = verify_recording(recorder.recording()).report
    return [str(violation) for violation in report.violations]


# The validator, on recordings made by hand: A starts west of the cell beside the shelf.


def by_hand(durations: dict[str, int] | None = None) -> dict[str, Any]:
    return drawn(FLOOR, [(0, 0)], orders=ORDERS, durations=durations or AT_ONCE)


TAKEN = (1, CHANGE_ORDER_RESERVED, 0, 0)
PICK_0 = [TAKEN, (1, CHANGE_PICKED, 0, 0)]
WAY = ({0: E | PICKED_ON_ARRIVAL}, {0: E}, {0: E}, {0: E | DROPPED_ON_ARRIVAL})
SET = [(4, CHANGE_DROPPED, 0, 1), (4, CHANGE_ORDER_RESERVED, 0, -1)]


def test_the_validator_accepts_it() -> None:
    report = played(by_hand(), *WAY, changes=[*PICK_0, *SET])
    assert report.valid, report.violations
    assert report.counts == {"move_east": 4, "pick": 1, "drop": 1}


def test_not_where_a_pick_takes_time() -> None:
    head = by_hand({"pick": 2, "drop": 0})
    report = played(head, *WAY, changes=[*PICK_0, *SET])
    assert rules(report) == ["arrival"]
    assert report.violations[0].text == "handles its load on arrival, but a pick takes 2 ticks"


def test_not_without_arriving() -> None:
    late = [TAKEN, (2, CHANGE_PICKED, 0, 0)]
    assert rules(played(by_hand(), {0: E}, {0: PICKED_ON_ARRIVAL}, changes=late)) == ["arrival"]
    head = by_hand({"move": 2, **AT_ONCE})
    early = played(head, {0: E | PICKED_ON_ARRIVAL}, changes=PICK_0)
    assert set(rules(early)) == {"arrival", "load"}, "it is still in the west, beside no shelf"
    assert played(head, {0: E}, {0: PICKED_ON_ARRIVAL}, changes=late).valid


def test_not_beside_another_cell() -> None:
    passing = [{0: E}, {0: E | PICKED_ON_ARRIVAL}]
    report = played(by_hand(), *passing, changes=[TAKEN, (2, CHANGE_PICKED, 0, 0)])
    assert rules(report) == ["load"]


@pytest.mark.parametrize(
    "changes", [[TAKEN], [(1, CHANGE_PICKED, 0, 0)], [*PICK_0, (1, CHANGE_PICKED, 0, 0)]]
)
def test_not_without_a_load_that_is_its_own(changes: list[tuple[int, int, int, int]]) -> None:
    assert rules(played(by_hand(), WAY[0], changes=changes))[0] in ("load", "order")


def test_not_both_at_once() -> None:
    both = {0: E | PICKED_ON_ARRIVAL | DROPPED_ON_ARRIVAL}
    assert "load" in rules(played(by_hand(), both, changes=PICK_0))


def test_a_recorded_action_in_words() -> None:
    assert action_text(E | PICKED_ON_ARRIVAL) == "move east, picked up on arrival"
    assert action_text(DROPPED_ON_ARRIVAL) == "nothing, dropped on arrival"
    assert action_text(E | ENTERED_PARKING_BAY) == "move east, parked"


def test_lengths_of_other_robots_may_stand_between_its_changes() -> None:
    """B waits in the tick in which A arrives; its length is noted after A's pick."""
    head = drawn(FLOOR, [(0, 0), (3, 0)], orders=ORDERS, durations=AT_ONCE)
    changes = [*PICK_0, (1, CHANGE_DURATION, 1, 3)]
    assert played(head, {0: E | PICKED_ON_ARRIVAL, 1: 10}, {}, {}, {1: E}, changes=changes).valid
    assert rules(played(head, {0: E | PICKED_ON_ARRIVAL, 1: 10}, {1: E}, changes=changes)) == [
        "busy"
    ]
