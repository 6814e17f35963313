"""Where robots put their pods: searched back from each station, as from each storage cell it is."""

from __future__ import annotations

import random
from functools import cache
from typing import Any

import pytest
from handmade_recordings import header

from automaton.floor.floor_plan import CELL_KINDS, STORAGE
from automaton.verification.motion_rules import ReplayedMotion
from automaton.verification.pod_rules import LoadedWays

WIDTH, HEIGHT = 7, 4
INSIDE = [(y + 1) * (WIDTH + 2) + x + 1 for y in range(HEIGHT) for x in range(WIDTH)]


@cache
def head(kinematics: str) -> dict[str, Any]:
    rows = ["s+++++d"] + ["+" * WIDTH] * (HEIGHT - 1)
    return header("\n".join(rows), [(0, 1), (6, 3)], kinematics=kinematics)


def on_random_floor(kinematics: str, seed: int) -> LoadedWays:
    """Exits at random, so that some lead one way; some cells are closed to one load or the other."""
    draw = random.Random(seed)
    motion = ReplayedMotion(head(kinematics), lambda *_: None)
    one_way, turning = draw.random(), [k for k, kind in enumerate(CELL_KINDS) if kind.turns]
    others = [*turning, *(k for k, kind in enumerate(CELL_KINDS) if kind.drivable and k != STORAGE)]
    for cell in INSIDE:
        leads = (way for way in range(4) if cell + motion.step[way] in INSIDE)
        motion.exits[cell] = sum(1 << way for way in leads if draw.random() >= 0.3 * one_way)
        motion.kind[cell] = STORAGE if draw.random() < 0.25 else draw.choice(others)
    for r in range(len(motion.home)):
        motion.types.closed[r] = (set(draw.sample(INSIDE, 2)), set(draw.sample(INSIDE, 2)))
        motion.types.name[r] = f"type {r}"
    return LoadedWays(motion, draw.sample(INSIDE, draw.randint(1, 3)))


def searched_one_by_one(ways: LoadedWays, r: int) -> set[int]:
    """The storage cells from which robot r gets everywhere, by a search from each."""
    motion, every = ways.motion, range(ways.motion.headings[r])
    both = [(station, True) for station in ways._stations]
    if motion.types.closed[r][0] - motion.types.closed[r][1]:
        both.append((motion.home[r], False))
    return {
        cell
        for cell, kind in enumerate(motion.kind)
        if kind == STORAGE
        and all(
            cell in ways.ticks(r, place, every, loaded)
            and place in ways.ticks(r, cell, every, loaded)
            for place, loaded in both
        )
    }


@pytest.mark.parametrize("kinematics", ["omni", "rail", "differential"])
def test_robots_put_pods_where_a_search_from_each_cell_says(kinematics: str) -> None:
    found: set[int] = set()
    for seed in range(60):
        ways = on_random_floor(kinematics, seed)
        for r in range(len(ways.motion.home)):
            useful = ways.useful(r)
            assert useful == searched_one_by_one(ways, r), (seed, r)
            found.add(len(useful))
    assert len(found) > 4, "on some floors a few cells, on some many"
