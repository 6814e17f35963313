"""Robots break down or run empty, are towed and return, or are repaired in place.

With an empty battery or a fault a robot goes down where it stands. It returns its orders; its load
becomes a waiting order in its cell, to be picked up from adjacent cells; a pod stays on it. It
holds its cell until it is towed; then its pod is put into storage. A robot that is not repaired is
removed for good. If broken robots are repaired in place, they keep orders and load, and continue
after the repair.
"""

import numpy as np

from automaton.engine.energy import end_charging
from automaton.engine.fulfilment import (
    complete_order,
    end_leg,
    leave_queue,
    reserve_order,
    reserve_slot,
    return_order,
)
from automaton.engine.holders import lane_of, mark_claim
from automaton.engine.jit.kernel import U, kernel
from automaton.engine.motion import direction_between, own_resource, put_pod_into, vacate
from automaton.engine.operations import (
    begin,
    clear_allocation_request,
    clear_right_of_way,
    clear_route_request,
    count_following,
    drive_on_with_load,
    drop_route,
    entry_heading,
    next_stop,
    note_delay,
    put_off,
    record_change,
    request_allocation,
    request_zoning,
    with_load,
)
from automaton.engine.random_numbers import (
    STREAM_BREAKDOWNS,
    STREAM_DELAY_COUNTS,
    STREAM_DELAY_TICKS,
    STREAM_DELAYS,
    STREAM_REPAIRS,
    chance_decides,
    random_between,
    random_bits,
)
from automaton.engine.record_codes import CHANGE_DELAYED, CHANGE_LOAD_LEFT, CHANGE_STATUS
from automaton.engine.search import begin_search, mark_goal, nearest_mark
from automaton.engine.state import (
    ACTION_DELAYED,
    ACTION_DOWN,
    ACTION_IDLE,
    FAILURE_DEPLETED,
    FAILURE_FAULT,
    FAILURE_TOWED,
    FOLLOWING_CONVOY,
    MAX_BUSY,
    NEED_CHARGING,
    NIL,
    NO_STEP,
    ORDER_WAITING,
    REASON_IDLE,
    REASON_PICKED,
    RETRY_NONE,
    STATUS_DEPLETED,
    STATUS_EXHAUSTED,
    STATUS_FAILED,
    STATUS_FAILING,
    STATUS_REMOVED,
    STATUS_TOWED,
    STATUS_UP,
)
from automaton.engine.trips import give_place_back, has_trips, offer, store_pod


@kernel
def break_down_and_repair(world, record, workspace):
    """At the start of a tick: robots are towed and return; others fail or run out of energy."""
    clock, faults = world.clock, world.rules.faults
    while clock.next_fault < faults.shape[0] and faults[clock.next_fault, 0] <= clock.tick:
        fail(world, np.int64(world.robots.at_index[faults[clock.next_fault, 1]]))
        clock.next_fault += 1
    if world.rules.breakdown and chance_decides(world):
        draw_faults(world)
    if clock.robots_down:
        tow_and_repair(world, record, workspace)
        take_all_out(world, record)


@kernel
def fail(world, i):
    """Robot i breaks down when its current operation ends."""
    if world.robots.status[i] == STATUS_UP:
        world.robots.status[i] = STATUS_FAILING
        world.clock.robots_down += 1


@kernel
def draw_faults(world):
    """Each robot on the floor fails with the scenario's probability."""
    robots, rules = world.robots, world.rules
    for i in range(robots.cell.shape[0]):
        if robots.cell[i] != NIL and robots.status[i] == STATUS_UP:
            identity = np.int64(robots.identity[i])
            bits = random_bits(
                rules.seed, STREAM_BREAKDOWNS, world.clock.coarse_tick, identity
            ) >> np.uint64(32)
            if np.int64(bits) < rules.breakdown:
                fail(world, i)


@kernel
def tow_and_repair(world, record, workspace):
    """Robots return, or are towed; a robot with a pod is towed once a cell for the pod is free."""
    robots, tick = world.robots, world.clock.tick
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        status = robots.status[i]
        if (
            status < STATUS_DEPLETED
            or robots.status_until[i] == NIL
            or tick < robots.status_until[i]
        ):
            continue
        if status == STATUS_FAILED and world.rules.repair_in_place.shape[0]:
            go_on_in_place(world, record, i)
        elif status == STATUS_TOWED:
            come_back(world, record, i)
        elif status != STATUS_REMOVED:
            carries_pod = has_trips(world) and robots.load[i] != NIL
            if not carries_pod or put_pod_aside(world, record, workspace, i):
                tow(world, record, i)


@kernel
def take_all_out(world, record):
    """Failing robots go down when their operation ends; exhausted robots go down."""
    robots = world.robots
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        status = robots.status[i]
        # A move that has begun is completed.
        is_between = robots.busy[i] != 0 and robots.claim[i] != NIL
        is_over = status == STATUS_EXHAUSTED and not is_between
        if is_over or (status == STATUS_FAILING and robots.busy[i] == 0):
            if status == STATUS_FAILING and world.rules.repair_in_place.shape[0]:
                stop_in_place(world, record, i)
            else:
                after = STATUS_DEPLETED if status == STATUS_EXHAUSTED else STATUS_FAILED
                take_out(world, record, i, after)
        if robots.status[i] == STATUS_FAILED and world.rules.repair_in_place.shape[0]:
            robots.busy[i] = 1  # motion counts it down in this tick
        if robots.status[i] == STATUS_DEPLETED or robots.status[i] == STATUS_FAILED:
            world.tally.ticks[i, ACTION_DOWN, 0] += world.rules.stride


@kernel
def stop_in_place(world, record, i):
    """Robot i is down until it is repaired in place; it keeps its orders and load."""
    robots, rules, tick = world.robots, world.rules, world.clock.tick
    become(world, record, i, STATUS_FAILED)
    entry = random_between(
        0,
        rules.repair_in_place.shape[0] - 1,
        rules.seed,
        STREAM_REPAIRS,
        world.clock.coarse_tick,
        np.int64(robots.identity[i]),
    )
    robots.status_until[i] = tick + rules.repair_in_place[entry]
    robots.action[i] = ACTION_DOWN
    world.tally.failures[i, FAILURE_FAULT] += 1
    world.tally.operations[i, ACTION_DOWN, 0] += 1


@kernel
def go_on_in_place(world, record, i):
    """Robot i works again, where it stands."""
    world.robots.status_until[i] = 0
    become(world, record, i, STATUS_UP)
    world.clock.robots_down -= 1
    world.tally.active[i] = world.clock.tick  # no wait of its own lasted until now


@kernel
def take_out(world, record, i, status):
    """Robot i is down: it returns its orders, and its load lies in its cell."""
    robots = world.robots
    become(world, record, i, status)
    return_orders(world, record, i)
    if robots.load[i] != NIL and robots.cell[i] != NIL and not has_trips(world):
        leave_load(world, record, i)
    world.tally.failures[i, FAILURE_DEPLETED if status == STATUS_DEPLETED else FAILURE_FAULT] += 1
    world.tally.operations[i, ACTION_DOWN, 0] += 1
    robots.action[i] = ACTION_DOWN
    after = world.rules.tow_after
    robots.status_until[i] = NIL if after == NIL else world.clock.tick + after
    world.clock.revision += 1
    if robots.cell[i] == NIL:
        tow(world, record, i)
    elif robots.parked[i]:
        robots.parked[i] = 0
        world.clock.unparked += 1


@kernel
def become(world, record, i, status):
    world.robots.status[i] = status
    request_zoning(world)
    record_change(world.clock, record, CHANGE_STATUS, world.robots.identity[i], status)


@kernel
def return_orders(world, record, i):
    """Robot i returns its orders and reserved slots; it has no goal, no route and no plan."""
    robots = world.robots
    if robots.order[i] != NIL and robots.load[i] == NIL:
        return_order(world, record, i)
    if robots.slot[i] != NIL:
        reserve_slot(world, record, np.int64(robots.slot[i]), NIL)
        robots.slot[i] = NIL
    end_charging(world, i)
    drop_route(robots, i)
    clear_route_request(world, i)
    clear_right_of_way(world, i)
    clear_allocation_request(world, i)
    if robots.need[i] & NEED_CHARGING:
        world.clock.needing_charging -= 1
    robots.need[i] = 0
    robots.retreat_moves[i] = 0
    robots.try_drop[i] = 0
    robots.failed_retries[i] = 0
    robots.retry_state[i] = RETRY_NONE
    robots.step[i] = NO_STEP
    robots.order_queue_length[i] = 0


@kernel
def leave_load(world, record, i):
    """The load of robot i waits in a spare slot in its cell; without one it stays on the robot."""
    robots, slots, orders = world.robots, world.slots, world.orders
    slot = spare_slot(slots)
    if slot == NIL or not open_slot(world, slot, np.int64(robots.cell[i])):
        return
    order = np.int64(robots.load[i])
    slots.content[slot] = order
    orders.current_slot[order] = slot
    orders.state[order] = ORDER_WAITING
    end_leg(world, i, order)
    put_off(world, i)
    robots.order[i] = NIL
    record_change(world.clock, record, CHANGE_LOAD_LEFT, robots.identity[i], slot)
    if world.service_zones.queue.shape[0]:  # zoning counts it at the station where it was picked up
        came_from = np.int64(world.service_zones.picked_from[order])
        world.service_zones.station_of[slot] = (
            NIL if came_from == NIL else world.service_zones.station_of[came_from]
        )
    leave_queue(world, order)
    reserve_order(world, record, order, NIL)


@kernel
def spare_slot(slots):
    """An unused spare slot, NIL if none."""
    for slot in range(slots.first_spare, slots.cell.shape[0]):
        if slots.cell[slot] == NIL:
            return slot
    return NIL


@kernel
def open_slot(world, slot, cell):
    """Put a spare slot into a cell; False if robots can reach no cell beside it."""
    slots = world.slots
    slots.accessible[:, slot] = 0
    served = False
    for direction in range(4):
        beside = cell + world.grid.offset[direction]
        usable = is_within(world, slot, beside)
        slots.access[slot, direction] = beside if usable else NIL
        served = served or usable
    if served:
        slots.cell[slot] = cell
        slots.unbounded[slot] = 0
    return served


@kernel
def is_within(world, slot, cell):
    """Whether robots of some type, with a load, can reach a cell and return; these serve the slot."""
    slots, found = world.slots, False
    for robot_type in range(slots.reachable.shape[0]):
        if slots.reachable[with_load(world, robot_type), cell]:
            slots.accessible[robot_type, slot] = 1
            found = True
    return found


@kernel
def tow(world, record, i):
    """Take robot i off the floor; it returns at its home, or never.

    If robots leave the floor where they finish, the home is the cell from which it was towed.
    """
    robots, rules = world.robots, world.rules
    if robots.cell[i] != NIL:
        vacate(world.traffic.occupancy, np.int64(robots.cell[i]), np.int64(robots.travel[i]))
        if rules.leave:
            robots.home[i] = robots.cell[i]
        robots.cell[i] = NIL
        heading = entry_heading(world.grid, robots.type[i], np.int64(robots.home[i]))
        robots.heading[i] = heading
        robots.travel[i] = heading
        world.tally.failures[i, FAILURE_TOWED] += 1
    if robots.parked[i] == 0:
        robots.parked[i] = 1
        world.clock.unparked -= 1
    robots.action[i] = ACTION_IDLE
    if rules.battery and rules.repair != NIL:
        charge_in_repair(world, i)
    become(world, record, i, STATUS_REMOVED if rules.repair == NIL else STATUS_TOWED)
    if rules.repair == NIL:
        world.clock.robots_down -= 1
        robots.status_until[i] = NIL
    else:
        robots.status_until[i] = world.clock.tick + rules.repair


@kernel
def charge_in_repair(world, i):
    """Set the charge with which robot i, which is being towed, will return."""
    robots, rules = world.robots, world.rules
    before = np.int64(robots.charge[i])
    after = np.int64(rules.repaired)
    if after == NIL:
        after = (
            max(before, np.int64(rules.reserve[robots.type[i]]))
            if robots.status[i] == STATUS_DEPLETED
            else before
        )
    robots.charge[i] = after
    world.tally.repaired[i] += max(after - before, 0)


@kernel
def come_back(world, record, i):
    """Robot i works again, off the floor at its home."""
    robots = world.robots
    robots.status_until[i] = 0
    become(world, record, i, STATUS_UP)
    world.clock.robots_down -= 1
    if robots.load[i] == NIL:
        request_allocation(world, i, REASON_IDLE)
    else:
        drive_on_with_load(world, i, REASON_PICKED)


# The pod of a towed robot is put into the nearest free storage cell.
#
# Its order waits there with its remaining stops, for any robot. An order without remaining stops is
# done, unless it names another cell.


@kernel
def put_pod_aside(world, record, workspace, i):
    """Store the pod of robot i, which is about to be towed; False: no cell is free."""
    robots, orders, trips = world.robots, world.orders, world.trips
    slot = nearest_storage(world, workspace, i)
    if slot == NIL:
        return False
    order, identity = np.int64(robots.load[i]), np.int64(robots.identity[i])
    cell = np.int64(world.slots.cell[slot])
    end_leg(world, i, order)
    put_off(world, i)
    robots.order[i] = NIL
    record_change(world.clock, record, CHANGE_LOAD_LEFT, identity, slot)
    put_pod_into(world.traffic.occupancy, cell)
    give_place_back(world, identity)
    orders.current_slot[order] = slot
    trips.begun[order] = orders.stops_done[order]  # an interrupted visit begins again
    stays = orders.target[order] == NIL or orders.target[order] == slot
    if stays and next_stop(world, order) == NIL:
        complete_order(world, order)
        store_pod(world, order, slot, True)
        reserve_order(world, record, order, NIL)
        return True
    orders.state[order] = ORDER_WAITING
    store_pod(world, order, slot, False)
    reserve_order(world, record, order, NIL)
    offer(world, record, order, cell)
    return True


@kernel
def nearest_storage(world, workspace, i):
    """The free slot that robot i with its pod reaches first; NIL: none is free.

    Ties go to the lowest number; if it can reach none, the lowest number counts too.
    """
    robots, slots = world.robots, world.slots
    robot_type = np.int64(robots.type[i])
    search = begin_search(workspace)
    for slot in range(slots.first_spare):
        if world.pods.slot_class[slot] == NIL or slots.content[slot] != NIL:
            continue
        if slots.reserved_by[slot] == NIL and slots.reachable[robot_type, slots.cell[slot]]:
            mark_goal(workspace, search, np.int64(slots.cell[slot]), slot)
    leave_out_held(world, workspace, i)
    cell, heading = np.int64(robots.cell[i]), np.int64(robots.heading[i])
    nearest = np.int64(nearest_mark(world, workspace, search, robot_type, cell, heading, False))
    slot = np.int64(0)
    while nearest == NIL and slot < slots.first_spare:
        if workspace.mark_stamp[slots.cell[slot]] == search:
            nearest = slot
        slot += 1
    return nearest


@kernel
def leave_out_held(world, workspace, i):
    """Exclude cells of other robots with a load; if robots do not drive under pods, of all other
    robots.

    Both the cell where a robot stands and the cell that it enters are excluded.
    """
    robots = world.robots
    for j in range(robots.cell.shape[0]):
        if j == i or robots.cell[j] == NIL or (robots.load[j] == NIL and world.rules.under):
            continue
        workspace.mark_stamp[robots.cell[j]] = NIL
        if robots.claim[j] != NIL:
            workspace.mark_stamp[robots.claim[j]] = NIL


# Delays: for some ticks robots begin nothing, and a move under way takes longer.
#
# As in the League of Robot Runners 2026. In the faults phase each working, undelayed robot on the
# floor begins a delay with a given probability; or a Poisson number of these robots do, those with
# the lowest hashes. A sum of Poisson numbers is a Poisson number: each robot adds one whose mean is
# the probability.
#
# Under convoy no move ends before the one ahead of it, so a delay in mid-move is passed on to the
# robots behind.


@kernel
def delay_robots(world, record):
    """Begin delays, and hold delayed robots; call after robots have gone down and returned."""
    robots, delays, tick = world.robots, world.delays, world.clock.tick
    draws = chance_decides(world)
    last_hash = find_last_hash(world) if delays.poisson and draws else np.uint64(0)
    lengthened = 0
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[U(identity)])
        if robots.cell[U(i)] == NIL or robots.status[U(i)] > STATUS_EXHAUSTED:
            delays.until[U(identity)] = 0
            continue
        if draws and delays.until[U(identity)] < tick:
            if begins_delay(world, identity, last_hash):
                lengthened += begin_delay(world, record, i)
        if delays.until[U(identity)] >= tick:
            delays.lasted[U(identity)] += world.rules.stride
            if robots.busy[U(i)] == 0:
                begin(world, i, ACTION_DELAYED, delays.until[U(identity)] - tick + 1)
    if lengthened and world.rules.following == FOLLOWING_CONVOY:
        hand_delays_on(world)


@kernel
def begins_delay(world, identity, last_hash):
    """Whether a robot that may begin a delay begins one."""
    bits = random_bits(world.rules.seed, STREAM_DELAYS, world.clock.coarse_tick, identity)
    if world.delays.poisson:
        return bits <= last_hash
    return np.int64(bits >> np.uint64(32)) < world.delays.probability


@kernel
def begin_delay(world, record, i):
    """Robot i is delayed from this tick on; returns 1 if its current move or turn takes longer,
    else 0."""
    robots, delays, tick = world.robots, world.delays, world.clock.tick
    identity, last = np.int64(robots.identity[i]), delays.ticks.shape[0] - 1
    drawn_in = world.clock.coarse_tick
    entry = random_between(0, last, world.rules.seed, STREAM_DELAY_TICKS, drawn_in, identity)
    busy = np.int64(robots.busy[i])
    ticks = min(np.int64(delays.ticks[entry]), MAX_BUSY - busy)
    delays.until[identity] = tick + ticks - 1
    record_change(world.clock, record, CHANGE_DELAYED, identity, ticks)
    if busy == 0 or delays.lengthens[robots.action[i]] == 0:
        return 0
    robots.busy[i] = busy + ticks
    world.traffic.own_ticks[i] = min(np.int64(world.traffic.own_ticks[i]) + ticks, MAX_BUSY)
    world.tally.ticks[i, robots.action[i], 1 if robots.load[i] != NIL else 0] += ticks
    note_delay(world, i, ticks)
    return 1


@kernel
def hand_delays_on(world):
    """Postpone the ends of moves behind delayed robots, in queues and rings of any length."""
    robots, until = world.robots, world.delays.until
    mark_claims(world, 1)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[U(identity)])
        if is_between_cells(robots, i) and until[U(identity)] >= world.clock.tick:
            put_off_end(world, i, 0)
            hand_on(world, i)
    mark_claims(world, 0)


@kernel
def mark_claims(world, value):
    """Enter the robots that move into cells (1), or remove them (0)."""
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        if is_between_cells(robots, i):
            mark_claim(world, i, robots.identity[U(i)] if value else NIL)


@kernel
def is_between_cells(robots, i):
    """Whether robot i is in a move of several ticks; a turn in a cell for two claims its own cell."""
    cell, claim = robots.cell[U(i)], robots.claim[U(i)]
    return cell != NIL and claim != NIL and claim != cell


@kernel
def hand_on(world, i):
    """Let the moves behind robot i end no sooner than its own."""
    robots = world.robots
    while True:
        cell, travel = np.int64(robots.cell[U(i)]), np.int64(robots.travel[U(i)])
        lane = lane_of(np.int64(world.grid.cell_flags[U(cell)]), travel)
        if lane == NIL or world.traffic.holder[U(cell), U(lane)] == NIL:
            return
        behind = np.int64(robots.at_index[U(world.traffic.holder[U(cell), U(lane)])])
        ticks = np.int64(robots.busy[U(i)]) - np.int64(robots.busy[U(behind)])
        if ticks <= 0:
            return
        put_off_end(world, behind, ticks)
        i = behind


@kernel
def put_off_end(world, i, ticks):
    """Postpone the end of the move of robot i by some ticks, which count as lost to following."""
    robots, traffic = world.robots, world.traffic
    robots.busy[U(i)] += np.uint16(ticks)
    if ticks:
        count_following(world, i, ticks)
    last = world.clock.tick + np.int64(robots.busy[U(i)]) - 1
    way = direction_between(world.grid, np.int64(robots.cell[U(i)]), np.int64(robots.claim[U(i)]))
    traffic.leaving[U(own_resource(robots, traffic, i))] = (last << 2) | way


@kernel
def find_last_hash(world):
    """The highest hash with which a robot begins a delay in this tick; 0: no delay."""
    robots, delays, rules = world.robots, world.delays, world.rules
    drawn_in, count, able = world.clock.coarse_tick, 0, 0
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[U(identity)])
        if robots.cell[U(i)] == NIL or robots.status[U(i)] > STATUS_EXHAUSTED:
            continue
        if delays.until[U(identity)] >= world.clock.tick:
            continue
        delays.hash[U(able)] = random_bits(rules.seed, STREAM_DELAYS, drawn_in, identity)
        able += 1
        bits = random_bits(rules.seed, STREAM_DELAY_COUNTS, drawn_in, identity) >> np.uint64(32)
        for k in range(delays.counts.shape[0]):
            count += np.int64(np.int64(bits) >= delays.counts[U(k)])
    return least_hash(delays.hash, able, min(count, able))


@kernel
def least_hash(hashes, able, count):
    """The `count`-th lowest of the first `able` hashes; 0 if `count` is 0."""
    result = np.uint64(0)
    if count == 0:
        return result
    for k in range(64):
        bit = np.uint64(1) << np.uint64(63 - k)
        below = result | (bit - np.uint64(1))
        within = 0
        for entry in range(able):
            within += np.int64(hashes[U(entry)] <= below)
        if within < count:
            result |= bit
    return result
