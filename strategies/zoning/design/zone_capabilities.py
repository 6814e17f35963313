"""What the robots of zones can do: stations that they serve, priority there, and how fast they are.

A zone has the number of its robot. `accessible` and `has_priority` (Z, S) are given for a run: 1 = the
robot gets to the station, and 1 = its type has priority there. Where all robots are alike, all
robots serve everything and none has priority.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.linear_sum_assignment import INF_COST, linear_sum_assignment

# Cost of a station in a zone whose robot has no priority there, and another one has.
MISPLACED = 1 << 30


@kernel
def may_take(workspace, a, b, s):
    """Whether zone a may give a station to zone b: its robot gets there, and loses no priority."""
    return workspace.serves[b, s] == 1 and (
        workspace.first[a, s] == 0 or workspace.first[b, s] == 1
    )


@kernel
def preference(workspace, zone, s):
    """1 if the robot of a zone has priority at a station, -1 if only others have it, else 0."""
    if workspace.first[zone, s] == 1:
        return 1
    for other in range(workspace.first.shape[0]):
        if workspace.first[other, s] == 1:
            return -1
    return 0


@kernel
def are_alike(workspace):
    """Whether it does not matter which robot gets which zone."""
    for z in range(workspace.serves.shape[0]):
        if workspace.move_time_factor[z] != workspace.move_time_factor[0]:
            return False
        for s in range(workspace.serves.shape[1]):
            if workspace.serves[z, s] == 0 or workspace.first[z, s] == 1:
                return False
    return True


@kernel
def match(design, workspace):
    """Number the zones after robots that serve them, one to one; returns 0 if there is no such way.

    Of all matchings one with the fewest stations away from who has priority there; of these one that
    gives the larger zones to the faster robots (linear sum assignment).
    """
    zones = workspace.serves.shape[0]
    cost = workspace.matching.cost
    for z in range(zones):
        for robot in range(zones):
            cost[z, robot] = cost_of(design, workspace, z, robot)
    linear_sum_assignment(cost, zones, zones, workspace.matching)
    workspace.frontier[:] = NIL
    for robot in range(zones):
        z = np.int64(workspace.matching.row_of[robot])
        if z == NIL:
            return 0
        workspace.frontier[z] = robot
    rename(design, workspace.frontier)
    return 1


@kernel
def cost_of(design, workspace, zone, robot):
    """What it costs to give a zone to a robot; INF_COST: it does not serve all of it."""
    cost = np.int64(0)
    for s in range(design.zone.shape[0]):
        if design.zone[s] != zone:
            continue
        if workspace.serves[robot, s] == 0:
            return np.int64(INF_COST)
        cost += np.int64(1000 * workspace.move_time_factor[robot])
        if preference(workspace, robot, s) < 0:
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
