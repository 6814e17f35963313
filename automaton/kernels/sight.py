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

from automaton.compiled import kernel
from automaton.kernels.motion import CLAIMS, RULE, U
from automaton.world.state import ACTIONS, NEVER, NIL, NO_STEP, UNRELEASED
from automaton.zoning.paths import copy_segment

HIDDEN = -2  # design.held: the point belongs to somebody out of sight


@kernel
def turns(world, batch):
    """How often a layer is called for a batch."""
    return 1 if world.rules.radius == NIL else batch.count[0]


@kernel
def take_turn(world, seen, batch, asked, memory, vault, turn):
    """Prepare call number `turn`: the robots asked, what they see, what they remember."""
    name_robots(world, batch, asked, turn)
    if world.rules.radius == NIL:
        return
    i = np.int64(batch.robot[turn])
    look(world, seen, i)
    if world.rules.radius > 0:
        for k in range(memory.own.shape[1]):
            memory.own[i, k] = vault.own[i, k]


@kernel
def name_robots(world, batch, asked, turn):
    """Enter the robots that call number `turn` is about: the whole batch, or one of it."""
    everything = world.rules.radius == NIL
    first = 0 if everything else turn
    count = batch.count[0] if everything else 1
    asked.count[0] = count
    for k in range(count):
        asked.robot[k] = batch.robot[first + k]
        asked.reason[k] = batch.reason[first + k]


@kernel
def end_turn(world, memory, vault, batch, turn):
    """Put the memory of the robot away."""
    if world.rules.radius > 0:
        i = np.int64(batch.robot[turn])
        for k in range(memory.own.shape[1]):
            vault.own[i, k] = memory.own[i, k]
            memory.own[i, k] = 0
        memory.shared[:] = 0


@kernel
def is_seen(world, i, j):
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
def look(world, seen, i):
    """Fill `seen` with what robot i sees now."""
    hide_everything(world, seen)
    for j in range(world.robots.cell.shape[0]):
        if is_seen(world, i, j):
            show(world, seen, j)
            show_cell(world, seen, np.int64(world.robots.cell[j]))
            show_cell(world, seen, np.int64(world.robots.claim[j]))
            show_zoning(world, seen, i, j)
    if world.rules.own_zones and world.zoning.queue.shape[0]:
        look_at_zones(world, seen, i)
    for action in range(ACTIONS):
        for loaded in range(2):
            seen.tally.times[i, action, loaded] = world.tally.times[i, action, loaded]
            seen.tally.ticks[i, action, loaded] = world.tally.ticks[i, action, loaded]
    seen.tally.slowed[i] = world.tally.slowed[i]


@kernel
def hide_everything(world, seen):
    """Take back what has been shown."""
    for j in range(world.robots.cell.shape[0]):
        forget_cell(world, seen, np.int64(seen.robots.cell[j]))
        forget_cell(world, seen, np.int64(seen.robots.claim[j]))
        hide(seen, j)


@kernel
def zone_is_seen(world, i, zone):
    """Whether robot i sees the robot that serves a zone."""
    if zone == NIL:
        return False
    server = np.int64(world.zoning.server[zone])
    return server != NIL and is_seen(world, i, np.int64(world.robots.at_index[server]))


@kernel
def zone_of_order(world, order):
    """The zone that has an order: in whose queue it is, or in which it lies, or that of its robot."""
    zoning = world.zoning
    if zoning.queue[order] != NIL:
        queue = np.int64(zoning.queue[order])
        return queue if queue >= 0 else -2 - queue
    slot = np.int64(world.orders.place[order])
    if slot == NIL or zoning.station_of[slot] == NIL:
        return np.int64(NIL)
    return np.int64(zoning.design.zone[zoning.station_of[slot]])


@kernel
def look_at_zones(world, seen, i):
    """Show the zones, queues and stations of robots in sight; the others look as if there were none."""
    a, b = seen.zoning, world.zoning
    zones = b.server.shape[0]
    for zone in range(zones):
        a.server[zone] = b.server[zone] if zone_is_seen(world, i, zone) else NIL
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
    look_at_orders(world, seen, i)
    look_at_works(world, seen)


@kernel
def hide_segments(design):
    """Segments look as if nobody owned them."""
    for segment in range(design.segments[0]):
        for k in range(design.points[segment]):
            design.path[segment, k] = NIL
        design.points[segment] = 0
        design.owner[segment] = NIL
        design.ends[segment] = NIL


@kernel
def look_at_orders(world, seen, i):
    """Orders in the zones of robots in sight, or on these robots; others look as if still to come."""
    a, b, x, y = seen.orders, world.orders, seen.zoning, world.zoning
    for order in range(b.state.shape[0]):
        zone = zone_of_order(world, order)
        shown = zone != NIL and x.server[zone] != NIL
        by = np.int64(b.by[order])
        if by != NIL:
            shown = is_seen(world, i, np.int64(world.robots.at_index[by]))
        a.state[order] = b.state[order] if shown else UNRELEASED
        a.place[order] = b.place[order] if shown else NIL
        a.source[order] = b.source[order] if shown else NIL
        a.target[order] = b.target[order] if shown else NIL
        a.by[order] = by if shown else NIL
        a.released[order] = b.released[order] if shown else NEVER
        a.weight[order] = b.weight[order] if shown else 0
        a.dispatched[order] = b.dispatched[order] if shown else NIL
        a.dispatched_from[order] = b.dispatched_from[order] if shown else NIL
        a.delivered[order] = b.delivered[order] if shown else NIL
        a.legs[order] = b.legs[order] if shown else 0
        x.queue[order] = y.queue[order] if shown else NIL
        x.stop[order] = y.stop[order] if shown else NIL
        x.direct[order] = y.direct[order] if shown else 0
        x.leg[order] = y.leg[order] if shown else NIL
    for k in range(b.coming.shape[0]):
        order = np.int64(b.coming[k])
        a.coming[k] = order if order != NIL and a.state[order] != UNRELEASED else NIL


@kernel
def look_at_works(world, seen):
    """Lines of stations in the zones of robots in sight."""
    a, b = seen.stations, world.stations
    for k in range(b.slot.shape[0]):
        shown = seen.zoning.design.zone[k] != NIL
        a.first[k] = b.first[k] if shown else NIL
        a.last[k] = b.last[k] if shown else NIL
        a.until[k] = b.until[k] if shown else 0
    for work in range(b.done.shape[0]):
        shown = seen.zoning.design.zone[b.station[work]] != NIL
        a.behind[work] = b.behind[work] if shown else NIL
        a.came[work] = b.came[work] if shown else NIL
        a.done[work] = b.done[work] if shown else NIL


@kernel
def forget_cell(world, seen, cell):
    """The cell looks empty."""
    if cell != NIL:
        rule = np.int64(world.grid.rule[U(cell)])
        seen.traffic.occupancy[U(cell)] = np.uint16((rule << RULE) | 96)  # room both ways


@kernel
def show_cell(world, seen, cell):
    if cell != NIL:
        word = np.int64(world.traffic.occupancy[U(cell)]) & ~CLAIMS
        seen.traffic.occupancy[U(cell)] = np.uint16(word)


@kernel
def hide(seen, j):
    r = seen.robots
    for k in range(r.length[j]):  # what was shown, and no more: the rows are long
        r.route[j, k] = 0
    for k in range(r.planned[j]):
        r.plan[j, k] = 0
    for array in (r.cell, r.claim, r.load, r.order, r.slot, r.stand, r.zone, r.home, r.bay):
        array[j] = NIL
    for array in (r.length, r.at, r.level, r.charge, r.planned):
        array[j] = 0
    for array in (r.heading, r.travel, r.action, r.goal, r.try_drop, r.blocked, r.hold):
        array[j] = 0
    for array in (r.parked, r.need, r.reason, r.route_reason, r.did, r.yields, r.status):
        array[j] = 0
    r.charging_reason[j] = 0
    r.until[j] = 0
    r.ticket[j] = 0
    r.busy[j] = 0
    r.priority[j] = 0
    r.withdrawing[j] = 0
    r.asked_at[j] = NIL
    r.route_sum[j] = 0
    r.step[j] = NO_STEP
    seen.tally.times[j] = 0
    seen.tally.ticks[j] = 0
    seen.tally.slowed[j] = 0
    if seen.zoning.wake.shape[0]:
        seen.zoning.halt[j] = NIL
        seen.zoning.wake[j] = NIL
        seen.zoning.said[j] = 0


@kernel
def show_zoning(world, seen, i, j):
    """What robot j, in sight of robot i, was told by zoning, and what it tells others."""
    a, b = seen.zoning, world.zoning
    if b.wake.shape[0]:
        a.halt[j] = b.halt[j]
        a.wake[j] = b.wake[j] if j == i else NIL
        for word in range(b.said.shape[1]):
            a.said[j, word] = b.said[j, word]


@kernel
def show(world, seen, j):
    a, b = seen.robots, world.robots
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
    a.goal[j] = b.goal[j]
    a.stand[j] = b.stand[j]
    a.level[j] = b.level[j]
    a.yields[j] = b.yields[j]
    a.charge[j] = b.charge[j]
    a.status[j] = b.status[j]
    a.until[j] = b.until[j]
    a.ticket[j] = b.ticket[j]
    a.planned[j] = b.planned[j]
    for k in range(b.planned[j]):
        a.plan[j, k] = b.plan[j, k]
    a.charging_reason[j] = b.charging_reason[j]
    a.try_drop[j] = b.try_drop[j]
    a.length[j] = b.length[j]
    a.at[j] = b.at[j]
    a.route_sum[j] = b.route_sum[j]
    a.withdrawing[j] = b.withdrawing[j]
    a.blocked[j] = b.blocked[j]
    a.hold[j] = b.hold[j]
    a.home[j] = b.home[j]
    a.bay[j] = b.bay[j]
    a.parked[j] = b.parked[j]
    a.zone[j] = b.zone[j]
    a.need[j] = b.need[j]
    a.reason[j] = b.reason[j]
    a.route_reason[j] = b.route_reason[j]
    a.asked_at[j] = b.asked_at[j]
    a.step[j] = b.step[j]
    a.did[j] = b.did[j]
    for k in range(b.length[j]):
        a.route[j, k] = b.route[j, k]
