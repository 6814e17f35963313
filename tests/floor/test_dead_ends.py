"""Dead ends of floors."""

from __future__ import annotations

import numpy as np
import pytest

from automaton.floor.drawn_floors import draw_floor
from automaton.floor.reachability import NO_WAY_OUT, dead_ends_of, dead_ends_of_types


@pytest.mark.parametrize(
    ("picture", "numbers"),
    [
        ("...\n.#.\n...", "...\n.#.\n..."),
        ("...\n.#.\n...\n#.#\n#..", "...\n.#.\n...\n#0#\n#00"),
        ("....\n.##.\n....\n.##.", "....\n.##.\n....\n0##1"),
        ("......", "tttttt"),
        ("...##.#.\n.#.#...#\n...##.#.", "...##t#.\n.#.#ttt#\n...##t#."),
        (">>v\n^#v\n^<<", ">>v\n^#v\n^<<"),
        ("....\n.##.\n....\n~##=", "....\n.##.\n....\n~##="),
    ],
)
def test_dead_ends_are_what_peels_away(picture, numbers):
    """Numbers: dead ends; t: parts without a ring."""
    floor_plan = draw_floor(picture)
    found = dead_ends_of(floor_plan)
    rows = picture.split("\n")
    cells = [
        [found.number[floor_plan.cell(x, y)] for x in range(len(row))] for y, row in enumerate(rows)
    ]
    ringless = [
        [found.ringless[floor_plan.cell(x, y)] for x in range(len(row))]
        for y, row in enumerate(rows)
    ]
    drawn = [
        "".join(
            "t" if alone else str(n) if n >= 0 else one
            for n, alone, one in zip(line, parts, row, strict=True)
        )
        for line, parts, row in zip(cells, ringless, rows, strict=True)
    ]
    assert "\n".join(drawn) == numbers
    assert found.total == found.number.max() + 1
    assert ((found.way_out == NO_WAY_OUT) == (found.number < 0)).all()


def test_a_dead_end_for_one_type_of_robots_is_one_for_all():
    """The second type may not drive in the last cell of row 0, so it leaves the right ring as it came."""
    whole = draw_floor(".....\n.#.#.\n.....")
    less = draw_floor("....#\n.#.#.\n.....")
    exits = np.array([one.exits.reshape(-1) for one in (whole, less)])
    found = dead_ends_of_types(exits, whole.capacity.reshape(-1) == 1, whole.offsets)
    assert dead_ends_of(whole).total == 0
    assert found.total == 2
    depths = {(3, 0): 1, (3, 2): 1, (4, 2): 2, (4, 1): 3}
    assert {xy: int(found.depth[whole.cell(*xy)]) for xy in depths} == depths
    assert np.count_nonzero(found.depth) == len(depths)
