"""Which situations of traffic a run went through, read off the world after each tick."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
from reference_motion import tie_break_hash

from automaton.engine.motion import LIVE, MOVED
from automaton.engine.record_codes import (
    DROPPED_ON_ARRIVAL,
    ENTERED_PARKING_BAY,
    EXECUTED_BAY_BLOCKED,
    LEFT_PARKING_BAY,
    PICKED_ON_ARRIVAL,
)
from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_QUEUE,
    LAYER_NAMES,
    NIL,
    ORDER_DELIVERED,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_REMOVED,
    STATUS_TOWED,
    STATUS_UP,
    World,
)
from automaton.floor.floor_plan import STATION

WANTED = (
    *("following in a queue", "rotating ring", "refused swap", "allowed swap", "contested cell"),
    *("priority decides", "move of several ticks", "turn on two lanes", "two in an aisle"),
    *("three without limit", "drove on capacity 0", "drove on capacity 1", "drove on capacity 2"),
    *("move in a slow zone", "picked up on arrival", "dropped on arrival"),
    *("left a bay", "went into a bay", "bay blocked"),
    *("left the floor", "came back to the floor", "kept off the floor"),
    *("battery empty", "broken down", "towed", "came back", "gone for good", "load left behind"),
    *("charging", "in the queue before a charger", "order came later", "visited", "on a station"),
    *("halted by zoning", "halted while down", "redesigned"),
    *(f"illegal {layer}" for layer in LAYER_NAMES),
)


class Want(NamedTuple):
    """A robot's live intent of the last tick."""

    robot: int  # identity
    start: int
    to: int
    moved: bool
    span: int
    priority: int


def wants(world: World) -> list[Want]:
    """The live intents of the last tick."""
    robots, traffic = world.robots, world.traffic
    found = []
    for i in np.flatnonzero(traffic.intent & LIVE).tolist():
        step = int(world.grid.offset[traffic.intent[i] & 3])
        moved = bool(traffic.intent[i] & MOVED)
        cell = int(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
        start = cell - step if moved and robots.claim[i] == NIL else cell
        who, priority = int(robots.identity[i]), int(robots.priority[i])
        found.append(Want(who, start, start + step, moved, int(traffic.move_ticks[i]), priority))
    return found


def count_traffic_cases(world: World, reached: Counter[str]) -> None:
    """Add the situations of the last tick."""
    capacity = (world.grid.cell_flags >> 5 & 3).tolist()
    live = wants(world)
    made = [want for want in live if want.moved]
    edges = {(want.start, want.to): want for want in live}
    for want in live:
        other = edges.get((want.to, want.start))
        if other is not None and want.robot < other.robot:
            reached["allowed swap"] += want.moved and other.moved
            strict = 1 in (capacity[want.start], capacity[want.to])
            reached["refused swap"] += strict and not want.moved and not other.moved
    leaving = {want.start: want for want in made if capacity[want.start] == 1}
    for want in made:
        reached[f"drove on capacity {capacity[want.to]}"] += 1
        reached["move of several ticks"] += want.span > 1
        ahead = leaving.get(want.to)
        reached["following in a queue"] += ahead is not None and ahead.to not in leaving
    reached["rotating ring"] += rings(leaving)
    conditions(world, reached)
    contests(world, live, edges, capacity, reached)
    places(world, capacity, reached)


def rings(leaving: dict[int, Want]) -> int:
    """Robots in rings of three and more."""
    count = 0
    for start in leaving:
        cell, length = start, 0
        while cell in leaving and length <= len(leaving):
            cell, length = leaving[cell].to, length + 1
            if cell == start:
                count += length >= 3
                break
    return count


def contests(
    world: World,
    live: list[Want],
    edges: dict[tuple[int, int], Want],
    capacity: list[int],
    reached: Counter[str],
) -> None:
    """Cells that several robots wanted, and who got them."""
    tick = int(world.clock.tick)
    rivals: dict[int, list[Want]] = {}
    for want in live:
        if capacity[want.to] == 1 and (want.to, want.start) not in edges:
            rivals.setdefault(want.to, []).append(want)
    for claimants in rivals.values():
        reached["contested cell"] += len(claimants) > 1
        for winner in claimants:
            reached["priority decides"] += winner.moved and any(
                winner.priority > other.priority
                and tie_break_hash(tick, winner.robot) < tie_break_hash(tick, other.robot)
                for other in claimants
            )


def places(world: World, capacity: list[int], reached: Counter[str]) -> None:
    """Where robots are, and how they came out of their bays and into them."""
    robots = world.robots
    inside = Counter(cell for cell in robots.cell.tolist() if cell != NIL)
    for cell, number in inside.items():
        reached["two in an aisle"] += capacity[cell] == 2 and number == 2
        reached["three without limit"] += capacity[cell] == 0 and number >= 3
    turning = (robots.claim != NIL) & (robots.claim == robots.cell)
    reached["turn on two lanes"] += int(turning.sum())
    reached["move in a slow zone"] += int(world.tally.slowdown_ticks.any())
    reached["picked up on arrival"] += int((robots.executed & PICKED_ON_ARRIVAL != 0).sum())
    reached["dropped on arrival"] += int((robots.executed & DROPPED_ON_ARRIVAL != 0).sum())
    executed = robots.executed[robots.bay != NIL]
    reached["left a bay"] += int((executed & LEFT_PARKING_BAY != 0).sum())
    reached["went into a bay"] += int((executed & ENTERED_PARKING_BAY != 0).sum())
    reached["bay blocked"] += int((executed == EXECUTED_BAY_BLOCKED).sum())
    executed = robots.executed[robots.bay == NIL]
    gone = robots.cell[robots.bay == NIL] == NIL
    reached["left the floor"] += int((gone & (executed & ENTERED_PARKING_BAY != 0)).sum())
    reached["came back to the floor"] += int((executed & LEFT_PARKING_BAY != 0).sum())
    reached["kept off the floor"] += int((executed == EXECUTED_BAY_BLOCKED).sum())


def count_illegal(world: World, reached: Counter[str]) -> None:
    for layer, count in zip(LAYER_NAMES, world.tally.illegal.tolist(), strict=True):
        reached[f"illegal {layer}"] += count


def conditions(world: World, reached: Counter[str]) -> None:
    """Add what batteries, faults and orders that come in time bring about."""
    robots, orders, slots = world.robots, world.orders, world.slots
    names = {
        STATUS_DEPLETED: "battery empty",
        STATUS_FAILED: "broken down",
        STATUS_TOWED: "towed",
        STATUS_REMOVED: "gone for good",
    }
    for status, name in names.items():
        reached[name] += int((robots.status == status).any())
    reached["came back"] += int(
        ((robots.status == STATUS_UP) & (world.tally.failures.any(1))).any()
    )
    reached["load left behind"] += int((slots.cell[slots.first_spare :] != NIL).any())
    reached["charging"] += int((robots.action == ACTION_CHARGE).any())
    reached["in the queue before a charger"] += int((robots.action == ACTION_QUEUE).any())
    reached["order came later"] += int((orders.release_tick == world.clock.tick).any())
    visits = (orders.source == orders.target) & (orders.state == ORDER_DELIVERED)
    reached["visited"] += int(visits.any())
    if len(world.service_zones.halt):
        halted = (world.service_zones.halt >= world.clock.tick) & (robots.cell != NIL)
        reached["halted by zoning"] += int(halted.any())
        out = (robots.status == STATUS_DEPLETED) | (robots.status == STATUS_FAILED)
        reached["halted while down"] += int((halted & out).any())
        reached["redesigned"] += int(world.clock.zones_redesigned == world.clock.tick)
    standing = robots.cell[robots.cell != NIL]
    reached["on a station"] += int((world.grid.kind[standing] == STATION).any())
