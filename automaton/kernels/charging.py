"""How the answers of a charging strategy enter the world."""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.energy import end_charging
from automaton.kernels.operations import (
    allocation_done,
    drop_route,
    need_allocation,
    no_route_needed,
    refuse,
    reserve_order,
    set_goal,
)
from automaton.world.cells import CHARGER
from automaton.world.condition import FULL
from automaton.world.state import CHARGING, FREE, GOAL_CHARGE, KEEP, NIL, REPLAN


@kernel
def commit_charging(world, record, asked, answers):
    """A robot without a load may be sent to a charger, or away from it."""
    robots, given = world.robots, answers.charging
    for k in range(asked.count[0]):
        stand, level = np.int64(given.stand[k]), np.int64(given.level[k])
        i = np.int64(asked.robot[k])
        if stand == KEEP:
            continue
        if stand == NIL and robots.goal[i] == GOAL_CHARGE:
            end_charging(robots, i)
            drop_route(robots, i)
            no_route_needed(world, i)
            need_allocation(world, i, FREE)
        elif is_charger(world, i, stand) and robots.load[i] == NIL and 0 < level <= FULL:
            send_to_charger(world, record, i, stand, level, given.yields[k])
        else:
            refuse(world, CHARGING, i)


@kernel
def is_charger(world, i, stand):
    """Whether `stand` is a charger that robot i gets to."""
    inside = 0 <= stand < world.grid.rule.shape[0]
    if not inside or world.rules.battery == 0 or world.grid.kind[stand] != CHARGER:
        return False
    return world.slots.within[world.robots.type[i], stand] != 0


@kernel
def send_to_charger(world, record, i, stand, level, yields):
    """Robot i gives back what it has not begun, and goes to charge up to a level."""
    robots = world.robots
    if robots.order[i] != NIL:
        reserve_order(world, record, np.int64(robots.order[i]), NIL)
        robots.order[i] = NIL
    robots.level[i] = level
    robots.yields[i] = 1 if yields else 0
    if yields:
        need_allocation(world, i, REPLAN)  # it may have an order while it charges
    else:
        allocation_done(world, i)
    if robots.goal[i] != GOAL_CHARGE or robots.stand[i] != stand:
        robots.ticket[i] = 0
        set_goal(world, i, GOAL_CHARGE, stand)
