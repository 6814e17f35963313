"""Who takes a part, and where to: section "part transfers" of Keith & La, as their code does it."""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.zoning.design.transfer_stations import find_levels
from strategies.zoning.design.zone_workspace import INF_COST

ROUTING_CENTRAL = 0  # rule of SA and GA: through the nearest transfer station
# rule of DDZ: without a common one, through the one that is nearest to the target
ROUTING_NEIGHBOURS = 1


@kernel
def route(roads, design, workspace, rule, zone, at, to):
    """(zone in whose queue it is, station where it is dropped, 1 = that is the target).

    zone: whose part it is: that of the station where it was processed, or after a transfer that of
    the robot that dropped it. at, to: the station where it is, the next one of its route. A part
    that waits at the transfer station to which it would be brought is the next robot's already.
    Where no transfers lead to the target, its own robot delivers: zones do not bind robots.
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
    """The transfer station by which a part leaves, and the zone that fetches it there.

    Zones with the fewest transfers left; of their transfer stations the nearest to where the part
    is, or by the rule of DDZ, when transfers remain after it, to its target; then the lowest.
    """
    best = np.int64(INF_COST)
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
