"""Zones that are redesigned: by simulated annealing, or by a genetic algorithm."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from automaton.engine.jit.structs import CONSTANT, Struct, field
from automaton.engine.state import CLOCK_TICK, NIL, Array, World
from automaton.errors import InputError
from automaton.units import SECONDS_PER_UNIT, count
from strategies.zoning.annealing.annealing import MAX_REPAIRS, repair
from strategies.zoning.central.monitored import (
    AFTER_REPAIR,
    MonitoredState,
    MonitoredZones,
)
from strategies.zoning.design.zone_paths import copy_design
from strategies.zoning.genetic.genetic_zones import evolve
from strategies.zoning.genetic.population import Population, population_for
from strategies.zoning.queues.zone_queues import record_flow
from strategies.zoning.queues.zone_units import ticks
from strategies.zoning.zoning_parameters import Annealing, Genetic, Monitoring


class StaticZones(MonitoredZones):
    """Zones that never change; out of balance, robots share orders."""

    Parameters = Monitoring


class RedesignedZones(MonitoredZones, ABC):
    """Zones that are redesigned when they have been out of balance for long."""

    def _check_redesign(self, view: World, state: MonitoredState) -> None:
        """Out of balance for longer than patience: new zones are made of the flow of this moment."""
        now = int(view.clock[CLOCK_TICK])
        if (
            not state.bad_since[0]
            or state.new_zones_at[0]
            or now < self._patience_ends(view, state)
        ):
            return
        window = ticks(view, SECONDS_PER_UNIT["min"] * self.parameters.window)
        record_flow(view, window, now, state.recent_flow)
        state.flow[:] = state.recent_flow.astype(np.int64)
        state.new_zones_at[0] = now + max(1, ticks(view, self.parameters.compute))

    def _patience_ends(self, view: World, state: MonitoredState) -> int:
        return (
            int(state.bad_since[0])
            + ticks(view, SECONDS_PER_UNIT["min"] * self.parameters.patience)
            + 1
        )

    def _due(self, view: World, state: MonitoredState) -> list[int]:
        """As for zones that stay, and when new ones are begun or take effect."""
        times = super()._due(view, state)
        if state.new_zones_at[0]:
            times.append(int(state.new_zones_at[0]))
        elif state.bad_since[0]:
            times.append(self._patience_ends(view, state))
        return times

    def _shares(self, state: MonitoredState) -> bool:
        """Not while new zones are computed, if the scenario says so."""
        return self.parameters.share_while_computing or not state.new_zones_at[0]

    def _apply_redesign(self, view: World, out: Any, state: MonitoredState) -> None:
        """New zones of the flow that was recorded take effect when they are due."""
        now = int(view.clock[CLOCK_TICK])
        if not state.new_zones_at[0] or now < state.new_zones_at[0]:
            return
        state.recent_flow[:] = state.flow
        if self._design(view, out.design, state):
            out.redesigned[0] = 1
            state.redesigns[view.robots.at_index[0]] += 1
        else:
            copy_design(view.service_zones.design, out.design)
        state.new_zones_at[0] = state.bad_since[0] = 0
        state.next_look[0] = now + ticks(view, AFTER_REPAIR)

    @abstractmethod
    def _design(self, view: World, design: Any, state: Any) -> bool:
        """Make new zones of the recent flow; False if none are found, and the design is spoiled then."""


class AnnealedZones(RedesignedZones):
    """Zones repaired by simulated annealing (Ho & Liao, modified by Keith & La)."""

    Parameters = Annealing

    def _annealing(self) -> Annealing:
        """As the scenario says, the first zones and all others."""
        parameters: Annealing = self.parameters
        return parameters

    def _design(self, view: World, design: Any, state: Any) -> bool:
        given = self._annealing()
        return bool(
            repair(
                view.service_zones.roads,
                state.rules,
                state.recent_flow,
                float(given.hot),
                float(given.cold),
                given.steps,
                MAX_REPAIRS,
                design,
                state.zones,
                state.zones.reach,
                np.uint64(view.rules.seed),
                int(view.clock[CLOCK_TICK]),
            )
        )


class GeneticState(MonitoredState):
    """And what zones are bred in."""

    poses: Array = field(
        "(n, 2) int64",
        "by identity: columns and rows of the grid, from where robots look for their zones",
        role=CONSTANT,
    )
    population: Population


class GeneticZones(RedesignedZones):
    """Zones repaired by a genetic algorithm; each goes to the robot whose pose is nearest to it."""

    Parameters = Genetic

    def reset(self, view: World) -> Struct:
        """The poses, and room for the population besides."""
        population = population_for(view.service_zones.roads, self.parameters.population)
        return self._first_state(
            view, GeneticState, poses=self._poses_of(view), population=population
        )

    def _design(self, view: World, design: Any, state: Any) -> bool:
        parameters = self.parameters
        found = evolve(
            view.service_zones.roads,
            state.rules,
            state.recent_flow,
            parameters.generations,
            parameters.selected,
            float(parameters.mutation),
            state.population,
            design,
            state.zones,
            state.zones.reach,
            np.uint64(view.rules.seed),
            int(view.clock[CLOCK_TICK]),
        )
        if found and parameters.matched:
            self._assign_zones(view, design, state.poses)
        return bool(found)

    def _poses_of(self, view: World) -> Array:
        """Those of GeneticState. Raises InputError."""
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
        """Name each zone after the robot whose pose is nearest to its middle; robots choose in order.

        Robots of a type choose among the zones that were bred for their type.
        """
        cells = view.service_zones.roads.cell[view.service_zones.roads.point]
        across, down = cells % view.grid.width, cells // view.grid.width
        zones, kinds = len(view.service_zones.server), view.robots.type[view.robots.at_index]
        kinds = kinds % view.rules.loaded_types if view.rules.loaded_types else kinds
        name = np.full(zones, NIL, np.int32)
        for robot in range(zones):
            x, y = poses[robot]
            alike = (view.service_zones.accessible == view.service_zones.accessible[robot]).all(
                axis=1
            )
            alike &= (
                view.service_zones.has_priority == view.service_zones.has_priority[robot]
            ).all(axis=1)
            alike &= kinds == kinds[robot]
            free = [zone for zone in range(zones) if name[zone] == NIL and alike[zone]]
            middle = [design.zone == zone for zone in free]
            far = [
                np.hypot(across[mask].mean() - x, down[mask].mean() - y) if mask.any() else np.inf
                for mask in middle
            ]
            name[free[int(np.argmin(far))]] = robot
        design.zone[:] = name[design.zone]
        used = int(design.segments[0])
        design.owner[:used] = name[design.owner[:used]]
        transfer = design.transfer.copy()
        for a in range(zones):
            for b in range(zones):
                design.transfer[name[a], name[b]] = transfer[a, b]
