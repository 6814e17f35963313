"""Recordings made by hand on drawn floors, for the tests of the validator."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from automaton.engine.record_codes import MOVE_EAST, MOVE_NORTH, MOVE_SOUTH, MOVE_WEST
from automaton.recording.contents import FRAME_KIND_END, FRAME_KIND_TICKS, DecodedFrame
from automaton.recording.frames import Recording
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.validator import Report, validate_recording
from automaton.world.resolve import resolve

E, S, W, N = MOVE_EAST, MOVE_SOUTH, MOVE_WEST, MOVE_NORTH

FLOOR = """\
......
.....d
.ss..d"""

RAILS = """\
+--+--d
|ss|###"""

BAYS = """\
b.....
b.....
#.ss.d"""


def header(
    picture: str,
    starts: list[tuple[int, int]] | str,
    robots: int = 0,
    kinematics: str = "omni",
    **parts: Any,
) -> dict[str, Any]:
    """The header of a run on a drawn floor."""
    fleet = {"robots": robots or len(starts), "kinematics": kinematics, "start": starts}
    scenario = {"name": "drawn", "layout": {"picture": picture}, "fleet": fleet, **parts}
    return MemoryRecorder(resolve(msgspec.convert(scenario, Scenario))).header


def played(
    head: dict[str, Any],
    *ticks: dict[int, int],
    changes: list[tuple[int, int, int, int]] | None = None,
    finished: bool | None = None,
) -> Report:
    """Validate a recording in which robot r does ticks[t - 1][r] in tick t.

    `finished`: what its end says, if it has one.
    """
    did = np.zeros((len(ticks), len(head["robots"]["home"])), np.uint16)
    for row, acts in enumerate(ticks):
        for robot, code in acts.items():
            did[row, robot] = code
    rows = np.array(changes or [], np.int64).reshape(-1, 4)
    content = {"first": 1, "executed": did, "changes": rows, "digests": np.zeros((len(ticks), 1))}
    end = (
        []
        if finished is None
        else [DecodedFrame(FRAME_KIND_END, {"ticks": len(ticks), "finished": finished})]
    )
    return validate_recording(head, [DecodedFrame(FRAME_KIND_TICKS, content), *end])


def rules(report: Report) -> list[str]:
    return [violation.rule for violation in report.violations]


def recorded(name: str, *settings: str, seed: int = 1) -> Recording:
    resolved = resolve(name, settings)
    recorder = MemoryRecorder(resolved, seed)
    Simulation(resolved, seed, on_record=recorder).run()
    return recorder.recording()
