"""Plans replayed ahead of time: the world's rule of slow zones, without anything else.

Each robot takes its steps as soon as it is free. A move takes as many times longer as its zone has
robots when it begins; no robot waits for a cell. Who leaves a parking bay is counted from the next
tick on. A robot whose plan has ended is counted for one more tick, then its next task is unknown;
one that has nothing to do stays.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import ACTION_DROP, ACTION_MOVE, ACTION_PICK, ACTION_TURN, NIL
from strategies.routing.congestion.known_plans import (
    DROPS,
    PICKS,
    has_task,
    plan_all,
    plan_on,
    zone_of,
)
from strategies.routing.congestion.zone_forecast import (
    COLUMNS,
    FREE,
    HEADING,
    HORIZON,
    IN_BAY,
    LINK,
    PLACE,
    STEP,
    STEPS,
    TRAVEL,
    ZONE,
    ZONES,
    enter_zone,
    present,
    words_of_zone,
)


@kernel
def forecast_all(view, workspace, memory):
    """Count all robots with the routes that they have, from now to the horizon."""
    plan_all(view, workspace, memory)
    horizon, zones = memory.parameters[HORIZON], memory.parameters[ZONES]
    first = zones * words_of_zone(memory)
    crowd = memory.shared[first : first + zones]
    calendar = memory.shared[first + zones : first + zones + horizon]
    robots = view.robots.cell.shape[0]
    for i in range(robots):
        row = memory.per_robot[i]
        if row[ZONE] != NIL:
            crowd[row[ZONE]] += 1
        if row[FREE] or has_task(view.robots, i):
            schedule(memory, calendar, i, row[FREE])
    for tick in range(horizon):
        go_on(view, memory, crowd, calendar, tick)
    for i in range(robots):
        enter_zone(memory, i, NIL, horizon)
    crowd[:] = 0


@kernel
def schedule(memory, calendar, i, tick):
    """Robot i begins its next step in a tick, unless that is beyond the horizon."""
    if tick < memory.parameters[HORIZON]:
        memory.per_robot[i, LINK] = calendar[tick]
        calendar[tick] = i + 1


@kernel
def go_on(view, memory, crowd, calendar, tick):
    """A tick of the replay: first all arrive, then all begin what comes next."""
    i = calendar[tick] - 1
    while i >= 0:
        arrive(view, memory, crowd, i, tick)
        i = memory.per_robot[i, LINK] - 1
    i = calendar[tick] - 1
    calendar[tick] = 0
    while i >= 0:
        following = memory.per_robot[i, LINK] - 1
        depart(view, memory, crowd, calendar, i, tick)
        i = following


@kernel
def arrive(view, memory, crowd, i, tick):
    """Robot i is where its last step took it; one that has gone past its last step is nowhere."""
    row = memory.per_robot[i]
    zone = NIL
    if row[STEP] <= row[STEPS] and row[IN_BAY] != 1:
        zone = zone_of(view.grid, row[PLACE], row[TRAVEL])
    if zone != row[ZONE]:
        if row[ZONE] != NIL:
            crowd[row[ZONE]] -= 1
        if zone != NIL:
            crowd[zone] += 1
        enter_zone(memory, i, zone, tick)


@kernel
def depart(view, memory, crowd, calendar, i, tick):
    """Robot i begins its next step, or goes past its last one."""
    row = memory.per_robot[i]
    while row[STEP] < row[STEPS]:
        ticks = row[IN_BAY] - 1
        if ticks <= 0:
            zone = zone_left(view, row)
            others = 0 if zone == NIL else crowd[zone] - (1 if zone == row[ZONE] else 0)
            ticks = ticks_of_step(view, i, row, others)
            if row[IN_BAY] and ticks > 1:
                row[IN_BAY] = ticks
                schedule(memory, calendar, i, tick + 1)
                return
        if ticks:
            row[IN_BAY] = 0
        begin_step(view, row)
        if ticks:
            schedule(memory, calendar, i, tick + ticks)
            return
    if row[STEP] == row[STEPS]:
        row[STEP] += 1
        schedule(memory, calendar, i, tick + 1)


@kernel
def zone_left(view, row):
    """The zone of the move that comes next, NIL if it is not a move."""
    step = row[COLUMNS + row[STEP]]
    return zone_of(view.grid, row[PLACE], step) if step < PICKS else NIL


@kernel
def ticks_of_step(view, i, row, others):
    """The ticks that the next step of robot i takes, beside `others` in its zone."""
    duration = view.rules.duration[view.robots.type[i]]
    step = row[COLUMNS + row[STEP]]
    if step >= PICKS:
        return np.int64(duration[ACTION_DROP if step == DROPS else ACTION_PICK])
    if step & (view.grid.headings - 1) != row[HEADING]:
        return np.int64(duration[ACTION_TURN])
    return ticks_of_move(view, i, others)


@kernel
def begin_step(view, row):
    """Begin the next step; before a move in another heading it is a turn."""
    headings = view.grid.headings
    step = row[COLUMNS + row[STEP]]
    heading = step & (headings - 1)
    if step < PICKS and heading != row[HEADING]:
        left = headings == 4 and (heading - row[HEADING]) & 3 == 3
        row[HEADING] = (row[HEADING] + (3 if left else 1)) & (headings - 1)
        return
    row[STEP] += 1
    if step < PICKS:
        row[PLACE] += view.grid.offset[step]
        row[TRAVEL] = step


@kernel
def ticks_of_move(view, i, others):
    """What a move of robot i takes beside so many others."""
    usual = np.int64(view.rules.duration[view.robots.type[i], ACTION_MOVE])
    return usual * (1 + (others if view.rules.slowdown else 0))


@kernel
def forecast_one(view, workspace, memory, i, steps, length):
    """Count robot i with a new route, slowed down by all who are counted; they keep their times."""
    plan_on(view, workspace, memory, i, steps, 0, length)
    row, horizon = memory.per_robot[i], memory.parameters[HORIZON]
    tick = row[FREE]
    while row[STEP] < row[STEPS] and tick < horizon:
        enter_zone(memory, i, zone_of(view.grid, row[PLACE], row[TRAVEL]), tick + row[IN_BAY])
        ticks = ticks_of_step(view, i, row, present(memory, zone_left(view, row), tick))
        if ticks:
            row[IN_BAY] = 0
        begin_step(view, row)
        tick += ticks
    if tick < horizon:
        enter_zone(memory, i, zone_of(view.grid, row[PLACE], row[TRAVEL]), tick)
    enter_zone(memory, i, NIL, min(tick + 1, horizon))
