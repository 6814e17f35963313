"""Robots that go out of order, are towed, and come back.

An empty battery or a fault takes a robot out where it stands. Its orders are given back; its load
becomes a waiting order in its cell, to be picked up from the cells beside it. It holds its cell
until it is towed; where nobody repairs robots, it is gone.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import BREAKDOWNS, draw
from automaton.kernels.energy import end_charging
from automaton.kernels.motion import vacate
from automaton.kernels.news import tell_zoning
from automaton.kernels.operations import (
    allocation_done,
    drop_route,
    entry_heading,
    leave_queue,
    need_allocation,
    no_route_needed,
    no_way_needed,
    note,
    reserve_order,
    reserve_slot,
)
from automaton.recording.codes import LEFT_LOAD, STATUS
from automaton.world.condition import (
    BROKE_DOWN,
    BROKEN,
    EMPTY,
    EXHAUSTED,
    FAILING,
    GONE,
    RAN_EMPTY,
    RUNNING,
    TOWED,
    WAS_TOWED,
)
from automaton.world.state import (
    CHANGES,
    FREE,
    HOLD_NONE,
    IDLE,
    NEED_CHARGING,
    NEEDING_CHARGING,
    NEXT_FAULT,
    NIL,
    NO_STEP,
    OUT,
    OUT_OF_ORDER,
    PICKED,
    TICK,
    UNPARKED,
    WAITING,
)


@kernel
def break_down_and_repair(world, record):
    """At the start of a tick: robots are towed and come back; others fail, or lack energy."""
    clock, faults = world.clock, world.rules.faults
    while clock[NEXT_FAULT] < faults.shape[0] and faults[clock[NEXT_FAULT], 0] <= clock[TICK]:
        fail(world, np.int64(world.robots.at_index[faults[clock[NEXT_FAULT], 1]]))
        clock[NEXT_FAULT] += 1
    if world.rules.breakdown:
        draw_faults(world)
    if clock[OUT]:
        tow_and_repair(world, record)
        take_all_out(world, record)


@kernel
def fail(world, i):
    """Robot i breaks down when what it does is over."""
    if world.robots.status[i] == RUNNING:
        world.robots.status[i] = FAILING
        world.clock[OUT] += 1


@kernel
def draw_faults(world):
    """Each robot on the floor fails with the scenario's probability."""
    robots, rules = world.robots, world.rules
    for i in range(robots.cell.shape[0]):
        if robots.cell[i] != NIL and robots.status[i] == RUNNING:
            identity = np.int64(robots.identity[i])
            bits = draw(rules.seed, BREAKDOWNS, world.clock[TICK], identity) >> np.uint64(32)
            if np.int64(bits) < rules.breakdown:
                fail(world, i)


@kernel
def tow_and_repair(world, record):
    robots, tick = world.robots, world.clock[TICK]
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        status = robots.status[i]
        if status < EMPTY or robots.until[i] == NIL or tick < robots.until[i]:
            continue
        if status == TOWED:
            come_back(world, record, i)
        elif status != GONE:
            tow(world, record, i)


@kernel
def take_all_out(world, record):
    """Robots that fail and whose operation is over, or that lacked energy, go out of order."""
    robots = world.robots
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        status = robots.status[i]
        if status == EXHAUSTED or (status == FAILING and robots.busy[i] == 0):
            take_out(world, record, i, EMPTY if status == EXHAUSTED else BROKEN)
        if robots.status[i] == EMPTY or robots.status[i] == BROKEN:
            world.tally.ticks[i, OUT_OF_ORDER, 0] += 1


@kernel
def take_out(world, record, i, status):
    """Robot i is out of order: what it had to do goes back, its load lies in its cell."""
    robots = world.robots
    become(world, record, i, status)
    give_up(world, record, i)
    if robots.load[i] != NIL and robots.cell[i] != NIL:
        leave_load(world, record, i)
    world.tally.out[i, RAN_EMPTY if status == EMPTY else BROKE_DOWN] += 1
    world.tally.times[i, OUT_OF_ORDER, 0] += 1
    robots.action[i] = OUT_OF_ORDER
    after = world.rules.tow_after
    robots.until[i] = NIL if after == NIL else world.clock[TICK] + after
    world.clock[CHANGES] += 1
    if robots.cell[i] == NIL:
        tow(world, record, i)
    elif robots.parked[i]:
        robots.parked[i] = 0
        world.clock[UNPARKED] += 1


@kernel
def become(world, record, i, status):
    world.robots.status[i] = status
    tell_zoning(world)
    note(world.clock, record, STATUS, world.robots.identity[i], status)


@kernel
def give_up(world, record, i):
    """Orders and slots of robot i go back; it has no goal, no route and no plan."""
    robots = world.robots
    if robots.order[i] != NIL and robots.load[i] == NIL:
        reserve_order(world, record, np.int64(robots.order[i]), NIL)
        robots.order[i] = NIL
    if robots.slot[i] != NIL:
        reserve_slot(world, record, np.int64(robots.slot[i]), NIL)
        robots.slot[i] = NIL
    end_charging(robots, i)
    drop_route(robots, i)
    no_route_needed(world, i)
    no_way_needed(world, i)
    allocation_done(world, i)
    if robots.need[i] & NEED_CHARGING:
        world.clock[NEEDING_CHARGING] -= 1
    robots.need[i] = 0
    robots.withdrawing[i] = 0
    robots.try_drop[i] = 0
    robots.blocked[i] = 0
    robots.hold[i] = HOLD_NONE
    robots.step[i] = NO_STEP
    robots.planned[i] = 0


@kernel
def leave_load(world, record, i):
    """The load of robot i waits in a spare slot in its cell; without one it stays on the robot."""
    robots, slots, orders = world.robots, world.slots, world.orders
    slot = spare_slot(slots)
    if slot == NIL or not open_slot(world, slot, np.int64(robots.cell[i])):
        return
    order = np.int64(robots.load[i])
    slots.content[slot] = order
    orders.place[order] = slot
    orders.state[order] = WAITING
    robots.load[i] = NIL
    robots.order[i] = NIL
    note(world.clock, record, LEFT_LOAD, robots.identity[i], slot)
    if world.zoning.queue.shape[0]:  # it counts to the station from where it came
        came_from = np.int64(world.zoning.leg[order])
        world.zoning.station_of[slot] = (
            NIL if came_from == NIL else world.zoning.station_of[came_from]
        )
    leave_queue(world, order)
    reserve_order(world, record, order, NIL)


@kernel
def spare_slot(slots):
    """A spare slot without a load, NIL if there is none."""
    for slot in range(slots.spare, slots.cell.shape[0]):
        if slots.cell[slot] == NIL:
            return slot
    return NIL


@kernel
def open_slot(world, slot, cell):
    """Put a spare slot into a cell; False if robots get to no cell beside it."""
    slots = world.slots
    slots.serves[:, slot] = 0
    served = False
    for direction in range(4):
        beside = cell + world.grid.offset[direction]
        usable = is_within(slots, slot, beside)
        slots.access[slot, direction] = beside if usable else NIL
        served = served or usable
    if served:
        slots.cell[slot] = cell
        slots.endless[slot] = 0
    return served


@kernel
def is_within(slots, slot, cell):
    """Whether robots of some type get to a cell and back; these serve the slot."""
    found = False
    for kind in range(slots.within.shape[0]):
        if slots.within[kind, cell]:
            slots.serves[kind, slot] = 1
            found = True
    return found


@kernel
def tow(world, record, i):
    """Robot i is taken off the floor; it comes back at its home, or never.

    The home of a robot that leaves the floor where it is done is where it was towed from.
    """
    robots, rules = world.robots, world.rules
    if robots.cell[i] != NIL:
        vacate(world.traffic.occupancy, np.int64(robots.cell[i]), np.int64(robots.travel[i]))
        if rules.leave:
            robots.home[i] = robots.cell[i]
        robots.cell[i] = NIL
        heading = entry_heading(world.grid, np.int64(robots.home[i]))
        robots.heading[i] = heading
        robots.travel[i] = heading
        world.tally.out[i, WAS_TOWED] += 1
    if robots.parked[i] == 0:
        robots.parked[i] = 1
        world.clock[UNPARKED] -= 1
    robots.action[i] = IDLE
    if rules.battery and rules.repair != NIL:
        charge_in_repair(world, i)
    become(world, record, i, GONE if rules.repair == NIL else TOWED)
    if rules.repair == NIL:
        world.clock[OUT] -= 1
        robots.until[i] = NIL
    else:
        robots.until[i] = world.clock[TICK] + rules.repair


@kernel
def charge_in_repair(world, i):
    """Robot i, which is being towed, gets the charge with which it will come back."""
    robots, rules = world.robots, world.rules
    before = np.int64(robots.charge[i])
    after = np.int64(rules.repaired)
    if after == NIL:
        after = max(before, np.int64(rules.reserve)) if robots.status[i] == EMPTY else before
    robots.charge[i] = after
    world.tally.repaired[i] += max(after - before, 0)


@kernel
def come_back(world, record, i):
    """Robot i is in order again, and off the floor at its home."""
    robots = world.robots
    robots.until[i] = 0
    become(world, record, i, RUNNING)
    world.clock[OUT] -= 1
    need_allocation(world, i, PICKED if robots.load[i] != NIL else FREE)
