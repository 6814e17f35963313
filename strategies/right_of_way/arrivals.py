"""Robots that have come to where they do something: what steers them lets them."""

from automaton.engine.state import GOAL_NONE
from automaton.strategy.kernels import kernel


@kernel
def is_at_goal(view, i):
    """Whether robot i, which is free, begins in this tick what it came for."""
    robots = view.robots
    if robots.try_drop[i]:
        return True
    return robots.goal_type[i] != GOAL_NONE and robots.cell[i] == robots.goal_cell[i]
