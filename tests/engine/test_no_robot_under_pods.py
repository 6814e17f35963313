"""`pods: {under: none}`: no robot enters the cell of a pod but the robot that lifts it."""

from __future__ import annotations

from typing import Any

import pytest
from handmade_recordings import rules
from pod_scenes import RING, pod_scene

from automaton.engine.observation import CAUSES
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.history.event_history import EventHistory
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolved import Resolved

SHORT_CUT = """\
>>>>>>>v
^#p##q#v
^t<<<<<<"""


def scene(under: str = "none", picture: str = RING, **parts: Any) -> Resolved:
    fleet = {"robots": 1, "kinematics": "omni", "start": parts.pop("start", [[3, 0]])}
    lines = [{"pod": parts.pop("pod", 1), "station": "P1"}]
    return pod_scene(lines, picture=picture, pods={"under": under}, fleet=fleet, **parts)


def test_who_does_not_lift_it_stops_before_a_pod() -> None:
    """Its router would never lead it there: it is sent south from (4, 0), beneath pod 3."""
    run = Simulation(scene(), on_observe=EventHistory())
    run.run(1)
    robots = run.world.robots
    robots.route[0, 0], robots.route_length[0], robots.route_index[0] = 1, 1, 0
    robots.need[0] = 0
    run.world.clock.needing_route = 0
    run.run(2)
    assert CAUSES[run.observation.cause[0]].name == "pod ahead"
    assert run.resolved.floor_plan.xy(int(robots.cell[0])) == (4, 0)


@pytest.mark.parametrize("under", ["empty", "none"])
def test_the_way_without_a_load_leads_past_storage(under: str) -> None:
    """From (5, 0) to the pod at (2, 1): not by (5, 1), but all the way round."""
    stations = {"P1": {"at": [1, 2]}}
    run = Simulation(scene(under, SHORT_CUT, start=[[5, 0]], stations=stations))
    while run.world.robots.load[0] == NIL:
        run.run(run.tick + 1)
    assert run.tick == 10 + 1, "and lifts it in the next tick"


def test_a_run_is_valid_and_the_validator_knows_the_rule() -> None:
    resolved = scene()
    recorder = MemoryRecorder(resolved)
    run = Simulation(resolved, on_record=recorder)
    run.run()
    recorder(run)
    assert run.finished and rules(validate_stored(recorder.recording())) == []


def test_no_robot_begins_in_storage() -> None:
    with pytest.raises(InputError, match=r"start at \[2, 1\], in storage"):
        scene(start=[[2, 1]])
