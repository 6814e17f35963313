"""Who blocks each waiting robot, and the cause: passes over the robots that `observe` listed.

They find the holder of each wanted cell, refused swaps, and the cause, which depends on what the
blocker does; they count lost ticks by cause and by cell.
"""

import numpy as np

from automaton.engine.gates import has_gates
from automaton.engine.jit.kernel import U, kernel, prefetch
from automaton.engine.motion import (
    CAPACITY_SHIFT,
    HELD,
    LIVE,
    MOVED,
    NO_TURN,
    REFUSED,
    TOWARDS,
    direction_between,
    has_room,
    own_resource,
    resource_of,
)
from automaton.engine.observation import (
    CAUSE_BAY_HELD,
    CAUSE_CHARGER_QUEUE,
    CAUSE_CLOSED,
    CAUSE_DELAYED,
    CAUSE_DRIVING_AHEAD,
    CAUSE_FAULT,
    CAUSE_FOLLOWING_CONFLICT,
    CAUSE_HEAD_ON,
    CAUSE_HELD_BACK,
    CAUSE_IDLE_AHEAD,
    CAUSE_ILLEGAL_DECISION,
    CAUSE_LANE,
    CAUSE_NO_DROP_OFF_SLOT,
    CAUSE_NO_ENERGY,
    CAUSE_NO_ORDER,
    CAUSE_NO_ROUTE,
    CAUSE_NOT_WAITING,
    CAUSE_POD_AHEAD,
    CAUSE_QUEUE,
    CAUSE_RANDOM_WAIT,
    CAUSE_REDESIGN,
    CAUSE_RETREAT,
    CAUSE_STANDING,
    CAUSE_STATION_BREAK,
    CAUSE_STATION_QUEUE,
    CAUSE_UNDECIDED,
    CAUSE_VERTEX_CONFLICT,
    CAUSE_WORKING_AHEAD,
    COUNTED_AT,
    DELAY_COLUMNS,
    LOST_EVER,
    LOST_LATELY,
    MEMORY_TICKS,
)
from automaton.engine.operations import is_facing, is_held_up
from automaton.engine.random_numbers import is_begin
from automaton.engine.record_codes import (
    EXECUTED_BAY_BLOCKED,
    EXECUTED_BLOCKED,
    EXECUTED_ILLEGAL,
    EXECUTED_RETREAT,
    EXECUTED_WAIT,
    LEFT_PARKING_BAY,
)
from automaton.engine.state import (
    ACTION_MOVE,
    ACTION_QUEUE,
    ACTION_STATION_QUEUE,
    ACTION_WAIT,
    FOLLOWING_CONVOY,
    GOAL_NONE,
    GOAL_STOP,
    MAY_TURN,
    NIL,
    STATUS_DEPLETED,
    STATUS_EXHAUSTED,
)
from automaton.engine.trips import has_break, has_trips

REQUESTED = -2  # value of scratch.holder: a robot waits for it


@kernel
def find_blockers(world, observation):
    """Find the blockers of the waiting robots, and then the causes."""
    scratch = observation.scratch
    waiters = scratch.count.waiters
    if world.rules.following == FOLLOWING_CONVOY:
        find_robots_ahead(world, observation)
    sought = 0
    for k in range(waiters):
        sought += seek(world, observation, np.int64(scratch.waiters[U(k)]))
    if sought:
        place_holders(world, observation)
    for k in range(waiters):
        enter_blocker(world, observation, np.int64(scratch.waiters[U(k)]))
    for k in range(waiters):
        i = np.int64(scratch.waiters[U(k)])
        find_refused_swap(world, observation, i)
        forget(observation, i)
    for k in range(waiters):
        i = np.int64(scratch.waiters[U(k)])
        if observation.cause[U(i)] == CAUSE_UNDECIDED:
            observation.cause[U(i)] = cause_of_wait(world, observation, i)
        count_wait(world, observation, i)


@kernel
def find_robots_ahead(world, observation):
    """For robots that follow into a cell, enter the robot that is still leaving it."""
    robots, scratch = world.robots, observation.scratch
    follow = 0
    for k in range(scratch.count.waiters):
        i = np.int64(scratch.waiters[U(k)])
        if follows(observation, i):
            scratch.holder[U(resource_ahead(world, i))] = REQUESTED
            follow += 1
    if follow == 0:
        return
    for i in range(robots.cell.shape[0]):
        if robots.claim[U(i)] != NIL and robots.claim[U(i)] != robots.cell[U(i)]:
            own = own_resource(robots, world.traffic, i)
            if scratch.holder[U(own)] == REQUESTED:
                scratch.holder[U(own)] = i
    for k in range(scratch.count.waiters):
        i = np.int64(scratch.waiters[U(k)])
        if follows(observation, i):
            ahead = U(resource_ahead(world, i))
            if scratch.holder[ahead] >= 0:
                observation.blocker[U(i)] = robots.identity[U(scratch.holder[ahead])]
            scratch.holder[ahead] = NIL


@kernel
def follows(observation, i):
    """Whether robot i is listed because it drives behind another robot."""
    return observation.cause[U(i)] == CAUSE_DRIVING_AHEAD and observation.scratch.entry[U(i)] == NIL


@kernel
def resource_ahead(world, i):
    """The resource that robot i takes in the cell that it enters."""
    claim, cells = np.int64(world.robots.claim[U(i)]), world.grid.cell_flags.shape[0]
    way = direction_between(world.grid, np.int64(world.robots.cell[U(i)]), claim)
    return resource_of(np.int64(world.traffic.occupancy[U(claim)]), claim, way, cells)


@kernel
def seek(world, observation, i):
    """Request the holder of what robot i waits for; returns 1 if it waits for a cell or a lane."""
    scratch = observation.scratch
    cell = np.int64(world.robots.cell[U(i)])
    if cell >= 0:
        prefetch(observation.lost_ticks_by_cell, U(DELAY_COLUMNS * cell))
    entry = np.int64(scratch.entry[U(i)])
    if entry == NIL:
        return 0
    scratch.holder[U(entry)] = REQUESTED
    place = np.int64(observation.wanted[U(i)]) & (scratch.sieve.shape[0] - 1)
    scratch.sieve[U(place)] = 1
    return 1


@kernel
def place_holders(world, observation):
    """Enter the holder of each requested resource, after the motion of this tick.

    The sieve fits in a fast cache and spares most robots a look-up in `holder`.
    """
    robots, sieve = world.robots, observation.scratch.sieve
    mask = sieve.shape[0] - 1
    if world.rules.following == FOLLOWING_CONVOY:
        place_entrants(world, observation, mask)
    for i in range(robots.cell.shape[0]):
        cell = np.int64(robots.cell[U(i)])
        if cell == NIL:
            continue
        claim = np.int64(robots.claim[U(i)])
        if sieve[U(cell & mask)]:
            travel = np.int64(robots.travel[U(i)])
            hold(world, observation, cell, travel, i)
            if claim == cell:
                hold(world, observation, cell, travel ^ 2, i)
        if claim != NIL and claim != cell and sieve[U(claim & mask)]:
            hold(world, observation, claim, direction_between(world.grid, cell, claim), i)


@kernel
def place_entrants(world, observation, mask):
    """Enter robots that come into a cell; they go before robots that are still leaving it."""
    robots, sieve = world.robots, observation.scratch.sieve
    for i in range(robots.cell.shape[0]):
        cell, claim = np.int64(robots.cell[U(i)]), np.int64(robots.claim[U(i)])
        if claim != NIL and claim != cell and sieve[U(claim & mask)]:
            hold(world, observation, claim, direction_between(world.grid, cell, claim), i)


@kernel
def hold(world, observation, cell, direction, i):
    """Robot i holds its lane of a limited cell: enter it if a robot requested it."""
    word = np.int64(world.traffic.occupancy[U(cell)])
    entry = resource_of(word, cell, direction, world.grid.cell_flags.shape[0])
    if (word >> CAPACITY_SHIFT) & 3 and observation.scratch.holder[U(entry)] == REQUESTED:
        observation.scratch.holder[U(entry)] = i


@kernel
def enter_blocker(world, observation, i):
    """The holder of what robot i waits for blocks it; without a holder the cause changes."""
    entry = np.int64(observation.scratch.entry[U(i)])
    if entry == NIL:
        return
    holder = np.int64(observation.scratch.holder[U(entry)])
    if holder >= 0:
        observation.blocker[U(i)] = world.robots.identity[U(holder)]
    elif (
        observation.cause[U(i)] == CAUSE_BAY_HELD
        or observation.cause[U(i)] == CAUSE_CHARGER_QUEUE
        or observation.cause[U(i)] == CAUSE_STATION_QUEUE
    ):
        observation.cause[U(i)] = CAUSE_FOLLOWING_CONFLICT
    elif observation.cause[U(i)] == CAUSE_LANE:
        observation.cause[U(i)] = CAUSE_RANDOM_WAIT


@kernel
def forget(observation, i):
    """Delete the request of robot i."""
    scratch = observation.scratch
    entry = np.int64(scratch.entry[U(i)])
    if entry != NIL:
        scratch.holder[U(entry)] = NIL
        place = np.int64(observation.wanted[U(i)]) & (scratch.sieve.shape[0] - 1)
        scratch.sieve[U(place)] = 0


@kernel
def find_refused_swap(world, observation, i):
    """Robot i was refused a cell whose holder wanted to enter i's cell: the holder waits for i too.

    Where robot i's cell has room for several robots, only the swap rule refused the holder.
    """
    robots = world.robots
    if observation.blocker[U(i)] == NIL or np.int64(world.traffic.intent[U(i)]) & REFUSED == 0:
        return
    q = np.int64(robots.at_index[U(observation.blocker[U(i)])])
    if np.int64(world.traffic.intent[U(q)]) & REFUSED == 0 or observation.blocker[U(q)] != NIL:
        return
    if observation.cause[U(q)] == CAUSE_POD_AHEAD:
        return  # a pod blocks it, no robot
    if has_gates(world) and world.gates.held[U(q)] != NIL:
        return  # a gate blocks it
    if (
        observation.wanted[U(q)] == robots.cell[U(i)]
        and observation.wanted[U(i)] == robots.cell[U(q)]
    ):
        observation.blocker[U(q)] = robots.identity[U(i)]


@kernel
def cause_of_wait(world, observation, i):
    """Why robot i waits for its wanted cell; depends on what the holder does."""
    robots = world.robots
    if observation.blocker[U(i)] == NIL:
        intent = np.int64(world.traffic.intent[U(i)])
        if intent & HELD:
            return CAUSE_HELD_BACK if world.rules.steered[0] else CAUSE_STANDING
        return CAUSE_FOLLOWING_CONFLICT if intent & REFUSED else CAUSE_RANDOM_WAIT
    q = np.int64(robots.at_index[U(observation.blocker[U(i)])])
    wanted = observation.wanted[U(i)]
    moved = np.int64(world.traffic.intent[U(q)]) & MOVED
    entered = robots.cell[U(q)] if robots.claim[U(q)] == NIL else robots.claim[U(q)]
    if moved and entered == wanted and np.int64(world.traffic.intent[U(i)]) & REFUSED:
        return CAUSE_VERTEX_CONFLICT
    if observation.wanted[U(q)] == robots.cell[U(i)] and observation.cause[U(q)] != CAUSE_BAY_HELD:
        return CAUSE_HEAD_ON
    if observation.cause[U(q)] == CAUSE_NO_ORDER or (
        robots.parked[U(q)] and robots.goal_type[U(q)] == GOAL_NONE
    ):
        return CAUSE_IDLE_AHEAD
    if observation.cause[U(q)] != CAUSE_NOT_WAITING:
        return CAUSE_QUEUE
    return (
        CAUSE_DRIVING_AHEAD if moved or robots.action[U(q)] == ACTION_MOVE else CAUSE_WORKING_AHEAD
    )


@kernel
def count_wait(world, observation, i):
    """Count a lost tick of robot i by cause and by cell; a free robot loses a whole stride."""
    ticks = world.rules.stride if is_begin(world) and world.robots.busy[U(i)] == 0 else 1
    observation.lost[U(i), U(observation.cause[U(i)])] += ticks
    cell = np.int64(world.robots.cell[U(i)])
    if cell != NIL:
        lost_ticks_by_cell, tick = observation.lost_ticks_by_cell[U(cell)], world.clock.tick
        lost_ticks_by_cell[LOST_EVER] += ticks
        halvings = min((tick - np.int64(lost_ticks_by_cell[COUNTED_AT])) // MEMORY_TICKS, 31)
        if halvings > 0:
            lost_ticks_by_cell[COUNTED_AT] = tick
        lost_ticks_by_cell[LOST_LATELY] = (
            np.int64(lost_ticks_by_cell[LOST_LATELY]) >> halvings
        ) + ticks


# Find wait cycles: each robot waits for the next one, and the last for the first.
#
# Each robot has at most one blocker, so every walk along blockers ends or reaches one cycle.


@kernel
def walk_to_cycle(blocker, at_index, color, start):
    """Walk along blockers from robot `start`; returns a robot of the cycle closed by this walk, or
    NIL.

    blocker: (n,) identity of the robot that each robot waits for, or NIL. at_index: (n,) storage
    index of each identity. color: (n,) 0 = not visited yet; modified: start + 1 on this walk.
    """
    i = start
    while blocker[U(i)] != NIL and color[U(i)] == 0:
        color[U(i)] = start + 1
        i = np.int64(at_index[U(blocker[U(i)])])
    if blocker[U(i)] != NIL and color[U(i)] == start + 1:
        return i
    return np.int64(NIL)


# Why one robot waits, and for which cell: its cause, until its blocker decides it.


@kernel
def wait_for(world, observation, i, cell, direction, cause):
    """Robot i waits for a cell; CAUSE_UNDECIDED is replaced once all robots have been scanned."""
    word = np.int64(world.traffic.occupancy[U(cell)])
    entry = resource_of(word, cell, direction, world.grid.cell_flags.shape[0])
    prefetch(observation.scratch.holder, U(entry))
    observation.scratch.entry[U(i)] = entry
    observation.wanted[U(i)] = cell
    return cause


@kernel
def find_wait(world, observation, i, want, did):
    """Why robot i did not move; enters the cell that it waits for."""
    robots = world.robots
    is_down = robots.status[U(i)] >= STATUS_EXHAUSTED
    if is_down:
        note_down(observation, i)
    observation.blocker[U(i)] = NIL
    observation.wanted[U(i)] = NIL
    observation.scratch.entry[U(i)] = NIL
    if is_down:
        return CAUSE_NO_ENERGY if robots.status[U(i)] <= STATUS_DEPLETED else CAUSE_FAULT
    if is_held_up(world, i):
        return CAUSE_DELAYED
    if (
        world.clock.halted_until >= world.clock.tick
        and world.service_zones.halt[U(i)] >= world.clock.tick
    ):
        if robots.action[U(i)] == ACTION_WAIT and robots.parked[U(i)] == 0:
            return CAUSE_REDESIGN
    if robots.action[U(i)] == ACTION_QUEUE and robots.ticket[U(i)] and did == EXECUTED_BLOCKED:
        charger = np.int64(robots.goal_cell[U(i)])
        direction = direction_between(world.grid, np.int64(robots.cell[U(i)]), charger)
        return wait_for(world, observation, i, charger, direction, CAUSE_CHARGER_QUEUE)
    if has_gates(world) and world.gates.held[U(i)] != NIL and did:
        return note_gate(world, observation, i, want)
    if want & HELD:
        return note_held_back(world, observation, i, want)
    if want & REFUSED and did == EXECUTED_BLOCKED and has_trips(world):
        direction = want & 3
        cell = np.int64(robots.cell[U(i)]) + world.grid.offset[U(direction)]
        if want & LIVE == 0:
            observation.wanted[U(i)] = cell
            return CAUSE_POD_AHEAD
        if robots.action[U(i)] == ACTION_STATION_QUEUE:
            return wait_for(world, observation, i, cell, direction, CAUSE_STATION_QUEUE)
    if did == EXECUTED_RETREAT:
        return CAUSE_RETREAT
    if did == EXECUTED_ILLEGAL:
        return CAUSE_ILLEGAL_DECISION
    if did == EXECUTED_BAY_BLOCKED:
        home = np.int64(robots.home[U(i)])
        return wait_for(world, observation, i, home, np.int64(robots.heading[U(i)]), CAUSE_BAY_HELD)
    if want == NO_TURN:
        return wait_to_turn(world, observation, i)
    if want & LIVE and want & REFUSED:
        direction = want & 3
        cell = np.int64(robots.cell[U(i)]) + world.grid.offset[U(direction)]
        return wait_for(world, observation, i, cell, direction, CAUSE_UNDECIDED)
    if did == EXECUTED_WAIT or did == EXECUTED_BLOCKED:
        return find_next_cell(world, observation, i)
    if observation.busy_before[U(i)] > 0:
        return (
            find_next_cell(world, observation, i)
            if robots.action[U(i)] == ACTION_WAIT
            else CAUSE_NOT_WAITING
        )
    if did == 0 and robots.parked[U(i)] == 0:
        return find_idleness(world, observation, i)
    return CAUSE_NOT_WAITING


@kernel
def note_down(observation, i):
    """Robot i is down: keep what it waited for when it went down."""
    cause = observation.cause[U(i)]
    if cause != CAUSE_NO_ENERGY and cause != CAUSE_FAULT:
        observation.blocker_before[U(i)] = observation.blocker[U(i)]
        observation.wanted_before[U(i)] = observation.wanted[U(i)]


@kernel
def note_gate(world, observation, i, want):
    """A gate blocks robot i, on the floor or in its parking bay."""
    cell = np.int64(world.robots.cell[U(i)])
    to = cell + world.grid.offset[U(want & 3)]
    observation.wanted[U(i)] = world.robots.home[U(i)] if cell == NIL else to
    return CAUSE_CLOSED + np.int64(world.gates.kind[world.gates.held[U(i)]])


@kernel
def note_held_back(world, observation, i, want):
    """Right of way holds robot i back; find the holder of its preferred cell, if any."""
    if want & TOWARDS == 0:
        return CAUSE_HELD_BACK
    direction = want & 3
    cell = np.int64(world.robots.cell[U(i)]) + world.grid.offset[U(direction)]
    return wait_for(world, observation, i, cell, direction, CAUSE_UNDECIDED)


@kernel
def find_next_cell(world, observation, i):
    """Robot i waits before the next cell of its route, or before the turn towards it."""
    robots, grid = world.robots, world.grid
    cell = np.int64(robots.cell[U(i)])
    if robots.route_index[U(i)] >= robots.route_length[U(i)]:
        return find_held_way_out(world, observation, i)
    direction = np.int64(robots.route[U(i), U(robots.route_index[U(i)])])
    if not is_facing(world, i, direction):
        return wait_to_turn(world, observation, i)
    return wait_for(
        world, observation, i, cell + grid.offset[U(direction)], direction, CAUSE_UNDECIDED
    )


@kernel
def find_held_way_out(world, observation, i):
    """Robot i waits without a route after a failed retreat: find the cell for which it waits.

    Among adjacent cells without room, it is the one nearest to its goal; ties: lowest direction.
    """
    robots, grid = world.robots, world.grid
    cell = np.int64(robots.cell[U(i)])
    flags = np.int64(grid.type_cell_flags[U(robots.type[U(i)]), U(cell)])
    goal = np.int64(robots.goal_cell[U(i)])
    if goal == NIL:
        goal = np.int64(robots.home[U(i)])
    best, least = np.int64(NIL), np.int64(0)
    for direction in range(4):
        may_go = flags & MAY_TURN != 0 or is_facing(world, i, direction)
        if (flags >> direction) & 1 == 0 or not may_go:
            continue
        to = cell + grid.offset[U(direction)]
        if has_room(world.traffic.occupancy, to, direction):
            continue
        columns = to % grid.width - goal % grid.width
        rows = to // grid.width - goal // grid.width
        if best == NIL or abs(columns) + abs(rows) < least:
            best, least = np.int64(direction), abs(columns) + abs(rows)
    if best == NIL:
        return CAUSE_RANDOM_WAIT
    return wait_for(world, observation, i, cell + grid.offset[U(best)], best, CAUSE_UNDECIDED)


@kernel
def wait_to_turn(world, observation, i):
    """Robot i is about to turn: another robot can block it only in a passing aisle."""
    cell = np.int64(world.robots.cell[U(i)])
    observation.wanted[U(i)] = cell
    if (np.int64(world.traffic.occupancy[U(cell)]) >> CAPACITY_SHIFT) & 3 == 2:
        return wait_for(
            world, observation, i, cell, np.int64(world.robots.travel[U(i)]) ^ 2, CAUSE_LANE
        )
    return CAUSE_RANDOM_WAIT


@kernel
def find_idleness(world, observation, i):
    """Why robot i, free and on the floor, did nothing."""
    robots = world.robots
    if robots.goal_type[U(i)] == GOAL_NONE:
        return CAUSE_NO_ORDER if robots.load[U(i)] == NIL else CAUSE_NO_DROP_OFF_SLOT
    if (
        robots.route_index[U(i)] >= robots.route_length[U(i)]
        and robots.goal_cell[U(i)] != robots.cell[U(i)]
    ):
        if world.rules.steered[0] and np.int64(robots.executed[U(i)]) & LEFT_PARKING_BAY:
            return CAUSE_NOT_WAITING
        observation.wanted[U(i)] = robots.goal_cell[U(i)]
        return CAUSE_HELD_BACK if world.rules.steered[0] else CAUSE_NO_ROUTE
    if robots.goal_type[U(i)] == GOAL_STOP and robots.busy[U(i)] == 0 and has_trips(world):
        if has_break(world, np.int64(robots.order[U(i)])):
            return CAUSE_STATION_BREAK
    return CAUSE_NOT_WAITING
