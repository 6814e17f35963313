"""Zones of one central computer: watched, shared when out of balance, and perhaps redesigned.

Keith & La's modes: the balance SVp of the zones on the flow of the last minutes is looked at every
minute, every third minute when it has been good for a while. Out of balance, robots share orders from
time to time; out of balance for long, new zones are made from the flow of that moment, and take effect
when a computer would be done with them. All that waits is queued again then.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final, cast

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL, Batch, Decisions, Memory, Workspace, World
from automaton.strategy.layer import Strategy, memory_of
from automaton.units import SECONDS_PER_UNIT
from strategies.zoning.annealing.annealing import (
    ANNEALING_STEPS,
    DEFAULT_FINAL_TEMPERATURE,
    DEFAULT_INITIAL_TEMPERATURE,
    first_zones,
)
from strategies.zoning.design.part_routing import ROUTING_CENTRAL
from strategies.zoning.design.transfer_stations import find_transfers
from strategies.zoning.design.zone_load import balance, find_loads
from strategies.zoning.design.zone_paths import copy_design
from strategies.zoning.design.zone_workspace import INF_COST, ZoneSpace
from strategies.zoning.queues.charging_load import add_charging
from strategies.zoning.queues.initial_zones import no_first_zones
from strategies.zoning.queues.reassignment import reassign_orders, set_zone_move_time_factors
from strategies.zoning.queues.zone_queues import queue_orders, record_flow, share, take_over
from strategies.zoning.queues.zone_units import rules_of_zones, ticks
from strategies.zoning.zoning_parameters import Monitoring

FIRST_LOOK: Final = 30.0  # seconds after the start
AFTER_REPAIR: Final = 60.0  # and after a redesign

# memory.per_robot, in the row of robot 0
REDESIGNS: Final = 0
SHARED: Final = 1
BALANCED: Final = 2  # ticks between two looks, the first of which found the zones balanced
WATCHED: Final = 3  # ticks between looks

# memory.shared; ticks, 0 where there is none
BEGUN: Final = 0
NEXT_LOOK: Final = 1
LAST_LOOK: Final = 2
WAS_GOOD: Final = 3  # what the last look found: 1 balanced, 0 not, NIL no flow
GOOD_SINCE: Final = 4
BAD_SINCE: Final = 5  # the look that found them out of balance
NEXT_SHARE: Final = 6
NEW_ZONES_AT: Final = 7
FLOW: Final = 8  # the flow of which they are made


class MonitoredZones(Strategy):
    """Zones that stay; robots may share orders when they are out of balance."""

    layer = "zoning"
    Parameters = Monitoring
    parameters: Any
    counters: ClassVar = {
        "redesigns": REDESIGNS,
        "shared_orders": SHARED,
        "ticks_in_balance": BALANCED,
        "ticks_watched": WATCHED,
    }

    def reset(self, view: World) -> Memory:
        """What is counted, when something is due next, and the flow for a redesign."""
        stations = len(view.service_zones.roads.point)
        self._rules = rules_of_zones(view, self.parameters.adjacency)
        self._flow = np.zeros((stations, stations))
        self._everywhere = np.ones(len(view.service_zones.server), np.uint8)
        allocation = getattr(self.other_layers.get("allocation"), "parameters", None)
        self._age = round(1000 * getattr(allocation, "age", 0.5))
        self._job = round(1000 * getattr(allocation, "job", 10.0))
        return memory_of(view, per_robot=4, shared=FLOW + stations * stations)

    def decide(
        self, view: World, batch: Batch, decisions: Decisions, memory: Memory, workspace: Workspace
    ) -> None:
        """Queue what is new, look at the balance, share, or bring new zones into effect."""
        out, state = decisions.zoning, memory.shared
        now = int(view.clock[CLOCK_TICK])
        copy_design(view.service_zones.design, out.design)
        set_zone_move_time_factors(view, workspace.zoning)
        if not state[BEGUN]:
            self._begin(view, batch, out, state, workspace)
        else:
            self._apply_redesign(view, out, memory, workspace)
        redesigned = int(out.redesigned[0])
        take_over(view, out)
        queue_orders(view, out.design, workspace.zoning, out, ROUTING_CENTRAL, redesigned)
        reassign_orders(view, out, NIL)
        if now >= state[NEXT_LOOK]:
            self._check_balance(view, out, memory, workspace)
        self._check_redesign(view, state)
        due = state[BAD_SINCE] and not redesigned
        if self.parameters.sharing and due and now >= state[NEXT_SHARE]:
            if self._shares(state):
                memory.per_robot[view.robots.at_index[0], SHARED] += share(
                    view, workspace, out, self._age, self._job
                )
            state[NEXT_SHARE] = now + ticks(view, self.parameters.share_every)
        out.again[: int(batch.count[0])] = max(1, min(self._due(view, state)) - now)

    def _due(self, view: World, state: Any) -> list[int]:
        """The ticks in which something is to be done next."""
        sharing = self.parameters.sharing and state[BAD_SINCE]
        return [int(state[NEXT_LOOK]), *([int(state[NEXT_SHARE])] if sharing else [])]

    def _begin(self, view: World, batch: Batch, out: Any, state: Any, workspace: Workspace) -> None:
        """The first zones: those of the scenario, or annealed on the flow between all stations."""
        if out.design.zone[0] == NIL:
            if not self._anneal_first(view, out.design, workspace):
                raise no_first_zones(view)
        elif not out.design.transfer.any():
            record_flow(view, INF_COST, 1 << 40, self._flow)  # of all orders, known or not
            find_loads(
                view.service_zones.roads, self._rules, self._flow, 0, out.design, workspace.zoning
            )
            find_transfers(
                view.service_zones.roads,
                self._rules,
                out.design,
                workspace.zoning,
                self._everywhere,
            )
        out.redesigned[0] = 1
        for k in range(int(batch.count[0])):
            out.service_zone[k] = view.robots.identity[batch.robot[k]]
        state[BEGUN] = 1
        state[NEXT_LOOK] = int(view.clock[CLOCK_TICK]) + ticks(view, FIRST_LOOK)

    def _anneal_first(self, view: World, design: Any, workspace: Workspace) -> bool:
        """The first zones, where the scenario gives none; False if none are found."""
        given = self.parameters
        return bool(
            first_zones(
                view.service_zones.roads,
                self._rules,
                float(getattr(given, "hot", DEFAULT_INITIAL_TEMPERATURE)),
                float(getattr(given, "cold", DEFAULT_FINAL_TEMPERATURE)),
                int(getattr(given, "steps", ANNEALING_STEPS)),
                0,
                design,
                workspace.zoning,
                self._everywhere,
                view.rules.seed,
                int(view.clock[CLOCK_TICK]),
            )
        )

    def _check_balance(self, view: World, out: Any, memory: Memory, workspace: Workspace) -> None:
        """How balanced the zones are now, and what follows from it."""
        state, now = memory.shared, int(view.clock[CLOCK_TICK])
        row = memory.per_robot[view.robots.at_index[0]]
        if state[LAST_LOOK]:
            row[WATCHED] += now - state[LAST_LOOK]
            row[BALANCED] += (now - state[LAST_LOOK]) * (state[WAS_GOOD] == 1)
        flows = record_flow(
            view, ticks(view, SECONDS_PER_UNIT["min"] * self.parameters.window), now, self._flow
        )
        good = NIL
        if flows:
            zones = cast(ZoneSpace, workspace.zoning)
            find_loads(view.service_zones.roads, self._rules, self._flow, 0, out.design, zones)
            add_charging(view, zones, self._rules)
            value = balance(zones.load)
            if len(zones.load) > 1:  # one zone is out of balance with no robot
                good = int(0.0 < value <= self.parameters.tolerance)
        state[LAST_LOOK], state[WAS_GOOD] = now, good
        often = ticks(view, self.parameters.often)
        state[NEXT_LOOK] = now + often
        if good == 1:
            state[BAD_SINCE] = 0
            state[GOOD_SINCE] = state[GOOD_SINCE] or now
            if now - state[GOOD_SINCE] >= ticks(
                view, SECONDS_PER_UNIT["min"] * self.parameters.calm
            ):
                state[NEXT_LOOK] = now + ticks(view, self.parameters.seldom)
        elif good == 0:
            state[GOOD_SINCE] = 0
            if not state[BAD_SINCE]:
                state[BAD_SINCE], state[NEXT_SHARE] = now, now

    def _check_redesign(self, view: World, state: Any) -> None:
        """Called after every look, and when `_due` says: are new zones needed? Here never."""

    def _shares(self, state: Any) -> bool:
        """Whether orders are shared at a time of sharing; here always."""
        return True

    def _apply_redesign(self, view: World, out: Any, memory: Memory, workspace: Workspace) -> None:
        """Called in every tick but the first, before orders are queued; here nothing, zones stay."""
