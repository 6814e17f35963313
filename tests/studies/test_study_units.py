"""Studies whose levels, warm-up and window are given with units."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.errors import InputError
from automaton.studies.sweeps.sweep_plan import resolved_study, windows_of

SCENARIO = """name: line
layout: {picture: "t..t"}
fleet: {robots: 1, kinematics: omni}
units: {tick: 0.5 s, cell: 1 m}
orders: {generator: visits, count: 50, mean_interarrival_time: 60/h}
strategy: {allocation: first-come}
stop: {when: never, max_duration: 1 h}
"""
STUDY = """name: speeds
scenario: line.yaml
factors: {durations.move: [0.5 m/s, 1 m/s], durations.pick: [1 s, 20 s]}
replications: 2
design: steady-state
warm_up: 10 min
window: 00:05:00
"""


def study(folder: Path, old: str = "", new: str = "") -> Path:
    (folder / "line.yaml").write_text(SCENARIO)
    path = folder / "study.yaml"
    path.write_text(STUDY.replace(old, new, 1))
    return path


def test_levels_are_read_by_the_scenario_and_shown_as_written(tmp_path: Path) -> None:
    declared, _, scenarios = resolved_study(study(tmp_path))
    durations = [resolved.scenario.durations for resolved in scenarios]
    assert [(one.move, one.pick) for one in durations] == [(4, 2), (4, 40), (2, 2), (2, 40)]
    assert declared.points[0].levels == {"durations.move": "0.5 m/s", "durations.pick": "1 s"}
    assert [one.scenario.measure.warm_up for one in scenarios if one.scenario.measure] == [1200] * 4
    assert windows_of(declared, scenarios).window == 600


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("[0.5 m/s, 1 m/s]", "[0.5 mph, 1 m/s]", 3, "durations.move: '0.5 mph': there is no unit"),
        ("10 min", "10 m", 6, "measure.warm_up: '10 m' is a length, expected a time such as 20 s"),
        ("10 min", "mser-6", 6, "warm_up must be a whole number"),
        ("00:05:00", "05:00", 7, "window: '05:00' has two parts"),
        ("00:05:00", "0.1 s", 7, "window: '0.1 s' is less than half a tick of 0.5 s"),
        ("00:05:00", "soon", 7, "or a time such as 20 s, found 'soon'"),
        ("durations.pick: [1 s, 20 s]", "units.tick: [0.5 s, 1 s]", 7,
         "window 00:05:00 is a different number of ticks at some points; give it in ticks"),
        ("durations.pick: [1 s, 20 s]", "durations.pick: [1 s, 2]", 3,
         "points 0 and 1 have the same runs"),
    ],
)  # fmt: skip
def test_a_mistake_has_its_line(tmp_path: Path, old: str, new: str, line: int, words: str) -> None:
    path = study(tmp_path, old, new)
    with pytest.raises(InputError) as caught:
        resolved_study(path)
    assert str(caught.value).startswith(f"{path}:{line}: "), caught.value
    assert words in str(caught.value)
