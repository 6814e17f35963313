"""Recorded runs as traces of VDA 5050: what messages say, and that they keep the form of the standard.

The project ships no schema. With AUTOMATON_SCHEMAS, a folder that holds `vda5050-VERSION-state.schema`
as published, messages are also checked by those.
"""

from __future__ import annotations

import io
import itertools
import json
import os
from collections import defaultdict
from fractions import Fraction
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from handmade_recordings import recorded

from automaton.commands import main
from automaton.errors import InputError
from automaton.exports.vda5050_export import VERSIONS, write_trace
from automaton.recording.contents import DecodedFrame
from automaton.recording.frames import Recording, encoded

Message = dict[str, Any]
EAST_WEST = """\
name: to-and-fro
layout: {picture: "t.....t\\n#######"}
fleet: {robots: 1, kinematics: differential, start: [[0, 0]], heading: east}
units: {tick: 0.5 s, cell: 2 m, clock: "2026-03-02 23:59:58"}
durations: {move: 4, turn: 3, pick: 5, drop: 2}
orders: {list: [{from: [0, 0], to: [6, 0], priority: 1}, {stops: [{at: [3, 0], for: 6}]}]}
strategy: {allocation: shortest-job, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 200}
"""
KEYS = {  # of messages; those of 2.1.0 have other names for the same
    *(
        "headerId",
        "timestamp",
        "version",
        "manufacturer",
        "serialNumber",
        "orderId",
        "orderUpdateId",
    ),
    *("lastNodeId", "lastNodeSequenceId", "nodeStates", "edgeStates", "driving", "actionStates"),
    *("loads", "operatingMode", "errors", "safetyState"),
}


def trace(recording: Recording, every: str | None = None, version: str = "3.0.0") -> list[Message]:
    """The messages of a recording."""
    file = io.BytesIO()
    size = write_trace(recording, file, None if every is None else Fraction(every), version)
    lines = file.getvalue().splitlines()
    assert size.messages == len(lines)
    return [json.loads(line) for line in lines]


@pytest.fixture(scope="module")
def mini() -> Recording:
    """A run of goods-mini: two robots on a ring, a station, 122 ticks of a second."""
    return recorded("goods-mini")


@pytest.fixture(scope="module")
def to_and_fro(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A robot drives 12 m with a load, and half way back for a stop; a move takes 2 s."""
    path = tmp_path_factory.mktemp("vda") / "to-and-fro.yaml"
    path.write_text(EAST_WEST)
    return recorded(str(path))


def test_there_is_a_message_for_each_robot_and_period_by_time_and_number(mini: Recording) -> None:
    messages = trace(mini)
    assert [(m["headerId"], m["serialNumber"]) for m in messages] == [
        (second, robot) for second in range(mini.ticks + 1) for robot in ("0", "1")
    ]
    assert messages[0]["timestamp"] == "1970-01-01T00:00:00.000Z"
    assert messages[-1]["timestamp"] == "1970-01-01T00:02:02.000Z"
    assert len(trace(mini, "60")) == 2 * 3


def test_trips_pods_and_the_station_of_goods_mini(mini: Recording) -> None:
    messages = trace(mini)
    robot = [m for m in messages if m["serialNumber"] == "1"]
    served = [m["headerId"] for m in robot if types(m) == ["serve"]]
    assert served == list(range(18, 38)), "begun in tick 18, and done with tick 37"
    carrying = {m["loads"][0]["loadId"] for m in robot if m["loads"]}
    assert carrying == {"2"} and robot[20]["loads"] == [{"loadId": "2", "loadType": "pod"}]
    assert {m["orderId"] for m in robot if m["loads"]} == {"1"}
    of_other = [m for m in messages if m["serialNumber"] == "0"]
    assert {m["orderId"] for m in of_other if m["loads"]} == {"0", "2"}
    assert len({a["actionId"] for m in messages for a in m["actionStates"]}) >= 8


def types(message: Message) -> list[str]:
    return [action["actionType"] for action in message["actionStates"]]


def test_nodes_and_edges_lead_on_from_where_the_robot_is(mini: Recording) -> None:
    """Numbers rise with the moves of an order, and a node keeps its number as it comes nearer."""
    numbers: dict[tuple[str, str], dict[int, str]] = defaultdict(dict)
    routes = 0
    for message in trace(mini):
        at, last = message["lastNodeId"], message["lastNodeSequenceId"]
        assert len(message["nodeStates"]) == len(message["edgeStates"])
        nodes = numbers[message["serialNumber"], message["orderId"]]
        for node, edge in zip(message["nodeStates"], message["edgeStates"], strict=True):
            assert edge["edgeId"] == f"{at}-{node['nodeId']}" and node["released"] is True
            assert (edge["sequenceId"], node["sequenceId"]) == (last + 1, last + 2)
            at, last = node["nodeId"], last + 2
            if message["orderId"]:
                assert nodes.setdefault(last, at) == at
            routes += 1
    assert routes > 450 and len(numbers) == 5, "three trips, and two robots without one"
    assert max(map(max, filter(None, numbers.values()))) == 2 * 26, "each trip drives 26 moves"


def test_a_long_move_is_shown_by_its_share(to_and_fro: Recording) -> None:
    messages = trace(to_and_fro, "0.5")
    assert messages[0]["mobileRobotPosition"] == {
        **{"x": 1.0, "y": 3.0, "theta": 0.0},  # the upper of two rows of cells of 2 m
        **{"mapId": "to-and-fro", "localized": True},
    }
    first = next(m for m in messages if m["driving"])
    begin = first["headerId"]
    ahead = messages[begin : begin + 5]
    assert [m["mobileRobotPosition"]["x"] for m in ahead] == [1.5, 2.0, 2.5, 3.0, 3.5]
    assert [m["lastNodeId"] for m in ahead] == ["0_0", "0_0", "0_0", "1_0", "1_0"]
    assert [m["lastNodeSequenceId"] for m in ahead] == [0, 0, 0, 2, 2]
    assert all(m["driving"] for m in ahead)
    assert [n["nodeId"] for n in ahead[0]["nodeStates"]] == [
        "1_0",
        "2_0",
        "3_0",
        "4_0",
        "5_0",
        "6_0",
    ]
    back = [m["mobileRobotPosition"]["theta"] for m in messages[-8:]]
    assert back == pytest.approx([3.14159265] * 8, abs=1e-6), "it faces west in the end"


def test_actions_run_while_they_last_and_the_clock_gives_the_time(to_and_fro: Recording) -> None:
    messages = trace(to_and_fro, "0.5")
    names = [types(m)[0] if types(m) else "" for m in messages]
    # An action of k ticks shows at the end of each of them, as a move does.
    assert [names.count(one) for one in ("pick", "drop", "serve")] == [5, 2, 6]
    ids = {a["actionId"] for m in messages for a in m["actionStates"]}
    assert len(ids) == 3 and all(
        a["actionStatus"] == "RUNNING" for m in messages for a in m["actionStates"]
    )
    assert [m["timestamp"] for m in messages[3:5]] == [
        "2026-03-02T23:59:59.500Z",
        "2026-03-03T00:00:00.000Z",
    ]
    assert {m["powerSupply"]["stateOfCharge"] for m in messages} == {100.0}, (
        "there are no batteries"
    )


def test_a_clock_with_an_offset_gives_utc() -> None:
    recording = recorded("goods-mini", "units.clock=2026-03-02 06:00+01:30", "stop.max_duration=1")
    assert trace(recording)[0]["timestamp"] == "2026-03-02T04:30:00.000Z"


def test_a_robot_that_breaks_down_has_a_fatal_error_and_no_place_when_it_is_towed() -> None:
    faults = "faults={list: [{at: 5, robot: 1}], tow_after: 10, repair_time: 20}"
    recording = recorded("goods-mini", faults, "stop.max_duration=60")
    messages = [m for m in trace(recording) if m["serialNumber"] == "1"]
    errors = [m["errors"][0]["errorType"] if m["errors"] else "" for m in messages]
    assert list(dict.fromkeys(errors)) == ["", "broken down", "towed"]
    assert {e["errorLevel"] for m in messages for e in m["errors"]} == {"FATAL"}
    towed = [m for m, error in zip(messages, errors, strict=True) if error == "towed"]
    assert len(towed) == 20 and errors[-1] == ""
    assert all("mobileRobotPosition" not in m and m["lastNodeId"] == "" for m in towed)


def test_a_robot_drives_up_to_the_tick_in_which_a_slow_move_ends() -> None:
    recording = recorded(
        "goods-mini", "floor.speed_limits=[{cells: {from: [0, 0], to: [9, 3]}, max_speed: 0.3 m/s}]"
    )
    for robot in "01":
        messages = [m for m in trace(recording) if m["serialNumber"] == robot]
        arrivals = [
            now["driving"]
            for before, now in itertools.pairwise(messages)
            if now["lastNodeId"] != before["lastNodeId"]
        ]
        assert len(arrivals) > 20 and all(arrivals)
        assert not all(m["driving"] for m in messages)


def test_charge_falls_as_robots_drive() -> None:
    battery = "battery={drain: {wait: 0.1, move: 0.5}, initial_charge: 50, charge_rate: 1}"
    messages = trace(recorded("goods-mini", battery, "stop.max_duration=20"))
    charges = [m["powerSupply"]["stateOfCharge"] for m in messages if m["serialNumber"] == "1"]
    assert charges[0] == 50 and charges == sorted(charges, reverse=True) and charges[-1] < 45
    assert {m["powerSupply"]["charging"] for m in messages} == {False}


@pytest.mark.parametrize("version", VERSIONS)
def test_messages_have_the_form_of_their_version(version: str, mini: Recording) -> None:
    others = {
        "3.0.0": {"mobileRobotPosition", "powerSupply", "instantActionStates"},
        "2.1.0": {"agvPosition", "batteryState"},
    }
    messages = trace(mini, version=version)
    for message in messages:
        assert set(message) == KEYS | others[version] and message["version"] == version
    stop = {"3.0.0": "activeEmergencyStop", "2.1.0": "eStop"}[version]
    assert messages[0]["safetyState"] == {stop: "NONE", "fieldViolation": False}
    folder = os.environ.get("AUTOMATON_SCHEMAS")
    if folder:
        schema = json.loads((Path(folder) / f"vda5050-{version}-state.schema").read_text())
        validator = jsonschema.validators.validator_for(schema)(schema)
        for message in messages:
            validator.validate(message)


@pytest.mark.parametrize(
    ("settings", "every", "sentence"),
    [
        ("units={tick: 1 cycle, cell: 1 m}", "1", "units.tick is '1 cycle', which is not a time"),
        ("units={tick: 1 s}", "1", "the size of a cell is unknown; set units.cell"),
        (
            "units={tick: 0.5 s, cell: 1 m}",
            "0.7",
            "0.7 s is not a whole number of ticks of 0.5 s: use 0.5 s",
        ),
        (
            "units={tick: 2 s, cell: 1 m}",
            "1",
            "1 s is not a whole number of ticks of 2 s: use 2 s",
        ),
        (
            "units={tick: 1 s, cell: 1 m, clock: '9999-12-31 23:59:59'}",
            "1",
            "outside the years 1 to 9999",
        ),
    ],
)
def test_what_has_no_trace_is_said(settings: str, every: str, sentence: str) -> None:
    plain = (
        "durations={pick: 3, drop: 3, handling: {line: 20}}",
        "orders.lines=[{pod: 1, station: P1}]",
    )
    recording = recorded("goods-mini", *plain, "stop.max_duration=3", settings)
    with pytest.raises(InputError, match=sentence):
        trace(recording, every)


def test_the_default_period_is_a_second_or_a_tick() -> None:
    for tick, periods in (("0.4 s", 2), ("3 s", 6)):
        plain = (
            "durations={pick: 3, drop: 3, handling: {line: 20}}",
            "orders.lines=[{pod: 1, station: P1}]",
        )
        recording = recorded("goods-mini", *plain, "stop.max_duration=6", f"units.tick={tick}")
        assert len(trace(recording)) == 2 * (periods + 1)


def test_a_period_longer_than_a_frame_says_the_same() -> None:
    recording = recorded("goods-mini", "orders.lines={count: 30, mean_interarrival_time: 20}")
    assert recording.ticks > 600
    often, seldom = trace(recording, "1"), trace(recording, "300")
    robots = len(recording.header["robots"]["cell"])
    for period in range(len(seldom) // robots):
        for robot in range(robots):
            one, other = seldom[period * robots + robot], often[300 * period * robots + robot]
            assert one | {"headerId": 0} == other | {"headerId": 0}


def test_the_command_writes_a_trace_and_leaves_the_recording(
    mini: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "run.rec", tmp_path / "trace.jsonl"
    path.write_bytes(encoded(mini.header, [DecodedFrame(*frame) for frame in mini.frames]))
    assert main(["export", str(path), "--vda5050", str(out), "--version", "2.1.0"]) == 0
    assert "2 robots, 246 messages of VDA 5050 2.1.0" in capsys.readouterr().out
    assert len(out.read_text().splitlines()) == 246
    cut = tmp_path / "cut.rec"
    cut.write_bytes(path.read_bytes()[:-40])
    assert main(["export", str(cut), "--vda5050", str(out), "--every", "60s"]) == 0
    for arguments, sentence in (
        (["--vda5050", str(path)], "cannot write it"),
        (
            ["--vda5050", str(out), "--version", "2.0"],
            "--version 2.0 is not supported (did you mean",
        ),
        (["--planviz", str(out), "--every", "1s"], "--every needs --vda5050"),
        (["--planviz", str(out), "--version", "1"], "--version needs --vda5050 or --lif"),
        ([], "one of the arguments --planviz --vda5050 --lif is required"),
    ):
        assert main(["export", str(path), *arguments]) == 2
        assert sentence in capsys.readouterr().err
