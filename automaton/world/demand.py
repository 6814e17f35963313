"""The orders of a run at tick 0, the slots between which they are carried, and their stops.

Orders are released at once, one by one, in bursts, at the rates of a profile, in a closed loop, or as
listed; orders of parts when
the previous job is done. Draws depend only on the seed and the number of the order or burst, so all
fleets and strategies face the same demand. For a closed loop only the sequence is drawn: deliveries
determine its release ticks.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from automaton.engine import random_numbers
from automaton.engine.facilities import Slots, Stations, Stops
from automaton.engine.state import NEVER, NIL, ORDER_UNRELEASED, ORDER_WAITING, Array, Orders
from automaton.floor.floor_plan import DESTINATION, DOCK, RACK, STATION
from automaton.scenario.orders import (
    DRAWN_GENERATORS,
    OrderLine,
)
from automaton.scenario.orders import (
    MAX_STOPS as MAX_STOPS,
)
from automaton.scenario.orders import Orders as OrdersGiven
from automaton.scenario.schema import Scenario
from automaton.world.capabilities import FleetOnFloor, Service, served_with_load, service_for
from automaton.world.draws import geometric, integers, uniform_draws
from automaton.world.prepared_floor import PreparedFloor
from automaton.world.release_ticks import PARTS, gaps, profile_ticks, ticks_by_rank
from automaton.world.resolved import Resolved
from automaton.world.rules import may_fail
from automaton.world.task_lists import (
    assign_in_turn,
    cells_of_tasks,
    order_count,
    stop_groups,
)

DRAW_RELEASE_SEQUENCE, DRAW_WEIGHT = 2, 3  # draws of an order besides its two ends
DRAW_STOP_COUNT: Final = 4
DRAW_STOP: Final = 16  # and above: first stop, second stop, ...


def build_orders(
    resolved: Resolved, floor: PreparedFloor, seed: int, homes: Array, number: int | None
) -> tuple[Orders, Slots, Stops]:
    """Orders (by slot in table order, as listed, or as drawn), the slots, and the stops of orders.

    Slots are served from the cells that robots can reach and return from. `homes`: (n,) start cells of
    robots by identity. `number`: of orders of a repeated list; None: as many as robots can do.
    """
    fleet = resolved.fleet
    first = np.cumsum([0, *fleet.counts[:-1]])  # robots of each type begin in one part of the floor
    service = service_for(
        resolved.floor_plan.without_weights(), fleet.types, tuple(homes[first].tolist())
    )
    if resolved.scenario.orders.parts is not None:
        source, target, released = part_orders(resolved, floor.grid.slot)
        coming = np.full(len(source), NIL)
    else:
        source, target = sources_and_targets(resolved, floor, service.access, seed, number)
        released, coming = releases(resolved.scenario, len(source), seed)
    weight = weights(resolved.scenario.orders, len(source), seed)
    slots = slots_of(resolved, floor, service, source)
    first_stop, stops = build_stops(resolved, service, len(source), seed, homes)
    orders = orders_of(source, target, released, coming, weight, first_stop)
    if resolved.scenario.orders.listed is not None:
        orders.priority[:] = [line.priority for line in resolved.scenario.orders.listed]
        orders.due[:] = due_ticks(resolved.scenario.orders.listed)
    if resolved.scenario.orders.assign == "round-robin":
        assign_in_turn(orders, stops, homes, resolved.scenario.orders.skip_reached)
    return orders, slots, stops


def weights(orders: OrdersGiven, count: int, seed: int) -> Array:
    """(count,) int32: the weight of each order."""
    if orders.listed is not None:
        return np.array([line.weight for line in orders.listed], np.int32)
    if orders.parts is not None:
        ways = [kind.count * (len(kind.route) - 1) for kind in orders.parts]
        return np.repeat(np.array([kind.weight for kind in orders.parts], np.int32), ways)
    if isinstance(orders.weight, int):
        return np.full(count, orders.weight, np.int32)
    least, most = orders.weight.least, orders.weight.most
    above = integers(count, most - least + 1, seed, random_numbers.STREAM_ORDERS, DRAW_WEIGHT)
    return (least + above).astype(np.int32)


def due_ticks(listed: Iterable[OrderLine]) -> list[int]:
    """The due tick of each order, at most what the array can hold; NEVER without a due time."""
    ticks = (line.due_tick for line in listed)
    return [NEVER if tick is None else min(tick, NEVER - 1) for tick in ticks]


def orders_of(
    source: Array,
    target: Array,
    released: Array,
    coming: Array,
    weight: Array,
    first_stop: Array,
) -> Orders:
    """New orders: source, target, release, sequence and weight.

    All arrays are (m,), except (m + 1,) for the first stop of each order.
    """
    return Orders.sized(
        state=np.where(released > 0, ORDER_UNRELEASED, ORDER_WAITING).astype(np.uint8),
        current_slot=source.astype(np.int32).copy(),
        source=source.astype(np.int32),
        target=target.astype(np.int32),
        release_tick=released.astype(np.int32),
        weight=weight.astype(np.int32),
        release_sequence=coming.astype(np.int32),
        first_stop=first_stop,
    )


def slots_of(resolved: Resolved, floor: PreparedFloor, service: Service, source: Array) -> Slots:
    """The slots of the floor with the loads of orders that begin at `source`, plus spare slots."""
    spare = len(floor.slot_cell)
    more = resolved.scenario.fleet.robots if may_fail(resolved.scenario) else 0
    content = np.full(spare + more, NIL, np.int32)
    with_load = np.flatnonzero(source != NIL)
    on_shelf = with_load[floor.slot_endless[source[with_load]] == 0]
    content[source[on_shelf]] = on_shelf
    reachable, accessible = service.reachable, service.accessible
    if len(floor.move) > len(reachable):
        reachable, accessible = with_loaded_types(resolved.fleet, service)
    nobody = np.zeros((len(reachable), more), np.uint8)
    cell = np.concatenate([floor.slot_cell, np.full(more, NIL, np.int32)])
    return Slots.sized(
        cell=cell,
        unbounded=np.concatenate([floor.slot_endless, np.ones(more, np.uint8)]),
        content=content,
        access=np.concatenate([service.access, np.full((more, 4), NIL, np.int32)]),
        accessible=np.concatenate([accessible, nobody], axis=1),
        first_spare=spare,
        reachable=reachable,
    )


def with_loaded_types(fleet: FleetOnFloor, service: Service) -> tuple[Array, Array]:
    """(2 K, C) and (2 K, s): cells and slots within reach of each type, without and with a load."""
    loaded = fleet.with_load(service)
    serves = served_with_load(service.access, loaded)
    return (
        np.concatenate([service.reachable, loaded]).astype(np.uint8),
        np.concatenate([serves, serves]).astype(np.uint8),
    )


def sources_and_targets(
    resolved: Resolved, floor: PreparedFloor, access: Array, seed: int, number: int | None
) -> tuple[Array, Array]:
    """(m,) slots where the orders begin and end; NIL for those without a load."""
    orders = resolved.scenario.orders
    kinds = floor.grid.kind[floor.slot_cell]
    if orders.listed is not None:
        cell, slot_of = resolved.floor_plan.cell, floor.grid.slot
        ends = [
            [NIL if end is None else slot_of[cell(*end)] for end in (line.source, line.target)]
            for line in orders.listed
        ]
        source, target = np.array(ends, np.int32).T
        return source, target
    if orders.lines is not None:  # trips are created during the run
        return np.zeros(0, np.int32), np.zeros(0, np.int32)
    if orders.generator == "tours" or orders.tasks is not None:
        count = order_count(resolved.scenario, resolved.floor_plan) if number is None else number
        count = len(profile_ticks(resolved.scenario, seed)) if orders.follows_profile else count
        return np.full(count, NIL, np.int32), np.full(count, NIL, np.int32)
    if orders.generator in DRAWN_GENERATORS:
        served = (access != NIL).any(axis=1)
        count = orders.count or 0
        if orders.follows_profile:
            count = len(profile_ticks(resolved.scenario, seed))
        if orders.generator == "dock-to-rack":
            docks, racks = (np.flatnonzero((kinds == kind) & served) for kind in (DOCK, RACK))
            return drawn(docks, count, seed, 0), drawn(racks, count, seed, 1)
        return among_stations(
            np.flatnonzero((kinds == STATION) & served), count, orders.generator == "visits", seed
        )
    loaded = floor.slot_endless == 0
    if orders.generator == "picture-loads":
        loaded &= resolved.floor_plan.loads.reshape(-1)[floor.slot_cell] == 1
    source = np.flatnonzero(loaded).astype(np.int32)
    return source, drawn(np.flatnonzero(kinds == DESTINATION), len(source), seed, 0)


def among_stations(stations: Array, count: int, are_visits: bool, seed: int) -> tuple[Array, Array]:
    """(m,) slots of visits, or of transports between two different stations."""
    source = drawn(stations, count, seed, 0)
    if are_visits:
        return source, source.copy()
    others = drawn(np.arange(len(stations) - 1), count, seed, 1)
    at = np.searchsorted(stations, source)
    target: Array = stations[(at + 1 + others) % len(stations)].astype(np.int32)
    return source, target


def drawn(slots: Array, count: int, seed: int, what: int) -> Array:
    """(count,) int32: slots drawn uniformly, with replacement; `what` addresses the draws."""
    choice = integers(count, len(slots), seed, random_numbers.STREAM_ORDERS, what)
    chosen: Array = slots[choice].astype(np.int32)
    return chosen


def routes(orders: OrdersGiven) -> list[tuple[int, ...]]:
    """The stations of each part: parts as listed, one after another."""
    return [kind.route for kind in orders.parts or () for _ in range(kind.count)]


def part_ticks(orders: OrdersGiven, seed: int) -> list[int]:
    """The tick in which each part arrives."""
    ticks: list[int] = []
    for row, kind in enumerate(orders.parts or ()):
        between = gaps(kind.interarrival_time, kind.count, seed, PARTS + row)
        after = np.concatenate([[0], np.cumsum(between[:-1])])
        ticks += np.minimum(kind.first_release + after, NEVER - 1).tolist()
    return ticks


def work_ticks(orders: OrdersGiven, station: Array, part: Array, place: Array, seed: int) -> Array:
    """(j,) int64: processing ticks of jobs, by station from 0; draws by part and index in the route."""
    ticks = np.zeros(len(station), np.int64)
    times = (
        orders.processing_time
        if isinstance(orders.processing_time, tuple)
        else (orders.processing_time,)
    )
    for number, time in enumerate(times):
        here = np.flatnonzero(station == number) if len(times) > 1 else np.arange(len(ticks))
        if isinstance(time, int):
            ticks[here] = time
        else:
            ticks[here] = geometric(
                time.mean, seed, random_numbers.STREAM_PROCESSING_TIMES, part[here], place[here]
            )
    return ticks


def part_orders(resolved: Resolved, slot_of: Array) -> tuple[Array, Array, Array]:
    """(m,) each: source slots, target slots and release ticks of the orders of all parts."""
    slots = slot_of[resolved.floor_plan.stations]
    ways = [
        (slots[here - 1], slots[then - 1])
        for route in routes(resolved.scenario.orders)
        for here, then in itertools.pairwise(route)
    ]
    source, target = np.array(ways, np.int32).reshape(-1, 2).T
    return source, target, np.full(len(ways), NEVER, np.int64)


def build_stations(
    resolved: Resolved, slot_of: Array, slots: int, orders: int, seed: int
) -> Stations:
    """The stations of the floor, by number, and the jobs of all parts; `slots`: spare ones included."""
    scenario = resolved.scenario.orders
    cells = resolved.floor_plan.stations
    at = np.full(slots, NIL, np.int32)
    at[slot_of[cells]] = np.arange(len(cells), dtype=np.int32)
    works: list[tuple[int, int, int, int, int]] = []  # station, place, part, frees, came
    arrives = np.full(orders, NIL, np.int32)
    order = 0
    coming = part_ticks(scenario, seed)
    for part, route in enumerate(routes(scenario)):
        for place, number in enumerate(route):
            last = place == len(route) - 1
            if place:
                arrives[order - 1] = len(works)
            came = NIL if place else coming[part]
            works.append((number - 1, place, part, NIL if last else order, came))
            order += not last
    table = np.array(works, np.int32).reshape(-1, 5).T
    station, place_of, part_of, frees, comes = (column.copy() for column in table)
    entering = np.flatnonzero(comes != NIL).astype(np.int32)
    entering = entering[np.argsort(comes[entering], kind="stable")]
    return Stations.sized(
        at=at,
        slot=slot_of[cells].astype(np.int32),
        part_arrivals=entering,
        station=station,
        processing_time=work_ticks(scenario, station, part_of, place_of, seed).astype(np.int32),
        part=part_of,
        releases_order=frees,
        arrival_tick=comes,
        job_of_order=arrives,
    )


def releases(scenario: Scenario, count: int, seed: int) -> tuple[Array, Array]:
    """(count,) int64 each: the ticks from which orders are known, and their sequence."""
    orders = scenario.orders
    if orders.listed is not None:
        released = np.array([line.release for line in orders.listed], np.int64)
        return released, np.argsort(released, kind="stable")
    in_system = orders.in_system(scenario.fleet.robots)
    ticks = np.minimum(ticks_by_rank(scenario, count, seed, in_system), NEVER)
    sequence = np.arange(count)
    if (
        orders.generator not in (*DRAWN_GENERATORS, None) and ticks.any()
    ):  # not row by row of shelves
        sequence = drawn_sequence(count, seed)
    released = np.zeros(count, np.int64)
    released[sequence] = ticks
    return released, sequence if in_system else np.argsort(released, kind="stable")


def drawn_sequence(count: int, seed: int) -> Array:
    """(count,) int64: all orders in a random sequence."""
    keys = np.zeros(count, np.uint64)
    numbers, what = np.arange(count), np.full(count, DRAW_RELEASE_SEQUENCE)
    with np.errstate(over="ignore"):
        random_numbers.random_bits_of_each(
            keys, np.uint64(seed), random_numbers.STREAM_ORDERS, what, numbers
        )
    return np.argsort(keys, kind="stable")


# The stops of orders: as listed, of tasks, or drawn for the generator tours by order and place.


def build_stops(
    resolved: Resolved, service: Service, orders: int, seed: int, homes: Array
) -> tuple[Array, Stops]:
    """(orders + 1,) int32 the index of the first stop of each order, and all stops."""
    demand = resolved.scenario.orders
    count = np.zeros(orders, np.int64)
    cells = np.zeros(0, np.int64)
    ticks = None
    if demand.listed is not None:
        listed = [line.stop_cells for line in demand.listed]
        count = np.array([len(stops) for stops in listed], np.int64)
        cell = resolved.floor_plan.cell
        cells = np.array([cell(x, y) for stops in listed for x, y in stops], np.int64)
        ticks = np.array([one for line in demand.listed for one in line.stop_ticks], np.int32)
    elif demand.tasks is not None:
        count, cells = stops_of_tasks(resolved, orders)
    elif demand.generator == "tours":
        count = stop_counts(demand, orders, seed)
        groups = stop_groups(demand, resolved.floor_plan, service.reachable)
        if demand.assign == "round-robin":
            cells = stops_of_robots(groups, count, homes, seed)
        else:
            cells = drawn_stops(groups[0], count, seed)
    first = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    if ticks is None:
        ticks = np.zeros(len(cells), np.int32)
    return first, Stops.sized({"v": len(cells)}, cell=cells.astype(np.int32), ticks=ticks)


def tour_cells(resolved: Resolved, reachable: Array) -> list[Array]:
    """The cells of the stops of tours, by group; `reachable`: (K, C) by robot type."""
    return stop_groups(resolved.scenario.orders, resolved.floor_plan, reachable)


def stops_of_tasks(resolved: Resolved, orders: int) -> tuple[Array, Array]:
    """The number of stops of each order, and all their cells: task k is line k modulo the line count."""
    count, cells = cells_of_tasks(resolved.scenario.orders, resolved.floor_plan)
    first = np.concatenate([[0], np.cumsum(count)])
    line = np.arange(orders) % len(count)
    begins = np.repeat(first[line], count[line])
    within = np.arange(len(begins)) - np.repeat(np.cumsum(count[line]) - count[line], count[line])
    return count[line], cells[begins + within]


def stops_of_robots(groups: Sequence[Array], count: Array, homes: Array, seed: int) -> Array:
    """The stops of orders that robots share in turn, one order after another: `count` of each.

    Draws depend on the robot and the number of its order. Two groups alternate, beginning with the first
    unless the robot starts in it.
    """
    order = np.repeat(np.arange(len(count)), count)
    within = np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    number, robot = np.divmod(order, len(homes))
    address = random_numbers.STREAM_VISITS, number * MAX_STOPS + within, robot
    share = uniform_draws(seed, address)
    begins = np.isin(homes, groups[0])[robot]
    group = (number * count[order] + within + begins) % len(groups)
    cells = np.zeros(len(order), np.int64)
    for place, members in enumerate(groups):
        chosen = group == place
        cells[chosen] = members[(share[chosen] * len(members)).astype(np.int64)]
    return cells


def stop_counts(orders: OrdersGiven, count: int, seed: int) -> Array:
    """(count,) int64: the number of stops of each order."""
    if isinstance(orders.stops, int):
        return np.full(count, orders.stops, np.int64)
    least, most = orders.stops.least, orders.stops.most
    counts: Array = least + integers(
        count, most - least + 1, seed, random_numbers.STREAM_ORDERS, DRAW_STOP_COUNT
    )
    return counts


def drawn_stops(cells: Array, count: Array, seed: int) -> Array:
    """The stops of orders, one order after another: `count` of each, drawn from cells.

    The first stop is any of the cells; each further stop is any cell except the previous one.
    """
    most = int(count.max(initial=0))
    places = np.zeros((len(count), most), np.int64)  # among `cells`
    for stop in range(most):
        others = len(cells) - (stop > 0)
        draws = integers(len(count), others, seed, random_numbers.STREAM_ORDERS, DRAW_STOP + stop)
        places[:, stop] = (places[:, stop - 1] + 1 + draws) % len(cells) if stop else draws
    chosen: Array = cells[places[np.arange(most) < count[:, None]]]
    return chosen
