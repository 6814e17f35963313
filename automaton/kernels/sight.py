"""What a robot sees: with limited sight a strategy is asked robot by robot, with masked copies.

rules.radius   NIL          everything: one call for the whole batch
               ORDER_LIST   the order list, and the neighbouring cells (the robot's bumper)
               r >= 1       the order list, and the robots within r cells (Chebyshev distance)

Hidden robots look like robots in no cell, with nothing to do; their cells look empty. Under a radius
a strategy gets its robot's own row of memory only, and no shared memory.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.motion import CLAIMS, RULE, U
from automaton.world.state import ACTIONS, NIL, NO_STEP


@kernel
def turns(world, batch):
    """How often a layer is called for a batch."""
    return 1 if world.rules.radius == NIL else batch.count[0]


@kernel
def take_turn(world, seen, batch, asked, memory, vault, turn):
    """Prepare call number `turn`: the robots asked, what they see, what they remember."""
    if world.rules.radius == NIL:
        asked.count[0] = batch.count[0]
        for k in range(batch.count[0]):
            asked.robot[k] = batch.robot[k]
            asked.reason[k] = batch.reason[k]
        return
    i = np.int64(batch.robot[turn])
    asked.count[0] = 1
    asked.robot[0] = i
    asked.reason[0] = batch.reason[turn]
    look(world, seen, i)
    if world.rules.radius > 0:
        for k in range(memory.own.shape[1]):
            memory.own[i, k] = vault.own[i, k]


@kernel
def end_turn(world, memory, vault, batch, turn):
    """Put the memory of the robot away."""
    if world.rules.radius > 0:
        i = np.int64(batch.robot[turn])
        for k in range(memory.own.shape[1]):
            vault.own[i, k] = memory.own[i, k]
            memory.own[i, k] = 0
        memory.shared[:] = 0


@kernel
def is_seen(world, i, j):
    """Whether robot i sees robot j."""
    if i == j:
        return True
    robots, width = world.robots, world.grid.width
    here = np.int64(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
    radius = max(world.rules.radius, 1)
    for place in (np.int64(robots.cell[j]), np.int64(robots.claim[j])):
        if place != NIL:
            across = abs(place % width - here % width)
            down = abs(place // width - here // width)
            if across <= radius and down <= radius:
                return True
    return False


@kernel
def look(world, seen, i):
    """Fill `seen` with what robot i sees now."""
    for j in range(world.robots.cell.shape[0]):
        forget_cell(world, seen, np.int64(seen.robots.cell[j]))
        forget_cell(world, seen, np.int64(seen.robots.claim[j]))
        hide(seen, j)
    for j in range(world.robots.cell.shape[0]):
        if is_seen(world, i, j):
            show(world, seen, j)
            show_cell(world, seen, np.int64(world.robots.cell[j]))
            show_cell(world, seen, np.int64(world.robots.claim[j]))
    for action in range(ACTIONS):
        for loaded in range(2):
            seen.tally.times[i, action, loaded] = world.tally.times[i, action, loaded]
            seen.tally.ticks[i, action, loaded] = world.tally.ticks[i, action, loaded]
    seen.tally.slowed[i] = world.tally.slowed[i]


@kernel
def forget_cell(world, seen, cell):
    """The cell looks empty."""
    if cell != NIL:
        rule = np.int64(world.grid.rule[U(cell)])
        seen.traffic.occupancy[U(cell)] = np.uint16((rule << RULE) | 96)  # room both ways


@kernel
def show_cell(world, seen, cell):
    if cell != NIL:
        word = np.int64(world.traffic.occupancy[U(cell)]) & ~CLAIMS
        seen.traffic.occupancy[U(cell)] = np.uint16(word)


@kernel
def hide(seen, j):
    r = seen.robots
    for array in (r.cell, r.claim, r.load, r.order, r.slot, r.stand, r.zone, r.home, r.bay):
        array[j] = NIL
    for array in (r.length, r.at, r.level, r.charge, r.planned):
        array[j] = 0
    for array in (r.heading, r.travel, r.action, r.goal, r.try_drop, r.blocked, r.hold):
        array[j] = 0
    for array in (r.parked, r.need, r.reason, r.route_reason, r.did, r.yields, r.status):
        array[j] = 0
    r.charging_reason[j] = 0
    r.until[j] = 0
    r.ticket[j] = 0
    r.busy[j] = 0
    r.priority[j] = 0
    r.withdrawing[j] = 0
    r.asked_at[j] = NIL
    r.route_sum[j] = 0
    r.step[j] = NO_STEP
    seen.tally.times[j] = 0
    seen.tally.ticks[j] = 0
    seen.tally.slowed[j] = 0


@kernel
def show(world, seen, j):
    a, b = seen.robots, world.robots
    a.cell[j] = b.cell[j]
    a.claim[j] = b.claim[j]
    a.heading[j] = b.heading[j]
    a.travel[j] = b.travel[j]
    a.action[j] = b.action[j]
    a.busy[j] = b.busy[j]
    a.priority[j] = b.priority[j]
    a.load[j] = b.load[j]
    a.order[j] = b.order[j]
    a.slot[j] = b.slot[j]
    a.goal[j] = b.goal[j]
    a.stand[j] = b.stand[j]
    a.level[j] = b.level[j]
    a.yields[j] = b.yields[j]
    a.charge[j] = b.charge[j]
    a.status[j] = b.status[j]
    a.until[j] = b.until[j]
    a.ticket[j] = b.ticket[j]
    a.planned[j] = b.planned[j]
    for k in range(b.planned[j]):
        a.plan[j, k] = b.plan[j, k]
    a.charging_reason[j] = b.charging_reason[j]
    a.try_drop[j] = b.try_drop[j]
    a.length[j] = b.length[j]
    a.at[j] = b.at[j]
    a.route_sum[j] = b.route_sum[j]
    a.withdrawing[j] = b.withdrawing[j]
    a.blocked[j] = b.blocked[j]
    a.hold[j] = b.hold[j]
    a.home[j] = b.home[j]
    a.bay[j] = b.bay[j]
    a.parked[j] = b.parked[j]
    a.zone[j] = b.zone[j]
    a.need[j] = b.need[j]
    a.reason[j] = b.reason[j]
    a.route_reason[j] = b.route_reason[j]
    a.asked_at[j] = b.asked_at[j]
    a.step[j] = b.step[j]
    a.did[j] = b.did[j]
    for k in range(b.length[j]):
        a.route[j, k] = b.route[j, k]
