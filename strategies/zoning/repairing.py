"""Zones that are designed anew: by simulated annealing, or by a genetic algorithm."""

from __future__ import annotations

from typing import Any

import numpy as np

from automaton.world.state import NIL, TICK, Memory, Workspace, World
from automaton.zoning.genetic import evolve
from automaton.zoning.herd import population_for
from strategies.zoning.monitored import (
    AFTER_REPAIR,
    BAD_SINCE,
    FLOW,
    NEW_ZONES_AT,
    NEXT_LOOK,
    REDESIGNS,
    Monitored,
)
from strategies.zoning.parameters import Annealing, Genetic, Monitoring
from strategies.zoning.units import ticks


class StaticZones(Monitored):
    """Zones that never change; out of balance, robots share orders."""

    Parameters = Monitoring


class Repaired(Monitored):
    """Zones that are designed anew when they have been out of balance for long."""

    def _consider(self, view: World, state: Any, now: int) -> None:
        patience = ticks(view, 60 * self.parameters.patience)
        if state[NEW_ZONES_AT] or now - state[BAD_SINCE] <= patience:
            return
        state[FLOW:] = self._flow.reshape(-1).astype(np.int64)
        state[NEW_ZONES_AT] = now + max(1, ticks(view, self.parameters.compute))

    def _take_effect(self, view: World, given: Any, memory: Memory, space: Workspace) -> None:
        state, now = memory.shared, int(view.clock[TICK])
        self._flow[:] = state[FLOW:].reshape(self._flow.shape)
        if self._design(view, given.design, space):
            given.redesigned[0] = 1
            memory.own[view.robots.at_index[0], REDESIGNS] += 1
        state[NEW_ZONES_AT] = state[BAD_SINCE] = 0
        state[NEXT_LOOK] = now + ticks(view, AFTER_REPAIR)

    def _design(self, view: World, design: Any, space: Workspace) -> bool:
        """Make new zones of self._flow; False if none were found."""
        raise NotImplementedError


class AnnealedZones(Repaired):
    """Zones repaired by simulated annealing (Ho & Liao, modified by Keith & La)."""

    Parameters = Annealing

    def _design(self, view: World, design: Any, space: Workspace) -> bool:
        return self._anneal(view, design, space)


class BredZones(Repaired):
    """Zones repaired by a genetic algorithm; each goes to the robot that began nearest to it."""

    Parameters = Genetic

    def reset(self, view: World) -> Memory:
        """Room for the population besides."""
        memory = super().reset(view)
        self._population = population_for(view.zoning.roads, self.parameters.population)
        return memory

    def _design(self, view: World, design: Any, space: Workspace) -> bool:
        given = self.parameters
        found = evolve(
            view.zoning.roads,
            self._rules,
            self._flow,
            given.generations,
            given.selected,
            float(given.mutation),
            self._population,
            design,
            space.zoning,
            self._everywhere,
            view.rules.seed,
            int(view.clock[TICK]),
        )
        if found and given.matched:
            self._give_out(view, design)
        return bool(found)

    def _give_out(self, view: World, design: Any) -> None:
        """Name each zone after the robot whose home is nearest to its middle; robots choose in order.

        Robots of a type choose among the zones that were bred for their type.
        """
        cells = view.zoning.roads.cell[view.zoning.roads.point]
        across, down = cells % view.grid.width, cells // view.grid.width
        zones, kinds = len(view.zoning.server), view.robots.type[view.robots.at_index]
        name = np.full(zones, NIL, np.int32)
        for robot in range(zones):
            home = int(view.robots.home[view.robots.at_index[robot]])
            x, y = home % view.grid.width, home // view.grid.width
            alike = (view.zoning.serves == view.zoning.serves[robot]).all(axis=1)
            alike &= (view.zoning.first == view.zoning.first[robot]).all(axis=1)
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
