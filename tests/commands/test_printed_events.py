"""`run --events` without a folder: the events of a run, line by line."""

from __future__ import annotations

import json

import pytest

from automaton.commands import main


def test_the_ticks_of_goods_mini_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "goods-mini", "--events"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:12] == [
        "tick       1  order taken       robot 0  trip 0",
        "tick       1  picked up         robot 0  trip 0  at (2, 1)",
        "tick       1  order taken       robot 1  trip 1",
        "tick       1  picked up         robot 1  trip 1  at (3, 1)",
        "tick      37  visited           robot 1  trip 1  at (5, 3)",
        "tick      50  delivered         robot 1  trip 1  at (3, 1)",
        "tick      58  visited           robot 0  trip 0  at (5, 3)",
        "tick      70  delivered         robot 0  trip 0  at (2, 1)",
        "tick      73  order taken       robot 0  trip 2",
        "tick      73  picked up         robot 0  trip 2  at (2, 1)",
        "tick     110  visited           robot 0  trip 2  at (5, 3)",
        "tick     122  delivered         robot 0  trip 2  at (2, 1)",
    ]
    assert lines[12] == "" and lines[13].startswith("goods-mini, 2 robots")


def test_they_are_objects_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "goods-mini", "--events", "--json"]) == 0
    events = json.loads(capsys.readouterr().out)["events"]
    assert len(events) == 12
    assert events[4] == {
        "tick": 37,
        "event": "visited",
        "robot": 1,
        "trip": 1,
        "value": None,
        "x": 5,
        "y": 3,
        "rule": None,
    }
