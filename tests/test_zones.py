"""Zones: the straight stretches between intersections, drawn on small floors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from automaton.scenario.pictures import draw_floor
from automaton.world.cells import EAST, NORTH, SOUTH, STEPS, WEST
from automaton.world.state import NIL
from automaton.world.zones import MODES, zones_of
from layouts.tabletop import Tabletop

MARKS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"


def zoned(plan, mode="undirected", direction=EAST):
    """The floor with a letter for each zone, + for an intersection that is none, # elsewhere."""
    zones = zones_of(plan, mode)
    rows = []
    for y in range(plan.height):
        row = ""
        for x in range(plan.width):
            cell = plan.cell(x, y)
            zone = zones.of[cell, direction >> 1]
            row += MARKS[zone] if zone != NIL else "+" if zones.intersection[cell] else "#"
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
    plan = drawn(CROSSING)
    assert zoned(plan) == "##a##\n##a##\nbb+cc\n##d##"
    assert zones_of(plan).count == 4


def test_directions_are_zones_of_their_own():
    plan = drawn(CROSSING)
    assert zoned(plan, "directed", EAST) == "##a##\n##a##\ncc+ee\n##g##"
    assert zoned(plan, "directed", SOUTH) == zoned(plan, "directed", EAST)
    assert zoned(plan, "directed", WEST) == "##b##\n##b##\ndd+ff\n##h##"
    assert zoned(plan, "directed", NORTH) == zoned(plan, "directed", WEST)
    assert zones_of(plan, "directed").count == 8


def test_intersections_come_after_the_segments():
    plan = drawn(CROSSING)
    assert zoned(plan, "with-intersections") == "##a##\n##a##\nbbecc\n##d##"
    assert zones_of(plan, "with-intersections").count == 5


def test_a_corner_divides_and_a_dead_end_belongs_to_its_segment():
    plan = drawn("""
....
.##.
.###
""")
    assert zoned(plan) == "+aa+\nb##c\nb###"


def test_a_lone_cell_is_a_segment():
    assert zoned(drawn(".#.\n###\n..#")) == "a#b\n###\ncc#"


def test_open_floor_is_intersections_alone():
    plan = drawn("...\n...")
    assert zoned(plan) == "+++\n+++"
    assert zones_of(plan).count == 0
    assert zones_of(plan, "with-intersections").count == 6


def test_one_way_cells_connect_as_far_as_their_arrows_lead():
    # The right neighbour of > is entered from it; nothing leads between the two at the end.
    assert zoned(drawn(".>.<#")) == "aaaa#"
    assert zoned(drawn(".<>.")) == "aabb"


def test_tabletop_alleys_are_segments_between_turntables():
    plan = Tabletop(tables=2, positions=3).build()
    assert zoned(plan) == "+a+b+#\nc#d#e#\nc#d#e#\nc#d#e#\n+f+g+#"


def test_arrays_are_read_only_and_shared():
    plan = drawn(CROSSING)
    zones = zones_of(plan)
    assert zones is zones_of(drawn(CROSSING))
    assert not zones.of.flags.writeable and zones.of.dtype == np.int32
    assert not zones.intersection.flags.writeable
    with pytest.raises(ValueError, match="there are undirected, directed"):
        zones_of(plan, "lanes")


def links_of(plan):
    """For each drivable cell its neighbours, horizontal and vertical, by walking over the exits."""
    links = {}
    for y in range(plan.height):
        for x in range(plan.width):
            for direction, (dx, dy) in enumerate(STEPS):
                if plan.exits[y + 1, x + 1] >> direction & 1:
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
    plan = draw_floor("\n".join(rows))
    zones, links = zones_of(plan), links_of(plan)
    for y in range(plan.height):
        for x in range(plan.width):
            cell = plan.cell(x, y)
            across, down = links.get((x, y), ([], []))
            assert zones.intersection[cell] == bool(across and down)
            drivable = bool(plan.drivable().flat[cell])
            assert (zones.of[cell, 0] != NIL) == (drivable and not zones.intersection[cell])
            for there in (*across, *down):
                other = plan.cell(*there)
                same = zones.of[cell, 0] == zones.of[other, 0] != NIL
                assert same == (not zones.intersection[cell] and not zones.intersection[other])
    used = np.unique(zones.of[zones.of != NIL])
    assert used.tolist() == list(range(zones.count))


@pytest.mark.parametrize("mode", MODES)
def test_every_zone_has_a_cell(mode):
    zones = zones_of(drawn(CROSSING), mode)
    assert np.unique(zones.of[zones.of != NIL]).tolist() == list(range(zones.count))
