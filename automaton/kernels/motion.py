"""Which of the moves that robots want in a tick happen: the occupancy rules of the world.

Executed is the greatest set of intents in which every cell has room for its best-ranked claimants,
counting what members of the set give up; queues follow and rings rotate by themselves.

One byte of occupancy per cell: bits 0-3 say that somebody claims the cell travelling E, S, W, N;
bit 4 that two claim it in one direction; bits 5-7 hold its room: bit 5 a free cell of capacity 1,
bits 5 and 6 the free lanes (E and S, W and N) of capacity 2, bit 7 a cell without limit.
A *resource* is a cell of capacity 1 or one lane: it has one holder, so one claimant at most wins.

Two passes decide all but the contested and the queueing intents from these bytes alone; only final
inferences are drawn, so the order of the robots does not matter. `resolve` decides the rest.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import mix
from automaton.world.state import NIL

LIVE = 4  # bits of traffic.want; bits 0-1 are the direction
ENTERED = 8  # it left its bay this tick: nobody may follow into its cell
MOVED = 16  # outcomes
REFUSED = 32
ARRIVED = 64  # a long move ended, or a robot stands at its goal already
ON_PATH = 128  # scratch of rotate_ring

CLAIMS = 31
TWO_CLAIMS = 16
ROOM_ONE = 32
ROOM_ENDLESS = 128

U = np.uint64  # unsigned where it indexes: saves the test for a negative index


@kernel(inline=True)
def room_bit(rule, direction):
    """The room that a robot travelling in `direction` needs in a cell with this rule byte."""
    capacity = (rule >> 5) & 3
    if capacity == 1:
        return 32
    if capacity == 2:
        return 32 << (direction >> 1)
    return 128


@kernel
def occupy(grid, occupancy, cell, direction):
    bit = room_bit(np.int64(grid.rule[cell]), np.int64(direction))
    if bit != ROOM_ENDLESS:
        occupancy[cell] = np.uint8(np.int64(occupancy[cell]) & ~bit)


@kernel
def vacate(grid, occupancy, cell, direction):
    bit = room_bit(np.int64(grid.rule[cell]), np.int64(direction))
    occupancy[cell] = np.uint8(np.int64(occupancy[cell]) | bit)


@kernel
def has_room(grid, occupancy, cell, direction):
    """Whether a robot travelling in `direction` would find room in `cell` now."""
    return np.int64(occupancy[cell]) & room_bit(np.int64(grid.rule[cell]), np.int64(direction)) != 0


@kernel
def rank(priority, tick, identity):
    """Claimants of one cell in order: priority, then a bijective hash of (tick, identity)."""
    scrambled = mix((np.uint64(tick) << np.uint64(32)) | np.uint64(identity)) >> np.uint64(16)
    return ((np.int64(priority) + 32768) << 47) | np.int64(scrambled >> np.uint64(1))


@kernel
def direction_between(grid, cell, neighbour):
    for d in range(4):
        if cell + grid.offset[d] == neighbour:
            return d
    return 0


@kernel
def arrive(grid, rules, robots, traffic, i, releases):
    """End the long move of robot i; returns the number of releases put off to the tick's end."""
    left = np.int64(robots.cell[i])
    entered = np.int64(robots.claim[i])
    bit = room_bit(np.int64(grid.rule[left]), np.int64(robots.travel[i]))
    robots.cell[i] = entered
    robots.claim[i] = NIL
    robots.travel[i] = direction_between(grid, left, entered)
    traffic.want[i] = ARRIVED
    if rules.following:
        traffic.occupancy[left] = np.uint8(np.int64(traffic.occupancy[left]) | bit)
        return releases
    traffic.release[2 * releases] = left
    traffic.release[2 * releases + 1] = bit
    return releases + 1


@kernel
def advance(grid, rules, robots, traffic, i, releases):
    """Let robot i make its move; returns the number of releases put off to the tick's end."""
    want = np.int64(traffic.want[U(i)])
    direction = want & 3
    cell = np.int64(robots.cell[U(i)])
    target = cell + grid.offset[direction]
    bit = room_bit(np.int64(grid.rule[U(target)]), direction)
    byte = np.int64(traffic.occupancy[U(target)]) & ~(1 << direction)
    traffic.occupancy[U(target)] = np.uint8(byte if bit == ROOM_ENDLESS else byte & ~bit)
    traffic.want[U(i)] = np.uint8(want | MOVED)
    span = np.int64(traffic.span[U(i)])
    if span > 1:
        robots.claim[U(i)] = target
        robots.busy[U(i)] = span - 1
        return releases
    mine = room_bit(np.int64(grid.rule[U(cell)]), np.int64(robots.travel[U(i)]))
    robots.cell[U(i)] = target
    robots.travel[U(i)] = direction
    if rules.following and want & ENTERED == 0:
        traffic.occupancy[U(cell)] = np.uint8(np.int64(traffic.occupancy[U(cell)]) | mine)
        return releases
    traffic.release[2 * releases] = cell
    traffic.release[2 * releases + 1] = mine
    return releases + 1


@kernel
def move_all(grid, rules, robots, traffic, tick):
    """Execute the moves of one tick; counts busy robots down and ends long moves that are due.

    Reads traffic.want (LIVE | direction, or 0) and traffic.span of robots that are not busy;
    leaves MOVED, REFUSED or ARRIVED there. A want against the cell's exits becomes 0.
    """
    releases = claim_cells(grid, rules, robots, traffic)
    releases, pending, dirty = move_uncontested(grid, rules, robots, traffic, releases)
    if pending:
        releases = resolve(grid, rules, robots, traffic, tick, pending, releases)
    for k in range(dirty):
        cell = traffic.dirty[k]
        traffic.occupancy[cell] = np.uint8(np.int64(traffic.occupancy[cell]) & ~CLAIMS)
    for k in range(releases):
        cell = traffic.release[2 * k]
        byte = np.int64(traffic.occupancy[cell]) | traffic.release[2 * k + 1]
        traffic.occupancy[cell] = np.uint8(byte)


@kernel
def claim_cells(grid, rules, robots, traffic):
    """First pass: busy robots count down, the others write their claims; returns releases."""
    occupancy, want = traffic.occupancy, traffic.want
    releases = 0
    for i in range(robots.cell.shape[0]):
        busy = robots.busy[U(i)]
        if busy > 0:
            robots.busy[U(i)] = busy - np.uint16(1)
            if busy == 1 and robots.claim[U(i)] != NIL:
                releases = arrive(grid, rules, robots, traffic, i, releases)
        elif want[U(i)] & np.uint8(LIVE):
            direction = np.int64(want[U(i)]) & 3
            cell = np.int64(robots.cell[U(i)])
            if (np.int64(grid.rule[U(cell)]) >> direction) & 1:
                target = U(cell + grid.offset[U(direction)])
                byte = np.int64(occupancy[target])
                occupancy[target] = np.uint8(
                    byte | (1 << direction) | (((byte >> direction) & 1) << 4)
                )
            else:
                want[U(i)] = 0
    return releases


@kernel
def move_uncontested(grid, rules, robots, traffic, releases):
    """Second pass: refuse swaps, make sole claims with room; returns (releases, pending, dirty)."""
    occupancy, want = traffic.occupancy, traffic.want
    pending = 0
    dirty = 0
    for i in range(robots.cell.shape[0]):
        w = np.int64(want[U(i)])
        if w & LIVE == 0:
            continue
        direction = w & 3
        cell = np.int64(robots.cell[U(i)])
        target = cell + grid.offset[U(direction)]
        rule = np.int64(grid.rule[U(target)])
        if (np.int64(occupancy[U(cell)]) >> (direction ^ 2)) & 1 and (
            rule >> 5 == 1 or np.int64(grid.rule[U(cell)]) >> 5 == 1
        ):
            # Two robots may not swap over one edge: they would pass through each other.
            want[U(i)] = np.uint8(w | REFUSED)
            traffic.dirty[dirty] = target
            dirty += 1
            continue
        byte = np.int64(occupancy[U(target)])
        bit = room_bit(rule, direction)
        if byte & bit and (byte & CLAIMS == 1 << direction or bit == ROOM_ENDLESS):
            if byte & CLAIMS != 1 << direction:
                traffic.dirty[dirty] = target
                dirty += 1
            releases = advance(grid, rules, robots, traffic, i, releases)
        else:
            traffic.pending[pending] = i
            pending += 1
            traffic.dirty[dirty] = target
            dirty += 1
    return releases, pending, dirty


@kernel
def find(traffic, mask, resource):
    """The entry of a resource in the hash table, inserted if it is new."""
    entry = np.int64(mix(np.uint64(resource))) & mask
    while traffic.key[U(entry)] != resource:
        if traffic.key[U(entry)] == NIL:
            traffic.key[U(entry)] = resource
            traffic.winner[U(entry)] = NIL
            traffic.leaver[U(entry)] = NIL
            return entry
        entry = (entry + 1) & mask
    return entry


@kernel
def lane_of(grid, cell, direction):
    """The resource that a robot travelling in `direction` holds or needs in a limited cell."""
    lane = direction >> 1 if np.int64(grid.rule[U(cell)]) >> 5 == 2 else 0
    return 2 * cell + lane


@kernel
def resolve(grid, rules, robots, traffic, tick, pending, releases):
    """Decide the pending intents: the best claimant of each resource, queues, then rings."""
    size = 64
    while size < 4 * pending:
        size *= 2
    mask = size - 1
    for k in range(size):
        traffic.key[k] = NIL
    for k in range(pending):
        enter_contest(grid, rules, robots, traffic, tick, mask, np.int64(traffic.pending[k]))
    for k in range(pending):
        i = np.int64(traffic.pending[k])
        if np.int64(traffic.want[i]) & (MOVED | REFUSED):
            continue
        if traffic.winner[target_entry(grid, robots, traffic, mask, i)] != i:
            traffic.want[i] = np.uint8(np.int64(traffic.want[i]) | REFUSED)
            continue
        releases = move_queue(grid, rules, robots, traffic, mask, i, releases)
    for k in range(pending):
        i = np.int64(traffic.pending[k])
        if np.int64(traffic.want[i]) & (MOVED | REFUSED) == 0:
            rotate_ring(grid, robots, traffic, mask, i)
    return releases


@kernel
def target_entry(grid, robots, traffic, mask, i):
    direction = np.int64(traffic.want[U(i)]) & 3
    target = np.int64(robots.cell[U(i)]) + grid.offset[U(direction)]
    return find(traffic, mask, lane_of(grid, target, direction))


@kernel
def enter_contest(grid, rules, robots, traffic, tick, mask, i):
    """Enter robot i as claimant of its target and, if others may follow it, as leaver of its cell."""
    entry = target_entry(grid, robots, traffic, mask, i)
    best = np.int64(traffic.winner[U(entry)])
    if best == NIL or rank(robots.priority[i], tick, robots.identity[i]) > rank(
        robots.priority[best], tick, robots.identity[best]
    ):
        traffic.winner[U(entry)] = i
    cell = np.int64(robots.cell[i])
    if (
        rules.following
        and traffic.span[i] == 1
        and np.int64(traffic.want[i]) & ENTERED == 0
        and np.int64(grid.rule[cell]) >> 5 != 0
    ):
        held = lane_of(grid, cell, np.int64(robots.travel[i]))
        traffic.leaver[find(traffic, mask, held)] = i


@kernel
def move_queue(grid, rules, robots, traffic, mask, i, releases):
    """Move winner i if its target has room, then whoever won the cell that it leaves, and so on."""
    while True:
        want = np.int64(traffic.want[i])
        direction = want & 3
        cell = np.int64(robots.cell[i])
        target = cell + grid.offset[direction]
        bit = room_bit(np.int64(grid.rule[target]), direction)
        if np.int64(traffic.occupancy[target]) & bit == 0:
            return releases
        held = lane_of(grid, cell, np.int64(robots.travel[i]))
        releases = advance(grid, rules, robots, traffic, i, releases)
        entry = find(traffic, mask, held)
        if traffic.leaver[entry] != i or traffic.winner[entry] == NIL:
            return releases
        i = np.int64(traffic.winner[entry])


@kernel
def holder_ahead(grid, robots, traffic, mask, i):
    """The robot that wants to leave the resource which robot i wants to enter, or NIL."""
    return np.int64(traffic.leaver[target_entry(grid, robots, traffic, mask, i)])


@kernel
def rotate_ring(grid, robots, traffic, mask, i):
    """Follow the holders from winner i: a closed ring rotates, any other chain is refused.

    Members of a ring give room to each other, so the room of its cells stays as it is.
    """
    walker = i
    while True:
        traffic.want[walker] = np.uint8(np.int64(traffic.want[walker]) | ON_PATH)
        ahead = holder_ahead(grid, robots, traffic, mask, walker)
        if ahead == NIL or np.int64(traffic.want[ahead]) & (MOVED | REFUSED):
            break
        walker = ahead
        if np.int64(traffic.want[walker]) & ON_PATH:
            shift_ring(grid, robots, traffic, mask, walker)
            break
    walker = i
    while walker != NIL and np.int64(traffic.want[walker]) & (MOVED | REFUSED) == 0:
        traffic.want[walker] = np.uint8(np.int64(traffic.want[walker]) | REFUSED)
        walker = holder_ahead(grid, robots, traffic, mask, walker)


@kernel
def shift_ring(grid, robots, traffic, mask, start):
    walker = start
    while True:
        want = np.int64(traffic.want[walker])
        ahead = holder_ahead(grid, robots, traffic, mask, walker)
        robots.cell[walker] = np.int64(robots.cell[walker]) + grid.offset[want & 3]
        robots.travel[walker] = want & 3
        traffic.want[walker] = np.uint8(want | MOVED)
        walker = ahead
        if walker == start:
            break
