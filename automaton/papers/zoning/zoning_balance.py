"""How balanced the zones of DDZ are, by the measure of SA and GA.

The publication prints a share of time in balance for SA and GA, and "NA" for DDZ, whose robots compare
loads of their own. Here a bystander looks once a minute at the zones that DDZ has made, and computes the
same SVp from the same flow of the last 20 minutes: 0 < SVp <= 0.2 is in balance, as in SA and GA. A look
counts up to the next one. Nothing of a run depends on it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from automaton.engine.state import NIL
from automaton.runs.simulation import Simulation
from automaton.units import SECONDS_PER_UNIT
from strategies.zoning.monitored import space_of
from strategies.zoning.zone_load import find_loads
from strategies.zoning.zone_queues import record_flow, rules_of_zones, ticks

LOOK_S: Final = 60.0
WINDOW_MIN: Final = 20.0
IN_BALANCE: Final = 0.2
ADJACENCY_FT: Final = 243.6437908496732  # of SA and GA; loads depend on neither this nor tip_pairs


def run_watched(simulation: Simulation) -> float:
    """Run to the end; return the share of time in which the zones were in balance."""
    view, limit = simulation.view, simulation.resolved.scenario.stop.max_duration
    rules, workspace = rules_of_zones(view, ADJACENCY_FT, "last"), space_of(view)
    flow = np.zeros((len(view.service_zones.roads.point),) * 2)
    every = ticks(view, LOOK_S)
    window = ticks(view, SECONDS_PER_UNIT["min"] * WINDOW_MIN)
    watched = balanced = 0
    while not simulation.finished and simulation.tick < limit:
        now = simulation.tick
        good = False
        if record_flow(view, window, now, flow) and view.service_zones.design.zone[0] != NIL:
            design = view.service_zones.design
            svp = find_loads(view.service_zones.roads, rules, flow, 0, design, workspace)
            good = 0.0 < svp <= IN_BALANCE
        simulation.run(until=now + every)
        watched += simulation.tick - now
        balanced += good * (simulation.tick - now)
    return balanced / watched if watched else 0.0
