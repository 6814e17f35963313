"""What each free robot tries in a tick, and what becomes of it: the two sides of motion.

`leave_bays` and `drive` turn goals and routes into intents and begin operations; `settle` reads the
outcome of the moves and runs the waits and retries that right of way has set.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import HANDLING, WAITS, draw_between
from automaton.kernels.energy import affords, charge_up
from automaton.kernels.motion import (
    ARRIVED,
    ENTERED,
    LIVE,
    MOVED,
    NO_TURN,
    U,
    has_room,
    occupy,
    vacate,
)
from automaton.kernels.operations import (
    begin,
    drop_route,
    entry_heading,
    lose_tick,
    need_allocation,
    need_route,
    need_way,
    no_route_needed,
    no_way_needed,
    note,
    pay,
    pick_up,
    price,
    set_down,
)
from automaton.recording.codes import (
    DID_BAY_BLOCKED,
    DID_BLOCKED,
    DID_DROP,
    DID_PICK,
    DID_TRY_DROP,
    DID_WAIT,
    DROPPED_AT_ONCE,
    DURATION,
    INTO_BAY,
    LEFT_BAY,
    MOVE_EAST,
    PICKED_AT_ONCE,
    TURN_LEFT,
    TURN_RIGHT,
)
from automaton.world.condition import EXHAUSTED
from automaton.world.state import (
    AROUND,
    BAY_BLOCKED,
    BLOCKED,
    DROP,
    FREE,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    HALTED,
    HOLD_ASK,
    HOLD_NONE,
    HOLD_WAITED,
    MOVE,
    NEED_ALLOCATION,
    NEED_ROUTE,
    NIL,
    NO_STEP,
    PICK,
    PICKED,
    PLAN,
    REPLAN,
    TICK,
    TRY_DROP,
    TURN,
    UNPARKED,
    WAIT,
)


@kernel
def leave_bays(world):
    """Place robots with a task on their home cells if those had room at the start of the tick."""
    robots = world.robots
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.parked[i] == 0 or robots.busy[i] or robots.goal[i] in (GOAL_NONE, GOAL_PARK):
            continue
        if world.clock[HALTED] >= world.clock[TICK] and world.zoning.halt[i] >= world.clock[TICK]:
            continue
        if robots.at[i] >= robots.length[i] and robots.stand[i] != robots.home[i]:
            continue  # its route is still to come
        if robots.cell[i] == NIL:
            home = np.int64(robots.home[i])
            heading = entry_heading(world.grid, home)
            if not has_room(world.traffic.occupancy, home, heading):
                lose_tick(world, i, BAY_BLOCKED)
                robots.did[i] = DID_BAY_BLOCKED
                continue
            occupy(world.traffic.occupancy, home, heading)
            robots.cell[i] = home
            robots.heading[i] = heading
            robots.travel[i] = heading
            robots.did[i] = LEFT_BAY
        robots.parked[i] = 0
        world.clock[UNPARKED] += 1


@kernel
def stand_still(world, record):
    """Robots that zoning halts wait from now on until it lets them go; who is out of order does not."""
    robots, tick = world.robots, world.clock[TICK]
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.status[i] > EXHAUSTED:
            continue
        ticks = world.zoning.halt[i] - tick + 1
        if ticks > 0 and robots.busy[i] == 0 and robots.parked[i] == 0 and robots.cell[i] != NIL:
            begin(world, i, WAIT, ticks)
            robots.did[i] = DID_WAIT
            note(world.clock, record, DURATION, identity, ticks)
            if robots.need[i] & NEED_ALLOCATION:  # it is asked again when it is free
                need_allocation(world, i, np.int64(robots.reason[i]))


@kernel
def drive(world, record):
    """Set traffic.want and begin the operations of every robot that is free and on the floor."""
    robots, traffic = world.robots, world.traffic
    heading_mask = world.grid.headings - 1
    several = world.rules.duration.shape[0] > 1  # types; reading a robot's costs 1 ns
    span = world.rules.duration[0, MOVE]
    for i in range(robots.cell.shape[0]):
        traffic.want[U(i)] = 0
        if robots.busy[U(i)]:
            continue
        at = robots.at[U(i)]
        if at < robots.length[U(i)]:
            if robots.parked[U(i)]:
                continue
            direction = np.int64(robots.route[U(i), U(at)])
            if direction & heading_mask == robots.heading[U(i)]:
                if several:
                    span = world.rules.duration[U(robots.type[U(i)]), U(MOVE)]
                traffic.span[U(i)] = span
                entered = ENTERED if robots.did[U(i)] == LEFT_BAY else 0
                traffic.want[U(i)] = LIVE | direction | entered
            else:
                turn(world, i, direction)
        elif robots.parked[U(i)] == 0:
            drive_without_route(world, record, i)


@kernel
def drive_without_route(world, record, i):
    """The rarer cases: a step of right of way, arrival at the stand, nothing to do."""
    robots = world.robots
    direction = np.int64(robots.step[i])
    if direction != NO_STEP:
        robots.step[i] = NO_STEP
        if direction & (world.grid.headings - 1) == robots.heading[i]:
            world.traffic.span[i] = world.rules.duration[robots.type[i], MOVE]
            world.traffic.want[i] = LIVE | direction
        else:
            turn(world, i, direction)
            if robots.withdrawing[i] == 0:
                replan(world, i)
    elif robots.try_drop[i]:
        if not affords(world, i, TRY_DROP):
            return
        robots.try_drop[i] = 0
        begin(world, i, TRY_DROP, world.rules.duration[robots.type[i], TRY_DROP])
        robots.did[i] = np.int64(robots.did[i]) | DID_TRY_DROP
    elif robots.withdrawing[i] == 0 and robots.cell[i] == robots.stand[i]:
        do_goal(world, record, i)
    elif robots.withdrawing[i] == 0 and robots.stand[i] != NIL:
        if robots.need[i] & NEED_ROUTE == 0:  # the route ended before the stand: go on from here
            need_route(world, i, PLAN)


@kernel
def do_goal(world, record, i):
    """At its stand, robot i begins what it came for."""
    robots = world.robots
    flags = np.int64(robots.did[i])
    goal = robots.goal[i]
    if goal == GOAL_PICK and affords(world, i, PICK):
        robots.blocked[i] = 0
        pick_up(world, record, i, handling_time(world, record, i, PICK))
        robots.did[i] = flags | DID_PICK
    elif goal == GOAL_DROP and affords(world, i, DROP):
        robots.blocked[i] = 0
        set_down(world, record, i, handling_time(world, record, i, DROP))
        robots.did[i] = flags | DID_DROP
    elif goal == GOAL_PARK:
        world.traffic.want[i] = ARRIVED
    elif goal == GOAL_CHARGE:
        charge_up(world, i)


@kernel
def handling_time(world, record, i, action):
    """Ticks of a pick or a drop that begins now, delay included."""
    ticks = max(np.int64(world.rules.duration[world.robots.type[i], action]), 1)
    if world.rules.delay:
        identity = np.int64(world.robots.identity[i])
        tick = world.clock[TICK]
        ticks += draw_between(0, world.rules.delay, world.rules.seed, HANDLING, tick, identity)
        note(world.clock, record, DURATION, identity, ticks)
    return ticks


@kernel
def turn(world, i, direction):
    """Turn robot i by 90 degrees towards a direction, clockwise if it must turn round.

    In a cell of capacity 2 a turning robot needs both lanes; it claims its own cell meanwhile.
    """
    robots, grid = world.robots, world.grid
    if not affords(world, i, TURN):
        return
    cell = np.int64(robots.cell[i])
    if np.int64(grid.rule[cell]) >> 5 & 3 == 2:
        other_lane = np.int64(robots.travel[i]) ^ 2
        if not has_room(world.traffic.occupancy, cell, other_lane):
            world.traffic.want[i] = NO_TURN
            return
        occupy(world.traffic.occupancy, cell, other_lane)
        robots.claim[i] = cell
    heading = np.int64(robots.heading[i])
    left = grid.headings == 4 and (direction - heading) & 3 == 3
    robots.heading[i] = (heading + (3 if left else 1)) & (grid.headings - 1)
    robots.blocked[i] = 0
    begin(world, i, TURN, world.rules.duration[robots.type[i], TURN])
    robots.did[i] = np.int64(robots.did[i]) | (TURN_LEFT if left else TURN_RIGHT)


@kernel
def settle(world, record):
    """Read the outcome of the moves: count them, run waits and retries, park robots at home."""
    robots, traffic = world.robots, world.traffic
    several = world.rules.duration.shape[0] > 1
    usual = np.int64(world.rules.duration[0, MOVE])
    for i in range(robots.cell.shape[0]):
        want = np.int64(traffic.want[U(i)])
        if want & MOVED:
            loaded = 1 if robots.load[U(i)] != NIL else 0
            span = np.int64(traffic.span[U(i)])
            if several:
                usual = np.int64(world.rules.duration[U(robots.type[U(i)]), U(MOVE)])
            world.tally.times[U(i), U(MOVE), U(loaded)] += 1
            world.tally.ticks[U(i), U(MOVE), U(loaded)] += span
            if span != usual:
                world.tally.slowed[U(i)] += span - usual
                note(world.clock, record, DURATION, robots.identity[U(i)], span)
            if world.rules.battery:
                pay(world, i, price(world, i, MOVE, span))
            robots.action[U(i)] = MOVE
            robots.did[U(i)] = (np.int64(robots.did[U(i)]) & LEFT_BAY) | (MOVE_EAST + (want & 3))
            at = robots.at[U(i)]
            if at < robots.length[U(i)]:
                robots.at[U(i)] = at + 1
                robots.blocked[U(i)] = 0
                robots.hold[U(i)] = HOLD_NONE
                if at + 1 == robots.length[U(i)]:
                    park_if_home(world, i)
                    handle_at_once(world, record, i)
            else:
                after_step(world, i)
                handle_at_once(world, record, i)
        elif want & LIVE or want == NO_TURN:
            refused(world, record, i)
        elif want & ARRIVED:
            park_if_home(world, i)
            handle_at_once(world, record, i)


@kernel
def park_if_home(world, i):
    """A robot at home with nothing to do is in its bay, off the floor, or parked, from now on."""
    robots = world.robots
    home = np.int64(robots.home[i])
    if robots.goal[i] != GOAL_PARK or robots.cell[i] != home or robots.withdrawing[i]:
        return
    if robots.busy[i] or robots.at[i] < robots.length[i]:
        return
    robots.parked[i] = 1
    robots.goal[i] = GOAL_NONE
    robots.stand[i] = NIL
    drop_route(robots, i)
    no_route_needed(world, i)
    robots.did[i] = np.int64(robots.did[i]) | INTO_BAY
    world.clock[UNPARKED] -= 1
    need_allocation(world, i, FREE)
    if robots.bay[i] != NIL or world.rules.leave:
        vacate(world.traffic.occupancy, home, np.int64(robots.travel[i]))
        robots.cell[i] = NIL
        robots.heading[i] = entry_heading(world.grid, home)


@kernel
def handle_at_once(world, record, i):
    """A robot whose move ends at its stand handles its load in the same tick, if that takes none."""
    robots, duration = world.robots, world.rules.duration[world.robots.type[i]]
    picks = robots.goal[i] == GOAL_PICK and duration[PICK] == 0
    drops = robots.goal[i] == GOAL_DROP and duration[DROP] == 0
    if not (picks or drops) or robots.cell[i] != robots.stand[i] or robots.action[i] != MOVE:
        return
    if robots.busy[i] or robots.at[i] < robots.length[i]:
        return
    if robots.withdrawing[i] or robots.try_drop[i]:
        return
    no_route_needed(world, i)  # a step of right of way may have asked for one
    robots.blocked[i] = 0
    if picks:
        pick_up(world, record, i, 0)
    else:
        set_down(world, record, i, 0)
    robots.did[i] = np.int64(robots.did[i]) | (PICKED_AT_ONCE if picks else DROPPED_AT_ONCE)


@kernel
def after_step(world, i):
    """A step that right of way asked for was made; after the last one of a withdrawal plan anew."""
    robots = world.robots
    if robots.withdrawing[i]:
        robots.withdrawing[i] -= 1
        if robots.withdrawing[i]:
            return
        no_way_needed(world, i)
    replan(world, i)


@kernel
def replan(world, i):
    """Plan the same task again around the other robots; look for work if there is no task."""
    goal = world.robots.goal[i]
    if goal == GOAL_NONE or goal == GOAL_PARK:
        need_allocation(world, i, PICKED if world.robots.load[i] != NIL else REPLAN)
    if goal != GOAL_NONE:
        need_route(world, i, AROUND)


@kernel
def refused(world, record, i):
    """A planned move, or the turn before it, was refused: wait, then retry, then ask right of way."""
    robots, wait = world.robots, world.rules.wait
    if robots.at[i] >= robots.length[i]:
        lose_tick(world, i, BLOCKED)  # a refused step costs the tick
        robots.did[i] = np.int64(robots.did[i]) | DID_BLOCKED
        if robots.withdrawing[i] == 0:
            replan(world, i)
    elif robots.hold[i] == HOLD_WAITED:
        lose_tick(world, i, BLOCKED)
        robots.did[i] = np.int64(robots.did[i]) | DID_BLOCKED
        robots.blocked[i] = min(np.int64(robots.blocked[i]) + 1, 255)
        robots.hold[i] = HOLD_NONE
        if robots.blocked[i] >= wait[4]:
            robots.hold[i] = HOLD_ASK
            need_way(world, i)
    else:
        first = 2 if robots.load[i] != NIL else 0
        tick = world.clock[TICK]
        identity = np.int64(robots.identity[i])
        ticks = draw_between(
            np.int64(wait[first]),
            np.int64(wait[first + 1]),
            world.rules.seed,
            WAITS,
            tick,
            identity,
        )
        begin(world, i, WAIT, ticks)
        robots.busy[i] = ticks - 1  # motion of this tick is over
        robots.hold[i] = HOLD_WAITED
        robots.did[i] = np.int64(robots.did[i]) | DID_WAIT
        note(world.clock, record, DURATION, identity, ticks)
