"""What `check` says of fleets that will not get through."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.scenario.schema import Scenario
from automaton.world.fleet_warnings import fleet_warnings, size_warnings
from automaton.world.resolve import Resolved, resolve

FLOOR = """
name: crowd
layout: {{generator: aisles, aisles: 8, length: 5, pockets: {pockets}}}
fleet: {{robots: {robots}, kinematics: differential}}
orders: {{generator: stations, count: 10}}
strategy: {{right_of_way: {right_of_way}}}
stop: {{when: never, max_duration: 100}}
"""
POCKETS = """
name: pockets
layout:
  picture: |
    ......
    .####.
    ..t.t.
    #.##.#
    #.####
    #.####
fleet: {{robots: {robots}, kinematics: differential, start: {starts}}}
orders: {{generator: stations, count: 6}}
strategy: {{right_of_way: pibt}}
stop: {{when: parked, max_duration: 400}}
"""
TRACK = """
name: track
layout:
  picture: |
    t---t
fleet: {robots: 2, kinematics: rail, start: [[1, 0], [3, 0]]}
orders: {generator: stations, count: 3}
strategy: {right_of_way: pibt}
stop: {when: never, max_duration: 100}
"""


def warned(tmp_path, text):
    path = tmp_path / "crowd.yaml"
    path.write_text(text)
    return fleet_warnings(resolve(path))


@pytest.mark.parametrize(
    ("pockets", "robots", "right_of_way", "begins"),
    [
        ("false", 30, "pibt", []),
        ("true", 30, "pibt", ["stations or chargers in dead ends ([2, 16]"]),
        ("true", 10, "pibt", []),
        ("false", 30, "retreat", ["right_of_way retreat jams with 30 robots on 182 cells"]),
        ("false", 8, "retreat", []),
        ("false", 180, "pibt", ["180 robots on 182 cells"]),
    ],
)
def test_fleets_that_will_not_get_through(tmp_path, pockets, robots, right_of_way, begins):
    text = FLOOR.format(pockets=pockets, robots=robots, right_of_way=right_of_way)
    found = warned(tmp_path, text)
    assert [sentence[: len(begin)] for sentence, begin in zip(found, begins, strict=True)] == begins


def test_of_a_crowd_no_number_is_promised(tmp_path):
    (sentence,) = warned(tmp_path, FLOOR.format(pockets="false", robots=180, right_of_way="pibt"))
    assert sentence.endswith("half as many robots may finish more orders (study crowds)")


@pytest.mark.parametrize(
    ("starts", "cells"),
    [
        ("[[1, 4], [1, 5]]", "[1, 4]"),
        ("[[1, 5], [1, 3]]", "[1, 3]"),
        ("[[1, 3], [1, 5], [1, 4]]", "[1, 3], [1, 4]"),
        ("[[1, 5], [1, 2]]", None),  # [1, 2] is on the ring
        ("[[1, 4], [4, 3]]", None),  # two dead ends
    ],
)
def test_homes_one_behind_the_other(tmp_path, starts, cells):
    found = warned(tmp_path, POCKETS.format(starts=starts, robots=starts.count("[") - 1))
    begin = f"homes of robots on the way into dead ends ({cells}): "
    assert [sentence[: len(begin)] for sentence in found] == ([begin] if cells else [])


def test_homes_matter_where_robots_are_to_park(tmp_path):
    text = POCKETS.format(starts="[[1, 4], [1, 5]]", robots=2)
    assert warned(tmp_path, text.replace("when: parked", "when: delivered")) == []


def test_priority_inheritance_needs_a_ring(tmp_path):
    (sentence,) = warned(tmp_path, TRACK)
    assert sentence.startswith("the floor has no ring of cells")


# Robots larger than a cell.


def large(fleet: dict[str, Any], units: dict[str, str]) -> Resolved:
    body = {
        "name": "large",
        "layout": {"picture": "...\n..."},
        "fleet": {"robots": 2, "kinematics": "omni", "start": [[0, 0], [2, 1]], **fleet},
        "units": units,
        "orders": {"list": [{"stops": [[1, 0]]}]},
        "stop": {"when": "delivered", "max_duration": 100},
    }
    return resolve(msgspec.convert(body, Scenario))


METRE = {"tick": "1 s", "cell": "1 m"}


def test_robots_longer_or_wider_than_a_cell_are_warned_of_once_for_each_type() -> None:
    warned = size_warnings(large({"length": 1.6, "width": 0.8}, METRE))
    assert warned == [
        "robots are 1.6 m long, but a cell is 1 m: a robot takes one cell, so they drive and queue "
        "closer together than such robots can; set units.cell to 1.6 m or more"
    ]
    types = [{"name": "fork", "robots": 1, "width": 1.2}, {"name": "tug", "length": 0.9}]
    (wide,) = size_warnings(large({"length": 0.5, "types": types}, METRE))
    assert wide.startswith("robots of the type fork are 1.2 m wide")
    assert size_warnings(large({"length": 1.0}, METRE)) == []
    assert size_warnings(large({}, METRE)) == []


def test_a_size_needs_the_size_of_a_cell() -> None:
    with pytest.raises(InputError, match=r"to compare it with a cell, .*set units\.cell"):
        large({"length": 1.6}, {"tick": "1 s"})
    types = [{"name": "fork", "length": 1.6}]
    with pytest.raises(InputError, match=r"to compare it with a cell"):
        large({"types": types}, {"tick": "1 s"})


def test_a_size_is_written_with_its_unit_and_check_names_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "forks.yaml"
    path.write_text(
        "name: forks\nlayout: {picture: '....'}\nunits: {tick: 1 s, cell: 1 m}\n"
        "fleet: {robots: 1, start: [[0, 0]], length: 240 cm}\n"
        "orders: {list: [{stops: [[3, 0]]}]}\nstop: {when: delivered, max_duration: 100}\n"
    )
    assert main(["check", str(path)]) == 0
    assert "robots are 2.4 m long, but a cell is 1 m" in capsys.readouterr().err
    path.write_text(path.read_text().replace("240 cm", "3 s"))
    assert main(["check", str(path)]) == 2
    assert "'3 s' is a time, expected a length such as 1.2 m" in capsys.readouterr().err
