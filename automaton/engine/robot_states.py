"""The states of a robot, derived from its fields: condition, task and motion.

A robot is in one state of each of three kinds, which change independently: its condition
(`robots.status`), its task, and its motion. docs/explanation/robot-states.md has the tables of
their transitions; a test checks them against runs. `robots` is the state's struct of arrays, or a
copy with fields of the same names.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np

from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_DROP,
    ACTION_HELD_BACK,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_SERVE,
    ACTION_TRY_DROP,
    ACTION_TURN,
    ACTION_WAIT,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    NIL,
    NO_STEP,
    RETRY_EXHAUSTED,
    RETRY_WAITED,
    STATUS_DEPLETED,
    Array,
)


class Task(IntEnum):
    """The task of a robot after a tick."""

    PARKED = 0  # in its parking bay, or off duty in its cell
    IDLE = 1  # on the floor without a goal
    TO_PICK = 2  # it drives to the pick-up of its order
    PICKING = 3
    HOLDING = 4  # it has picked up; allocation has not yet named the destination
    TRYING = 5  # it checks whether its load can be dropped
    TO_DROP = 6  # it drives to the drop-off of its load
    DROPPING = 7
    TO_CHARGER = 8
    QUEUEING = 9  # before a charger
    CHARGING = 10
    TO_PARK = 11  # it drives home
    OUT = 12  # down on the floor, or off it: see its condition
    TO_STOP = 13  # it drives to the next stop of its order
    AT_STOP = 14  # it is at the stop for as long as the stop takes


class Motion(IntEnum):
    """The motion of a robot after a tick."""

    STANDING = 0  # nothing to drive
    DRIVING = 1  # it moves or turns, or is about to
    WAITING = 2  # before a held cell, for a random time; then it tries again
    STUCK = 3  # its retries are used up: right of way decides
    RETREATING = 4
    HALTED = 5  # zoning halts it
    HELD_BACK = 6  # a steering right of way makes it wait on its way


def is_charging(robots: Any) -> Array:
    """Return (n,) bool: robots that charge. The action alone is not enough: it may be over."""
    at_charger = (robots.goal_type == GOAL_CHARGE) & (robots.cell == robots.goal_cell)
    out: Array = at_charger & (robots.action == ACTION_CHARGE)
    return out


def is_queueing(robots: Any) -> Array:
    """Return (n,) bool: robots that queue before a charger; a robot driving into the charger does
    not."""
    entering = (robots.claim == robots.goal_cell) | (robots.cell == robots.goal_cell)
    out: Array = (robots.ticket != 0) & ~entering
    return out


def tasks_of(robots: Any) -> Array:
    """Return (n,) int64: the Task of each robot. The first condition that holds decides."""
    busy, action, goal = robots.busy > 0, robots.action, robots.goal_type
    conditions = (
        (robots.status >= STATUS_DEPLETED, Task.OUT),
        ((robots.parked != 0) & (goal == GOAL_PICK), Task.TO_PICK),
        ((robots.parked != 0) & (goal == GOAL_STOP), Task.TO_STOP),
        ((robots.parked != 0) & (goal == GOAL_CHARGE), Task.TO_CHARGER),
        (robots.parked != 0, Task.PARKED),
        (busy & (action == ACTION_PICK), Task.PICKING),
        (busy & (action == ACTION_TRY_DROP), Task.TRYING),
        (busy & (action == ACTION_DROP), Task.DROPPING),
        (busy & (action == ACTION_SERVE), Task.AT_STOP),
        (goal == GOAL_PICK, Task.TO_PICK),
        (goal == GOAL_STOP, Task.TO_STOP),
        (goal == GOAL_DROP, Task.TO_DROP),
        (robots.load != NIL, Task.HOLDING),
        (is_charging(robots), Task.CHARGING),
        (is_queueing(robots), Task.QUEUEING),
        (goal == GOAL_CHARGE, Task.TO_CHARGER),
        (goal == GOAL_PARK, Task.TO_PARK),
    )
    out: Array = np.select(
        [holds for holds, _ in conditions], [task for _, task in conditions], Task.IDLE
    )
    return out


def motions_of(robots: Any, halted: Array, steered: bool = False) -> Array:
    """Return (n,) int64: the Motion of each robot; `halted`: (n,) bool, halted by zoning.

    `steered`: right of way steers, so robots on their way have no routes. The first condition that
    holds decides.
    """
    waits = (robots.busy > 0) & (robots.action == ACTION_WAIT)
    moves = (robots.busy > 0) & ((robots.action == ACTION_MOVE) | (robots.action == ACTION_TURN))
    to_drive = (robots.route_index < robots.route_length) | (robots.step != NO_STEP)
    steered_on = (robots.goal_type != GOAL_NONE) & (robots.cell != robots.goal_cell) & steered
    conditions = (
        ((robots.status >= STATUS_DEPLETED) | (robots.parked != 0), Motion.STANDING),
        (waits & halted, Motion.HALTED),
        (robots.retreat_moves > 0, Motion.RETREATING),
        (robots.retry_state == RETRY_EXHAUSTED, Motion.STUCK),
        (waits | (robots.retry_state == RETRY_WAITED), Motion.WAITING),
        (steered_on & (robots.action == ACTION_HELD_BACK), Motion.HELD_BACK),
        (moves | to_drive | steered_on, Motion.DRIVING),
    )
    out: Array = np.select(
        [holds for holds, _ in conditions], [motion for _, motion in conditions], Motion.STANDING
    )
    return out
