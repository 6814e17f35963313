"""Batches: which robots a layer is asked about in this tick, in order of identity."""

import numpy as np
from numba import types

from automaton.engine.decisions import (
    AllocationDecisions,
    ChargingDecisions,
    Decisions,
    RightOfWayDecisions,
    RoutingDecisions,
    ZoningDecisions,
)
from automaton.engine.jit.field_kernels import clearing
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.struct_types import declared_type
from automaton.engine.operations import clear_route_request, first_cell
from automaton.engine.random_numbers import is_due
from automaton.engine.state import (
    LAYER_ALLOCATION,
    LAYER_CHARGING,
    LAYER_RIGHT_OF_WAY,
    LAYER_ROUTING,
    LAYER_ZONING,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    PHASE_CHARGING_AGAIN,
    REASON_PERIODIC,
    REASON_PICKED,
    REASON_RETREATING,
    REASON_RETRIES_EXHAUSTED,
    REASON_ZONE_EVENT,
    RETRY_EXHAUSTED,
    STATUS_EXHAUSTED,
    STATUS_UP,
    Batch,
    Memory,
    Workspace,
    World,
)


def decide_signature():
    """The types of the arguments of a strategy's `decide`."""
    shown = (declared_type(kind, writable=False) for kind in (World, Batch))
    return types.void(*shown, *(declared_type(kind) for kind in (Decisions, Memory, Workspace)))


@kernel
def append(batch, i, reason):
    k = batch.count
    batch.robot[k] = i
    batch.reason[k] = reason
    batch.count = k + 1


@kernel
def batch_all_robots(world, batch, layer):
    """Zoning: all robots if an order has no queue yet or the tick is due; else robots due to wake."""
    robots, clock = world.robots, world.clock
    batch.count = 0
    everybody = is_due(world, layer)
    zoned = world.service_zones.wake.shape[0] > 0
    if zoned and clock.unqueued_orders:
        clock.unqueued_orders = 0
        everybody = True
    if not everybody and not (zoned and 0 <= clock.next_wakeup <= clock.tick):
        return False
    earliest = np.int64(NIL)
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        wake = np.int64(world.service_zones.wake[i]) if zoned else np.int64(NIL)
        due = wake != NIL and wake <= clock.tick
        if due:
            world.service_zones.wake[i] = NIL
        elif wake != NIL and (earliest == NIL or wake < earliest):
            earliest = wake
        if everybody or due:
            append(batch, i, REASON_PERIODIC if due or not zoned else REASON_ZONE_EVENT)
    clock.next_wakeup = earliest
    world.tally.batches[layer] += 1
    return batch.count > 0


@kernel
def batch_charging(world, batch):
    """Robots with a battery that are free, took an order, or got no order.

    Each is asked about once, when it is not busy: free robots before allocation, the others after
    it. In periodic ticks of the strategy, the batch also has every robot that is up.
    """
    robots, clock = world.robots, world.clock
    batch.count = 0
    due = clock.phase != PHASE_CHARGING_AGAIN and is_due(world, LAYER_CHARGING)
    if clock.needing_charging == 0 and not due:
        return False
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.need[i] & NEED_CHARGING and robots.busy[i] == 0 and robots.retreat_moves[i] == 0:
            robots.need[i] &= np.uint8(255 - NEED_CHARGING)
            clock.needing_charging -= 1
            append(batch, i, robots.charging_reason[i])
        elif due and robots.status[i] == STATUS_UP:
            append(batch, i, REASON_PERIODIC)
    if batch.count == 0 and not due:
        return False
    world.tally.batches[LAYER_CHARGING] += 1
    return True


@kernel
def allocation_of(world, i):
    """The strategy that allocates orders to robot i."""
    return np.int64(world.rules.allocation[world.robots.type[i]])


@kernel
def may_set_order_queue(world, batch, i):
    """Whether the plan of robot i may be set now: only by its own strategy, and under limited sight
    only by its own decision."""
    if allocation_of(world, i) != batch.strategy:
        return False
    return world.rules.radius == NIL or batch.robot[0] == i


@kernel
def is_allocation_due(world):
    """Whether an allocation strategy asked for this tick."""
    for further in range(world.rules.allocations):
        if is_due(world, number_of_allocation(further)):
            return True
    return False


@kernel
def number_of_allocation(further):
    """The number of the first allocation strategy (0), or of a further one."""
    return np.int64(LAYER_RIGHT_OF_WAY + further if further else LAYER_ALLOCATION)


@kernel
def strategy_of_call(world, full_batch, layer, call):
    """The strategy asked in call number `call`: that of the layer, or one of several allocations."""
    if layer != LAYER_ALLOCATION or world.rules.allocations == 1:
        return np.int64(layer)
    if world.rules.radius != NIL:
        return allocation_of(world, np.int64(full_batch.robot[call]))
    return number_of_allocation(call)


@kernel
def batch_allocation(world, batch):
    """Robots that are free, have just picked up, or returned their order; grouped by strategy.

    An idle robot is asked again after an order or a reservation has changed.
    """
    clock = world.clock
    batch.count = 0
    due = is_allocation_due(world)
    if not due and clock.fresh_allocation == 0 and clock.revision == clock.allocation_revision:
        return False
    clock.allocation_revision = clock.revision
    for further in range(world.rules.allocations):
        append_concerned(world, batch, number_of_allocation(further))
    if batch.count == 0 and not due:
        return False
    world.tally.batches[LAYER_ALLOCATION] += 1
    return True


@kernel
def append_concerned(world, batch, strategy):
    """The robots about which an allocation strategy is asked, by identity."""
    robots, clock = world.robots, world.clock
    due, several = is_due(world, strategy), world.rules.allocations > 1
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if several and allocation_of(world, i) != strategy:
            continue
        concerned = robots.need[i] & NEED_ALLOCATION and (
            robots.busy[i] == 0
            or (robots.reason[i] == REASON_PICKED and robots.status[i] <= STATUS_EXHAUSTED)
        )
        if concerned and robots.seen_revision[i] != clock.revision:
            append(batch, i, robots.reason[i])
        elif due and robots.status[i] == STATUS_UP:
            append(batch, i, REASON_PERIODIC)


@kernel
def is_on_its_way(world, i):
    """Whether robot i has a plan that can still be replaced, whatever it does now."""
    robots = world.robots
    if robots.goal_cell[i] == NIL or robots.need[i] & NEED_ROUTE or robots.retreat_moves[i]:
        return False
    return robots.try_drop[i] == 0 and first_cell(robots, i) != robots.goal_cell[i]


@kernel
def batch_routing(world, batch):
    """Robots that are free to drive and have a new goal or need a new plan.

    In periodic ticks of the strategy, also all robots on their way: REASON_PERIODIC.
    """
    robots, clock = world.robots, world.clock
    batch.count = 0
    due = is_due(world, LAYER_ROUTING) and world.rules.steered[0] == 0
    if clock.needing_route == 0 and not due:
        return False
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.need[i] & NEED_ROUTE and robots.busy[i] == 0:
            if robots.retreat_moves[i] or robots.try_drop[i]:
                continue
            if robots.cell[i] == robots.goal_cell[i] or (
                robots.parked[i] and robots.home[i] == robots.goal_cell[i]
            ):
                clear_route_request(world, i)
            else:
                append(batch, i, robots.route_reason[i])
        elif due and is_on_its_way(world, i):
            append(batch, i, REASON_PERIODIC)
    if batch.count == 0 and not due:
        return False
    world.tally.batches[LAYER_ROUTING] += 1
    return True


@kernel
def batch_right_of_way(world, batch):
    """Robots without retries left, and robots in a retreat, which ask for every step."""
    robots, clock = world.robots, world.clock
    batch.count = 0
    due = is_due(world, LAYER_RIGHT_OF_WAY)
    if clock.needing_right_of_way == 0 and not due:
        return False
    for identity in range(robots.cell.shape[0]):
        i = np.int64(robots.at_index[identity])
        if robots.busy[i]:
            continue
        if robots.need[i] & NEED_RIGHT_OF_WAY:
            append(
                batch,
                i,
                REASON_RETRIES_EXHAUSTED
                if robots.retry_state[i] == RETRY_EXHAUSTED
                else REASON_RETREATING,
            )
        elif due and robots.status[i] == STATUS_UP:
            append(batch, i, REASON_PERIODIC)
    if batch.count == 0 and not due:
        return False
    world.tally.batches[LAYER_RIGHT_OF_WAY] += 1
    return True


clear_zoning, clear_charging = clearing(ZoningDecisions), clearing(ChargingDecisions)
clear_allocation, clear_routing = clearing(AllocationDecisions), clearing(RoutingDecisions)
clear_right_of_way = clearing(RightOfWayDecisions)


@kernel
def clear_decisions(batch, decisions, layer, known):
    """Reset all decisions to KEEP; `known`: orders that may be marked have lower numbers.

    A repeating task list has millions of orders, few of them released.
    """
    count = batch.count
    if layer == LAYER_ALLOCATION:
        clear_allocation(decisions.allocation, count)
        decisions.allocation.order_taken[:known] = 0
    elif layer == LAYER_ROUTING:
        clear_routing(decisions.routing, count)
    elif layer == LAYER_RIGHT_OF_WAY:
        clear_right_of_way(decisions.right_of_way, count)
    elif layer == LAYER_ZONING:
        clear_zoning(decisions.zoning, count)
    else:
        clear_charging(decisions.charging, count)
