"""How decisions enter the world: each is checked; an illegal one costs a tick of WAIT and is
counted."""

import numpy as np

from automaton.engine.batches import may_set_order_queue
from automaton.engine.decisions import (
    CMD_DROP_AT,
    CMD_GO,
    CMD_HOLD,
    CMD_PARK,
    CMD_RETREAT,
    CMD_STEP,
    CMD_TAKE_ORDER,
    CMD_WAIT,
)
from automaton.engine.energy import end_charging, offer_charger
from automaton.engine.fulfilment import (
    begin_leg,
    has_started,
    lose_order,
    reserve_order,
    reserve_slot,
    return_order,
)
from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import (
    begin,
    clear_allocation_request,
    clear_right_of_way,
    clear_route_request,
    count_lost_tick,
    drop_route,
    has_load,
    is_assigned,
    is_drivable,
    is_facing,
    next_stop,
    next_stop_cell,
    record_change,
    refuse,
    replan,
    request_allocation,
    request_charging,
    request_right_of_way,
    request_route,
    set_goal,
    with_load,
)
from automaton.engine.random_numbers import splitmix64
from automaton.engine.record_codes import (
    CHANGE_DURATION,
    EXECUTED_BLOCKED,
    EXECUTED_RETREAT,
    EXECUTED_WAIT,
)
from automaton.engine.state import (
    ACTION_BLOCKED,
    ACTION_RETREAT,
    ACTION_WAIT,
    BATTERY_FULL,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    HOLD,
    KEEP,
    LAYER_ALLOCATION,
    LAYER_CHARGING,
    LAYER_RIGHT_OF_WAY,
    LAYER_ROUTING,
    MAY_TURN,
    NEED_ALLOCATION,
    NEED_ROUTE,
    NIL,
    NO_STEP,
    ORDER_WAITING,
    REASON_AROUND_ROBOTS,
    REASON_IDLE,
    REASON_NO_ORDER,
    REASON_ORDER_RETURNED,
    REASON_ORDER_TAKEN,
    REASON_REPLAN,
    RETRY_EXHAUSTED,
    RETRY_NONE,
    STATUS_EXHAUSTED,
)
from automaton.engine.trips import (
    give_place_back,
    has_place,
    has_trips,
    next_station,
    take_place,
    withdraw_offer,
)

GIVEN = 255  # in out.order_taken: assigned in this batch


@kernel
def serves(world, i, goal_cell, slot):
    """Whether robot i can serve `slot` from `goal_cell`."""
    if goal_cell < 0 or slot < 0 or slot >= world.slots.cell.shape[0]:
        return False
    if (
        goal_cell >= world.slots.reachable.shape[1]
        or not world.slots.reachable[with_load(world, np.int64(world.robots.type[i])), goal_cell]
    ):
        return False
    for direction in range(4):
        if world.slots.access[slot, direction] == goal_cell:
            return True
    return False


@kernel
def commit_allocation(world, record, batch, decisions):
    robots = world.robots
    out = decisions.allocation
    commit_order_queues(world, batch, out)
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        command = out.command[k]
        if robots.status[i] > STATUS_EXHAUSTED:
            continue  # it broke down in this tick
        if command == CMD_TAKE_ORDER:
            take(world, record, i, np.int64(out.order[k]), np.int64(out.goal_cell[k]), out)
        elif command == CMD_DROP_AT:
            slot, goal_cell = np.int64(out.slot[k]), np.int64(out.goal_cell[k])
            choose_slot(world, record, i, slot, goal_cell, np.int64(out.try_drop[k]))
        elif command == CMD_PARK and (robots.load[i] != NIL or robots.order[i] != NIL):
            refuse(world, LAYER_ALLOCATION, i)
        elif command == CMD_PARK and robots.goal_type[i] == GOAL_CHARGE:
            stay_idle(world, i, out.ask_again[k])
        elif command == CMD_PARK and world.rules.leave and robots.cell[i] != NIL:
            leave_floor(world, i, out.ask_again[k])
        elif command == CMD_PARK and robots.parked[i] == 0:
            clear_allocation_request(world, i)
            if robots.goal_type[i] != GOAL_PARK:
                set_goal(world, i, GOAL_PARK, np.int64(robots.home[i]))
                request_charging(world, i, REASON_NO_ORDER)
        elif command == CMD_PARK or command == KEEP:
            stay_idle(world, i, out.ask_again[k])
        else:
            refuse(world, LAYER_ALLOCATION, i)
        if batch.reason[k] == REASON_ORDER_RETURNED:
            route_around_robots(world, i)


@kernel
def route_around_robots(world, i):
    """Robot i, whose way was blocked, chose again (`plan_again`): its new route avoids other robots."""
    robots = world.robots
    if (
        robots.retreat_moves[i] == 0
        and robots.failed_retries[i] > 0
        and robots.need[i] & NEED_ROUTE
    ):
        request_route(world, i, REASON_AROUND_ROBOTS)


@kernel
def commit_order_queues(world, batch, out):
    """Enter the planned orders of robots; a plan is illegal if one of its orders does not wait."""
    robots, orders = world.robots, world.orders
    for i in range(robots.cell.shape[0]):
        count = np.int64(out.order_queue_length[i])
        if count == KEEP or not may_set_order_queue(world, batch, i):
            continue
        legal = 0 <= count <= robots.order_queue.shape[1]
        for k in range(count if legal else 0):
            order = np.int64(out.order_queue[i, k])
            legal = legal and 0 <= order < orders.state.shape[0]
            legal = legal and orders.state[order] == ORDER_WAITING
        if not legal:
            world.tally.illegal[LAYER_ALLOCATION] += 1
            continue
        changed = count != robots.order_queue_length[i]
        robots.order_queue_length[i] = count
        for k in range(count):
            changed = changed or robots.order_queue[i, k] != out.order_queue[i, k]
            robots.order_queue[i, k] = out.order_queue[i, k]
        if changed:
            world.clock.revision += 1  # an idle robot is asked again


@kernel
def leave_floor(world, i, ask_again):
    """Robot i parks where it stands, unless it is busy or in a retreat."""
    robots = world.robots
    if robots.busy[i] or robots.retreat_moves[i]:
        stay_idle(world, i, ask_again)
        return
    clear_allocation_request(world, i)
    if robots.parked[i]:
        robots.parked[i] = 0
        world.clock.unparked += 1
    robots.home[i] = robots.cell[i]
    set_goal(world, i, GOAL_PARK, np.int64(robots.home[i]))


@kernel
def stay_idle(world, i, ask_again):
    """No order for robot i: ask again when an order or a reservation has changed."""
    robots = world.robots
    if robots.need[i] & NEED_ALLOCATION == 0 or ask_again:
        return
    if robots.goal_type[i] != GOAL_NONE and robots.charging_interruptible[i] == 0:
        clear_allocation_request(world, i)
        return
    if robots.seen_revision[i] == NIL:
        world.clock.fresh_allocation -= 1
        if robots.goal_type[i] == GOAL_NONE:
            request_charging(world, i, REASON_NO_ORDER)
    robots.seen_revision[i] = world.clock.revision


@kernel
def may_have(reserved_by, identity):
    """Whether a resource reserved by `by` (NIL: no robot) is available to a robot."""
    return reserved_by == NIL or reserved_by == identity


@kernel
def may_take(world, i, order, out):
    """Whether robot i may get an order: it waits, and is unreserved or may be taken from its robot.

    An order without a load may be taken from its robot until its first stop is begun, except within
    the batch that assigned it.
    """
    robots, orders = world.robots, world.orders
    if robots.load[i] != NIL or order < 0 or order >= orders.state.shape[0]:
        return False
    if orders.state[order] != ORDER_WAITING or has_started(world, i):
        return False
    if orders.weight[order] > world.rules.payload[robots.type[i]]:
        return False
    if not is_assigned(world, i, order):
        return False
    if may_have(orders.reserved_by[order], robots.identity[i]):
        return True
    return not has_load(orders, order) and out.order_taken[order] != GIVEN


@kernel
def begins_at(world, i, order, goal_cell):
    """Whether robot i begins an order in `goal_cell`: its next stop, or the access cell of its
    pick-up."""
    if has_load(world.orders, order):
        return serves(world, i, goal_cell, np.int64(world.orders.current_slot[order]))
    if goal_cell != next_stop_cell(world, order):
        return False
    return world.slots.reachable[world.robots.type[i], goal_cell] != 0


@kernel
def take(world, record, i, order, goal_cell, out):
    """Reserve a waiting order for robot i and send it to the goal cell; a previous robot loses the
    order."""
    robots, orders = world.robots, world.orders
    if not may_take(world, i, order, out) or not begins_at(world, i, order, goal_cell):
        refuse(world, LAYER_ALLOCATION, i)
        return
    if has_trips(world) and robots.order[i] != order:
        own = world.trips.place[robots.identity[i]]  # freed when this robot changes its trip
        if not has_place(world, order) and own != next_station(world, order):
            return  # another robot got the last place in this batch: ask this robot again
        take_trip(world, record, np.int64(robots.identity[i]), order)
    out.order_taken[order] = GIVEN
    clear_allocation_request(world, i)
    if robots.order[i] != order:
        if robots.order[i] != NIL:
            reserve_order(world, record, np.int64(robots.order[i]), NIL)
        if not may_have(orders.reserved_by[order], robots.identity[i]):
            lose_order(world, record, np.int64(robots.at_index[orders.reserved_by[order]]))
        robots.order[i] = order
        orders.dispatched[order] = world.clock.tick
        in_bay = robots.cell[i] == NIL
        orders.dispatched_from[order] = robots.home[i] if in_bay else robots.cell[i]
        orders.dispatched_heading[order] = robots.heading[i]
        orders.dispatched_type[order] = robots.type[i]
        orders.dispatched_to[order] = robots.identity[i]
        begin_leg(world, i)
        reserve_order(world, record, order, np.int64(robots.identity[i]))
    if robots.goal_type[i] == GOAL_CHARGE:
        end_charging(world, i)
    set_goal(world, i, GOAL_PICK if has_load(orders, order) else GOAL_STOP, goal_cell)
    request_charging(world, i, REASON_ORDER_TAKEN)


@kernel
def take_trip(world, record, identity, order):
    """A robot takes a trip and a place at its station; its previous place or offer ends."""
    if world.trips.offered[identity] != NIL:
        if world.trips.offered[identity] != order:
            withdraw_offer(world, record, identity)
        world.trips.offered[identity] = NIL
    give_place_back(world, identity)
    take_place(world, identity, order)


@kernel
def choose_slot(world, record, i, slot, goal_cell, try_drop):
    """Reserve the slot where robot i will drop its load; legal only when no stop is left."""
    robots, slots = world.robots, world.slots
    legal = robots.load[i] != NIL and serves(world, i, goal_cell, slot)
    legal = legal and next_stop(world, np.int64(robots.load[i])) == NIL
    legal = legal and (not has_trips(world) or world.pods.slot_class[slot] != NIL)
    if legal and slots.unbounded[slot]:  # a load may be dropped at any station, not only its target
        legal = slot == world.orders.target[robots.load[i]] or world.stations.at[slot] != NIL
    elif legal:
        legal = slots.content[slot] == NIL and may_have(slots.reserved_by[slot], robots.identity[i])
    if not legal:
        refuse(world, LAYER_ALLOCATION, i)
        return
    clear_allocation_request(world, i)
    if robots.slot[i] != slot:
        if robots.slot[i] != NIL:
            reserve_slot(world, record, np.int64(robots.slot[i]), NIL)
        robots.slot[i] = slot
        reserve_slot(world, record, slot, np.int64(robots.identity[i]))
    robots.try_drop[i] = 1 if try_drop else 0
    set_goal(world, i, GOAL_DROP, goal_cell)


@kernel
def commit_routing(world, batch, decisions):
    robots = world.robots
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        route_length = np.int64(decisions.routing.route_length[k])
        if route_length == KEEP:
            continue
        if route_length < 0 or not is_drivable(world, i, decisions.routing.steps[k], route_length):
            refuse(world, LAYER_ROUTING, i)
            continue
        clear_route_request(world, i)
        total = np.uint64(0)
        for s in range(route_length):
            step = decisions.routing.steps[k, s]
            robots.route[i, s] = step
            total += splitmix64((np.uint64(s) << np.uint64(8)) | np.uint64(step))
        robots.route_length[i] = route_length
        robots.route_index[i] = 0
        robots.route_hash[i] = np.int64(total >> np.uint64(1))


# How the decisions of a charging strategy enter the world.


@kernel
def commit_charging(world, record, batch, decisions):
    """A robot without a load or a begun order may be sent to a charger, or away from it."""
    robots, out = world.robots, decisions.charging
    for k in range(batch.count):
        goal_cell, charge_target = np.int64(out.goal_cell[k]), np.int64(out.charge_target[k])
        i = np.int64(batch.robot[k])
        if goal_cell == KEEP:
            continue
        if goal_cell == NIL and robots.goal_type[i] == GOAL_CHARGE:
            end_charging(world, i)
            drop_route(robots, i)
            clear_route_request(world, i)
            request_allocation(world, i, REASON_IDLE)
        elif (
            is_charger(world, i, goal_cell)
            and robots.load[i] == NIL
            and not has_started(world, i)
            and 0 < charge_target <= BATTERY_FULL
        ):
            send_to_charger(
                world, record, i, goal_cell, charge_target, out.charging_interruptible[k]
            )
        else:
            refuse(world, LAYER_CHARGING, i)


@kernel
def is_charger(world, i, goal_cell):
    """Whether `goal_cell` is a charger that robot i can reach."""
    inside = 0 <= goal_cell < world.grid.cell_flags.shape[0]
    if not inside or world.rules.battery == 0 or world.chargers.charger_at[goal_cell] == NIL:
        return False
    return world.slots.reachable[world.robots.type[i], goal_cell] != 0


@kernel
def send_to_charger(world, record, i, goal_cell, charge_target, charging_interruptible):
    """Robot i returns the orders that it has not begun, and goes to charge up to a level."""
    robots = world.robots
    if robots.order[i] != NIL:
        return_order(world, record, i)
    robots.charge_target[i] = charge_target
    robots.charging_interruptible[i] = 1 if charging_interruptible else 0
    if charging_interruptible:
        request_allocation(world, i, REASON_REPLAN)  # it may get an order while it charges
    else:
        clear_allocation_request(world, i)
    if robots.goal_type[i] != GOAL_CHARGE or robots.goal_cell[i] != goal_cell:
        if robots.goal_type[i] == GOAL_CHARGE:
            offer_charger(world, i)
        robots.ticket[i] = 0
        set_goal(world, i, GOAL_CHARGE, goal_cell)


# How decisions of right of way enter the world: steps, waits, retreats, and steering.


MAX_COMMAND_TICKS = 10_000  # of one wait or retreat


@kernel
def commit_right_of_way(world, record, batch, decisions):
    robots = world.robots
    out = decisions.right_of_way
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        command, value = out.command[k], np.int64(out.value[k])
        if world.rules.steered[0]:
            robots.step[i] = NO_STEP
        if out.priority[k] != KEEP:
            if -32768 <= out.priority[k] <= 32767:
                robots.priority[i] = out.priority[k]
            else:
                world.tally.illegal[LAYER_RIGHT_OF_WAY] += 1
        if command == KEEP:
            if robots.retry_state[i] == RETRY_EXHAUSTED:
                robots.retry_state[i] = RETRY_NONE
                clear_right_of_way(world, i)
        elif world.rules.steered[0]:
            commit_steering(world, record, i, command, value)
        elif robots.parked[i] and command != CMD_STEP:
            refuse(world, LAYER_RIGHT_OF_WAY, i)
        elif command == CMD_STEP and robots.cell[i] != NIL:
            step(world, i, value)
        elif command == CMD_WAIT and 1 <= value <= MAX_COMMAND_TICKS:
            pause(world, record, i, value)
        elif command == CMD_RETREAT and value == 0:
            plan_again(world, record, i, out.return_order[k])
        elif command == CMD_RETREAT and 1 <= value <= MAX_COMMAND_TICKS:
            retreat(world, record, i, value, out.return_order[k])
        else:
            refuse(world, LAYER_RIGHT_OF_WAY, i)


@kernel
def commit_steering(world, record, i, command, value):
    """What a steering right of way may ask of robot i, in its parking bay or on the floor."""
    robots = world.robots
    in_bay = robots.cell[i] == NIL
    waits_in_bay = in_bay and robots.goal_type[i] != GOAL_NONE and robots.goal_type[i] != GOAL_PARK
    if command == CMD_GO and waits_in_bay and 0 <= value < 4:
        robots.step[i] = value  # out of its parking bay, in whatever direction
    elif command == CMD_GO and may_step(world, i, value):
        robots.step[i] = value
        if robots.parked[i]:
            robots.parked[i] = 0
            world.clock.unparked += 1
            if robots.goal_type[i] == GOAL_NONE:  # pushed from its place: it returns by itself
                set_goal(world, i, GOAL_PARK, np.int64(robots.home[i]))
    elif command == CMD_HOLD and -1 <= value < 4:
        if robots.parked[i] and in_bay == 0 and robots.goal_type[i] != GOAL_NONE:
            robots.parked[i] = 0  # it has work: its lost ticks count from now on
            world.clock.unparked += 1
        if waits_in_bay or robots.parked[i] == 0:
            robots.step[i] = HOLD | (NO_STEP if value == NIL else value)
    elif command == CMD_WAIT and 1 <= value <= MAX_COMMAND_TICKS and robots.parked[i] == 0:
        pause(world, record, i, value)
    else:
        refuse(world, LAYER_RIGHT_OF_WAY, i)


@kernel
def may_step(world, i, direction):
    """Whether robot i, on the floor, may move in a direction or turn towards it."""
    robots = world.robots
    if robots.cell[i] == NIL or direction < 0 or direction > 3:
        return False
    flags = np.int64(world.grid.type_cell_flags[robots.type[i], robots.cell[i]])
    may_turn = flags & MAY_TURN != 0
    return (flags >> direction) & 1 == 1 and (may_turn or is_facing(world, i, direction))


@kernel
def step(world, i, direction):
    """Execute one move, or the turn before it; outside a retreat the route is then planned again.

    A robot that is parked on the floor leaves its place.
    """
    robots = world.robots
    if not may_step(world, i, direction):
        refuse(world, LAYER_RIGHT_OF_WAY, i)
        return
    if robots.retreat_moves[i] == 0:
        drop_route(robots, i)
        robots.retry_state[i] = RETRY_NONE
        clear_right_of_way(world, i)
    if robots.parked[i]:
        robots.parked[i] = 0
        world.clock.unparked += 1
    robots.step[i] = direction


@kernel
def pause(world, record, i, ticks):
    """Wait; in a retreat this ends it, and the plan is made again around the robots."""
    robots = world.robots
    begin(world, i, ACTION_WAIT, ticks)
    robots.executed[i] = EXECUTED_WAIT
    record_change(world.clock, record, CHANGE_DURATION, robots.identity[i], ticks)
    clear_right_of_way(world, i)
    robots.retry_state[i] = RETRY_NONE
    if robots.retreat_moves[i]:
        robots.retreat_moves[i] = 0
        replan(world, i)


@kernel
def retreat(world, record, i, moves, returns):
    """Begin a retreat; the tick of the decision executes nothing."""
    robots = world.robots
    count_lost_tick(world, i, ACTION_RETREAT)
    robots.busy[i] = 1
    robots.executed[i] = EXECUTED_RETREAT
    robots.retreat_moves[i] = moves
    robots.failed_retries[i] = 0
    robots.retry_state[i] = RETRY_NONE
    drop_route(robots, i)
    request_right_of_way(world, i)
    if returns:
        choose_again(world, record, i)


@kernel
def plan_again(world, record, i, returns):
    """A retreat of 0 moves: robot i plans again where it stands; this tick executes nothing.

    Its failed retries still count: the next one may lead to a retreat.
    """
    robots = world.robots
    count_lost_tick(world, i, ACTION_BLOCKED)
    robots.busy[i] = 1
    robots.executed[i] = EXECUTED_BLOCKED
    robots.retreat_moves[i] = 0
    robots.retry_state[i] = RETRY_NONE
    clear_right_of_way(world, i)
    drop_route(robots, i)
    if not (returns and choose_again(world, record, i)):
        replan(world, i)


@kernel
def choose_again(world, record, i):
    """Robot i returns an order that it has not begun and asks for another one; else returns False."""
    robots = world.robots
    if robots.load[i] != NIL or has_started(world, i) or robots.goal_type[i] == GOAL_CHARGE:
        return False
    if robots.order[i] != NIL:
        return_order(world, record, i)
    robots.goal_type[i] = GOAL_NONE
    robots.goal_cell[i] = NIL
    clear_route_request(world, i)
    request_allocation(world, i, REASON_ORDER_RETURNED)
    return True
