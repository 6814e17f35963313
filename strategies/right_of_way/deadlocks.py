"""Deadlocks, where all else has failed: wait cycles, in which each robot waits for the next one.

Every LOOK coarse ticks those that have stood for long are looked at. In a wait cycle whose robots have
all stood for `patience` ticks more than the longest action of any of them, the robot whose goal is
newest, ties by identity, steps aside: it chooses before all others, any cell but the one for which it
waits, until it has left its own. If it finds no way out, it is the turn of the next one in the next
decision, and so on round the cycle.

Where robots move and yet none of those with work gets anything done, they keep each other from their
goals in turn. That is a stall: the strategies then try other orders of turns, one after another.
"""

import numpy as np

from automaton.engine.jit.structs import SCRATCH, STATIC, Struct, field
from automaton.engine.state import (
    ACTION_COUNT,
    CLOCK_COARSE_TICK,
    CLOCK_TICK,
    GOAL_DROP,
    GOAL_PICK,
    GOAL_STOP,
    NIL,
    Array,
)
from automaton.strategy.kernels import kernel, walk_to_cycle

STALLED = 4  # times the patience: nothing has been done for so long
LOOK = 16  # coarse ticks: strategies may decide in the first fine tick of each alone
COUNTERS = {"deadlocks_resolved": "deadlocks.resolved"}  # of strategies whose state has `deadlocks`


class Deadlocks(Struct):
    """What is known of robots that stand, n robots by storage."""

    patience: int = field("int64", "ticks that a wait cycle lasts before it is broken", role=STATIC)
    cell: Array = field("(n,) int32", "its cell at the last look", default=NIL)
    stood_since: Array = field("(n,) int64", "the tick of the look that first found it there")
    goal: Array = field("(n,) int32", "its goal cell at the last look", default=NIL)
    goal_since: Array = field("(n,) int64", "the tick of the look that first found that")
    aside: Array = field("(n,) uint8", "1 + the direction in which it must not go, or 0")
    aside_since: Array = field(
        "(n,) int64", "the tick since which it is to step aside, or last was"
    )
    tries: Array = field("(n,) int32", "how often it has been to do so in its cell")
    look_again: Array = field("(s,) int64", "1: in the next tick, one number")
    resolved: Array = field("(n,) int64", "deadlocks that it has broken")
    aim_type: Array = field("(n,) uint8", "what it was to do in the last decision")
    aim_cell: Array = field("(n,) int32", "and where", default=NIL)
    progress: Array = field("(s,) int64", "the coarse tick in which something was last done")
    first_choice: Array = field(
        "(n,) uint8", "1 + the direction of the cell for which it waits", role=SCRATCH
    )
    blocker: Array = field(
        "(n,) int32", "identity of the robot for which it waits, or NIL", default=NIL, role=SCRATCH
    )
    color: Array = field("(n,) int32", "in the search for cycles", role=SCRATCH)


@kernel
def is_time_to_look(view, deadlocks):
    """Return whether wait cycles are looked for in this tick; then note who has stood since when."""
    robots, tick = view.robots, view.clock[CLOCK_TICK]
    if view.clock[CLOCK_COARSE_TICK] % LOOK and deadlocks.look_again[0] == 0:
        return False
    deadlocks.look_again[0] = 0
    for i in range(robots.cell.shape[0]):
        deadlocks.blocker[i] = NIL
        deadlocks.color[i] = 0
        if robots.cell[i] != deadlocks.cell[i]:
            steps_aside(view, deadlocks, i)
            deadlocks.cell[i] = robots.cell[i]
            deadlocks.stood_since[i] = tick
            deadlocks.tries[i] = 0
            deadlocks.aside_since[i] = 0
        if robots.goal_cell[i] != deadlocks.goal[i]:
            deadlocks.goal[i] = robots.goal_cell[i]
            deadlocks.goal_since[i] = tick
    return True


@kernel
def has_stood_long(view, deadlocks, i):
    """Return whether robot i has stood for so long that it may be part of a deadlock."""
    age = view.clock[CLOCK_TICK] - deadlocks.stood_since[i]
    return view.robots.cell[i] != NIL and age >= deadlocks.patience


@kernel
def break_deadlocks(view, deadlocks):
    """Let one robot of each wait cycle that has lasted too long step aside; `blocker` is entered."""
    at_index = view.robots.at_index
    for identity in range(view.robots.cell.shape[0]):
        i = np.int64(at_index[identity])
        if deadlocks.blocker[i] == NIL or deadlocks.color[i]:
            continue
        member = walk_to_cycle(deadlocks.blocker, at_index, deadlocks.color, i)
        if member != NIL and has_lasted(view, deadlocks, member):
            let_step_aside(view, deadlocks, robot_to_step_aside(view, deadlocks, member))


@kernel
def has_lasted(view, deadlocks, first):
    """Return whether all robots of the wait cycle have stood for longer than any of their actions."""
    robots, i, longest, since = view.robots, first, np.int64(0), np.int64(0)
    while True:
        for action in range(ACTION_COUNT):
            longest = max(longest, np.int64(view.rules.duration[robots.type[i], action]))
        since = max(since, deadlocks.stood_since[i])
        i = np.int64(robots.at_index[deadlocks.blocker[i]])
        if i == first:
            return view.clock[CLOCK_TICK] - since >= deadlocks.patience + longest


@kernel
def robot_to_step_aside(view, deadlocks, first):
    """Return the robot of the wait cycle that has not tried for longest, or that of the newest goal."""
    robots, best, i = view.robots, first, first
    while True:
        if deadlocks.aside_since[i] != deadlocks.aside_since[best]:
            is_better = deadlocks.aside_since[i] < deadlocks.aside_since[best]
        elif deadlocks.goal_since[i] != deadlocks.goal_since[best]:
            is_better = deadlocks.goal_since[i] > deadlocks.goal_since[best]
        else:
            is_better = robots.identity[i] < robots.identity[best]
        best = i if is_better else best
        i = np.int64(robots.at_index[deadlocks.blocker[i]])
        if i == first:
            return best


@kernel
def let_step_aside(view, deadlocks, i):
    """Robot i chooses another cell in the next tick, and is looked at again; once all have, they rest."""
    if deadlocks.tries[i] == 0 or view.clock[CLOCK_COARSE_TICK] % LOOK == 0:
        deadlocks.tries[i] += 1
        deadlocks.aside[i] = deadlocks.first_choice[i]
        deadlocks.aside_since[i] = view.clock[CLOCK_TICK]
        deadlocks.look_again[0] = 1


@kernel
def is_given_up(view, deadlocks, i):
    """Return whether robot i has been to step aside for so long that it is the turn of another one."""
    return view.clock[CLOCK_TICK] - deadlocks.aside_since[i] > deadlocks.patience


@kernel
def steps_aside(view, deadlocks, i):
    """Return whether robot i, which was to step aside, has not done so yet; once it has, count it."""
    if deadlocks.aside[i] and view.robots.cell[i] != deadlocks.cell[i]:
        deadlocks.resolved[i] += 1
        deadlocks.aside[i] = 0
    return deadlocks.aside[i] != 0


@kernel
def has_work(goal_type):
    return goal_type == GOAL_PICK or goal_type == GOAL_DROP or goal_type == GOAL_STOP


@kernel
def note_progress(view, deadlocks):
    """Note whether a robot does its work, has done it, gets some after it had none, or none has any."""
    robots, is_quiet = view.robots, True
    for i in range(robots.cell.shape[0]):
        before, goal_type = deadlocks.aim_type[i], robots.goal_type[i]
        is_quiet = is_quiet and not has_work(goal_type)
        if robots.busy[i] and has_work(goal_type) and robots.cell[i] == robots.goal_cell[i]:
            deadlocks.progress[0] = view.clock[CLOCK_COARSE_TICK]
        if before == goal_type and deadlocks.aim_cell[i] == robots.goal_cell[i]:
            continue
        was_there = robots.cell[i] == deadlocks.aim_cell[i]
        if was_there if has_work(before) else has_work(goal_type):
            deadlocks.progress[0] = view.clock[CLOCK_COARSE_TICK]
        deadlocks.aim_type[i], deadlocks.aim_cell[i] = goal_type, robots.goal_cell[i]
    if is_quiet:
        deadlocks.progress[0] = view.clock[CLOCK_COARSE_TICK]


@kernel
def round_of_stall(view, deadlocks):
    """Return which order of turns is to be tried in a stall, from 1 on; 0: it is not one.

    Each is tried for two times the patience.
    """
    patience = deadlocks.patience // view.rules.refinement
    ticks = view.clock[CLOCK_COARSE_TICK] - deadlocks.progress[0] - STALLED * patience
    return max(ticks // (2 * patience) + 1, np.int64(0))
