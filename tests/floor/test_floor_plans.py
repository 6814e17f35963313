"""Floors as data: what a picture or a generator becomes."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from automaton.errors import InputError
from automaton.floor.drawn_floors import draw_floor, symbol_of
from automaton.floor.floor_plan import (
    ALL_EXITS,
    ALONG_X,
    ALONG_Y,
    CELL_KINDS,
    DIRECTION_VECTORS,
    DIRECTIONS,
    SYMBOLS,
    TURNTABLE,
    FloorPlan,
)
from automaton.floor.reachability import (
    reached,
    slots_beside,
    to_and_from,
)
from layouts.tabletop import Tabletop


def picture(*rows: str) -> FloorPlan:
    return draw_floor("\n".join(rows))


def exits(floor_plan: FloorPlan, x: int, y: int) -> set[str]:
    bits = int(floor_plan.exits.flat[floor_plan.cell(x, y)])
    return {name for direction, name in enumerate(DIRECTIONS) if bits >> direction & 1}


def as_text(floor_plan: FloorPlan) -> list[str]:
    """Kinds of a floor with its border, for tables of track: one letter each."""
    letters = " .o+sdcb"
    rows = ["".join(letters[kind] for kind in row) for row in floor_plan.kind.tolist()]
    return [row.rstrip() for row in rows]


def test_the_code_of_a_kind_is_its_row_in_the_table() -> None:
    assert [kind.code for kind in CELL_KINDS] == list(range(len(CELL_KINDS)))


def test_directions_turn_clockwise_and_d_xor_2_is_the_opposite() -> None:
    for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
        assert DIRECTION_VECTORS[direction ^ 2] == (-dx, -dy)
        assert (dx == 0) == bool(direction & 1)


def test_capital_letters_are_robots_and_never_symbols() -> None:
    assert not [symbol for symbol in SYMBOLS if symbol.isupper()]


def test_cells_are_counted_from_the_upper_left_and_have_a_border() -> None:
    floor_plan = picture("..", "..", "..")
    assert (floor_plan.width, floor_plan.height, floor_plan.stride) == (2, 3, 4)
    assert floor_plan.kind.shape == (5, 4)
    assert floor_plan.cell(0, 0) == 5
    assert floor_plan.xy(floor_plan.cell(1, 2)) == (1, 2)
    assert floor_plan.holds(1, 2) and not floor_plan.holds(2, 2) and not floor_plan.holds(-1, 0)


def test_free_floor_is_left_towards_drivable_neighbours_only() -> None:
    floor_plan = picture("...", ".s.", "...")
    assert exits(floor_plan, 0, 0) == {"east", "south"}
    assert exits(floor_plan, 1, 0) == {"east", "west"}
    assert exits(floor_plan, 1, 1) == set()


def test_tracks_are_entered_and_left_along_their_axis() -> None:
    floor_plan = picture("+-+", "|.|", "+-+")
    assert exits(floor_plan, 0, 0) == {"east", "south"}
    assert exits(floor_plan, 1, 0) == {"east", "west"}
    assert exits(floor_plan, 0, 1) == {"north", "south"}
    assert exits(floor_plan, 1, 1) == set(), "free floor inside may not enter tracks from the side"


def test_a_one_way_cell_is_left_along_its_arrow_and_not_entered_against_it() -> None:
    floor_plan = picture(".>.", "...")
    assert exits(floor_plan, 1, 0) == {"east"}
    assert exits(floor_plan, 0, 0) == {"east", "south"}
    assert exits(floor_plan, 2, 0) == {"south"}, "west would be against the arrow"
    assert exits(floor_plan, 1, 1) == {"east", "north", "west"}, "from the side is allowed"


def test_a_ring_of_arrows_is_driven_one_way_round() -> None:
    floor_plan = picture(">>v", "^#v", "^<<")
    cell, visited = floor_plan.cell(0, 0), []
    for _ in range(8):
        visited.append(floor_plan.xy(cell))
        (direction,) = (d for d in range(4) if floor_plan.exits.flat[cell] >> d & 1)
        cell = floor_plan.neighbours(cell)[direction]
    assert cell == floor_plan.cell(0, 0)
    assert len(set(visited)) == 8


def test_aisles_carry_their_capacity() -> None:
    floor_plan = picture(".=~")
    assert [int(floor_plan.capacity.flat[floor_plan.cell(x, 0)]) for x in range(3)] == [1, 2, 0]


def test_slots_come_in_table_order_by_column_then_row() -> None:
    floor_plan = picture("s.d", "$.s", "...")
    assert [floor_plan.xy(cell) for cell in floor_plan.slots] == [(0, 0), (0, 1), (2, 0), (2, 1)]
    assert [floor_plan.xy(cell) for cell in np.flatnonzero(floor_plan.loads).tolist()] == [(0, 1)]


def test_a_first_column_of_bays_lies_left_of_the_floor() -> None:
    floor_plan = picture("b..", " ..", "b..")
    assert (floor_plan.width, floor_plan.height) == (2, 3)
    pairs = [(floor_plan.xy(bay), floor_plan.xy(home)) for bay, home in floor_plan.bays]
    assert pairs == [((-1, 0), (0, 0)), ((-1, 2), (0, 2))]


def test_a_bay_elsewhere_opens_east_then_west_south_north() -> None:
    floor_plan = picture(".b.", "...", "sb#")
    pairs = [(floor_plan.xy(bay), floor_plan.xy(home)) for bay, home in floor_plan.bays]
    assert pairs == [((1, 0), (2, 0)), ((1, 2), (1, 1))]


def test_short_rows_are_filled_with_wall() -> None:
    floor_plan = picture("....", ".", "...")
    assert floor_plan.width == 4
    assert exits(floor_plan, 0, 1) == {"north", "south"}


def test_robots_drawn_stand_on_free_floor_in_the_order_of_their_letters() -> None:
    floor_plan = picture("B..", "..A")
    assert [floor_plan.xy(cell) for cell in floor_plan.starts] == [(2, 1), (0, 0)]
    assert exits(floor_plan, 0, 0) == {"east", "south"}


def test_a_legend_adds_symbols() -> None:
    legend = (("x", symbol_of("track", exits=("north", "south"))), ("o", symbol_of("floor", 0)))
    floor_plan = draw_floor("+x\no+", legend)
    assert exits(floor_plan, 0, 0) == {"south"}, "a vertical track is not entered from the side"
    assert int(floor_plan.capacity.flat[floor_plan.cell(0, 1)]) == 0


@pytest.mark.parametrize("bad", [("wall", 1), ("shelf", None, ("east",)), ("track",)])
def test_a_legend_cannot_contradict_the_kind(bad: tuple[str]) -> None:
    with pytest.raises(InputError):
        symbol_of(*bad)


def test_equal_pictures_give_the_same_plan_and_plans_cannot_be_changed() -> None:
    floor_plan = picture("..", ".s")
    assert picture("..", ".s") is floor_plan
    assert floor_plan == picture("..", ".s", "") and hash(floor_plan) == hash(
        picture("..", ".s", "")
    )
    assert floor_plan != picture("..", "s.")
    with pytest.raises(ValueError, match="read-only"):
        floor_plan.kind[1, 1] = 0
    with pytest.raises(FrozenInstanceError):
        floor_plan.width = 3  # type: ignore[misc]


def test_the_tabletop_has_alleys_corridors_destinations_and_bays() -> None:
    floor_plan = Tabletop(tables=2, positions=3, destinations=4).build()
    assert as_text(floor_plan) == [
        "",
        "b+o+o+d",
        "bososod",
        "bososod",
        "bososod",
        "b+o+o+",
        "",
    ]
    for y in range(1, 4):
        assert exits(floor_plan, 0, y) == exits(floor_plan, 2, y) == {"north", "south"}
    assert exits(floor_plan, 1, 0) == exits(floor_plan, 3, 4) == {"east", "west"}
    assert exits(floor_plan, 2, 0) == {"east", "west", "south"}


@pytest.mark.parametrize(
    ("tables", "positions", "size"), [(5, 10, (11, 12)), (10, 5, (21, 7)), (5, 5, (11, 7))]
)
def test_the_papers_floors_have_the_papers_size(
    tables: int, positions: int, size: tuple[int, int]
) -> None:
    floor_plan = Tabletop(tables=tables, positions=positions).build()
    assert (floor_plan.width - 1, floor_plan.height) == size, (
        "the paper leaves out the destinations' column"
    )
    assert np.count_nonzero(floor_plan.kind == TURNTABLE) == 2 * (tables + 1)
    assert len(floor_plan.bays) == floor_plan.height


def test_the_smallest_tabletop_works() -> None:
    floor_plan = Tabletop(tables=1, positions=1, destinations=1).build()
    assert as_text(floor_plan) == ["", "b+o+d", "boso", "b+o+", ""]
    assert not slots_beside(floor_plan, ~floor_plan.drivable.reshape(-1)).size
    within = to_and_from(floor_plan, int(floor_plan.bays[0, 1]), rail=True)
    assert not slots_beside(floor_plan, ~within).size


def test_what_lies_behind_a_one_way_door_is_reached_but_not_left() -> None:
    floor_plan = picture(".>.s", "s###")
    assert reached(floor_plan, [floor_plan.cell(0, 0)], rail=False)[floor_plan.cell(2, 0)]
    assert not reached(floor_plan, [floor_plan.cell(2, 0)], rail=False)[floor_plan.cell(0, 0)]
    within = to_and_from(floor_plan, floor_plan.cell(2, 0), False)
    assert [floor_plan.xy(c) for c in slots_beside(floor_plan, ~within)] == [(0, 1)]


def test_each_cell_of_a_part_of_a_floor_has_the_same_ways_to_and_fro() -> None:
    """What was found from one cell is remembered for the others."""
    generator = np.random.default_rng(2)
    for _ in range(30):
        rows = generator.choice(list("..><v^#s"), (5, 6))
        floor_plan = picture(*("".join(row) for row in rows))
        for cell in generator.permutation(np.flatnonzero(floor_plan.drivable)).tolist():
            there = reached(floor_plan, [cell], rail=False)
            back = reached(floor_plan, [cell], rail=False, backwards=True)
            assert (to_and_from(floor_plan, cell, rail=False) == there & back).all()


def test_rails_turn_on_turntables_only() -> None:
    corner, table = picture("...", "##.", "##s"), picture("..+", "##.", "##s")
    start = corner.cell(0, 0)
    assert slots_beside(corner, ~to_and_from(corner, start, rail=True)).size == 1
    assert slots_beside(corner, ~to_and_from(corner, start, rail=False)).size == 0
    assert slots_beside(table, ~to_and_from(table, start, rail=True)).size == 0


def test_straight_tracks_that_a_robot_cannot_leave_are_a_part_of_their_own() -> None:
    floor_plan = picture("===", "+#+", "+++")
    corner, middle = floor_plan.cell(0, 0), floor_plan.cell(1, 0)
    assert not to_and_from(floor_plan, corner, rail=True)[middle]
    assert to_and_from(floor_plan, corner, rail=True)[floor_plan.cell(2, 0)]
    assert to_and_from(floor_plan, middle, rail=True)[middle]


def test_rails_enter_storage_along_the_way_they_are_on() -> None:
    passing, turning = picture("+.+", "#p#"), picture("+++", "#p#")
    pod, ahead = passing.cell(1, 1), passing.cell(1, 0)
    for start in (passing.cell(0, 0), passing.cell(2, 0)):
        assert not to_and_from(passing, start, rail=True)[pod]
        assert not to_and_from(passing, pod, rail=True)[start]
        assert to_and_from(passing, start, rail=False)[pod]
        assert to_and_from(turning, start, rail=True)[pod]
    assert to_and_from(passing, ahead, rail=True)[pod]  # the robot there may stand across


def test_exits_never_lead_into_the_border_or_a_wall() -> None:
    generator = np.random.default_rng(1)
    symbols = list("#.-|+sdc><v^=~")
    for _ in range(50):
        rows = ["".join(generator.choice(symbols, 7)) for _ in range(6)]
        floor_plan = picture(*rows, ".......")
        drivable = floor_plan.drivable.reshape(-1)
        for cell, bits in enumerate(floor_plan.exits.reshape(-1).tolist()):
            assert bits & ~ALL_EXITS == 0
            for direction, neighbour in enumerate(floor_plan.neighbours(cell)):
                if bits >> direction & 1:
                    assert drivable[cell] and drivable[neighbour]
    assert ALONG_X | ALONG_Y == ALL_EXITS
