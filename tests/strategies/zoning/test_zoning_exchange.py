"""Tips, and stations that change zones."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from zoning_scenes import (
    check_partition,
    drawn,
    everyone,
    factory,
    factory_rules,
    scratch,
    segments,
    shipped,
    stations,
    transfers,
)

from automaton.engine.facilities import Design
from strategies.zoning.design_files import design_arrays, read_design
from strategies.zoning.designs import give, random_design, remove
from strategies.zoning.loads_and_transfers import find_tips, find_transfers
from strategies.zoning.zone_workspace import copy_design, zone_rules

# Figure 2: zone 1 has WS2 at H, WS4 at O and WS5 at R (here 1, 2, 3); zone 2 has WS6 (here 4).
FIGURE_2 = """
    1....####
    ####.####
    ####...2.4
    ####.####
    ####....3
"""
NO_LIMIT = float("inf")  # limits are floats, as in the rules of zones
H, INNER, N, WS4, S, R = (0, 0), (4, 0), (4, 2), (7, 2), (4, 4), (8, 4)


def figure_2():
    floor_plan, roads = drawn(FIGURE_2)
    paths = [[list(p) for p in (H, INNER, N, WS4)], [list(p) for p in (WS4, N, S, R)]]
    zones = [{"stations": [1, 2, 3], "segments": paths}, {"stations": [4]}]
    return floor_plan, roads, read_design(floor_plan, roads, {"zones": zones})


def tips(roads, design: Design) -> set[int]:
    workspace = scratch(roads, len(design.transfer))
    find_tips(roads, design, workspace)
    return set((np.flatnonzero(workspace.tip) + 1).tolist())


def test_in_figure_2_all_stations_are_tips() -> None:
    _, roads, design = figure_2()
    assert tips(roads, design) == {1, 2, 3, 4}


def test_removing_ws4_of_figure_2_merges_its_segments() -> None:
    floor_plan, roads, design = figure_2()
    assert remove(roads, design, scratch(roads, 2), 1, 1)
    assert segments(floor_plan, roads, design, 0) == [[H, INNER, N, S, R]]


def test_the_receiver_fetches_ws4_by_its_own_path() -> None:
    floor_plan, roads, design = figure_2()
    assert give(roads, design, scratch(roads, 2), 1, 3, NO_LIMIT, 2)
    check_partition(roads, design)
    assert stations(design) == [{1, 3}, {2, 4}]
    assert segments(floor_plan, roads, design, 1) == [[(9, 2), WS4]]


def test_the_busier_zone_has_the_transfer_station_of_figure_2() -> None:
    for loads, station in (((2.0, 1.0), 2), ((1.0, 2.0), 4)):
        _, roads, design = figure_2()
        workspace = scratch(roads, 2)
        workspace.load[:] = loads
        find_transfers(roads, zone_rules(10, adjacent=6), design, workspace, everyone(2))
        assert transfers(design, 0, 1) == {station}


def test_a_zone_keeps_its_last_two_stations() -> None:
    _, roads, design = figure_2()
    workspace = scratch(roads, 2)
    assert give(roads, design, workspace, 1, 3, NO_LIMIT, 2)
    assert not give(roads, design, workspace, 0, 3, NO_LIMIT, 2)


def test_a_path_that_is_too_long_is_refused() -> None:
    for limit, done in ((2.0, 1), (1.0, 0)):
        _, roads, design = figure_2()
        assert give(roads, design, scratch(roads, 2), 1, 3, limit, 2) == done


def test_what_cannot_be_joined_anew_is_refused() -> None:
    floor_plan, roads = drawn("1..2..3\n###.###\n###4###")
    design = read_design(floor_plan, roads, {"zones": [{"stations": [1, 2, 3]}, {"stations": [4]}]})
    assert not give(roads, design, scratch(roads, 2), 1, 3, NO_LIMIT, 1)


def test_the_station_of_a_zone_of_one_is_in_the_way() -> None:
    floor_plan, roads = drawn("1..2..3\n.#####.\n.......")
    design = read_design(floor_plan, roads, {"zones": [{"stations": [1, 3]}, {"stations": [2]}]})
    assert segments(floor_plan, roads, design, 0) == [[(0, 0), (0, 2), (6, 2), (6, 0)]]


def test_the_tips_of_the_logged_design() -> None:
    _, _, roads = factory()
    assert {*range(1, 19)} - tips(roads, shipped("factory-logged")) == {1, 7, 10, 12, 14}


@given(
    st.integers(0, 2**32),
    st.integers(2, 6),
    st.lists(st.tuples(st.integers(0, 17), st.integers(0, 17))),
)
def test_giving_keeps_a_partition(seed: int, zones: int, gifts: list[tuple[int, int]]) -> None:
    _, _, roads = factory()
    workspace = scratch(roads, zones)
    design, tried = design_arrays(roads, zones), design_arrays(roads, zones)
    assert random_design(roads, factory_rules(roads), design, workspace, np.uint64(seed), 0)
    check_partition(roads, design)
    for station, through in gifts:
        if design.zone[station] == design.zone[through]:
            continue
        copy_design(design, tried)
        if give(roads, tried, workspace, station, through, 120.0, 1):
            check_partition(roads, tried)
            assert tried.zone[station] == design.zone[through]
            copy_design(tried, design)


@given(st.integers(0, 2**32), st.integers(0, 17))
def test_removing_keeps_the_rest_a_partition(seed: int, station: int) -> None:
    _, _, roads = factory()
    workspace, design = scratch(roads, 3), design_arrays(roads, 3)
    assert random_design(roads, factory_rules(roads), design, workspace, np.uint64(seed), 0)
    before, zone = stations(design), int(design.zone[station])
    if len(before[zone]) > 1 and remove(roads, design, workspace, station, (zone + 1) % 3):
        after = stations(design)
        assert after[zone] == before[zone] - {station + 1}
        assert design.owner[: design.segments].tolist().count(zone) == len(after[zone]) - 1
        for m in range(int(design.segments)):
            assert roads.point[station] not in design.path[m, : design.points[m]]
