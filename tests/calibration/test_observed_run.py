"""Logs of real robots as recordings: they show what the messages say, and what no rule allows."""

from __future__ import annotations

import datetime
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from handmade_recordings import recorded

from automaton.commands import main
from automaton.engine.state import ACTION_MOVE, ACTION_PICK, ACTION_SERVE
from automaton.exports.vda5050_export import write_trace
from automaton.history.playback import Playback
from automaton.recording.contents import DecodedFrame
from automaton.recording.frames import Recording, encoded
from automaton.recording.recording_reader import read_recording
from automaton.runs.metrics import executed_ticks
from tui.playback.playback_state import RecordedCells, TimeComparison

SITE = (
    "units={tick: 0.5 s, cell: 1 m, origin: [-7.25, 3], rotation: 90}",
    "battery={drain: {wait: 0.1, move: 0.5}, initial_charge: 50, charge_rate: 1}",
    "faults={list: [{at: 25, robot: 1}], tow_after: 10, repair_time: 20}",
    "durations.move=3",
    "stop.max_duration=90",
)


@pytest.fixture(scope="module")
def run() -> Recording:
    """Pods, batteries, a robot that breaks down and is towed, and moves of several ticks."""
    return recorded("goods-mini", *SITE)


def observed(lines: list[bytes] | list[str], folder: Path, *settings: str) -> Path:
    """The observed run of a log."""
    log, out = folder / "log.jsonl", folder / "real.rec"
    texts = [line.decode() if isinstance(line, bytes) else line for line in lines]
    log.write_text("".join(f"{text}\n" for text in texts))
    sets = [word for setting in settings for word in ("--set", setting)]
    scenario = "goods-mini" if not settings or "layout" not in settings[0] else settings[0]
    assert main(["log", str(log), "--floor", scenario, "--out", str(out), *sets]) == 0
    return out


@pytest.fixture(scope="module")
def real(run: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The observed run of its export, one message a second."""
    folder = tmp_path_factory.mktemp("observed")
    with (folder / "trace").open("wb") as file:
        write_trace(run, file)
    lines = (folder / "trace").read_bytes().splitlines()
    return observed(lines, folder, *SITE[:2], "durations.move=3")


def state_of(playback: Playback, tick: int) -> dict[str, list[Any]]:
    """What messages say about the robots at a tick."""
    playback.go_to(tick)
    robots: Any = playback.simulation.world.robots
    at = robots.at_index
    off = robots.status[at] >= 3
    cell = np.where((robots.cell[at] == -1) & ~off, robots.bay[at], robots.cell[at])
    return {
        "cell": cell.tolist(),
        "claim": robots.claim[at].tolist(),
        "heading": np.where(cell == -1, 0, robots.heading[at]).tolist(),
        "loaded": (robots.load[at] >= 0).tolist(),
        "charge": np.round(robots.charge[at] / 10_000_000, 3).tolist(),
        "down": off.tolist(),
    }


def test_an_observed_run_shows_what_the_messages_say(run: Recording, real: Path) -> None:
    seen = read_recording(real)
    assert seen.is_observed and seen.complete and seen.ticks == run.ticks
    ours, theirs = (Playback(one.header, one.stored()) for one in (seen, run))
    states = [(state_of(ours, tick), state_of(theirs, tick)) for tick in range(0, run.ticks + 1, 2)]
    claims = [mine.pop("claim") == other.pop("claim") for mine, other in states]
    for mine, other in states:
        assert mine == other
    assert claims.count(False) == 1, "a message finds the robot on its way out of its repair"
    assert any(sum(state["down"]) for state, _ in states)
    mine, other = (executed_ticks(one.simulation.world).sum((0, 2)) for one in (ours, theirs))
    begun = theirs.simulation.world.tally.operations.sum((0, 2))
    for action in (ACTION_MOVE, ACTION_PICK, ACTION_SERVE):
        # Of each operation the time between two messages may be missing.
        assert abs(int(mine[action]) - int(other[action])) <= 2 * begun[action] > 0
    assert np.array_equal(*(one.simulation.observation.flow for one in (ours, theirs)))


def test_it_can_be_shown_backwards(real: Path) -> None:
    seen = read_recording(real)
    playback = Playback(seen.header, seen.stored())
    there = {tick: state_of(playback, tick) for tick in (20, 50, 80)}
    for tick in (50, 20, 80):
        assert state_of(playback, tick) == there[tick]


def test_commands_that_need_decisions_refuse_it(
    real: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for arguments, what in (
        (["branch", str(real), "--at", "10"], "a branch"),
        (["export", str(real), "--vda5050", str(tmp_path / "x")], "an export"),
        (["export", str(real), "--planviz", str(tmp_path / "x")], "an export"),
    ):
        assert main(arguments) == 2
        sentence = f"{what} needs the decisions of a simulated run; this run was observed"
        assert sentence in capsys.readouterr().err
    assert not (tmp_path / "x").exists()
    assert main(["explain", str(real), "--robot", "1", "--at", "30"]) == 0
    assert "robot 1 has broken down" in capsys.readouterr().out
    assert main(["verify", str(real)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "observed: rules not applicable: goods-mini (observed), 2 robots" in said
    assert "no two robots in a cell for one, no swaps" in said


def test_both_runs_are_shown_side_by_side_with_the_difference_of_their_times(
    run: Recording, real: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site, out = tmp_path / "site.rec", tmp_path / "both.txt"
    site.write_bytes(encoded(run.header, [DecodedFrame(*frame) for frame in run.frames]))
    layer = ["--layer", "difference", "--at", "60"]
    beside = ["cast", str(real), "--beside", str(site), "--picture", str(out)]
    assert main([*beside, *layer]) == 0
    assert "k more time than in the simulation" in out.read_text()
    assert main(["cast", str(real), "--picture", str(out), *layer]) == 2
    assert "compares two recordings" in capsys.readouterr().err


def test_the_layer_counts_the_time_of_robots_in_cells(run: Recording, real: Path) -> None:
    seen = read_recording(real)
    ours, theirs = (RecordedCells(one.header, one.stored(), 0.5) for one in (run, seen))
    first, last = ours.until(20).copy(), ours.until(60).copy()
    assert (first <= last).all() and np.array_equal(ours.until(20), first)
    playback, total = Playback(run.header, run.stored()), 0
    for tick in range(1, 61):
        playback.go_to(tick)
        total += int((playback.simulation.world.robots.cell >= 0).sum())
    assert last.sum() == 0.5 * total
    real_less = TimeComparison(ours, theirs).time_difference(60)
    assert np.array_equal(real_less, TimeComparison(theirs, ours).time_difference(60))
    assert abs(int(real_less.sum())) <= 4, "the real robots are in the same cells"


CROSSING = """\
name: crossing
layout:
  picture: |
    #t##t##t#
    .........
    .##.##.#.
    .........
    #t##t##t#
fleet: {robots: 4, kinematics: differential}
units: {tick: 0.5 s, cell: 1 m, clock: "2026-03-02 06:00"}
durations: {move: 1 m/s, turn: 1 s, pick: 4 s, drop: 3 s}
orders: {generator: stations, count: 900, mean_interarrival_time: 20}
strategy: {allocation: first-come, right_of_way: pibt}
stop: {when: never, max_duration: 500}
"""


ON_ORDERS = ("driving_loaded", "driving_empty", "turning", "handling")


def test_the_time_of_the_robots_is_split_as_in_the_run_whatever_the_scenario_plans(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site, rec, out = (str(tmp_path / name) for name in ("site.yaml", "day.rec", "real.rec"))
    Path(site).write_text(CROSSING)
    truth = "durations={move: {empty: 3, loaded: 4}, turn: 5, pick: 9, drop: 6}"
    assert main(["run", site, "--set", truth, "--record", rec, "--json"]) == 0
    spent = json.loads(capsys.readouterr().out)["robot_time"]
    for option in (["--every", "0.5s"], ["--on-events"]):
        log = str(tmp_path / "log.jsonl")
        assert main(["export", rec, "--vda5050", log, *option]) == 0
        capsys.readouterr()
        assert main(["log", log, "--floor", site, "--out", out, "--json"]) == 0
        seen = json.loads(capsys.readouterr().out)["robot_time"]
        assert "lost_standing" in seen and "lost_refused" not in seen
        shares = [
            {
                "on_orders": sum(of[name] for name in ON_ORDERS),
                "lost": sum(ticks for name, ticks in of.items() if name.startswith("lost_")),
                "aside": of["driving_aside"],
                "idle": of["idle"],
            }
            for of in (spent, seen)
        ]
        assert shares[0]["lost"] > 200 and shares[0]["on_orders"] > 1000
        for name, ticks in shares[0].items():
            assert abs(ticks - shares[1][name]) <= 0.02 * 4 * 500, (name, shares)


def message(second: float, robot: str, x: float, y: float, theta: float = 0.0, **more: Any) -> str:
    """A message at a second; cell (i, j) of a floor of three rows is at x i + 0.5, y 2.5 - j."""
    moment = datetime.datetime(2026, 3, 2, 6) + datetime.timedelta(seconds=second)
    place = {"x": x, "y": y, "theta": theta, "positionInitialized": True}
    stamp = f"{moment.isoformat(timespec='milliseconds')}Z"
    base = {"timestamp": stamp, "serialNumber": robot, "driving": False, "agvPosition": place}
    return json.dumps(base | more)


def test_two_robots_in_a_cell_and_swaps_are_listed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = []
    for second in range(12):
        lines.append(message(second, "agv-10", 3.5 if second < 4 else 2.5, 0.5))
        lines.append(
            message(second, "agv-9", 2.5 if second < 4 else 3.5 if second < 8 else 2.5, 0.5)
        )
    out = observed(
        lines, tmp_path, "units={tick: 1 s, cell: 1 m}", "orders.lines=[{pod: 1, station: P1}]"
    )
    said = " ".join(capsys.readouterr().out.split())
    assert "observed run, 2 robots, 11 ticks" in said
    assert read_recording(out).header["observed"]["robots"] == ("agv-9", "agv-10")
    assert main(["verify", str(out)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "two robots that swapped their cells: once, first in tick 4: robots 0 and 1" in said
    assert "two robots in a cell for one: once, first in tick 10: robots 0 and 1" in said


def test_the_log_says_that_a_robot_stands_not_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = []
    for second in range(12):
        behind = 1.5 if second < 8 else 2.5
        lines.append(message(second, "0", behind, 0.5, orderId="A"))
        lines.append(message(second, "1", 2.5 if second < 4 else 4.5, 0.5))
    units = "units={tick: 1 s, cell: 1 m}"
    out = observed(lines, tmp_path, units, "orders.lines=[{pod: 1, station: P1}]")
    capsys.readouterr()
    for tick, cause in (("3", "robot 1 holds (2, 3) and is idle"), ("6", "and no robot is ahead")):
        assert main(["explain", str(out), "--robot", "0", "--at", tick]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert cause in said and "right of way" not in said and "rule: occupancy" not in said
    assert main(["explain", str(out), "--robot", "0", "--at", "6", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["lost"]["standing"] > 0
    assert main(["replay", str(out), "--describe"]) == 0
    assert "right of way" not in capsys.readouterr().out


def test_each_carry_of_a_load_without_an_order_is_an_order(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    carries = [second in (2, 3, 4, 7, 8) for second in range(12)]
    lines = [
        message(second, "1", 2.5, 0.5, loads=[{"loadId": "box"}] if carries[second] else [])
        for second in range(12)
    ]
    observed(
        lines, tmp_path, "units={tick: 1 s, cell: 1 m}", "orders.lines=[{pod: 1, station: P1}]"
    )
    assert "2 of 2 orders" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        ([message(0, str(robot), 2.5, 0.5) for robot in range(3)], "but the scenario only 2; set"),
        (
            [message(0, "1", 2.5, 0.5), message(9e8, "1", 2.5, 0.5)],
            "more than an observed run holds",
        ),
        ([message(0, "1", 250, 0.5)], "of the positions are not on the floor"),
        (
            [message(0, "1", 2.5, 0.5, theta=-90)],
            "has theta up to 90; theta is in radians, so convert degrees",
        ),
    ],
)
def test_a_log_that_does_not_fit_leaves_no_file(
    lines: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = tmp_path / "log.jsonl", tmp_path / "real.rec"
    log.write_text("\n".join(lines))
    floor = ["--floor", "goods-mini", "--set", "units.cell=1 m"]
    assert main(["log", str(log), *floor, "--out", str(out)]) == 2
    assert sentence in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["log.jsonl"]
