"""How the decisions of a charging strategy enter the world."""

import numpy as np

from automaton.engine.energy import end_charging, offer_charger
from automaton.engine.jit.kernel import kernel
from automaton.engine.operations import refuse
from automaton.engine.requests import (
    clear_allocation_request,
    clear_route_request,
    drop_route,
    request_allocation,
    set_goal,
)
from automaton.engine.robot_status import BATTERY_FULL
from automaton.engine.state import (
    GOAL_CHARGE,
    KEEP,
    LAYER_CHARGING,
    NIL,
    REASON_IDLE,
    REASON_REPLAN,
)
from automaton.engine.visits import has_started, return_order


@kernel
def commit_charging(world, record, batch, decisions):
    """A robot that has neither a load nor begun an order may be sent to a charger, or away from it."""
    robots, out = world.robots, decisions.charging
    for k in range(batch.count[0]):
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
    """Whether `goal_cell` is a charger that robot i gets to."""
    inside = 0 <= goal_cell < world.grid.cell_flags.shape[0]
    if not inside or world.rules.battery == 0 or world.chargers.charger_at[goal_cell] == NIL:
        return False
    return world.slots.reachable[world.robots.type[i], goal_cell] != 0


@kernel
def send_to_charger(world, record, i, goal_cell, charge_target, charging_interruptible):
    """Robot i gives back what it has not begun, and goes to charge up to a level."""
    robots = world.robots
    if robots.order[i] != NIL:
        return_order(world, record, i)
    robots.charge_target[i] = charge_target
    robots.charging_interruptible[i] = 1 if charging_interruptible else 0
    if charging_interruptible:
        request_allocation(world, i, REASON_REPLAN)  # it may have an order while it charges
    else:
        clear_allocation_request(world, i)
    if robots.goal_type[i] != GOAL_CHARGE or robots.goal_cell[i] != goal_cell:
        if robots.goal_type[i] == GOAL_CHARGE:
            offer_charger(world, i)
        robots.ticket[i] = 0
        set_goal(world, i, GOAL_CHARGE, goal_cell)
