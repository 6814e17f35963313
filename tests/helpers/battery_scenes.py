"""Robots with batteries on drawn floors, for the tests of energy, faults and charging."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
from small_runs import SmallRun

from automaton.build.resolve import Resolved, resolve
from automaton.engine.robot_status import BATTERY_PERCENT
from automaton.engine.state import GOAL_CHARGE
from automaton.evidence.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Battery, Drain, Scenario
from automaton.strategy.layer import Strategy

MOVES = Battery(drain=Drain(move=1.0), charge_rate=10.0)


class BatteryScene(SmallRun):
    """A staged run whose robots are told to charge; charges in percent."""

    def charge(self, name: str) -> float:
        return float(self.world.robots.charge[self.index(name)]) / BATTERY_PERCENT

    def status(self, name: str) -> int:
        return int(self.world.robots.status[self.index(name)])

    def at(self, name: str) -> tuple[int, int]:
        return self.floor_plan.xy(int(self.world.robots.cell[self.index(name)]))

    def send_to_charge(self, name: str, route: str, level: float = 100) -> None:
        """Drive to a charger and charge up to a level, in percent."""
        self.send(name, route)
        robots, i = self.world.robots, self.index(name)
        robots.goal_type[i], robots.charge_target[i] = GOAL_CHARGE, round(level * BATTERY_PERCENT)
        if not route:
            robots.goal_cell[i] = robots.cell[i]

    def charges(self, name: str) -> bool:
        return bool(self.world.robots.goal_type[self.index(name)] == GOAL_CHARGE)


def scene(
    picture: str, start: Sequence[tuple[int, int]], settings: Sequence[str] = (), **parts: Any
) -> Resolved:
    """A scenario on a drawn floor; omni robots that start in these cells."""
    fleet = {"robots": len(start), "kinematics": "omni", "start": list(start)}
    body = {"name": "scene", "layout": {"picture": picture.strip("\n")}, "fleet": fleet, **parts}
    body.setdefault("stop", {"when": "delivered", "max_duration": 3000})
    return resolve(msgspec.convert(body, Scenario), settings)


def recorded_run(
    resolved: Resolved, seed: int | None = None, strategies: Sequence[Strategy | None] | None = None
) -> tuple[Simulation, MemoryRecorder]:
    """A run to its end, recorded."""
    recorder = MemoryRecorder(resolved, seed)
    run = Simulation(resolved, seed, on_record=recorder, strategies=strategies)
    run.run()
    return run, recorder
