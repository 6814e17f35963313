"""A recording keeps due times: they are verified, and what is late is what was late in the run."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from drawn_scenes import recorded_run, scene

from automaton.history.watched_run import ReplayedRun
from automaton.recording.frames import Recording
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.unavailable_metrics import OF_DUE_TIMES
from automaton.verification.validator import validate_stored
from automaton.verification.verification import verify_recording

LINES = [
    *({"stops": [[6, 0]], "due": 4}, {"stops": [[0, 0]], "release": 3, "due": {"at": 9}}),
    *({"stops": [[6, 0]], "due": 50}, {"stops": [[0, 0]]}, {"stops": [[6, 0]], "due": 200}),
]


def recorded(lines: list[dict[str, object]], **parts: object) -> tuple[Simulation, Recording]:
    resolved = scene(
        "t.....t",
        [(0, 0)],
        orders={"list": lines},
        strategy={"allocation": {"name": "first-come", "by": "due"}, "right_of_way": "wait"},
        stop={"when": "delivered", "max_duration": 18},
        **parts,
    )
    run, recorder = recorded_run(resolved)
    return run, recorder.recording()


def test_what_is_late_is_told_alike_by_the_run_and_its_recording() -> None:
    run, recording = recorded(LINES)
    found = verify_recording(recording)
    assert found.report.violations == [] and found.difference is None
    live = metrics_of(run)
    assert live["late_share"] == 2 / 3 and live["not_yet_due"] == 1
    played = ReplayedRun(recording)
    played.show(run.tick, 9.0)
    again = metrics_of(played.shown)
    stored = next(frame.content for frame in recording.frames if "metrics" in frame.content)
    for name in OF_DUE_TIMES:
        assert again[name] == live[name] == stored["metrics"][name]


@pytest.mark.parametrize("order", [0, 1, 3])
def test_another_due_time_is_found_by_the_rules_and_by_the_run_made_again(order: int) -> None:
    _, recording = recorded(LINES)
    altered = Recording(copy.deepcopy(recording.header), list(recording.frames), complete=True)
    altered.header["orders"]["due"][order] -= 1
    report = validate_stored(altered)
    assert [violation.rule for violation in report.violations][:1] == ["due"]
    assert f"order {order} is due in tick" in report.violations[0].text
    difference = verify_recording(altered).difference
    assert difference is not None and difference.array == "header"


def test_due_times_that_a_recording_leaves_out_are_missed() -> None:
    _, recording = recorded(LINES)
    altered = Recording(copy.deepcopy(recording.header), list(recording.frames), complete=True)
    del altered.header["orders"]["due"]
    (violation,) = validate_stored(altered).violations[:1]
    assert violation.text == "order 0 is due in tick never, by its scenario 4"


def test_without_due_times_a_recording_is_what_it_was() -> None:
    run, recording = recorded([{"stops": [[6, 0]]}])
    assert "due" not in recording.header["orders"]
    assert validate_stored(recording).violations == []
    assert np.all(run.world.orders.due == 2**31 - 1)
