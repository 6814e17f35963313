"""Zones of one central computer: watched, shared when out of balance, and perhaps redesigned.

Keith & La's modes: the balance SVp of the zones on the flow of the last minutes is looked at every
minute, every third minute when it has been good for a while. Out of balance, robots share orders from
time to time; out of balance for long, new zones are made from the flow of that moment, and take effect
when a computer would be done with them. All that waits is queued again then.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final

import numpy as np

from automaton.engine.jit.structs import SCRATCH, Struct, field
from automaton.engine.state import (
    CLOCK_TICK,
    NIL,
    Array,
    Batch,
    Decisions,
    Memory,
    Workspace,
    World,
)
from automaton.strategy.layer import Strategy
from automaton.units import SECONDS_PER_UNIT
from strategies.zoning.annealing.annealing import first_zones
from strategies.zoning.design.part_routing import ROUTING_CENTRAL
from strategies.zoning.design.transfer_stations import find_transfers
from strategies.zoning.design.zone_load import balance, find_loads
from strategies.zoning.design.zone_paths import copy_design
from strategies.zoning.design.zone_workspace import INF_COST, ZoneRules, ZoneSpace
from strategies.zoning.queues.charging_load import add_charging
from strategies.zoning.queues.initial_zones import PUBLISHED, no_first_zones, space_of
from strategies.zoning.queues.reassignment import reassign_orders, set_zone_move_time_factors
from strategies.zoning.queues.zone_queues import queue_orders, record_flow, share, take_over
from strategies.zoning.queues.zone_units import order_weights, rules_of_zones, ticks
from strategies.zoning.zoning_parameters import Annealing, Monitoring

FIRST_LOOK: Final = 30.0  # seconds after the start
AFTER_REPAIR: Final = 60.0  # and after a redesign


class MonitoredState(Struct):
    """What is counted, when something is due next, and the flow for a redesign."""

    # Counted in the row of robot 0:
    redesigns: Array = field("(n,) int64")
    shared_orders: Array = field("(n,) int64")
    ticks_in_balance: Array = field(
        "(n,) int64", "between two looks, the first of which saw the zones balanced"
    )
    ticks_watched: Array = field("(n,) int64", "between looks")
    # Ticks, 0 where there is none:
    begun: Array = field("(1,) int64", "1: the first zones are made")
    next_look: Array = field("(1,) int64")
    last_look: Array = field("(1,) int64")
    was_good: Array = field("(1,) int64", "the last look: 1 balanced, 0 not, NIL without flow")
    good_since: Array = field("(1,) int64")
    bad_since: Array = field("(1,) int64", "the look that saw them out of balance")
    next_share: Array = field("(1,) int64")
    new_zones_at: Array = field("(1,) int64")
    flow: Array = field("(k, k) int64", "between stations, of which they are made")
    recent_flow: Array = field("(k, k) float64", "that is looked at", role=SCRATCH)
    rules: ZoneRules
    age: int = field("int64", "weights of orders that are shared, in thousandths")
    job: int = field("int64")
    zones: ZoneSpace


class MonitoredZones(Strategy):
    """Zones that stay; robots may share orders when they are out of balance."""

    layer = "zoning"
    Parameters = Monitoring
    parameters: Any
    counters: ClassVar = {
        name: name for name in ("redesigns", "shared_orders", "ticks_in_balance", "ticks_watched")
    }

    def reset(self, view: World) -> Struct:
        """Nothing is counted yet, and the first zones are due."""
        return self._first_state(view, MonitoredState)

    def _first_state(self, view: World, kind: type[MonitoredState], **more: Any) -> Struct:
        return kind.sized(
            {"n": len(view.robots.cell), "k": len(view.service_zones.roads.point)},
            rules=rules_of_zones(view, self.parameters.adjacency, self._annealing().tip_pairs),
            **order_weights(self.other_layers.get("allocation")),
            zones=space_of(view),
            **more,
        )

    def decide(
        self, view: World, batch: Batch, decisions: Decisions, memory: Memory, workspace: Workspace
    ) -> None:
        """Queue what is new, look at the balance, share, or bring new zones into effect."""
        out, state = decisions.zoning, MonitoredState.of(memory)
        now = int(view.clock[CLOCK_TICK])
        copy_design(view.service_zones.design, out.design)
        state.zones.reach[:] = 1
        set_zone_move_time_factors(view, state.zones)
        if not state.begun[0]:
            self._begin(view, batch, out, state)
        else:
            self._apply_redesign(view, out, state)
        redesigned = int(out.redesigned[0])
        take_over(view, out)
        queue_orders(view, out.design, state.zones, out, ROUTING_CENTRAL, redesigned)
        reassign_orders(view, out, NIL)
        if now >= state.next_look[0]:
            self._check_balance(view, out, state)
        self._check_redesign(view, state)
        due = state.bad_since[0] and not redesigned
        if self.parameters.sharing and due and now >= state.next_share[0]:
            if self._shares(state):
                state.shared_orders[view.robots.at_index[0]] += share(
                    view, workspace, out, state.age, state.job
                )
            state.next_share[0] = now + ticks(view, self.parameters.share_every)
        out.again[: int(batch.count[0])] = max(1, min(self._due(view, state)) - now)

    def _due(self, view: World, state: MonitoredState) -> list[int]:
        """The ticks in which something is to be done next."""
        sharing = self.parameters.sharing and state.bad_since[0]
        return [int(state.next_look[0]), *([int(state.next_share[0])] if sharing else [])]

    def _begin(self, view: World, batch: Batch, out: Any, state: MonitoredState) -> None:
        """The first zones: those of the scenario, or annealed on the flow between all stations."""
        if out.design.zone[0] == NIL:
            if not self._anneal_first(view, out.design, state):
                raise no_first_zones(view)
        elif not out.design.transfer.any():
            roads, zones = view.service_zones.roads, state.zones
            record_flow(view, INF_COST, 1 << 40, state.recent_flow)  # of all orders, known or not
            find_loads(roads, state.rules, state.recent_flow, 0, out.design, zones)
            find_transfers(roads, state.rules, out.design, zones, zones.reach)
        out.redesigned[0] = 1
        for k in range(int(batch.count[0])):
            out.service_zone[k] = view.robots.identity[batch.robot[k]]
        state.begun[0] = 1
        state.next_look[0] = int(view.clock[CLOCK_TICK]) + ticks(view, FIRST_LOOK)

    def _anneal_first(self, view: World, design: Any, state: MonitoredState) -> bool:
        """The first zones, where the scenario gives none; False if none are found."""
        given = self._annealing()
        return bool(
            first_zones(
                view.service_zones.roads,
                state.rules,
                float(given.hot),
                float(given.cold),
                given.steps,
                0,
                design,
                state.zones,
                state.zones.reach,
                np.uint64(view.rules.seed),
                int(view.clock[CLOCK_TICK]),
            )
        )

    def _annealing(self) -> Annealing:
        """How the first zones are annealed; here as published."""
        return PUBLISHED

    def _check_balance(self, view: World, out: Any, state: MonitoredState) -> None:
        """How balanced the zones are now, and what follows from it."""
        now, robot = int(view.clock[CLOCK_TICK]), view.robots.at_index[0]
        if state.last_look[0]:
            passed = now - state.last_look[0]
            state.ticks_watched[robot] += passed
            state.ticks_in_balance[robot] += passed * (state.was_good[0] == 1)
        flow, zones = state.recent_flow, state.zones
        window = ticks(view, SECONDS_PER_UNIT["min"] * self.parameters.window)
        good = NIL
        if record_flow(view, window, now, flow):
            find_loads(view.service_zones.roads, state.rules, flow, 0, out.design, zones)
            add_charging(view, zones, state.rules)
            value = balance(zones.load)
            if len(zones.load) > 1:  # one zone is out of balance with no robot
                good = int(0.0 < value <= self.parameters.tolerance)
        state.last_look[0], state.was_good[0] = now, good
        often = ticks(view, self.parameters.often)
        state.next_look[0] = now + often
        if good == 1:
            state.bad_since[0] = 0
            state.good_since[0] = state.good_since[0] or now
            if now - state.good_since[0] >= ticks(
                view, SECONDS_PER_UNIT["min"] * self.parameters.calm
            ):
                state.next_look[0] = now + ticks(view, self.parameters.seldom)
        elif good == 0:
            state.good_since[0] = 0
            if not state.bad_since[0]:
                state.bad_since[0], state.next_share[0] = now, now

    def _check_redesign(self, view: World, state: MonitoredState) -> None:
        """Called after every look, and when `_due` says: are new zones needed? Here never."""

    def _shares(self, state: MonitoredState) -> bool:
        """Whether orders are shared at a time of sharing; here always."""
        return True

    def _apply_redesign(self, view: World, out: Any, state: MonitoredState) -> None:
        """Called in every tick but the first, before orders are queued; here nothing, zones stay."""
