"""Jams are told of when they happen, `check --trial` finds them, `check` sees what can never move."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from automaton.commands import main

RING = """name: ring
layout:
  picture: |
    >>v
    ^<<
fleet: {robots: 6, kinematics: omni}
durations: {move: 2}
orders: {generator: tours, count: 20000}
world: {following: none}
strategy: {allocation: first-come, right_of_way: pibt}
stop: {when: never, max_duration: 800}
"""
JAM = (
    "tick 512: jam: 6 robots between [0, 0] and [2, 1] have finished nothing for the last 500 ticks"
)
STANDS = "stands still: 6 robots fill the 6 cells around [0, 0]"


@pytest.fixture
def ring(tmp_path: Path) -> str:
    path = tmp_path / "ring.yaml"
    path.write_text(RING)
    return str(path)


def test_a_run_tells_of_a_jam_once_and_when_it_happens(
    ring: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", ring, "--until", "520"]) == 0
    assert capsys.readouterr().err.count(f"ring: {JAM}\n") == 1
    assert main(["run", ring]) == 0
    assert capsys.readouterr().err.count("jam: ") == 1


def test_a_trial_finds_a_jam_and_says_so_in_json(
    ring: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", ring, "--trial"]) == 1
    out, err = capsys.readouterr()
    assert f"  trial of 800 ticks: {JAM}" in out.replace("\n    ", " ")
    assert STANDS in err and "at most 5 robots can move there at all" in err
    assert main(["check", ring, "--trial", "--json"]) == 1
    report, *others = json.loads(capsys.readouterr().out)
    assert others == [] and report["name"] == "ring" and report["error"] is None
    assert report["trial"] == {"passed": False, "ticks": 800, "patience": 500, "findings": [JAM]}


def test_with_room_a_trial_passes(ring: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", ring, "--trial", "--set", "fleet.robots=4"]) == 0
    out, err = capsys.readouterr()
    assert "trial of 800 ticks: ok, every robot with work made progress" in out
    assert "stands still" not in err


@pytest.mark.parametrize(
    ("following", "move", "stands"),
    [("none", 1, True), ("handover", 2, True), ("handover", 1, False), ("convoy", 2, False)],
)
def test_check_knows_where_a_full_ring_stands(
    ring: str, following: str, move: int, stands: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    rule = ["--set", f"world.following={following}", "--set", f"durations.move={move}"]
    assert main(["check", ring, *rule]) == 0
    assert (STANDS in capsys.readouterr().err) == stands


def test_robots_that_leave_the_floor_make_room(
    ring: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", ring, "--set", "fleet.when_idle=leave"]) == 0
    assert "stands still" not in capsys.readouterr().err


def test_a_study_has_no_trial(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "tabletop-fleet", "--trial"]) == 2
    said = "--trial is for scenarios only; this is a study"
    assert said in capsys.readouterr().err
