"""The zones with which a run begins, where the scenario gives none."""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.engine.facilities import design_for
from automaton.engine.state import World
from automaton.errors import InputError
from automaton.units import count
from strategies.zoning.annealing.annealing import first_zones
from strategies.zoning.design.zone_workspace import ZoneRules, ZoneSpace, space_for
from strategies.zoning.queues.reassignment import set_zone_move_time_factors
from strategies.zoning.zoning_parameters import Annealing

# How first zones are annealed where the scenario has no parameters for it.
PUBLISHED: Final = Annealing()
INITIAL_TEMPERATURE: Final = PUBLISHED.hot
FINAL_TEMPERATURE: Final = PUBLISHED.cold
STEPS: Final = PUBLISHED.steps


def no_first_zones(view: World) -> InputError:
    """What is said when none are found."""
    return InputError(
        f"zoning found no zones for {count(len(view.service_zones.server), 'robot')} on this floor; "
        "strategy.zoning.design gives them, and fewer robots or more groups are easier"
    )


def space_of(view: World) -> ZoneSpace:
    """Scratch for the zones of a run."""
    zones = view.service_zones
    return space_for(zones.roads, len(zones.server)).replaced(
        serves=zones.accessible, first=zones.has_priority
    )


def try_first_zones(view: World, rules: ZoneRules) -> int:
    """How many tries fail before those zones are found that a compiled strategy is going to find.

    It could not say that there are none, and need not fail again. Raises InputError.
    """
    roads, zones = view.service_zones.roads, len(view.service_zones.server)
    workspace = space_of(view)
    set_zone_move_time_factors(view, workspace)
    everywhere = np.ones(zones, np.uint8)
    found = first_zones(
        roads, rules, INITIAL_TEMPERATURE, FINAL_TEMPERATURE, STEPS, 0, design_for(roads, zones),
        workspace, everywhere, view.rules.seed, 0,
    )  # fmt: skip
    if not found:
        raise no_first_zones(view)
    return int(found) - 1
