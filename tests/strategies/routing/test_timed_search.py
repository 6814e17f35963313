"""Search in time: checked against a label-setting A* in plain Python, and where time does not matter
against Bellman and Ford."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_floors import pictures
from reference_paths import FAR, HEADINGS, Pose, Ways
from slow_zone_scenes import ONE_WAY, STEPS, Traffic

from automaton.engine.state import NIL, Array
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.traffic_zones import ZONE_MODES
from strategies.routing.congestion import time_dependent_path
from strategies.routing.forecasts import add, forecast_all, forget

HORIZON = 160  # later than any of these robots arrives
Others = Callable[[int, int, int], int]  # (cell, direction, tick) -> robots in that zone


class Case(NamedTuple):
    """A leg of robot 0, and how many others will be where."""

    traffic: Traffic
    ways: Ways
    target: int
    beta: int  # thousandths
    counts: Array  # (ticks, zones)

    def start(self) -> Pose:
        robots = self.traffic.world.robots
        return int(robots.cell[0]), int(robots.heading[0])

    def others(self, cell: int, direction: int, tick: int) -> int:
        traffic_zone = int(self.traffic.world.grid.traffic_zone[cell, direction >> 1])
        return int(self.counts[tick, traffic_zone]) if traffic_zone != NIL and tick < HORIZON else 0

    def found(self) -> list[int] | None:
        """The kernel's route."""
        run, state = self.traffic.run, self.traffic.forecast(HORIZON, self.beta / 1000)
        for tick, zone in zip(*np.nonzero(self.counts), strict=True):
            add(state, int(zone), int(tick), int(tick) + 1, int(self.counts[tick, zone]))
        run.world.robots.goal_cell[0] = self.target
        steps = np.zeros(200, np.uint8)
        length = time_dependent_path(run.view, run.workspace, state, 0, False, steps)
        return None if length == NIL else [int(step) for step in steps[:length]]


@st.composite
def cases(draw: Any, kinematics: tuple[str, ...] = ("omni", "differential")) -> Case:
    width, height = draw(st.integers(2, 5)), draw(st.integers(1, 4))
    picture = draw(pictures("~~~~~~~~~~~###eswn", width, height))
    cells = np.flatnonzero(draw_floor(f"{picture}\n~", tuple(ONE_WAY.items())).drivable).tolist()
    ways_of = draw(st.sampled_from(kinematics))
    move, turn = draw(st.integers(1, 2)), draw(st.integers(1, 3))
    traffic = Traffic(
        f"{picture}\n~",
        robots=(draw(st.sampled_from(cells)),),
        kinematics=ways_of,
        traffic_zones=draw(st.sampled_from(ZONE_MODES)),
        slowdown=draw(st.sampled_from(["zones", "none"])),
        move=move,
        turn=turn,
    )
    seeded = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = (HORIZON, traffic.world.grid.traffic_zone_count)
    counts = seeded.integers(0, 4, shape) * (seeded.random(shape) < draw(st.floats(0, 1)))
    return Case(
        traffic,
        Ways(traffic.floor_plan, ways_of, move, turn),
        draw(st.sampled_from(cells)),
        draw(st.sampled_from([0, 500, 1000, 2000, 7000])),
        counts,
    )


def plain_route(case: Case) -> list[int] | None:
    """The same search with a dict of labels: least cost, then the earliest tick; ties as documented."""
    ways, slow = case.ways, bool(case.traffic.world.rules.slowdown)
    x, y = case.traffic.floor_plan.xy(case.target)
    n = HEADINGS[ways.kinematics]

    def entry(pose: Pose) -> tuple[int, int, int]:
        column, row = case.traffic.floor_plan.xy(pose[0])
        left = abs(column - x) + abs(row - y)
        return labels[pose][0] + 1000 * ways.move * left, left, pose[0] * n + pose[1]

    labels: dict[Pose, tuple[int, int]] = {case.start(): (0, 0)}
    routes: dict[Pose, list[int]] = {case.start(): []}
    heap, done = [(entry(case.start()), case.start())], set()
    while heap:
        _, pose = heapq.heappop(heap)
        if pose in done:
            continue
        done.add(pose)
        if pose[0] == case.target:
            return routes[pose]
        cost, tick = labels[pose]
        for after, ticks in ways.steps(pose):
            if after[0] == pose[0]:
                label, route = (cost + 1000 * ticks, tick + ticks), routes[pose]
            else:
                way = case.traffic.floor_plan.neighbours(pose[0]).index(after[0])
                others = case.others(pose[0], way, tick)
                later = tick + ticks * (1 + others if slow else 1)
                label, route = (
                    (cost + ticks * (1000 + case.beta * others), later),
                    [*routes[pose], way],
                )
            if after not in done and label < labels.get(after, (FAR * 1000, 0)):
                labels[after], routes[after] = label, route
                heapq.heappush(heap, (entry(after), after))
    return None


@given(cases())
@settings(max_examples=60)
def test_the_route_is_that_of_the_plain_search(case: Case) -> None:
    assert case.found() == plain_route(case)


@given(cases(("omni",)), st.integers(0, 2**32))
@settings(max_examples=60)
def test_where_the_traffic_does_not_change_the_route_is_the_cheapest_of_all(
    case: Case, seed: int
) -> None:
    """With counts that stay as they are a move costs the same at any time."""
    floor_plan, start = case.traffic.floor_plan, case.start()[0]
    steady = np.random.default_rng(seed).integers(0, 4, case.counts.shape[1])
    case = case._replace(counts=np.tile(steady, (HORIZON, 1)))
    least = {start: 0}
    front = [start]
    while front:
        cell = front.pop()
        for way, after in enumerate(floor_plan.neighbours(cell)):
            cost = least[cell] + price(case, cell, way)
            if int(floor_plan.exits.flat[cell]) >> way & 1 and cost < least.get(after, 1000 * FAR):
                least[after] = cost
                front.append(after)
    route = case.found()
    assert (route is None) == (case.target not in least)
    cell, cost = start, 0
    for way in route or []:
        cost += price(case, cell, way)
        cell = floor_plan.neighbours(cell)[way]
    assert route is None or (cell, cost) == (case.target, least[case.target])


def price(case: Case, cell: int, way: int) -> int:
    return case.ways.move * (1000 + case.beta * case.others(cell, way, 0))


def route_of_a(traffic: Traffic, target: tuple[int, int], beta: float) -> str:
    run, state = traffic.run, traffic.forecast(HORIZON, beta)
    i = traffic.index("A")
    traffic.world.robots.goal_cell[i] = traffic.floor_plan.cell(*target)
    forecast_all(run.view, run.workspace, state)
    forget(state, i)
    steps = np.zeros(50, np.uint8)
    length = time_dependent_path(run.view, run.workspace, state, i, False, steps)
    return "".join(STEPS[step] for step in steps[:length])


def test_the_way_round_is_taken_when_the_aisle_is_dear() -> None:
    """Straight on it is 6 moves beside two robots, round the south 4 moves more."""
    picture = "A~BC~~~\n~#####~\n~~~~~~~"
    assert route_of_a(Traffic(picture), (6, 0), beta=0) == "EEEEEE"
    assert route_of_a(Traffic(picture), (6, 0), beta=2) == "SSEEEEEENN"


@pytest.mark.parametrize(("beta", "route"), [(0.3, "EEEEEE"), (0.5, "SSEEEEEENN")])
def test_each_robot_in_a_zone_adds_beta_to_the_price_of_a_move(beta: float, route: str) -> None:
    """Straight on, 5 of 6 moves lead out of the zone of two robots; round the south it is 10 moves.

    So straight on costs 6 + 10 beta: 9 or 11. If robots counted by their square it would be 12 with
    the lower beta, and if it counted only that there are any 8.5 with the higher one.
    """
    assert route_of_a(Traffic("A~BC~~~\n~#####~\n~~~~~~~"), (6, 0), beta) == route
