"""Charging counts as work: what is missing in a robot's battery is time that its zone has not."""

from automaton.strategy.kernels import kernel
from automaton.world.condition import FULL
from automaton.world.state import NIL
from automaton.zoning.space import SPEED


@kernel
def charging_minutes(view, rules, zone):
    """Minutes that the server of a zone needs at a charger until its battery is full; 0 without one."""
    server = view.zoning.server[zone]
    if view.rules.battery == 0 or server == NIL:
        return 0.0
    charge = int(view.robots.charge[view.robots.at_index[server]])
    ticks = 0
    while charge < FULL:
        step = 0
        while step + 1 < view.rules.curve.shape[0] and view.rules.curve[step + 1, 0] <= charge:
            step += 1
        # As far as this piece of the curve goes.
        end = FULL if step + 1 == view.rules.curve.shape[0] else view.rules.curve[step + 1, 0]
        rate = max(1, view.rules.curve[step, 1])
        needed = (end - charge + rate - 1) // rate
        ticks += needed
        charge += needed * rate
    return ticks / (rules[SPEED] * view.rules.duration[0, 1])


@kernel
def add_charging(view, load, rules):
    """Add the minutes of charging to the loads of all zones."""
    if view.rules.battery:
        for zone in range(load.shape[0]):
            load[zone] += charging_minutes(view, rules, zone)
