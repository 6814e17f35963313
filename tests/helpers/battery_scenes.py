"""Robots with batteries in staged runs, for the tests of energy and faults."""

from __future__ import annotations

from small_runs import SmallRun

from automaton.engine.state import BATTERY_PERCENT, GOAL_CHARGE
from automaton.scenario.schema import Battery, Drain

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
