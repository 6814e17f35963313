"""From a resolved scenario to the arrays of a world at tick 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.build.battery import first_charges
from automaton.build.demand import build_orders
from automaton.build.initial_service_zones import build_service_zones
from automaton.build.parts import build_stations
from automaton.build.prepared_floor import Floor, floor_for, frozen
from automaton.build.resolve import Resolved
from automaton.build.rules import rules_for
from automaton.build.starts import first_headings, homes, occupy_starts
from automaton.engine.decision_stream import max_words
from automaton.engine.events import max_events
from automaton.engine.facilities import Chargers
from automaton.engine.observation import (
    CAUSE_COUNT,
    COUNTS,
    CURVE_COLUMNS,
    DELAY_COLUMNS,
    Observation,
    Scratch,
)
from automaton.engine.operations import MAX_CHANGES
from automaton.engine.service_zones import MESSAGE_WORDS, ServiceZones
from automaton.engine.state import (
    ACTION_COUNT,
    CLOCK_ALLOCATION_REVISION,
    CLOCK_DIGEST_EVERY,
    CLOCK_FRESH_ALLOCATION,
    CLOCK_HALTED_UNTIL,
    CLOCK_NEXT_RELEASE,
    CLOCK_NEXT_WAKEUP,
    CLOCK_OPEN_JOBS,
    CLOCK_SIZE,
    CLOCK_UNDELIVERED,
    CLOCK_UNPARKED,
    CLOCK_UNQUEUED_ORDERS,
    NEED_ALLOCATION,
    NIL,
    NO_STEP,
    REASON_IDLE,
    AllocationDecisions,
    Array,
    Batch,
    ChargingDecisions,
    Decisions,
    Memory,
    Record,
    RightOfWayDecisions,
    Robots,
    RoutingDecisions,
    Tally,
    Traffic,
    World,
    ZoningDecisions,
)
from automaton.engine.visibility import hide_all
from automaton.engine.zoning_decision_stream import max_zoning_words
from automaton.floor.cells import CHARGER
from automaton.scenario.robot_types import type_of_each, types_of

MAX_QUEUE_LENGTH = 64  # orders of a robot
MAX_QUEUED_ORDERS = 4_000_000  # of all robots: bounds the memory of large fleets
CROWDED = 12  # cells per robot below which each cell has its entry in the contest


class Buffers(NamedTuple):
    """What the loop passes to strategies besides the view."""

    full_batch: Batch  # the robots concerned
    batch: Batch  # those that one call of decide is about
    decisions: Decisions


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
    zones = scenario.world.traffic_zones
    types = types_of(scenario)
    floor = floor_for(resolved.floor_plan, kinematics, durations.move, durations.turn, zones, types)
    starts = homes(resolved, floor, seed)
    orders, slots = build_orders(resolved, floor, seed, starts[0])
    occupancy = floor.occupancy.copy()
    steps = floor.longest_route if longest_route is None else longest_route
    most = len(orders.state)
    robots = build_robots(resolved, floor, starts, occupancy, seed, storage, steps, most)
    n = scenario.fleet.robots
    clock = np.zeros(CLOCK_SIZE, np.int64)
    stations = build_stations(resolved, floor.grid.slot, len(slots.cell), len(orders.state), seed)
    clock[CLOCK_UNDELIVERED] = len(orders.state)
    clock[CLOCK_OPEN_JOBS] = len(stations.completion_tick)
    service_zones = build_service_zones(resolved, floor, slots, stations, len(orders.state))
    clock[CLOCK_UNQUEUED_ORDERS] = int(
        len(service_zones.wake) > 0
    )  # zoning is asked in the first tick
    clock[CLOCK_NEXT_WAKEUP] = NIL
    clock[CLOCK_HALTED_UNTIL] = NIL
    clock[CLOCK_NEXT_RELEASE] = int(np.count_nonzero(orders.release_tick == 0))
    clock[CLOCK_UNPARKED] = n - int(robots.parked.sum())
    clock[CLOCK_FRESH_ALLOCATION] = n
    clock[CLOCK_ALLOCATION_REVISION] = NIL
    clock[CLOCK_DIGEST_EVERY] = 1
    tally = Tally(
        operations=np.zeros((n, ACTION_COUNT, 2), np.int64),
        ticks=np.zeros((n, ACTION_COUNT, 2), np.int64),
        slowdown_ticks=np.zeros(n, np.int64),
        energy_used=np.zeros(n, np.int64),
        charged=np.zeros(n, np.int64),
        repaired=np.zeros(n, np.int64),
        failures=np.zeros((n, 3), np.int64),
        illegal=np.zeros(5, np.int64),
        batches=np.zeros(5, np.int64),
    )
    traffic = build_traffic(n, occupancy, floor.grid.traffic_zone_count)
    world = World(
        grid=floor.grid,
        rules=rules_for(scenario, seed),
        robots=robots,
        orders=orders,
        slots=slots,
        stations=stations,
        chargers=build_chargers(floor.grid.kind),
        service_zones=service_zones,
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
        charger_at=at,
        exit_cell=np.full(len(cells), NIL, np.int32),
        first_ticket=np.zeros(len(cells), np.int64),
    )


def build_traffic(robots: int, occupancy: Array, zones: int) -> Traffic:
    crowded = len(occupancy) < CROWDED * robots
    table = 64
    while table < 3 * robots:
        table *= 2
    return Traffic(
        occupancy=occupancy,
        intent=np.zeros(robots, np.uint8),
        move_ticks=np.ones(robots, np.uint16),
        zone_occupancy=np.zeros(zones, np.int32),
        holder=np.full((len(occupancy), 2), NIL, np.int32),
        pending=np.zeros((robots, 8), np.int32),
        dirty=np.zeros(robots, np.int32),
        vacated=np.zeros(4 * robots, np.int32),
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
    """Robots in their parking bays or on their start cells; occupancy is updated for the latter.

    `starts`: (n,) home cells and parking bays by identity.
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
        goal_type=zero8.copy(),
        goal_cell=nil.copy(),
        charge_target=np.zeros(n, np.int32),
        charging_interruptible=zero8.copy(),
        try_drop=zero8.copy(),
        route=np.zeros((n, longest_route), np.uint8),
        route_length=np.zeros(n, np.int32),
        route_index=np.zeros(n, np.int32),
        route_hash=np.zeros(n, np.int64),
        retreat_moves=np.zeros(n, np.int16),
        failed_retries=zero8.copy(),
        retry_state=zero8.copy(),
        home=home,
        bay=bay,
        parked=np.ones(n, np.uint8),
        service_zone=nil.copy(),
        charge=first_charges(resolved.scenario, seed)[identity],
        status=zero8.copy(),
        status_until=np.zeros(n, np.int64),
        ticket=np.zeros(n, np.int64),
        order_queue=np.zeros((n, max_queue_length(n, orders)), np.int32),
        order_queue_length=np.zeros(n, np.int32),
        charging_reason=zero8.copy(),
        need=np.full(n, NEED_ALLOCATION, np.uint8),
        reason=np.full(n, REASON_IDLE, np.uint8),
        route_reason=zero8.copy(),
        seen_revision=np.full(n, NIL, np.int64),
        step=np.full(n, NO_STEP, np.uint8),
        executed=zero8.copy(),
    )


def max_queue_length(robots: int, orders: int) -> int:
    """How many orders a robot may have ahead of it."""
    return max(1, min(orders, MAX_QUEUE_LENGTH, MAX_QUEUED_ORDERS // robots))


def build_buffers(world: World) -> Buffers:
    """The batch and the decisions, sized for the world."""
    n, m, s = len(world.robots.cell), len(world.orders.state), len(world.slots.cell)

    def numbers() -> Array:
        return np.zeros(n, np.int32)

    decisions = Decisions(
        zoning=build_zoning_decisions(world.service_zones, n),
        charging=ChargingDecisions(
            goal_cell=numbers(), charge_target=numbers(), charging_interruptible=numbers()
        ),
        allocation=AllocationDecisions(
            command=numbers(),
            order=numbers(),
            slot=numbers(),
            goal_cell=numbers(),
            try_drop=numbers(),
            ask_again=np.zeros(n, np.uint8),
            order_queue_length=numbers(),
            order_queue=np.zeros_like(world.robots.order_queue),
            order_taken=np.zeros(m, np.uint8),
            slot_taken=np.zeros(s, np.uint8),
        ),
        routing=RoutingDecisions(route_length=numbers(), steps=np.zeros_like(world.robots.route)),
        right_of_way=RightOfWayDecisions(
            command=numbers(), value=numbers(), return_order=numbers(), priority=numbers()
        ),
    )
    full_batch, batch = (
        Batch(count=np.zeros(1, np.int64), robot=numbers(), reason=np.zeros(n, np.uint8))
        for _ in range(2)
    )
    return Buffers(full_batch, batch, decisions)


def build_zoning_decisions(service_zones: ServiceZones, robots: int) -> ZoningDecisions:
    """Room for what zoning decides, sized for a partition; tiny without one."""

    def numbers(count: int) -> Array:
        return np.zeros(count, np.int32)

    orders = len(service_zones.queue)
    return ZoningDecisions(
        service_zone=numbers(robots),
        halt=numbers(robots),
        again=numbers(robots),
        sends_message=np.zeros(robots, np.uint8),
        messages=np.zeros((robots, MESSAGE_WORDS), np.int64),
        server=numbers(len(service_zones.server)),
        redesigned=np.zeros(1, np.int64),
        design=service_zones.design.copied(),
        queued=np.zeros(1, np.int64),
        order=numbers(orders),
        queue=numbers(orders),
        next_slot=numbers(orders),
        skips_transfer=np.zeros(orders, np.uint8),
        refused=np.zeros(1, np.int64),
    )


def build_sight(world: World, floor: Floor) -> World:
    """What strategies see: the world itself, or, with limited sight, masked copies."""
    if world.rules.radius == NIL:
        return world
    service_zones = world.service_zones
    visible_world = world.replaced(
        robots=world.robots.copied(),
        traffic=build_traffic(
            len(world.robots.cell), floor.occupancy.copy(), floor.grid.traffic_zone_count
        ),
        tally=world.tally.copied(),
        chargers=build_chargers(world.grid.kind),  # without what the tick notes about robots
        service_zones=service_zones.replaced(
            halt=service_zones.halt.copy(),
            wake=service_zones.wake.copy(),
            messages=service_zones.messages.copy(),
        ),
    )
    if world.rules.own_zones:
        visible_world = visible_world.replaced(
            orders=world.orders.copied(),
            stations=world.stations.copied(),
            service_zones=service_zones.copied().replaced(design=service_zones.design.copied()),
        )
    hide_all(world, visible_world)
    return visible_world


def build_record(world: World, ticks: int, arrays: int) -> Record:
    """Buffers of a recording for so many ticks; tiny when nothing is recorded."""
    n, steps = world.robots.route.shape
    orders = world.robots.order_queue.shape[1]
    words = 3 * n * max_words(steps, orders) + 3 * int(max_zoning_words(world))
    rows = MAX_CHANGES * (n + 1) * max(2, min(ticks, 64)) if ticks else 1
    return Record(
        executed=np.zeros((max(ticks, 1), n), np.uint8),
        decisions=np.zeros(words if ticks else 1, np.int64),
        changes=np.zeros((rows, 4), np.int64),
        digests=np.zeros((max(ticks, 1), arrays), np.uint64),
        values=np.zeros(arrays, np.int64),
    )


def build_observation(world: World, ticks: int) -> Observation:
    """Room to observe so many ticks at a time; tiny when nothing is observed."""
    n, cells = (len(world.robots.cell), len(world.grid.kind)) if ticks else (1, 1)
    events = max(16 * ticks, 3 * max_events(world)) if ticks else 1
    nil = np.full(n, NIL, np.int32)
    return Observation(
        cause=np.zeros(n, np.uint8),
        blocker=nil.copy(),
        wanted=nil.copy(),
        since=np.zeros(n, np.int64),
        slow_zone=nil.copy(),
        slow_zone_occupancy=np.zeros(n, np.int32),
        wait_cycle_ticks=np.zeros(n, np.int32),
        lost=np.zeros((n, CAUSE_COUNT), np.int64),
        lost_in_zone=np.zeros(world.grid.traffic_zone_count if ticks else 1, np.int64),
        busy_before=np.zeros(n, np.uint16),
        dropped=nil.copy(),
        load_before=nil.copy(),
        order_before=nil.copy(),
        stays=np.zeros(n, np.int64),
        status_before=np.zeros(n, np.uint8),
        working=np.full(len(world.stations.slot), NIL, np.int32),
        zone_before=world.service_zones.design.zone.copy(),
        reshaped=np.full(len(world.service_zones.server), NIL, np.int64),
        redesigns=np.zeros(1, np.int64),
        lost_ticks_by_cell=np.zeros((cells, DELAY_COLUMNS), np.int32),
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
    return Memory(
        per_robot=np.zeros((1, 0), np.int64), shared=nothing, parameters=frozen(nothing.copy())
    )
