"""What `check` says of times and speeds that are no whole number of ticks."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.commands import main
from automaton.world.conversion_table import coarse_conversions, conversion_lines
from automaton.world.resolve import Resolved, resolve

SCENARIO = """name: yard
layout: {generator: tabletop, tables: 2, positions: 3}
fleet: {robots: 2, kinematics: omni}
units: {tick: 0.5 s, cell: 1.2 m, clock: "06:00"}
orders: {generator: full-shelves}
"""


def path_of(folder: Path) -> str:
    path = folder / "yard.yaml"
    path.write_text(SCENARIO)
    return str(path)


def resolved(folder: Path, *settings: str) -> Resolved:
    return resolve(path_of(folder), settings)


@pytest.mark.parametrize(
    ("setting", "line"),
    [
        ("durations.move=1.5 m/s", "durations.move 1.5 m/s: 1.6 ticks -> 2, 25 % slower"),
        ("durations.move=1 m/s", "durations.move 1 m/s: 2.4 ticks -> 2, 17 % faster"),
        (
            "floor.speed_limits=[{cells: [[0, 0], [1, 0]], max_speed: 0.7 m/s}]",
            "floor.speed_limits[0].max_speed 0.7 m/s: 3.42857 ticks -> 3, 12 % faster",
        ),
        (
            "durations.move={empty: 1.5 m/s, loaded: 1.2 m/s}",
            "durations.move.empty 1.5 m/s: 1.6 ticks -> 2, 25 % slower",
        ),
        (
            "durations.move={empty: 1.2 m/s, loaded: 1.5 m/s}",
            "durations.move.loaded 1.5 m/s: 1.6 ticks -> 2, 25 % slower",
        ),
        ("durations.turn=100 deg/s", "durations.turn 100 deg/s: 1.8 ticks -> 2, 11 % slower"),
        ("durations.pick=10.2 s", "durations.pick 10.2 s: 20.4 ticks -> 20, 2 % shorter"),
        ("durations.pick=10.3 s", "durations.pick 10.3 s: 20.6 ticks -> 21, 1.9 % longer"),
        (
            "faults.tow_after='0:00:01.1'",
            "faults.tow_after 0:00:01.1: 2.2 ticks -> 2, 9.1 % shorter",
        ),
        ("information={radius: 3 m}", "information.radius 3 m: 2.5 cells -> 3, 20 % longer"),
        (
            "faults.list=[{robot: 0, at: 1.7 s}]",
            "faults.list[0].at 1.7 s: 3.4 ticks -> 3, 0.2 s earlier",
        ),
    ],
)
def test_each_conversion_that_is_not_exact_has_a_line(
    tmp_path: Path, setting: str, line: str
) -> None:
    assert conversion_lines(resolved(tmp_path, setting)) == [line]


def test_what_is_exact_or_is_not_rounded_has_none(tmp_path: Path) -> None:
    settings = (
        'layout={picture: "t..t"}',
        "orders={generator: visits, count: 5, mean_interarrival_time: 7/h}",
        "durations={move: 2.4 m/s, pick: 10 s, drop: 3}",
        "faults.mtbf=1000.1 s",
        "units.tick=0.25 s",
    )
    assert conversion_lines(resolved(tmp_path, *settings)) == []


def test_batteries_lose_little(tmp_path: Path) -> None:
    battery = "battery={drain: {move: 0.5, turn: 0.05 %/h, wait: 2 %/h}, charge_rate: 36 %/h}"
    settings = ("strategy.charging=none", battery)
    assert conversion_lines(resolved(tmp_path, *settings)) == [
        "battery.drain.turn 0.05 %/h: 69.4444 units -> 69, 0.64 % less"
    ]
    assert coarse_conversions(resolved(tmp_path, *settings)) == []


def test_parameters_of_strategies_count_too(tmp_path: Path) -> None:
    setting = "strategy.right_of_way={name: wait, wait_loaded: [1.1 s, 5 s]}"
    assert conversion_lines(resolved(tmp_path, setting)) == [
        "strategy.right_of_way.wait_loaded[0] 1.1 s: 2.2 ticks -> 2, 9.1 % shorter"
    ]


@pytest.mark.parametrize(
    ("settings", "tick"),
    [
        (("durations.move=1.5 m/s",), "0.2 s"),  # 1.2 m in 0.8 s
        (("durations.move=1.5 m/s", "durations.pick=4.5 s"), "0.1 s"),  # 4.5 s in 0.2 s: 22.5
        (("durations.pick=1.1 s",), "0.1 s"),
        (("durations.pick=3.3 s", "units.tick=1 s"), "0.25 s"),  # 13.2 ticks are 13: 1.5 %
        (("durations.pick=0.33 s",), "0.01 s"),  # 16.5 ticks of 0.02 s are 17: 3 %
    ],
)
def test_the_largest_tick_that_fits_is_named(
    tmp_path: Path, settings: tuple[str, ...], tick: str
) -> None:
    (sentence,) = coarse_conversions(resolved(tmp_path, *settings))
    assert sentence.endswith(f"; with units.tick: {tick} all times are within 2 %")
    assert coarse_conversions(resolved(tmp_path, *settings, f"units.tick={tick}")) == []


def test_where_no_tick_fits_it_says_so(tmp_path: Path) -> None:
    (sentence,) = coarse_conversions(resolved(tmp_path, "units.tick=10 ms", "durations.pick=9 ms"))
    assert sentence.endswith("11 % longer; no tick from 1 to 0.01 s keeps all times within 2 %")
    # 50 s would be more ticks than a pick may take.
    long = ("units.tick=0.01 s", "durations.pick=99.999 s", "durations.turn=5 ms")
    (sentence,) = coarse_conversions(resolved(tmp_path, *long))
    assert "no tick from 1 to 0.01 s" in sentence


def test_lengths_have_a_sentence_of_their_own(tmp_path: Path) -> None:
    settings = ("information={radius: 3 m}", "durations.move=1.5 m/s")
    times, lengths = coarse_conversions(resolved(tmp_path, *settings))
    assert times.endswith("with units.tick: 0.2 s all times are within 2 %")
    assert lengths.endswith("20 % longer; only a different units.cell changes this")


def test_points_in_time_are_late_but_never_warned_of(tmp_path: Path) -> None:
    assert coarse_conversions(resolved(tmp_path, "faults.list=[{robot: 0, at: 0.7 s}]")) == []


def test_of_many_the_worst_are_shown(tmp_path: Path) -> None:
    faults = ", ".join(f"{{robot: 0, at: {k}.1 s}}" for k in range(1, 101))
    lines = conversion_lines(resolved(tmp_path, f"faults.list=[{faults}]"))
    assert len(lines) == 21
    assert lines[0] == "faults.list[0].at 1.1 s: 2.2 ticks -> 2, 0.1 s earlier"
    assert lines[-1] == "... and 80 more with smaller errors"


def test_check_prints_the_table_and_the_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["check", path_of(tmp_path), "--set", "durations.move=1.5 m/s"]
    assert main(command) == 0
    out, err = capsys.readouterr()
    assert out.splitlines() == [
        "yard: 6 shelves, 5 destinations, 2 robots, right of way pibt by default, ok",
        "  durations.move 1.5 m/s: 1.6 ticks -> 2, 25 % slower",
    ]
    assert err == (
        "automaton: yard: warning: durations.move 1.5 m/s: 1.6 ticks -> 2, 25 % slower; with "
        "units.tick: 0.2 s all times are within 2 %\n"
    )
    assert main([*command, "--set", "units.tick=0.2 s"]) == 0
    out, err = capsys.readouterr()
    assert out.count("\n") == 1 and err == ""
