"""Floors with everything on at once, and recordings of shipped scenarios: samples of long proofs.

`tests/proofs/everything_on.py` and `tests/proofs/shipped_recordings.py` do the same at length.
"""

from __future__ import annotations

import copy
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from counted_recordings import flaws_of
from everything_on import as_yaml, recorded, scenario_of, trials
from shipped_recordings import rows
from whole_floors import contents_of, resolved_whole

from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_DROPPED,
    CHANGE_PICKED,
    EXECUTED_CHARGE,
    MOVE_NORTH,
)
from automaton.recording.contents import FRAME_KIND_TICKS, DecodedFrame
from automaton.recording.frames import Recording
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world import feasibility
from automaton.world.resolve import resolve

SAMPLE, TICKS = range(8, 31), 200
COUNTED = 28  # a scenario with pods, gates, faults and charging
IN_SHAFT = range(29, 30)  # robots that would begin in the shaft of a lift
NO_WAY_HOME = 700_755  # from a charger, for robots of one type


def test_on_floors_with_everything_on_nothing_breaks() -> None:
    findings, counts = trials(SAMPLE, length=TICKS)
    assert findings == []
    assert counts["runs"] > 0.7 * len(SAMPLE)
    for name in ("delivered", "failures", "charging", "at_gates", "in_queues"):
        assert counts[name] > 0, f"in no run: {name}"
    assert counts["with pods + gates + battery + faults"] > 1


def test_no_robot_is_sent_to_a_charger_from_which_it_does_not_get_home() -> None:
    run = Simulation(resolved_whole(scenario_of(NO_WAY_HOME)))
    run.run()
    assert (run.world.tally.illegal == 0).all()


def test_a_scenario_and_its_file_are_the_same(tmp_path: Path) -> None:
    scenario = scenario_of(COUNTED, TICKS)
    file = tmp_path / "whole.yaml"
    file.write_text(as_yaml(scenario), encoding="utf-8")
    assert resolve(str(file)).scenario == resolved_whole(scenario).scenario


def test_robots_that_begin_in_lifts_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    assert trials(IN_SHAFT, length=400).flaws == []
    monkeypatch.setattr(feasibility, "check_homes", lambda *arguments: None)
    assert trials(IN_SHAFT, length=400).flaws, "without the check, a run of them breaks"


@pytest.fixture(scope="module")
def recording() -> Recording:
    """A recorded run of the scenario COUNTED."""
    scenario = scenario_of(COUNTED, TICKS)
    assert {"pods", "gates", "charging"} <= contents_of(scenario)
    return recorded(resolved_whole(scenario), Random(COUNTED))[1]


def altered(recording: Recording) -> tuple[Any, list[Any]]:
    """A copy of a recording, and the contents of its frames of ticks."""
    frames = [DecodedFrame(kind, copy.deepcopy(content)) for kind, content in recording.frames]
    ticks = [frame.content for frame in frames if frame.kind == FRAME_KIND_TICKS]
    return Recording(copy.deepcopy(recording.header), frames, complete=True), ticks


def test_a_recording_adds_up(recording: Recording) -> None:
    assert flaws_of(recording) == [] and validate_stored(recording).valid


@pytest.mark.parametrize("code", [1, 2, 3, 4, EXECUTED_CHARGE])
def test_what_a_robot_did_is_missed(recording: Recording, code: int) -> None:
    again, ticks = altered(recording)
    part = next(part for part in ticks if (part["executed"] == code).any())
    tick, robot = np.argwhere(part["executed"] == code)[0]
    part["executed"][tick, robot] = 0
    assert flaws_of(again)


@pytest.mark.parametrize("code", [CHANGE_PICKED, CHANGE_DROPPED])
def test_a_pod_that_stays_where_it_was_is_found(recording: Recording, code: int) -> None:
    again, ticks = altered(recording)
    part = next(part for part in ticks if (part["changes"][:, 1] == code).any())
    first = int(np.argmax(part["changes"][:, 1] == code))
    part["changes"] = np.delete(part["changes"], first, axis=0)
    assert flaws_of(again)


def test_other_prices_are_found(recording: Recording) -> None:
    again, _ = altered(recording)
    drain = again.header["scenario"]["battery"]["drain"]
    drain["move"] += 0.0001
    assert flaws_of(again)


def test_robots_that_swap_are_found(recording: Recording) -> None:
    again, ticks = altered(recording)
    executed = ticks[0]["executed"]
    moves = (executed & ACTION_MASK > 0) & (executed & ACTION_MASK <= MOVE_NORTH)
    executed[moves] = (executed[moves] + 1) % 4 + 1  # each the other way
    assert flaws_of(again)


PODS_AND_CHARGING = """\
name: pods-charging
layout:
  picture: |
    ++++++t++
    cppp+~qqq
    +t++t+++c
    +++++++++
    ppp+pppq+
fleet: {robots: 5}
battery: {drain: {move: 2}, charge_rate: [[0, 1]]}
orders: {lines: {count: 27}}
strategy: {charging: opportunity}
"""


def test_recordings_to_the_end_are_verified(tmp_path: Path) -> None:
    file = tmp_path / "pods-charging.yaml"
    file.write_text(PODS_AND_CHARGING, encoding="utf-8")
    for row in rows(["goods-mini", str(file)], [1]):
        assert row.flaw == "" and row.verdict == "verified"
        assert row.recorded.answer["finished"]
        assert 20 < row.recorded.memory < 4096 and 20 < row.verified.memory < 4096
