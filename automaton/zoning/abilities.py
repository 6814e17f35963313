"""What the robots of zones can do: stations that they serve, priority there, and how fast they are.

A zone has the number of its robot. `space.serves` and `space.first` (Z, S) are given for a run: 1 = the
robot gets to the station, and 1 = its type has priority there. Where all robots are alike, everybody
serves everything and nobody has priority.
"""

import numpy as np

from automaton.auctions.assignment import linear_sum_assignment
from automaton.auctions.market import INF
from automaton.compiled import kernel
from automaton.world.state import NIL

MISPLACED = (
    1 << 30
)  # cost of a station in a zone whose robot has no priority there, another one has


@kernel
def may_take(space, a, b, s):
    """Whether zone a may give a station to zone b: its robot gets there, and loses no priority."""
    return space.serves[b, s] == 1 and (space.first[a, s] == 0 or space.first[b, s] == 1)


@kernel
def preference(space, zone, s):
    """1 if the robot of a zone has priority at a station, -1 if only others have it, else 0."""
    if space.first[zone, s] == 1:
        return 1
    for other in range(space.first.shape[0]):
        if space.first[other, s] == 1:
            return -1
    return 0


@kernel
def are_alike(space):
    """Whether it does not matter which robot gets which zone."""
    for z in range(space.serves.shape[0]):
        if space.pace[z] != space.pace[0]:
            return False
        for s in range(space.serves.shape[1]):
            if space.serves[z, s] == 0 or space.first[z, s] == 1:
                return False
    return True


@kernel
def match(design, space):
    """Number the zones after robots that serve them, one to one; returns 0 if there is no such way.

    Of all matchings one with the fewest stations away from who has priority there; of these one that
    gives the larger zones to the faster robots (linear sum assignment).
    """
    zones = space.serves.shape[0]
    cost = space.matching.cost
    for z in range(zones):
        for robot in range(zones):
            cost[z, robot] = cost_of(design, space, z, robot)
    linear_sum_assignment(cost, zones, zones, space.matching)
    space.wave[:] = NIL
    for robot in range(zones):
        z = np.int64(space.matching.row_of[robot])
        if z == NIL:
            return 0
        space.wave[z] = robot
    rename(design, space.wave)
    return 1


@kernel
def cost_of(design, space, zone, robot):
    """What it costs to give a zone to a robot; INF: it does not serve all of it."""
    cost = np.int64(0)
    for s in range(design.zone.shape[0]):
        if design.zone[s] != zone:
            continue
        if space.serves[robot, s] == 0:
            return np.int64(INF)
        cost += np.int64(1000 * space.pace[robot])
        if preference(space, robot, s) < 0:
            cost += MISPLACED
    return cost


@kernel
def rename(design, name):
    """Zone z becomes zone name[z]; the design has no transfer stations yet."""
    for s in range(design.zone.shape[0]):
        if design.zone[s] != NIL:
            design.zone[s] = name[design.zone[s]]
    for m in range(design.segments[0]):
        design.owner[m] = name[design.owner[m]]
    for p in range(design.held.shape[0]):
        if design.held[p] >= 0:
            design.held[p] = name[design.held[p]]
