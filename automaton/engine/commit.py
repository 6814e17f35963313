"""How decisions enter the world: each is checked; an illegal one costs a tick of WAIT and is
counted."""

import numpy as np

from automaton.engine.batches import may_set_order_queue
from automaton.engine.decisions import (
    CMD_DROP_AT,
    CMD_PARK,
    CMD_TAKE_ORDER,
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
    clear_allocation_request,
    clear_route_request,
    drop_route,
    has_load,
    is_assigned,
    next_stop,
    next_stop_cell,
    note_refusal,
    refuse,
    request_allocation,
    request_charging,
    request_route,
    route_flaw,
    set_goal,
    with_load,
)
from automaton.engine.random_numbers import splitmix64
from automaton.engine.refusals import (
    RULE_ALLOCATION,
    RULE_CHARGE_LOAD,
    RULE_CHARGE_ORDER,
    RULE_CHARGE_STOP,
    RULE_CHARGE_TARGET,
    RULE_CHARGER,
    RULE_CHARGER_REACH,
    RULE_DROP_EMPTY,
    RULE_DROP_FULL,
    RULE_DROP_GOAL,
    RULE_DROP_PLACE,
    RULE_DROP_REACH,
    RULE_DROP_RESERVED,
    RULE_DROP_SLOT,
    RULE_DROP_STOPS,
    RULE_DROP_TARGET,
    RULE_PARK,
    RULE_PLAN_LENGTH,
    RULE_PLAN_ORDER,
    RULE_PLAN_WAITING,
    RULE_TAKE_ASSIGNED,
    RULE_TAKE_GOAL,
    RULE_TAKE_LOADED,
    RULE_TAKE_ORDER,
    RULE_TAKE_REACH,
    RULE_TAKE_RESERVED,
    RULE_TAKE_STARTED,
    RULE_TAKE_WAITING,
    RULE_TAKE_WEIGHT,
)
from automaton.engine.state import (
    BATTERY_FULL,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    KEEP,
    NEED_ALLOCATION,
    NEED_ROUTE,
    NIL,
    ORDER_WAITING,
    REASON_AROUND_ROBOTS,
    REASON_IDLE,
    REASON_NO_ORDER,
    REASON_ORDER_RETURNED,
    REASON_ORDER_TAKEN,
    REASON_REPLAN,
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
def is_access(world, goal_cell, slot):
    """Whether `slot` is served from `goal_cell`."""
    if goal_cell < 0 or slot < 0:
        return False
    for direction in range(4):
        if world.slots.access[slot, direction] == goal_cell:
            return True
    return False


@kernel
def reaches_loaded(world, i, goal_cell):
    """Whether robot i can drive to `goal_cell` and carry a load from or to it."""
    kind = with_load(world, np.int64(world.robots.type[i]))
    return world.slots.reachable[kind, goal_cell] != 0


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
            refuse(world, i, RULE_PARK, np.int64(command))
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
            refuse(world, i, RULE_ALLOCATION, np.int64(command))
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
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        count = np.int64(out.order_queue_length[i])
        if count == KEEP or not may_set_order_queue(world, batch, i):
            continue
        rule, value = plan_flaw(world, out, i, count)
        if rule != NIL:
            note_refusal(world, np.int64(robots.identity[i]), rule, value, 0)
            continue
        changed = count != robots.order_queue_length[i]
        robots.order_queue_length[i] = count
        for k in range(count):
            changed = changed or robots.order_queue[i, k] != out.order_queue[i, k]
            robots.order_queue[i, k] = out.order_queue[i, k]
        if changed:
            world.clock.revision += 1  # an idle robot is asked again


@kernel
def plan_flaw(world, out, i, count):
    """The rule that the plan of robot i breaks, or NIL, and a value."""
    if not 0 <= count <= world.robots.order_queue.shape[1]:
        return np.int64(RULE_PLAN_LENGTH), count
    for k in range(count):
        order = np.int64(out.order_queue[i, k])
        if not 0 <= order < world.orders.state.shape[0]:
            return np.int64(RULE_PLAN_ORDER), order
        if world.orders.state[order] != ORDER_WAITING:
            return np.int64(RULE_PLAN_WAITING), order
    return np.int64(NIL), np.int64(0)


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
def bar_to_taking(world, i, order, out):
    """The rule that keeps robot i from an order, or NIL: it waits, and is unreserved or may be taken
    from its robot.

    An order without a load may be taken from its robot until its first stop is begun, except within
    the batch that assigned it.
    """
    robots, orders = world.robots, world.orders
    if robots.load[i] != NIL:
        return RULE_TAKE_LOADED
    if order < 0 or order >= orders.state.shape[0]:
        return RULE_TAKE_ORDER
    if orders.state[order] != ORDER_WAITING:
        return RULE_TAKE_WAITING
    if has_started(world, i):
        return RULE_TAKE_STARTED
    if orders.weight[order] > world.rules.payload[robots.type[i]]:
        return RULE_TAKE_WEIGHT
    if not is_assigned(world, i, order):
        return RULE_TAKE_ASSIGNED
    if may_have(orders.reserved_by[order], robots.identity[i]):
        return NIL
    is_lost = not has_load(orders, order) and out.order_taken[order] != GIVEN
    return NIL if is_lost else RULE_TAKE_RESERVED


@kernel
def bar_to_goal(world, i, order, goal_cell):
    """The rule that keeps robot i from beginning an order in `goal_cell`, or NIL: this is its next
    stop, or an access cell of its pick-up."""
    if has_load(world.orders, order):
        if not is_access(world, goal_cell, np.int64(world.orders.current_slot[order])):
            return RULE_TAKE_GOAL
        return NIL if reaches_loaded(world, i, goal_cell) else RULE_TAKE_REACH
    if goal_cell != next_stop_cell(world, order):
        return RULE_TAKE_GOAL
    return NIL if world.slots.reachable[world.robots.type[i], goal_cell] else RULE_TAKE_REACH


@kernel
def take(world, record, i, order, goal_cell, out):
    """Reserve a waiting order for robot i and send it to the goal cell; a previous robot loses the
    order."""
    robots, orders = world.robots, world.orders
    bar = bar_to_taking(world, i, order, out)
    if bar != NIL:
        refuse(world, i, bar, order)
        return
    bar = bar_to_goal(world, i, order, goal_cell)
    if bar != NIL:
        refuse(world, i, bar, goal_cell)
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
    robots = world.robots
    bar = bar_to_dropping(world, i, slot, goal_cell)
    if bar != NIL:
        is_about_goal = bar == RULE_DROP_GOAL or bar == RULE_DROP_REACH
        refuse(world, i, bar, goal_cell if is_about_goal else slot)
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
def bar_to_dropping(world, i, slot, goal_cell):
    """The rule that keeps robot i from dropping its load at a slot, or NIL."""
    robots, slots = world.robots, world.slots
    if robots.load[i] == NIL:
        return RULE_DROP_EMPTY
    if slot < 0 or slot >= slots.cell.shape[0]:
        return RULE_DROP_SLOT
    if not is_access(world, goal_cell, slot):
        return RULE_DROP_GOAL
    if not reaches_loaded(world, i, goal_cell):
        return RULE_DROP_REACH
    if next_stop(world, np.int64(robots.load[i])) != NIL:
        return RULE_DROP_STOPS
    if has_trips(world) and world.pods.slot_class[slot] == NIL:
        return RULE_DROP_PLACE
    if slots.unbounded[slot]:  # a load may be dropped at any station, not only its target
        is_place = slot == world.orders.target[robots.load[i]] or world.stations.at[slot] != NIL
        return NIL if is_place else RULE_DROP_TARGET
    if slots.content[slot] != NIL:
        return RULE_DROP_FULL
    is_open = may_have(slots.reserved_by[slot], robots.identity[i])
    return NIL if is_open else RULE_DROP_RESERVED


@kernel
def commit_routing(world, batch, decisions):
    robots = world.robots
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        route_length = np.int64(decisions.routing.route_length[k])
        if route_length == KEEP:
            continue
        rule, value = route_flaw(world, i, decisions.routing.steps[k], route_length)
        if rule != NIL:
            refuse(world, i, rule, value)
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
            continue
        bar = bar_to_charging(world, i, goal_cell, charge_target)
        if bar == NIL:
            send_to_charger(
                world, record, i, goal_cell, charge_target, out.charging_interruptible[k]
            )
        else:
            refuse(world, i, bar, charge_target if bar == RULE_CHARGE_TARGET else goal_cell)


@kernel
def bar_to_charging(world, i, goal_cell, charge_target):
    """The rule that keeps robot i from charging in `goal_cell` up to `charge_target`, or NIL."""
    inside = 0 <= goal_cell < world.grid.cell_flags.shape[0]
    if not inside or world.rules.battery == 0 or world.chargers.charger_at[goal_cell] == NIL:
        return RULE_CHARGE_STOP if goal_cell == NIL else RULE_CHARGER
    if not world.slots.reachable[world.robots.type[i], goal_cell]:
        return RULE_CHARGER_REACH
    if world.robots.load[i] != NIL:
        return RULE_CHARGE_LOAD
    if has_started(world, i):
        return RULE_CHARGE_ORDER
    return NIL if 0 < charge_target <= BATTERY_FULL else RULE_CHARGE_TARGET


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
