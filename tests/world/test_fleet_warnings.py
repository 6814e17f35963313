"""What `check` says of fleets that will not get through."""

from __future__ import annotations

import pytest

from automaton.world.fleet_warnings import fleet_warnings
from automaton.world.resolve import resolve

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
