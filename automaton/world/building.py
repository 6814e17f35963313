"""From a resolved scenario to the arrays of a world at tick 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from automaton.engine.decision_stream import max_words, max_zoning_words
from automaton.engine.events import max_events
from automaton.engine.facilities import Chargers, ServiceZones
from automaton.engine.jit.field_kernels import digested_fields
from automaton.engine.motion import POD
from automaton.engine.observation import Observation, Scratch
from automaton.engine.operations import MAX_CHANGES
from automaton.engine.state import (
    CLOCK_ALLOCATION_REVISION,
    CLOCK_FRESH_ALLOCATION,
    CLOCK_HALTED_UNTIL,
    CLOCK_KNOWN_ORDERS,
    CLOCK_NEXT_RELEASE,
    CLOCK_NEXT_WAKEUP,
    CLOCK_OPEN_JOBS,
    CLOCK_SEQUENCED,
    CLOCK_SIZE,
    CLOCK_UNDELIVERED,
    CLOCK_UNPARKED,
    CLOCK_UNQUEUED_ORDERS,
    FOLLOWING_CONVOY,
    NIL,
    ORDER_WAITING,
    REASON_IDLE,
    AllocationDecisions,
    Array,
    Batch,
    ChargingDecisions,
    Decisions,
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
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.schema import Scenario
from automaton.world.charger_places import places_of_chargers
from automaton.world.demand import build_orders, build_stations
from automaton.world.disturbances import build_delays
from automaton.world.gates import build_gates
from automaton.world.initial_service_zones import build_service_zones
from automaton.world.pods import build_pods
from automaton.world.prepared_floor import Floor, floor_for
from automaton.world.refined_world import refined_world
from automaton.world.resolve import Resolved
from automaton.world.rules import rules_for
from automaton.world.starts import first_charges, homes, occupy_starts, start_headings

MAX_QUEUE_LENGTH = 64  # orders of a robot
MAX_QUEUED_ORDERS = 4_000_000  # of all robots: bounds the memory of large fleets
VALUES_DIGESTED = 7_000  # in a tick, on average: some 2 ns each
LONGEST_DIGEST_INTERVAL = 64  # ticks
DIGESTED_ARRAYS = [
    (part, name, declared)
    for part, name, declared in digested_fields(World).values()
    if part and declared.is_array
]
CROWDED = 12  # cells per robot below which each cell has its entry in the contest


class Buffers(NamedTuple):
    """What the loop passes to strategies besides the view."""

    full_batch: Batch  # the robots concerned
    batch: Batch  # those that one call of decide is about
    decisions: Decisions


def digest_interval(world: World) -> int:
    """Ticks from one digest of a recording to the next, by how many values one is made of."""
    values = 0
    for part, name, declared in DIGESTED_ARRAYS:
        array = getattr(getattr(world, part), name)
        values += len(array) if declared.by else array.size
    return min(1 + values // VALUES_DIGESTED, LONGEST_DIGEST_INTERVAL)


def build_world(
    resolved: Resolved,
    seed: int,
    storage: Array | None = None,
    longest_route: int | None = None,
    in_convoy: bool = False,
) -> tuple[World, Floor]:
    """The world at tick 0.

    `storage`: (n,) the identity stored at each index; default 0..n-1. `longest_route`: steps that a
    route may have; default what the floor may ask for. `in_convoy`: robots may follow each other in moves
    of several ticks as the run begins, since it branches off from one where they do.
    """
    is_refined = resolved.coarse is not None
    in_convoy = in_convoy or is_refined  # moves of one tick take several then
    world, floor = _build_coarse(resolved.unrefined, seed, storage, longest_route, in_convoy)
    return refined_world(world, resolved) if is_refined else (world, floor)


def _build_coarse(
    resolved: Resolved,
    seed: int,
    storage: Array | None,
    longest_route: int | None,
    in_convoy: bool,
) -> tuple[World, Floor]:
    """The world at tick 0 in the ticks of its scenario."""
    scenario = resolved.scenario
    types = resolved.fleet.types
    floor = floor_for(resolved.floor_plan, scenario.world.traffic_zones, types)
    starts = homes(resolved, seed)
    orders, slots, stops = build_orders(resolved, floor, seed, starts[0])
    carried = build_pods(resolved, floor, slots, orders, seed)
    if carried.orders is not None and carried.stops is not None:
        orders, stops = carried.orders, carried.stops
    occupancy = floor.occupancy.copy()
    occupancy[slots.cell[carried.pods.slot]] |= POD
    steps = floor.longest_route if longest_route is None else longest_route
    most = len(orders.state)
    robots = build_robots(resolved, floor, starts, occupancy, seed, storage, steps, most)
    n = scenario.fleet.robots
    clock = np.zeros(CLOCK_SIZE, np.int64)
    stations = build_stations(resolved, floor.grid.slot, len(slots.cell), len(orders.state), seed)
    clock[CLOCK_UNDELIVERED] = len(orders.state)  # of lines: until a trip is known, the lines
    clock[CLOCK_OPEN_JOBS] = len(stations.completion_tick)
    service_zones = build_service_zones(resolved, floor, slots, stations, len(orders.state))
    # Zoning is asked in the first tick.
    clock[CLOCK_UNQUEUED_ORDERS] = int(len(service_zones.wake) > 0)
    clock[CLOCK_NEXT_WAKEUP] = NIL
    clock[CLOCK_HALTED_UNTIL] = NIL
    known = np.flatnonzero((orders.release_tick == 0) & (orders.state == ORDER_WAITING))
    clock[CLOCK_NEXT_RELEASE] = len(known)
    clock[CLOCK_KNOWN_ORDERS] = int(known[-1]) + 1 if len(known) else 0
    clock[CLOCK_SEQUENCED] = clock[CLOCK_NEXT_RELEASE]
    clock[CLOCK_UNPARKED] = n - int(robots.parked.sum())
    clock[CLOCK_FRESH_ALLOCATION] = n
    clock[CLOCK_ALLOCATION_REVISION] = NIL
    loaded_differ = len(floor.move) > len(types)
    rules = rules_for(scenario, seed, loaded_differ, in_convoy, resolved.allocation_of_types)
    on_floor = starts[0][starts[1] == NIL]
    gates = build_gates(resolved, on_floor, seed, int(rules.tick_us))
    traffic = build_traffic(n, occupancy, floor.grid.traffic_zone_count, rules.following)
    world = World(
        grid=floor.grid,
        rules=rules,
        robots=robots,
        orders=orders,
        stops=stops,
        slots=slots,
        stations=stations,
        pods=carried.pods,
        lines=carried.lines,
        trips=carried.trips,
        pod_stations=carried.stations,
        gates=gates,
        chargers=build_chargers(scenario, resolved.floor_plan),
        service_zones=service_zones,
        traffic=traffic,
        tally=Tally.sized({"n": n}),
        delays=build_delays(scenario.faults.delays, n),
        clock=clock,
    )
    return world, floor


def build_chargers(scenario: Scenario, floor_plan: FloorPlan) -> Chargers:
    by_cell = places_of_chargers(scenario, floor_plan)
    cells, places = np.array(list(by_cell), np.int32), np.array(list(by_cell.values()), np.int32)
    at = np.full(floor_plan.kind.size, NIL, np.int32)
    at[cells] = np.arange(len(cells), dtype=np.int32)
    return Chargers.sized(cell=cells.astype(np.int32), charger_at=at, places=places)


def build_traffic(robots: int, occupancy: Array, zones: int, following: int) -> Traffic:
    crowded = len(occupancy) < CROWDED * robots
    table = 64
    while table < 3 * robots:
        table *= 2
    sizes = {"n": robots, "Z": zones, "T": 2 * len(occupancy) if crowded else table}
    sizes |= {"H": 0 if crowded else table}
    sizes |= {"L": 2 * len(occupancy) if following == FOLLOWING_CONVOY else 0}
    return Traffic.sized(sizes, occupancy=occupancy)


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
    heading = start_headings(resolved.fleet, floor.grid, home)[identity]
    home, bay = home[identity], bay[identity]
    cell = np.where(bay == NIL, home, NIL).astype(np.int32)
    occupy_starts(floor.grid, occupancy, cell[bay == NIL], heading[bay == NIL])
    return Robots.sized(
        {"R": longest_route, "L": max_queue_length(n, orders)},
        identity=identity,
        at_index=at_index,
        type=resolved.fleet.type_of[identity],
        cell=cell,
        heading=heading,
        travel=heading.copy(),
        home=home,
        bay=bay,
        charge=first_charges(resolved.scenario, seed)[identity],
        reason=np.full(n, REASON_IDLE, np.uint8),
    )


def max_queue_length(robots: int, orders: int) -> int:
    """How many orders a robot may have ahead of it."""
    return max(1, min(orders, MAX_QUEUE_LENGTH, MAX_QUEUED_ORDERS // robots))


def build_buffers(world: World) -> Buffers:
    """The batch and the decisions, sized for the world."""
    n, steps = world.robots.route.shape
    sizes = {"n": n, "R": steps, "L": world.robots.order_queue.shape[1]}
    sizes |= {"m": len(world.orders.state), "s": len(world.slots.cell)}
    decisions = Decisions(
        zoning=build_zoning_decisions(world.service_zones, n),
        charging=ChargingDecisions.sized(sizes),
        allocation=AllocationDecisions.sized(sizes),
        routing=RoutingDecisions.sized(sizes),
        right_of_way=RightOfWayDecisions.sized(sizes),
    )
    return Buffers(Batch.sized(sizes), Batch.sized(sizes), decisions)


def build_zoning_decisions(service_zones: ServiceZones, robots: int) -> ZoningDecisions:
    """Room for what zoning decides, sized for a partition; tiny without one."""
    sizes = {"n": robots, "m": len(service_zones.queue), "Z": len(service_zones.server)}
    return ZoningDecisions.sized(sizes, design=service_zones.design.copied())


def build_sight(world: World, floor: Floor) -> World:
    """What strategies see: the world itself, or, with limited sight, masked copies."""
    if world.rules.radius == NIL:
        return world
    service_zones = world.service_zones
    visible_world = world.replaced(
        robots=world.robots.copied(),
        traffic=build_traffic(
            len(world.robots.cell),
            floor.occupancy.copy(),
            floor.grid.traffic_zone_count,
            world.rules.following,
        ),
        tally=world.tally.copied(),
        delays=world.delays.copied(),  # without who is delayed
        chargers=world.chargers.copied(),
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
    return Record.sized(
        {"T": max(ticks, 1), "n": n, "Y": words if ticks else 1, "X": rows, "D": arrays}
    )


def build_observation(world: World, ticks: int) -> Observation:
    """Room to observe so many ticks at a time; tiny when nothing is observed."""
    n, cells = (len(world.robots.cell), len(world.grid.kind)) if ticks else (1, 1)
    events = max(16 * ticks, 3 * max_events(world)) if ticks else 1
    sizes = {"n": n, "C": cells, "E": events, "T": max(ticks, 1), "k": len(world.stations.slot)}
    sizes |= {"Z": world.grid.traffic_zone_count if ticks else 1}
    return Observation.sized(
        sizes | {"P": len(world.service_zones.server)},
        zone_before=world.service_zones.design.zone.copy(),
        scratch=build_scratch(n, cells),
    )


def build_scratch(n: int, cells: int) -> Scratch:
    """What observing n robots on so many cells takes between two phases of a tick."""
    words = np.zeros(-(-n // 8), np.uint64)
    sizes = {"n": n, "C": cells, "power of two": 1 << (4 * n).bit_length()}
    return Scratch.sized(sizes, marks=words.view(np.uint8), words=words)
