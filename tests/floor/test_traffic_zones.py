"""Zones: the straight stretches between intersections, drawn on small floors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from automaton.engine.state import NIL
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import DIRECTION_VECTORS, EAST, NORTH, SOUTH, WEST
from automaton.floor.traffic_zones import ZONE_MODES, traffic_zones_of
from layouts.tabletop import Tabletop

MARKS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"


def zoned(floor_plan, mode="undirected", direction=EAST):
    """The floor with a letter for each zone, + for an intersection that is none, # elsewhere."""
    traffic_zones = traffic_zones_of(floor_plan, mode)
    rows = []
    for y in range(floor_plan.height):
        row = ""
        for x in range(floor_plan.width):
            cell = floor_plan.cell(x, y)
            zone = traffic_zones.of[cell, direction >> 1]
            row += MARKS[zone] if zone != NIL else "+" if traffic_zones.intersection[cell] else "#"
        rows.append(row)
    return "\n".join(rows)


def drawn(picture):
    return draw_floor(picture.strip("\n"))


CROSSING = """
##.##
##.##
.....
##.##
"""


def test_four_segments_meet_in_a_crossing():
    floor_plan = drawn(CROSSING)
    assert zoned(floor_plan) == "##a##\n##a##\nbb+cc\n##d##"
    assert traffic_zones_of(floor_plan).count == 4


def test_directions_are_zones_of_their_own():
    floor_plan = drawn(CROSSING)
    assert zoned(floor_plan, "directed", EAST) == "##a##\n##a##\ncc+ee\n##g##"
    assert zoned(floor_plan, "directed", SOUTH) == zoned(floor_plan, "directed", EAST)
    assert zoned(floor_plan, "directed", WEST) == "##b##\n##b##\ndd+ff\n##h##"
    assert zoned(floor_plan, "directed", NORTH) == zoned(floor_plan, "directed", WEST)
    assert traffic_zones_of(floor_plan, "directed").count == 8


def test_intersections_come_after_the_segments():
    floor_plan = drawn(CROSSING)
    assert zoned(floor_plan, "with-intersections") == "##a##\n##a##\nbbecc\n##d##"
    assert traffic_zones_of(floor_plan, "with-intersections").count == 5


def test_a_corner_divides_and_a_dead_end_belongs_to_its_segment():
    floor_plan = drawn("""
....
.##.
.###
""")
    assert zoned(floor_plan) == "+aa+\nb##c\nb###"


def test_a_lone_cell_is_a_segment():
    assert zoned(drawn(".#.\n###\n..#")) == "a#b\n###\ncc#"


def test_open_floor_is_intersections_alone():
    floor_plan = drawn("...\n...")
    assert zoned(floor_plan) == "+++\n+++"
    assert traffic_zones_of(floor_plan).count == 0
    assert traffic_zones_of(floor_plan, "with-intersections").count == 6


def test_one_way_cells_connect_as_far_as_their_arrows_lead():
    # The right neighbour of > is entered from it; nothing leads between the two at the end.
    assert zoned(drawn(".>.<#")) == "aaaa#"
    assert zoned(drawn(".<>.")) == "aabb"


def test_tabletop_alleys_are_segments_between_turntables():
    floor_plan = Tabletop(tables=2, positions=3).build()
    assert zoned(floor_plan) == "+a+b+#\nc#d#e#\nc#d#e#\nc#d#e#\n+f+g+#"


def test_arrays_are_read_only_and_shared():
    floor_plan = drawn(CROSSING)
    traffic_zones = traffic_zones_of(floor_plan)
    assert traffic_zones is traffic_zones_of(drawn(CROSSING))
    assert not traffic_zones.of.flags.writeable and traffic_zones.of.dtype == np.int32
    assert not traffic_zones.intersection.flags.writeable
    with pytest.raises(ValueError, match="there are undirected, directed"):
        traffic_zones_of(floor_plan, "lanes")


def links_of(floor_plan):
    """For each drivable cell its neighbours, horizontal and vertical, by walking over the exits."""
    links = {}
    for y in range(floor_plan.height):
        for x in range(floor_plan.width):
            for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
                if floor_plan.exits[y + 1, x + 1] >> direction & 1:
                    there = (x + dx, y + dy)
                    links.setdefault((x, y), ([], []))[direction & 1].append(there)
                    links.setdefault(there, ([], []))[direction & 1].append((x, y))
    return links


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 7)
    .flatmap(
        lambda width: st.lists(
            st.text("..#.>v<^=", min_size=width, max_size=width), min_size=1, max_size=7
        )
    )
    .filter(lambda rows: set("".join(rows)) != {"#"})
)
def test_two_neighbours_share_a_zone_exactly_when_neither_is_an_intersection(rows):
    floor_plan = draw_floor("\n".join(rows))
    traffic_zones, links = traffic_zones_of(floor_plan), links_of(floor_plan)
    for y in range(floor_plan.height):
        for x in range(floor_plan.width):
            cell = floor_plan.cell(x, y)
            across, down = links.get((x, y), ([], []))
            assert traffic_zones.intersection[cell] == bool(across and down)
            drivable = bool(floor_plan.drivable.flat[cell])
            assert (traffic_zones.of[cell, 0] != NIL) == (
                drivable and not traffic_zones.intersection[cell]
            )
            for there in (*across, *down):
                other = floor_plan.cell(*there)
                same = traffic_zones.of[cell, 0] == traffic_zones.of[other, 0] != NIL
                assert same == (
                    not traffic_zones.intersection[cell] and not traffic_zones.intersection[other]
                )
    used = np.unique(traffic_zones.of[traffic_zones.of != NIL])
    assert used.tolist() == list(range(traffic_zones.count))


@pytest.mark.parametrize("mode", ZONE_MODES)
def test_every_zone_has_a_cell(mode):
    traffic_zones = traffic_zones_of(drawn(CROSSING), mode)
    assert np.unique(traffic_zones.of[traffic_zones.of != NIL]).tolist() == list(
        range(traffic_zones.count)
    )
