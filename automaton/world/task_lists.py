"""Tours and lists of tasks: their cells, the number of orders, and round-robin assignment to robots.

A repeated list has no end, but the arrays of a world need a number of orders: an upper bound on the
tasks that the robots can do until the run ends. A robot does at most one stop per tick, and between two
cells it makes at least one move for each row and column. A pool has MAX_TASK_ORDERS tasks at most, so
that the arrays fit memory; a run that uses them up says so.
"""

from __future__ import annotations

from math import gcd
from typing import Final

import numpy as np

from automaton.engine.facilities import Stops
from automaton.engine.state import NEVER, NIL, ORDER_UNRELEASED, ORDER_WAITING, Array
from automaton.engine.state import Orders as OrderArrays
from automaton.floor.floor_plan import RACK, FloorPlan
from automaton.floor.reachability import dead_ends_of, slot_access
from automaton.scenario.orders import Orders, StopGroup
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import Scenario

MAX_TASK_ORDERS: Final = 10_000_000  # of a repeated list: half a gigabyte


def cells_of_tasks(orders: Orders, floor_plan: FloorPlan) -> tuple[Array, Array]:
    """The number of cells of each task, and the flat cells of all tasks, one after another."""
    tasks = orders.tasks
    if tasks is None or isinstance(tasks, str):
        raise ValueError("the file of tasks has not been read")
    count = np.array([len(task) for task in tasks], np.int64)
    x, y = np.array([cell for task in tasks for cell in task], np.int64).T
    cells: Array = (y + 1) * (floor_plan.width + 2) + x + 1
    return count, cells


def stop_groups(orders: Orders, floor_plan: FloorPlan, reachable: Array) -> list[Array]:
    """The cells of the stops of tours, one array for each group; `reachable`: (K, C) by robot type."""
    within: Array = np.logical_and.reduce(reachable, axis=0)
    if isinstance(orders.cells, tuple):
        return [_group(name, floor_plan, within) for name in orders.cells]
    if orders.cells == "no-dead-ends":
        within = within & (dead_ends_of(floor_plan).number == NIL)
    return [np.flatnonzero(within)]


def _group(name: StopGroup, floor_plan: FloorPlan, within: Array) -> Array:
    cells = floor_plan.stations
    if name == "racks":
        of_racks = floor_plan.kind.reshape(-1)[floor_plan.slots] == RACK
        cells = slot_access(floor_plan)[of_racks].reshape(-1)
    cells = np.unique(cells[cells != NIL]).astype(np.int64)
    reached: Array = cells[within[cells] != 0]
    return reached


def order_count(scenario: Scenario, floor_plan: FloorPlan) -> int:
    """Return the number of orders of the tours or tasks of a scenario."""
    orders = scenario.orders
    if orders.tasks is None:
        return orders.count or 0
    if not orders.repeat:
        return len(orders.tasks)
    if orders.assign == "round-robin":
        return _dealt_out(scenario, floor_plan)
    return min(_from_a_pool(scenario, floor_plan), MAX_TASK_ORDERS)


def _from_a_pool(scenario: Scenario, floor_plan: FloorPlan) -> int:
    """The number of open tasks, plus the tasks before them that all robots together could have done.

    Done tasks are the first of the list, except as many as are open: their least work must fit into the
    ticks of all robots.
    """
    robots, ticks = scenario.fleet.robots, scenario.stop.max_duration
    in_system = scenario.orders.in_system(robots)
    work = _ticks_within(scenario, floor_plan)
    room = robots * ticks + in_system * int(work.max())
    whole, rest = divmod(room, int(work.sum()))
    done = whole * len(work) + int(np.searchsorted(np.cumsum(work), rest, side="right"))
    return done + in_system


def _dealt_out(scenario: Scenario, floor_plan: FloorPlan) -> int:
    """For each robot the number of tasks that the fastest robot could do, plus one.

    After at most as many rounds as there are tasks, each robot gets the same tasks again. Its cell then
    depends only on its last task: soon it is where it was one or two such periods before, and the ticks
    of all further periods are added at once.
    """
    robots, ticks = scenario.fleet.robots, scenario.stop.max_duration
    count, cells = cells_of_tasks(scenario.orders, floor_plan)
    within = _ticks_within(scenario, floor_plan)
    first = np.concatenate([[0], np.cumsum(count)])
    begin, end = cells[first[:-1]], cells[first[1:] - 1]
    spent = np.zeros(robots, np.int64)
    here = np.full(robots, NIL)
    idle = np.zeros(robots, np.int64)  # rounds in which a robot skipped its tasks
    rounds, period = 0, len(count) // gcd(len(count), robots)
    before: list[tuple[Array, Array]] = []  # `here` and `spent` one and two periods ago
    while (spent <= ticks).any() and rounds * robots <= MAX_TASK_ORDERS:
        if rounds % period == 0:
            for periods, (place, sum_then) in enumerate(before, 1):
                if (place == here).all():
                    most = max(0, (MAX_TASK_ORDERS // robots - rounds) // (periods * period))
                    times = min(most, _repetitions(ticks - spent, spent - sum_then))
                    spent += times * (spent - sum_then)
                    rounds += times * periods * period
                    break
            before = [(here, spent.copy()), *before[:1]]
        task = (rounds * robots + np.arange(robots)) % len(count)
        way = np.where(here == NIL, 0, _moves(here, begin[task], floor_plan))
        took = np.maximum(way * _move_ticks(scenario), 1) + within[task] - 1
        passed = scenario.orders.skip_reached & (way == 0)
        spent += np.where(passed, 0, took)
        here = np.where(passed & (here != NIL), here, end[task])
        idle = np.where(passed, idle + 1, 0)
        spent[idle > len(count)] = ticks + 1  # it skips all of them
        rounds += 1
    return (rounds + 1) * robots


def _repetitions(left: Array, took: Array) -> int:
    """The number of times that `took` fits into `left` for the last robot; both (robots,)."""
    open_ = left >= 0
    if (took[open_] <= 0).any():
        return 0  # a robot skips all of its tasks
    times: int = (left[open_] // took[open_]).max()
    return times


def _ticks_within(scenario: Scenario, floor_plan: FloorPlan) -> Array:
    """(tasks,) int64: least ticks from that of the first stop to that of the last stop, both included."""
    count, cells = cells_of_tasks(scenario.orders, floor_plan)
    moves = _moves(cells[:-1], cells[1:], floor_plan) * _move_ticks(scenario)
    legs = np.concatenate([[1], np.maximum(moves, 1)])
    first = np.cumsum(count) - count
    legs[first] = 1
    ticks: Array = np.add.reduceat(legs, first)
    return ticks


def _moves(here: Array, there: Array, floor_plan: FloorPlan) -> Array:
    width = floor_plan.width + 2
    moves: Array = np.abs(here // width - there // width) + np.abs(here % width - there % width)
    return moves


def _move_ticks(scenario: Scenario) -> int:
    return min(one.moves.empty for one in types_of(scenario))


def assign_in_turn(orders: OrderArrays, stops: Stops, homes: Array, skip_reached: bool) -> None:
    """Reveal the first task of each robot; each further task is known when the previous one is done.

    `homes`: (n,) start cells. Modifies the state, the releases and their sequence.
    """
    robots = len(homes)
    orders.state[:] = ORDER_UNRELEASED
    orders.release_tick[:] = NEVER
    orders.release_sequence[:] = NIL
    shown = 0
    for robot, home in enumerate(homes.tolist()):
        order = robot
        while skip_reached and order < len(orders.state):
            if stops.cell[orders.first_stop[order]] != home:
                break
            order += robots
        if order < len(orders.state):
            orders.state[order], orders.release_tick[order] = ORDER_WAITING, 0
            orders.release_sequence[shown] = order
            shown += 1


def targets_of(orders: OrderArrays, stops: Stops, homes: Array) -> Array:
    """(n,) the last cell of the task of each robot, one each; without a task, its start cell.

    `homes`: (n,) start cells.
    """
    targets = homes.copy()
    targets[: len(orders.state)] = stops.cell[orders.first_stop[1:] - 1]
    return targets
