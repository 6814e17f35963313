"""Robots drawn on a small floor, with routes that a test gives them, observed tick by tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from automaton.engine.observation import CAUSES
from automaton.engine.state import LAYER_NAMES
from automaton.floor.drawn_floors import draw_floor
from automaton.history.event_history import Event, EventHistory
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.runs.pictures.pictures import Following
from automaton.runs.simulation import Simulation
from automaton.scenario.fleet import FleetType
from automaton.scenario.schema import (
    Battery,
    Durations,
    Faults,
    Fleet,
    Orders,
    Scenario,
    Stop,
    WorldRules,
)
from automaton.strategy.api import GOAL_PARK, NIL, Strategy
from automaton.strategy.lookup import NoParameters
from automaton.world.resolved import Resolved, StrategyChoice

STEPS = "ESWN"


class SmallRun:
    """`routes` by robot, such as A="EES"; robots without one have nothing to do, and are not parked.

    `waits`: those of right of way; one long wait keeps a robot from retrying.
    """

    def __init__(
        self,
        picture: str,
        routes: Mapping[str, str] | None = None,
        *,
        kinematics: str = "omni",
        following: Following = "convoy",
        rules: WorldRules | None = None,
        durations: Durations | None = None,
        strategies: Mapping[str, Strategy] | None = None,
        storage: Sequence[int] | None = None,
        start: Any = None,
        waits: tuple[int, int, int, int, int] = (1, 1, 1, 1, 255),
        battery: Battery | None = None,
        faults: Faults | None = None,
        types: tuple[FleetType, ...] = (),
    ) -> None:
        self.floor_plan = draw_floor(picture.strip("\n"))
        start = start or self.floor_plan.starts or "parking-bays"
        robots = len(self.floor_plan.bays) if start == "parking-bays" else len(start)
        scenario = Scenario(
            name="staged",
            layout={},
            fleet=Fleet(robots=robots, kinematics=kinematics, types=types),  # type: ignore[arg-type]
            durations=durations or Durations(),
            orders=Orders(generator="picture-loads"),
            world=rules or WorldRules(following=following),
            battery=battery,
            faults=faults or Faults(),
            stop=Stop(when="never", max_duration=10_000),
        )
        self.answers: Any = (strategies or {}).get("right_of_way")
        picks = {layer: StrategyChoice("none", NoParameters()) for layer in LAYER_NAMES}
        self.event_history = EventHistory()
        self.run = Simulation(
            Resolved(scenario, self.floor_plan, picks, start=start, source=""),
            storage=None if storage is None else np.array(storage, np.int32),
            on_observe=self.event_history,
            strategies=[(strategies or {}).get(layer) for layer in LAYER_NAMES],
        )
        self.world = self.run.world
        if start != "parking-bays":
            self.world.robots.parked[:] = 0
        if not strategies or "right_of_way" not in strategies:
            self.world.rules.wait[:] = waits
        for name, route in (routes or {}).items():
            self.send(name, route)

    def index(self, name: str) -> int:
        return int(self.world.robots.at_index[ord(name) - ord("A")])

    def send(self, name: str, route: str) -> None:
        """Give a robot a route, to a place where it does nothing."""
        robots, i = self.world.robots, self.index(name)
        steps = [STEPS.index(step) for step in route]
        robots.route[i, : len(steps)] = steps
        robots.route_length[i], robots.route_index[i] = len(steps), 0
        robots.goal_type[i] = GOAL_PARK
        cell = int(robots.cell[i])
        robots.goal_cell[i] = cell + sum(int(self.world.grid.offset[step]) for step in steps)

    def tick(self, ticks: int = 1) -> SmallRun:
        self.run.run(self.run.tick + ticks)
        return self

    def cause(self, name: str) -> str:
        """The name of what keeps a robot in the last tick; "none" if it does not wait."""
        return CAUSES[self.run.observation.cause[self.index(name)]].name

    def blocker(self, name: str) -> str:
        """The robot that keeps it, or ""."""
        robot = int(self.run.observation.blocker[self.index(name)])
        return "" if robot == NIL else chr(ord("A") + robot)

    def wanted(self, name: str) -> tuple[int, int] | None:
        """Column and row of the cell that it wants."""
        cell = int(self.run.observation.wanted[self.index(name)])
        return None if cell == NIL else self.floor_plan.xy(cell)

    def why(self, name: str) -> tuple[str, str, tuple[int, int] | None]:
        return self.cause(name), self.blocker(name), self.wanted(name)

    def ring(self, name: str) -> int:
        return int(self.run.observation.wait_cycle_ticks[self.index(name)])

    def snapshot(self) -> Snapshot:
        return take_snapshot(self.run)

    def events(self) -> list[Event]:
        return [self.event_history.event(k) for k in range(len(self.event_history.events))]
