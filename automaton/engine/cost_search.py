"""Least costs from every pose to a goal cell: what a distance table is made of.

The search begins at the goal and goes against the direction of travel. In place of a heap it has a
queue for each distinct cost of a step or a turn. What enters a queue was reached at the cost of now
plus the cost of the queue, so each queue is sorted by itself, and the least of their heads is next:

    queue of cost 1:   4 4 5        now: 4, then 4, then 5 of the queue of cost 1, ...
    queue of cost 3:   5 6 6 7

With a single cost this is a breadth-first search. An entry is a cell with a set of headings:

    entry = cost << 32 | cell << 4 | headings (bit h)

At most 4 entries per cell come of steps (one for each direction in which it is left), and at most 3 of
turns, since each set of headings that turns was not reached before: that bounds the queues.
"""

import numpy as np

from automaton.engine.facilities import MAY_TURN
from automaton.engine.jit.fields import NIL
from automaton.engine.jit.kernel import kernel

ENTRIES_PER_CELL = 7  # of a queue
MAX_QUEUES = 16  # distinct costs
ENTRY_COST = 32  # bits below the cost
ENTRY_CELL = 4  # bits below the cell
ENTRY_MASK = (1 << ENTRY_COST) - 1
DELTA_BITS = 3  # of each heading in `turns`

# [headings, set of them]: the directions in which a robot moves that has one of them.
DIRECTIONS_OF = np.array(
    [
        [
            sum(1 << d for d in range(4) if headings and (chosen >> (d % headings)) & 1)
            for chosen in range(16)
        ]
        for headings in range(5)
    ],
    np.uint8,
)
# [set of headings]: 1 in the bits of each of them in `turns`.
DELTA_OF = np.array(
    [sum(((chosen >> h) & 1) << (DELTA_BITS * h) for h in range(4)) for chosen in range(16)],
    np.uint16,
)


@kernel
def find_costs(tables, cost_set, goal):
    """Find the least cost from each pose to a goal cell in any heading; False if it was given up.

    Written: `reached` and, where `is_narrow`, `least` and `turns`, else `costs`, of the cells reached.
    """
    tables.reached[:] = 0
    tables.head[:] = 0
    tables.end[:] = 0
    tables.queue[0, 0] = (goal << ENTRY_CELL) | ((1 << tables.headings) - 1)
    tables.end[0] = 1
    if tables.goal_entries.shape[0] and np.int64(tables.entries[cost_set, goal]) & 15 == 0:
        enter_goal(tables, cost_set, goal)
    queues = np.int64(tables.queue_count[cost_set])
    while tables.stop[0] == 0:
        now = np.int64(1) << 31
        source = np.int64(NIL)
        for q in range(queues):
            if tables.head[q] < tables.end[q]:
                cost = tables.queue[q, tables.head[q]] >> ENTRY_COST
                if cost < now:
                    now = cost
                    source = np.int64(q)
        if source == NIL:
            return True
        drain(tables, cost_set, source, now)
    return False


@kernel
def enter_goal(tables, cost_set, goal):
    """Enter the steps into a goal through which no way leads."""
    ways = np.int64(tables.goal_entries[cost_set, goal])
    for direction in range(4):
        if (ways >> direction) & 1:
            before = goal - tables.offset[direction]
            q = 0
            if tables.step_queue.shape[0]:
                q = np.int64(tables.step_queue[cost_set, 4 * before + direction])
            heading = heading_set(tables, cost_set, direction)
            cost = np.int64(tables.cost[cost_set, q]) << ENTRY_COST
            tables.queue[q, tables.end[q]] = cost | (before << ENTRY_CELL) | heading
            tables.end[q] += 1


@kernel
def heading_set(tables, cost_set, direction):
    """The set of headings in which a robot moves in a direction; those it does not distinguish too."""
    return tables.alike[cost_set] << (direction & (tables.set_headings[cost_set] - 1))


@kernel
def drain(tables, cost_set, source, now):
    """Settle the entries of a queue that cost as much as `now`, and enter what comes before them."""
    headings, entries, offset = tables.headings, tables.entries[cost_set], tables.offset
    queue, end, reached, cost_of = tables.queue, tables.end, tables.reached, tables.cost[cost_set]
    turn_queue = np.int64(tables.turn_queue[cost_set])
    mask, alike = tables.set_headings[cost_set] - 1, tables.alike[cost_set]
    turn_cost = (now + cost_of[turn_queue]) << ENTRY_COST
    step_cost = (now + cost_of[0]) << ENTRY_COST
    is_weighted = tables.step_queue.shape[0] > 0
    at = np.uint64(tables.head[source])
    while at < np.uint64(end[source]):
        entry = queue[source, at]
        if entry >> ENTRY_COST != now:
            break
        at += np.uint64(1)
        cell = (entry & ENTRY_MASK) >> ENTRY_CELL
        known = np.int64(reached[np.uint64(cell)])
        new = entry & 15 & ~known
        if new == 0:
            continue
        note_costs(tables, cell, known, new, now)
        known |= new
        reached[np.uint64(cell)] = known
        flags = np.int64(entries[np.uint64(cell)])
        turned = turned_from(headings, new) & ~known
        if turned and flags & MAY_TURN:
            queue[turn_queue, np.uint64(end[turn_queue])] = (
                turn_cost | (cell << ENTRY_CELL) | turned
            )
            end[turn_queue] += 1
        ways = flags & np.int64(DIRECTIONS_OF[np.uint64(headings), np.uint64(new)])
        direction = 0
        while ways:
            if ways & 1:
                before = cell - offset[np.uint64(direction)]
                heading = alike << (direction & mask)
                if np.int64(reached[np.uint64(before)]) & heading == 0:
                    q, cost = np.uint64(0), step_cost
                    if is_weighted:
                        q = np.uint64(
                            tables.step_queue[cost_set, np.uint64(4 * before + direction)]
                        )
                        cost = (now + cost_of[q]) << ENTRY_COST
                    queue[q, np.uint64(end[q])] = cost | (before << ENTRY_CELL) | heading
                    end[q] += 1
            ways >>= 1
            direction += 1
    tables.head[source] = np.int64(at)


@kernel(inline=True)
def note_costs(tables, cell, known, new, now):
    """Note the cost of new headings of a cell, of which some are known."""
    if tables.is_narrow:
        if known == 0:
            tables.least[np.uint64(cell)] = now
            tables.turns[np.uint64(cell)] = 0
        else:
            delta = np.uint16(now - np.int64(tables.least[np.uint64(cell)]))
            tables.turns[np.uint64(cell)] += DELTA_OF[np.uint64(new)] * delta
    else:
        for heading in range(tables.headings):
            if (new >> heading) & 1:
                tables.costs[np.uint64(cell * tables.headings + heading)] = now


@kernel(inline=True)
def turned_from(headings, chosen):
    """The set of headings a quarter turn from a set of them, to both sides."""
    if headings == 4:
        return ((chosen << 1) | (chosen >> 3) | (chosen >> 1) | (chosen << 3)) & 15
    if headings == 2:
        return ((chosen << 1) | (chosen >> 1)) & 3
    return np.int64(0)
