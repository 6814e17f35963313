"""A text as a world: the exact state that `picture_of` has drawn, ready to go on.

Restored is all that a digest covers, so a run continues with the same digests if its strategies
keep no memory of their own: a strategy's memory starts anew, and so does what is
counted for metrics: tallies, and when and from where an order was taken.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from automaton.errors import InputError
from automaton.kernels.draws import mix
from automaton.kernels.faults import open_slot
from automaton.picture.orders import read_order
from automaton.picture.phrases import Facts, Pair, Value
from automaton.picture.robots import NEEDS, NUMBERS, RobotLine, name_of, read_robot
from automaton.picture.writing import picture_of
from automaton.scenario.resolve import Resolved
from automaton.simulation import Simulation
from automaton.world.condition import GONE, RUNNING
from automaton.world.floor import floor_for
from automaton.world.plan import FloorPlan
from automaton.world.starts import occupy_starts
from automaton.world.state import (
    CARRIED,
    CHANGES,
    DELIVERED,
    FINISHED,
    FRESH_ALLOCATION,
    GOAL_PARK,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_ROUTE,
    NEED_WAY,
    NEEDING_CHARGING,
    NEEDING_ROUTE,
    NEEDING_WAY,
    NEXT_FAULT,
    NEXT_ORDER,
    NIL,
    OUT,
    SEEN_CHANGES,
    TICK,
    TICKETS,
    UNDELIVERED,
    UNPARKED,
    UNRELEASED,
    WAITING,
    World,
)

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
    orders: dict[int, Facts]


def world_from(text: str, resolved: Resolved) -> Simulation:
    """The simulation whose picture this is: floor, rules and strategies come from `resolved`.

    Raises InputError for a line that cannot be read, and for a picture that contradicts itself or
    the scenario (the restored world is drawn again and compared).
    """
    lines = [line.rstrip() for line in text.strip("\n").split("\n")]
    said = read_lines(lines)
    simulation = Simulation(resolved, said.seed)
    world, plan = simulation.world, resolved.plan
    check_names(said, world)
    for identity, line in said.robots.items():
        set_robot(world, plan, int(world.robots.at_index[identity]), line)
    for order, facts in said.orders.items():
        set_order(world, plan, order, facts)
    set_reservations(world)
    set_occupancy(world, resolved)
    set_clock(world, said, resolved)
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
                order, facts = read_order(line)
                said.orders[order] = facts
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


def set_robot(world: World, plan: FloorPlan, i: int, line: RobotLine) -> None:
    """Put a robot at storage index i into the state that its line tells."""
    robots, facts = world.robots, line.facts
    for name in NUMBERS:
        getattr(robots, name)[i] = facts[name]
    robots.zone[i] = _number(facts["zone"]) - 1
    for name in ("cell", "claim", "stand"):
        getattr(robots, name)[i] = _cell(plan, facts[name])
    if facts["left"] is not None:
        robots.home[i] = _cell(plan, facts["left"])
    if facts["goal"] == GOAL_PARK:
        robots.stand[i] = robots.home[i]
    robots.slot[i] = _slot(world, plan, facts["slot"])
    robots.need[i] = sum(bit for name, bit in NEEDS.items() if facts[name])
    set_plan(world, i, line.plan)
    steps, driven = line.route
    if len(steps) > robots.route.shape[1]:
        raise InputError(f"{PLACE} has a route longer than {robots.route.shape[1]} steps")
    robots.route[i, : len(steps)] = steps
    robots.length[i] = len(steps)
    robots.at[i] = driven
    robots.route_sum[i] = route_sum(steps)


def set_plan(world: World, i: int, orders: list[int]) -> None:
    """Let a robot have these orders ahead of it."""
    if len(orders) > world.robots.plan.shape[1]:
        raise InputError(f"{PLACE} has a plan longer than {world.robots.plan.shape[1]} orders")
    if max(orders, default=0) >= len(world.orders.state):
        raise InputError(f"{PLACE} has a plan with an order {max(orders)}, which does not exist")
    world.robots.plan[i, : len(orders)] = orders
    world.robots.planned[i] = len(orders)


def route_sum(steps: list[int]) -> int:
    """The hash of a route that the digest covers, as the world computes it."""
    total = np.uint64(0)
    with np.errstate(over="ignore"):
        for s, step in enumerate(steps):
            total += np.uint64(mix(np.uint64(s << 8 | step)))
    return int(total >> np.uint64(1))


def set_order(world: World, plan: FloorPlan, order: int, facts: Facts) -> None:
    """Put an order into the state that its line tells."""
    orders = world.orders
    for name in ("state", "delivered", "legs"):
        getattr(orders, name)[order] = facts[name]
    spare = _number(facts["spare"])
    if spare == NIL:
        orders.place[order] = _slot(world, plan, facts["place"])
        return
    slot, cell = world.slots.spare + spare, _cell(plan, facts["place"])
    if slot >= len(world.slots.cell) or not open_slot(world, slot, cell):
        raise InputError(f"{PLACE} has a load {spare} on the floor, which no robot can have left")
    orders.place[order] = slot


def set_reservations(world: World) -> None:
    """What follows from the robots and orders: who has an order, what a slot holds and awaits."""
    robots, orders, slots = world.robots, world.orders, world.slots
    for i, identity in enumerate(robots.identity.tolist()):
        load, order, slot = int(robots.load[i]), int(robots.order[i]), int(robots.slot[i])
        if order != NIL:
            orders.by[order] = identity
        if load != NIL:
            orders.state[load] = CARRIED
            orders.place[load] = NIL
            orders.legs[load] = max(1, int(orders.legs[load]))
        if slot != NIL and not slots.endless[slot]:
            slots.by[slot] = identity
    slots.content[:] = NIL
    for order, slot in enumerate(orders.place.tolist()):
        if slot != NIL and not slots.endless[slot]:
            slots.content[slot] = order


def set_occupancy(world: World, resolved: Resolved) -> None:
    """Let every robot hold its cell, and the one that a long move or a turn claims."""
    durations, mode = resolved.scenario.durations, resolved.scenario.world.zones
    kinematics = resolved.scenario.fleet.kinematics
    floor = floor_for(resolved.plan, kinematics, durations.move, durations.turn, mode)
    robots, occupancy = world.robots, world.traffic.occupancy
    occupancy[:] = floor.occupancy
    on_floor = robots.cell != NIL
    occupy_starts(world.grid, occupancy, robots.cell[on_floor], robots.travel[on_floor])
    claiming = np.flatnonzero(robots.claim != NIL)
    for i in claiming.tolist():
        step = int(robots.claim[i]) - int(robots.cell[i])
        # A turn in a cell for two claims the other lane of its own cell.
        ahead = int(np.argmax(world.grid.offset == step)) if step else int(robots.travel[i]) ^ 2
        lane = np.array([ahead], np.uint8)
        occupy_starts(world.grid, occupancy, robots.claim[i : i + 1], lane)


def set_clock(world: World, said: Said, resolved: Resolved) -> None:
    """The tick, and the counters that follow from the robots and orders."""
    robots, clock = world.robots, world.clock
    clock[TICK] = said.tick
    clock[CHANGES] = said.changes
    clock[SEEN_CHANGES] = said.seen
    clock[UNDELIVERED] = np.count_nonzero(world.orders.state != DELIVERED)
    clock[UNPARKED] = np.count_nonzero(robots.parked == 0)
    orders = world.orders
    if world.rules.in_system:
        restore_closed_loop(world, said.tick)
    known = orders.released <= said.tick
    orders.state[known & (orders.state == UNRELEASED)] = WAITING
    clock[NEXT_ORDER] = np.count_nonzero(known)
    clock[NEXT_FAULT] = np.count_nonzero(world.rules.faults[:, 0] <= said.tick)
    clock[TICKETS] = said.tickets
    clock[OUT] = np.count_nonzero((robots.status != RUNNING) & (robots.status != GONE))
    clock[NEEDING_CHARGING] = np.count_nonzero(robots.need & NEED_CHARGING)
    asking = robots.need & NEED_ALLOCATION != 0
    clock[FRESH_ALLOCATION] = np.count_nonzero(asking & (robots.asked_at == NIL))
    clock[NEEDING_ROUTE] = np.count_nonzero(robots.need & NEED_ROUTE)
    clock[NEEDING_WAY] = np.count_nonzero(robots.need & NEED_WAY)
    when = resolved.scenario.stop.when
    over = when == "delivered" or (when == "parked" and clock[UNPARKED] == 0)
    clock[FINISHED] = int(said.tick > 0 and clock[UNDELIVERED] == 0 and over)


def restore_closed_loop(world: World, tick: int) -> None:
    """When orders became known: for each delivery one in the tick after it, in their sequence."""
    orders, first = world.orders, world.rules.in_system
    later = orders.coming[first:]
    before = np.sort(orders.delivered[(orders.delivered != NIL) & (orders.delivered < tick)])
    shown = min(len(later), len(before))
    orders.released[later[:shown]] = before[:shown] + 1


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


def _cell(plan: FloorPlan, value: Value) -> int:
    if not isinstance(value, tuple):
        return NIL
    return plan.cell(*_on_floor(plan, value))


def _slot(world: World, plan: FloorPlan, value: Value) -> int:
    if not isinstance(value, tuple):
        return NIL
    slot = int(world.grid.slot[plan.cell(*_on_floor(plan, value))])
    if slot == NIL:
        raise InputError(f"{PLACE} has a load at {value}, where there is no shelf or destination")
    return slot


def _on_floor(plan: FloorPlan, value: Pair) -> Pair:
    if not plan.holds(*value):
        raise InputError(f"{PLACE} mentions {value}, which is not on the floor")
    return value
