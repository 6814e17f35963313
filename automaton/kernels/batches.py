"""Who is asked: the batch of robots that concern a layer in this tick, sorted by identity."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.operations import first_cell, no_route_needed
from automaton.world.condition import RUNNING
from automaton.world.state import (
    ALLOCATION,
    CHANGES,
    CHARGING,
    CHARGING_AGAIN,
    FRESH_ALLOCATION,
    HOLD_ASK,
    KEEP,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_ROUTE,
    NEED_WAY,
    NEEDING_CHARGING,
    NEEDING_ROUTE,
    NEEDING_WAY,
    NEWS,
    NIL,
    PERIODIC,
    PHASE,
    PICKED,
    RIGHT_OF_WAY,
    ROUTING,
    SEEN_CHANGES,
    STUCK,
    TICK,
    UNQUEUED,
    WAKING,
    WITHDRAWING,
    ZONING,
)


@kernel
def is_due(world, layer):
    """Whether the layer's strategy asked for this tick."""
    every = world.rules.every[layer]
    return every > 0 and world.clock[TICK] % every == 0


@kernel
def append(asked, i, reason):
    k = asked.count[0]
    asked.robot[k] = i
    asked.reason[k] = reason
    asked.count[0] = k + 1


@kernel
def batch_everybody(world, asked, layer):
    """Zoning: all robots, when an order is in no queue yet or the tick is due; or those to be woken."""
    robots, clock = world.robots, world.clock
    asked.count[0] = 0
    everybody = is_due(world, layer)
    zoned = world.zoning.wake.shape[0] > 0
    if zoned and clock[UNQUEUED]:
        clock[UNQUEUED] = 0
        everybody = True
    if not everybody and not (zoned and 0 <= clock[WAKING] <= clock[TICK]):
        return False
    earliest = np.int64(NIL)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        wake = np.int64(world.zoning.wake[i]) if zoned else np.int64(NIL)
        due = wake != NIL and wake <= clock[TICK]
        if due:
            world.zoning.wake[i] = NIL
        elif wake != NIL and (earliest == NIL or wake < earliest):
            earliest = wake
        if everybody or due:
            append(asked, i, PERIODIC if due or not zoned else NEWS)
    clock[WAKING] = earliest
    world.tally.asked[layer] += 1
    return asked.count[0] > 0


@kernel
def batch_charging(world, asked):
    """Robots with a battery that are free, have taken an order, or were left without one.

    Once each, when they are not busy: the free ones before allocation, the others after it. On the
    ticks that the strategy asked for, all that are in order.
    """
    robots, clock = world.robots, world.clock
    asked.count[0] = 0
    due = clock[PHASE] != CHARGING_AGAIN and is_due(world, CHARGING)
    if clock[NEEDING_CHARGING] == 0 and not due:
        return False
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.need[i] & NEED_CHARGING and robots.busy[i] == 0 and robots.withdrawing[i] == 0:
            robots.need[i] &= np.uint8(255 - NEED_CHARGING)
            clock[NEEDING_CHARGING] -= 1
            append(asked, i, robots.charging_reason[i])
        elif due and robots.status[i] == RUNNING:
            append(asked, i, PERIODIC)
    if asked.count[0] == 0 and not due:
        return False
    world.tally.asked[CHARGING] += 1
    return True


@kernel
def batch_allocation(world, asked):
    """Robots that are free, have just picked, or gave their order back.

    One that was left idle is asked again when an order or a reservation has changed.
    """
    robots, clock = world.robots, world.clock
    asked.count[0] = 0
    due = is_due(world, ALLOCATION)
    if not due and clock[FRESH_ALLOCATION] == 0 and clock[CHANGES] == clock[SEEN_CHANGES]:
        return False
    clock[SEEN_CHANGES] = clock[CHANGES]
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        concerned = robots.need[i] & NEED_ALLOCATION and (
            robots.busy[i] == 0 or robots.reason[i] == PICKED
        )
        if concerned and robots.asked_at[i] != clock[CHANGES]:
            append(asked, i, robots.reason[i])
        elif due and robots.status[i] == RUNNING:
            append(asked, i, PERIODIC)
    if asked.count[0] == 0 and not due:
        return False
    world.tally.asked[ALLOCATION] += 1
    return True


@kernel
def is_on_its_way(world, i):
    """Whether robot i has a plan, whatever it does now, that can still be made anew."""
    robots = world.robots
    if robots.stand[i] == NIL or robots.need[i] & NEED_ROUTE or robots.withdrawing[i]:
        return False
    return robots.try_drop[i] == 0 and first_cell(robots, i) != robots.stand[i]


@kernel
def batch_routing(world, asked):
    """Robots with a new goal or a plan to be made anew, once they are free to drive.

    A strategy that asked for this tick gets all that are on their way too: PERIODIC.
    """
    robots, clock = world.robots, world.clock
    asked.count[0] = 0
    due = is_due(world, ROUTING)
    if clock[NEEDING_ROUTE] == 0 and not due:
        return False
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.need[i] & NEED_ROUTE and robots.busy[i] == 0:
            if robots.withdrawing[i] or robots.try_drop[i]:
                continue
            if robots.cell[i] == robots.stand[i] or (
                robots.parked[i] and robots.home[i] == robots.stand[i]
            ):
                no_route_needed(world, i)
            else:
                append(asked, i, robots.route_reason[i])
        elif due and is_on_its_way(world, i):
            append(asked, i, PERIODIC)
    if asked.count[0] == 0 and not due:
        return False
    world.tally.asked[ROUTING] += 1
    return True


@kernel
def batch_right_of_way(world, asked):
    """Robots whose retries are used up, and robots in a withdrawal: they ask for every step."""
    robots, clock = world.robots, world.clock
    asked.count[0] = 0
    due = is_due(world, RIGHT_OF_WAY)
    if clock[NEEDING_WAY] == 0 and not due:
        return False
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.busy[i]:
            continue
        if robots.need[i] & NEED_WAY:
            append(asked, i, STUCK if robots.hold[i] == HOLD_ASK else WITHDRAWING)
        elif due and robots.status[i] == RUNNING:
            append(asked, i, PERIODIC)
    if asked.count[0] == 0 and not due:
        return False
    world.tally.asked[RIGHT_OF_WAY] += 1
    return True


@kernel
def clear_answers(asked, answers, layer):
    """Every answer starts as KEEP."""
    n = asked.count[0]
    if layer == ALLOCATION:
        given = answers.allocation
        given.order_taken[:] = 0
        given.slot_taken[:] = 0
        given.planned[:] = KEEP
        for k in range(n):
            given.verb[k] = KEEP
            given.order[k] = NIL
            given.slot[k] = NIL
            given.stand[k] = NIL
            given.try_drop[k] = 0
            given.ask_again[k] = 0
    elif layer == ROUTING:
        for k in range(n):
            answers.routing.length[k] = KEEP
    elif layer == RIGHT_OF_WAY:
        for k in range(n):
            answers.right_of_way.verb[k] = KEEP
            answers.right_of_way.value[k] = 0
            answers.right_of_way.release[k] = 0
            answers.right_of_way.priority[k] = KEEP
    elif layer == ZONING:
        answers.zoning.redesigned[0] = 0
        answers.zoning.queued[0] = 0
        answers.zoning.refused[0] = 0
        answers.zoning.server[:] = KEEP
        for k in range(n):
            answers.zoning.zone[k] = KEEP
            answers.zoning.halt[k] = KEEP
            answers.zoning.again[k] = KEEP
            answers.zoning.tells[k] = 0
    else:
        for k in range(n):
            answers.charging.stand[k] = KEEP
            answers.charging.level[k] = 0
            answers.charging.yields[k] = 0
