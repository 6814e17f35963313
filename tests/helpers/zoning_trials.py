"""The methods of zoning, each tried on a small flow of parts."""

from __future__ import annotations

from typing import Any

import numpy as np
from zoning_scenes import ddz_rules, everyone, factory, factory_rules, scratch, shipped

from automaton.engine.facilities import Design
from strategies.zoning import annealing, genetic, negotiation
from strategies.zoning.design_files import design_arrays
from strategies.zoning.genetic import population_for
from strategies.zoning.loads_and_transfers import connected, find_transfers
from strategies.zoning.negotiation import NegotiatedParts, lead, parts_for
from strategies.zoning.zoning_parameters import Annealing, Decentralized, Genetic

# What methods take of their parameters, as published.
ANNEALED = (Annealing().hot, Annealing().cold, Annealing().steps)
BRED = (Genetic().selected, Genetic().mutation)


def repaired(flow: Any, zones: int, seed: int) -> tuple[int, Design]:
    _, _, roads = factory()
    design, workspace = design_arrays(roads, zones), scratch(roads, zones)
    rules, reach = factory_rules(roads), everyone(zones)
    done = annealing.repair(
        *(roads, rules, flow, *ANNEALED, annealing.MAX_REPAIRS),
        *(design, workspace, reach, np.uint64(seed), 0),
    )
    return done, design


def evolved(flow: Any, seed: int, generations: int = 12, individuals: int = 30) -> Design:
    _, _, roads = factory()
    design, workspace, herd = (
        design_arrays(roads, 3),
        scratch(roads, 3),
        population_for(roads, individuals),
    )
    rules, reach = factory_rules(roads), everyone(3)
    assert genetic.evolve(
        roads, rules, flow, generations, *BRED, herd, design, workspace, reach, np.uint64(seed), 0
    )
    assert connected(design, workspace)
    return design


def waiting(legs: list[tuple[int, int]]) -> NegotiatedParts:
    """Parts at stations on their way to others, as users count them; nobody has queued them."""
    parts = parts_for(len(legs) + 3)
    parts.count = len(legs)
    for k, (at, to) in enumerate(legs):
        parts.at[k], parts.to[k] = at - 1, to - 1
    return parts


def south() -> dict[str, Any]:
    """The initial design of DDZ with all the parts in the south."""
    _, _, roads = factory()
    workspace, rules, reach = scratch(roads, 3), ddz_rules(), everyone(3)
    design = shipped("factory-ddz")
    find_transfers(roads, rules, design, workspace, reach)
    parts = waiting([(17, 11), (16, 8), (12, 15), (11, 18), (18, 12), (8, 13), (13, 17)] * 3)
    negotiation.requeue(roads, design, workspace, parts, reach)
    negotiation.adopt(parts)
    parts.zone[: parts.count] = 2
    return dict(
        roads=roads, rules=rules, parts=parts, design=design, workspace=workspace, reach=reach
    )


def turn(scene: dict[str, Any], leader: int, mean: float, seed: int) -> float:
    given = Decentralized()
    limits = (given.hot, given.cold, given.turns * given.iterations, given.scale)
    known = (scene["design"], scene["workspace"], leader, scene["reach"], mean, np.uint64(seed), 0)
    before = (
        scene["roads"],
        scene["rules"],
        scene["parts"],
        *limits,
        0,
        given.iterations,
    )
    return float(lead(*before, *known))
