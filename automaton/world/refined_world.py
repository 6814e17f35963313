"""A world in finer ticks, from the one in the ticks of its scenario.

What is drawn for a run is drawn in coarse ticks and multiplied, so that all refinements have the same
day: demand, handling times, closings. What the engine draws meanwhile (automaton.engine.random_numbers)
keeps its chances, and the tables that it draws from are multiplied here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from automaton.engine.state import NEVER, NIL, Array, Rules, World
from automaton.scenario.refinement import begin_of
from automaton.world.prepared_floor import Floor, floor_for
from automaton.world.resolve import Resolved
from automaton.world.rules import rules_for


def refined_world(coarse: World, resolved: Resolved) -> tuple[World, Floor]:
    """The world at tick 0 of a refined scenario; `coarse`: that of its scenario as it was read."""
    scenario, factor = resolved.scenario, resolved.scenario.refine
    floor = floor_for(resolved.floor_plan, scenario.world.traffic_zones, resolved.fleet.types)
    orders, lines, stations = coarse.orders, coarse.lines, coarse.stations
    gates, delays, places = coarse.gates, coarse.delays, coarse.pod_stations
    world = coarse.replaced(
        grid=floor.grid,
        rules=_rules(coarse.rules, resolved),
        orders=orders.replaced(
            release_tick=_begins(orders.release_tick, factor), due=_times(orders.due, factor)
        ),
        stops=coarse.stops.replaced(ticks=_times(coarse.stops.ticks, factor)),
        stations=stations.replaced(
            arrival_tick=_begins(stations.arrival_tick, factor),
            processing_time=_times(stations.processing_time, factor),
        ),
        lines=lines.replaced(
            release_tick=_begins(lines.release_tick, factor), due=_times(lines.due, factor)
        ),
        pod_stations=places.replaced(
            ticks_from=_times(places.ticks_from, factor),
            breaks=np.column_stack([places.breaks[:, :1], begin_of(places.breaks[:, 1:], factor)]),
        ),
        gates=gates.replaced(
            closings=begin_of(gates.closings, factor),
            replan_after=factor * gates.replan_after,
            opening_ticks=factor * gates.opening_ticks,
            hold_ticks=factor * gates.hold_ticks,
            travel_ticks=factor * gates.travel_ticks,
            cabin_ticks=_times(gates.cabin_ticks, factor),
        ),
        delays=delays.replaced(ticks=_times(delays.ticks, factor)),
    )
    return world, floor


def _rules(coarse: Rules, resolved: Resolved) -> Rules:
    """The constants of the scenario; chances stay those of a coarse tick, in which they are drawn."""
    factor = resolved.scenario.refine
    fine = rules_for(resolved.scenario, int(coarse.seed), coarse.loaded_types > 0)
    return fine.replaced(
        breakdown=coarse.breakdown,
        repair_in_place=_times(coarse.repair_in_place, factor),
        allocations=coarse.allocations,
        allocation=coarse.allocation,
    )


def _times(ticks: Array, factor: int) -> Array:
    """Ticks in fine ones; NEVER and NIL stay, and nothing is as late as NEVER."""
    return _kept(ticks, factor * ticks.astype(np.int64))


def _begins(ticks: Array, factor: int) -> Array:
    """The same of ticks in which something is to happen."""
    return _kept(ticks, begin_of(ticks.astype(np.int64), factor))


def _kept(ticks: Array, fine: Any) -> Array:
    special = (ticks == NEVER) | (ticks == NIL)
    result: Array = np.where(special, ticks, np.minimum(fine, NEVER - 1)).astype(ticks.dtype)
    return result
