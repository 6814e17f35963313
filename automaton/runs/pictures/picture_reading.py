"""A text as a world: the exact state that `picture_of` has drawn, ready to go on.

Restored is all that a digest covers, so a run continues with the same digests if its strategies
keep no memory of their own: a strategy's memory starts again, and so does what is
counted for metrics: tallies, and when and from where an order was taken.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from automaton.engine.faults import open_slot
from automaton.engine.random_numbers import splitmix64
from automaton.engine.robot_states import STATUS_REMOVED, STATUS_UP
from automaton.engine.state import (
    CLOCK_ALLOCATION_REVISION,
    CLOCK_COARSE_TICK,
    CLOCK_FINISHED,
    CLOCK_FIRST_OPEN,
    CLOCK_FRESH_ALLOCATION,
    CLOCK_KNOWN_ORDERS,
    CLOCK_NEEDING_CHARGING,
    CLOCK_NEEDING_RIGHT_OF_WAY,
    CLOCK_NEEDING_ROUTE,
    CLOCK_NEXT_FAULT,
    CLOCK_NEXT_RELEASE,
    CLOCK_REVISION,
    CLOCK_ROBOTS_DOWN,
    CLOCK_TICK,
    CLOCK_TICKETS_ISSUED,
    CLOCK_UNDELIVERED,
    CLOCK_UNPARKED,
    GOAL_PARK,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
    ORDER_WAITING,
    World,
)
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.runs.pictures.order_lines import OrderLine, read_order
from automaton.runs.pictures.phrases import Facts, Pair, Value
from automaton.runs.pictures.picture_writing import picture_of
from automaton.runs.pictures.robot_lines import NEEDS, RobotLine, name_of, numbers_of, read_robot
from automaton.runs.simulation import Simulation
from automaton.runs.state_copy import hold_cells
from automaton.world.resolve import Resolved

PLACE = "the picture"
HEAD = re.compile(
    r"tick (\d+), seed (\d+), (\d+) order changes, (\d+|none) seen by allocation"
    r"(?:, (\d+) tickets)?"
)
BEGINNING = "tick 0, seed 1, 0 order changes, none seen by allocation"
LEGEND = re.compile(r"\S is kind .*")


class Said(NamedTuple):
    """What a picture says, line by line."""

    tick: int
    seed: int
    changes: int
    seen: int
    tickets: int
    robots: dict[int, RobotLine]  # by identity
    orders: dict[int, OrderLine]


def world_from(text: str, resolved: Resolved) -> Simulation:
    """The simulation whose picture this is: floor, rules and strategies come from `resolved`.

    Raises InputError for a line that cannot be read, and for a picture that contradicts itself or
    the scenario (the restored world is drawn again and compared).
    """
    lines = [line.rstrip() for line in text.strip("\n").split("\n")]
    said = read_lines(lines)
    simulation = Simulation(resolved, said.seed)
    world, floor_plan = simulation.world, resolved.floor_plan
    if world.rules.assigned:
        raise InputError(
            "a picture does not show which orders are known where robots have their own"
        )
    if len(world.pods.slot):
        raise InputError(
            "a picture does not show which pod stands where, nor which orders and lines wait for it; "
            "use a recording, or run the scenario up to this tick"
        )
    check_names(said, world)
    for identity, line in said.robots.items():
        set_robot(world, floor_plan, int(world.robots.at_index[identity]), line)
    for order in said.orders.values():
        set_order(world, floor_plan, order.number, order.facts)
        set_stops(world, order)
    set_reservations(world)
    set_clock(world, said, resolved)
    hold_cells(world)
    check_against(lines, picture_of(simulation).split("\n"))
    return simulation


def read_lines(lines: list[str]) -> Said:
    """Read every line but those of the map. Raises InputError with the number of the line."""
    head = HEAD.fullmatch(lines[0])
    if head is None:
        raise InputError(f"it has to begin with a line such as: {BEGINNING}", PLACE, 1)
    seen = NIL if head[4] == "none" else int(head[4])
    said = Said(int(head[1]), int(head[2]), int(head[3]), seen, int(head[5] or 0), {}, {})
    body = [number for number, line in enumerate(lines) if not line][1:2]  # the map lies between
    for number in range(body[0] if body else len(lines), len(lines)):
        line = lines[number]
        try:
            if line.startswith("order "):
                order = read_order(line)
                said.orders[order.number] = order
            elif line and not LEGEND.fullmatch(line):
                robot = read_robot(line, said.tick)
                said.robots[robot.identity] = robot
        except InputError as error:
            raise error.at(PLACE, number + 1) from None
    return said


def check_names(said: Said, world: World) -> None:
    """Raises InputError unless the picture speaks of exactly the scenario's robots."""
    robots, orders = len(world.robots.cell), len(world.orders.state)
    missing = [name_of(identity) for identity in range(robots) if identity not in said.robots]
    if missing:
        raise InputError(f"{PLACE} has no line for robot {missing[0]}")
    surplus = [name_of(identity) for identity in said.robots if identity >= robots]
    if surplus:
        raise InputError(f"{PLACE} has a robot {surplus[0]}, but the scenario has only {robots}")
    numbers = [*said.orders, *(_number(facts["order"]) for _, facts, _, _ in said.robots.values())]
    if max(numbers, default=0) >= orders:
        raise InputError(f"{PLACE} has an order {max(numbers)}, but the scenario has only {orders}")


def set_robot(world: World, floor_plan: FloorPlan, i: int, line: RobotLine) -> None:
    """Put a robot at storage index i into the state that its line tells."""
    robots, facts = world.robots, line.facts
    for name in numbers_of(type(robots)):
        getattr(robots, name)[i] = facts[name]
    robots.service_zone[i] = _number(facts["service_zone"]) - 1
    for name in ("cell", "claim", "goal_cell"):
        getattr(robots, name)[i] = _cell(floor_plan, facts[name])
    if facts["left"] is not None:
        robots.home[i] = _cell(floor_plan, facts["left"])
    if facts["goal_type"] == GOAL_PARK:
        robots.goal_cell[i] = robots.home[i]
    robots.slot[i] = _slot(world, floor_plan, facts["slot"])
    robots.need[i] = sum(bit for name, bit in NEEDS.items() if facts[name])
    set_order_queue(world, i, line.plan)
    steps, driven = line.route
    if len(steps) > robots.route.shape[1]:
        raise InputError(f"{PLACE} has a route longer than {robots.route.shape[1]} steps")
    robots.route[i, : len(steps)] = steps
    robots.route_length[i] = len(steps)
    robots.route_index[i] = driven
    robots.route_hash[i] = route_hash(steps)


def set_order_queue(world: World, i: int, orders: list[int]) -> None:
    """Let a robot have these orders ahead of it."""
    if len(orders) > world.robots.order_queue.shape[1]:
        raise InputError(
            f"{PLACE} has a plan longer than {world.robots.order_queue.shape[1]} orders"
        )
    if max(orders, default=0) >= len(world.orders.state):
        raise InputError(f"{PLACE} has a plan with an order {max(orders)}, which does not exist")
    world.robots.order_queue[i, : len(orders)] = orders
    world.robots.order_queue_length[i] = len(orders)


def route_hash(steps: list[int]) -> int:
    """The hash of a route that the digest covers, as the world computes it."""
    total = np.uint64(0)
    with np.errstate(over="ignore"):
        for s, step in enumerate(steps):
            total += np.uint64(splitmix64(np.uint64(s << 8 | step)))
    return int(total >> np.uint64(1))


def set_order(world: World, floor_plan: FloorPlan, order: int, facts: Facts) -> None:
    """Put an order into the state that its line tells."""
    orders = world.orders
    for name in ("state", "delivered", "legs"):
        getattr(orders, name)[order] = facts[name]
    spare = _number(facts["spare"])
    if spare == NIL:
        orders.current_slot[order] = _slot(world, floor_plan, facts["current_slot"])
        return
    slot, cell = world.slots.first_spare + spare, _cell(floor_plan, facts["current_slot"])
    if slot >= len(world.slots.cell) or not open_slot(world, slot, cell):
        raise InputError(f"{PLACE} has a load {spare} on the floor, which no robot can have left")
    orders.current_slot[order] = slot


def set_stops(world: World, line: OrderLine) -> None:
    """Let the first stops of an order be done in the ticks of its line."""
    orders = world.orders
    first, end = orders.first_stop[line.number : line.number + 2].tolist()
    if len(line.stops) > end - first:
        raise InputError(f"{PLACE} has {len(line.stops)} stops of order {line.number}, too many")
    world.stops.done[first : first + len(line.stops)] = line.stops
    orders.stops_done[line.number] = len(line.stops)


def set_reservations(world: World) -> None:
    """What follows from the robots and orders: who has an order, what a slot holds and awaits."""
    robots, orders, slots = world.robots, world.orders, world.slots
    for i, identity in enumerate(robots.identity.tolist()):
        load, order, slot = int(robots.load[i]), int(robots.order[i]), int(robots.slot[i])
        if order != NIL:
            orders.reserved_by[order] = identity
        if load != NIL:
            orders.state[load] = ORDER_CARRIED
            orders.current_slot[load] = NIL
            orders.legs[load] = max(1, int(orders.legs[load]))
        if slot != NIL and not slots.unbounded[slot]:
            slots.reserved_by[slot] = identity
    slots.content[:] = NIL
    for order, slot in enumerate(orders.current_slot.tolist()):
        if slot != NIL and not slots.unbounded[slot]:
            slots.content[slot] = order


def set_clock(world: World, said: Said, resolved: Resolved) -> None:
    """The tick, and the counters that follow from the robots and orders."""
    robots, clock = world.robots, world.clock
    clock[CLOCK_TICK] = said.tick
    clock[CLOCK_COARSE_TICK] = (said.tick - 1) // world.rules.refinement + 1
    clock[CLOCK_REVISION] = said.changes
    clock[CLOCK_ALLOCATION_REVISION] = said.seen
    is_open = world.orders.state != ORDER_DELIVERED
    clock[CLOCK_UNDELIVERED] = np.count_nonzero(is_open)
    clock[CLOCK_FIRST_OPEN] = np.argmax(is_open) if is_open.any() else len(is_open)
    clock[CLOCK_UNPARKED] = np.count_nonzero(robots.parked == 0)
    orders = world.orders
    if world.rules.in_system:
        restore_closed_loop(world, said.tick)
    known = orders.release_tick <= said.tick
    orders.state[known & (orders.state == ORDER_UNRELEASED)] = ORDER_WAITING
    clock[CLOCK_NEXT_RELEASE] = np.count_nonzero(known)
    clock[CLOCK_KNOWN_ORDERS] = len(known)
    clock[CLOCK_NEXT_FAULT] = np.count_nonzero(world.rules.faults[:, 0] <= said.tick)
    clock[CLOCK_TICKETS_ISSUED] = said.tickets
    clock[CLOCK_ROBOTS_DOWN] = np.count_nonzero(
        (robots.status != STATUS_UP) & (robots.status != STATUS_REMOVED)
    )
    clock[CLOCK_NEEDING_CHARGING] = np.count_nonzero(robots.need & NEED_CHARGING)
    asking = robots.need & NEED_ALLOCATION != 0
    clock[CLOCK_FRESH_ALLOCATION] = np.count_nonzero(asking & (robots.seen_revision == NIL))
    clock[CLOCK_NEEDING_ROUTE] = np.count_nonzero(robots.need & NEED_ROUTE)
    clock[CLOCK_NEEDING_RIGHT_OF_WAY] = np.count_nonzero(robots.need & NEED_RIGHT_OF_WAY)
    when = resolved.scenario.stop.when
    over = when == "delivered" or (when == "parked" and clock[CLOCK_UNPARKED] == 0)
    clock[CLOCK_FINISHED] = int(said.tick > 0 and clock[CLOCK_UNDELIVERED] == 0 and over)


def restore_closed_loop(world: World, tick: int) -> None:
    """When orders were released: for each delivery one in the tick after it, in their sequence."""
    orders, first = world.orders, world.rules.in_system
    later = orders.release_sequence[first:]
    before = np.sort(orders.delivered[(orders.delivered != NIL) & (orders.delivered < tick)])
    shown = min(len(later), len(before))
    orders.release_tick[later[:shown]] = before[:shown] + 1


def check_against(lines: list[str], drawn: list[str]) -> None:
    """Raises InputError at the first line that the restored world would draw differently."""
    for number in range(max(len(lines), len(drawn))):
        said = lines[number] if number < len(lines) else ""
        should = drawn[number].rstrip() if number < len(drawn) else ""
        if said != should:
            raise InputError(
                f"this line contradicts the rest of the picture or the scenario: "
                f"it says '{said}', expected was '{should}'",
                PLACE,
                number + 1,
            )


def _number(value: Value) -> int:
    return value if isinstance(value, int) else NIL


def _cell(floor_plan: FloorPlan, value: Value) -> int:
    if not isinstance(value, tuple):
        return NIL
    return floor_plan.cell(*_on_floor(floor_plan, value))


def _slot(world: World, floor_plan: FloorPlan, value: Value) -> int:
    if not isinstance(value, tuple):
        return NIL
    slot = int(world.grid.slot[floor_plan.cell(*_on_floor(floor_plan, value))])
    if slot == NIL:
        raise InputError(f"{PLACE} has a load at {value}, where there is no shelf or destination")
    return slot


def _on_floor(floor_plan: FloorPlan, value: Pair) -> Pair:
    if not floor_plan.holds(*value):
        raise InputError(f"{PLACE} mentions {value}, which is not on the floor")
    return value
