"""The right of way through which actions from outside enter a run: what each action of a robot means,
and which are allowed.

    drive     0          1                                   2            3           4
    omni      stay       east                                south        west        north
    diff.     stay       forward                             turn left    turn right
    rail      stay       east, or south on a vertical axis   west, north  turn

With routes (`Guided`) two actions come first, `follow the route` and `wait a tick`, in place of stay.
In a parking bay action 1 leaves it. A robot that stays in its goal cell begins what it came for; with
`handling: action` it waits there, and a last action, `handle`, begins it.
"""

import base64
import zlib
from typing import Annotated, Any, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta

from automaton.strategy.api import (
    CMD_GO,
    CMD_HOLD,
    CMD_STEP,
    CMD_TURN,
    CMD_WAIT,
    CONSTANT,
    GOAL_NONE,
    GOAL_PARK,
    MAY_TURN,
    NEED_RIGHT_OF_WAY,
    NIL,
    STATUS_UP,
    Array,
    InputError,
    Strategy,
    Struct,
    field,
    headings_of,
    is_in_own_queue,
    kernel,
)

U = np.uint64  # unsigned index: spares the test for negative values

DRIVE_FREE: Final = 0  # drive: robots have no routes
DRIVE_GUIDED: Final = 1
HANDLE_SHIFT: Final = 1  # drive >> HANDLE_SHIFT: the action `handle`; 0: handling is automatic
ACT_STAY: Final = 0  # guided: follow the route
ACT_WAIT: Final = 1  # guided only
ACT_COUNTS: Final = 256  # besides the bits of allowed actions: its action will count
ACT_NONE: Final = -1


class EnteredActions(Struct):
    """The actions that enter next, n robots."""

    drive: int = field("int64", "FREE or GUIDED, and the action `handle`")
    are_checked: int = field("() int64", "1 = the driver has checked the actions")
    actions: Array = field("(n,) int32", "action of each robot, by identity")
    logged: Array = field("(t, n) int8", "actions of an episode, by tick", role=CONSTANT)


@kernel
def is_acting(view, i):
    """Whether an action of robot i counts: right of way is asked about it, and nothing else moves it."""
    robots = view.robots
    if robots.busy[U(i)] or robots.try_drop[U(i)]:
        return False
    if robots.status[U(i)] != STATUS_UP and robots.need[U(i)] & NEED_RIGHT_OF_WAY == 0:
        return False
    goal_type = robots.goal_type[U(i)]
    if robots.parked[U(i)]:
        return goal_type != GOAL_NONE and goal_type != GOAL_PARK
    return robots.cell[U(i)] != NIL and not is_in_own_queue(view, i)


@kernel
def allowed_actions(view, drive, i):
    """The allowed actions of robot i, as bits, and ACT_COUNTS; what other robots do does not matter."""
    robots = view.robots
    if not is_acting(view, i):
        return np.int64(1)
    handle = np.int64(ACT_COUNTS)
    if drive > DRIVE_GUIDED and is_at_goal(view, i):
        handle |= 1 << (drive >> HANDLE_SHIFT)
    if drive & DRIVE_GUIDED:
        return handle | (1 if robots.parked[U(i)] else 3 | allowed_moves(view, i) << 2)
    return handle | (3 if robots.cell[U(i)] == NIL else 1 | allowed_moves(view, i) << 1)


@kernel
def is_at_goal(view, i):
    """Whether robot i stands in its goal cell."""
    goal = view.robots.goal_cell[U(i)]
    return goal != NIL and goal == view.robots.cell[U(i)]


@kernel
def allowed_moves(view, i):
    """The moves and turns that the floor allows robot i, as bits, in the order of its actions."""
    robots = view.robots
    kind = U(robots.type[U(i)])
    flags = np.int64(view.grid.type_cell_flags[kind, U(robots.cell[U(i)])])
    headings, heading = headings_of(view.grid, kind), np.int64(robots.heading[U(i)])
    if headings == 1:
        return flags & 15
    ahead, turns = flags >> heading & 1, 1 if flags & MAY_TURN else 0
    if headings == 2:
        return ahead | (flags >> (heading + 2) & 1) << 1 | turns << 2
    return ahead | turns << 1 | turns << 2


@kernel
def checked_action(view, drive, i, action):
    """The action of robot i: 0 if it is not allowed, ACT_NONE if no action counts."""
    allowed = allowed_actions(view, drive, i)
    if allowed & ACT_COUNTS == 0:
        return np.int64(ACT_NONE)
    return action if 0 <= action < 8 and allowed >> action & 1 else np.int64(ACT_STAY)


@kernel
def enter_actions(view, batch, decisions, drive, actions, are_checked):
    """Turn the actions of the robots of a batch into commands.

    `actions`: (n,) by identity; `are_checked`: whether all are results of `checked_action`.
    """
    out, robots = decisions.right_of_way, view.robots
    for k in range(batch.count):
        i = np.int64(batch.robot[U(k)])
        action = np.int64(actions[U(robots.identity[U(i)])])
        if not are_checked:
            action = checked_action(view, drive, i, action)
        if action == ACT_NONE:
            continue
        handle, is_guided = drive >> HANDLE_SHIFT, drive & DRIVE_GUIDED
        if action == ACT_STAY:
            begins = handle == 0 and is_at_goal(view, i)
            if not is_guided and robots.goal_type[U(i)] != GOAL_NONE and not begins:
                out.command[U(k)], out.value[U(k)] = CMD_HOLD, NIL
            elif is_guided and handle and robots.parked[U(i)] == 0 and is_at_goal(view, i):
                # A parked robot may not wait: it begins at once.
                out.command[U(k)], out.value[U(k)] = CMD_WAIT, 1
        elif action == handle:
            continue
        elif is_guided and action == ACT_WAIT:
            out.command[U(k)], out.value[U(k)] = CMD_WAIT, 1
        elif robots.cell[U(i)] == NIL:
            out.command[U(k)], out.value[U(k)] = CMD_GO, 0
        else:
            enter_move(view, out, k, i, is_guided, action - 1 - is_guided)


@kernel
def enter_move(view, out, k, i, is_guided, move):
    """Decision k: a move or a turn of robot i, numbered from 0."""
    robots = view.robots
    headings, heading = headings_of(view.grid, robots.type[i]), np.int64(robots.heading[i])
    out.command[k] = CMD_STEP if is_guided else CMD_GO
    if headings == 1:
        out.value[k] = move
    elif move == 0:
        out.value[k] = heading
    elif headings == 2 and move == 1:
        out.value[k] = heading + 2
    else:
        out.command[k] = CMD_TURN
        out.value[k] = 3 if headings == 4 and move == 1 else 1


@kernel
def decide(view, batch, decisions, memory, workspace):
    state, tick = EnteredActions.of(memory), view.clock.tick
    if state.logged.shape[0]:
        for robot in range(state.actions.shape[0]):
            is_logged = tick < state.logged.shape[0]
            state.actions[robot] = state.logged[tick, robot] if is_logged else ACT_STAY
    enter_actions(view, batch, decisions, state.drive, state.actions, state.are_checked)


class ExternalParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A recording of an episode carries its actions."""

    actions: Annotated[
        str, Meta(description="actions of an episode by tick, as `Environment.save` writes them")
    ] = ""
    handling: Annotated[
        Literal["automatic", "action"], Meta(description="how robots begin tasks in goal cells")
    ] = "automatic"


def action_count(headings: Any, is_guided: bool) -> int:
    """The number of moves, turns and waits of a robot: that of the kinematics with the most.

    `headings`: that types of robots distinguish.
    """
    return (5 if (headings == 1).any() else 4) + is_guided


def text_of_actions(rows: Any) -> str:
    """The parameter `actions` for (t, n) int8."""
    return base64.b85encode(zlib.compress(rows.tobytes())).decode()


def actions_of_text(text: str, robots: int) -> Any:
    """(t, n) int8 from the parameter `actions`. Raises InputError."""
    try:
        values = np.frombuffer(zlib.decompress(base64.b85decode(text)), np.int8)
        return values.reshape(-1, robots)
    except (ValueError, zlib.error):
        raise InputError(f"actions is not a log of the actions of {robots} robots") from None


class External(Strategy):
    """Actions from outside move each robot: an environment's, or those of a program."""

    layer = "right_of_way"
    Parameters = ExternalParameters
    compiled = decide
    steers = True
    period = 1

    def reset(self, view):
        """Return the actions of a run: all `stay`, or those of its log."""
        robots, text = len(view.robots.cell), self.parameters.actions
        logged = actions_of_text(text, robots).copy() if text else np.zeros((0, robots), np.int8)
        drive = DRIVE_FREE if self.steers else DRIVE_GUIDED
        if self.parameters.handling == "action":
            drive |= action_count(view.grid.type_headings, not self.steers) << HANDLE_SHIFT
        return EnteredActions.sized({"n": robots}, drive=drive, logged=logged)


class Guided(External):
    """Robots follow their routes, and actions from outside let them wait, move or turn."""

    steers = False
