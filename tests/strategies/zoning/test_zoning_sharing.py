"""Load sharing: what a round does to two queues."""

from __future__ import annotations

import numpy as np
from reference_load_sharing import share
from zoning_scenes import drawn

from strategies.zoning.design.design_files import read_design


def shared(queue: list[int], to: list[int], score: list[int]) -> tuple[list[int], list[int], int]:
    """Queue and direct flag of each part after a round; zones are {1, 2} and {3, 4}."""
    floor_plan, roads = drawn("1.2.3.4")
    zones = [{"stations": [1, 2]}, {"stations": [3, 4]}]
    design = read_design(floor_plan, roads, {"zones": zones})
    parts = np.array(queue, np.int32), np.array(to, np.int32) - 1
    waiting, direct = np.ones(len(queue), np.uint8), np.zeros(len(queue), np.uint8)
    scores, length = np.array(score, float), np.zeros(2, np.int32)
    touched = share(design, *parts, waiting, scores, direct, length)
    return parts[0].tolist(), direct.tolist(), touched


def test_the_first_part_bound_for_the_idle_zone_changes_robots() -> None:
    assert shared([0, 0, 0], [2, 3, 4], [9, 1, 5]) == ([0, 0, 1], [0, 0, 1], 1)


def test_the_first_part_bound_for_the_busy_zone_goes_past_the_transfer_stations() -> None:
    assert shared([0, 0, 1], [1, 2, 2], [1, 1, 1]) == ([0, 0, 1], [0, 0, 1], 1)


def test_at_most_one_of_each_kind_in_a_round() -> None:
    queues = [0, 0, 0, 0, 1, 1]
    assert shared(queues, [3, 3, 3, 3, 1, 1], [0] * 6) == (
        [1, 0, 0, 0, 1, 1],
        [1, 0, 0, 0, 1, 0],
        2,
    )


def test_equal_queues_are_left_alone() -> None:
    assert shared([0, 1], [3, 1], [1, 1]) == ([0, 1], [0, 0], 0)
