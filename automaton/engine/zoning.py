"""How the decisions of zoning enter the world: designs, queues and messages between robots.

A design is checked as a whole: every station is in a zone, segments follow roads between stations
of their zone, no point is in two zones, a transfer station belongs to one of its two zones. With
limited sight a robot may change only what it sees.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import note_refusal, record_change
from automaton.engine.record_codes import CHANGE_ZONE
from automaton.engine.refusals import (
    RULE_AGAIN,
    RULE_HALT,
    RULE_OVERLAP,
    RULE_PATH,
    RULE_POINTS,
    RULE_QUEUE_DROP,
    RULE_QUEUE_ORDER,
    RULE_QUEUE_SLOT,
    RULE_QUEUE_TAKEN,
    RULE_QUEUE_ZONE,
    RULE_QUEUED,
    RULE_SEGMENTS,
    RULE_SERVER,
    RULE_SIGHT,
    RULE_STATION_ACCESS,
    RULE_STATION_ZONE,
    RULE_TRANSFER,
    RULE_ZONE,
    RULE_ZONING,
)
from automaton.engine.state import (
    KEEP,
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
    if out.redesigned and flaw_of(world, out.design)[0] == NIL:
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
            note_refusal(world, NIL, RULE_SERVER, np.int64(server), 0)
    for k in range(out.queued):
        enqueue_order(world, out, k)


@kernel
def judge_zoning(world, batch, out):
    """Complete the design of a decision, and reject what cannot be recorded.

    Rejected are a design that is invalid or changes too much, and an invalid number of queued
    orders.
    """
    most = out.refusals.shape[0]  # in a replay, which decides for all calls at once
    out.refused = min(max(np.int64(0), out.refused), most)
    if not 0 <= out.queued <= out.order.shape[0]:
        reject(world, batch, out, RULE_QUEUED, np.int64(out.queued))
        out.queued = 0
    if out.redesigned and world.service_zones.queue.shape[0]:
        rule, value = bar_to_design(world, batch, out.design)
        if rule != NIL:
            reject(world, batch, out, rule, value)
            out.redesigned = 0
    for k in range(out.refused):
        robot, rule = np.int64(out.refusals[k, 0]), np.int64(out.refusals[k, 1])
        is_known = 0 <= rule <= RULE_SIGHT  # a recording may have been altered
        is_robot = 0 <= robot < world.robots.cell.shape[0]
        note_refusal(
            world,
            robot if is_robot else NIL,
            rule if is_known else RULE_ZONING,
            np.int64(out.refusals[k, 2]),
            0,
        )


@kernel
def reject(world, batch, out, rule, value):
    """Enter an illegal decision of a call that cannot be recorded."""
    alone = world.rules.radius != NIL and batch.count
    if out.refused < out.refusals.shape[0]:
        out.refusals[out.refused, 0] = world.robots.identity[batch.robot[0]] if alone else NIL
        out.refusals[out.refused, 1] = rule
        out.refusals[out.refused, 2] = value
        out.refused += 1


@kernel
def bar_to_design(world, batch, design):
    """The rule that a completed design breaks, itself or by what it changes, or NIL; and a value."""
    rule, value = bar_to_size(design)
    if rule != NIL:
        return rule, value
    if world.rules.own_zones and batch.count:
        fill_in_hidden(world, np.int64(batch.robot[0]), design)
    rule, value = flaw_of(world, design)
    return bar_to_change(world, batch, design) if rule == NIL else (rule, value)


@kernel
def bar_to_size(design):
    """The rule if the segments of a design or their points do not fit the arrays; and a value."""
    if not 0 <= design.segments <= design.owner.shape[0]:
        return np.int64(RULE_SEGMENTS), np.int64(design.segments)
    for segment in range(design.segments):
        if not 0 <= design.points[segment] <= design.path.shape[1]:
            return np.int64(RULE_POINTS), np.int64(design.points[segment])
    return np.int64(NIL), np.int64(0)


@kernel
def commit_robot(world, record, i, out, k):
    """Enter the zoning decision about robot i, decision k of the batch."""
    service_zones, tick = world.service_zones, world.clock.tick
    service_zone = np.int64(out.service_zone[k])
    identity = np.int64(world.robots.identity[i])
    if service_zone != KEEP and not may_serve(world, service_zone):
        note_refusal(world, identity, RULE_ZONE, service_zone, 0)
    elif service_zone != KEEP and service_zone != world.robots.service_zone[i]:
        world.robots.service_zone[i] = service_zone
        record_change(world.clock, record, CHANGE_ZONE, identity, service_zone)
    if service_zones.queue.shape[0] == 0:
        return
    halt, again = np.int64(out.halt[k]), np.int64(out.again[k])
    if halt != KEEP:
        if 0 <= halt <= MAX_HALT_TICKS:
            service_zones.halt[i] = tick - 1 + halt
            world.clock.halted_until = max(np.int64(world.clock.halted_until), tick - 1 + halt)
        else:
            note_refusal(world, identity, RULE_HALT, halt, 0)
    if again != KEEP and again < NIL:
        note_refusal(world, identity, RULE_AGAIN, again, 0)
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
def flaw_of(world, design):
    """The rule that a design breaks, or NIL, and a value; writes design.held, the zone of each point
    of primary segments."""
    roads, zones = world.service_zones.roads, world.service_zones.server.shape[0]
    held = design.held
    held[:] = NIL
    for station in range(design.zone.shape[0]):
        zone = np.int64(design.zone[station])
        if not 0 <= zone < zones:
            return np.int64(RULE_STATION_ZONE), zone
        if world.service_zones.accessible[zone, station] == 0:
            return np.int64(RULE_STATION_ACCESS), np.int64(station)
        held[roads.point[station]] = zone
    rule, value = bar_to_size(design)
    if rule != NIL:
        return rule, value
    for segment in range(design.segments):
        if not is_path(roads, design, segment):
            return np.int64(RULE_PATH), np.int64(segment)
        owner = np.int64(design.owner[segment])
        for k in range(design.points[segment]):
            point = np.int64(design.path[segment, k])
            if held[point] != NIL and held[point] != owner:
                return np.int64(RULE_OVERLAP), point
            held[point] = owner
    station = misplaced_transfer(design, world.service_zones.accessible)
    return np.int64(NIL if station == NIL else RULE_TRANSFER), np.int64(station)


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
def misplaced_transfer(design, accessible):
    """A transfer station that is in neither of its two zones, or that robots of one of them cannot
    serve; else NIL."""
    zones = design.transfer.shape[0]
    for a in range(zones):
        for b in range(zones):
            for station in range(design.zone.shape[0]):
                if design.transfer[a, b, station] == 0:
                    continue
                zone = design.zone[station]
                if a == b or (zone != a and zone != b) or design.transfer[b, a, station] == 0:
                    return station
                if accessible[a, station] == 0:
                    return station
    return NIL


@kernel
def bar_to_change(world, batch, design):
    """With limited sight: the rule if a station changes zones not between robots in sight, and it."""
    if world.rules.radius == NIL or batch.count == 0:
        return np.int64(NIL), np.int64(0)
    i = np.int64(batch.robot[0])
    for station in range(design.zone.shape[0]):
        before = world.service_zones.design.zone[station]
        if before == design.zone[station] or before == NIL:
            continue  # NIL: these are the first zones
        for zone in (before, design.zone[station]):
            server = np.int64(world.service_zones.server[zone])
            if server != NIL and not is_visible(world, i, np.int64(world.robots.at_index[server])):
                return np.int64(RULE_SIGHT), np.int64(station)
    return np.int64(NIL), np.int64(0)


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
def bar_to_queue(world, order, queue, next_slot):
    """The rule that keeps an order from a queue and its next slot, or NIL; and a value."""
    orders = world.orders
    if not 0 <= order < orders.state.shape[0]:
        return np.int64(RULE_QUEUE_ORDER), order
    if not 0 <= queue < world.service_zones.server.shape[0]:
        return np.int64(RULE_QUEUE_ZONE), queue
    if orders.state[order] != ORDER_WAITING or orders.reserved_by[order] != NIL:
        return np.int64(RULE_QUEUE_TAKEN), order
    if not 0 <= next_slot < world.slots.cell.shape[0]:
        return np.int64(RULE_QUEUE_SLOT), next_slot
    if next_slot != orders.target[order]:  # dropped on the way
        is_place = world.stations.at[next_slot] != NIL or world.slots.unbounded[next_slot] == 0
        if not is_place or next_slot == orders.current_slot[order]:
            return np.int64(RULE_QUEUE_DROP), next_slot
    return np.int64(NIL), np.int64(0)


@kernel
def enqueue_order(world, out, k):
    """Entry k of the decisions: an order that no robot has taken enters a queue."""
    service_zones = world.service_zones
    order, queue, next_slot = (
        np.int64(out.order[k]),
        np.int64(out.queue[k]),
        np.int64(out.next_slot[k]),
    )
    rule, value = bar_to_queue(world, order, queue, next_slot)
    if rule != NIL:
        note_refusal(world, NIL, rule, value, 0)
        return
    if service_zones.queue[order] != queue or service_zones.next_slot[order] != next_slot:
        world.clock.revision += 1
    service_zones.queue[order] = queue
    service_zones.next_slot[order] = next_slot
    service_zones.skips_transfer[order] = out.skips_transfer[k]
