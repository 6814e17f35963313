"""Build the arrays of a world at tick 0 from a resolved scenario, in its own ticks or in finer ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from automaton.engine.decision_stream import max_words, max_zoning_words
from automaton.engine.decisions import (
    AllocationDecisions,
    ChargingDecisions,
    Decisions,
    RightOfWayDecisions,
    RoutingDecisions,
    ZoningDecisions,
)
from automaton.engine.events import max_events
from automaton.engine.facilities import (
    Chargers,
    Roads,
    Rules,
    ServiceZones,
    Slots,
    Stations,
    design_for,
)
from automaton.engine.jit.field_kernels import digested_fields
from automaton.engine.motion import POD
from automaton.engine.observation import Observation, ObservationScratch
from automaton.engine.operations import MAX_CHANGES_PER_ROBOT
from automaton.engine.refusals import Refusals
from automaton.engine.state import (
    FOLLOWING_CONVOY,
    NEVER,
    NIL,
    ORDER_WAITING,
    REASON_IDLE,
    Array,
    Batch,
    Clock,
    DeadlockTally,
    Record,
    Robots,
    Tally,
    TimeUse,
    Traffic,
    World,
)
from automaton.engine.visibility import hide_all
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.reachability import grouped
from automaton.floor.traffic_zones import road_network
from automaton.scenario.floor_section import point_names
from automaton.scenario.refinement import begin_of
from automaton.scenario.schema import Scenario
from automaton.strategy.lookup import zone_design_reader
from automaton.units import count
from automaton.world.demand import build_orders, build_stations
from automaton.world.draws import build_delays
from automaton.world.floor_parts import places_of_chargers
from automaton.world.gates import build_gates
from automaton.world.pods import build_pods
from automaton.world.prepared_floor import PreparedFloor, floor_for
from automaton.world.resolved import Resolved
from automaton.world.rules import rules_for
from automaton.world.starts import first_charges, homes, occupy_starts, start_headings
from automaton.world.task_lists import targets_of

MAX_QUEUE_LENGTH = 64  # orders in the queue of a robot
MAX_QUEUED_ORDERS = 4_000_000  # orders in all queues: bounds the memory of large fleets
VALUES_DIGESTED = 7_000  # per tick, on average: about 2 ns each
LONGEST_DIGEST_INTERVAL = 64  # ticks
DIGESTED_ARRAYS = [
    (part, name, declared)
    for part, name, declared in digested_fields(World).values()
    if part and declared.is_array
]
CROWDED = 12  # cells per robot; below, each cell has its own entry in the contest


def build_world(
    resolved: Resolved,
    seed: int,
    storage: Array | None = None,
    longest_route: int | None = None,
    in_convoy: bool = False,
    order_number: int | None = None,
) -> tuple[World, PreparedFloor]:
    """The world at tick 0.

    `storage`: (n,) the identity stored at each index; default 0..n-1. `longest_route`: most steps of a
    route; default: the longest on this floor. `in_convoy`: at tick 0 of a branch, robots may already
    follow each other in moves of several ticks. `order_number`: as in `build_orders`.
    """
    is_refined = resolved.coarse is not None
    in_convoy = in_convoy or is_refined  # moves of one tick then take several
    world, floor = _build_coarse(
        resolved.unrefined, seed, storage, longest_route, in_convoy, order_number
    )
    return refined_world(world, resolved) if is_refined else (world, floor)


def _build_coarse(
    resolved: Resolved,
    seed: int,
    storage: Array | None,
    longest_route: int | None,
    in_convoy: bool,
    order_number: int | None,
) -> tuple[World, PreparedFloor]:
    """The world at tick 0 in the ticks of its scenario."""
    scenario = resolved.scenario
    types = resolved.fleet.types
    floor = floor_for(resolved.floor_plan, scenario.world.traffic_zones, types)
    starts = homes(resolved, seed)
    orders, slots, stops = build_orders(resolved, floor, seed, starts[0], order_number)
    carried = build_pods(resolved, floor, slots, orders, seed)
    if carried.orders is not None and carried.stops is not None:
        orders, stops = carried.orders, carried.stops
    occupancy = floor.occupancy.copy()
    occupancy[slots.cell[carried.pods.slot]] |= POD
    steps = floor.longest_route if longest_route is None else longest_route
    most = len(orders.state)
    robots = build_robots(resolved, floor, starts, occupancy, seed, storage, steps, most)
    n = scenario.fleet.robots
    tally = Tally.sized({"n": n})
    if scenario.stop.when == "on-targets":
        robots.home[:] = targets_of(orders, stops, starts[0])[robots.identity]
        tally.settled[robots.home == robots.cell] = 0
    clock = Clock.zeros()
    stations = build_stations(resolved, floor.grid.slot, len(slots.cell), len(orders.state), seed)
    clock.undelivered = len(orders.state)  # for lines: the number of lines until a trip is known
    clock.open_jobs = len(stations.completion_tick)
    service_zones = build_service_zones(resolved, floor, slots, stations, len(orders.state))
    # Zoning is called in the first tick.
    clock.unqueued_orders = int(len(service_zones.wake) > 0)
    clock.next_wakeup = NIL
    clock.halted_until = NIL
    known = np.flatnonzero((orders.release_tick == 0) & (orders.state == ORDER_WAITING))
    clock.next_release = len(known)
    clock.known_orders = int(known[-1]) + 1 if len(known) else 0
    clock.sequenced = clock.next_release
    clock.unparked = n - int(robots.parked.sum())
    clock.fresh_allocation = n
    clock.allocation_revision = NIL
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
        tally=tally,
        time_use=TimeUse.sized({"n": n}),
        deadlocks=DeadlockTally.sized({"n": n}),
        refusals=Refusals.sized({}),
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
    floor: PreparedFloor,
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
    """The most orders in the queue of a robot."""
    return max(1, min(orders, MAX_QUEUE_LENGTH, MAX_QUEUED_ORDERS // robots))


class Buffers(NamedTuple):
    """What the loop passes to strategies in addition to the view."""

    full_batch: Batch  # the robots concerned
    batch: Batch  # the robots of one call of decide
    decisions: Decisions


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
    """Buffers for the decisions of zoning, sized for a partition; tiny without one."""
    sizes = {"n": robots, "m": len(service_zones.queue), "Z": len(service_zones.server)}
    return ZoningDecisions.sized(sizes, design=service_zones.design.copied())


def build_sight(world: World, floor: PreparedFloor) -> World:
    """The world that strategies see: the world itself or, with limited sight, masked copies."""
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
        time_use=TimeUse.sized({"n": len(world.robots.cell)}),
        deadlocks=DeadlockTally.sized({"n": len(world.robots.cell)}),
        refusals=Refusals.sized({}),
        delays=world.delays.copied(),  # without the delayed robots
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
    """Buffers to record this number of ticks; tiny when nothing is recorded."""
    n, steps = world.robots.route.shape
    orders = world.robots.order_queue.shape[1]
    words = 3 * n * max_words(steps, orders) + 3 * int(max_zoning_words(world))
    rows = MAX_CHANGES_PER_ROBOT * (n + 1) * max(2, min(ticks, 64)) if ticks else 1
    return Record.sized(
        {"T": max(ticks, 1), "n": n, "Y": words if ticks else 1, "X": rows, "D": arrays}
    )


def digest_interval(world: World) -> int:
    """Ticks from one digest of a recording to the next, from the number of digested values."""
    values = 0
    for part, name, declared in DIGESTED_ARRAYS:
        array = getattr(getattr(world, part), name)
        values += len(array) if declared.by else array.size
    return min(1 + values // VALUES_DIGESTED, LONGEST_DIGEST_INTERVAL)


def build_observation(world: World, ticks: int) -> Observation:
    """Buffers to observe this number of ticks at a time; tiny when nothing is observed."""
    n, cells = (len(world.robots.cell), len(world.grid.kind)) if ticks else (1, 1)
    events = max(16 * ticks, 3 * max_events(world)) if ticks else 1
    sizes = {"n": n, "C": cells, "E": events, "T": max(ticks, 1), "k": len(world.stations.slot)}
    sizes |= {"Z": world.grid.traffic_zone_count if ticks else 1}
    return Observation.sized(
        sizes | {"P": len(world.service_zones.server)},
        zone_before=world.service_zones.design.zone.copy(),
        scratch=build_scratch(n, cells),
    )


def build_watch(world: World) -> Observation:
    """Scratch of the search for deadlocks, which looks at robots as an observation does."""
    return build_observation(world, 1)


def build_scratch(n: int, cells: int) -> ObservationScratch:
    """Scratch for observing n robots on this number of cells between two phases of a tick."""
    words = np.zeros(-(-n // 8), np.uint64)
    sizes = {"n": n, "C": cells, "power of two": 1 << (4 * n).bit_length()}
    return ObservationScratch.sized(sizes, marks=words.view(np.uint8), words=words)


# The partition of a world at tick 0: its stations and roads, with nothing designed yet.


class ZoneDesignError(InputError):
    """A zone design that the fleet cannot serve."""


def build_service_zones(
    resolved: Resolved, floor: PreparedFloor, slots: Slots, stations: Stations, orders: int
) -> ServiceZones:
    """Stations and roads if the scenario has a zoning strategy, with one zone for each robot."""
    choice = resolved.strategies.get("zoning")  # a story has no strategies
    robots = resolved.scenario.fleet.robots
    if choice is None or choice.name == "none":
        no_roads = Roads.sized({"P": 0, "S": 0})
        return service_zones_of(no_roads, 0, np.zeros(0, np.int32), 0, 0)

    parameters = resolved.zoning
    station_of = np.full(len(slots.cell), NIL, np.int32)
    if len(stations.slot):
        cells = floor.slot_cell[stations.slot]
        station_of[: slots.first_spare] = stations.at[: slots.first_spare]
    else:
        cells, groups = grouped(resolved.floor_plan, parameters.groups)
        station_of[: slots.first_spare] = groups
    roads = roads_of(resolved.floor_plan, cells)
    serves = served_stations(resolved, slots, station_of, len(cells))
    # Room for at least one order: zones exist without orders, too.
    service_zones = service_zones_of(roads, robots, station_of, max(orders, 1), robots).replaced(
        accessible=serves, has_priority=priorities(resolved, parameters.priority, len(cells))
    )
    if parameters.design is None:
        return service_zones
    names = point_names(resolved.scenario.layout)
    design = zone_design_reader()(resolved.floor_plan, roads, parameters.design, names)
    if len(design.transfer) != robots:
        zones = count(len(design.transfer), "zone")
        raise ZoneDesignError(
            f"the zone design has {zones}, one for each robot; there are {robots}"
        )
    for station, zone in enumerate(design.zone.tolist()):
        if not serves[zone, station]:
            name = resolved.fleet.types[resolved.fleet.type_of[zone]].name
            raise ZoneDesignError(
                f"station {station + 1} is in zone {zone + 1} of the zone design, but robot "
                f"{zone} ({name}) cannot reach it"
            )
    return service_zones.replaced(design=design)


def roads_of(floor_plan: FloorPlan, station_cells: Sequence[int] | Array) -> Roads:
    """station_cells: the drivable flat cell of each station. Raises InputError."""
    return Roads(**road_network(floor_plan, station_cells)._asdict())


def served_stations(resolved: Resolved, slots: Slots, station_of: Array, count: int) -> Array:
    """(n, S) uint8: 1 = a robot reaches all slots of a station that any robot reaches."""
    by_type = np.ones((len(slots.accessible), count), np.uint8)
    anybody = np.logical_or.reduce(slots.accessible)
    for kind, serves in enumerate(slots.accessible):
        out = station_of[anybody & (serves == 0)]
        by_type[kind, out[out != NIL]] = 0
    found: Array = by_type[resolved.fleet.type_of]
    return found


def priorities(resolved: Resolved, priority: dict[str, tuple[int, ...]], count: int) -> Array:
    """(n, S) uint8: 1 = the type of a robot has priority at a station."""
    kinds = resolved.fleet.types
    by_type = np.zeros((len(kinds), count), np.uint8)
    for number, robot_type in enumerate(kinds):
        by_type[number, [station - 1 for station in priority.get(robot_type.name, ())]] = 1
    found: Array = by_type[resolved.fleet.type_of]
    return found


def service_zones_of(
    roads: Roads, zones: int, station_of: Array, orders: int, robots: int
) -> ServiceZones:
    """A partition over some roads in which no station is in a zone."""
    return ServiceZones.sized(
        {"Z": zones, "S": len(roads.point), "m": orders, "n": robots},
        roads=roads,
        design=design_for(roads, zones),
        station_of=station_of,
        server=np.arange(zones, dtype=np.int32),
    )


# A world in finer ticks, from the one in the ticks of its scenario.
#
# Demand, handling times and closings are drawn in coarse ticks and multiplied, so that all refinements
# have the same day. Random events in the run (automaton.engine.random_numbers) keep their
# probabilities, and their tables of ticks are multiplied here.


def refined_world(coarse: World, resolved: Resolved) -> tuple[World, PreparedFloor]:
    """The world at tick 0 of a refined scenario; `coarse`: the world of the scenario as it was read."""
    scenario, factor = resolved.scenario, resolved.scenario.refine
    floor = floor_for(resolved.floor_plan, scenario.world.traffic_zones, resolved.fleet.types)
    orders, lines, stations = coarse.orders, coarse.lines, coarse.stations
    gates, delays, places = coarse.gates, coarse.delays, coarse.pod_stations
    world = coarse.replaced(
        grid=floor.grid,
        rules=_rules(coarse.rules, resolved),
        orders=orders.replaced(
            release_tick=_begins(orders.release_tick, factor), due=_times(orders.due, factor)
        ),
        stops=coarse.stops.replaced(ticks=_times(coarse.stops.ticks, factor)),
        stations=stations.replaced(
            arrival_tick=_begins(stations.arrival_tick, factor),
            processing_time=_times(stations.processing_time, factor),
        ),
        lines=lines.replaced(
            release_tick=_begins(lines.release_tick, factor), due=_times(lines.due, factor)
        ),
        pod_stations=places.replaced(
            ticks_from=_times(places.ticks_from, factor),
            breaks=np.column_stack([places.breaks[:, :1], begin_of(places.breaks[:, 1:], factor)]),
        ),
        gates=gates.replaced(
            closings=begin_of(gates.closings, factor),
            replan_after=factor * gates.replan_after,
            opening_ticks=factor * gates.opening_ticks,
            hold_ticks=factor * gates.hold_ticks,
            travel_ticks=factor * gates.travel_ticks,
            cabin_ticks=_times(gates.cabin_ticks, factor),
        ),
        delays=delays.replaced(ticks=_times(delays.ticks, factor)),
    )
    return world, floor


def _rules(coarse: Rules, resolved: Resolved) -> Rules:
    """The constants of the scenario; probabilities remain per coarse tick, in which they are drawn."""
    factor = resolved.scenario.refine
    fine = rules_for(resolved.scenario, int(coarse.seed), coarse.loaded_types > 0)
    return fine.replaced(
        breakdown=coarse.breakdown,
        repair_in_place=_times(coarse.repair_in_place, factor),
        allocations=coarse.allocations,
        allocation=coarse.allocation,
    )


def _times(ticks: Array, factor: int) -> Array:
    """Ticks as fine ticks; NEVER and NIL stay, and no other tick reaches NEVER."""
    return _kept(ticks, factor * ticks.astype(np.int64))


def _begins(ticks: Array, factor: int) -> Array:
    """The first fine ticks of coarse ticks; otherwise as `_times`."""
    return _kept(ticks, begin_of(ticks.astype(np.int64), factor))


def _kept(ticks: Array, fine: Any) -> Array:
    special = (ticks == NEVER) | (ticks == NIL)
    result: Array = np.where(special, ticks, np.minimum(fine, NEVER - 1)).astype(ticks.dtype)
    return result
