"""Robots that have come to where they do something: what steers them lets them; who may go on."""

from automaton.engine.state import ACTION_MOVE, FOLLOWING_CONVOY, GOAL_CHARGE, GOAL_NONE
from automaton.strategy.kernels import energy_cost, kernel


@kernel
def is_at_goal(view, i):
    """Whether robot i, which is free, begins in this tick what it came for."""
    robots = view.robots
    if robots.try_drop[i]:
        return True
    return robots.goal_type[i] != GOAL_NONE and robots.cell[i] == robots.goal_cell[i]


@kernel
def comes_to_charge(view, i, cell):
    """Return whether robot i would charge in a cell, into which it comes when the one there has gone."""
    if view.rules.battery == 0:
        return False
    return view.robots.goal_type[i] == GOAL_CHARGE and view.robots.goal_cell[i] == cell


@kernel
def lacks_charge(view, i):
    """Return whether the battery of robot i does not hold what a move takes."""
    if view.rules.battery == 0:
        return False
    ticks = view.rules.duration[view.robots.type[i], ACTION_MOVE]
    return view.robots.charge[i] < energy_cost(view, i, ACTION_MOVE, ticks)


def at_once_ticks(view):
    """Return the ticks of moves that are over when robots are asked again: all that follow go at once.

    In a convoy also a move of a coarse tick that is refined, so that refined fleets decide as before.
    """
    return int(view.rules.stride) if view.rules.following == FOLLOWING_CONVOY else 1
