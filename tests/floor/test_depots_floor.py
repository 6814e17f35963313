"""The floor of De Ryck et al.: its grid and its graph say the same."""

from __future__ import annotations

from collections import deque

import pytest

from automaton.floor.floor_plan import CHARGER, FloorPlan
from layouts.depots import (
    CELL,
    CELL_OF_POSITION,
    NEEDED_LANES,
    OPTIONAL_LANES,
    STATION_POSITIONS,
    Depots,
    metres,
)


def cells_from(floor_plan: FloorPlan, start: int) -> dict[int, int]:
    """Cells to drive from a flat cell to each other one, by the exits of the floor."""
    exits = floor_plan.exits.reshape(-1)
    found, queue = {start: 0}, deque([start])
    while queue:
        cell = queue.popleft()
        for direction, neighbour in enumerate(floor_plan.neighbours(cell)):
            if exits[cell] >> direction & 1 and neighbour not in found:
                found[neighbour] = found[cell] + 1
                queue.append(neighbour)
    return found


@pytest.mark.parametrize("lanes", ["full", "comb"])
def test_driving_over_cells_is_as_far_as_the_graph_says(lanes: str) -> None:
    floor = Depots(lanes=lanes)  # type: ignore[arg-type]
    floor_plan, table = floor.build(), floor.metres()
    for a, at in CELL_OF_POSITION.items():
        found = cells_from(floor_plan, floor_plan.cell(*at))
        for b, to in CELL_OF_POSITION.items():
            assert found[floor_plan.cell(*to)] * CELL == table[a - 1, b - 1], (a, b)


def test_lengths_that_the_paper_states() -> None:
    table = metres(NEEDED_LANES | OPTIONAL_LANES)
    stated = {(3, 7): 20, (7, 8): 20, (8, 13): 30, (13, 14): 110, (1, 5): 20, (5, 4): 20}
    stated |= {(4, 9): 30, (9, 14): 30, (5, 2): 40, (2, 4): 60, (1, 2): 60, (14, 2): 120}
    for (a, b), length in stated.items():
        assert table[a - 1, b - 1] == length, (a, b)


def test_nine_lanes_are_needed_for_the_lengths_of_the_text() -> None:
    legs = [(1, 5), (5, 4), (4, 9), (9, 14), (3, 7), (7, 8), (8, 13), (5, 2), (2, 4)]
    full = metres(NEEDED_LANES | OPTIONAL_LANES)
    nine = NEEDED_LANES - {(6, 7), (13, 16), (14, 15), (15, 16), (15, 17)}
    assert len(nine) == 9
    for lane in nine:
        less = metres((NEEDED_LANES | OPTIONAL_LANES) - {lane})
        assert any(less[a - 1, b - 1] != full[a - 1, b - 1] for a, b in legs), lane


def test_the_drawing() -> None:
    floor_plan = Depots(chargers=(1, 2)).build()
    rows = [
        "".join("#.c"[0 if not kind else 2 if kind == CHARGER else 1] for kind in row[1:-1])
        for row in floor_plan.kind[1:-1]
    ]
    assert rows == [
        "##c#c#.##",
        "##.#.#.##",
        ".........",
        ".#.#.#.#.",
        ".#.#.#.#.",
        ".........",
        ".###.###.",
        ".###.###.",
        ".........",
        "####.####",
        "####.####",
    ]
    assert len(STATION_POSITIONS) == 13
    assert floor_plan.capacity[1:-1, 1:-1][0, 2] == 1
    assert floor_plan.capacity[1:-1, 1:-1][2, 0] == 0


def test_a_charger_where_no_position_is_is_refused() -> None:
    with pytest.raises(ValueError, match="positions 1 to 17, found 40"):
        Depots(chargers=(40,))
