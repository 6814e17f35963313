"""A* with the Manhattan estimate: ignores robots at first, plans around them after a retreat.

Of several shortest paths the tie rule picks one; where robots slow each other down it matters which.
"""

import numpy as np

from automaton.engine.jit.structs import Struct, field
from automaton.engine.state import NIL
from automaton.strategy.kernels import find_path, kernel, position
from automaton.strategy.layer import Strategy
from strategies.routing.astar.astar import astar
from strategies.routing.astar.frontier import TIES
from strategies.routing.astar.route_workspace import RouteSpace, route_space
from strategies.routing.closed_cells import around_closed, around_what


class AStarState(Struct):
    """Parameters, and scratch; it remembers nothing."""

    tie_rule: int = field("int64", "an index of TIES")
    routes: RouteSpace


@kernel
def around_robots(view, workspace, i, reason, steps):
    """The length of a way around the other robots if a retreat is over, around closed cells after a
    long wait; NIL if neither, or if no way leads there."""
    around = around_what(reason)
    if around == 0:
        return NIL
    heading, goal_cell = np.int64(view.robots.heading[i]), np.int64(view.robots.goal_cell[i])
    robot_type = view.robots.type[i]
    return find_path(
        view, workspace, robot_type, position(view, i), heading, goal_cell, around, steps
    )


@kernel
def start_pose(view, i):
    """Where and how robot i stands when its route begins."""
    return position(view, i) * view.grid.headings + np.int64(view.robots.heading[i])


@kernel
def decide(view, batch, decisions, memory, workspace):
    seed, state = view.rules.seed, AStarState.of(memory)
    for k in range(batch.count[0]):
        i = np.int64(batch.robot[k])
        steps = decisions.routing.steps[k]
        length = around_robots(view, workspace, i, batch.reason[k], steps)
        if length == NIL:
            start, goal_cell = start_pose(view, i), np.int64(view.robots.goal_cell[i])
            robot_type = view.robots.type[i]
            duration = view.rules.duration[robot_type]
            length = astar(
                view.grid,
                robot_type,
                duration,
                state.routes,
                state.tie_rule,
                seed,
                start,
                goal_cell,
                False,
                steps,
            )
            length = around_closed(view, workspace, i, steps, length)
        if length != NIL:
            decisions.routing.route_length[k] = length


class AStar(Strategy):
    """A shortest path of A*; which one of several is settled by a tie rule."""

    layer = "routing"
    compiled = decide

    def reset(self, view):
        tie_rule = TIES.index(self.parameters.tie_break)
        return AStarState(tie_rule=tie_rule, routes=route_space(view.grid))
