"""Distributions of durations that cannot be, and measured durations of a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.errors import InputError
from automaton.scenario.durations import Distribution
from automaton.world.resolve import resolve

SCENARIO = """\
name: measured
layout:
  picture: |
    >>>v
    ^#pv
    ^t<<
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
units: {tick: 0.5 s}
durations: {handling: {line: {empirical: times.csv, column: took}}}
orders: {lines: [{pod: 1}]}
"""


def measured(folder: Path, content: str, scenario: str = SCENARIO) -> Distribution:
    (folder / "times.csv").write_text(content)
    (folder / "measured.yaml").write_text(scenario)
    line = resolve(folder / "measured.yaml").scenario.durations.handling.line
    assert isinstance(line, Distribution)
    return line


def test_a_file_of_durations_becomes_the_scenarios_own_list(tmp_path: Path) -> None:
    """Numbers are ticks, of half a second here; equal ones count as often as they are there."""
    line = measured(tmp_path, "who;took\na;5\nb;7 s\nc;00:00:09\nd;5\n")
    assert line == Distribution(empirical=(5, 14, 18, 5))


def test_a_station_may_have_a_file_of_its_own(tmp_path: Path) -> None:
    own = "stations: {P1: {at: [1, 2], handling: {line: {empirical: times.csv, column: took}}}}\n"
    (tmp_path / "times.csv").write_text("took\n3\n")
    given = SCENARIO.replace("{line: {empirical: times.csv, column: took}}", "{line: 4}")
    (tmp_path / "measured.yaml").write_text(given + own)
    resolved = resolve(tmp_path / "measured.yaml")
    handling = resolved.scenario.stations["P1"].handling
    assert handling is not None and handling.line == Distribution(empirical=(3,))
    assert [Path(name).name for name, _ in resolved.files] == ["times.csv"]


def test_repairs_and_closings_may_have_files_too(tmp_path: Path) -> None:
    more = (
        "faults: {mtbf: 400 s, repair_in_place: {empirical: times.csv, column: took}}\n"
        "floor: {closed: [{cells: [[0, 0]], every: {mean: 90}, for: {empirical: times.csv, "
        "column: shut}}]}\n"
    )
    (tmp_path / "times.csv").write_text("took;shut\n5;10\n7 s;20\n")
    (tmp_path / "measured.yaml").write_text(SCENARIO + more)
    scenario = resolve(tmp_path / "measured.yaml").scenario
    assert scenario.faults.repair_in_place == Distribution(empirical=(5, 14))
    assert [one.ticks for one in scenario.floor.closed] == [Distribution(empirical=(10, 20))]
    (tmp_path / "measured.yaml").write_text(SCENARIO + more.replace("shut", "open"))
    with pytest.raises(InputError, match="there is no column 'open'; the columns are took, shut"):
        resolve(tmp_path / "measured.yaml")


@pytest.mark.parametrize(
    ("content", "line", "sentence"),
    [
        ("take\n3\n", 1, "there is no column 'took'; the columns are take"),
        ("took\n", None, "has no rows below its header"),
        ("took\n3\n-1\n-1\n", 3, "took: '-1' must not be below 0; 1 more such row, in line 4"),
        ("took\n3\nlong\n", 3, "'long'"),
        ("took\n70000\n", 2, "took must be at most 65,535 ticks, found '70000'"),
        ("took\n10 h\n", 2, "allowed is from 0"),
    ],
)
def test_what_cannot_be_is_told_with_its_line(
    content: str, line: int | None, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as error:
        measured(tmp_path, content)
    assert sentence in str(error.value) and error.value.file == str(tmp_path / "times.csv")
    assert error.value.line == line


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    other = SCENARIO.replace("times.csv", "time.csv")
    with pytest.raises(InputError, match=r"there is no file of durations 'time\.csv'"):
        measured(tmp_path, "took\n3\n", other)


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("{lognormal: {mean: 5, sd: -1}}", "lognormal.sd must be a number from 0"),
        ("{lognormal: {mean: 0, sd: 1}}", "lognormal.mean must be a number above 0"),
        ("{empirical: []}", "empirical must be a list"),
        ("{empirical: [1, -2]}", "empirical[1] must be a number from 0"),
        ("{uniform: {from: 9, to: 3}}", "uniform.from (9) must not be above to (3)"),
        ("{exponential: 0.5}", "exponential must be at least a tick, found 0.5"),
        ("{exponential: 4, empirical: [1]}", "a distribution must be one of uniform, lognormal"),
        ("{empirical: times.csv}", "a file of durations needs a column, and a column needs a file"),
    ],
)
def test_distributions_that_cannot_be(line: str, sentence: str, tmp_path: Path) -> None:
    given = SCENARIO.replace("{empirical: times.csv, column: took}", line)
    with pytest.raises(InputError) as error:
        measured(tmp_path, "took\n3\n", given)
    assert sentence in str(error.value)


@pytest.mark.parametrize("allocation", ["cooperative", "adaptive"])
def test_who_does_not_know_pods_says_so_and_what_goes_instead(allocation: str) -> None:
    with pytest.raises(InputError, match=r"does not support pods.*shortest-job"):
        resolve("goods-mini", (f"strategy.allocation={allocation}",))
