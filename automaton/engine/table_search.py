"""Least costs from every pose to a goal cell: the contents of distance tables.

The search begins at the goal and runs against the direction of travel. Instead of a heap it has a
queue for each distinct cost of a step or a turn. An entry is added at the current cost plus the
cost of the queue, so each queue stays sorted, and the least head of all queues is next:

    queue of cost 1:   4 4 5        now: 4, then 4, then 5 of the queue of cost 1, ...
    queue of cost 3:   5 6 6 7

With a single cost this is a breadth-first search. An entry is a cell with a set of headings:

    entry = cost << 32 | cell << 4 | headings (bit h)

At most 4 entries per cell come from steps (one per direction of leaving it), and at most 3 from
turns, since only newly reached sets of headings turn: this bounds the queues.

With more than MAX_QUEUES distinct costs the entries are in a radix heap instead: an entry is in the
bucket of the highest bit in which its cost differs from the cost now (0: equal). When bucket 0 is
empty, the least cost of the first other bucket becomes the cost now, and that bucket is divided again.
Ahuja, Mehlhorn, Orlin & Tarjan, JACM 1990.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import NIL
from automaton.engine.state import MAY_TURN

ENTRIES_PER_CELL = 7  # in a queue
MAX_QUEUES = 16  # most distinct costs with a queue for each
BUCKETS = 33  # of a radix heap: by the highest of 32 bits, or none
ENTRY_COST = 32  # bits below the cost
ENTRY_CELL = 4  # bits below the cell
ENTRY_MASK = (1 << ENTRY_COST) - 1
DELTA_BITS = 3  # per heading in `turns`

# [headings, set of headings]: the directions in which a robot with one of them can move.
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
# [set of headings]: 1 in the bits of each of its headings in `turns`.
BIT_LENGTH = np.array([value.bit_length() for value in range(256)], np.int64)
DELTA_OF = np.array(
    [sum(((chosen >> h) & 1) << (DELTA_BITS * h) for h in range(4)) for chosen in range(16)],
    np.uint16,
)


@kernel
def find_costs(tables, cost_set, goal):
    """Find the least cost from each pose to a goal cell in any heading; False if aborted.

    Writes, for reached cells, `reached` and, if `is_narrow`, `least` and `turns`, else `costs`.
    """
    if tables.step.shape[0]:
        return find_many_costs(tables, cost_set, goal)
    tables.reached[:] = 0
    tables.head[:] = 0
    tables.end[:] = 0
    tables.status.settled = 0
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
    """Enter the steps into a goal that no path crosses."""
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
    """The headings with which a robot can move in a direction, including those it does not
    distinguish."""
    return tables.alike[cost_set] << (direction & (tables.set_headings[cost_set] - 1))


@kernel
def drain(tables, cost_set, source, now):
    """Settle the entries of a queue with cost `now`, and enter their predecessors."""
    headings, entries, offset = tables.headings, tables.entries[cost_set], tables.offset
    queue, end, reached, cost_of = tables.queue, tables.end, tables.reached, tables.cost[cost_set]
    turn_queue = np.int64(tables.turn_queue[cost_set])
    mask, alike = tables.set_headings[cost_set] - 1, tables.alike[cost_set]
    turn_cost = (now + cost_of[turn_queue]) << ENTRY_COST
    step_cost = (now + cost_of[0]) << ENTRY_COST
    is_weighted = tables.step_queue.shape[0] > 0
    notes, settled = tables.settled.shape[0] > 0, tables.status.settled
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
        if notes:
            tables.settled[settled] = (cell << ENTRY_CELL) | new
            settled += 1
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
    tables.status.settled = settled


@kernel
def find_many_costs(tables, cost_set, goal):
    """As `find_costs`, with a radix heap for any number of distinct costs."""
    headings, entries, offset = tables.headings, tables.entries[cost_set], tables.offset
    mask, alike = tables.set_headings[cost_set] - 1, tables.alike[cost_set]
    step, turn = tables.step[cost_set], tables.cost[cost_set, tables.turn_queue[cost_set]]
    reached, bucket = tables.reached, tables.bucket
    reached[:] = 0
    bucket[:] = NIL
    count, settled, now = np.int64(0), np.int64(0), np.int64(0)
    add_entry(tables, count, now, (goal << ENTRY_CELL) | ((1 << headings) - 1))
    count += 1
    if tables.goal_entries.shape[0] and np.int64(entries[goal]) & 15 == 0:
        ways = np.int64(tables.goal_entries[cost_set, goal])
        for direction in range(4):
            if (ways >> direction) & 1:
                before = goal - offset[direction]
                cost = np.int64(step[4 * before + direction]) << ENTRY_COST
                heading = heading_set(tables, cost_set, direction)
                add_entry(tables, count, now, cost | (before << ENTRY_CELL) | heading)
                count += 1
    while tables.stop[0] == 0:
        if bucket[0] == NIL:
            now = divide_bucket(tables, now)
            if now == NIL:
                tables.status.settled = settled
                return True
        first = np.uint64(bucket[0])
        bucket[0] = tables.following[first]
        cell = (tables.entry[first] & ENTRY_MASK) >> ENTRY_CELL
        known = np.int64(reached[np.uint64(cell)])
        new = tables.entry[first] & 15 & ~known
        if new == 0:
            continue
        note_costs(tables, cell, known, new, now)
        known |= new
        reached[np.uint64(cell)] = known
        if tables.settled.shape[0]:
            tables.settled[settled] = (cell << ENTRY_CELL) | new
            settled += 1
        flags = np.int64(entries[np.uint64(cell)])
        turned = turned_from(headings, new) & ~known
        if turned and flags & MAY_TURN:
            entry = ((now + turn) << ENTRY_COST) | (cell << ENTRY_CELL) | turned
            add_entry(tables, count, now, entry)
            count += 1
        ways = flags & np.int64(DIRECTIONS_OF[np.uint64(headings), np.uint64(new)])
        for direction in range(4):
            if (ways >> direction) & 1:
                before = cell - offset[np.uint64(direction)]
                heading = alike << (direction & mask)
                if np.int64(reached[np.uint64(before)]) & heading == 0:
                    cost = now + np.int64(step[np.uint64(4 * before + direction)])
                    entry = (cost << ENTRY_COST) | (before << ENTRY_CELL) | heading
                    add_entry(tables, count, now, entry)
                    count += 1
    return False


@kernel(inline=True)
def add_entry(tables, at, now, entry):
    """Put an entry of a cost from `now` on into its bucket."""
    tables.entry[np.uint64(at)] = entry
    into = bucket_of((entry >> ENTRY_COST) ^ now)
    tables.following[np.uint64(at)] = tables.bucket[np.uint64(into)]
    tables.bucket[np.uint64(into)] = at


@kernel(inline=True)
def bucket_of(bits):
    """The number of bits up to the highest one that is set, below 2**32."""
    if bits >> 16:
        high = bits >> 24
        return BIT_LENGTH[np.uint64(high)] + 24 if high else BIT_LENGTH[np.uint64(bits >> 16)] + 16
    high = bits >> 8
    return BIT_LENGTH[np.uint64(high)] + 8 if high else BIT_LENGTH[np.uint64(bits)]


@kernel
def divide_bucket(tables, now):
    """Divide the first bucket that has entries; returns their least cost, NIL without any."""
    bucket, following, entry = tables.bucket, tables.following, tables.entry
    number = 1
    while number < BUCKETS and bucket[number] == NIL:
        number += 1
    if number == BUCKETS:
        return np.int64(NIL)
    at, now = np.int64(bucket[number]), np.int64(1) << 31
    while at != NIL:
        now = min(now, entry[np.uint64(at)] >> ENTRY_COST)
        at = np.int64(following[np.uint64(at)])
    at = np.int64(bucket[number])
    bucket[number] = NIL
    while at != NIL:
        after = np.int64(following[np.uint64(at)])
        into = np.uint64(bucket_of((entry[np.uint64(at)] >> ENTRY_COST) ^ now))
        following[np.uint64(at)] = bucket[into]
        bucket[into] = at
        at = after
    return now


# The ticks of the ways of least cost.


@kernel
def find_ticks(tables, cost_set, goal):
    """Enter the ticks of the way from each pose, in the order in which the search reached them.

    The way prefers a move to a turn, then the lowest direction, then the turn to the right.
    """
    headings, ticks = tables.headings, tables.ticks
    turn = np.int64(tables.cost[cost_set, tables.turn_queue[cost_set]])
    turn_ticks, mask = np.int64(tables.turn_ticks[cost_set]), tables.set_headings[cost_set] - 1
    for k in range(tables.status.settled):
        cell = tables.settled[np.uint64(k)] >> ENTRY_CELL
        for heading in range(headings):
            if (tables.settled[np.uint64(k)] >> heading) & 1 == 0:
                continue
            pose = np.uint64(cell * headings + heading)
            ticks[pose] = 0
            if cell == goal:
                continue
            facing, turned = heading & mask, np.int64(0)
            way = way_ahead(tables, cost_set, goal, cell, facing)
            while way == NIL and turned <= 4 * turn_ticks:
                after = (facing + 1) & mask
                cost = pose_cost(tables, cell, facing) - turn
                if not is_reached(tables, cell, after) or pose_cost(tables, cell, after) != cost:
                    after = (facing - 1) & mask
                facing = after
                turned += turn_ticks
                way = way_ahead(tables, cost_set, goal, cell, facing)
            to = (cell + tables.offset[way]) * headings + facing
            step = np.int64(tables.step_ticks[cost_set, np.uint64(4 * cell + way)])
            ticks[pose] = turned + step + np.int64(ticks[np.uint64(to)])


@kernel
def way_ahead(tables, cost_set, goal, cell, heading):
    """The direction of a move on the way of least cost from a pose, or NIL if it turns first."""
    cost = pose_cost(tables, cell, heading)
    for direction in range(heading, 4, tables.set_headings[cost_set]):
        after = cell + tables.offset[direction]
        ways = np.int64(tables.entries[cost_set, np.uint64(after)])
        if after == goal and tables.goal_entries.shape[0]:
            ways = np.int64(tables.goal_entries[cost_set, np.uint64(after)])
        if (ways >> direction) & 1 == 0 or not is_reached(tables, after, heading):
            continue
        if pose_cost(tables, after, heading) == cost - cost_of_step(
            tables, cost_set, cell, direction
        ):
            return np.int64(direction)
    return np.int64(NIL)


@kernel(inline=True)
def is_reached(tables, cell, heading):
    return (np.int64(tables.reached[np.uint64(cell)]) >> heading) & 1 != 0


@kernel(inline=True)
def pose_cost(tables, cell, heading):
    """The cost of a reached pose, in units."""
    if tables.is_narrow:
        delta = (np.int64(tables.turns[np.uint64(cell)]) >> (DELTA_BITS * heading)) & 7
        return np.int64(tables.least[np.uint64(cell)]) + delta
    return np.int64(tables.costs[np.uint64(cell * tables.headings + heading)])


@kernel(inline=True)
def cost_of_step(tables, cost_set, cell, direction):
    """The cost of a step out of a cell, in units."""
    at = np.uint64(4 * cell + direction)
    if tables.step.shape[0]:
        return np.int64(tables.step[cost_set, at])
    if tables.step_queue.shape[0]:
        return np.int64(tables.cost[cost_set, np.uint64(tables.step_queue[cost_set, at])])
    return np.int64(tables.cost[cost_set, 0])


@kernel(inline=True)
def note_costs(tables, cell, known, new, now):
    """Enter the cost of new headings of a cell that already has known headings."""
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
    """The set of headings one quarter turn from a set of headings, to either side."""
    if headings == 4:
        return ((chosen << 1) | (chosen >> 3) | (chosen >> 1) | (chosen << 3)) & 15
    if headings == 2:
        return ((chosen << 1) | (chosen >> 1)) & 3
    return np.int64(0)
