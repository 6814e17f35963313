"""Orders that arrive at the rates of a profile of the week."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_scenes import recorded_run
from hypothesis import given
from hypothesis import strategies as st

from automaton.commands import main
from automaton.errors import InputError
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.scenario.arrivals import BatchSize, LognormalSize, SizeRange, expected_orders
from automaton.verification.validator import validate_stored
from automaton.world.release_ticks import batch_sizes, mean_batch, profile_ticks
from automaton.world.resolve import Resolved, branched, resolve

SCENARIO = """\
name: week
layout:
  picture: |
    t....t
    .####.
    t....t
fleet: {robots: 2, kinematics: omni, start: [[1, 0], [2, 0]]}
units: {tick: 1 s, clock: "2026-03-02 06:00"}
durations: {pick: 2, drop: 2}
orders:
  generator: stations
  arrivals: {profile: week.csv}
strategy: {allocation: first-come, right_of_way: retreat}
stop: {when: delivered, max_duration: 4 h}
"""
HOUR = 3600


def rates(days: dict[int, dict[int, float]]) -> str:
    rows = (
        f"{day},{hour},{of_hour.get(hour, 0)}"
        for day, of_hour in days.items()
        for hour in range(24)
    )
    return "\n".join(["weekday,hour,orders", *rows]) + "\n"


MONDAY = rates({1: {6: 300, 7: 0, 8: 600, 9: 150}})


def week(folder: Path, *settings: str, file: str = MONDAY, text: str = SCENARIO) -> Resolved:
    (folder / "week.yaml").write_text(text, encoding="utf-8")
    (folder / "week.csv").write_text(file, encoding="utf-8")
    return resolve(folder / "week.yaml", settings)


def by_hour(resolved: Resolved, seed: int) -> list[int]:
    ticks = profile_ticks(resolved.scenario, seed)
    return np.bincount(ticks // HOUR, minlength=4).tolist()


def test_each_hour_has_the_orders_of_its_rate(tmp_path: Path) -> None:
    resolved = week(tmp_path)
    mean = np.mean([by_hour(resolved, seed) for seed in range(200)], axis=0)
    # 200 Poisson counts: the standard error of a mean of 600 is 1.7.
    assert np.abs(mean - [300, 0, 600, 150]).max() < 6
    assert mean[1] == 0


def test_a_scale_multiplies_and_batches_keep_the_number_of_orders(tmp_path: Path) -> None:
    arrivals = "orders.arrivals={profile: week.csv, scale: 1.2, batch: {uniform: {from: 1, to: 5}}}"
    resolved = week(tmp_path, arrivals)
    ticks = profile_ticks(resolved.scenario, 1)
    sizes = np.unique(ticks, return_counts=True)[1]
    assert sizes.max() > 1
    mean = np.mean([by_hour(resolved, seed) for seed in range(200)], axis=0)
    assert np.abs(mean - [360, 0, 720, 180]).max() < 12


def test_a_tuesday_without_rows_has_no_orders(tmp_path: Path) -> None:
    settings = ('units.clock="2026-03-02 08:00"', "stop.max_duration=20 h")
    ticks = profile_ticks(week(tmp_path, *settings).scenario, 3)
    assert (ticks < 2 * HOUR).all() and len(ticks) > 600
    tuesday = ('units.clock="2026-03-03 08:00"',)
    with pytest.raises(InputError, match="the profile has no orders in the 14,400 ticks"):
        week(tmp_path, *tuesday)


def test_a_week_begins_again_after_sunday(tmp_path: Path) -> None:
    file = rates({7: {23: 100}, 1: {0: 400}})
    settings = ('units.clock="2026-03-08 23:00"', "stop.max_duration=3 h")
    resolved = week(tmp_path, *settings, file=file)
    mean = np.mean([by_hour(resolved, seed) for seed in range(100)], axis=0)
    assert np.abs(mean - [100, 400, 0, 0]).max() < 10


def test_arrivals_depend_on_the_seed_alone_and_a_longer_run_begins_alike(tmp_path: Path) -> None:
    first = profile_ticks(week(tmp_path).scenario, 5)
    fleet = ("fleet.robots=1", "fleet.start=[[1, 0]]", "strategy.allocation=greedy")
    assert np.array_equal(profile_ticks(week(tmp_path, *fleet).scenario, 5), first)
    shorter = profile_ticks(week(tmp_path, "stop.max_duration=1 h").scenario, 5)
    assert np.array_equal(first[: len(shorter)], shorter) and 0 < len(shorter) < len(first)
    few = profile_ticks(week(tmp_path, "orders.count=20").scenario, 5)
    assert np.array_equal(few, first[:20])
    assert not np.array_equal(profile_ticks(week(tmp_path).scenario, 6)[:20], first[:20])


def test_many_orders_may_arrive_in_one_tick(tmp_path: Path) -> None:
    ticks = profile_ticks(week(tmp_path, "units.tick=1 min", "durations.pick=1").scenario, 1)
    assert np.bincount(ticks).max() > 4


@pytest.mark.parametrize(
    "batch",
    [
        3,
        BatchSize(uniform=SizeRange(least=0, most=2.4)),
        BatchSize(lognormal=LognormalSize(mean=3, sd=2)),
        BatchSize(empirical=(0.2, 1.5, 7)),
        BatchSize(exponential=4.0),
    ],
)
def test_batches_are_rounded_half_up_to_one_at_least_and_their_mean_is_known(batch: Any) -> None:
    sizes = batch_sizes(batch, np.arange(100_000), 2)
    assert sizes.min() >= 1
    assert abs(sizes.mean() - mean_batch(batch)) < 0.06
    if isinstance(batch, BatchSize) and batch.empirical is not None:
        assert set(sizes.tolist()) == {1, 2, 7}


@given(
    st.lists(st.floats(0, 1000), min_size=168, max_size=168),
    st.integers(0, 604_799),
    st.integers(0, 2_000_000),
)
def test_expected_orders_add_up(hourly: list[float], begin: int, seconds: int) -> None:
    whole = expected_orders(hourly, begin, seconds)
    first = expected_orders(hourly, begin, seconds // 3)
    rest = expected_orders(hourly, (begin + seconds // 3) % 604_800, seconds - seconds // 3)
    assert abs(whole - first - rest) < 1e-6 * (1 + whole)


def test_a_list_of_rates_is_the_same_as_a_file(tmp_path: Path) -> None:
    from_file = week(tmp_path, "stop.max_duration=1 h")
    again = resolve(from_file.scenario)
    assert again.scenario == from_file.scenario
    run, recorder = recorded_run(from_file)
    assert validate_stored(recorder.recording()).valid
    assert len(run.world.orders.state) == by_hour(from_file, 1)[0]


def test_a_recording_of_a_random_number_of_orders_is_read_and_verified(
    tmp_path: Path, capsys: Any
) -> None:
    week(tmp_path)
    file = str(tmp_path / "run.rec")
    settings = ["--set", "stop.max_duration=20 min", "--set", "refine=2"]
    assert main(["run", str(tmp_path / "week.yaml"), *settings, "--record", file]) in (0, 1)
    assert main(["verify", file]) == 0
    assert "no violations" in capsys.readouterr().out
    (tmp_path / "week.csv").unlink()
    assert read_recording(file).header["scenario"]["orders"]["arrivals"]["scale"] == 1.0


PODS = """\
name: pods
layout:
  picture: |
    >>>>>>>>>v
    ^#pppp#p#v
    ^########v
    ^<<<<t<<<<
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
units: {tick: 1 s, clock: "2026-03-02 06:00"}
orders: {lines: {count: 3000, per_order: 2}, arrivals: {profile: week.csv}}
strategy: {allocation: first-come, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 4 h}
"""


def test_random_lines_of_pods_follow_a_profile_order_by_order(tmp_path: Path) -> None:
    resolved = week(tmp_path, text=PODS)
    lines = Simulation(resolved, 4).world.lines
    arrived = profile_ticks(resolved.scenario, 4)
    assert np.array_equal(lines.release_tick[: 2 * len(arrived)], np.repeat(arrived, 2))
    end = resolved.scenario.stop.max_duration
    assert (lines.release_tick[2 * len(arrived) :] == end + 1).all()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("1,5,0\n", "1,24,0\n", "week.csv:7: hour must be a whole number from 0 to 23, found '24'"),
        ("1,5,0\n", "8,5,0\n", "week.csv:7: weekday must be a whole number from 1 to 7, found '8'"),
        (
            "1,6,300",
            "1,6,-3",
            "week.csv:8: orders must be a number from 0 to 1,000,000, found '-3'",
        ),
        ("1,6,300", "1,6,", "week.csv:8: orders is empty"),
        ("1,5,0\n", "1,6,0\n", "week.csv:8: weekday 1, hour 6 appears twice (first in line 7)"),
        ("1,7,0\n", "", "week.csv:2: weekday 1 has no row for hour 7; write 0 if no orders arrive"),
        ("weekday,", "day,", "week.csv:1: there is no column for weekday"),
    ],
)
def test_a_bad_profile_is_refused_with_its_line(
    tmp_path: Path, old: str, new: str, says: str
) -> None:
    assert old in MONDAY
    with pytest.raises(InputError) as error:
        week(tmp_path, file=MONDAY.replace(old, new))
    text = str(error.value).replace(f"{tmp_path}/", "")
    assert text.startswith(says) and "\n" not in text


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (', clock: "2026-03-02 06:00"', "", "week.yaml:10: orders has arrivals with a profile"),
        ("2026-03-02 06:00", "06:00", "week.yaml:8: units has the clock '06:00' without a date"),
        ("week.csv}", "week.csv, batch: 0}", "week.yaml:12: orders.arrivals.batch must be a whole"),
        (
            "week.csv}",
            "week.csv, scale: 0}",
            "week.yaml:12: orders.arrivals.scale must be a number",
        ),
        ("week.csv}", "none.csv}", "week.yaml:12: there is no file of rates 'none.csv'"),
        (
            "{profile: week.csv}",
            "{bursts: {size: 2, every: 9}, scale: 2}",
            "week.yaml:12: orders.arrivals.scale belongs to",
        ),
        (
            "{profile: week.csv}",
            "{profile: []}",
            "week.yaml:12: orders.arrivals.profile must hold at least one day",
        ),
        ("max_duration: 4 h", "max_duration: 20000 h", "week.yaml:12: the profile brings about"),
    ],
)
def test_a_scenario_that_a_profile_does_not_fit_is_refused(
    tmp_path: Path, old: str, new: str, says: str
) -> None:
    assert old in SCENARIO
    with pytest.raises(InputError) as error:
        week(tmp_path, file=rates({1: {6: 30_000}}), text=SCENARIO.replace(old, new))
    assert str(error.value).replace(f"{tmp_path}/", "").startswith(says), str(error.value)


def test_a_profile_needs_a_tick_that_is_a_time(tmp_path: Path) -> None:
    text = SCENARIO.replace("tick: 1 s", "tick: 1 cycle").replace("4 h", "14400")
    with pytest.raises(InputError, match=r"orders per hour, but units\.tick is '1 cycle'"):
        week(tmp_path, text=text)


def test_check_says_how_many_orders_arrive(tmp_path: Path, capsys: Any) -> None:
    week(tmp_path)
    assert main(["check", str(tmp_path / "week.yaml")]) == 0
    assert "about 1,050 orders arrive in 14,400 ticks (4 h)" in capsys.readouterr().out


def test_a_branch_with_other_numbers_of_orders_is_refused(tmp_path: Path) -> None:
    run = Simulation(week(tmp_path))
    with pytest.raises(InputError, match="a branch keeps the"):
        run.continue_with(branched(run.resolved, ("stop.max_duration=2 h",)))
