"""Properties of a design: tips, loads and balance, transfer stations, and routes of parts.

The load of a zone in minutes (eq. 1-4 of Keith & La):

    f_ij   loads from i to j        tot = base + sum f_ij        W the stations of the zone
    g_ij   = (inflow of i) (outflow of j) / tot: empty trips (the paper prints the same sum twice)
    L      = sum over i, j in W, i != j of (f_ij + g_ij) between_ij / V  +  tot (t_u + t_l), V by robot
    SVp    = sum over pairs of zones of |L_z - L_y| / ((zones - 1) sum L)
"""

import numpy as np

from automaton.strategy.api import NIL, kernel
from strategies.zoning.zone_workspace import UNREACHED, block_others, spread, whole_cells

UNDEFINED = -1.0  # the balance of zones without any load
ROUTING_CENTRAL = 0  # rule of SA and GA: through the nearest transfer station
ROUTING_NEIGHBOURS = 1  # of DDZ: without a common station, through the one nearest to the target


# Tip workstations: stations that a single path joins to the rest of their zone.
#
# A station at point p is a tip if exactly one neighbour of p shares a segment of the zone with p (by
# membership, as in the authors' code, not by following the segment), or if it is alone in its zone.


@kernel
def find_tips(roads, design, workspace):
    """workspace.tip of all stations."""
    for s in range(design.zone.shape[0]):
        workspace.tip[s] = is_tip(roads, design, s)


@kernel
def is_tip(roads, design, s):
    """1 if a station is a tip of its zone."""
    p = np.int64(roads.point[s])
    only = np.int64(NIL)
    for m in range(design.segments):
        if design.owner[m] != design.zone[s] or passes(design, m, p) == 0:
            continue
        for k in range(design.points[m]):
            q = np.int64(design.path[m, k])
            if q == p or q == only or linked(roads, p, q) == 0:
                continue
            if only != NIL:
                return 0
            only = q
    return 1


@kernel
def passes(design, m, p):
    """1 if a segment contains a point."""
    for k in range(design.points[m]):
        if design.path[m, k] == p:
            return 1
    return 0


@kernel
def linked(roads, p, q):
    """1 if a straight road joins the two points, in either direction."""
    for d in range(4):
        if roads.next[p, d] == q or roads.next[q, d] == p:
            return 1
    return 0


# Loads.


@kernel
def find_loads(roads, rules, flow, through, design, workspace):
    """workspace.load of all zones, from one flow (S, S) float64; return the balance.

    through: 1 = loads that pass a tip on their shortest path count as the tip's (GA).
    """
    if through == 1:
        flow_past_tips(roads, flow, design, workspace)
    for z in range(design.transfer.shape[0]):
        members(design, workspace, z, rules.shared)
        if through == 1:
            workspace.load[z] = load_of(roads, rules, workspace.legs, workspace, z)
        else:
            workspace.load[z] = load_of(roads, rules, flow, workspace, z)
    return balance(workspace.load)


@kernel
def members(design, workspace, z, shared):
    """workspace.member: the stations of zone z, and its transfer stations if these are shared."""
    for s in range(design.zone.shape[0]):
        workspace.member[s] = 1 if design.zone[s] == z else 0
        if shared:
            for other in range(design.transfer.shape[0]):
                if design.transfer[z, other, s] == 1:
                    workspace.member[s] = 1


@kernel
def load_of(roads, rules, flow, workspace, z):
    """Minutes of work of the robot of zone z at the stations of workspace.member."""
    count = np.int64(0)
    for s in range(workspace.member.shape[0]):
        if workspace.member[s] == 1:
            workspace.listed[count] = s
            count += 1
    total = rules.base
    workspace.into[:] = 0.0
    workspace.out[:] = 0.0
    for a in range(count):
        i = workspace.listed[a]
        for b in range(count):
            j = workspace.listed[b]
            if i != j:
                total += flow[i, j]
                workspace.out[i] += flow[i, j]
                workspace.into[j] += flow[i, j]
    if total == 0.0:
        return 0.0
    cells = 0.0
    for a in range(count):
        i = workspace.listed[a]
        for b in range(count):
            j = workspace.listed[b]
            if i != j:
                empty = workspace.into[i] * workspace.out[j] / total
                cells += (flow[i, j] + empty) * roads.between[i, j]
    return cells * workspace.move_time_factor[z] / rules.speed + total * rules.handling


@kernel
def flow_past_tips(roads, flow, design, workspace):
    """workspace.legs: the flow; for tips i, also all loads that pass i and then j of the same zone."""
    stations = flow.shape[0]
    find_tips(roads, design, workspace)
    workspace.legs[:] = 0.0
    for a in range(stations):
        for b in range(stations):
            if a == b or flow[a, b] == 0.0:
                continue
            count = stations_on_way(roads, workspace, a, b)
            for x in range(count):
                i = np.int64(workspace.listed[x])
                for y in range(x + 1, count):
                    j = np.int64(workspace.listed[y])
                    whole = i == a and j == b
                    if design.zone[i] == design.zone[j] and (whole or workspace.tip[i] == 1):
                        workspace.legs[i, j] += flow[a, b]


@kernel
def stations_on_way(roads, workspace, a, b):
    """workspace.listed: the stations on the shortest path from a to b, in order; return their number."""
    end = np.int64(roads.point[b])
    p = np.int64(roads.point[a])
    count = np.int64(0)
    while p != NIL:
        if roads.station[p] != NIL:
            workspace.listed[count] = roads.station[p]
            count += 1
        if p == end:
            break
        p = np.int64(roads.hop[p, end])
    return count


@kernel
def balance(load):
    """SVp, from 0 (equal) to 1 (one zone has all the load), or UNDEFINED."""
    zones = load.shape[0]
    total = 0.0
    apart = 0.0
    for z in range(zones):
        total += load[z]
        for y in range(z):
            apart += abs(load[z] - load[y])
    if total == 0.0 or zones < 2:
        return UNDEFINED
    return apart / ((zones - 1) * total)


# Transfer stations between zones (Algorithm 1, by the rules that gave the published numbers).
#
# For each pair of zones, union paths join tips that are near a station of the other zone. In the order
# of path length, the tip in the zone with more load becomes a transfer station, where the other zone's
# robot fetches. A pair is skipped if one of its ends is already a transfer station of these zones (the
# paper removes both ends of a chosen pair).


@kernel
def find_transfers(roads, rules, design, workspace, reach):
    """design.transfer between all zones with reach[z] = 1, from workspace.load.

    Other pairs of zones keep their transfer stations, except stations that have left both zones.
    """
    forget_moved(design)
    find_tips(roads, design, workspace)
    workspace.claimed[:] = 0
    for a in range(reach.shape[0]):
        for b in range(a + 1, reach.shape[0]):
            if reach[a] == 1 and reach[b] == 1:
                between_two(roads, rules, design, workspace, a, b)


@kernel
def forget_moved(design):
    """Drop the transfer stations of two zones that are in neither of them."""
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            for s in range(design.zone.shape[0]):
                if design.zone[s] != a and design.zone[s] != b:
                    design.transfer[a, b, s] = 0


@kernel
def between_two(roads, rules, design, workspace, a, b):
    """The transfer stations of two zones."""
    design.transfer[a, b, :] = 0
    design.transfer[b, a, :] = 0
    close_to_two(design, workspace, a, b)
    count = joined_tips(roads, rules, design, workspace, a, b)
    for k in range(count):
        x, y = np.int64(workspace.pair[k, 0]), np.int64(workspace.pair[k, 1])
        if design.transfer[a, b, x] == 1 or design.transfer[a, b, y] == 1:
            continue
        of_a = workspace.load[a] >= workspace.load[b]
        if workspace.serves[b, x] == 0 or workspace.serves[a, y] == 0:
            of_a = workspace.serves[b, x] == 1
            if workspace.serves[b, x] == 0 and workspace.serves[a, y] == 0:
                continue  # neither can be fetched from
        station, fetcher = (x, b) if of_a else (y, a)
        share_station(design, a, b, station)
        if rules.blocks:
            claim(roads, workspace, x, y, fetcher)


@kernel
def share_station(design, a, b, station):
    """Make a station a transfer station of two zones."""
    design.transfer[a, b, station] = 1
    design.transfer[b, a, station] = 1


@kernel
def close_to_two(design, workspace, a, b):
    """Close points that other zones hold or have claimed."""
    block_others(design, workspace, a, b)
    for p in range(design.held.shape[0]):
        for z in range(design.transfer.shape[0]):
            if z != a and z != b and workspace.claimed[p, z] == 1:
                workspace.blocked[p] = 1


@kernel
def joined_tips(roads, rules, design, workspace, a, b):
    """workspace.pair: tips x of a and y of b with a union path, shortest first; return their number."""
    bound = whole_cells(rules.limit)
    count = np.int64(0)
    for x in range(design.zone.shape[0]):
        if faces(roads, rules, design, workspace, x, a, b) == 0:
            continue
        spread(roads, workspace, roads.point[x], NIL, bound)
        for y in range(design.zone.shape[0]):
            far = workspace.distance[roads.point[y]]
            if far == UNREACHED or faces(roads, rules, design, workspace, y, b, a) == 0:
                continue
            at = count
            while at > 0 and workspace.length[at - 1] > far:
                workspace.length[at] = workspace.length[at - 1]
                workspace.pair[at, 0] = workspace.pair[at - 1, 0]
                workspace.pair[at, 1] = workspace.pair[at - 1, 1]
                at -= 1
            workspace.length[at] = far
            workspace.pair[at, 0] = x
            workspace.pair[at, 1] = y
            count += 1
    return count


@kernel
def faces(roads, rules, design, workspace, s, own, other):
    """1 if s is a tip of its own zone, near any station of the other one."""
    if design.zone[s] != own or workspace.tip[s] == 0:
        return 0
    for t in range(design.zone.shape[0]):
        if design.zone[t] == other and roads.between[s, t] <= rules.adjacent:
            return 1
    return 0


@kernel
def claim(roads, workspace, x, y, zone):
    """Claim the inner points of the path between two stations: later pairs of zones must avoid them."""
    spread(roads, workspace, roads.point[x], roads.point[y], UNREACHED)
    p = np.int64(workspace.back[roads.point[y]])
    while p != NIL and p != roads.point[x]:
        workspace.claimed[p, zone] = 1
        p = np.int64(workspace.back[p])


@kernel
def joined(design, a, b):
    """1 if two zones have a transfer station."""
    for s in range(design.zone.shape[0]):
        if design.transfer[a, b, s] == 1:
            return 1
    return 0


@kernel
def find_levels(design, workspace, zone):
    """workspace.level: number of transfers from each zone to this one, or NIL."""
    workspace.level[:] = NIL
    workspace.level[zone] = 0
    workspace.frontier[0] = zone
    count, at = np.int64(1), np.int64(0)
    while at < count:
        here = np.int64(workspace.frontier[at])
        at += 1
        for z in range(design.transfer.shape[0]):
            if workspace.level[z] == NIL and joined(design, here, z) == 1:
                workspace.level[z] = workspace.level[here] + 1
                workspace.frontier[count] = z
                count += 1
    return count


@kernel
def reach_connected(design, workspace, reach):
    """1 if parts can travel between all zones with reach[z] = 1."""
    begun = False
    for z in range(reach.shape[0]):
        if reach[z] == 1 and not begun:
            find_levels(design, workspace, z)
            begun = True
        if reach[z] == 1 and workspace.level[z] == NIL:
            return 0
    return 1


@kernel
def connected(design, workspace):
    """1 if parts can travel between all zones."""
    return 1 if find_levels(design, workspace, 0) == design.transfer.shape[0] else 0


@kernel
def connect_cut_off(roads, design, workspace):
    """Join isolated zones, from workspace.load; return 1 if all zones are then connected.

    Tips may be any distance apart, and transfer paths may share points (as in DDZ).
    """
    find_tips(roads, design, workspace)
    while connected(design, workspace) == 0:
        if join_nearest(roads, design, workspace) == 0:
            return 0
    return 1


@kernel
def join_nearest(roads, design, workspace):
    """Add a transfer station between a zone that parts reach by workspace.level and one that they do not.

    Chooses the pair of zones with the shortest union path between two tips; the zone with more load
    gives the station. Returns 0 if there is no pair.
    """
    best = np.int64(UNREACHED)
    x, y = np.int64(NIL), np.int64(NIL)
    for a in range(design.transfer.shape[0]):
        for b in range(design.transfer.shape[0]):
            if workspace.level[a] == NIL or workspace.level[b] != NIL:
                continue
            block_others(design, workspace, a, b)
            for s in range(design.zone.shape[0]):
                if design.zone[s] != a or workspace.tip[s] == 0:
                    continue
                spread(roads, workspace, roads.point[s], NIL, best)
                for t in range(design.zone.shape[0]):
                    far = workspace.distance[roads.point[t]]
                    if design.zone[t] == b and workspace.tip[t] == 1 and far < best:
                        best = far
                        x, y = np.int64(s), np.int64(t)
    if x == NIL:
        return 0
    a, b = np.int64(design.zone[x]), np.int64(design.zone[y])
    share_station(design, a, b, x if workspace.load[a] >= workspace.load[b] else y)
    return 1


# The robot that takes a part, and its stop: section "part transfers" of Keith & La, as in their code.


@kernel
def route(roads, design, workspace, rule, zone, at, to):
    """(zone of the queue, station of the drop, 1 if that is the target) of a part.

    zone: the owner of the part: the zone of the station that processed it, or after a transfer the
    zone of the robot that dropped it. at, to: the station where it is, and the next one of its route.
    A part that already waits at its transfer station belongs to the next robot. If no transfers lead
    to the target, its own robot delivers it: robots may leave their zones.
    """
    target = np.int64(design.zone[to])
    if zone != target:
        find_levels(design, workspace, target)
    while zone != target and workspace.level[zone] != NIL:
        station, other = way_out(roads, design, workspace, rule, zone, at, to)
        if station == to:
            break
        if station != at:
            return zone, station, 0
        zone = other
    return zone, to, 1


@kernel
def way_out(roads, design, workspace, rule, zone, at, to):
    """The transfer station through which a part leaves, and the zone that fetches it there.

    Prefers zones with the fewest remaining transfers; then the transfer station nearest to the part, or
    by the rule of DDZ, if transfers remain after it, nearest to its target; then the lowest.
    """
    best = np.int64(UNREACHED)
    station, other = np.int64(NIL), np.int64(NIL)
    to_target = rule == ROUTING_NEIGHBOURS and workspace.level[zone] > 1
    for s in range(design.zone.shape[0]):
        for z in range(design.transfer.shape[0]):
            if design.transfer[zone, z, s] == 0 or workspace.level[z] != workspace.level[zone] - 1:
                continue
            far = np.int64(roads.between[s, to] if to_target else roads.between[at, s])
            if far < best:
                best = far
                station, other = np.int64(s), np.int64(z)
    return station, other
