"""Motion: which intended moves happen in a tick, by the occupancy rules of the world.

The tick executes the largest set of intents in which every cell has room for its best-ranked
claimants, including room that members of the set release. Queues follow and rings rotate as a
result.

Each cell has one word, so one load reads everything. Bits 0-3: a robot claims the cell travelling
E, S, W, N. Bit 4: two robots claim it in one direction. Bits 5 and 6: it has room for travel E or
S, and for W or N (the two lanes of capacity 2). In a cell of capacity 1 both bits change together;
in a cell without limit both stay set. Bits 8-14 repeat grid.cell_flags. Bit 15: a pod stands there.
A *resource* is a cell of capacity 1 or one lane: it has one holder, so at most one claimant wins.

A move of d ticks that begins in tick T occupies its edge in the ticks T .. T+d-1. Two moves over
one edge in opposite directions conflict if they share a tick. Unless both cells let robots pass,
the later move is refused, or both if they begin in the same tick. If a cell has capacity 1, the
claim of a long move keeps other robots off in all of its ticks except the last, in which it
releases the cell that it leaves. In that tick its claim bit is set again in the cell that it
enters, so a robot that starts against it is refused as if both started at once.

Under the rule `convoy` a move of any length takes the room ahead and releases its own at once, like
moves of one tick under `handover`. So the room bits tell whether a cell is *open*, not whether it
is empty. `traffic.leaving` holds, by resource, the end and direction of the last move out of it. A
move takes its own ticks, or the remaining ticks of the move out of its target if these are more; in
a ring all moves take as long as the longest. Lengths are fixed from head to tail: a robot sets out
when the cell ahead is open, so the length of the move out of that cell is known.

Two passes over these words decide all intents except contested and queueing ones. They draw only
conclusions that cannot change, so the order of robots does not matter. `resolve` decides the rest.
"""

import numpy as np

from automaton.engine.jit.kernel import U, kernel, prefetch
from automaton.engine.random_numbers import splitmix64
from automaton.engine.state import FOLLOWING_CONVOY, FOLLOWING_NONE, GOAL_PICK, NIL

LIVE = 4  # bits of traffic.intent; bits 0-1 are the direction
ENTERED = 8  # it left its parking bay this tick: no robot may follow into its cell
NO_TURN = 8  # without LIVE: a turn that found the other lane held
MOVED = 16  # REFUSED, without LIVE: this robot may not drive under the pod
REFUSED = 32
POD_AHEAD = 32  # REFUSED, without LIVE: a robot that does not drive under this pod
AT_GATE = 40  # two bits, without LIVE: a gate blocks it
ARRIVED = 64  # a long move ended, or a robot stands at its goal already
HELD = 128  # right of way holds it back; bits 0-1 are its preferred direction, if TOWARDS is set
TOWARDS = 8

CLAIM_BITS = 31
FLAGS_SHIFT = 8  # shift of the rule in a word
CAPACITY_SHIFT = 13  # shift of the class of capacity in a word
POD = 1 << 15  # bit of a word: a pod stands here, under which not all robots drive (drives_under)
# Room taken by a robot, by class (unlimited, 1, 2) and lane.
ROOM_TAKEN_BITS = 0b10_01_11_11_00_00
ROBOTS_FETCHED_AHEAD = 16  # cells are prefetched for this many robots

INTENT_GOAL = 0  # columns of traffic.pending: the wanted resource, then its entry in the contest
INTENT_OWN = 1  # the held resource if a robot may follow, then its entry, or NIL
INTENT_ROBOT = 2
INTENT_STATE = 3  # 0 undecided, MOVED or REFUSED
INTENT_CELL = 4  # where it stands
INTENT_DIRECTION = 5
INTENT_FREED = 6  # room that it releases at once when it moves
INTENT_TICKS = 7  # under convoy: its own ticks, then the ticks that it takes


@kernel(inline=True)
def room_bit(direction):
    """The room that a robot travelling in `direction` needs."""
    return 32 << (direction >> 1)


@kernel(inline=True)
def taken_bits(word, direction):
    """The room that a robot travelling in `direction` takes from the cell of this word."""
    return ((ROOM_TAKEN_BITS >> (((word >> (CAPACITY_SHIFT - 2)) & 12) | (direction & 2))) & 3) << 5


@kernel
def occupy(occupancy, cell, direction):
    """Take the room of a robot that entered `cell` in `direction`."""
    word = np.int64(occupancy[U(cell)])
    occupancy[U(cell)] = np.uint16(word & ~taken_bits(word, np.int64(direction)))


@kernel
def vacate(occupancy, cell, direction):
    """Release the room of a robot that entered `cell` in `direction`."""
    word = np.int64(occupancy[U(cell)])
    occupancy[U(cell)] = np.uint16(word | taken_bits(word, np.int64(direction)))


@kernel
def put_pod_into(occupancy, cell):
    """A pod now stands in a cell."""
    occupancy[U(cell)] = np.uint16(np.int64(occupancy[U(cell)]) | POD)


@kernel
def take_pod_out(occupancy, cell):
    """A cell no longer has a pod."""
    occupancy[U(cell)] = np.uint16(np.int64(occupancy[U(cell)]) & ~POD)


@kernel
def has_room(occupancy, cell, direction):
    """Return whether a robot travelling in `direction` may now begin to move into `cell`."""
    return np.int64(occupancy[U(cell)]) & room_bit(np.int64(direction)) != 0


@kernel
def is_empty(traffic, cell, direction, tick):
    """Return whether a robot travelling in `direction` finds no robot in `cell` or on its way in.

    Under convoy a cell may be open although a robot is still leaving it.
    """
    if not has_room(traffic.occupancy, cell, direction):
        return False
    cells = traffic.occupancy.shape[0]
    word = np.int64(traffic.occupancy[U(cell)])
    resource = resource_of(word, cell, np.int64(direction), cells)
    if traffic.leaving.shape[0] == 0 or (word >> CAPACITY_SHIFT) & 3 == 0:
        return True
    return traffic.leaving[U(resource)] >> 2 < tick


@kernel(inline=True)
def fetch_ahead(grid, robots, traffic, i):
    """Prefetch the words for a robot stored a little later."""
    if i + ROBOTS_FETCHED_AHEAD < robots.cell.shape[0]:
        cell = np.int64(robots.cell[U(i + ROBOTS_FETCHED_AHEAD)])
        if cell >= 0:
            direction = np.int64(traffic.intent[U(i + ROBOTS_FETCHED_AHEAD)]) & 3
            prefetch(traffic.occupancy, U(cell))
            prefetch(traffic.occupancy, U(cell + grid.offset[U(direction)]))


@kernel(inline=True)
def fetch_leaving_ahead(grid, robots, traffic, i):
    """Prefetch when robots leave the cells around a robot stored a little later.

    With it a step in convoy takes 43 ns, without it 61 ns (`automaton bench --only step`).
    """
    if i + ROBOTS_FETCHED_AHEAD < robots.cell.shape[0]:
        cell = np.int64(robots.cell[U(i + ROBOTS_FETCHED_AHEAD)])
        if cell >= 0:
            direction = np.int64(traffic.intent[U(i + ROBOTS_FETCHED_AHEAD)]) & 3
            prefetch(traffic.leaving, U(cell))
            prefetch(traffic.leaving, U(cell + grid.offset[U(direction)]))


@kernel
def tie_break_hash(tick, identity):
    """A bijective hash of (tick, identity): it ranks claimants of equal priority, without ties."""
    return splitmix64((np.uint64(tick) << np.uint64(32)) | np.uint64(identity))


@kernel
def direction_between(grid, cell, neighbour):
    """Return the direction from a cell to its neighbour."""
    for d in range(4):
        if cell + grid.offset[d] == neighbour:
            return d
    return 0


@kernel
def vacate_later(traffic, cell, direction, at_once, releases):
    """Release a cell's room, at once or at the end of the tick; returns the number of postponed
    releases."""
    if at_once:
        vacate(traffic.occupancy, cell, direction)
        return releases
    traffic.vacated[2 * releases] = cell
    traffic.vacated[2 * releases + 1] = direction
    return releases + 1


@kernel
def end_moves(grid, rules, robots, traffic, arriving):
    """End the long moves that are due, and the turns between two lanes; returns (releases, dirty).

    The first `arriving` entries of traffic.dirty are these robots; cells take their place.
    """
    releases = 0
    dirty = 0
    for k in range(arriving):
        if k + ROBOTS_FETCHED_AHEAD < arriving:
            ahead = traffic.dirty[U(k + ROBOTS_FETCHED_AHEAD)]
            prefetch(traffic.occupancy, U(robots.cell[U(ahead)]))
            prefetch(traffic.occupancy, U(robots.claim[U(ahead)]))
        i = np.int64(traffic.dirty[U(k)])
        left = np.int64(robots.cell[U(i)])
        entered = np.int64(robots.claim[U(i)])
        direction = np.int64(robots.travel[U(i)])
        robots.claim[U(i)] = NIL
        traffic.intent[U(i)] = ARRIVED
        if entered == left:
            direction ^= 2  # it turned, and releases the other lane
        else:
            way = direction_between(grid, left, entered)
            robots.cell[U(i)] = entered
            robots.travel[U(i)] = way
            if rules.following == FOLLOWING_CONVOY:
                continue  # its room was released when the move began
            dirty = bar_way_back(traffic, left, entered, way, dirty)
        releases = vacate_later(
            traffic, left, direction, rules.following != FOLLOWING_NONE, releases
        )
    return releases, dirty


@kernel
def bar_way_back(traffic, left, entered, way, dirty):
    """Set the claim of a long move that ends in this tick, against robots that start the other way.

    Otherwise two robots could pass through each other when one releases a cell of capacity 1 and
    enters a cell that may hold robots. Returns the number of dirty cells.
    """
    single = (np.int64(traffic.occupancy[U(left)]) >> CAPACITY_SHIFT) & 3 == 1
    word = np.int64(traffic.occupancy[U(entered)])
    bars = np.int64(single & ((word >> CAPACITY_SHIFT) & 3 != 1))
    traffic.occupancy[U(entered)] = np.uint16(word | (bars << way))
    traffic.dirty[U(dirty)] = entered
    return dirty + bars


@kernel
def advance(grid, rules, robots, traffic, i, releases):
    """Let robot i make its move; returns the number of releases postponed to the tick's end."""
    direction = np.int64(traffic.intent[U(i)]) & 3
    cell = np.int64(robots.cell[U(i)])
    target = cell + grid.offset[U(direction)]
    word = np.int64(traffic.occupancy[U(target)]) & ~(1 << direction)
    traffic.occupancy[U(target)] = np.uint16(word & ~taken_bits(word, direction))
    at_once = rules.following != FOLLOWING_NONE and np.int64(traffic.intent[U(i)]) & ENTERED == 0
    if at_once and traffic.move_ticks[U(i)] == 1:
        vacate(traffic.occupancy, cell, np.int64(robots.travel[U(i)]))
    return finish_move(rules, robots, traffic, i, cell, target, releases)


@kernel
def finish_move(rules, robots, traffic, i, cell, target, releases):
    """Enter the move of robot i, whose room is already updated; returns the number of postponed
    releases."""
    intent = np.int64(traffic.intent[U(i)])
    direction = intent & 3
    traffic.intent[U(i)] = np.uint8(intent | MOVED)
    move_ticks = np.int64(traffic.move_ticks[U(i)])
    if move_ticks > 1:
        robots.claim[U(i)] = target
        robots.busy[U(i)] = move_ticks - 1
        return releases
    if not rules.following or intent & ENTERED:
        releases = vacate_later(traffic, cell, np.int64(robots.travel[U(i)]), 0, releases)
    robots.cell[U(i)] = target
    robots.travel[U(i)] = direction
    return releases


@kernel
def move_all(grid, rules, robots, traffic, tick):
    """Execute the moves of one tick; counts busy robots down and ends long moves that are due.

    Reads traffic.intent (LIVE | direction, or 0) and traffic.move_ticks of robots that are not
    busy; writes MOVED, REFUSED or ARRIVED there. An intent against the cell's exits becomes 0.
    """
    arriving = claim_cells(grid, rules, robots, traffic)
    releases, dirty = end_moves(grid, rules, robots, traffic, arriving)
    if rules.following == FOLLOWING_CONVOY:
        releases, pending, dirty = join_uncontested(grid, robots, traffic, tick, releases, dirty)
    else:
        releases, pending, dirty = move_uncontested(grid, rules, robots, traffic, releases, dirty)
    if pending:
        releases = resolve(grid, rules, robots, traffic, tick, pending, releases)
    for k in range(dirty):
        cell = U(traffic.dirty[U(k)])
        traffic.occupancy[cell] = np.uint16(np.int64(traffic.occupancy[cell]) & ~CLAIM_BITS)
    for k in range(releases):
        vacate(traffic.occupancy, traffic.vacated[2 * k], traffic.vacated[2 * k + 1])


@kernel
def claim_cells(grid, rules, robots, traffic):
    """First pass: busy robots count down, the others write their claims.

    Returns how many robots arrive, which are then listed in traffic.dirty.
    """
    occupancy, intent = traffic.occupancy, traffic.intent
    arriving = 0
    for i in range(robots.cell.shape[0]):
        fetch_ahead(grid, robots, traffic, i)
        busy = np.int64(robots.busy[U(i)])
        if busy > 0:
            robots.busy[U(i)] = np.uint16(busy - 1)
            if busy == 1 and robots.claim[U(i)] != NIL:
                traffic.dirty[U(arriving)] = i
                arriving += 1
        elif intent[U(i)] & np.uint8(LIVE):
            direction = np.int64(intent[U(i)]) & 3
            cell = np.int64(robots.cell[U(i)])
            if (np.int64(occupancy[U(cell)]) >> (FLAGS_SHIFT + direction)) & 1:
                target = U(cell + grid.offset[U(direction)])
                word = np.int64(occupancy[target])
                if word & POD and not drives_under(rules, robots, i, target):
                    intent[U(i)] = POD_AHEAD | direction
                    continue
                twice = ((word >> direction) & 1) << 4
                occupancy[target] = np.uint16(word | (1 << direction) | twice)
            else:
                intent[U(i)] = 0
    return arriving


@kernel
def drives_under(rules, robots, i, target):
    """Whether robot i may drive under the pod in a cell: without a load, or only to lift that pod."""
    if robots.load[U(i)] != NIL:
        return False
    lifts = robots.goal_type[U(i)] == GOAL_PICK and robots.goal_cell[U(i)] == target
    return rules.under != 0 or lifts


@kernel
def move_uncontested(grid, rules, robots, traffic, releases, dirty):
    """Second pass: refuse swaps, execute uncontested moves with room; returns (releases, pending,
    dirty)."""
    occupancy, intent = traffic.occupancy, traffic.intent
    cells = occupancy.shape[0]
    pending = 0
    for i in range(robots.cell.shape[0]):
        fetch_ahead(grid, robots, traffic, i)
        w = np.int64(intent[U(i)])
        if w & LIVE == 0:
            continue
        direction = w & 3
        cell = np.int64(robots.cell[U(i)])
        target = cell + grid.offset[U(direction)]
        here = np.int64(occupancy[U(cell)])
        there = np.int64(occupancy[U(target)])
        if (here >> (direction ^ 2)) & 1 and (
            (there >> CAPACITY_SHIFT) & 3 == 1 or (here >> CAPACITY_SHIFT) & 3 == 1
        ):
            # Two robots may not swap over one edge: they would pass through each other.
            intent[U(i)] = np.uint8(w | REFUSED)
        elif there & room_bit(direction) and there & CLAIM_BITS == 1 << direction:
            releases = advance(grid, rules, robots, traffic, i, releases)
            continue
        elif (there >> CAPACITY_SHIFT) & 3 == 0:
            releases = advance(grid, rules, robots, traffic, i, releases)
        else:
            followed = (
                here & CLAIM_BITS != 0 and (here >> CAPACITY_SHIFT) & 3 != 0 and w & ENTERED == 0
            )
            own = NIL
            if followed and rules.following and traffic.move_ticks[U(i)] == 1:
                own = resource_of(here, cell, np.int64(robots.travel[U(i)]), cells)
            row = traffic.pending[U(pending)]
            row[INTENT_GOAL] = resource_of(there, target, direction, cells)
            row[INTENT_OWN] = own
            row[INTENT_ROBOT] = i
            row[INTENT_STATE] = 0
            row[INTENT_CELL] = cell
            row[INTENT_DIRECTION] = direction
            at_once = rules.following and w & ENTERED == 0 and traffic.move_ticks[U(i)] == 1
            row[INTENT_FREED] = taken_bits(here, np.int64(robots.travel[U(i)])) if at_once else 0
            pending += 1
        traffic.dirty[U(dirty)] = target
        dirty += 1
    return releases, pending, dirty


@kernel
def join_uncontested(grid, robots, traffic, tick, releases, dirty):
    """The second pass under convoy; returns (releases, pending, dirty)."""
    occupancy, intent = traffic.occupancy, traffic.intent
    cells = occupancy.shape[0]
    pending = 0
    for i in range(robots.cell.shape[0]):
        fetch_ahead(grid, robots, traffic, i)
        fetch_leaving_ahead(grid, robots, traffic, i)
        w = np.int64(intent[U(i)])
        if w & LIVE == 0:
            continue
        direction = w & 3
        cell = np.int64(robots.cell[U(i)])
        target = cell + grid.offset[U(direction)]
        here = np.int64(occupancy[U(cell)])
        there = np.int64(occupancy[U(target)])
        travel = np.int64(robots.travel[U(i)])
        is_sole = there & CLAIM_BITS == 1 << direction and there & room_bit(direction) != 0
        if meets_on_edge(traffic, here, there, target, direction, tick):
            intent[U(i)] = np.uint8(w | REFUSED)
        elif is_sole or (there >> CAPACITY_SHIFT) & 3 == 0:
            goal = resource_of(there, target, direction, cells)
            ticks = ticks_behind(traffic, there, goal, tick, np.int64(traffic.move_ticks[U(i)]))
            there &= ~(1 << direction) if is_sole else -1
            occupancy[U(target)] = np.uint16(there & ~taken_bits(there, direction))
            releases = vacate_later(traffic, cell, travel, w & ENTERED == 0, releases)
            set_out(robots, traffic, tick, i, target, resource_of(here, cell, travel, cells), ticks)
            if is_sole:
                continue
        else:
            row = traffic.pending[U(pending)]
            followed = (
                here & CLAIM_BITS != 0 and (here >> CAPACITY_SHIFT) & 3 != 0 and w & ENTERED == 0
            )
            row[INTENT_GOAL] = resource_of(there, target, direction, cells)
            row[INTENT_OWN] = resource_of(here, cell, travel, cells) if followed else NIL
            row[INTENT_ROBOT] = i
            row[INTENT_STATE] = 0
            row[INTENT_CELL] = cell
            row[INTENT_DIRECTION] = direction
            row[INTENT_FREED] = taken_bits(here, travel) if w & ENTERED == 0 else 0
            row[INTENT_TICKS] = traffic.move_ticks[U(i)]
            pending += 1
        traffic.dirty[U(dirty)] = target
        dirty += 1
    return releases, pending, dirty


@kernel(inline=True)
def meets_on_edge(traffic, here, there, target, direction, tick):
    """Whether a robot would meet another on its edge, which starts now or is already on it.

    A robot already on the edge comes from a cell of capacity 1 into a cell that may hold robots. A
    move into a cell of capacity 1 follows a robot on its way out, which has no intent now.
    """
    starts = (here >> (direction ^ 2)) & 1 != 0
    single, single_here = (there >> CAPACITY_SHIFT) & 3 == 1, (here >> CAPACITY_SHIFT) & 3 == 1
    if starts and (single or single_here):
        return True
    if not single or single_here:
        return False
    last = traffic.leaving[U(target)]
    return last >> 2 >= tick and last & 3 == direction ^ 2


@kernel(inline=True)
def ticks_behind(traffic, there, goal, tick, ticks):
    """Ticks of a move into a resource: its own, or until the leaving robot has left."""
    if (there >> CAPACITY_SHIFT) & 3 == 0:
        return ticks
    return max(ticks, (traffic.leaving[U(goal)] >> 2) - tick + 1)


@kernel
def set_out(robots, traffic, tick, i, target, own, ticks):
    """Robot i begins its move under convoy, out of the resource `own`; room is already updated."""
    intent = np.int64(traffic.intent[U(i)])
    direction = intent & 3
    traffic.intent[U(i)] = np.uint8(intent | MOVED)
    traffic.own_ticks[U(i)] = traffic.move_ticks[U(i)]
    traffic.move_ticks[U(i)] = ticks
    traffic.leaving[U(own)] = ((tick + ticks - 1) << 2) | direction
    if ticks > 1:
        robots.claim[U(i)] = target
        robots.busy[U(i)] = ticks - 1
    else:
        robots.cell[U(i)] = target
        robots.travel[U(i)] = direction


@kernel
def find(traffic, mask, resource):
    """The entry of a resource in the hash table, inserted if it is new."""
    key = traffic.key
    entry = np.int64((np.uint64(resource) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32)) & mask
    while key[U(entry)] != resource:
        if key[U(entry)] == NIL:
            key[U(entry)] = resource
            return entry
        entry = (entry + 1) & mask
    return entry


@kernel(inline=True)
def resource_of(word, cell, direction, cells):
    """The resource that a robot travelling in `direction` holds or needs in a limited cell."""
    return cell + (cells if (word >> 13) & 3 == 2 and direction >> 1 else 0)


@kernel
def resolve(grid, rules, robots, traffic, tick, pending, releases):
    """Decide the pending intents: the best claimant of each resource, queues, then rings.

    On a crowded floor the contest has an entry for every resource; otherwise it uses a hash table,
    which stays small if few robots meet on many cells.
    """
    contest, intents = traffic.contest, traffic.pending
    drawn_in = (tick - 1) // rules.refinement + 1  # the coarse tick breaks ties
    if traffic.key.shape[0] > 0:
        enter_entries(traffic, pending)
    for k in range(pending):
        if k + ROBOTS_FETCHED_AHEAD < pending:
            prefetch(contest, U(intents[U(k + ROBOTS_FETCHED_AHEAD), U(INTENT_GOAL)]))
        goal = U(intents[U(k), U(INTENT_GOAL)])
        best = np.int64(contest[goal])
        i = np.int64(intents[U(k), U(INTENT_ROBOT)])
        if best == NIL or is_before(
            robots, drawn_in, i, np.int64(intents[U(best), U(INTENT_ROBOT)])
        ):
            contest[goal] = k
    for k in range(pending):
        if contest[U(intents[U(k), U(INTENT_GOAL)])] != k:
            intents[U(k), U(INTENT_STATE)] = REFUSED
        elif intents[U(k), U(INTENT_STATE)] == 0:
            move_queue(grid, rules, robots, traffic, tick, k)
    for k in range(pending):
        if intents[U(k), U(INTENT_STATE)] == 0:
            rotate_ring(traffic, k)
    for k in range(pending):
        contest[U(intents[U(k), U(INTENT_GOAL)])] = NIL
        i = np.int64(intents[U(k), U(INTENT_ROBOT)])
        if intents[U(k), U(INTENT_STATE)] == MOVED:
            cell = np.int64(intents[U(k), U(INTENT_CELL)])
            target = cell + grid.offset[U(intents[U(k), U(INTENT_DIRECTION)])]
            if rules.following == FOLLOWING_CONVOY:
                if np.int64(traffic.intent[U(i)]) & ENTERED:
                    travel = np.int64(robots.travel[U(i)])
                    releases = vacate_later(traffic, cell, travel, 0, releases)
                ticks = np.int64(intents[U(k), U(INTENT_TICKS)])
                set_out(robots, traffic, tick, i, target, own_resource(robots, traffic, i), ticks)
            else:
                releases = finish_move(rules, robots, traffic, i, cell, target, releases)
        else:
            traffic.intent[U(i)] = np.uint8(np.int64(traffic.intent[U(i)]) | REFUSED)
    return releases


@kernel
def enter_entries(traffic, pending):
    """Replace resources by their entries in the hash table."""
    size = 64
    while size < 3 * pending:
        size *= 2
    for entry in range(size):
        traffic.key[U(entry)] = NIL
    for k in range(pending):
        goal = np.int64(traffic.pending[U(k), U(INTENT_GOAL)])
        traffic.pending[U(k), U(INTENT_GOAL)] = find(traffic, size - 1, goal)
        own = np.int64(traffic.pending[U(k), U(INTENT_OWN)])
        if own != NIL:
            traffic.pending[U(k), U(INTENT_OWN)] = find(traffic, size - 1, own)


@kernel
def is_before(robots, tick, i, j):
    """Whether robot i goes before robot j into a cell that both claim."""
    if robots.priority[U(i)] != robots.priority[U(j)]:
        return robots.priority[U(i)] > robots.priority[U(j)]
    return tie_break_hash(tick, robots.identity[U(i)]) > tie_break_hash(tick, robots.identity[U(j)])


@kernel
def own_resource(robots, traffic, i):
    """The resource that robot i holds in its cell: the cell, or a lane of it."""
    cell = np.int64(robots.cell[U(i)])
    word = np.int64(traffic.occupancy[U(cell)])
    return resource_of(word, cell, np.int64(robots.travel[U(i)]), traffic.occupancy.shape[0])


@kernel
def move_queue(grid, rules, robots, traffic, tick, k):
    """Move winner k if its target has room, then the winner of the cell that it leaves, and so on.

    This writes only room and outcome, from one row per intent; the robots, scattered in memory,
    follow later in storage order (33 % faster on a half-full floor).
    """
    while k != NIL:
        row = traffic.pending[U(k)]
        cell, direction = np.int64(row[INTENT_CELL]), np.int64(row[INTENT_DIRECTION])
        target = U(cell + grid.offset[U(direction)])
        word = np.int64(traffic.occupancy[target])
        if word & room_bit(direction) == 0:
            return
        traffic.occupancy[target] = np.uint16(word & ~taken_bits(word, direction))
        row[INTENT_STATE] = MOVED
        if rules.following == FOLLOWING_CONVOY:
            settle_ticks(robots, traffic, tick, word, np.int64(target), row)
        if row[INTENT_FREED]:
            left = np.int64(traffic.occupancy[U(cell)]) | np.int64(row[INTENT_FREED])
            traffic.occupancy[U(cell)] = np.uint16(left)
        k = behind(traffic, k)


@kernel
def settle_ticks(robots, traffic, tick, there, target, row):
    """Fix the ticks of an intent's move, and so the least ticks of the move behind it."""
    direction = np.int64(row[INTENT_DIRECTION])
    goal = resource_of(there, target, direction, traffic.occupancy.shape[0])
    ticks = ticks_behind(traffic, there, goal, tick, np.int64(row[INTENT_TICKS]))
    row[INTENT_TICKS] = ticks
    own = own_resource(robots, traffic, np.int64(row[INTENT_ROBOT]))
    traffic.leaving[U(own)] = ((tick + ticks - 1) << 2) | direction


@kernel
def behind(traffic, k):
    """The intent that won the resource that intent k would release, or NIL."""
    own = np.int64(traffic.pending[U(k), U(INTENT_OWN)])
    return NIL if own == NIL else np.int64(traffic.contest[U(own)])


@kernel
def rotate_ring(traffic, k):
    """Follow the winners behind winner k: a ring closes on k and rotates, any other queue is refused.

    A resource has one winner, which claims one resource, so queues and rings never branch. Members
    of a ring pass room to each other, so the room of its cells does not change. Under convoy all
    take as long as the longest; under `handover` only moves of one tick form rings.
    """
    intents = traffic.pending
    ticks = np.int64(intents[U(k), U(INTENT_TICKS)])
    walker = behind(traffic, k)
    while walker != k and walker != NIL and intents[U(walker), U(INTENT_STATE)] != REFUSED:
        ticks = max(ticks, np.int64(intents[U(walker), U(INTENT_TICKS)]))
        walker = behind(traffic, walker)
    outcome = MOVED if walker == k else REFUSED
    walker = k
    while walker != NIL and intents[U(walker), U(INTENT_STATE)] == 0:
        intents[U(walker), U(INTENT_STATE)] = outcome
        intents[U(walker), U(INTENT_TICKS)] = ticks
        walker = behind(traffic, walker)
