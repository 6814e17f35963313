"""Due times: how they are written, what they mean, and what is said of wrong ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.scenario.quantities import clock_text, read_moment
from automaton.scenario.schema import Scenario
from automaton.world.resolve import Resolved, resolve
from automaton.world.scenario_warnings import scenario_warnings

UNITS = 'units: {tick: 0.5 s, clock: "2026-03-02 06:00"}'
SCENARIO = """name: due
layout:
  picture: |
    t...t
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
UNITS
orders: ORDERS
strategy: {allocation: ALLOCATION, right_of_way: wait}
stop: {when: delivered, max_duration: 500}
"""
LIST = "{list: [{from: [0, 0], to: [4, 0], release: 100, due: DUE}]}"
HEAD = "released,from_x,from_y,to_x,to_y,due\n"


def scenario(
    folder: Path, orders: str, units: str = UNITS, allocation: str = "first-come"
) -> Resolved:
    text = SCENARIO.replace("UNITS", units).replace("ORDERS", orders)
    path = folder / "due.yaml"
    path.write_text(text.replace("ALLOCATION", allocation))
    return resolve(path)


def listed(folder: Path, due: str, units: str = UNITS) -> Resolved:
    return scenario(folder, LIST.replace("DUE", due), units)


def in_file(folder: Path, due: str, units: str = UNITS) -> Resolved:
    (folder / "orders.csv").write_text(HEAD + f"100,0,0,4,0,{due}\n0,0,0,4,0,\n")
    return scenario(folder, "{transports: {file: orders.csv}}", units)


def due_ticks(resolved: Resolved) -> list[int | None]:
    return [line.due_tick for line in resolved.scenario.orders.listed or ()]


DUE_TIMES = [
    ("60", 160),
    ("0", 100),
    ("30 s", 160),
    ("0.01 h", 172),
    ('"06:02"', 240),
    ("2026-03-03 06:00", 172_800),
    ("2026-03-02 05:59", -120),
    ('"05:00"', -7200),
]


@pytest.mark.parametrize(("due", "tick"), DUE_TIMES)
def test_a_time_counts_from_the_release_and_a_clock_time_from_the_clock(
    due: str, tick: int, tmp_path: Path
) -> None:
    assert due_ticks(listed(tmp_path, due)) == [tick]
    assert due_ticks(in_file(tmp_path, due)) == [tick, None], "empty: it has no due time"


def test_it_may_be_a_tick_of_the_run(tmp_path: Path) -> None:
    for at, tick in (("70", 70), ("35 s", 70), ('"06:01"', 120), ("-3", -3)):
        assert due_ticks(listed(tmp_path, f"{{at: {at}}}")) == [tick]


def test_without_a_unit_ticks_are_enough(tmp_path: Path) -> None:
    assert due_ticks(listed(tmp_path, "60", "units: {tick: 1 cycle}")) == [160]
    assert due_ticks(in_file(tmp_path, "60", "units: {tick: 1 cycle}")) == [160, None]
    assert due_ticks(listed(tmp_path, "00:00:30", "units: {tick: 0.5 s}")) == [160], "no clock"


@pytest.mark.parametrize("written", [listed, in_file])
def test_a_recorded_scenario_means_the_same(written: Any, tmp_path: Path) -> None:
    for due, tick in DUE_TIMES:
        found = written(tmp_path, due).scenario
        again = msgspec.convert(msgspec.to_builtins(found), Scenario)
        assert (again.orders.listed or ())[0].due_tick == tick


NO_CLOCK, NO_TIME = "units: {tick: 0.5 s}", "units: {tick: 1 cycle}"


@pytest.mark.parametrize(
    ("due", "units", "words"),
    [
        ("30 s", NO_TIME, "units.tick is '1 cycle', which is not a time"),
        ('"06:30"', NO_CLOCK, "the clock time of tick 0 is unknown"),
        ('"06:30"', NO_TIME, "the clock time of tick 0 is unknown"),
        ("30 lines", UNITS, "there is no unit 'lines' here"),
        ("3 m", UNITS, "is a length, expected a time after release such as 30 min, or a clock"),
        ("0.1 s", UNITS, "'0.1 s' is less than half a tick of 0.5 s, so it would be 0 ticks"),
        ("07:10:00", UNITS, "may be a time of the day or a time after the release"),
        ('"25:00"', UNITS, "not a time of the day"),
        ("90000 d", UNITS, "allowed is from 0 ticks (0 s) to 2,000,000,000 ticks"),
        ("0001-01-01 00:00", UNITS, "allowed is from -2,000,000,000 ticks"),
    ],
)
def test_a_wrong_one_gets_one_sentence_with_its_line(
    due: str, units: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as error:
        listed(tmp_path, due, units)
    assert "due.yaml:7: " in str(error.value) and words in str(error.value), str(error.value)


@pytest.mark.parametrize("due", ["-5", "soon"])
def test_a_wrong_number_too(due: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"due\.yaml:7: .*due"):
        listed(tmp_path, due)
    with pytest.raises(InputError, match=rf"orders\.csv:2: due '{due}' is not a time"):
        in_file(tmp_path, due)


def test_what_is_due_before_its_release_is_counted(tmp_path: Path) -> None:
    line = "{stops: [[0, 0]], release: RELEASE, due: {at: 9}}"
    lines = [line.replace("RELEASE", release) for release in ("8", "9", "10", "11")]
    warnings = scenario_warnings(scenario(tmp_path, f"{{list: [{', '.join(lines)}]}}"))
    assert warnings == [
        "2 orders are due before they are released, and therefore late from the start; the first "
        "is "
        "orders.list[2]"
    ]
    warnings = scenario_warnings(scenario(tmp_path, f"{{list: [{lines[2]}]}}"))
    assert warnings == [
        "orders.list[0] is due before it is released, and therefore late from the start"
    ]


def test_an_allocation_by_due_times_needs_some(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    by_due = "{name: first-come, by: due}"
    orders = "{list: [{stops: [[0, 0]]}]}"
    (warning,) = scenario_warnings(scenario(tmp_path, orders, allocation=by_due))
    assert warning.startswith("strategy.allocation uses due times (by: due), but no order has")
    assert main(["check", str(tmp_path / "due.yaml")]) == 0
    assert "uses due times" in capsys.readouterr().err
    due = "{list: [{stops: [[0, 0]], due: 5}]}"
    assert scenario_warnings(scenario(tmp_path, due, allocation=by_due)) == []


@pytest.mark.parametrize(
    ("clock", "seconds", "text"),
    [
        ("2026-03-02 06:00", 0, "06:00"),
        ("2026-03-02 06:00", 30_605, "14:30:05"),
        ("2026-03-02 06:00", 18 * 3600, "2026-03-03 00:00"),
        ("2026-03-02 06:00", -7 * 3600, "2026-03-01 23:00"),
        ("06:00", 18 * 3600, "00:00 on day 2"),
        ("06:00", -6 * 3600 - 1, "23:59:59 on day 0"),
        ("2026-03-02 06:00", 10**15, "07:46:40 on day 11,574,074,075"),
    ],
)
def test_a_tick_is_told_by_the_clock(clock: str, seconds: int, text: str) -> None:
    from fractions import Fraction

    assert clock_text(read_moment(clock), Fraction(seconds)) == text
