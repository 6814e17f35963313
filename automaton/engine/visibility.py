"""What a robot sees: with limited sight a strategy is asked robot by robot, with masked copies.

rules.radius   NIL          everything: one call for the whole batch
               ORDER_LIST   the order list, and the neighbouring cells (the robot's bumper)
               r >= 1       the order list, and the robots within r cells (Chebyshev distance, or
                            Euclidean with rules.circle)

With rules.own_zones a strategy knows no other orders, works and stations than those of the zones of
the robots that its robot sees.

Hidden robots look like robots in no cell, with nothing to do; their cells look empty. Under a radius
a strategy gets its robot's own row of memory only, and no shared memory.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.motion import CLAIMS, FLAGS_SHIFT, U
from automaton.engine.state import ACTION_COUNT, NEVER, NIL, NO_STEP, ORDER_UNRELEASED
from automaton.engine.zone_segments import copy_segment

HIDDEN = -2  # design.held: the point belongs to a robot out of sight


@kernel
def call_count(world, full_batch):
    """How often a layer is called for a batch."""
    return 1 if world.rules.radius == NIL else full_batch.count[0]


@kernel
def begin_call(world, visible_world, full_batch, batch, memory, full_memory, call):
    """Prepare call number `call`: the robots asked, what they see, what they remember."""
    name_robots(world, full_batch, batch, call)
    if world.rules.radius == NIL:
        return
    i = np.int64(full_batch.robot[call])
    mask_world(world, visible_world, i)
    if world.rules.radius > 0:
        for k in range(memory.per_robot.shape[1]):
            memory.per_robot[i, k] = full_memory.per_robot[i, k]


@kernel
def name_robots(world, full_batch, batch, call):
    """Enter the robots that call number `call` is about: the whole batch, or one of it."""
    everything = world.rules.radius == NIL
    first = 0 if everything else call
    count = full_batch.count[0] if everything else 1
    batch.count[0] = count
    for k in range(count):
        batch.robot[k] = full_batch.robot[first + k]
        batch.reason[k] = full_batch.reason[first + k]


@kernel
def end_call(world, memory, full_memory, full_batch, call):
    """Put the memory of the robot away."""
    if world.rules.radius > 0:
        i = np.int64(full_batch.robot[call])
        for k in range(memory.per_robot.shape[1]):
            full_memory.per_robot[i, k] = memory.per_robot[i, k]
            memory.per_robot[i, k] = 0
        memory.shared[:] = 0


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
            reveal_robot(world, visible_world, j)
            reveal_cell(world, visible_world, np.int64(world.robots.cell[j]))
            reveal_cell(world, visible_world, np.int64(world.robots.claim[j]))
            reveal_zoning(world, visible_world, i, j)
    if world.rules.own_zones and world.service_zones.queue.shape[0]:
        mask_zones(world, visible_world, i)
    for action in range(ACTION_COUNT):
        for loaded in range(2):
            visible_world.tally.operations[i, action, loaded] = world.tally.operations[
                i, action, loaded
            ]
            visible_world.tally.ticks[i, action, loaded] = world.tally.ticks[i, action, loaded]
    visible_world.tally.slowdown_ticks[i] = world.tally.slowdown_ticks[i]


@kernel
def hide_all(world, visible_world):
    """Take back what has been shown."""
    for j in range(world.robots.cell.shape[0]):
        hide_cell(world, visible_world, np.int64(visible_world.robots.cell[j]))
        hide_cell(world, visible_world, np.int64(visible_world.robots.claim[j]))
        hide_robot(visible_world, j)


@kernel
def is_zone_visible(world, i, zone):
    """Whether robot i sees the robot that serves a zone."""
    if zone == NIL:
        return False
    server = np.int64(world.service_zones.server[zone])
    return server != NIL and is_visible(world, i, np.int64(world.robots.at_index[server]))


@kernel
def zone_of_order(world, order):
    """The zone that has an order: in whose queue it is, or in which it lies, or that of its robot."""
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
    """Show the zones, queues and stations of robots in sight; the others look as if there were none."""
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
        a.design.held[point] = zone if zone == NIL or a.server[zone] != NIL else HIDDEN
    hide_segments(a.design)
    a.design.segments[0] = b.design.segments[0]
    for segment in range(b.design.segments[0]):
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
def hide_segments(design):
    """Segments look as if no robot owned them."""
    for segment in range(design.segments[0]):
        for k in range(design.points[segment]):
            design.path[segment, k] = NIL
        design.points[segment] = 0
        design.owner[segment] = NIL
        design.ends[segment] = NIL


@kernel
def mask_orders(world, visible_world, i):
    """Orders in the zones of robots in sight, or on these robots; others look as if still to come."""
    a, b, x, y = (
        visible_world.orders,
        world.orders,
        visible_world.service_zones,
        world.service_zones,
    )
    for order in range(b.state.shape[0]):
        zone = zone_of_order(world, order)
        shown = zone != NIL and x.server[zone] != NIL
        reserved_by = np.int64(b.reserved_by[order])
        if reserved_by != NIL:
            shown = is_visible(world, i, np.int64(world.robots.at_index[reserved_by]))
        a.state[order] = b.state[order] if shown else ORDER_UNRELEASED
        a.current_slot[order] = b.current_slot[order] if shown else NIL
        a.source[order] = b.source[order] if shown else NIL
        a.target[order] = b.target[order] if shown else NIL
        a.reserved_by[order] = reserved_by if shown else NIL
        a.release_tick[order] = b.release_tick[order] if shown else NEVER
        a.weight[order] = b.weight[order] if shown else 0
        a.dispatched[order] = b.dispatched[order] if shown else NIL
        a.dispatched_from[order] = b.dispatched_from[order] if shown else NIL
        a.delivered[order] = b.delivered[order] if shown else NIL
        a.legs[order] = b.legs[order] if shown else 0
        x.queue[order] = y.queue[order] if shown else NIL
        x.next_slot[order] = y.next_slot[order] if shown else NIL
        x.skips_transfer[order] = y.skips_transfer[order] if shown else 0
        x.picked_from[order] = y.picked_from[order] if shown else NIL
    for k in range(b.release_sequence.shape[0]):
        order = np.int64(b.release_sequence[k])
        a.release_sequence[k] = (
            order if order != NIL and a.state[order] != ORDER_UNRELEASED else NIL
        )


@kernel
def mask_jobs(world, visible_world):
    """Lines of stations in the zones of robots in sight."""
    a, b = visible_world.stations, world.stations
    for k in range(b.slot.shape[0]):
        shown = visible_world.service_zones.design.zone[k] != NIL
        a.in_service[k] = b.in_service[k] if shown else NIL
        a.queue_tail[k] = b.queue_tail[k] if shown else NIL
        a.job_done_tick[k] = b.job_done_tick[k] if shown else 0
    for work in range(b.completion_tick.shape[0]):
        shown = visible_world.service_zones.design.zone[b.station[work]] != NIL
        a.next_in_queue[work] = b.next_in_queue[work] if shown else NIL
        a.arrival_tick[work] = b.arrival_tick[work] if shown else NIL
        a.completion_tick[work] = b.completion_tick[work] if shown else NIL


@kernel
def hide_cell(world, visible_world, cell):
    """The cell looks empty."""
    if cell != NIL:
        cell_flags = np.int64(world.grid.cell_flags[U(cell)])
        visible_world.traffic.occupancy[U(cell)] = np.uint16(
            (cell_flags << FLAGS_SHIFT) | 96
        )  # room both ways


@kernel
def reveal_cell(world, visible_world, cell):
    if cell != NIL:
        word = np.int64(world.traffic.occupancy[U(cell)]) & ~CLAIMS
        visible_world.traffic.occupancy[U(cell)] = np.uint16(word)


@kernel
def hide_robot(visible_world, j):
    r = visible_world.robots
    for k in range(r.route_length[j]):  # what was shown, and no more: the rows are long
        r.route[j, k] = 0
    for k in range(r.order_queue_length[j]):
        r.order_queue[j, k] = 0
    for array in (
        r.cell,
        r.claim,
        r.load,
        r.order,
        r.slot,
        r.goal_cell,
        r.service_zone,
        r.home,
        r.bay,
    ):
        array[j] = NIL
    for array in (r.route_length, r.route_index, r.charge_target, r.charge, r.order_queue_length):
        array[j] = 0
    for array in (
        r.heading,
        r.travel,
        r.action,
        r.goal_type,
        r.try_drop,
        r.failed_retries,
        r.retry_state,
    ):
        array[j] = 0
    for array in (
        r.parked,
        r.need,
        r.reason,
        r.route_reason,
        r.executed,
        r.charging_interruptible,
        r.status,
    ):
        array[j] = 0
    r.charging_reason[j] = 0
    r.status_until[j] = 0
    r.ticket[j] = 0
    r.busy[j] = 0
    r.priority[j] = 0
    r.retreat_moves[j] = 0
    r.seen_revision[j] = NIL
    r.route_hash[j] = 0
    r.step[j] = NO_STEP
    visible_world.tally.operations[j] = 0
    visible_world.tally.ticks[j] = 0
    visible_world.tally.slowdown_ticks[j] = 0
    if visible_world.service_zones.wake.shape[0]:
        visible_world.service_zones.halt[j] = NIL
        visible_world.service_zones.wake[j] = NIL
        visible_world.service_zones.messages[j] = 0


@kernel
def reveal_zoning(world, visible_world, i, j):
    """What robot j, in sight of robot i, was told by zoning, and what it tells others."""
    a, b = visible_world.service_zones, world.service_zones
    if b.wake.shape[0]:
        a.halt[j] = b.halt[j]
        a.wake[j] = b.wake[j] if j == i else NIL
        for word in range(b.messages.shape[1]):
            a.messages[j, word] = b.messages[j, word]


@kernel
def reveal_robot(world, visible_world, j):
    a, b = visible_world.robots, world.robots
    a.cell[j] = b.cell[j]
    a.claim[j] = b.claim[j]
    a.heading[j] = b.heading[j]
    a.travel[j] = b.travel[j]
    a.action[j] = b.action[j]
    a.busy[j] = b.busy[j]
    a.priority[j] = b.priority[j]
    a.load[j] = b.load[j]
    a.order[j] = b.order[j]
    a.slot[j] = b.slot[j]
    a.goal_type[j] = b.goal_type[j]
    a.goal_cell[j] = b.goal_cell[j]
    a.charge_target[j] = b.charge_target[j]
    a.charging_interruptible[j] = b.charging_interruptible[j]
    a.charge[j] = b.charge[j]
    a.status[j] = b.status[j]
    a.status_until[j] = b.status_until[j]
    a.ticket[j] = b.ticket[j]
    a.order_queue_length[j] = b.order_queue_length[j]
    for k in range(b.order_queue_length[j]):
        a.order_queue[j, k] = b.order_queue[j, k]
    a.charging_reason[j] = b.charging_reason[j]
    a.try_drop[j] = b.try_drop[j]
    a.route_length[j] = b.route_length[j]
    a.route_index[j] = b.route_index[j]
    a.route_hash[j] = b.route_hash[j]
    a.retreat_moves[j] = b.retreat_moves[j]
    a.failed_retries[j] = b.failed_retries[j]
    a.retry_state[j] = b.retry_state[j]
    a.home[j] = b.home[j]
    a.bay[j] = b.bay[j]
    a.parked[j] = b.parked[j]
    a.service_zone[j] = b.service_zone[j]
    a.need[j] = b.need[j]
    a.reason[j] = b.reason[j]
    a.route_reason[j] = b.route_reason[j]
    a.seen_revision[j] = b.seen_revision[j]
    a.step[j] = b.step[j]
    a.executed[j] = b.executed[j]
    for k in range(b.route_length[j]):
        a.route[j, k] = b.route[j, k]
