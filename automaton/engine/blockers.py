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
    MOVED,
    REFUSED,
    direction_between,
    own_resource,
    resource_of,
)
from automaton.engine.observation import (
    CAUSE_BAY_HELD,
    CAUSE_CHARGER_QUEUE,
    CAUSE_DRIVING_AHEAD,
    CAUSE_FOLLOWING_CONFLICT,
    CAUSE_HEAD_ON,
    CAUSE_HELD_BACK,
    CAUSE_IDLE_AHEAD,
    CAUSE_LANE,
    CAUSE_NO_ORDER,
    CAUSE_NOT_WAITING,
    CAUSE_POD_AHEAD,
    CAUSE_QUEUE,
    CAUSE_RANDOM_WAIT,
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
from automaton.engine.random_numbers import is_begin
from automaton.engine.state import ACTION_MOVE, FOLLOWING_CONVOY, GOAL_NONE, NIL

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
            return CAUSE_HELD_BACK
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
