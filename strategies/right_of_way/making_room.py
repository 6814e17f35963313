"""Idle robots make room where pushing them is in vain: in queues of stations, in pockets, and in blocks.

A robot in the queue of its station pushes no robot, since the queue alone moves it. From a pocket, a
station or charger with one way in and out, a robot can only come before another one is at its mouth.
So idle robots leave both as soon as another robot has something to do there; and a block or lift that
holds as many robots as it may, as soon as another robot faces it. Elsewhere they are pushed.
"""

import numpy as np

from automaton.engine.facilities import GATE_BLOCK
from automaton.engine.jit.structs import CONSTANT, SCRATCH, Struct, field
from automaton.engine.state import GOAL_NONE, GOAL_PARK, NIL, Array
from automaton.floor.cells import CHARGER, STATION
from automaton.strategy.kernels import has_gates, is_facing, kernel

NO_WAY_OUT = 4  # beside the four directions


class ServiceAreas(Struct):
    """The p service areas of a floor of c cells; both are 0 without any."""

    area: Array = field(
        "(c,) int32", "the service area that a cell belongs to, or NIL", role=CONSTANT
    )
    way_out: Array = field(
        "(c,) uint8", "direction of the next step out of it, or NO_WAY_OUT", role=CONSTANT
    )
    gate: Array = field(
        "(p,) int32", "the block or lift that it is, or NIL", default=NIL, role=CONSTANT
    )
    callers: Array = field(
        "(p,) int32",
        "robots that have something to do there, or face it where it is full",
        role=SCRATCH,
    )


def service_areas_of(view):
    """Return the service areas: stations with queues, each with its queue, pockets, blocks and lifts.

    A cell without limit is in none but blocks and lifts: it holds robots that stay, too. A cell of a
    station's queue or of a pocket belongs to that.
    """
    grid, stations = view.grid, view.pod_stations
    limited = grid.cell_flags >> 5 & 3 != 0
    lane = np.flatnonzero((stations.queue_at != NIL) & limited[: len(stations.queue_at)])
    heads = np.flatnonzero(limited & np.isin(grid.kind, (STATION, CHARGER)) & is_pocket(grid))
    heads = np.union1d(heads, stations.cell[stations.queue_at[lane]])
    gates = np.flatnonzero(view.gates.kind >= GATE_BLOCK)
    if not len(heads) + len(gates):
        return ServiceAreas.sized({"p": 0, "c": 0})
    area = np.full(len(grid.kind), NIL, np.int32)
    area[heads] = np.arange(len(heads), dtype=np.int32)
    head = stations.cell[stations.queue_at[lane]]
    area[lane] = area[head]
    way_out = ways_out(grid, area)
    beyond = head + grid.offset[way_out[head] & 3]
    through = lane[(way_out[head] != NO_WAY_OUT) & (area[beyond] == NIL)]
    way_out[through] = stations.queue_way[through]  # the others in the queue stand behind
    for number, gate in enumerate(gates, len(heads)):
        entries = np.flatnonzero(view.gates.cell_gate == gate)
        inside = np.full(len(area), NIL, np.int32)
        inside[np.searchsorted(view.gates.cell_first, entries, side="right") - 1] = number
        added = (area == NIL) & (inside == number)
        area[added], way_out[added] = number, ways_out(grid, inside)[added]
    area[way_out == NO_WAY_OUT] = NIL
    gate = np.concatenate((np.full(len(heads), NIL), gates)).astype(np.int32)
    return ServiceAreas.sized({"p": len(gate)}, area=area, way_out=way_out, gate=gate)


def is_pocket(grid):
    """Return (c,) bool: cells that lead to one neighbour, and are reached from it alone."""
    ways_out, ways_in, both = (np.zeros(len(grid.kind), int) for _ in range(3))
    for direction, offset in enumerate(grid.offset.tolist()):
        leads = grid.cell_flags >> direction & 1
        comes = np.roll(grid.cell_flags, -offset) >> (direction ^ 2) & 1
        ways_out += leads
        ways_in += comes
        both += leads & comes
    return (ways_out == 1) & (ways_in == 1) & (both == 1)


def ways_out(grid, area):
    """Return (c,) the first direction of a shortest way out of the area of a cell, or NO_WAY_OUT."""
    way_out = np.full(len(area), NO_WAY_OUT, np.uint8)
    front = area == NIL
    while front.any():
        reached = np.zeros(len(area), bool)
        for direction, offset in enumerate(grid.offset.tolist()):
            leads = (grid.cell_flags >> direction & 1 != 0) & np.roll(front, -offset)
            ahead = np.roll(area, -offset)
            leaving = leads & (area != NIL) & ((ahead == NIL) | (ahead == area))
            leaving &= (way_out == NO_WAY_OUT) & ~reached
            way_out[leaving] = direction
            reached |= leaving
        front = reached
    return way_out


@kernel
def count_callers(view, areas):
    """Count the robots that have something to do in each area."""
    if areas.callers.shape[0] == 0:
        return
    areas.callers[:] = 0
    robots = view.robots
    for i in range(robots.cell.shape[0]):
        if robots.goal_type[i] != GOAL_NONE and robots.goal_type[i] != GOAL_PARK:
            goal = np.int64(robots.goal_cell[i])
            area = areas.area[goal] if goal != NIL else NIL
            if area != NIL and areas.gate[area] == NIL:
                areas.callers[area] += 1
        if has_gates(view) and robots.cell[i] != NIL and robots.goal_type[i] != GOAL_NONE:
            call_at_full_gate(view, areas, i)


@kernel
def call_at_full_gate(view, areas, i):
    """Count robot i for the block or lift that it faces, if that holds as many robots as it may.

    Robots that only want to park in there do not count: they would take turns with those that do.
    """
    robots, cell = view.robots, np.int64(view.robots.cell[i])
    for direction in range(4):
        leads = (np.int64(view.grid.cell_flags[cell]) >> direction) & 1
        if leads == 0 or not is_facing(view, i, direction):
            continue
        area = np.int64(areas.area[cell + view.grid.offset[direction]])
        if area == NIL or area == areas.area[cell] or areas.gate[area] == NIL:
            continue
        gate = np.int64(areas.gate[area])
        parks = robots.goal_type[i] == GOAL_PARK and areas.area[robots.goal_cell[i]] == area
        if not parks and view.gates.robots[gate] >= view.gates.max_robots[gate]:
            areas.callers[area] += 1


@kernel
def is_needed(areas, cell):
    """Return whether a cell belongs to an area in which a robot has something to do."""
    if areas.callers.shape[0] == 0 or cell == NIL:
        return False
    area = areas.area[cell]
    return area != NIL and areas.callers[area] > 0


@kernel
def way_to_make_room(view, areas, i, cell):
    """Return the direction in which robot i, without work, leaves its cell in a needed area, or NIL."""
    robots = view.robots
    is_idle = robots.goal_type[i] == GOAL_NONE or robots.goal_type[i] == GOAL_PARK
    if not is_idle or not is_needed(areas, cell):
        return np.int64(NIL)
    area = np.int64(areas.area[cell])
    is_through = areas.gate[area] != NIL and robots.goal_type[i] == GOAL_PARK
    if is_through and areas.area[robots.goal_cell[i]] != area:
        return np.int64(NIL)  # it goes through, on its own way
    return np.int64(areas.way_out[cell])


@kernel
def may_not_go_home(view, areas, i):
    """Return whether robot i would park in an area that is needed; it has no goal as long as it is."""
    robots = view.robots
    return robots.goal_type[i] == GOAL_PARK and is_needed(areas, np.int64(robots.goal_cell[i]))
