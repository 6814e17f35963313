"""Fleets in narrow aisles, with turns and handling that take time: a sample of `aisle_trials.py`."""

from __future__ import annotations

import pytest
from aisle_trials import AISLES, main, outcome, picture, scenario_of


def test_a_pocket_is_a_station_below_the_last_corridor() -> None:
    rows = {floor: picture(floor) for floor in AISLES}
    assert {floor: len(found) for floor, found in rows.items()} == {
        "two": 24,
        "one": 24,
        "stub": 25,
        "dead": 20,
    }
    assert rows["one"][2].startswith("#e#f#e") and rows["two"][2].startswith("#a#a#a")
    assert rows["dead"][-1].startswith("..t...t.") and rows["stub"][-1].startswith("##t###t#")


@pytest.mark.parametrize("floor", AISLES)
def test_robots_get_through_aisles(floor: str) -> None:
    found = outcome(scenario_of(floor, 30, 1, ticks=800))
    assert found.delivered > 80 and not found.jammed and found.illegal == 0


def test_a_fleet_that_waits_for_ever_jams() -> None:
    assert outcome(scenario_of("two", 30, 1, "wait", 800)).jammed


def test_a_line_is_printed_for_a_fleet(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["1", "pibt", "dead", "2"]) == 0
    title, line = capsys.readouterr().out.splitlines()
    assert title.startswith("pibt, 1 seeds:")
    assert line.startswith("dead     2:    0 jams,    0 starved,") and "0 illegal" in line
