"""Floors made by generators: open floors with obstacles, rooms, narrow aisles."""

from __future__ import annotations

from textwrap import dedent

import numpy as np
import pytest

from automaton.floor.drawn_floors import floor_picture
from automaton.floor.floor_plan import FLOOR
from automaton.floor.reachability import to_and_from
from layouts.aisles import Aisles
from layouts.random_floor import RandomFloor, Rooms, largest_part
from layouts.shelf_blocks import ShelfBlocks
from layouts.sorting import Sorting


@pytest.mark.parametrize(
    ("floor", "picture"),
    [
        (
            Aisles(aisles=3, sections=1, length=2, one_way=True),
            """
            .......
            .......
            #v#^#v#
            #v#^#v#
            .......
            ..t...t
            """,
        ),
        (
            Aisles(aisles=2, sections=1, length=2, shelves=True),
            """
            .....
            .....
            s.s.s
            s.s.s
            .....
            .....
            ##d##
            """,
        ),
        (
            Sorting(columns=10, rows=8),
            """
            i........i
            #........#
            i..r..r..i
            #........#
            i........i
            #..r..r..#
            i........i
            #........#
            """,
        ),
        (
            ShelfBlocks(columns=12, rows=9, block=3),
            """
            ............
            t..........t
            ..rrr.rrr...
            ............
            t..........t
            ............
            ..rrr.rrr...
            t..........t
            ............
            """,
        ),
        (
            Aisles(aisles=2, sections=2, length=1, pockets=True),
            """
            .....
            .....
            #.#.#
            .....
            .....
            #.#.#
            .....
            .....
            ##t##
            """,
        ),
    ],
)
def test_floors_for_large_fleets(floor, picture):
    drawn = floor_picture(floor.build()).replace(" ", "#")
    assert drawn.strip("\n") == dedent(picture).strip("\n")


@pytest.mark.parametrize(
    "floor", [Aisles(one_way=True, pockets=True), Aisles(one_way=True, shelves=True)]
)
def test_exits_lead_from_and_to_where_robots_drive(floor):
    built = floor.build()
    exits, drivable = built.exits.reshape(-1), built.drivable.reshape(-1)
    assert not exits[~drivable].any()
    for direction, offset in enumerate(built.offsets):
        assert drivable[np.flatnonzero(exits >> direction & 1) + offset].all()


def test_what_obstacles_cut_off_is_wall():
    free = (
        np.array([list(map(int, row)) for row in ("0000000", "0110100", "0010110", "0000000")]) == 1
    )
    assert largest_part(free).sum() == 3
    assert largest_part(free)[1, 1] and not largest_part(free)[1, 4]


@pytest.mark.parametrize("floor", [RandomFloor(obstacles=0.35), Rooms(across=3, down=3, side=5)])
def test_all_free_cells_are_reached_from_each_other(floor):
    built = floor.build()
    free = np.flatnonzero(built.kind.reshape(-1) == FLOOR)
    assert len(free) > 200
    assert (np.flatnonzero(to_and_from(built, int(free[0]), False)) == free).all()


def test_a_floor_follows_from_its_seed():
    one, same, other = (floor_picture(RandomFloor(floor_seed=s).build()) for s in (1, 1, 2))
    assert one == same != other


def test_rooms_have_a_door_in_each_wall():
    kind = Rooms(across=3, down=2, side=4, floor_seed=5).build().kind[1:-1, 1:-1]
    for wall in (kind[:4, 4], kind[:4, 9], kind[5:, 4], kind[5:, 9]):
        assert (wall == FLOOR).sum() == 1
    assert (kind[4] == FLOOR).sum() == 3
