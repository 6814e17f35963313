"""The generator of rack warehouses: the floor of the paper, cell by cell and by its numbers."""

import numpy as np
import pytest

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.floor.drawn_floors import write_matrix
from automaton.floor.floor_plan import DOCK, FLOOR, RACK
from automaton.floor.reachability import reached
from automaton.floor.traffic_zones import traffic_zones_of
from automaton.runs.pictures import floor_picture
from automaton.scenario.schema import Fleet, Orders, Scenario
from automaton.world.building import build_world
from automaton.world.resolve import resolve
from layouts.racks import Racks

# Figure 2 of the paper: the upper left corner; -1 wall, 0 free, 50 intersection, 100 rack, 200 dock.
AISLE = "-1 50 0 50 0 0 0 0 0 0 0 0 0"
BLOCK = "-1 0 200 0 100 100 100 100 100 100 100 100 100"
FIGURE_2 = [" ".join(["-1"] * 13), *[AISLE, BLOCK, BLOCK] * 5]


@pytest.fixture(scope="module")
def e1():
    return Racks(preset="E1").build()


def test_the_corner_is_the_one_printed_in_the_paper(e1):
    rows = write_matrix(e1).splitlines()[:16]
    assert [" ".join(row.split(",")[:13]) for row in rows] == FIGURE_2


@pytest.mark.parametrize(
    ("preset", "size", "docks", "racks", "segments", "intersections", "free"),
    [
        ("E1", (100, 100), 64, 5769, 522, 264, 3748),
        ("E2", (104, 100), 64, 5769, 714, 363, 4061),
        ("L1", (100, 100), 64, 5504, 715, 363, 3938),
    ],
)
def test_presets_have_the_numbers_of_the_paper(
    preset, size, docks, racks, segments, intersections, free
):
    floor_plan = Racks(preset=preset).build()
    assert (floor_plan.width, floor_plan.height) == size
    assert np.count_nonzero(floor_plan.kind == DOCK) == docks
    assert np.count_nonzero(floor_plan.kind == RACK) == racks
    assert traffic_zones_of(floor_plan).count == segments
    assert traffic_zones_of(floor_plan, "directed").count == 2 * segments
    assert traffic_zones_of(floor_plan, "with-intersections").count == segments + intersections
    connected = reached(floor_plan, [floor_plan.cell(1, 1)], rail=False)
    assert np.count_nonzero(connected) == np.count_nonzero(floor_plan.kind == FLOOR) == free


def test_e2_has_1044_zones_but_for_its_dead_ends():
    traffic_zones = traffic_zones_of(Racks(preset="E2").build(), "with-intersections")
    dead_ends = 33  # right of the last cross highway, one in each aisle
    assert traffic_zones.count - dead_ends == 1044


def test_every_slot_but_27_of_e2_has_one_cell_to_stand_on(e1):
    for floor_plan, without in ((e1, 0), (Racks(preset="E2").build(), 27)):
        access = world_on(floor_plan).slots.access
        rack = floor_plan.kind.reshape(-1)[floor_plan.slots] == RACK
        stands = (access != NIL).sum(axis=1)
        assert np.count_nonzero(stands[rack] == 1) == 5769 - without
        assert np.count_nonzero(stands[rack] == 0) == without
        # A dock opens on the right, beside the racks, first of all.
        docks = floor_plan.slots[~rack]
        assert (access[~rack, 0] == docks + 1).all()


def world_on(floor_plan):
    """A world with one robot and one order on this floor."""
    from automaton.world.resolved import Resolved

    scenario = Scenario(
        name="racks",
        layout={},
        fleet=Fleet(robots=1, kinematics="omni"),
        orders=Orders(generator="full-shelves"),
    )
    resolved = Resolved(
        scenario, floor_plan, strategies={}, start=(floor_plan.cell(1, 1),), source=""
    )
    return build_world(resolved, 1)[0]


SMALL = """
################
#~~~~~~~~~~~~~~#
#~i~rrr~rrr~rrr#
#~i~rrr~rrr~rrr#
#~~~~~~~~~~~~~~#
#~i~rrr~rrr~rrr#
#~i~rrr~rrr~rrr#
#~~~~~~~~~~~~~~#
#~#~rrrr########
################
"""


def test_a_small_warehouse_with_a_last_row():
    floor = Racks(rows=10, columns=16, block=3, last_row=4).build()
    assert floor_picture(floor) == SMALL.strip()


def test_aisles_for_one_robot_or_for_two():
    floor = Racks(rows=6, columns=9, block=3, last_row=0, capacity=2).build()
    assert floor_picture(floor).split("\n")[1:3] == ["#=======#", "#=i=rrr=#"]
    one = Racks(rows=6, columns=9, block=3, last_row=0, capacity=1).build()
    assert floor_picture(one).split("\n")[1:3] == ["#.......#", "#.i.rrr.#"]


def test_a_closed_aisle_is_filled_from_highway_to_highway():
    floor = Racks(rows=9, columns=16, block=3, last_row=0, closed=((9, 4),)).build()
    assert floor_picture(floor).split("\n")[4] == "#~~~~~~~rrr~~~~#"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"preset": "E3"}, "layout.preset must be E1, E2 or L1, found 'E3'"),
        ({"rows": 3}, "layout.rows must be a whole number from 6 to 4096, found 3"),
        ({"rows": 99, "last_row": 5}, "last_row is 5, but with 99 rows none is left over"),
        ({"last_row": 96}, "last_row must be from 0 to columns - 5 = 95, found 96"),
        ({"closed": [[17, 4]]}, "closed names [17, 4], which is not a cell of an aisle"),
        ({"closed": [[5, 5]]}, "closed names [5, 5], which is not a cell of an aisle"),
        ({"capacity": 3}, "layout.capacity must be 0, 1 or 2, found 3"),
        ({"aisles": 3}, "unknown key 'aisles' in layout; allowed: preset, rows"),
    ],
)
def test_bad_parameters_are_refused_in_one_sentence(changes, message):
    scenario = Scenario(name="bad", layout={"generator": "racks", **changes}, fleet=Fleet(robots=1))
    with pytest.raises(InputError) as raised:
        resolve(scenario)
    assert message in str(raised.value)
