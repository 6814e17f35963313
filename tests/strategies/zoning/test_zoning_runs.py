"""Runs with fixed zones against those of an independent program of the same rules.

That program: 9.54 h and 57,043 ft without sharing, 5.76 h and 48,523 ft with it, and for the zones
and rules of DDZ 7.78 h and 53,931 ft; sigma 36,846, 20,101 and 22,455 ft (means of three runs).
"""

from __future__ import annotations

import numpy as np
import pytest
from reference_factory import Run
from zoning_scenes import (
    ddz_rules,
    everyone,
    factory,
    factory_rules,
    scratch,
    shipped,
    training_flow,
)

from automaton.engine.facilities import Design
from strategies.zoning.loads_and_transfers import (
    ROUTING_CENTRAL,
    ROUTING_NEIGHBOURS,
    find_loads,
    find_transfers,
)


def with_transfers(name: str, rule: int) -> Design:
    _, _, roads = factory()
    design, workspace = shipped(name), scratch(roads, 3)
    rules = factory_rules(roads) if rule == ROUTING_CENTRAL else ddz_rules()
    if rule == ROUTING_CENTRAL:
        find_loads(roads, rules, training_flow(), 0, design, workspace)
    find_transfers(roads, rules, design, workspace, everyone(3))
    return design


@pytest.mark.parametrize(
    ("name", "rule", "sharing", "hours", "feet", "sigma"),
    [
        ("factory-logged", ROUTING_CENTRAL, False, 9.54, 57_043, 36_846),
        ("factory-ddz", ROUTING_NEIGHBOURS, False, 7.78, 53_931, 22_455),
        ("factory-logged", ROUTING_CENTRAL, True, 5.76, 48_523, 20_101),
    ],
)
def test_fixed_zones(
    name: str, rule: int, sharing: bool, hours: float, feet: float, sigma: float
) -> None:
    design = with_transfers(name, rule)
    runs = [Run(design, rule, seed, sharing) for seed in range(4)]
    assert np.mean([run.hours for run in runs]) == pytest.approx(
        hours, rel=0.04 if sharing else 0.015
    )
    assert np.mean([run.feet.mean() for run in runs]) == pytest.approx(feet, rel=0.01)
    assert np.mean([run.feet.std() for run in runs]) == pytest.approx(sigma, rel=0.025)
