"""Greedy allocation: the cheapest pair of a robot and an order first."""

from __future__ import annotations

import dataclasses
import heapq
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.state import (
    ACTION_MOVE,
    ACTION_TURN,
    GOAL_PARK,
    MAY_TURN,
    NIL,
    ORDER_WAITING,
)
from automaton.engine.table_rows import has_room_for
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify_recording
from automaton.world.resolved import Resolved

FLOOR = "..........\n.##.##.##.\n..........\n.##.##.##.\n.........."
ONE_WAY = ">>>>>>v\n^#####v\n^#####v\n^<<<<<<"
GIVE_WAY = {"name": "retreat", "idle_give_way": True}  # a parked robot may stand on a stop
Cell = tuple[int, int]


def greedy(
    picture: str,
    start: Sequence[Cell],
    orders: Any,
    kinematics: str = "omni",
    world: Any = None,
    **parameters: Any,
) -> Resolved:
    """Robots on a floor whose orders greedy allocation gives away."""
    if isinstance(orders, list):
        orders = {"list": [{"stops": stops} for stops in orders]}
    fleet = {"robots": len(start), "kinematics": kinematics, "start": list(start)}
    strategy = {"allocation": {"name": "greedy", **parameters}, "right_of_way": GIVE_WAY}
    parts = {"fleet": fleet, "strategy": strategy, "world": world or {}}
    return scene(picture, list(start), orders=orders, durations={"turn": 2}, **parts)


def taken(resolved: Resolved, ticks: int = 1, **options: Any) -> list[int]:
    """The orders that robots 0, 1, ... have after some ticks."""
    run = Simulation(resolved, **options)
    run.run(until=ticks)
    found: list[int] = run.world.robots.order[run.world.robots.at_index].tolist()
    return found


def test_the_cheapest_pair_comes_first_and_not_the_first_robot() -> None:
    """A is nearer to 0 than to 1, but B is nearest of all."""
    assert taken(greedy("............", [(0, 0), (6, 0)], [[(4, 0)], [(11, 0)]])) == [1, 0]


def test_ways_count_not_rows_and_columns() -> None:
    """Order 1 lies beside A, behind a wall; order 0 is three moves away."""
    floor = "....\n###.\n...."
    assert taken(greedy(floor, [(0, 0)], [[(3, 0)], [(0, 2)]])) == [0]


def test_turns_count() -> None:
    """It faces south: two ticks of turning and two moves east, or three moves south."""
    floor = "...\n.##\n.##\n.##"
    resolved = greedy(floor, [(0, 0)], [[(2, 0)], [(0, 3)]], "differential")
    assert taken(resolved) == [1]


def test_of_equal_pairs_the_first_robot_gets_the_earliest_order() -> None:
    assert taken(greedy(".....", [(2, 0)], [[(0, 0)], [(4, 0)]])) == [0]
    assert taken(greedy(".....", [(0, 0), (4, 0)], [[(2, 0)], [(2, 0)]])) == [0, 1]
    assert taken(greedy(".....", [(0, 0), (4, 0)], [[(2, 0)]]))[0] == 0


def test_the_stops_behind_the_first_one_may_count_too() -> None:
    """Order 0 begins nearby and goes on for long, order 1 is farther and short."""
    orders = [[(2, 0), (9, 0), (0, 0)], [(4, 0)]]
    assert taken(greedy(FLOOR, [(0, 0)], orders)) == [0]
    assert taken(greedy(FLOOR, [(0, 0)], orders, rest=1.0)) == [1]


def test_without_orders_robots_park_or_stay() -> None:
    orders = [[(3, 0)]]
    run = Simulation(greedy(".....", [(0, 0)], orders))
    run.run()
    assert run.world.robots.parked[0] == 0 and run.tick == 3
    for idle, cell in (("park", 0), ("stay", 3)):
        resolved = greedy(".....", [(0, 0)], orders, idle=idle)
        run = Simulation(resolved)
        run.world.clock.undelivered += 1  # one order more, which never comes: the run goes on
        run.run(until=20)
        assert resolved.floor_plan.xy(int(run.world.robots.cell[0])) == (cell, 0)


def test_loads_are_fetched_nearest_first_and_brought_to_their_targets() -> None:
    floor = "..........\ns.s.s..ddd"
    orders = {"list": [{"from": [0, 1], "to": [7, 1]}, {"from": [4, 1], "to": [8, 1]}]}
    resolved = greedy(floor, [(6, 0), (2, 0)], orders)
    assert taken(resolved) == [1, 0]
    run, recorder = recorded_run(resolved)
    assert run.finished and verify_recording(recorder.recording()).passed


def test_an_order_that_none_of_them_carries_waits_for_who_does() -> None:
    """The strong robot is under way when the second heavy load comes, beside a light one."""
    types = [
        {"name": "light", "robots": 3, "payload": 1},
        {"name": "strong", "robots": 1, "payload": 9},
    ]
    start = [(1, 0), (2, 0), (3, 0), (8, 0)]
    fleet = {"robots": 4, "kinematics": "omni", "start": start, "types": types}
    loads = [(8, 0, 9), (2, 5, 1), (5, 5, 9)]  # column, release and weight
    orders = [
        {"from": [x, 1], "to": [0, 1], "release": release, "weight": weight}
        for x, release, weight in loads
    ]
    strategy = {"allocation": {"name": "greedy", "idle": "stay"}, "right_of_way": GIVE_WAY}
    parts = {"orders": {"list": orders}, "strategy": strategy}
    run = Simulation(scene(".........\nt.t..t..t", start, **(parts | {"fleet": fleet})))
    run.run(until=7)
    assert run.world.robots.order.tolist() == [NIL, 1, NIL, 0]
    run.run()
    assert run.finished and run.world.orders.dispatched_to.tolist()[::2] == [3, 3]


def test_an_order_goes_to_a_robot_that_has_become_nearer() -> None:
    """B gets 1, the only one left; when A is done, it is nearer by far."""
    orders = [[(2, 0)], [(4, 0)]]
    keeps = greedy("............", [(0, 0), (11, 0)], orders)
    parts = greedy("............", [(0, 0), (11, 0)], orders, reassign=1)
    assert taken(keeps, 3) == [NIL, 1]
    assert taken(parts, 3) == [1, NIL]


def test_only_so_many_robots_have_an_order() -> None:
    orders = [[(x, 0)] for x in range(1, 9)]
    resolved = greedy(FLOOR, [(0, 0), (9, 0), (9, 4)], orders, active=2)
    run = Simulation(resolved)
    while not run.finished:
        run.run(until=run.tick + 1)
        assert np.count_nonzero(run.world.robots.order != NIL) <= 2
    assert run.world.orders.delivered.min() > 0


@pytest.mark.parametrize("active", [1, 2])
def test_robots_park_when_no_order_is_open_for_them(active: int) -> None:
    """Nobody drives home as long as one is free."""
    orders = [[(x, y)] for x in range(1, 9) for y in (0, 4)]
    resolved = greedy(FLOOR, [(0, 2), (9, 2)], orders, active=active)
    stop = msgspec.structs.replace(resolved.scenario.stop, when="parked")
    scenario = msgspec.structs.replace(resolved.scenario, stop=stop)
    run = Simulation(dataclasses.replace(resolved, scenario=scenario))
    while ((run.world.orders.state == ORDER_WAITING) & (run.world.orders.reserved_by == NIL)).any():
        assert not (run.world.robots.goal_type == GOAL_PARK).any()
        run.run(until=run.tick + 1)
    run.run()
    assert run.finished and run.world.robots.parked.all()


def test_matched_again_no_more_robots_get_an_order_than_may() -> None:
    orders = {"generator": "tours", "count": 40, "stops": 2}
    resolved = greedy(FLOOR, [(0, 0), (9, 0), (9, 4), (0, 4)], orders, active=2, reassign=1)
    run = Simulation(resolved)
    for tick in range(1, 120):
        run.run(until=tick)
        assert np.count_nonzero(run.world.robots.order != NIL) <= 2
    assert np.count_nonzero(run.world.orders.delivered > 0) > 5


def ways(world: Any, i: int) -> dict[int, int]:
    """Ticks of robot i to every cell that it gets to, on the empty floor."""
    grid, robots, duration = world.grid, world.robots, world.rules.duration[0]
    start = int(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
    start = int(robots.claim[i]) if robots.claim[i] != NIL else start
    front = [(int(robots.busy[i]), start, int(robots.heading[i]))]
    known: dict[tuple[int, int], int] = {}
    while front:
        ticks, cell, heading = heapq.heappop(front)
        if (cell, heading) in known:
            continue
        known[cell, heading] = ticks
        flags = int(grid.type_cell_flags[0, cell])
        for direction in range(heading, 4, grid.headings):
            if flags >> direction & 1:
                to = cell + int(grid.offset[direction])
                heapq.heappush(front, (ticks + int(duration[ACTION_MOVE]), to, heading))
        if grid.headings > 1 and flags & MAY_TURN:
            for turned in (heading + 1, heading - 1):
                to = turned % grid.headings
                heapq.heappush(front, (ticks + int(duration[ACTION_TURN]), cell, to))
    cells: dict[int, int] = {}
    for (cell, _), ticks in known.items():
        cells[cell] = min(ticks, cells.get(cell, ticks))
    return cells


def cheapest_pairs(world: Any, seekers: Sequence[int], orders: Sequence[int]) -> dict[int, int]:
    """Robot -> order: all pairs by cost, present ones first, then by identity and release."""
    stops, first = world.stops.cell, world.orders.first_stop
    pairs = []
    for i in seekers:
        way = ways(world, i)
        for rank, order in enumerate(orders):
            cell = int(stops[first[order] + world.orders.stops_done[order]])
            if cell in way:
                new = int(world.robots.order[i] != order)
                pairs.append((way[cell], new, int(world.robots.identity[i]), rank, i, order))
    found: dict[int, int] = {}
    for *_, i, order in sorted(pairs):
        if i not in found and order not in found.values():
            found[i] = order
    return found


class Compared:
    """Allocation as configured, compared with all pairs sorted each time it is asked."""

    def __init__(self, run: Simulation, again: bool) -> None:
        self.run, self.again, self.checked = run, again, 0

    def tick(self) -> None:
        """One tick; what is expected of it follows from the state before."""
        world = self.run.world
        robots, orders = world.robots, world.orders
        before = robots.order.copy()
        free = [
            i
            for i in robots.at_index.tolist()
            if before[i] == NIL and (self.again or (robots.need[i] & 1 and robots.busy[i] == 0))
        ]
        held = [
            i
            for i in robots.at_index.tolist()
            if self.again and before[i] != NIL and orders.state[before[i]] == ORDER_WAITING
        ]
        known = [k for k in orders.release_sequence.tolist() if orders.state[k] == ORDER_WAITING]
        mine = {int(before[i]) for i in held}
        able = [k for k in known if orders.reserved_by[k] == NIL or k in mine]
        expected = cheapest_pairs(world, sorted([*free, *held], key=robots.identity.item), able)
        done_before = world.tally.visits.copy()
        self.run.run(until=self.run.tick + 1)
        for i, order in expected.items():
            stood = world.tally.visits[i] > done_before[i] and world.tally.visited[i] == order
            returned = robots.retreat_moves[i] > 0  # by right of way, later in the tick
            assert stood or returned or robots.order[i] == order, (self.run.tick, i, order)
            self.checked += 1


@pytest.mark.parametrize(
    ("robots", "count", "kinematics", "again"),
    [
        (3, 40, "omni", False),  # more orders than robots
        (6, 4, "differential", False),  # more robots than orders
        (5, 30, "differential", True),
        (6, 5, "omni", True),
    ],
)
def test_all_pairs_sorted_by_cost_give_the_same(
    robots: int, count: int, kinematics: str, again: bool
) -> None:
    start = [(0, 0), (9, 0), (3, 2), (6, 2), (0, 4), (9, 4)][:robots]
    orders = {"generator": "tours", "count": count, "stops": {"from": 1, "to": 2}}
    parameters = {"reassign": 1} if again else {}
    run = Simulation(greedy(FLOOR, start, orders, kinematics, **parameters), seed=5)
    compared = Compared(run, again)
    while not run.finished and run.tick < 150:
        compared.tick()
    assert compared.checked >= count


def test_on_one_way_aisles_too() -> None:
    orders = {"generator": "tours", "count": 30, "stops": 1}
    run = Simulation(greedy(ONE_WAY, [(0, 0), (6, 3), (3, 0)], orders, reassign=1), seed=2)
    compared = Compared(run, True)
    while not run.finished and run.tick < 150:
        compared.tick()
    assert compared.checked >= 30


@pytest.mark.parametrize("kinematics", ["omni", "differential"])
@pytest.mark.parametrize("reassign", [None, 1])
def test_tables_and_searches_give_the_same_orders(kinematics: str, reassign: int | None) -> None:
    """Orders weigh what comes after their start: looked up if all tables fit, else searched for."""
    start = [(0, 0), (9, 0), (3, 2), (6, 2), (0, 4)]
    orders = {"generator": "tours", "count": 60, "stops": {"from": 1, "to": 3}}
    digests, fits = set(), []
    for budget in ("1 MiB", "1 KiB"):
        world = {"distance_tables": budget}
        parameters = {"rest": 1, "reassign": reassign}
        run = Simulation(greedy(FLOOR, start, orders, kinematics, world=world, **parameters), 7)
        run.run(until=300)
        assert run.world.clock.undelivered < 30
        digests.add(run.digest)
        fits.append(bool(has_room_for(run.workspace.tables, 50)))
    assert (len(digests), fits) == (1, [True, False])


def test_how_robots_are_stored_does_not_matter() -> None:
    start = [(0, 0), (9, 0), (3, 2), (6, 2), (0, 4)]
    orders = {"generator": "tours", "count": 60, "stops": {"from": 1, "to": 3}}
    digests = set()
    for storage in (None, [4, 3, 2, 1, 0], [2, 0, 4, 1, 3]):
        resolved = greedy(FLOOR, start, orders, "differential", reassign=3)
        order = None if storage is None else np.array(storage, np.int32)
        run = Simulation(resolved, 7, storage=order)
        run.run(until=300)
        digests.add((run.digest, int(run.world.clock.tick)))
    assert len(digests) == 1


def test_a_robot_with_limited_sight_takes_no_order_from_one_that_it_does_not_see() -> None:
    start = [(0, 0), (9, 0), (3, 2), (6, 2)]
    orders = {"generator": "tours", "count": 30, "stops": 2}
    strategy = {"allocation": {"name": "greedy", "reassign": 1}, "right_of_way": GIVE_WAY}
    resolved = scene(FLOOR, start, orders=orders, strategy=strategy, information={"radius": 2})
    run = Simulation(resolved, 3)
    run.run()
    assert run.finished and run.world.tally.illegal.sum() == 0
    assert (run.world.orders.legs == 1).all()


def test_tours_of_one_recording_are_made_again() -> None:
    orders = {"generator": "tours", "count": 50, "stops": {"from": 1, "to": 3}}
    start = [(0, 0), (9, 0), (3, 2), (6, 2)]
    run, recorder = recorded_run(greedy(FLOOR, start, orders, "differential", reassign=2))
    assert run.finished and verify_recording(recorder.recording()).passed
