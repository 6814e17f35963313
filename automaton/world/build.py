"""From a resolved scenario to the arrays of a world at tick 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.kernels.decisions import most_words
from automaton.kernels.events import most_events
from automaton.kernels.operations import MOST_CHANGES
from automaton.kernels.sight import hide_everything
from automaton.kernels.zoning_decisions import most_zoning_words
from automaton.scenario.resolve import Resolved
from automaton.world.battery import first_charges
from automaton.world.cells import CHARGER
from automaton.world.demand import build_orders
from automaton.world.floor import Floor, floor_for, frozen
from automaton.world.partition import SAID, Partition
from automaton.world.partitions import build_partition
from automaton.world.places import Chargers
from automaton.world.rules import rules_for
from automaton.world.starts import first_headings, homes, occupy_starts
from automaton.world.state import (
    ACTIONS,
    CLOCK_SIZE,
    DIGEST_EVERY,
    FREE,
    FRESH_ALLOCATION,
    HALTED,
    NEED_ALLOCATION,
    NEXT_ORDER,
    NIL,
    NO_STEP,
    SEEN_CHANGES,
    UNDELIVERED,
    UNPARKED,
    UNQUEUED,
    UNWORKED,
    WAKING,
    AllocationAnswers,
    Answers,
    Array,
    Asked,
    ChargingAnswers,
    Memory,
    Record,
    RightOfWayAnswers,
    Robots,
    RoutingAnswers,
    Tally,
    Traffic,
    World,
    ZoningAnswers,
)
from automaton.world.types import type_of_each, types_of
from automaton.world.waiting import (
    CAUSE_COUNT,
    COUNTS,
    CURVE_COLUMNS,
    DELAY_COLUMNS,
    Observation,
    Scratch,
)
from automaton.world.work import build_stations

LONGEST_PLAN = 64  # orders of a robot
PLANNED_ORDERS = 4_000_000  # of all robots: bounds the memory of large fleets
CROWDED = 12  # cells per robot below which each cell has its entry in the contest


class Buffers(NamedTuple):
    """What the loop passes to strategies besides the view."""

    batch: Asked  # the robots concerned
    asked: Asked  # those that one call of decide is about
    answers: Answers


def build_world(
    resolved: Resolved,
    seed: int,
    storage: Array | None = None,
    longest_route: int | None = None,
) -> tuple[World, Floor]:
    """The world at tick 0.

    `storage`: (n,) the identity stored at each index; default 0..n-1. `longest_route`: steps that a
    route may have; default what the floor may ask for.
    """
    scenario = resolved.scenario
    kinematics, durations = scenario.fleet.kinematics, scenario.durations
    zones = scenario.world.zones
    types = types_of(scenario)
    floor = floor_for(resolved.plan, kinematics, durations.move, durations.turn, zones, types)
    starts = homes(resolved, floor, seed)
    orders, slots = build_orders(resolved, floor, seed, starts[0])
    occupancy = floor.occupancy.copy()
    steps = floor.longest_route if longest_route is None else longest_route
    most = len(orders.state)
    robots = build_robots(resolved, floor, starts, occupancy, seed, storage, steps, most)
    n = scenario.fleet.robots
    clock = np.zeros(CLOCK_SIZE, np.int64)
    stations = build_stations(resolved, floor.grid.slot, len(slots.cell), len(orders.state), seed)
    clock[UNDELIVERED] = len(orders.state)
    clock[UNWORKED] = len(stations.done)
    zoning = build_partition(resolved, floor, slots, stations, len(orders.state))
    clock[UNQUEUED] = int(len(zoning.wake) > 0)  # zoning is asked in the first tick
    clock[WAKING] = NIL
    clock[HALTED] = NIL
    clock[NEXT_ORDER] = int(np.count_nonzero(orders.released == 0))
    clock[UNPARKED] = n - int(robots.parked.sum())
    clock[FRESH_ALLOCATION] = n
    clock[SEEN_CHANGES] = NIL
    clock[DIGEST_EVERY] = 1
    tally = Tally(
        times=np.zeros((n, ACTIONS, 2), np.int64),
        ticks=np.zeros((n, ACTIONS, 2), np.int64),
        slowed=np.zeros(n, np.int64),
        spent=np.zeros(n, np.int64),
        charged=np.zeros(n, np.int64),
        repaired=np.zeros(n, np.int64),
        out=np.zeros((n, 3), np.int64),
        illegal=np.zeros(5, np.int64),
        asked=np.zeros(5, np.int64),
    )
    traffic = build_traffic(n, occupancy, floor.grid.zones)
    world = World(
        grid=floor.grid,
        rules=rules_for(scenario, seed),
        robots=robots,
        orders=orders,
        slots=slots,
        stations=stations,
        chargers=build_chargers(floor.grid.kind),
        zoning=zoning,
        traffic=traffic,
        tally=tally,
        clock=clock,
    )
    return world, floor


def build_chargers(kind: Array) -> Chargers:
    cells = np.flatnonzero(kind == CHARGER)
    at = np.full(len(kind), NIL, np.int32)
    at[cells] = np.arange(len(cells), dtype=np.int32)
    return Chargers(
        cell=cells.astype(np.int32),
        at=at,
        way_out=np.full(len(cells), NIL, np.int32),
        first=np.zeros(len(cells), np.int64),
    )


def build_traffic(robots: int, occupancy: Array, zones: int) -> Traffic:
    crowded = len(occupancy) < CROWDED * robots
    table = 64
    while table < 3 * robots:
        table *= 2
    return Traffic(
        occupancy=occupancy,
        want=np.zeros(robots, np.uint8),
        span=np.ones(robots, np.uint16),
        crowd=np.zeros(zones, np.int32),
        holder=np.full((len(occupancy), 2), NIL, np.int32),
        pending=np.zeros((robots, 8), np.int32),
        dirty=np.zeros(robots, np.int32),
        release=np.zeros(4 * robots, np.int32),
        contest=np.full(2 * len(occupancy) if crowded else table, NIL, np.int32),
        key=np.zeros(0 if crowded else table, np.int32),
    )


def build_robots(
    resolved: Resolved,
    floor: Floor,
    starts: tuple[Array, Array],
    occupancy: Array,
    seed: int,
    storage: Array | None,
    longest_route: int,
    orders: int,
) -> Robots:
    """Robots in their bays or on their start cells; occupancy is updated for the latter.

    `starts`: (n,) home cells and bays by identity.
    """
    n = resolved.scenario.fleet.robots
    home, bay = starts
    identity = np.arange(n, dtype=np.int32) if storage is None else storage.astype(np.int32)
    at_index = np.zeros(n, np.int32)
    at_index[identity] = np.arange(n, dtype=np.int32)
    home, bay = home[identity], bay[identity]
    heading = first_headings(floor.grid, home)
    cell = np.where(bay == NIL, home, NIL).astype(np.int32)
    occupy_starts(floor.grid, occupancy, cell[bay == NIL], heading[bay == NIL])
    nil = np.full(n, NIL, np.int32)
    zero8 = np.zeros(n, np.uint8)
    return Robots(
        identity=identity,
        at_index=at_index,
        type=type_of_each(resolved.scenario.fleet)[identity],
        cell=cell,
        claim=nil.copy(),
        heading=heading,
        travel=heading.copy(),
        action=zero8.copy(),
        busy=np.zeros(n, np.uint16),
        priority=np.zeros(n, np.int16),
        load=nil.copy(),
        order=nil.copy(),
        slot=nil.copy(),
        goal=zero8.copy(),
        stand=nil.copy(),
        level=np.zeros(n, np.int32),
        yields=zero8.copy(),
        try_drop=zero8.copy(),
        route=np.zeros((n, longest_route), np.uint8),
        length=np.zeros(n, np.int32),
        at=np.zeros(n, np.int32),
        route_sum=np.zeros(n, np.int64),
        withdrawing=np.zeros(n, np.int16),
        blocked=zero8.copy(),
        hold=zero8.copy(),
        home=home,
        bay=bay,
        parked=np.ones(n, np.uint8),
        zone=nil.copy(),
        charge=first_charges(resolved.scenario, seed)[identity],
        status=zero8.copy(),
        until=np.zeros(n, np.int64),
        ticket=np.zeros(n, np.int64),
        plan=np.zeros((n, longest_plan(n, orders)), np.int32),
        planned=np.zeros(n, np.int32),
        charging_reason=zero8.copy(),
        need=np.full(n, NEED_ALLOCATION, np.uint8),
        reason=np.full(n, FREE, np.uint8),
        route_reason=zero8.copy(),
        asked_at=np.full(n, NIL, np.int64),
        step=np.full(n, NO_STEP, np.uint8),
        did=zero8.copy(),
    )


def longest_plan(robots: int, orders: int) -> int:
    """How many orders a robot may have ahead of it."""
    return max(1, min(orders, LONGEST_PLAN, PLANNED_ORDERS // robots))


def build_buffers(world: World) -> Buffers:
    """The batch and the answers, sized for the world."""
    n, m, s = len(world.robots.cell), len(world.orders.state), len(world.slots.cell)

    def numbers() -> Array:
        return np.zeros(n, np.int32)

    answers = Answers(
        zoning=zoning_answers(world.zoning, n),
        charging=ChargingAnswers(stand=numbers(), level=numbers(), yields=numbers()),
        allocation=AllocationAnswers(
            verb=numbers(),
            order=numbers(),
            slot=numbers(),
            stand=numbers(),
            try_drop=numbers(),
            ask_again=np.zeros(n, np.uint8),
            planned=numbers(),
            plan=np.zeros_like(world.robots.plan),
            order_taken=np.zeros(m, np.uint8),
            slot_taken=np.zeros(s, np.uint8),
        ),
        routing=RoutingAnswers(length=numbers(), steps=np.zeros_like(world.robots.route)),
        right_of_way=RightOfWayAnswers(
            verb=numbers(), value=numbers(), release=numbers(), priority=numbers()
        ),
    )
    batch, asked = (
        Asked(count=np.zeros(1, np.int64), robot=numbers(), reason=np.zeros(n, np.uint8))
        for _ in range(2)
    )
    return Buffers(batch, asked, answers)


def zoning_answers(zoning: Partition, robots: int) -> ZoningAnswers:
    """Room for what zoning answers, sized for a partition; tiny without one."""

    def numbers(count: int) -> Array:
        return np.zeros(count, np.int32)

    orders = len(zoning.queue)
    return ZoningAnswers(
        zone=numbers(robots),
        halt=numbers(robots),
        again=numbers(robots),
        tells=np.zeros(robots, np.uint8),
        said=np.zeros((robots, SAID), np.int64),
        server=numbers(len(zoning.server)),
        redesigned=np.zeros(1, np.int64),
        design=zoning.design.copied(),
        queued=np.zeros(1, np.int64),
        order=numbers(orders),
        queue=numbers(orders),
        stop=numbers(orders),
        direct=np.zeros(orders, np.uint8),
        refused=np.zeros(1, np.int64),
    )


def build_sight(world: World, floor: Floor) -> World:
    """What strategies see: the world itself, or, with limited sight, masked copies."""
    if world.rules.radius == NIL:
        return world
    zoning = world.zoning
    seen = world.replaced(
        robots=world.robots.copied(),
        traffic=build_traffic(len(world.robots.cell), floor.occupancy.copy(), floor.grid.zones),
        tally=world.tally.copied(),
        chargers=build_chargers(world.grid.kind),  # without what the tick notes about robots
        zoning=zoning.replaced(
            halt=zoning.halt.copy(), wake=zoning.wake.copy(), said=zoning.said.copy()
        ),
    )
    if world.rules.own_zones:
        seen = seen.replaced(
            orders=world.orders.copied(),
            stations=world.stations.copied(),
            zoning=zoning.copied().replaced(design=zoning.design.copied()),
        )
    hide_everything(world, seen)
    return seen


def build_record(world: World, ticks: int, arrays: int) -> Record:
    """Buffers of a recording for so many ticks; tiny when nothing is recorded."""
    n, steps = world.robots.route.shape
    orders = world.robots.plan.shape[1]
    words = 3 * n * most_words(steps, orders) + 3 * int(most_zoning_words(world))
    rows = MOST_CHANGES * (n + 1) * max(2, min(ticks, 64)) if ticks else 1
    return Record(
        did=np.zeros((max(ticks, 1), n), np.uint8),
        decisions=np.zeros(words if ticks else 1, np.int64),
        changes=np.zeros((rows, 4), np.int64),
        digests=np.zeros((max(ticks, 1), arrays), np.uint64),
        values=np.zeros(arrays, np.int64),
    )


def build_observation(world: World, ticks: int) -> Observation:
    """Room to observe so many ticks at a time; tiny when nothing is observed."""
    n, cells = (len(world.robots.cell), len(world.grid.kind)) if ticks else (1, 1)
    events = max(16 * ticks, 3 * most_events(world)) if ticks else 1
    nil = np.full(n, NIL, np.int32)
    return Observation(
        cause=np.zeros(n, np.uint8),
        blocker=nil.copy(),
        wanted=nil.copy(),
        since=np.zeros(n, np.int64),
        slow_zone=nil.copy(),
        crowd=np.zeros(n, np.int32),
        ring=np.zeros(n, np.int32),
        lost=np.zeros((n, CAUSE_COUNT), np.int64),
        lost_in_zone=np.zeros(world.grid.zones if ticks else 1, np.int64),
        busy_before=np.zeros(n, np.uint16),
        set_down=nil.copy(),
        load_before=nil.copy(),
        order_before=nil.copy(),
        stays=np.zeros(n, np.int64),
        status_before=np.zeros(n, np.uint8),
        working=np.full(len(world.stations.slot), NIL, np.int32),
        zone_before=world.zoning.design.zone.copy(),
        reshaped=np.full(len(world.zoning.server), NIL, np.int64),
        redesigns=np.zeros(1, np.int64),
        delay=np.zeros((cells, DELAY_COLUMNS), np.int32),
        flow=np.zeros((cells, 4), np.int32),
        count=np.zeros(COUNTS, np.int64),
        events=np.zeros((events, 5), np.int64),
        curve=np.zeros((max(ticks, 1), CURVE_COLUMNS), np.int32),
        scratch=build_scratch(n, cells),
    )


def build_scratch(n: int, cells: int) -> Scratch:
    """What observing n robots on so many cells takes between two phases of a tick."""
    words = np.zeros(-(-n // 8), np.uint64)
    return Scratch(
        count=np.zeros(2, np.int64),
        entry=np.full(n, NIL, np.int32),
        holder=np.full(2 * cells, NIL, np.int32),
        sieve=np.zeros(1 << (4 * n).bit_length(), np.uint8),
        marks=words.view(np.uint8),
        words=words,
        waiters=np.zeros(n, np.int32),
        eventful=np.zeros(n, np.int32),
        color=np.zeros(n, np.int32),
    )


def no_memory() -> Memory:
    """Memory of an absent layer."""
    nothing = np.zeros(0, np.int64)
    return Memory(own=np.zeros((1, 0), np.int64), shared=nothing, parameters=frozen(nothing.copy()))
