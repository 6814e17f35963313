"""Visibility: with limited sight a strategy is asked about one robot at a time, with masked copies.

rules.radius   NIL          everything: one call for the whole batch
               ORDER_LIST   the order list, and the neighbouring cells (the robot's bumper)
               r >= 1       the order list, and the robots within r cells (Chebyshev distance, or
                            Euclidean with rules.circle)

With rules.own_zones a strategy sees only orders, jobs and stations in the zones of robots that its
robot sees, and no measured fields of orders.

Hidden robots appear off the floor with nothing to do; their cells look empty. With a radius a
strategy gets only its robot's rows of its own state (automaton.engine.holders).
"""

import numpy as np

from automaton.engine.batches import allocation_of, append
from automaton.engine.facilities import ServiceZones, Stations
from automaton.engine.jit.field_kernels import hiding, showing
from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import CLAIM_BITS, FLAGS_SHIFT
from automaton.engine.state import (
    LAYER_ALLOCATION,
    LAYER_RIGHT_OF_WAY,
    NIL,
    ORDER_UNRELEASED,
    Orders,
    Robots,
    Tally,
)

HIDDEN_POINT = -2  # design.held: the point belongs to a robot out of sight

# Kernels to hide and show an element of a struct: a robot, an order and so on.
hide_robot, show_robot = hiding(Robots, "n"), showing(Robots, "n")
hide_tally, show_tally = hiding(Tally, "n"), showing(Tally, "n")
hide_signals, show_signals = hiding(ServiceZones, "n"), showing(ServiceZones, "n")
hide_order = hiding(Orders, "m", measured=False)
show_order = showing(Orders, "m", measured=False)
hide_queue, show_queue = hiding(ServiceZones, "m"), showing(ServiceZones, "m")
hide_station, show_station = hiding(Stations, "k"), showing(Stations, "k")
hide_job, show_job = hiding(Stations, "j"), showing(Stations, "j")


@kernel
def call_count(world, full_batch, layer):
    """The number of calls of a layer for a batch: one per strategy, or one per robot."""
    if world.rules.radius != NIL:
        return full_batch.count
    return np.int64(world.rules.allocations if layer == LAYER_ALLOCATION else 1)


@kernel
def name_robots(world, full_batch, batch, strategy, call):
    """Enter the robots of call number `call`: those of the strategy in the batch, or one of them."""
    batch.strategy = strategy
    batch.count = 0
    if world.rules.radius != NIL:
        append(batch, np.int64(full_batch.robot[call]), np.int64(full_batch.reason[call]))
        return
    several = world.rules.allocations > 1 and is_allocation(strategy)
    for k in range(full_batch.count):
        i = np.int64(full_batch.robot[k])
        if not several or allocation_of(world, i) == strategy:
            append(batch, i, np.int64(full_batch.reason[k]))


@kernel
def is_allocation(strategy):
    """Whether a strategy allocates orders."""
    return strategy == LAYER_ALLOCATION or strategy > LAYER_RIGHT_OF_WAY


@kernel
def is_visible(world, i, j):
    """Whether robot i sees robot j."""
    if i == j:
        return True
    robots, width = world.robots, world.grid.width
    here = np.int64(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
    radius = max(world.rules.radius, 1)
    for place in (np.int64(robots.cell[j]), np.int64(robots.claim[j])):
        if place != NIL:
            across = abs(place % width - here % width)
            down = abs(place // width - here // width)
            if world.rules.circle and across * across + down * down <= radius * radius:
                return True
            if world.rules.circle == 0 and across <= radius and down <= radius:
                return True
    return False


@kernel
def mask_world(world, visible_world, i):
    """Fill `visible_world` with what robot i sees now."""
    hide_all(world, visible_world)
    for j in range(world.robots.cell.shape[0]):
        if is_visible(world, i, j):
            show_robot(visible_world.robots, world.robots, j)
            reveal_cell(world, visible_world, np.int64(world.robots.cell[j]))
            reveal_cell(world, visible_world, np.int64(world.robots.claim[j]))
            if world.service_zones.wake.shape[0]:
                show_signals(visible_world.service_zones, world.service_zones, j)
                if j != i:
                    visible_world.service_zones.wake[j] = NIL  # the timer of another robot
    if world.rules.own_zones and world.service_zones.queue.shape[0]:
        mask_zones(world, visible_world, i)
    show_tally(visible_world.tally, world.tally, i)


@kernel
def hide_all(world, visible_world):
    """Hide again what has been shown."""
    for j in range(world.robots.cell.shape[0]):
        hide_cell(world, visible_world, np.int64(visible_world.robots.cell[j]))
        hide_cell(world, visible_world, np.int64(visible_world.robots.claim[j]))
        hide_robot(visible_world.robots, j)
        hide_tally(visible_world.tally, j)
        if world.service_zones.wake.shape[0]:
            hide_signals(visible_world.service_zones, j)


@kernel
def is_zone_visible(world, i, zone):
    """Whether robot i sees the robot that serves a zone."""
    if zone == NIL:
        return False
    server = np.int64(world.service_zones.server[zone])
    return server != NIL and is_visible(world, i, np.int64(world.robots.at_index[server]))


@kernel
def zone_of_order(world, order):
    """The zone of an order: of its queue, its slot, or its robot."""
    service_zones = world.service_zones
    if service_zones.queue[order] != NIL:
        queue = np.int64(service_zones.queue[order])
        return queue if queue >= 0 else -2 - queue
    slot = np.int64(world.orders.current_slot[order])
    if slot == NIL or service_zones.station_of[slot] == NIL:
        return np.int64(NIL)
    return np.int64(service_zones.design.zone[service_zones.station_of[slot]])


@kernel
def mask_zones(world, visible_world, i):
    """Show the zones, queues and stations of robots in sight; hide the others."""
    a, b = visible_world.service_zones, world.service_zones
    zones = b.server.shape[0]
    for zone in range(zones):
        a.server[zone] = b.server[zone] if is_zone_visible(world, i, zone) else NIL
    for station in range(b.design.zone.shape[0]):
        zone = np.int64(b.design.zone[station])
        shown = zone != NIL and a.server[zone] != NIL
        a.design.zone[station] = zone if shown else NIL
    for point in range(b.design.held.shape[0]):
        zone = np.int64(b.design.held[point])
        a.design.held[point] = zone if zone == NIL or a.server[zone] != NIL else HIDDEN_POINT
    hide_segments(a.design)
    a.design.segments = b.design.segments
    for segment in range(b.design.segments):
        if a.server[b.design.owner[segment]] != NIL:
            copy_segment(b.design, segment, a.design, segment)
    for x in range(zones):
        for y in range(zones):
            shown = a.server[x] != NIL and a.server[y] != NIL
            for station in range(b.design.zone.shape[0]):
                a.design.transfer[x, y, station] = b.design.transfer[x, y, station] if shown else 0
    mask_orders(world, visible_world, i)
    mask_jobs(world, visible_world)


@kernel
def copy_segment(source, m, design, to):
    """Copy a segment; source and design may be the same."""
    design.owner[to] = source.owner[m]
    design.ends[to, 0] = source.ends[m, 0]
    design.ends[to, 1] = source.ends[m, 1]
    design.points[to] = source.points[m]
    for k in range(source.points[m]):
        design.path[to, k] = source.path[m, k]


@kernel
def hide_segments(design):
    """Hide the owners of segments."""
    for segment in range(design.segments):
        for k in range(design.points[segment]):
            design.path[segment, k] = NIL
        design.points[segment] = 0
        design.owner[segment] = NIL
        design.ends[segment] = NIL


@kernel
def mask_orders(world, visible_world, i):
    """Show orders in the zones of robots in sight, or on these robots; others look unreleased."""
    a, b = visible_world.orders, world.orders
    x, y = visible_world.service_zones, world.service_zones
    for order in range(b.state.shape[0]):
        zone = zone_of_order(world, order)
        shown = zone != NIL and x.server[zone] != NIL
        reserved_by = np.int64(b.reserved_by[order])
        if reserved_by != NIL:
            shown = is_visible(world, i, np.int64(world.robots.at_index[reserved_by]))
        if shown:
            show_order(a, b, order)
            show_queue(x, y, order)
        else:
            hide_order(a, order)
            hide_queue(x, order)
    for k in range(b.release_sequence.shape[0]):
        order = np.int64(b.release_sequence[k])
        a.release_sequence[k] = (
            order if order != NIL and a.state[order] != ORDER_UNRELEASED else NIL
        )


@kernel
def mask_jobs(world, visible_world):
    """Show the queues of stations in the zones of robots in sight."""
    a, b = visible_world.stations, world.stations
    for k in range(b.slot.shape[0]):
        if visible_world.service_zones.design.zone[k] != NIL:
            show_station(a, b, k)
        else:
            hide_station(a, k)
    for job in range(b.completion_tick.shape[0]):
        if visible_world.service_zones.design.zone[b.station[job]] != NIL:
            show_job(a, b, job)
        else:
            hide_job(a, job)


@kernel
def hide_cell(world, visible_world, cell):
    """Make a cell look empty."""
    if cell != NIL:
        cell_flags = np.int64(world.grid.cell_flags[U(cell)])
        # Room in both directions.
        visible_world.traffic.occupancy[U(cell)] = np.uint16((cell_flags << FLAGS_SHIFT) | 96)


@kernel
def reveal_cell(world, visible_world, cell):
    if cell != NIL:
        word = np.int64(world.traffic.occupancy[U(cell)]) & ~CLAIM_BITS
        visible_world.traffic.occupancy[U(cell)] = np.uint16(word)
