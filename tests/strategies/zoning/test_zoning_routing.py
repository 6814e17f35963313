"""Which robot takes a part, and where it drops it: the cases one by one, on the logged design.

Zones: 0 has WS 9 10 7 6 3 15, 1 has WS 2 4 1 5, 2 the others; transfer stations between 0 and 1 are
WS 2 5 4, between 0 and 2 WS 15 9 6 3, between 1 and 2 none.
"""

from __future__ import annotations

import numpy as np
import pytest
from zoning_scenes import drawn, everyone, factory, factory_rules, scratch, shipped, training_flow

from strategies.zoning.design_files import design_arrays
from strategies.zoning.loads_and_transfers import (
    ROUTING_CENTRAL,
    ROUTING_NEIGHBOURS,
    find_loads,
    find_transfers,
    route,
)

DELIVERED = 1
HANDED_ON = 0


def routed(zone: int, at: int, to: int, rule: int = ROUTING_CENTRAL) -> tuple[int, int, int]:
    """Stations as users count them."""
    _, _, roads = factory()
    workspace, rules = scratch(roads, 3), factory_rules(roads)
    design = shipped("factory-logged")
    find_loads(roads, rules, training_flow(), 0, design, workspace)
    find_transfers(roads, rules, design, workspace, everyone(3))
    queue, stop, direct = route(roads, design, workspace, rule, zone, at - 1, to - 1)
    return queue, stop + 1, direct


@pytest.mark.parametrize("rule", [ROUTING_CENTRAL, ROUTING_NEIGHBOURS])
@pytest.mark.parametrize(
    ("story", "zone", "at", "to", "expected"),
    [
        ("the target is in the same zone", 0, 9, 10, (0, 10, DELIVERED)),
        ("the nearest transfer station", 1, 1, 9, (1, 2, HANDED_ON)),
        ("set down there, it is the other robot's", 1, 2, 9, (0, 9, DELIVERED)),
        ("the next station is the transfer station", 0, 3, 2, (0, 2, DELIVERED)),
        ("it waits at a transfer station", 0, 3, 12, (2, 12, DELIVERED)),
        ("fetched by the other robot already", 0, 2, 9, (0, 9, DELIVERED)),
    ],
)
def test_zones_with_a_common_transfer_station(
    rule: int, story: str, zone: int, at: int, to: int, expected: tuple[int, int, int]
) -> None:
    assert routed(zone, at, to, rule) == expected, story


def test_through_a_third_zone_by_the_transfer_station_nearest_to_the_part() -> None:
    assert routed(1, 1, 12) == (1, 2, HANDED_ON)
    assert routed(0, 2, 12) == (0, 3, HANDED_ON)
    assert routed(2, 3, 12) == (2, 12, DELIVERED)


def test_in_ddz_by_the_one_nearest_to_the_target() -> None:
    assert routed(1, 1, 12, ROUTING_NEIGHBOURS) == (1, 5, HANDED_ON)


def test_a_part_at_the_way_out_is_the_third_robots_at_once() -> None:
    assert routed(1, 2, 12) == (0, 3, HANDED_ON)


@pytest.fixture
def row():
    """Six stations in a row, each a zone; transfers along the row, and 0-3 by station 0."""
    _, roads = drawn("1.2.3.4.5.6")
    design, workspace = design_arrays(roads, 6), scratch(roads, 6)
    design.zone[:] = range(6)
    for a, b, station in ((0, 1, 1), (1, 2, 2), (2, 3, 3), (3, 4, 4), (0, 3, 3)):
        design.transfer[a, b, station] = design.transfer[b, a, station] = 1
    return roads, design, workspace


def test_the_fewest_transfers_win(row) -> None:
    roads, design, workspace = row
    assert route(roads, design, workspace, ROUTING_CENTRAL, 0, 0, 4) == (0, 3, HANDED_ON)
    assert route(roads, design, workspace, ROUTING_CENTRAL, 0, 0, 2) == (0, 1, HANDED_ON)


def test_of_equal_ways_the_nearer_then_the_lower_station(row) -> None:
    roads, design, workspace = row
    design.transfer[0, 3, 0] = design.transfer[3, 0, 0] = 1
    assert route(roads, design, workspace, ROUTING_CENTRAL, 0, 1, 4) == (0, 0, HANDED_ON)


def test_where_no_transfers_lead_its_own_robot_delivers(row) -> None:
    roads, design, workspace = row
    for rule in (ROUTING_CENTRAL, ROUTING_NEIGHBOURS):
        assert route(roads, design, workspace, rule, 0, 0, 5) == (0, 5, DELIVERED)


def test_every_part_arrives_after_a_few_transfers(row) -> None:
    roads, design, workspace = row
    for rule in (ROUTING_CENTRAL, ROUTING_NEIGHBOURS):
        for start in range(5):
            for to in np.setdiff1d(range(5), [start]).tolist():
                zone, at, direct = start, start, HANDED_ON
                for _ in range(6):
                    zone, at, direct = route(roads, design, workspace, rule, zone, at, to)
                    if direct:
                        break
                assert (at, direct) == (to, DELIVERED)
