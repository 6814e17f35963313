"""Loads, balance and transfer stations: the authors' logged numbers, and what each rule does."""

from __future__ import annotations

import numpy as np
import pytest
from zoning_scenes import (
    FEET_PER_MINUTE,
    ddz_rules,
    drawn,
    everyone,
    factory,
    factory_rules,
    scratch,
    shipped,
    training_flow,
    transfers,
)

from automaton.engine.facilities import Design
from strategies.zoning.design_files import design_arrays, read_design
from strategies.zoning.loads_and_transfers import (
    UNDEFINED,
    balance,
    connected,
    find_loads,
    find_transfers,
)
from strategies.zoning.zone_workspace import zone_rules

SVP = 0.02140921364780887
LOADS = [96.25346013022276, 96.44791452906311, 90.38721052754236]


def isolated_pairs(design: Design) -> int:
    """How many pairs of zones have no transfer station."""
    zones = range(len(design.transfer))
    return sum(not design.transfer[a, b].any() for a in zones for b in range(a))


def test_the_balance_of_the_logged_design() -> None:
    _, _, roads = factory()
    workspace = scratch(roads, 3)
    design = shipped("factory-logged")
    svp = find_loads(roads, factory_rules(roads), training_flow(), 0, design, workspace)
    assert svp == pytest.approx(SVP, abs=1e-12)
    assert workspace.load == pytest.approx(LOADS, abs=1e-11)


def test_the_logged_transfer_stations() -> None:
    _, _, roads = factory()
    workspace, rules = scratch(roads, 3), factory_rules(roads)
    design = shipped("factory-logged")
    find_loads(roads, rules, training_flow(), 0, design, workspace)
    find_transfers(roads, rules, design, workspace, everyone(3))
    assert transfers(design, 0, 1) == {2, 5, 4}
    assert transfers(design, 0, 2) == {15, 9, 6, 3}
    assert transfers(design, 1, 2) == set()
    assert isolated_pairs(design) == 1 and connected(design, workspace)
    assert (design.transfer == design.transfer.transpose(1, 0, 2)).all()


def test_in_ddz_connecting_paths_block_nothing_and_are_short() -> None:
    _, _, roads = factory()
    workspace, rules = scratch(roads, 3), ddz_rules()
    design = shipped("factory-ddz")
    find_transfers(roads, rules, design, workspace, everyone(3))
    assert isolated_pairs(design) == 0
    rules = rules.replaced(limit=1)
    find_transfers(roads, rules, design, workspace, everyone(3))
    assert isolated_pairs(design) == 3 and not connected(design, workspace)


def test_zones_out_of_reach_keep_their_transfer_stations() -> None:
    _, _, roads = factory()
    workspace, rules = scratch(roads, 3), ddz_rules()
    design = shipped("factory-ddz")
    design.transfer[0, 2, 9] = design.transfer[2, 0, 9] = 1
    design.transfer[1, 2, 9] = design.transfer[2, 1, 9] = 1  # WS10 is in neither zone
    find_transfers(roads, rules, design, workspace, np.array([1, 1, 0], np.uint8))
    assert transfers(design, 0, 2) == {10} and transfers(design, 1, 2) == set()
    assert transfers(design, 0, 1)


def test_all_stations_as_one_zone_ask_for_three() -> None:
    """Phase 1 of Ho & Liao: load / (8 h less 2 h) zones, 2.672 on the training set."""
    _, _, roads = factory()
    design, workspace = design_arrays(roads, 1), scratch(roads, 1)
    design.zone[:] = 0
    rules = zone_rules(FEET_PER_MINUTE / 2.5, adjacent=1, base=0)
    find_loads(roads, rules, training_flow(), 0, design, workspace)
    assert round(float(workspace.load[0]) / 360, 3) == 2.672


LINE = "1...2...3"


def loads_on_the_line(flow: dict[tuple[int, int], float], through: int, base: float = 0) -> float:
    floor_plan, roads = drawn(LINE)
    workspace = scratch(roads, 1)
    design = read_design(floor_plan, roads, {"zones": [{"stations": [1, 2, 3]}]})
    table = np.zeros((3, 3))
    for pair, value in flow.items():
        table[pair] = value
    rules = zone_rules(4, adjacent=9, base=base, handling=1)
    find_loads(roads, rules, table, through, design, workspace)
    return float(workspace.load[0])


def test_a_load_counts_loaded_and_empty_trips_and_handling() -> None:
    # Two loads over 4 cells; back empty: inflow 2 of station 2 times outflow 2 of station 1 over 2.
    assert loads_on_the_line({(0, 1): 2}, 0) == (2 * 4 + 2 * 4) / 4 + 2


def test_a_zone_without_flow_has_its_base_to_handle() -> None:
    assert loads_on_the_line({}, 0) == 0 and loads_on_the_line({}, 0, base=1) == 1


def test_what_drives_past_a_tip_counts_as_its_own() -> None:
    # From 1 to 3 past 2. The tip 1 is the start of 1-2 and 1-3; station 2 is not a tip.
    assert loads_on_the_line({(0, 2): 2}, 0) == (2 * 8 + 2 * 8) / 4 + 2
    empty = (4 * 2 * 1 + 4 * 2 * 2) / 4  # (inflow 2 at stations 2 and 3) x (outflow 4 of 1) / 4
    assert loads_on_the_line({(0, 2): 2}, 1) == (2 * 4 + 2 * 8) / 4 + 4 + empty * 4 / 4


def test_loads_of_ddz_have_the_transfer_stations() -> None:
    floor_plan, roads = drawn(LINE)
    zones = [{"stations": [1, 2]}, {"stations": [3]}]
    design, workspace = read_design(floor_plan, roads, {"zones": zones}), scratch(roads, 2)
    flow = np.zeros((3, 3))
    flow[1, 2] = 1
    rules = zone_rules(4, adjacent=9, base=0, handling=1, shared=True)
    assert find_loads(roads, rules, flow, 0, design, workspace) == UNDEFINED
    design.transfer[0, 1, 2] = design.transfer[1, 0, 2] = 1
    find_loads(roads, rules, flow, 0, design, workspace)
    assert workspace.load.tolist() == [(4 + 4) / 4 + 1, 0]


def test_balance_is_0_when_loads_are_equal_and_1_when_one_zone_has_it_all() -> None:
    assert balance(np.array([2.0, 2, 2])) == 0
    assert balance(np.array([2.0, 0, 0])) == 1
    assert balance(np.zeros(3)) == UNDEFINED


def test_zones_in_a_chain_are_connected_others_are_not() -> None:
    _, roads = drawn("1.2.3.4")
    design, workspace = design_arrays(roads, 4), scratch(roads, 4)
    design.zone[:] = range(4)
    for a, b in ((0, 1), (1, 2)):
        design.transfer[a, b, a] = design.transfer[b, a, a] = 1
    assert not connected(design, workspace)
    design.transfer[2, 3, 3] = design.transfer[3, 2, 3] = 1
    assert connected(design, workspace) and isolated_pairs(design) == 3
