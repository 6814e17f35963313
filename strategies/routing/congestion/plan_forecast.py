"""Plans replayed ahead of time: the world's rule of slow zones, without anything else.

Each robot takes its steps as soon as it is free. A move takes as many times longer as its zone has
robots when it begins; no robot waits for a cell. Who leaves a parking bay is counted from the next
tick on. A robot whose plan has ended is counted for one more tick, then its next task is unknown;
one that has nothing to do stays.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import ACTION_DROP, ACTION_MOVE, ACTION_PICK, ACTION_TURN, NIL
from automaton.strategy.kernels import (
    heading_towards,
    headings_of,
    limited_ticks,
    with_load,
    without_load,
)
from strategies.routing.congestion.known_plans import (
    DROPS,
    PICKS,
    has_task,
    plan_all,
    plan_on,
    zone_of,
)
from strategies.routing.congestion.zone_forecast import enter_zone, present


@kernel
def forecast_all(view, workspace, state):
    """Count all robots with the routes that they have, from now to the horizon."""
    plan_all(view, workspace, state)
    robots = view.robots.cell.shape[0]
    for i in range(robots):
        if state.zone[i] != NIL:
            state.crowd[state.zone[i]] += 1
        if state.free[i] or has_task(view.robots, i):
            schedule(state, i, state.free[i])
    for tick in range(state.horizon):
        go_on(view, state, tick)
    for i in range(robots):
        enter_zone(state, i, NIL, state.horizon)
    state.crowd[:] = 0


@kernel
def schedule(state, i, tick):
    """Robot i begins its next step in a tick, unless that is beyond the horizon."""
    if tick < state.horizon:
        state.link[i] = state.calendar[tick]
        state.calendar[tick] = i + 1


@kernel
def go_on(view, state, tick):
    """A tick of the replay: first all arrive, then all begin what comes next."""
    i = state.calendar[tick] - 1
    while i >= 0:
        arrive(view, state, i, tick)
        i = state.link[i] - 1
    i = state.calendar[tick] - 1
    state.calendar[tick] = 0
    while i >= 0:
        following = state.link[i] - 1
        depart(view, state, i, tick)
        i = following


@kernel
def arrive(view, state, i, tick):
    """Robot i is where its last step took it; one that has gone past its last step is nowhere."""
    before, zone = state.zone[i], NIL
    if state.step[i] <= state.step_count[i] and state.in_bay[i] != 1:
        zone = zone_of(view.grid, state.place[i], state.travel[i])
    if zone != before:
        if before != NIL:
            state.crowd[before] -= 1
        if zone != NIL:
            state.crowd[zone] += 1
        enter_zone(state, i, zone, tick)


@kernel
def depart(view, state, i, tick):
    """Robot i begins its next step, or goes past its last one."""
    while state.step[i] < state.step_count[i]:
        ticks = state.in_bay[i] - 1
        if ticks <= 0:
            zone = zone_left(view, state, i)
            others = 0 if zone == NIL else state.crowd[zone] - (1 if zone == state.zone[i] else 0)
            ticks = ticks_of_step(view, state, i, others)
            if state.in_bay[i] and ticks > 1:
                state.in_bay[i] = ticks
                schedule(state, i, tick + 1)
                return
        if ticks:
            state.in_bay[i] = 0
        begin_step(view, state, i)
        if ticks:
            schedule(state, i, tick + ticks)
            return
    if state.step[i] == state.step_count[i]:
        state.step[i] += 1
        schedule(state, i, tick + 1)


@kernel
def next_step(state, i):
    """What robot i does next: a direction, PICKS or DROPS."""
    return np.int64(state.steps[i, state.step[i]])


@kernel
def zone_left(view, state, i):
    """The zone of the move that comes next, NIL if it is not a move."""
    step = next_step(state, i)
    return zone_of(view.grid, state.place[i], step) if step < PICKS else NIL


@kernel
def ticks_of_step(view, state, i, others):
    """The ticks that the next step of robot i takes, beside `others` in its zone."""
    duration = view.rules.duration[state.robot_type[i]]
    step = next_step(state, i)
    if step >= PICKS:
        return np.int64(duration[ACTION_DROP if step == DROPS else ACTION_PICK])
    if heading_towards(view.grid, state.robot_type[i], step) != state.heading[i]:
        return np.int64(duration[ACTION_TURN])
    own = limited_ticks(view.grid, np.int64(duration[ACTION_MOVE]), state.place[i], step)
    return ticks_of_move(view, own, others)


@kernel
def begin_step(view, state, i):
    """Begin the next step; before a move in another heading it is a turn."""
    headings = headings_of(view.grid, state.robot_type[i])
    step, before = next_step(state, i), state.heading[i]
    heading = step & (headings - 1)
    if step < PICKS and heading != before:
        left = headings == 4 and (heading - before) & 3 == 3
        state.heading[i] = (before + (3 if left else 1)) & (headings - 1)
        return
    state.step[i] += 1
    if step < PICKS:
        state.place[i] += view.grid.offset[step]
        state.travel[i] = step
    elif step == PICKS:
        state.robot_type[i] = with_load(view, state.robot_type[i])
    else:
        state.robot_type[i] = without_load(view, state.robot_type[i])


@kernel
def ticks_of_move(view, own, others):
    """What a move takes beside so many others, which takes `own` ticks alone."""
    return own * (1 + (others if view.rules.slowdown else 0))


@kernel
def forecast_one(view, workspace, state, i, steps, length):
    """Count robot i with a new route, slowed down by all who are counted; they keep their times."""
    plan_on(view, workspace, state, i, steps, 0, length)
    tick, horizon = state.free[i], state.horizon
    while state.step[i] < state.step_count[i] and tick < horizon:
        zone = zone_of(view.grid, state.place[i], state.travel[i])
        enter_zone(state, i, zone, tick + state.in_bay[i])
        ticks = ticks_of_step(view, state, i, present(state, zone_left(view, state, i), tick))
        if ticks:
            state.in_bay[i] = 0
        begin_step(view, state, i)
        tick += ticks
    if tick < horizon:
        enter_zone(state, i, zone_of(view.grid, state.place[i], state.travel[i]), tick)
    enter_zone(state, i, NIL, min(tick + 1, horizon))
