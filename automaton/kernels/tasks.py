"""The least time that a task takes: both legs driven on the empty floor."""

from automaton.compiled import kernel
from automaton.kernels.search import (
    FAR,
    STARTED,
    TURNED_AHEAD,
    TURNED_BEHIND,
    begin_search,
    distance,
    pop,
    reach,
)
from automaton.kernels.stands import drop_stand, pick_stand
from automaton.world.state import MOVE, TURN

POSE = (1 << 32) - 1  # a key of the queue: estimated ticks << 32 | pose


@kernel
def least_drives(view, space, which, out):
    """out[order] = least ticks of driving for each order in `which`: to its source, then to its target.

    The first leg begins where and with the heading in which the order was taken, the second one with
    the heading in which the first one ends; of several that take the least ticks, the best counts.
    Slots are served from the cells that the shipped allocations choose, by the type of robot that
    took the order last. FAR if there is no way.
    """
    orders = view.orders
    for k in range(which.shape[0]):
        order = which[k]
        start = orders.dispatched_from[order] * view.grid.headings
        start += orders.dispatched_heading[order]
        kind = orders.dispatched_type[order]
        stand = pick_stand(view, kind, orders.source[order])
        end = drop_stand(view, kind, orders.target[order])
        out[order] = least_by(view, space, kind, start, stand, end)


@kernel
def least_by(view, space, kind, start, stand, end):
    """Least ticks from a pose to a cell, and from there to another one; FAR if there is no way.

    A* with the Manhattan estimate, to every heading in which the first cell is reached soonest.
    """
    headings = view.grid.headings
    if headings == 1:
        to_stand = distance(view, space, kind, start, 0, stand)
        return to_stand + distance(view, space, kind, stand, 0, end)
    search = begin_search(space)
    size = reach(space, search, 0, start, 0, estimate(view, kind, start, stand), STARTED)
    least = best = FAR
    while size > 0 and space.stop[0] == 0:
        key = pop(space.heap, size)
        size -= 1
        pose = key & POSE
        ticks = space.cost[pose]
        if (key >> 32) > least:
            break
        if (key >> 32) != ticks + estimate(view, kind, pose, stand):
            continue  # a better way to this pose was found meanwhile
        if pose // headings == stand:
            least = ticks
            best = min(best, ticks + distance(view, space, kind, stand, pose % headings, end))
        size = go_on(view, space, search, size, kind, pose, ticks, stand)
    return best


@kernel
def go_on(view, space, search, size, kind, pose, ticks, stand):
    """Enter the poses that follow on a pose into the queue; returns its size."""
    grid, duration, ways = view.grid, view.rules.duration[kind], view.grid.ways[kind]
    cell, heading = pose // grid.headings, pose % grid.headings
    for way in range(heading, 4, grid.headings):
        if (ways[cell] >> way) & 1:
            to = (cell + grid.offset[way]) * grid.headings + heading
            left = estimate(view, kind, to, stand)
            size = reach(space, search, size, to, ticks + duration[MOVE], left, way)
    if grid.headings > 1 and ways[cell] & 16:
        left = estimate(view, kind, pose, stand)
        for k in range(2):
            to = cell * grid.headings + ((heading + 1 - 2 * k) & (grid.headings - 1))
            how = TURNED_BEHIND if k else TURNED_AHEAD
            size = reach(space, search, size, to, ticks + duration[TURN], left, how)
    return size


@kernel
def estimate(view, kind, pose, target):
    """Ticks from a pose to a cell at least."""
    cell, width = pose // view.grid.headings, view.grid.width
    left = abs(cell // width - target // width) + abs(cell % width - target % width)
    return left * view.rules.duration[kind, MOVE]
