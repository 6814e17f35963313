"""How the decisions of zoning enter the world: designs, queues and messages between robots.

A design is checked as a whole: every station is in a zone, segments follow roads between stations
of their zone, no point is in two zones, a transfer station belongs to one of its two zones. With
limited sight a robot may change only what it sees.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import record_change
from automaton.engine.record_codes import CHANGE_ZONE
from automaton.engine.state import (
    KEEP,
    LAYER_ZONING,
    NIL,
    ORDER_WAITING,
)
from automaton.engine.visibility import copy_segment, is_visible, is_zone_visible

MAX_HALT_TICKS = 60_000  # ticks


@kernel
def commit_zoning(world, record, batch, decisions):
    """Enter what zoning decided about robots, the design and the queues."""
    out = decisions.zoning
    for k in range(batch.count):
        commit_robot(world, record, np.int64(batch.robot[k]), out, k)
    if world.service_zones.queue.shape[0] == 0:
        return
    if out.redesigned and is_sound(world, out.design):
        adopt(world.service_zones.design, out.design)
        if world.clock.zones_redesigned != world.clock.tick:
            world.clock.revision += 1
        world.clock.zones_redesigned = world.clock.tick
    for zone in range(out.server.shape[0]):
        server = out.server[zone]
        if server != KEEP and 0 <= server < world.robots.cell.shape[0]:
            if server != world.service_zones.server[zone]:
                world.service_zones.server[zone] = server
                world.clock.revision += 1
        elif server != KEEP:
            world.tally.illegal[LAYER_ZONING] += 1
    for k in range(out.queued):
        enqueue_order(world, out, k)


@kernel
def judge_zoning(world, batch, out):
    """Complete the design of a decision, and reject what cannot be recorded.

    Rejected are a design that is invalid or changes too much, and an invalid number of queued
    orders.
    """
    most = 2 * world.robots.cell.shape[0]  # in a replay, which decides for all calls at once
    refused = min(max(np.int64(0), out.refused), most)
    if not 0 <= out.queued <= out.order.shape[0]:
        out.queued = 0
        refused += 1
    if out.redesigned and world.service_zones.queue.shape[0]:
        if not may_become(world, batch, out.design):
            out.redesigned = 0
            refused += 1
    out.refused = refused
    world.tally.illegal[LAYER_ZONING] += refused


@kernel
def may_become(world, batch, design):
    """Whether a completed design is valid and changes only what it may change."""
    if not has_room_for(design):
        return False
    if world.rules.own_zones and batch.count:
        fill_in_hidden(world, np.int64(batch.robot[0]), design)
    return is_sound(world, design) and may_change(world, batch, design)


@kernel
def has_room_for(design):
    """Whether the segments of a design and their points fit the arrays."""
    if not 0 <= design.segments <= design.owner.shape[0]:
        return False
    for segment in range(design.segments):
        if not 0 <= design.points[segment] <= design.path.shape[1]:
            return False
    return True


@kernel
def commit_robot(world, record, i, out, k):
    """Enter the zoning decision about robot i, decision k of the batch."""
    service_zones, tick = world.service_zones, world.clock.tick
    service_zone = np.int64(out.service_zone[k])
    if service_zone != KEEP and not may_serve(world, service_zone):
        world.tally.illegal[LAYER_ZONING] += 1
    elif service_zone != KEEP and service_zone != world.robots.service_zone[i]:
        world.robots.service_zone[i] = service_zone
        record_change(world.clock, record, CHANGE_ZONE, world.robots.identity[i], service_zone)
    if service_zones.queue.shape[0] == 0:
        return
    halt, again = np.int64(out.halt[k]), np.int64(out.again[k])
    if halt != KEEP:
        if 0 <= halt <= MAX_HALT_TICKS:
            service_zones.halt[i] = tick - 1 + halt
            world.clock.halted_until = max(np.int64(world.clock.halted_until), tick - 1 + halt)
        else:
            world.tally.illegal[LAYER_ZONING] += 1
    if again != KEEP and again < NIL:
        world.tally.illegal[LAYER_ZONING] += 1
    elif again != KEEP:
        service_zones.wake[i] = tick + max(np.int64(1), again) if again != NIL else NIL
        waking = np.int64(world.clock.next_wakeup)
        if again != NIL and (waking == NIL or service_zones.wake[i] < waking):
            world.clock.next_wakeup = service_zones.wake[i]
    if out.sends_message[k]:
        for word in range(service_zones.messages.shape[1]):
            service_zones.messages[i, word] = out.messages[k, word]


@kernel
def may_serve(world, service_zone):
    """Whether a zone exists, or is NIL; without a design there may be as many zones as cells."""
    designed = world.service_zones.queue.shape[0] > 0
    zones = world.service_zones.server.shape[0] if designed else world.grid.cell_flags.shape[0]
    return NIL <= service_zone < zones


@kernel
def fill_in_hidden(world, i, design):
    """Copy the parts of the zones that robot i does not see from the current design."""
    now = world.service_zones.design
    for station in range(design.zone.shape[0]):
        if design.zone[station] == NIL:
            design.zone[station] = now.zone[station]
    kept = 0
    for segment in range(design.segments):
        if design.owner[segment] != NIL:
            copy_segment(design, segment, design, kept)
            kept += 1
    for segment in range(now.segments):
        hidden = not is_zone_visible(world, i, np.int64(now.owner[segment]))
        if hidden and kept < design.owner.shape[0]:
            copy_segment(now, segment, design, kept)
            kept += 1
    design.segments = kept
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            if not (is_zone_visible(world, i, a) and is_zone_visible(world, i, b)):
                for station in range(design.zone.shape[0]):
                    lies = design.zone[station] == a or design.zone[station] == b
                    design.transfer[a, b, station] = now.transfer[a, b, station] if lies else 0


@kernel
def is_sound(world, design):
    """Whether a design is valid; writes design.held, the zone of each point of primary segments."""
    roads, zones = world.service_zones.roads, world.service_zones.server.shape[0]
    held = design.held
    held[:] = NIL
    for station in range(design.zone.shape[0]):
        zone = np.int64(design.zone[station])
        if not 0 <= zone < zones or world.service_zones.accessible[zone, station] == 0:
            return False
        held[roads.point[station]] = zone
    if not has_room_for(design):
        return False
    for segment in range(design.segments):
        if not is_path(roads, design, segment):
            return False
        owner = np.int64(design.owner[segment])
        for k in range(design.points[segment]):
            point = np.int64(design.path[segment, k])
            if held[point] != NIL and held[point] != owner:
                return False
            held[point] = owner
    return transfers_are_sound(design, world.service_zones.accessible)


@kernel
def is_path(roads, design, segment):
    """Whether a segment follows roads from one station of its zone to another."""
    owner = np.int64(design.owner[segment])
    count = np.int64(design.points[segment])
    if not 2 <= count <= design.path.shape[1]:
        return False
    for end in range(2):
        station = np.int64(design.ends[segment, end])
        if not 0 <= station < design.zone.shape[0] or design.zone[station] != owner:
            return False
        if design.path[segment, (count - 1) * end] != roads.point[station]:
            return False
    for k in range(count - 1):
        here, there = np.int64(design.path[segment, k]), np.int64(design.path[segment, k + 1])
        if not 0 <= here < roads.cell.shape[0]:
            return False
        follows = False
        for direction in range(4):
            follows = follows or roads.next[here, direction] == there
        if not follows:
            return False
    return True


@kernel
def transfers_are_sound(design, accessible):
    """Whether each transfer station is in one of its two zones, and robots of both zones can serve
    it."""
    zones = design.transfer.shape[0]
    for a in range(zones):
        for b in range(zones):
            for station in range(design.zone.shape[0]):
                if design.transfer[a, b, station] == 0:
                    continue
                zone = design.zone[station]
                if a == b or (zone != a and zone != b) or design.transfer[b, a, station] == 0:
                    return False
                if accessible[a, station] == 0:
                    return False
    return True


@kernel
def may_change(world, batch, design):
    """With limited sight: whether stations change zones only between robots in sight."""
    if world.rules.radius == NIL or batch.count == 0:
        return True
    i = np.int64(batch.robot[0])
    for station in range(design.zone.shape[0]):
        before = world.service_zones.design.zone[station]
        if before == design.zone[station] or before == NIL:
            continue  # NIL: these are the first zones
        for zone in (before, design.zone[station]):
            server = np.int64(world.service_zones.server[zone])
            if server != NIL and not is_visible(world, i, np.int64(world.robots.at_index[server])):
                return False
    return True


@kernel
def adopt(design, given):
    """Copy a design."""
    count = np.int64(given.segments)
    design.segments = count
    for station in range(design.zone.shape[0]):
        design.zone[station] = given.zone[station]
    for segment in range(design.owner.shape[0]):
        used = segment < count
        design.owner[segment] = given.owner[segment] if used else NIL
        design.points[segment] = given.points[segment] if used else 0
        for end in range(2):
            design.ends[segment, end] = given.ends[segment, end] if used else NIL
        for k in range(design.path.shape[1]):
            inside = k < design.points[segment]
            design.path[segment, k] = given.path[segment, k] if inside else NIL
    for point in range(design.held.shape[0]):
        design.held[point] = given.held[point]
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            for station in range(design.zone.shape[0]):
                design.transfer[a, b, station] = 1 if given.transfer[a, b, station] else 0


@kernel
def enqueue_order(world, out, k):
    """Entry k of the decisions: an order that no robot has taken enters a queue."""
    service_zones, orders = world.service_zones, world.orders
    order, queue, next_slot = (
        np.int64(out.order[k]),
        np.int64(out.queue[k]),
        np.int64(out.next_slot[k]),
    )
    legal = 0 <= order < orders.state.shape[0] and 0 <= queue < service_zones.server.shape[0]
    legal = legal and orders.state[order] == ORDER_WAITING and orders.reserved_by[order] == NIL
    legal = legal and 0 <= next_slot < world.slots.cell.shape[0]
    if legal and next_slot != orders.target[order]:  # dropped on the way
        legal = world.stations.at[next_slot] != NIL or world.slots.unbounded[next_slot] == 0
        legal = legal and next_slot != orders.current_slot[order]
    if not legal:
        world.tally.illegal[LAYER_ZONING] += 1
        return
    if service_zones.queue[order] != queue or service_zones.next_slot[order] != next_slot:
        world.clock.revision += 1
    service_zones.queue[order] = queue
    service_zones.next_slot[order] = next_slot
    service_zones.skips_transfer[order] = out.skips_transfer[k]
