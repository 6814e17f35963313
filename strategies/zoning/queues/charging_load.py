"""Charging counts as work: what is missing in a robot's battery is time that its zone has not."""

import numpy as np

from automaton.engine.robot_states import BATTERY_FULL
from automaton.engine.state import ACTION_MOVE, NIL
from automaton.strategy.kernels import charging_ticks, kernel


@kernel
def charging_minutes(view, rules, i):
    """Minutes that robot i needs at a charger until its battery is full; 0 without batteries."""
    if view.rules.battery == 0:
        return 0.0
    curve = view.rules.curve[view.robots.type[i]]
    ticks = charging_ticks(curve, np.int64(view.robots.charge[i]), BATTERY_FULL)
    return ticks / (rules.speed * view.rules.duration[view.rules.loaded_types, ACTION_MOVE])


@kernel
def add_charging(view, workspace, rules):
    """Add the minutes that the server of each zone charges to the zone's workspace.load."""
    for zone in range(workspace.load.shape[0]):
        server = view.service_zones.server[zone]
        if server != NIL:
            workspace.load[zone] += charging_minutes(
                view, rules, np.int64(view.robots.at_index[server])
            )
