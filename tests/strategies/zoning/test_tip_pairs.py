"""Which tip of the zone that takes a tip it is joined to: the last one in reach, or any of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from zoning_scenes import (
    FEET_PER_MINUTE,
    check_partition,
    drawn,
    factory,
    factory_rules,
    scratch,
)
from zoning_trials import ANNEALED, south, turn

from automaton.engine.facilities import Design, Roads
from automaton.engine.state import NIL
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.zoning import annealing
from strategies.zoning.design_files import design_arrays
from strategies.zoning.designs import first_design, give, random_design
from strategies.zoning.loads_and_transfers import find_tips
from strategies.zoning.zone_workspace import (
    block_others,
    copy_design,
    spread,
    typical_distance,
    whole_cells,
    zone_rules,
)

# Floors on which the last tip in reach cannot be joined to, and another one can.
HOOK = """
    .3...#.##
    .#9###.##
    .8....4.1
    ##.###6#7
    ##2###5#.
"""
RING = """
    ..7..#...
    .#5#1###4
    .#.3.6...
    ##.#8#.#.
    9..#..2#.
"""


def annealed(roads: Roads, all_pairs: bool, seed: int) -> tuple[float, Design]:
    """Two zones, annealed on a flow of one load between any two stations: their balance."""
    rules = zone_rules(FEET_PER_MINUTE / 2.5, typical_distance(roads.between), all_pairs=all_pairs)
    design, workspace = design_arrays(roads, 2), scratch(roads, 2)
    flow = 1.0 - np.eye(len(roads.point))
    assert first_design(roads, flow, design, workspace)
    balance = annealing.improve(
        roads, rules, flow, *ANNEALED, design, workspace, np.uint64(seed), 0
    )
    check_partition(roads, design)
    return float(balance), design


@pytest.mark.parametrize(("picture", "last", "any_tip"), [(HOOK, 0.92, 0.22), (RING, 0.66, 0.23)])
def test_zones_that_the_last_tip_leaves_unequal_are_balanced_by_all(
    picture: str, last: float, any_tip: float
) -> None:
    _, roads = drawn(picture)
    for seed in range(4):
        assert annealed(roads, False, seed)[0] == pytest.approx(last, abs=0.01)
        assert annealed(roads, True, seed)[0] < any_tip


def partners(roads: Roads, rules: Any, design: Design, tip: int, zone: int) -> list[int]:
    """The tips of a zone within reach of a tip of another one, by a search of each."""
    workspace = scratch(roads, len(design.transfer))
    find_tips(roads, design, workspace)
    block_others(design, workspace, design.zone[tip], zone)
    spread(roads, workspace, roads.point[tip], NIL, whole_cells(rules.adjacent))
    return [
        t
        for t in range(len(design.zone))
        if design.zone[t] == zone
        and workspace.tip[t]
        and workspace.distance[roads.point[t]] < rules.adjacent
    ]


def can_be_given(roads: Roads, rules: Any, design: Design, tip: int, through: int) -> bool:
    workspace = scratch(roads, len(design.transfer))
    trial = design_arrays(roads, len(design.transfer))
    copy_design(design, trial)
    return bool(
        give(roads, trial, workspace, tip, through, rules.adjacent, annealing.MIN_ZONE_STATIONS)
    )


@given(st.integers(0, 2**32), st.booleans())
def test_a_tip_is_given_if_a_partner_takes_it(seed: int, all_pairs: bool) -> None:
    """Whether it is given, against a try of each partner; each tip has its own scratch there."""
    _, _, roads = factory()
    rules = factory_rules(roads).replaced(all_pairs=int(all_pairs))
    design, workspace = design_arrays(roads, 3), scratch(roads, 3)
    if not random_design(roads, rules, design, workspace, np.uint64(seed), 0):
        return
    annealing.forget_tips(roads, design, workspace)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        if not annealing.facing_tips(roads, rules, design, workspace, a, b):
            continue
        drawn_before = int(workspace.drawn)
        tip = int(annealing.random_tip(workspace, a, b, np.uint64(seed), 0))
        workspace.drawn = drawn_before
        given_away = annealing.give_random_tip(
            roads, rules, design, workspace, a, b, np.uint64(seed), 0
        )
        found = partners(roads, rules, design, tip, b)
        tried = found if all_pairs else found[-1:]
        expected = any(can_be_given(roads, rules, design, tip, t) for t in tried)
        assert bool(given_away) == expected
        if given_away:
            assert workspace.trial.zone[tip] == b
            check_partition(roads, workspace.trial)


def zones_after(scenario: str, *settings: str) -> list[int]:
    simulation = Simulation(resolve(scenario, settings))
    simulation.run(until=9000)
    assert not simulation.world.tally.illegal.sum()
    zones: list[int] = simulation.world.service_zones.design.zone.tolist()
    return zones


def test_a_scenario_chooses_the_pairs() -> None:
    last = zones_after("factory", "strategy.zoning.tip_pairs=last")
    assert zones_after("factory") == last != zones_after("factory", "strategy.zoning.tip_pairs=all")


def test_robots_that_negotiate_try_all_pairs_too() -> None:
    found = []
    for all_pairs in (0, 1):
        scene = south()
        scene["rules"] = scene["rules"].replaced(all_pairs=all_pairs)
        turn(scene, 2, 20.0, seed=3)
        check_partition(scene["roads"], scene["design"])
        found.append(scene["design"].zone.tolist())
    assert found[0] != found[1]
