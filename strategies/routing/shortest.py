"""Shortest path with turn costs: ignores robots at first, plans around them after a retreat.

It does not avoid closed cells until a robot has long waited before one.
"""

import numpy as np

from automaton.engine.state import NIL
from automaton.strategy.kernels import find_path, follow_gradient, kernel, position
from automaton.strategy.layer import Strategy
from strategies.routing.closed_cells import around_what


@kernel
def decide(view, batch, decisions, memory, workspace):
    robots = view.robots
    for k in range(batch.count[0]):
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
    """The path of least ticks, turns included."""

    layer = "routing"
    compiled = decide
