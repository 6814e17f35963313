"""A* with the Manhattan estimate: ignores robots at first, plans around them after a withdrawal.

Of several shortest paths the tie rule picks one; where robots slow each other down it matters which.
"""

import numpy as np

from automaton.strategy.kernels import TIES, astar, find_path, kernel, position
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.state import AROUND, NIL

RULE = 0  # memory.parameters: the tie rule, an index of TIES


@kernel
def around_robots(view, space, i, reason, steps):
    """The length of a way around the other robots if a withdrawal is over; NIL if not, or if none."""
    if reason != AROUND:
        return NIL
    heading, stand = np.int64(view.robots.heading[i]), np.int64(view.robots.stand[i])
    kind = view.robots.type[i]
    return find_path(view, space, kind, position(view, i), heading, stand, True, steps)


@kernel
def start_pose(view, i):
    """Where and how robot i stands when its route begins."""
    return position(view, i) * view.grid.headings + np.int64(view.robots.heading[i])


@kernel
def decide(view, asked, answers, memory, space):
    seed = view.rules.seed
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        steps = answers.routing.steps[k]
        length = around_robots(view, space, i, asked.reason[k], steps)
        if length == NIL:
            start, stand = start_pose(view, i), np.int64(view.robots.stand[i])
            rule, kind = memory.parameters[RULE], view.robots.type[i]
            duration = view.rules.duration[kind]
            length = astar(
                view.grid, kind, duration, space.routes, rule, seed, start, stand, False, steps
            )
        if length != NIL:
            answers.routing.length[k] = length


class AStar(Strategy):
    """A shortest path of A*; which one of several is settled by a tie rule."""

    layer = "routing"
    compiled = decide

    def reset(self, view):
        return memory_of(view, parameters=(TIES.index(self.parameters.ties),))
