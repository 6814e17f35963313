"""Zones of one central computer: monitored, shared when out of balance, and optionally redesigned.

Keith & La's modes: the balance SVp of the zones for the flow of the last minutes is measured every
minute, or every third minute after a time of balance. Out of balance, robots share orders periodically.
After a long imbalance, simulated annealing or a genetic algorithm makes new zones from the current
flow. They take effect after the time that a computer would need, and all waiting orders are queued
again.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Final

import numpy as np

from automaton.strategy.api import (
    CONSTANT,
    NIL,
    SCRATCH,
    Array,
    Batch,
    Decisions,
    InputError,
    Memory,
    Strategy,
    Struct,
    Workspace,
    World,
    design_for,
    field,
)
from automaton.units import count
from strategies.zoning.annealing import MAX_REPAIRS, first_zones, repair
from strategies.zoning.genetic import ZonePopulation, evolve, population_for
from strategies.zoning.loads_and_transfers import (
    ROUTING_CENTRAL,
    balance,
    find_loads,
    find_transfers,
)
from strategies.zoning.zone_queues import (
    add_charging,
    order_weights,
    queue_orders,
    reassign_orders,
    record_flow,
    rules_of_zones,
    set_zone_move_time_factors,
    share,
    take_over,
    ticks,
    ticks_of_minutes,
)
from strategies.zoning.zone_workspace import ZoneRules, ZoneSpace, copy_design, space_for
from strategies.zoning.zoning_parameters import Annealing, Genetic, Monitoring

FIRST_LOOK: Final = 30.0  # seconds after the start
AFTER_REPAIR: Final = 60.0  # and after a redesign
EVER: Final = 1 << 40  # ticks: longer than any run
# Annealing parameters of the first zones if the scenario has none.
PUBLISHED_ANNEALING: Final = Annealing()
INITIAL_TEMPERATURE: Final = PUBLISHED_ANNEALING.hot
FINAL_TEMPERATURE: Final = PUBLISHED_ANNEALING.cold
ANNEALING_STEPS: Final = PUBLISHED_ANNEALING.steps


class MonitoredState(Struct):
    """Counters, times of the next actions, and the flow for a redesign."""

    # Counted in the row of robot 0:
    redesigns: Array = field("(n,) int64")
    shared_orders: Array = field("(n,) int64")
    ticks_in_balance: Array = field("(n,) int64", "ticks between measurements, from one in balance")
    ticks_watched: Array = field("(n,) int64", "ticks between measurements")
    # Ticks; 0: none:
    begun: int = field("() int64", "1: the first zones exist")
    next_look: int = field("() int64")
    last_look: int = field("() int64")
    was_good: int = field("() int64", "the last measurement: 1 balanced, 0 not, NIL without flow")
    good_since: int = field("() int64")
    bad_since: int = field("() int64", "tick of the first measurement out of balance")
    next_share: int = field("() int64")
    new_zones_at: int = field("() int64")
    flow: Array = field("(k, k) int64", "between stations, for a redesign")
    recent_flow: Array = field("(k, k) float64", "between stations, as measured", role=SCRATCH)
    rules: ZoneRules
    age: int = field("int64", "weights of shared orders, in thousandths")
    job: int = field("int64")
    zones: ZoneSpace


class MonitoredZones(Strategy):
    """Zones that stay; robots may share orders while the zones are out of balance."""

    layer = "zoning"
    Parameters = Monitoring
    parameters: Any
    counters: ClassVar = {
        name: name for name in ("redesigns", "shared_orders", "ticks_in_balance", "ticks_watched")
    }

    def reset(self, view: World) -> Struct:
        """Return the state at the start of a run, in which the first zones are due."""
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
        """Queue new orders, measure the balance, share orders, or switch to new zones."""
        out, state = decisions.zoning, MonitoredState.of(memory)
        now = int(view.clock.tick)
        copy_design(view.service_zones.design, out.design)
        state.zones.reach[:] = 1
        set_zone_move_time_factors(view, state.zones)
        if not state.begun:
            self._begin(view, batch, out, state)
        else:
            self._apply_redesign(view, out, state)
        redesigned = int(out.redesigned)
        take_over(view, out)
        queue_orders(view, out.design, state.zones, out, ROUTING_CENTRAL, redesigned)
        reassign_orders(view, out, NIL)
        if now >= state.next_look:
            self._check_balance(view, out, state)
        self._check_redesign(view, state)
        due = state.bad_since and not redesigned
        if self.parameters.sharing and due and now >= state.next_share:
            if self._shares(state):
                shared = share(view, workspace, out, state.age, state.job)
                state.shared_orders[view.robots.at_index[0]] += shared
            state.next_share = now + ticks(view, self.parameters.share_every)
        out.again[: int(batch.count)] = max(1, min(self._due(view, state)) - now)

    def _due(self, view: World, state: MonitoredState) -> list[int]:
        """The ticks of the next actions."""
        sharing = self.parameters.sharing and state.bad_since
        return [int(state.next_look), *([int(state.next_share)] if sharing else [])]

    def _begin(self, view: World, batch: Batch, out: Any, state: MonitoredState) -> None:
        """The first zones: those of the scenario, or annealed on the flow between all stations."""
        if out.design.zone[0] == NIL:
            if not self._anneal_first(view, out.design, state):
                raise no_first_zones(view)
        elif not out.design.transfer.any():
            roads, zones = view.service_zones.roads, state.zones
            record_flow(view, 2 * EVER, EVER, state.recent_flow)  # of all orders, known or not
            find_loads(roads, state.rules, state.recent_flow, 0, out.design, zones)
            find_transfers(roads, state.rules, out.design, zones, zones.reach)
        out.redesigned = 1
        for k in range(int(batch.count)):
            out.service_zone[k] = view.robots.identity[batch.robot[k]]
        state.begun = 1
        state.next_look = int(view.clock.tick) + ticks(view, FIRST_LOOK)

    def _anneal_first(self, view: World, design: Any, state: MonitoredState) -> bool:
        """Make first zones if the scenario has none; return False if none are found."""
        given = self._annealing()
        has_zones = first_zones(
            view.service_zones.roads, state.rules, float(given.hot), float(given.cold), given.steps,
            0, design, state.zones, state.zones.reach, np.uint64(view.rules.seed),
            int(view.clock.tick),
        )  # fmt: skip
        return bool(has_zones)

    def _annealing(self) -> Annealing:
        """The annealing parameters of the first zones; here as published."""
        return PUBLISHED_ANNEALING

    def _check_balance(self, view: World, out: Any, state: MonitoredState) -> None:
        """Measure the balance of the zones, and set the next actions."""
        now, robot = int(view.clock.tick), view.robots.at_index[0]
        if state.last_look:
            passed = now - state.last_look
            state.ticks_watched[robot] += passed
            state.ticks_in_balance[robot] += passed * (state.was_good == 1)
        flow, zones = state.recent_flow, state.zones
        window = ticks_of_minutes(view, self.parameters.window)
        good = NIL
        if record_flow(view, window, now, flow):
            find_loads(view.service_zones.roads, state.rules, flow, 0, out.design, zones)
            add_charging(view, zones, state.rules)
            value = balance(zones.load)
            if len(zones.load) > 1:  # a single zone has no balance
                good = int(0.0 < value <= self.parameters.tolerance)
        state.last_look, state.was_good = now, good
        often = ticks(view, self.parameters.often)
        state.next_look = now + often
        if good == 1:
            state.bad_since = 0
            state.good_since = state.good_since or now
            calm = ticks_of_minutes(view, self.parameters.calm)
            if now - state.good_since >= calm:
                state.next_look = now + ticks(view, self.parameters.seldom)
        elif good == 0:
            state.good_since = 0
            if not state.bad_since:
                state.bad_since, state.next_share = now, now

    def _check_redesign(self, view: World, state: MonitoredState) -> None:
        """Hook after measurements and at times of `_due`: begin a redesign if needed; here never."""

    def _shares(self, state: MonitoredState) -> bool:
        """Whether to share orders at a time of sharing; here always."""
        return True

    def _apply_redesign(self, view: World, out: Any, state: MonitoredState) -> None:
        """Hook in every tick except the first, before orders are queued. Here zones never change."""


class StaticZones(MonitoredZones):
    """Zones that never change; out of balance, robots share orders."""

    Parameters = Monitoring


class RedesignedZones(MonitoredZones, ABC):
    """Zones that are redesigned after a long imbalance."""

    def _check_redesign(self, view: World, state: MonitoredState) -> None:
        """Make new zones from the current flow after an imbalance longer than patience."""
        now = int(view.clock.tick)
        if not state.bad_since or state.new_zones_at:
            return
        if now < self._patience_ends(view, state):
            return
        window = ticks_of_minutes(view, self.parameters.window)
        record_flow(view, window, now, state.recent_flow)
        state.flow[:] = state.recent_flow.astype(np.int64)
        state.new_zones_at = now + max(1, ticks(view, self.parameters.compute))

    def _patience_ends(self, view: World, state: MonitoredState) -> int:
        patience = ticks_of_minutes(view, self.parameters.patience)
        return int(state.bad_since) + patience + 1

    def _due(self, view: World, state: MonitoredState) -> list[int]:
        """As for zones that stay, plus the times when a redesign begins or takes effect."""
        times = super()._due(view, state)
        if state.new_zones_at:
            times.append(int(state.new_zones_at))
        elif state.bad_since:
            times.append(self._patience_ends(view, state))
        return times

    def _shares(self, state: MonitoredState) -> bool:
        """Not during the computation of new zones, if the scenario forbids it."""
        return self.parameters.share_while_computing or not state.new_zones_at

    def _apply_redesign(self, view: World, out: Any, state: MonitoredState) -> None:
        """Switch to new zones, made from the stored flow, when they are due."""
        now = int(view.clock.tick)
        if not state.new_zones_at or now < state.new_zones_at:
            return
        state.recent_flow[:] = state.flow
        if self._design(view, out.design, state):
            out.redesigned = 1
            state.redesigns[view.robots.at_index[0]] += 1
        else:
            copy_design(view.service_zones.design, out.design)
        state.new_zones_at = state.bad_since = 0
        state.next_look = now + ticks(view, AFTER_REPAIR)

    @abstractmethod
    def _design(self, view: World, design: Any, state: Any) -> bool:
        """Make new zones from the recent flow; False if none are found; the design is then invalid."""


class AnnealedZones(RedesignedZones):
    """Zones repaired by simulated annealing (Ho & Liao, modified by Keith & La)."""

    Parameters = Annealing

    def _annealing(self) -> Annealing:
        """The scenario's parameters, for the first zones and all others."""
        parameters: Annealing = self.parameters
        return parameters

    def _design(self, view: World, design: Any, state: Any) -> bool:
        given = self._annealing()
        has_zones = repair(
            view.service_zones.roads, state.rules, state.recent_flow, float(given.hot),
            float(given.cold), given.steps, MAX_REPAIRS, design, state.zones, state.zones.reach,
            np.uint64(view.rules.seed), int(view.clock.tick),
        )  # fmt: skip
        return bool(has_zones)


class GeneticState(MonitoredState):
    """The state of monitored zones, plus scratch of the genetic algorithm."""

    poses: Array = field(
        "(n, 2) int64",
        "by identity: columns and rows of the grid, the reference cells of robots",
        role=CONSTANT,
    )
    population: ZonePopulation


class GeneticZones(RedesignedZones):
    """Zones repaired by a genetic algorithm; each goes to the robot with the nearest reference cell."""

    Parameters = Genetic

    def reset(self, view: World) -> Struct:
        """Add the reference cells and scratch for the population."""
        population = population_for(view.service_zones.roads, self.parameters.population)
        return self._first_state(
            view, GeneticState, poses=self._poses_of(view), population=population
        )

    def _design(self, view: World, design: Any, state: Any) -> bool:
        parameters = self.parameters
        found = evolve(
            view.service_zones.roads, state.rules, state.recent_flow, parameters.generations,
            parameters.selected, float(parameters.mutation), state.population, design, state.zones,
            state.zones.reach, np.uint64(view.rules.seed), int(view.clock.tick),
        )  # fmt: skip
        if found and parameters.matched:
            self._assign_zones(view, design, state.poses)
        return bool(found)

    def _poses_of(self, view: World) -> Array:
        """The reference cells of GeneticState. Raises InputError."""
        given, robots = self.parameters.poses, len(view.service_zones.server)
        if given is None:
            homes = view.robots.home[view.robots.at_index]
            places = np.stack((homes % view.grid.width, homes // view.grid.width), axis=1)
            return places.astype(np.int64)
        if len(given) != robots:
            raise InputError(
                f"strategy.zoning.poses has {count(len(given), 'cell')}, one for each robot; "
                f"there are {robots}"
            )
        return np.array(given) + 1  # the border of the grid

    def _assign_zones(self, view: World, design: Any, poses: Array) -> None:
        """Give each zone to the robot with the nearest reference cell; robots choose in order.

        Robots of a type choose among the zones bred for their type.
        """
        cells = view.service_zones.roads.cell[view.service_zones.roads.point]
        across, down = cells % view.grid.width, cells // view.grid.width
        zones, kinds = len(view.service_zones.server), view.robots.type[view.robots.at_index]
        accessible, has_priority = view.service_zones.accessible, view.service_zones.has_priority
        kinds = kinds % view.rules.loaded_types if view.rules.loaded_types else kinds
        name = np.full(zones, NIL, np.int32)
        for robot in range(zones):
            x, y = poses[robot]
            alike = (accessible == accessible[robot]).all(axis=1)
            alike &= (has_priority == has_priority[robot]).all(axis=1)
            alike &= kinds == kinds[robot]
            free = [zone for zone in range(zones) if name[zone] == NIL and alike[zone]]
            middle = [design.zone == zone for zone in free]
            far = [
                np.hypot(across[mask].mean() - x, down[mask].mean() - y) if mask.any() else np.inf
                for mask in middle
            ]
            name[free[int(np.argmin(far))]] = robot
        design.zone[:] = name[design.zone]
        used = int(design.segments)
        design.owner[:used] = name[design.owner[:used]]
        transfer = design.transfer.copy()
        for a in range(zones):
            for b in range(zones):
                design.transfer[name[a], name[b]] = transfer[a, b]


# The zones at the start of a run if the scenario has none.


def space_of(view: World) -> ZoneSpace:
    """Scratch for the zones of a run."""
    zones = view.service_zones
    return space_for(zones.roads, len(zones.server)).replaced(
        serves=zones.accessible, first=zones.has_priority
    )


def try_first_zones(view: World, rules: ZoneRules) -> int:
    """The number of tries that fail before a compiled strategy will find its first zones.

    The strategy cannot report a failure itself, and with this number it skips the failing tries.
    Raises InputError.
    """
    roads, zones = view.service_zones.roads, len(view.service_zones.server)
    workspace = space_of(view)
    set_zone_move_time_factors(view, workspace)
    everywhere = np.ones(zones, np.uint8)
    design = design_for(roads, zones)
    found = first_zones(
        roads, rules, INITIAL_TEMPERATURE, FINAL_TEMPERATURE, ANNEALING_STEPS, 0, design,
        workspace, everywhere, view.rules.seed, 0,
    )  # fmt: skip
    if not found:
        raise no_first_zones(view)
    return int(found) - 1


def no_first_zones(view: World) -> InputError:
    """The error message if no zones are found."""
    return InputError(
        f"zoning found no zones for {count(len(view.service_zones.server), 'robot')} on this floor; "
        "set strategy.zoning.design, or use fewer robots or more groups"
    )
