"""Shortest paths with turn costs; they ignore robots at first, and avoid them after a retreat.

A route avoids a closed cell if the detour takes less time than waiting for it to open, or if the robot
has long waited in front of it.
"""

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    ACTION_TURN,
    AROUND_CLOSED,
    AROUND_KNOWN,
    AROUND_ROBOTS,
    NIL,
    REASON_AROUND_CLOSED,
    REASON_AROUND_ROBOTS,
    Strategy,
    closed_until,
    find_path,
    follow_gradient,
    has_gates,
    headings_of,
    kernel,
    position,
)
from strategies.routing.routing_parameters import ShortestRoutes


@kernel
def decide(view, batch, decisions, memory, workspace):
    robots = view.robots
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        robot_type, cell = robots.type[i], position(view, i)
        heading = np.int64(robots.heading[i])
        goal_cell = np.int64(robots.goal_cell[i])
        steps = decisions.routing.steps[k]
        length = NIL
        around = around_what(batch.reason[k])
        if around:
            length = find_path(view, workspace, robot_type, cell, heading, goal_cell, around, steps)
        if length == NIL:
            length = follow_gradient(view, workspace, robot_type, cell, heading, goal_cell, steps)
        if length != NIL:
            decisions.routing.route_length[k] = length


class Shortest(Strategy):
    """The fastest path in ticks, including turns."""

    layer = "routing"
    Parameters = ShortestRoutes
    compiled = decide


@kernel
def around_what(reason):
    """The obstacles that a route for this reason avoids; 0: none."""
    if reason == REASON_AROUND_ROBOTS:
        return AROUND_ROBOTS
    return AROUND_CLOSED if reason == REASON_AROUND_CLOSED else 0


@kernel
def around_closed(view, workspace, i, steps, length):
    """The length of robot i's route, replaced by one around closed cells if that is faster."""
    if length == NIL or not has_gates(view):
        return length
    waiting = ticks_of_route(view, i, steps, length, True)
    if waiting == ticks_of_route(view, i, steps, length, False):
        return length
    goal_cell, heading = np.int64(view.robots.goal_cell[i]), np.int64(view.robots.heading[i])
    other = workspace.steps
    robot_type, cell = view.robots.type[i], position(view, i)
    detour = find_path(view, workspace, robot_type, cell, heading, goal_cell, AROUND_KNOWN, other)
    if detour == NIL or ticks_of_route(view, i, other, detour, True) >= waiting:
        return length
    for k in range(detour):
        steps[k] = other[k]
    return detour


@kernel
def ticks_of_route(view, i, steps, length, waits):
    """The ticks of a route for robot i alone, with waits for cells to reopen if requested."""
    grid, duration = view.grid, view.rules.duration[view.robots.type[i]]
    cell, heading = position(view, i), np.int64(view.robots.heading[i])
    headings = headings_of(grid, view.robots.type[i])
    ticks, now = np.int64(0), view.clock.tick
    for k in range(length):
        direction = np.int64(steps[k])
        toward = direction & (headings - 1)
        if toward != heading:
            difference = (toward - heading) & (headings - 1)
            ticks += duration[ACTION_TURN] * (1 if difference == 3 else difference)
            heading = toward
        cell += grid.offset[direction]
        if waits:
            ticks = max(ticks, closed_until(view, cell, True) - now)
        ticks += duration[ACTION_MOVE]
    return ticks
