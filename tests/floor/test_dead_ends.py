"""Dead ends of floors."""

from __future__ import annotations

import pytest

from automaton.floor.dead_ends import NO_WAY_OUT, dead_ends_of
from automaton.floor.drawn_floors import draw_floor


@pytest.mark.parametrize(
    ("picture", "numbers", "is_tree"),
    [
        ("...\n.#.\n...", "...\n.#.\n...", False),
        ("...\n.#.\n...\n#.#\n#..", "...\n.#.\n...\n#0#\n#00", False),
        ("....\n.##.\n....\n.##.", "....\n.##.\n....\n0##1", False),
        ("......", "......", True),
        (">>v\n^#v\n^<<", ">>v\n^#v\n^<<", False),
        ("....\n.##.\n....\n~##=", "....\n.##.\n....\n~##=", False),
    ],
)
def test_dead_ends_are_what_peels_away(picture, numbers, is_tree):
    floor_plan = draw_floor(picture)
    found = dead_ends_of(floor_plan)
    rows = picture.split("\n")
    cells = [
        [found.number[floor_plan.cell(x, y)] for x in range(len(row))] for y, row in enumerate(rows)
    ]
    drawn = [
        "".join(str(n) if n >= 0 else one for n, one in zip(line, row, strict=True))
        for line, row in zip(cells, rows, strict=True)
    ]
    assert "\n".join(drawn) == numbers
    assert (found.total, found.is_tree) == (found.number.max() + 1, is_tree)
    assert ((found.way_out == NO_WAY_OUT) == (found.number < 0)).all()
