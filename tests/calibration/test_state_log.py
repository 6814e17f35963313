"""Logs of robots: what our own export says comes back exactly, and what is wrong in a log is counted."""

from __future__ import annotations

import datetime
import gzip
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from handmade_recordings import recorded

from automaton.calibration.log_on_floor import placed
from automaton.calibration.state_log import StateLog, read_log
from automaton.errors import InputError
from automaton.exports.vda5050_export import VERSIONS, write_trace
from automaton.recording.frames import Recording, floor_plan_of
from automaton.scenario.refinement import refined_data

Messages = list[dict[str, Any]]
SITE = "units={tick: 0.5 s, cell: 1 m, origin: [-7.25, 3], rotation: 90}"
BATTERY = "battery={drain: {wait: 0.1, move: 0.5}, initial_charge: 50, charge_rate: 1}"
FAULTS = "faults={list: [{at: 25, robot: 1}], tow_after: 10, repair_time: 20}"


@pytest.fixture(scope="module")
def run() -> Recording:
    """Pods, batteries, a robot that breaks down and is towed, and moves of several ticks."""
    return recorded("goods-mini", SITE, BATTERY, FAULTS, "durations.move=3", "stop.max_duration=90")


def messages_of(run: Recording, **options: Any) -> Messages:
    file = io.BytesIO()
    write_trace(run, file, **options)
    return [json.loads(line) for line in file.getvalue().splitlines()]


def log_of(messages: Messages | list[str], tmp_path: Path) -> StateLog:
    path = tmp_path / "log.jsonl"
    lines = [line if isinstance(line, str) else json.dumps(line) for line in messages]
    path.write_text("".join(f"{line}\n" for line in lines))
    return read_log([path])


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("on_events", [False, True])
def test_an_export_comes_back_exactly(
    version: str, on_events: bool, run: Recording, tmp_path: Path
) -> None:
    messages = messages_of(run, version=version, on_events=on_events)
    log = log_of(messages, tmp_path)
    floor_plan, units = (
        floor_plan_of(run.header["floor"]),
        refined_data(run.header["scenario"]).units,
    )
    place = placed(log, floor_plan, units, snap=0.001)
    rows = sorted(messages, key=lambda m: (m["serialNumber"], m["timestamp"]))
    assert log.counts.messages == len(rows) and log.robots == ("0", "1")
    assert log.counts.sentences() == [f"{len(rows):,} messages of VDA 5050 {version}"]
    s, is_new = log.samples, version == "3.0.0"
    loads, towed = set(), 0
    for row, message in enumerate(rows):
        at = message.get("mobileRobotPosition" if is_new else "agvPosition")
        towed += at is None
        if at is None:
            assert np.isnan(s.x[row]) and place.cell[row] == -1
        else:
            assert (s.x[row], s.y[row], s.theta[row]) == (at["x"], at["y"], at["theta"])
            x, y = map(int, message["lastNodeId"].split("_"))
            cell = place.to_cell[row] if place.share[row] > 0.999 else place.cell[row]
            assert cell == floor_plan.cell(x, y)
        load = message["loads"][0]["loadId"] if message["loads"] else None
        assert s.load[row] == 0 if load is None else log.loads[s.load[row] - 1] == load
        loads.add(load)
        power = message["powerSupply" if is_new else "batteryState"]
        assert s.charge[row] == power["stateOfCharge" if is_new else "batteryCharge"]
        assert bool(s.driving[row]) == message["driving"]
        assert s.down[row] == bool(message["errors"])
        assert (s.action[row] > 0) == bool(message["actionStates"])
    assert len(loads) > 1 and s.down.any() and towed and (place.share > 0).any()


def test_an_envelope_a_packed_file_and_csv_say_the_same(run: Recording, tmp_path: Path) -> None:
    messages = messages_of(run)
    bare = log_of(messages, tmp_path)
    packed = tmp_path / "log.gz"
    wrapped = [
        {"topic": f"uagv/v3/a/{m['serialNumber']}/state", "payload": m if n % 2 else json.dumps(m)}
        for n, m in enumerate(messages)
    ]
    other = {"topic": "uagv/v3/a/0/connection", "payload": {"connectionState": "ONLINE"}}
    packed.write_bytes(gzip.compress("\n".join(map(json.dumps, [*wrapped, other])).encode()))
    log = read_log([packed])
    assert log.counts.skipped == {"other topic": 1}
    assert all(
        np.array_equal(*pair, equal_nan=True)
        for pair in zip(log.samples, bare.samples, strict=True)
    )
    table = tmp_path / "log.csv"
    rows = ["agv;time;x;y;load;state"]
    for m in messages:
        at = m.get("mobileRobotPosition", {"x": "", "y": ""})
        load = m["loads"][0]["loadId"] if m["loads"] else ""
        state = m["actionStates"][0]["actionType"] if m["actionStates"] else ""
        state = "Error" if m["errors"] else state
        x, y = (str(at[name]).replace(".", ",") for name in "xy")
        rows.append(f"{m['serialNumber']};{m['timestamp']};{x};{y};{load};{state}")
    table.write_text("\n".join(rows))
    csv = read_log([table], {"robot": "agv"})
    for name in ("robot", "time", "x", "y", "load", "down"):
        assert np.array_equal(*(getattr(one.samples, name) for one in (csv, bare)), equal_nan=True)
    assert [csv.actions[a - 1] for a in csv.samples.action if a] == [
        bare.actions[a - 1]
        for a, down in zip(bare.samples.action, bare.samples.down, strict=True)
        if a and not down
    ]
    assert (csv.samples.charging[csv.samples.action > 0] == 0).all()


def state(second: float, number: int | None = None, robot: str = "7") -> dict[str, Any]:
    """A message at a second of a minute."""
    header = {} if number is None else {"headerId": number}
    stamp = f"2026-03-02T06:00:{second:06.3f}Z"
    return {**header, "timestamp": stamp, "serialNumber": robot, "driving": False, "version": "2.1"}


def test_what_is_wrong_in_a_log_is_counted(tmp_path: Path) -> None:
    lines = [
        state(1, 1), state(2, 2), state(2, 2), state(5, 5), state(4, 4),
        state(2.5, 6), state(3.5, 7), state(50, 8), state(8, 0, "9"),
        '{"headerId": 3}', "no JSON", '{"headerId": 9, "time',
    ]  # fmt: skip
    log = log_of(lines, tmp_path)
    counts = log.counts
    assert (counts.messages, counts.lines, counts.doubled, counts.unordered) == (8, 12, 1, 1)
    assert (counts.missing, counts.clock_steps, counts.gaps) == (1, 1, 1)
    assert counts.skipped == {"other message": 1, "unreadable": 2}
    stamps = (log.samples.time[log.usable] - log.samples.time[0]) / 1000
    assert stamps.tolist() == [0], "the others are beside a clock step, a gap or another robot"
    assert counts.sentences() == [
        "8 messages of VDA 5050 2.1",
        "3 lines skipped: other message 1, unreadable 2",
        "doubled 1, unordered 1, missing 1, clock stepped back 1, pauses above 30 s 1",
    ]


def test_days_may_come_in_any_order_and_number_their_orders_anew(
    run: Recording, tmp_path: Path
) -> None:
    files = [tmp_path / "monday.jsonl", tmp_path / "tuesday.jsonl"]
    zones = datetime.UTC, datetime.timezone(datetime.timedelta(hours=1))
    for number, (path, zone) in enumerate(zip(files, zones, strict=True)):
        lines = []
        for one in messages_of(run):
            moment = datetime.datetime.fromisoformat(one["timestamp"]).astimezone(zone)
            moment += datetime.timedelta(days=number)
            lines.append(json.dumps({**one, "timestamp": moment.isoformat()}))
        path.write_text("\n".join(lines))
    logs = [read_log(paths) for paths in (files, files[::-1])]
    assert all(
        np.array_equal(*pair, equal_nan=True)
        for pair in zip(*(one.samples for one in logs), strict=True)
    )
    log, single = logs[1], read_log(files[:1])
    assert log.counts.unordered == 0 and len(log.orders) == 2 * len(single.orders)
    first = log.samples.time[: len(single.samples.time) // 2]
    assert np.array_equal(first + 86_400_000, log.samples.time[len(first) : 2 * len(first)])
    assert log.counts.gaps == 2 and not log.usable[len(first) - 1]
    assert "no message of any robot for 24.0 h in all" in log.counts.sentences()


def test_a_line_that_is_cut_short_is_the_last(tmp_path: Path) -> None:
    path = tmp_path / "cut.jsonl"
    path.write_text(json.dumps(state(1)) + "\n" + json.dumps(state(2))[:-20])
    assert read_log([path]).counts.skipped == {"line cut short": 1}


@pytest.mark.parametrize(
    ("text", "columns", "sentence"),
    [
        ("", {}, "is empty"),
        ("name: site\n", {}, ":1: is not a log: neither JSON objects nor a CSV file"),
        ('{"headerId": 1}\n', {}, "has no state message; line 1 is skipped: other message"),
        (
            "robot,time,x\n",
            {},
            "there is no column 'y'; use --column y=NAME; the columns are robot",
        ),
        ("robto,time,x,y\n", {}, "there is no column 'robot' (did you mean 'robto'?)"),
        (
            "agv,time,x,y\n",
            {"robt": "agv"},
            "--column robt=... is not possible (did you mean 'robot'",
        ),
        (
            "robot,time,x,y\n1,now,2,3\n",
            {},
            "line 2 is skipped: time, position or charge unreadable",
        ),
        ("\0\1\2" * 50, {}, ":1: is not a log: neither JSON objects nor a CSV file"),
    ],
)
def test_a_file_that_is_no_log_is_refused(
    text: str, columns: dict[str, str], sentence: str, tmp_path: Path
) -> None:
    path = tmp_path / "log"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_log([path], columns)
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("change", "fit"),
    [
        (lambda x, y: (1000 * x, 1000 * y), "they are millimetres"),
        (lambda x, y: (x + 40, y - 20), "units.origin is [32.75, -17]"),
        (
            lambda x, y: (9 * np.sin(900 * x + y), 4 * np.sin(700 * y + x)),
            "no unit, origin and quarter turn fits them",
        ),
    ],
)
def test_positions_off_the_floor_are_refused_with_the_nearest_fit(
    change: Any, fit: str, run: Recording, tmp_path: Path
) -> None:
    log = log_of(messages_of(run), tmp_path)
    x, y = change(log.samples.x, log.samples.y)
    floor_plan, units = (
        floor_plan_of(run.header["floor"]),
        refined_data(run.header["scenario"]).units,
    )
    with pytest.raises(InputError, match="of the positions are not on the floor") as error:
        placed(log._replace(samples=log.samples._replace(x=x, y=y)), floor_plan, units)
    assert fit in error.value.message


def test_two_days_with_one_clock_are_no_single_log(run: Recording, tmp_path: Path) -> None:
    messages = messages_of(run)
    places = [one.get("mobileRobotPosition") for one in messages]
    other = [
        one | {"mobileRobotPosition": at} for one, at in zip(messages, places[::-1], strict=True)
    ]
    half = messages[: len(messages) // 2]
    for name, lines in (("monday", messages), ("tuesday", other), ("half", half)):
        text = "".join(f"{json.dumps(one)}\n" for one in lines)
        (tmp_path / f"{name}.jsonl").write_text(text)
    monday, tuesday, part = (tmp_path / f"{name}.jsonl" for name in ("monday", "tuesday", "half"))
    with pytest.raises(
        InputError, match=r"tuesday.jsonl: has robot \d elsewhere than .*monday.jsonl"
    ):
        read_log([monday, tuesday])
    assert read_log([monday, part]).counts.doubled == len(half), "a copy agrees"
