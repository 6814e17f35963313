"""Robots drawn on a floor of slow zones, where any number of them fits into a cell."""

from __future__ import annotations

import numpy as np

from automaton.engine.state import LAYER_NAMES
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import FLOOR, UNLIMITED, Symbol
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Durations, Fleet, Orders, Scenario, Stop, WorldRules
from automaton.strategy.api import (
    GOAL_CHARGE,
    GOAL_NONE,
    GOAL_PARK,
    NEED_ROUTE,
    NIL,
    REASON_NEW_GOAL,
    Array,
    Strategy,
)
from automaton.strategy.lookup import NoParameters
from automaton.world.resolved import Resolved, StrategyChoice
from strategies.routing.forecasts import CongestionState, congestion_state
from strategies.routing.routing_parameters import SharedPlans

STEPS = "ESWN"
ONE_WAY = {  # symbols of cells for any number of robots, left in one direction
    symbol: Symbol(FLOOR, 1 << direction, UNLIMITED) for direction, symbol in enumerate("eswn")
}


class Traffic:
    """Robots A, B, ... stand in cells ~ (any number fits) and have nothing to do; e s w n are one-way.

    `robots` instead of letters: flat cells of robots 0, 1, ...; or `bays`: so many robots in
    parking bays.
    """

    def __init__(
        self,
        picture: str,
        *,
        robots: tuple[int, ...] = (),
        bays: int = 0,
        routing: Strategy | None = None,
        kinematics: str = "omni",
        traffic_zones: str = "undirected",
        slowdown: str = "zones",
        move: int = 1,
        turn: int = 1,
    ) -> None:
        letters = sorted(set(picture) & set("ABCDEFGHIJKLMNOP"))
        plain = "".join("~" if symbol in letters else symbol for symbol in picture)
        self.floor_plan = draw_floor(plain, tuple(ONE_WAY.items()))
        lines = picture.split("\n")
        places = [
            (line.index(name), y)
            for name in letters
            for y, line in enumerate(lines)
            if name in line
        ]
        start = robots or tuple(self.floor_plan.cell(*place) for place in places)
        scenario = Scenario(
            name="traffic",
            layout={},
            fleet=Fleet(robots=bays or len(start), kinematics=kinematics),  # type: ignore[arg-type]
            durations=Durations(move=move, turn=turn),
            orders=Orders(generator="picture-loads"),
            world=WorldRules(traffic_zones=traffic_zones, slowdown=slowdown),  # type: ignore[arg-type]
            stop=Stop(when="never", max_duration=10_000),
        )
        picks = {layer: StrategyChoice("none", NoParameters()) for layer in LAYER_NAMES}
        self.run = Simulation(
            Resolved(
                scenario, self.floor_plan, picks, start="parking-bays" if bays else start, source=""
            ),
            strategies=[routing if layer == "routing" else None for layer in LAYER_NAMES],
        )
        self.world = self.run.world
        if bays:
            return
        self.world.robots.parked[:] = 0
        self.world.robots.home[:] = 0  # a wall: nobody ever parks

    def index(self, name: str) -> int:
        return int(self.world.robots.at_index[ord(name) - ord("A")])

    def place(self, name: str) -> tuple[int, int]:
        return self.floor_plan.xy(int(self.world.robots.cell[self.index(name)]))

    def put(self, name: str, place: tuple[int, int]) -> None:
        """Move a robot by hand."""
        self.world.robots.cell[self.index(name)] = self.floor_plan.cell(*place)

    def send(self, i: int, route: list[int]) -> None:
        """Give a robot a route, at whose end it does nothing."""
        robots = self.world.robots
        robots.route[i, : len(route)] = route
        robots.route_length[i], robots.route_index[i] = len(route), 0
        robots.goal_type[i] = GOAL_CHARGE if robots.parked[i] else GOAL_PARK
        begins = robots.home[i] if robots.cell[i] == NIL else robots.cell[i]
        robots.goal_cell[i] = int(begins) + int(self.world.grid.offset[route].sum())

    def drive(self, **routes: str) -> Traffic:
        """Give robots routes, such as A="EES"."""
        for name, route in routes.items():
            self.send(self.index(name), [STEPS.index(step) for step in route])
        return self

    def want(self, **targets: tuple[int, int]) -> Traffic:
        """Have robots ask for routes to cells."""
        for name, place in targets.items():
            i, robots = self.index(name), self.world.robots
            robots.goal_type[i], robots.goal_cell[i] = GOAL_PARK, self.floor_plan.cell(*place)
            robots.need[i] |= NEED_ROUTE
            robots.route_reason[i] = REASON_NEW_GOAL
            self.world.clock.needing_route += 1
        return self

    def tick(self, ticks: int = 1) -> Traffic:
        self.run.run(self.run.tick + ticks)
        return self

    def route(self, name: str) -> str:
        """What a robot has still to drive."""
        robots, i = self.world.robots, self.index(name)
        return "".join(
            STEPS[step] for step in robots.route[i, robots.route_index[i] : robots.route_length[i]]
        )

    def crowd(self) -> Array:
        """(Z,) robots in each zone, counted here."""
        robots, grid = self.world.robots, self.world.grid
        inside = robots.cell != NIL
        traffic_zone = grid.traffic_zone[robots.cell[inside], robots.travel[inside] >> 1]
        return np.bincount(traffic_zone[traffic_zone != NIL], minlength=grid.traffic_zone_count)

    def tick_and_take_away(self) -> None:
        """A tick; robots that stood at the end of their routes before it vanish after it."""
        robots = self.world.robots
        there = (robots.route_length > 0) & (robots.route_index >= robots.route_length)
        there &= (robots.busy == 0) & (robots.claim == NIL)
        self.tick()
        robots.cell[there], robots.route_length[there] = NIL, 0
        robots.goal_type[there], robots.goal_cell[there] = GOAL_NONE, NIL

    def forecast(self, horizon: int, beta: float = 0) -> CongestionState:
        """Room for a forecast, of nobody yet."""
        return congestion_state(self.run.view, SharedPlans(horizon=horizon, beta=beta))


def is_empty(state: CongestionState) -> bool:
    """Whether a forecast leaves nothing behind."""
    parts = (state.counts, state.overflowed, state.zone_share, state.crowd, state.calendar)
    return not any(part.any() for part in parts)
