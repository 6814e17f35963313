"""The zones with which a run begins, where the scenario gives none."""

from __future__ import annotations

import numpy as np

from automaton.errors import InputError
from automaton.units import count
from automaton.world.state import TICK, Array, World
from automaton.zoning.annealing import COLD, HOT, STEPS, first_zones
from automaton.zoning.space import design_for, space_for
from strategies.zoning.able import heed_servers


def no_first_zones(view: World) -> InputError:
    """What is said when none are found."""
    return InputError(
        f"zoning found no zones for {count(len(view.zoning.server), 'robot')} on this floor; "
        "strategy.zoning.design gives them, and fewer robots or more groups are easier"
    )


def check_first_zones(view: World, rules: Array) -> None:
    """Find them as a compiled strategy will, which could not say that there are none.

    rules: (RULES,) float64, as the strategy has them. Raises InputError.
    """
    roads, zones = view.zoning.roads, len(view.zoning.server)
    space = space_for(roads, zones).replaced(
        serves=view.zoning.serves.copy(), first=view.zoning.first.copy()
    )
    heed_servers(view, space)
    everywhere = np.ones(zones, np.uint8)
    tick = int(view.clock[TICK]) + 1  # in which it will look for them, and draw the same
    found = first_zones(
        roads, rules, HOT, COLD, STEPS, design_for(roads, zones), space, everywhere,
        view.rules.seed, tick,
    )  # fmt: skip
    if not found:
        raise no_first_zones(view)
