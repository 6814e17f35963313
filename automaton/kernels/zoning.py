"""How the answers of zoning enter the world: designs, queues, and what robots tell each other.

A design is checked as a whole: every station is in a zone, segments follow roads between stations of
their zone, no point is in two zones, a transfer station belongs to one of its two zones. With limited
sight a robot may change only what it can see.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.operations import note
from automaton.kernels.sight import is_seen, zone_is_seen
from automaton.recording.codes import ZONE
from automaton.world.state import (
    CHANGES,
    HALTED,
    KEEP,
    NIL,
    REDESIGNED,
    TICK,
    WAITING,
    WAKING,
    ZONING,
)
from automaton.zoning.paths import copy_segment

LONGEST_HALT = 60_000  # ticks


@kernel
def commit_zoning(world, record, asked, answers):
    """Enter what zoning decided about robots, the design and the queues."""
    given = answers.zoning
    for k in range(asked.count[0]):
        commit_robot(world, record, np.int64(asked.robot[k]), given, k)
    if world.zoning.queue.shape[0] == 0:
        return
    if given.redesigned[0] and is_sound(world, given.design):
        adopt(world.zoning.design, given.design)
        if world.clock[REDESIGNED] != world.clock[TICK]:
            world.clock[CHANGES] += 1
        world.clock[REDESIGNED] = world.clock[TICK]
    for zone in range(given.server.shape[0]):
        server = given.server[zone]
        if server != KEEP and 0 <= server < world.robots.cell.shape[0]:
            if server != world.zoning.server[zone]:
                world.zoning.server[zone] = server
                world.clock[CHANGES] += 1
        elif server != KEEP:
            world.tally.illegal[ZONING] += 1
    for k in range(given.queued[0]):
        line_up(world, given, k)


@kernel
def judge_zoning(world, asked, given):
    """Make the design of an answer whole, and refuse what cannot be recorded as it stands.

    That is a design that is not sound or changes too much, and a number of queued orders that
    cannot be.
    """
    most = 2 * world.robots.cell.shape[0]  # of a replay, which tells of all calls at once
    refused = min(max(np.int64(0), given.refused[0]), most)
    if not 0 <= given.queued[0] <= given.order.shape[0]:
        given.queued[0] = 0
        refused += 1
    if given.redesigned[0] and world.zoning.queue.shape[0]:
        if not may_become(world, asked, given.design):
            given.redesigned[0] = 0
            refused += 1
    given.refused[0] = refused
    world.tally.illegal[ZONING] += refused


@kernel
def may_become(world, asked, design):
    """Whether a design, made whole, is sound and changes only what may be changed."""
    if not has_room_for(design):
        return False
    if world.rules.own_zones and asked.count[0]:
        fill_in_hidden(world, np.int64(asked.robot[0]), design)
    return is_sound(world, design) and may_change(world, asked, design)


@kernel
def has_room_for(design):
    """Whether the segments of a design and their points are as many as there is room for."""
    if not 0 <= design.segments[0] <= design.owner.shape[0]:
        return False
    for segment in range(design.segments[0]):
        if not 0 <= design.points[segment] <= design.path.shape[1]:
            return False
    return True


@kernel
def commit_robot(world, record, i, given, k):
    """What zoning says of robot i, answer k of the batch."""
    zoning, tick = world.zoning, world.clock[TICK]
    zone = np.int64(given.zone[k])
    if zone != KEEP and not may_serve(world, zone):
        world.tally.illegal[ZONING] += 1
    elif zone != KEEP and zone != world.robots.zone[i]:
        world.robots.zone[i] = zone
        note(world.clock, record, ZONE, world.robots.identity[i], zone)
    if zoning.queue.shape[0] == 0:
        return
    halt, again = np.int64(given.halt[k]), np.int64(given.again[k])
    if halt != KEEP:
        if 0 <= halt <= LONGEST_HALT:
            zoning.halt[i] = tick - 1 + halt
            world.clock[HALTED] = max(np.int64(world.clock[HALTED]), tick - 1 + halt)
        else:
            world.tally.illegal[ZONING] += 1
    if again != KEEP and again < NIL:
        world.tally.illegal[ZONING] += 1
    elif again != KEEP:
        zoning.wake[i] = tick + max(np.int64(1), again) if again != NIL else NIL
        waking = np.int64(world.clock[WAKING])
        if again != NIL and (waking == NIL or zoning.wake[i] < waking):
            world.clock[WAKING] = zoning.wake[i]
    if given.tells[k]:
        for word in range(zoning.said.shape[1]):
            zoning.said[i, word] = given.said[k, word]


@kernel
def may_serve(world, zone):
    """Whether a zone exists, or is NIL; without a design there may be as many as cells."""
    designed = world.zoning.queue.shape[0] > 0
    zones = world.zoning.server.shape[0] if designed else world.grid.rule.shape[0]
    return NIL <= zone < zones


@kernel
def fill_in_hidden(world, i, design):
    """What robot i does not see of the zones stays as it is."""
    now = world.zoning.design
    for station in range(design.zone.shape[0]):
        if design.zone[station] == NIL:
            design.zone[station] = now.zone[station]
    kept = 0
    for segment in range(design.segments[0]):
        if design.owner[segment] != NIL:
            copy_segment(design, segment, design, kept)
            kept += 1
    for segment in range(now.segments[0]):
        hidden = not zone_is_seen(world, i, np.int64(now.owner[segment]))
        if hidden and kept < design.owner.shape[0]:
            copy_segment(now, segment, design, kept)
            kept += 1
    design.segments[0] = kept
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            if not (zone_is_seen(world, i, a) and zone_is_seen(world, i, b)):
                for station in range(design.zone.shape[0]):
                    lies = design.zone[station] == a or design.zone[station] == b
                    design.transfer[a, b, station] = now.transfer[a, b, station] if lies else 0


@kernel
def is_sound(world, design):
    """Whether a design is one; writes design.held, the zone of each point of primary segments."""
    roads, zones = world.zoning.roads, world.zoning.server.shape[0]
    held = design.held
    held[:] = NIL
    for station in range(design.zone.shape[0]):
        zone = np.int64(design.zone[station])
        if not 0 <= zone < zones or world.zoning.serves[zone, station] == 0:
            return False
        held[roads.point[station]] = zone
    if not has_room_for(design):
        return False
    for segment in range(design.segments[0]):
        if not is_path(roads, design, segment):
            return False
        owner = np.int64(design.owner[segment])
        for k in range(design.points[segment]):
            point = np.int64(design.path[segment, k])
            if held[point] != NIL and held[point] != owner:
                return False
            held[point] = owner
    return transfers_are_sound(design, world.zoning.serves)


@kernel
def is_path(roads, design, segment):
    """Whether a segment leads along roads from one station of its zone to another."""
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
def transfers_are_sound(design, serves):
    """Whether transfer stations lie in one of their two zones, and both know and serve them."""
    zones = design.transfer.shape[0]
    for a in range(zones):
        for b in range(zones):
            for station in range(design.zone.shape[0]):
                if design.transfer[a, b, station] == 0:
                    continue
                zone = design.zone[station]
                if a == b or (zone != a and zone != b) or design.transfer[b, a, station] == 0:
                    return False
                if serves[a, station] == 0:
                    return False
    return True


@kernel
def may_change(world, asked, design):
    """With limited sight: whether all stations that change their zone do so between robots in sight."""
    if world.rules.radius == NIL or asked.count[0] == 0:
        return True
    i = np.int64(asked.robot[0])
    for station in range(design.zone.shape[0]):
        before = world.zoning.design.zone[station]
        if before == design.zone[station] or before == NIL:
            continue  # NIL: these are the first zones
        for zone in (before, design.zone[station]):
            server = np.int64(world.zoning.server[zone])
            if server != NIL and not is_seen(world, i, np.int64(world.robots.at_index[server])):
                return False
    return True


@kernel
def adopt(design, given):
    """Copy a design."""
    count = np.int64(given.segments[0])
    design.segments[0] = count
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
def line_up(world, given, k):
    """Entry k of the answers: an order that nobody has taken comes into a queue."""
    zoning, orders = world.zoning, world.orders
    order, queue, stop = np.int64(given.order[k]), np.int64(given.queue[k]), np.int64(given.stop[k])
    legal = 0 <= order < orders.state.shape[0] and 0 <= queue < zoning.server.shape[0]
    legal = legal and orders.state[order] == WAITING and orders.by[order] == NIL
    legal = legal and 0 <= stop < world.slots.cell.shape[0]
    if legal and stop != orders.target[order]:  # on the way: at another station, or on a shelf
        legal = world.stations.at[stop] != NIL or world.slots.endless[stop] == 0
        legal = legal and stop != orders.place[order]
    if not legal:
        world.tally.illegal[ZONING] += 1
        return
    if zoning.queue[order] != queue or zoning.stop[order] != stop:
        world.clock[CHANGES] += 1
    zoning.queue[order] = queue
    zoning.stop[order] = stop
    zoning.direct[order] = given.direct[k]
