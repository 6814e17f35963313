"""Shortest path with turn costs: ignores robots at first, plans around them after a withdrawal."""

import numpy as np

from automaton.strategy.kernels import descend, find_path, kernel, position
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.state import AROUND, NIL


@kernel
def decide(view, asked, answers, memory, space):
    robots = view.robots
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        kind, cell = robots.type[i], position(view, i)
        heading = np.int64(robots.heading[i])
        stand = np.int64(robots.stand[i])
        steps = answers.routing.steps[k]
        length = NIL
        if asked.reason[k] == AROUND:
            length = find_path(view, space, kind, cell, heading, stand, True, steps)
        if length == NIL:
            length = descend(view, space, kind, cell, heading, stand, steps)
        if length != NIL:
            answers.routing.length[k] = length


class Shortest(Strategy):
    """The path of least ticks, turns included."""

    layer = "routing"
    compiled = decide

    def reset(self, view):
        return memory_of(view)
