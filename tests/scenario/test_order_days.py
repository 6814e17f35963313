"""Several files of orders, of which the seed of a run draws one."""

from __future__ import annotations

import json
import os
import pickle
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from drawn_scenes import recorded_run

from automaton.commands import main
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.scenario import table_reader
from automaton.scenario.order_lines import line_column, listed_lines
from automaton.scenario.reading import named_files
from automaton.studies.sweeps.run_keys import fingerprint
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve
from automaton.world.resolved import drawn_day

PODS = """\
name: days
layout:
  picture: |
    >>>>>>>>>v
    ^#pppp#p#v
    ^########v
    ^<<<<t<<<<
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
units: {tick: 1 s, clock: "2026-03-02 06:00"}
orders: {lines: {file: days/*.csv}}
strategy: {allocation: first-come, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 4 h}
"""
DAYS = {
    "mon.csv": "released,pod\n2026-03-02 06:00,1\n2026-03-02 06:01,2\n",
    "tue.csv": "released,pod\n2026-03-03 06:00:10,3\n",
    "wed.csv": "released,pod\n2026-03-11 06:00:20,4\n2026-03-12 00:10,5\n",
}
TRANSPORTS = """\
name: days
layout:
  picture: |
    t....t
    .####.
    t....t
fleet: {robots: 2, kinematics: omni, start: [[1, 0], [2, 0]]}
units: {tick: 1 s, clock: "06:00"}
orders: {transports: {file: "day?.csv"}}
strategy: {allocation: first-come, right_of_way: retreat}
stop: {when: delivered, max_duration: 1 h}
"""


def days(folder: Path, *settings: str, seed: int = 1, text: str = PODS) -> Resolved:
    (folder / "days").mkdir(exist_ok=True)
    for name, content in DAYS.items():
        if not (folder / "days" / name).exists():
            (folder / "days" / name).write_text(content, encoding="utf-8")
    (folder / "days.yaml").write_text(text, encoding="utf-8")
    return resolve(folder / "days.yaml", settings, seed)


def releases(resolved: Resolved) -> list[int]:
    ticks: list[int] = line_column(listed_lines(resolved.scenario.orders), "release").tolist()
    return ticks


OF_DAY = {"mon.csv": [0, 60], "tue.csv": [10], "wed.csv": [20, 65_400]}


def test_each_seed_draws_a_file_and_all_are_equally_likely(tmp_path: Path) -> None:
    resolved = days(tmp_path)
    for seed in range(12):
        drawn = days(tmp_path, seed=seed)
        assert releases(drawn) == OF_DAY[drawn.days[drawn.day].name]
        assert releases(resolved.of_seed(seed)) == releases(drawn)
        assert resolved.of_seed(seed).of_seed(1).scenario == resolved.scenario
    often = Counter(drawn_day(seed, 3) for seed in range(3000))
    assert min(often.values()) > 900


def test_times_count_from_the_own_midnight_of_a_file(tmp_path: Path) -> None:
    resolved = days(tmp_path, "units.clock=05:59")  # without a date
    assert releases(resolved.of_seed(1)) == [
        60 + tick for tick in OF_DAY[resolved.days[resolved.day].name]
    ]
    offset = {name: text.replace(":00,", ":00+02:00,") for name, text in DAYS.items()}
    (tmp_path / "days" / "mon.csv").write_text(offset["mon.csv"].replace("06:01,", "06:01+02:00,"))
    with pytest.raises(InputError, match=r"has an offset from UTC, but units\.clock has none"):
        days(tmp_path)


def test_a_file_alone_keeps_its_dates_and_is_not_drawn(tmp_path: Path) -> None:
    fixed = days(tmp_path, "orders.lines.file=days/mon.csv", seed=7)
    assert releases(fixed) == [0, 60] and fixed.day_in_words == ""
    assert releases(fixed.of_seed(3)) == [0, 60]
    tuesday = days(tmp_path, "orders.lines.file=days/tue.csv")
    assert releases(tuesday) == [86_410], "a day after the date of units.clock"
    one = days(tmp_path, "orders.lines.file=days/tu[e].csv")
    assert releases(one) == [10], "a pattern that one file matches"


def test_a_run_simulates_the_file_of_its_seed_refined_pickled_and_recorded(tmp_path: Path) -> None:
    settings = ("stop.max_duration=10 min", "refine=2")
    resolved = days(tmp_path, *settings)
    seed = next(seed for seed in range(9) if drawn_day(seed, 3) != resolved.day)
    other = pickle.loads(pickle.dumps(resolved)).of_seed(seed)
    assert other.unrefined.day == other.day != resolved.day
    run, recorder = recorded_run(resolved, seed)
    alone = Simulation(days(tmp_path, *settings, seed=seed))
    alone.run()
    assert run.digest == alone.digest
    assert validate_stored(recorder.recording()).valid


def test_keys_of_sweeps_depend_on_the_content_of_all_files(tmp_path: Path) -> None:
    first = days(tmp_path)
    assert fingerprint(first) == fingerprint(days(tmp_path, seed=2))
    assert fingerprint(first) != fingerprint(days(tmp_path, "orders.lines.file=days/mon.csv"))
    names = {Path(path).name for path, _ in first.files}
    assert names == set(DAYS)
    assert {path.name for path in named_files(tmp_path / "days.yaml")} >= set(DAYS)
    undrawn = next(day.name for k, day in enumerate(first.days) if k != first.day)
    (tmp_path / "days" / undrawn).write_text("released,pod\n0,1\n")
    assert fingerprint(first) != fingerprint(days(tmp_path))


def test_transports_are_drawn_as_well_and_all_files_are_checked(tmp_path: Path) -> None:
    rows = "released,from_x,from_y,to_x,to_y\n06:00,0,0,5,0\n"
    for name in ("day1.csv", "day2.csv"):
        (tmp_path / name).write_text(rows)
    first = days(tmp_path, text=TRANSPORTS)
    (tmp_path / first.days[1 - first.day].name).write_text(rows + "06:02,0,0,5,2\n")
    again = days(tmp_path, text=TRANSPORTS)
    many = {len(again.of_seed(seed).scenario.orders.listed or ()) for seed in range(9)}
    assert many == {1, 2} and not again.has_same_orders
    alone = days(tmp_path, "orders.transports.file=day1.csv", text=TRANSPORTS)
    assert alone.has_same_orders
    (tmp_path / first.days[1 - first.day].name).write_text(rows + "06:02,0,0,1,1\n")
    with pytest.raises(InputError) as error:
        days(tmp_path, text=TRANSPORTS)
    assert f"{first.days[1 - first.day].name}:3: " in str(error.value)


def test_a_pattern_without_a_file_is_one_sentence(tmp_path: Path, capsys: Any) -> None:
    days(tmp_path)
    file, setting = str(tmp_path / "days.yaml"), "orders.lines.file=days/*.txt"
    assert main(["check", file, "--set", setting]) == 2
    assert "no file of lines matches 'days/*.txt'" in capsys.readouterr().err


def test_check_and_run_say_which_file_was_drawn(tmp_path: Path, capsys: Any) -> None:
    resolved = days(tmp_path)
    name, file = resolved.days[resolved.day].name, str(tmp_path / "days.yaml")
    assert main(["check", file]) == 0
    assert f"seed 1: {name}, 1 of 3 files of days/*.csv" in capsys.readouterr().out
    assert main(["run", file, "--until", "1"]) in (0, 1)
    assert f"orders of {name}, 1 of 3 files of days/*.csv" in capsys.readouterr().out
    assert main(["run", file, "--until", "1", "--json"]) in (0, 1)
    assert json.loads(capsys.readouterr().out)["order_file"] == name


def test_a_file_is_read_again_only_if_its_content_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []
    by_csv = table_reader.read_csv_columns

    def counted(path: Path, *more: Any) -> Any:
        read.append(path.name)
        return by_csv(path, *more)

    monkeypatch.setattr(table_reader, "read_csv_columns", counted)
    first = days(tmp_path)
    again = resolve(tmp_path / "days.yaml", ["durations.pick=3"], 1)
    assert sorted(read) == sorted(DAYS) and again.days[0].orders == first.days[0].orders
    resolve(tmp_path / "days.yaml", ["units.tick=2 s"])  # other ticks from the same texts
    assert len(read) == 2 * len(DAYS)
    stamp = (tmp_path / "days/mon.csv").stat()
    (tmp_path / "days/mon.csv").write_text(DAYS["mon.csv"].replace("06:01,2", "06:01,3"))
    os.utime(tmp_path / "days/mon.csv", ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    changed = resolve(tmp_path / "days.yaml")
    assert read[2 * len(DAYS) :] == ["mon.csv"]
    assert changed.days[0].orders != first.days[0].orders
