"""Storage and pockets: left and entered over their open sides, whatever arrows say."""

from __future__ import annotations

import pytest

from automaton.errors import InputError
from automaton.floor.drawn_floors import draw_floor, floor_drawing, symbol_of
from automaton.floor.floor_plan import EXIT_NORTH, EXIT_SOUTH

STORAGE = ">>>>\n^pqv\n^<<<"


def test_an_aisle_lets_out_into_storage_beside_it_wherever_its_arrow_points() -> None:
    plan = draw_floor(STORAGE)
    above, pod = plan.cell(1, 0), plan.cell(1, 1)
    assert plan.exits.flat[above] & EXIT_SOUTH
    assert plan.exits.flat[pod] & EXIT_NORTH, "and back, against the arrow's side"
    assert plan.loads.flat[pod] == 1 and plan.loads.flat[plan.cell(2, 1)] == 0


def test_open_sides_restrict_storage() -> None:
    plan = draw_floor(STORAGE.replace("p", "x"), (("x", symbol_of("storage", opens=("south",))),))
    assert plan.exits.flat[plan.cell(1, 1)] == EXIT_SOUTH
    assert plan.exits.flat[plan.cell(1, 0)] & EXIT_SOUTH == 0


def test_a_pocket_beside_a_one_way_aisle_is_left_over_the_side_by_which_it_is_entered() -> None:
    legend = (("z", symbol_of("charger", opens=("north",))),)
    plan = draw_floor(">>>v\n^#z.\n^<<<", legend)
    assert plan.exits.flat[plan.cell(2, 1)] == EXIT_NORTH
    assert plan.exits.flat[plan.cell(2, 0)] & EXIT_SOUTH
    assert plan.exits.flat[plan.cell(3, 1)] & 4 == 0, "not from the east"


@pytest.mark.parametrize("picture", [STORAGE, ">>>v\n^pzv\n^<<<", "....\n.pq.\n.tq.\n...."])
def test_a_drawn_floor_is_the_same_again(picture: str) -> None:
    plan = draw_floor(picture, (("z", symbol_of("charger", opens=("north",))),))
    assert draw_floor(*floor_drawing(plan)) == plan


def test_storage_has_open_sides_and_no_exits() -> None:
    with pytest.raises(
        InputError, match="set opens to the sides over which robots enter and leave a storage"
    ):
        symbol_of("storage", exits=("north",))
    with pytest.raises(InputError, match="either exits or the sides"):
        symbol_of("charger", exits=("north",), opens=("north",))
