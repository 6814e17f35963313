"""How answers enter the world: each is checked, an illegal one costs a tick of WAIT and is counted."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import mix
from automaton.kernels.drive import replan
from automaton.kernels.energy import end_charging
from automaton.kernels.operations import (
    allocation_done,
    begin,
    drop_route,
    first_cell,
    lose_tick,
    need_allocation,
    need_charging,
    need_way,
    no_route_needed,
    no_way_needed,
    note,
    refuse,
    reserve_order,
    reserve_slot,
    set_goal,
)
from automaton.recording.codes import DID_WAIT, DID_WITHDRAW, DURATION
from automaton.world.condition import EXHAUSTED
from automaton.world.state import (
    ALLOCATION,
    CHANGES,
    FRESH_ALLOCATION,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    HOLD_ASK,
    HOLD_NONE,
    IDLE_NOW,
    KEEP,
    NEED_ALLOCATION,
    NIL,
    PARK,
    PAUSE,
    RELEASED,
    RETREAT,
    RIGHT_OF_WAY,
    ROUTING,
    SET_DOWN,
    STEP,
    TAKE,
    TICK,
    TOOK,
    UNPARKED,
    WAIT,
    WAITING,
    WITHDRAW,
)

MOST_TICKS = 10_000  # of one pause or withdrawal


@kernel
def serves(world, i, stand, slot):
    """Whether `stand` is a cell from which robot i serves `slot`."""
    if stand < 0 or slot < 0 or slot >= world.slots.cell.shape[0]:
        return False
    if stand >= world.slots.within.shape[1] or not world.slots.within[world.robots.type[i], stand]:
        return False
    for direction in range(4):
        if world.slots.access[slot, direction] == stand:
            return True
    return False


@kernel
def commit_allocation(world, record, asked, answers):
    robots = world.robots
    given = answers.allocation
    commit_plans(world, asked, given)
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        verb = given.verb[k]
        if robots.status[i] > EXHAUSTED:
            continue  # it went out of order in this tick
        if verb == TAKE:
            take(world, record, i, np.int64(given.order[k]), np.int64(given.stand[k]))
        elif verb == SET_DOWN:
            slot, stand = np.int64(given.slot[k]), np.int64(given.stand[k])
            choose_slot(world, record, i, slot, stand, np.int64(given.try_drop[k]))
        elif verb == PARK and (robots.load[i] != NIL or robots.order[i] != NIL):
            refuse(world, ALLOCATION, i)
        elif verb == PARK and robots.goal[i] == GOAL_CHARGE:
            stay_idle(world, i, given.ask_again[k])
        elif verb == PARK and world.rules.leave and robots.cell[i] != NIL:
            leave_floor(world, i, given.ask_again[k])
        elif verb == PARK and robots.parked[i] == 0:
            allocation_done(world, i)
            if robots.goal[i] != GOAL_PARK:
                set_goal(world, i, GOAL_PARK, np.int64(robots.home[i]))
                need_charging(world, i, IDLE_NOW)
        elif verb == PARK or verb == KEEP:
            stay_idle(world, i, given.ask_again[k])
        else:
            refuse(world, ALLOCATION, i)


@kernel
def may_plan(world, asked, i):
    """Whether the plan of robot i may be made now: with limited sight only its own decision does."""
    return world.rules.radius == NIL or asked.robot[0] == i


@kernel
def commit_plans(world, asked, given):
    """Enter the orders that robots are to do next; a plan with one that does not wait is illegal."""
    robots, orders = world.robots, world.orders
    for i in range(robots.cell.shape[0]):
        count = np.int64(given.planned[i])
        if count == KEEP or not may_plan(world, asked, i):
            continue
        legal = 0 <= count <= robots.plan.shape[1]
        for k in range(count if legal else 0):
            order = np.int64(given.plan[i, k])
            legal = legal and 0 <= order < orders.state.shape[0]
            legal = legal and orders.state[order] == WAITING
        if not legal:
            world.tally.illegal[ALLOCATION] += 1
            continue
        changed = count != robots.planned[i]
        robots.planned[i] = count
        for k in range(count):
            changed = changed or robots.plan[i, k] != given.plan[i, k]
            robots.plan[i, k] = given.plan[i, k]
        if changed:
            world.clock[CHANGES] += 1  # who was left idle is asked again


@kernel
def leave_floor(world, i, ask_again):
    """Robot i parks where it stands, unless it is busy or on a withdrawal."""
    robots = world.robots
    if robots.busy[i] or robots.withdrawing[i]:
        stay_idle(world, i, ask_again)
        return
    allocation_done(world, i)
    if robots.parked[i]:
        robots.parked[i] = 0
        world.clock[UNPARKED] += 1
    robots.home[i] = robots.cell[i]
    set_goal(world, i, GOAL_PARK, np.int64(robots.home[i]))


@kernel
def stay_idle(world, i, ask_again):
    """Nothing for robot i now: ask again when an order or a reservation has changed."""
    robots = world.robots
    if robots.need[i] & NEED_ALLOCATION == 0 or ask_again:
        return
    if robots.goal[i] != GOAL_NONE and robots.yields[i] == 0:
        allocation_done(world, i)
        return
    if robots.asked_at[i] == NIL:
        world.clock[FRESH_ALLOCATION] -= 1
        if robots.goal[i] == GOAL_NONE:
            need_charging(world, i, IDLE_NOW)
    robots.asked_at[i] = world.clock[CHANGES]


@kernel
def may_have(by, identity):
    """Whether something reserved by `by` (NIL: nobody) is free for a robot."""
    return by == NIL or by == identity


@kernel
def take(world, record, i, order, stand):
    """Reserve a waiting order for robot i and send it to the stand."""
    robots, orders = world.robots, world.orders
    legal = robots.load[i] == NIL and 0 <= order < orders.state.shape[0]
    legal = legal and orders.state[order] == WAITING
    legal = legal and may_have(orders.by[order], robots.identity[i])
    legal = legal and orders.weight[order] <= world.rules.payload[robots.type[i]]
    if not legal or not serves(world, i, stand, np.int64(orders.place[order])):
        refuse(world, ALLOCATION, i)
        return
    allocation_done(world, i)
    if robots.order[i] != order:
        if robots.order[i] != NIL:
            reserve_order(world, record, np.int64(robots.order[i]), NIL)
        robots.order[i] = order
        orders.dispatched[order] = world.clock[TICK]
        in_bay = robots.cell[i] == NIL
        orders.dispatched_from[order] = robots.home[i] if in_bay else robots.cell[i]
        orders.dispatched_heading[order] = robots.heading[i]
        orders.dispatched_type[order] = robots.type[i]
        reserve_order(world, record, order, np.int64(robots.identity[i]))
    if robots.goal[i] == GOAL_CHARGE:
        end_charging(robots, i)
    set_goal(world, i, GOAL_PICK, stand)
    need_charging(world, i, TOOK)


@kernel
def choose_slot(world, record, i, slot, stand, try_drop):
    """Reserve the slot where robot i will set its load down."""
    robots, slots = world.robots, world.slots
    legal = robots.load[i] != NIL and serves(world, i, stand, slot)
    if legal and slots.endless[slot]:  # at a station a load may lie on its way
        legal = slot == world.orders.target[robots.load[i]] or world.stations.at[slot] != NIL
    elif legal:
        legal = slots.content[slot] == NIL and may_have(slots.by[slot], robots.identity[i])
    if not legal:
        refuse(world, ALLOCATION, i)
        return
    allocation_done(world, i)
    if robots.slot[i] != slot:
        if robots.slot[i] != NIL:
            reserve_slot(world, record, np.int64(robots.slot[i]), NIL)
        robots.slot[i] = slot
        reserve_slot(world, record, slot, np.int64(robots.identity[i]))
    robots.try_drop[i] = 1 if try_drop else 0
    set_goal(world, i, GOAL_DROP, stand)


@kernel
def commit_routing(world, asked, answers):
    robots = world.robots
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        length = np.int64(answers.routing.length[k])
        if length == KEEP:
            continue
        if length < 0 or not is_drivable(world, i, answers.routing.steps[k], length):
            refuse(world, ROUTING, i)
            continue
        no_route_needed(world, i)
        total = np.uint64(0)
        for s in range(length):
            step = answers.routing.steps[k, s]
            robots.route[i, s] = step
            total += mix((np.uint64(s) << np.uint64(8)) | np.uint64(step))
        robots.length[i] = length
        robots.at[i] = 0
        robots.route_sum[i] = np.int64(total >> np.uint64(1))


@kernel
def is_drivable(world, i, steps, length):
    """Whether a route starts at robot i, keeps to exits open to it, and turns only where it may."""
    grid, robots = world.grid, world.robots
    if length > steps.shape[0]:
        return False
    ways = grid.ways[robots.type[i]]
    cell = first_cell(robots, i)
    heading = np.int64(robots.heading[i])
    for s in range(length):
        direction = np.int64(steps[s])
        rule = np.int64(ways[cell])
        if direction > 3 or (rule >> direction) & 1 == 0:
            return False
        if direction & (grid.headings - 1) != heading:
            if rule & 16 == 0:
                return False
            heading = direction & (grid.headings - 1)
        cell += grid.offset[direction]
    return True


@kernel
def commit_right_of_way(world, record, asked, answers):
    robots = world.robots
    given = answers.right_of_way
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        verb, value = given.verb[k], np.int64(given.value[k])
        if given.priority[k] != KEEP:
            if -32768 <= given.priority[k] <= 32767:
                robots.priority[i] = given.priority[k]
            else:
                world.tally.illegal[RIGHT_OF_WAY] += 1
        if verb == KEEP:
            if robots.hold[i] == HOLD_ASK:
                robots.hold[i] = HOLD_NONE
                no_way_needed(world, i)
        elif robots.parked[i] and verb != STEP:
            refuse(world, RIGHT_OF_WAY, i)
        elif verb == STEP and robots.cell[i] != NIL:
            step(world, i, value)
        elif verb == PAUSE and 1 <= value <= MOST_TICKS:
            pause(world, record, i, value)
        elif verb == RETREAT and 1 <= value <= MOST_TICKS:
            retreat(world, record, i, value, given.release[k])
        else:
            refuse(world, RIGHT_OF_WAY, i)


@kernel
def step(world, i, direction):
    """One move, or the turn before it, now; outside a withdrawal the route is planned anew after it.

    A robot that is parked on the floor leaves its place.
    """
    grid, robots = world.grid, world.robots
    rule = np.int64(grid.ways[robots.type[i], robots.cell[i]])
    legal = 0 <= direction < 4 and (rule >> direction) & 1 == 1
    if not legal or (direction & (grid.headings - 1) != robots.heading[i] and rule & 16 == 0):
        refuse(world, RIGHT_OF_WAY, i)
        return
    if robots.withdrawing[i] == 0:
        drop_route(robots, i)
        robots.hold[i] = HOLD_NONE
        no_way_needed(world, i)
    if robots.parked[i]:
        robots.parked[i] = 0
        world.clock[UNPARKED] += 1
    robots.step[i] = direction


@kernel
def pause(world, record, i, ticks):
    """Wait; during a withdrawal this gives it up, and the plan is made anew around the robots."""
    robots = world.robots
    begin(world, i, WAIT, ticks)
    robots.did[i] = DID_WAIT
    note(world.clock, record, DURATION, robots.identity[i], ticks)
    no_way_needed(world, i)
    robots.hold[i] = HOLD_NONE
    if robots.withdrawing[i]:
        robots.withdrawing[i] = 0
        replan(world, i)


@kernel
def retreat(world, record, i, moves, release):
    """Begin a withdrawal; the tick of the decision executes nothing."""
    robots = world.robots
    lose_tick(world, i, WITHDRAW)
    robots.busy[i] = 1
    robots.did[i] = DID_WITHDRAW
    robots.withdrawing[i] = moves
    robots.blocked[i] = 0
    robots.hold[i] = HOLD_NONE
    drop_route(robots, i)
    need_way(world, i)
    if release and robots.load[i] == NIL and robots.goal[i] != GOAL_CHARGE:
        if robots.order[i] != NIL:
            reserve_order(world, record, np.int64(robots.order[i]), NIL)
            robots.order[i] = NIL
        robots.goal[i] = GOAL_NONE
        robots.stand[i] = NIL
        no_route_needed(world, i)
        need_allocation(world, i, RELEASED)
