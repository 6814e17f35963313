"""Operations: the sequences of D actions that a robot may do in its next D ticks.

    F go forward    R turn right    L turn left    W wait

Two sequences belong to one class if the robot is in the same cell after each action and ends with the
same heading: they meet the same robots. A plan is a class. After its first action, the rest of a plan
followed by a wait is also a class, so plans stay free of conflicts. New plans are chosen from the
candidates: the classes that do not end in a turn, without the full wait. Yukhnevich & Andreychuk,
AAAI-26.

    D            3    4    5
    classes     31   88  249
    candidates  16   47  135
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    ACTION_TURN,
    CONSTANT,
    FOLLOWING_CONVOY,
    FOLLOWING_NONE,
    NIL,
    NO_WAY_THROUGH,
    SCRATCH,
    Array,
    DistanceTables,
    Struct,
    field,
    kernel,
)
from strategies.right_of_way.right_of_way_parameters import horizon_of
from strategies.right_of_way.steering import (
    AGAINST_STREET,
    Deadlocks,
    ServiceAreas,
    at_once_ticks,
    guiding_tables,
    service_areas_of,
)

U = np.uint64  # unsigned as an index: avoids the test for negative values
FORWARD: Final = 0
RIGHT: Final = 1
LEFT: Final = 2
WAIT: Final = 3
ACTION_LETTERS: Final = "FRLW"
FULL_WAIT: Final = 0  # the class of the full wait
KEY_RANGE: Final = 4000  # costs of a plan in the unit of keys
DEAREST_WEIGHT: Final = 800  # of a move, in 1/100: larger ones make operations equally bad
NO_AIM = 4  # the aim of an operation that never moves
# Lattice cost of a tick along a street, relative to a tick until a goal is reached:
LATTICE_SCALE = 2
# Of two operations with equal costs the one with the larger weight is tried first. The weight is a sum
# over its actions, each times the number of remaining ticks.
WEIGHTS: Final = (10, -2, -2, -3)
VECTORS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1))  # of the headings east, south, west, north

Actions = tuple[int, ...]
Trace = tuple[tuple[tuple[int, int], ...], int]


class Operations(NamedTuple):
    """The classes of one depth, by ascending weight, beginning with the full wait."""

    actions: tuple[Actions, ...]  # one sequence of each class
    following: tuple[int, ...]  # the class of the rest of each after a tick
    candidates: tuple[int, ...]  # the classes from which plans are chosen

    @property
    def texts(self) -> list[str]:
        """The sequences as letters."""
        return ["".join(ACTION_LETTERS[action] for action in actions) for actions in self.actions]


def turned_by(heading: int, action: int) -> int:
    """Return the heading after a turn to the right or to the left."""
    return (heading + (1 if action == RIGHT else 3)) & 3


def trace(actions: Actions) -> Trace:
    """Return the cells after each action, from (0, 0) with the heading east, and the last heading."""
    x = y = heading = 0
    cells = []
    for action in actions:
        if action == FORWARD:
            x, y = x + VECTORS[heading][0], y + VECTORS[heading][1]
        elif action != WAIT:
            heading = turned_by(heading, action)
        cells.append((x, y))
    return tuple(cells), heading


def weight(actions: Actions) -> int:
    """Return the weight of an operation: high if it goes forward early and waits late."""
    ticks_left = range(len(actions), 0, -1)
    return sum(WEIGHTS[action] * left for action, left in zip(actions, ticks_left, strict=True))


def ends_in_turn(actions: Actions) -> bool:
    """Return whether the last heading differs from that of the last move, or else from the first one."""
    heading = moved = 0
    for action in actions:
        if action == FORWARD:
            moved = heading
        elif action != WAIT:
            heading = turned_by(heading, action)
    return heading != moved


@cache
def operations_of(depth: int) -> Operations:
    """Return the operations of this number of actions."""
    wait = (WAIT,) * depth
    others = (actions for actions in product(range(4), repeat=depth) if actions != wait)
    classes: dict[Trace, int] = {}
    sequences: list[Actions] = []
    for actions in (wait, *sorted(others, key=weight)):
        if trace(actions) not in classes:
            classes[trace(actions)] = len(sequences)
            sequences.append(actions)
    return Operations(
        tuple(sequences),
        tuple(classes[trace((*actions[1:], WAIT))] for actions in sequences),
        tuple(
            number
            for number, actions in enumerate(sequences)
            if number != FULL_WAIT and not ends_in_turn(actions)
        ),
    )


# The operations of EPIBT on a floor, the plans of robots, and scratch.
#
# n robots of K types, C cells with the border, P = 4 C poses (cell * 4 + heading). The operations of
# depth D have O classes and J candidates; W words of 64 bits hold one bit for each candidate. An end is
# a final cell and heading of candidates. There are B paces (ticks of a move and of a turn), Q = 4 B.
# Every operation ends within T ticks, including an action in progress; S: T, rounded up to a power of 2.


class EpibtState(Struct):
    """Parameters, operations on this floor, plans, and scratch of a tick."""

    ticks: int = field("int64", "T, planned ticks")
    reach: int = field("int64", "maximum cost of a path within a plan")
    holds_two: int = field("int64", "1: moves hold both cells in some ticks")
    holds_late: int = field("int64", "1: moves hold both cells in their last tick")
    slow_moves: int = field("int64", "1: moves take several ticks")
    takes_time: int = field("int64", "1: moves or turns take several ticks")
    has_storage: int = field("int64", "1: robots drive into storage, but not through it")
    oldest_first: int = field(
        "int64", "1: robots are ordered by age, 0: by distance to their goals"
    )
    guided: int = field("int64", "1: distances are from `tables`, 0: by streets, else ticks")
    streets: int = field("int64", "1: weights of streets are part of the costs")
    grain: int = field("int64", "unit of the costs in keys")
    rest_weight: int = field(
        "int64", "cost of a tick of driving after the goal in the order of robots; 0: none"
    )
    starved_after: int = field("int64", "age in ticks from which robots come first; NIL: never")
    drivers: int = field("int64", "number of robots that drive to their goals; NIL: all")
    repair_tries: int = field("int64", "tries per robot to improve the plans")
    visits_allowed: int = field("int64", "maximum pushes of a robot in a tick")
    max_pushes: int = field("int64", "pushes after which a chain is abandoned")
    repair_pushes: int = field("int64", "the same in repairs")
    tables: DistanceTables
    service_areas: ServiceAreas

    deadlocks: Deadlocks

    # Operations; h is their first heading.
    following: Array = field("(O,) int16", "the class of the rest after a tick", role=CONSTANT)
    action: Array = field("(O,) uint8", "the first action", role=CONSTANT)
    sequence_of: Array = field("(O, D) uint8", "the actions", role=CONSTANT)
    aim: Array = field(
        "(O,) uint8", "heading of the first move, relative to h, or NO_AIM", role=CONSTANT
    )
    pace: Array = field("(K,) uint8", "the pace b of a robot type", role=CONSTANT)
    offset: Array = field("(Q, O, T) int32", "[4 b + h]: cell after each tick", role=CONSTANT)
    left: Array = field(
        "(Q, O, T) int32",
        "[4 b + h]: the cell that is being left and still held, or the same",
        role=CONSTANT,
    )
    turned: Array = field("(O,) uint8", "last heading, relative to h", role=CONSTANT)
    candidate: Array = field("(J,) int16", "their classes, by end", role=CONSTANT)
    candidate_end: Array = field("(J,) uint8", "the end of each candidate", role=CONSTANT)
    open: Array = field(
        "(K, P, W) uint64", "candidates that exits allow, by type and pose", role=CONSTANT
    )

    is_pocket: Array = field("(C,) uint8", "1 = its only exit is its only entrance", role=CONSTANT)

    plan: Array = field("(n,) int16", "the plan of each robot: a class")
    expected_pose: Array = field(
        "(n,) int32",
        "1 + pose to which its action leads; 0: none; negative: the plan begins after it",
    )
    last_goal: Array = field("(n,) int32", "1 + goal cell in the last tick; 0: none")
    rest: Array = field("(n,) int64", "least cost of its order after its goal")
    rest_goal: Array = field("(n,) int32", "the goal cell of `rest`", default=NIL)
    rest_order: Array = field("(n,) int32", "the order of `rest`", default=NIL)
    idle_since: Array = field("(n,) int64", "tick in which it last finished a goal")

    # For this tick. A fixed robot stays where it is: busy, at its goal, or not on the floor.
    pose: Array = field(
        "(n,) int32", "its cell, or the one it is moving to; NIL: not on the floor", role=SCRATCH
    )
    row: Array = field("(n,) int32", "its row of `offset`", role=SCRATCH)
    delay: Array = field("(n,) int32", "ticks until a move or turn is over", role=SCRATCH)
    origin: Array = field("(n,) int32", "the cell that it still holds until then", role=SCRATCH)
    is_fixed: Array = field("(n,) uint8", "1 = it makes no plan", default=1, role=SCRATCH)
    occupied: Array = field(
        "(C, S) int32",
        "the robot in a cell after a number of ticks, or NIL",
        default=NIL,
        role=SCRATCH,
    )
    steered: Array = field("(n,) int32", "robots that plan, by identity", role=SCRATCH)
    asked: Array = field(
        "(n,) uint8", "1 = without a goal, and blocking another robot", role=SCRATCH
    )
    sequence: Array = field("(n,) int32", "the same, in planning order", role=SCRATCH)
    sequence_key: Array = field("(n,) int64", "key of this order; lowest first", role=SCRATCH)
    sorting: Array = field("(n,) int32", role=SCRATCH)
    sorting_count: Array = field("(2048,) int64", role=SCRATCH)
    goal: Array = field("(n,) int32", "its goal cell, or NIL", role=SCRATCH)
    table: Array = field("(n,) int32", "row of the distance table to that cell", role=SCRATCH)
    key: Array = field(
        "(n, J) int32", "candidates of a robot: cost << 8 | number, partly sorted", role=SCRATCH
    )
    key_count: Array = field("(n,) int32", "number of its open candidates", role=SCRATCH)
    sorted_count: Array = field("(n,) int32", "number of its sorted candidates", role=SCRATCH)
    cost: Array = field("(n,) int64", "cost of its plan", role=SCRATCH)
    power: Array = field("(n,) int64", "weight of its cost in repairs", role=SCRATCH)
    stamp: int = field("() int64", "number of this round of plans", role=SCRATCH)
    visit_stamp: Array = field("(n,) int64", "round in which it was last visited", role=SCRATCH)
    visits: Array = field("(n,) int32", "visits in that round", role=SCRATCH)
    settled: Array = field("(n,) int64", "round in which its plan was settled", role=SCRATCH)
    chain_robot: Array = field(
        "(n,) int32", "robots, each pushed by the previous one", role=SCRATCH
    )
    chain_tried: Array = field("(n,) int32", "number of candidates tried by each", role=SCRATCH)
    chain_plan: Array = field("(n,) int16", "the old plan of each", role=SCRATCH)
    chain_cost: Array = field("(n,) int64", "cost of the new plan of each", role=SCRATCH)


def epibt_state(view, parameters):
    """Return the state for a run, without plans."""
    grid, operations = view.grid, operations_of(parameters.depth)
    guided = parameters.guidance == "lattice"
    duration = np.asarray(view.rules.duration)[:, [ACTION_MOVE, ACTION_TURN]]
    paces, pace = np.unique(np.maximum(duration, 1), axis=0, return_inverse=True)
    following, holds_late = view.rules.following, int(view.rules.following == FOLLOWING_NONE)
    wait = int(view.rules.stride)
    at_once = at_once_ticks(view)
    ticks = horizon_of(parameters.depth, max(int(paces.max()), wait), wait)
    slow = [(move, turn, wait) for move, turn in paces.tolist()]
    offset, left = paths_of(grid.offset, operations, slow, ticks, holds_late)
    has_streets = len(grid.move_weight) > 0
    dearest = int(paces.max()) * (LATTICE_SCALE * AGAINST_STREET if guided else 1)
    if has_streets:
        dearest *= min(int(grid.move_weight.max()), DEAREST_WEIGHT)
    candidates, ends = candidates_by_end(operations)
    return EpibtState.sized(
        {
            "n": len(view.robots.cell),
            "C": len(grid.kind),
            "S": max(4, 1 << (ticks - 1).bit_length()),
        },
        ticks=ticks,
        reach=parameters.depth * dearest,
        holds_two=int(following != FOLLOWING_CONVOY and duration[:, 0].max() + holds_late > 1),
        holds_late=holds_late,
        slow_moves=int(duration[:, 0].max() > at_once),
        takes_time=int(paces.max() > at_once),
        has_storage=int((grid.type_cell_flags & NO_WAY_THROUGH).any()),
        oldest_first=int(parameters.first == "oldest"),
        rest_weight=int(parameters.first == "shortest") * (LATTICE_SCALE if guided else 1),
        starved_after=NIL if parameters.starved_after is None else parameters.starved_after,
        drivers=NIL if parameters.drivers is None else parameters.drivers,
        guided=int(guided),
        streets=int(has_streets),
        grain=max(1, -(-parameters.depth * dearest // KEY_RANGE)) if has_streets else 1,
        repair_tries=parameters.repair_tries,
        visits_allowed=parameters.visits,
        max_pushes=parameters.max_pushes,
        repair_pushes=parameters.repair_pushes,
        deadlocks=Deadlocks.sized(
            {"n": len(view.robots.cell), "s": 1}, patience=parameters.deadlock_patience
        ),
        service_areas=service_areas_of(view),
        tables=guiding_tables(view, guided, LATTICE_SCALE),
        following=list(operations.following),
        sequence_of=[list(actions) for actions in operations.actions],
        action=[actions[0] for actions in operations.actions],
        aim=[first_aim(actions) for actions in operations.actions],
        is_pocket=pockets_of(grid).astype(np.uint8).tolist(),
        pace=pace.reshape(-1).tolist(),
        offset=offset,
        left=left,
        turned=[trace(actions)[1] for actions in operations.actions],
        candidate=candidates,
        candidate_end=ends,
        open=open_candidates(grid, operations, candidates),
    )


def first_aim(actions):
    """Return the heading of an operation's first move, relative to its first heading, or NO_AIM."""
    heading = 0
    for action in actions:
        if action == FORWARD:
            return heading
        if action != WAIT:
            heading = turned_by(heading, action)
    return NO_AIM


def pockets_of(grid):
    """Return (C,) bool: pockets, cells whose only exit and only entrance is the same cell.

    Exits from storage into storage do not count, so storage beside a single aisle is a pocket.
    """
    flags = grid.type_cell_flags
    storage = (flags & NO_WAY_THROUGH != 0).any(axis=0)
    ways_on, ways_in, only_way = (np.zeros(len(storage), int) for _ in range(3))
    for direction, offset in enumerate(grid.offset.tolist()):
        leads = (flags[0] >> direction & 1).astype(bool) & ~(storage & np.roll(storage, -offset))
        comes = np.roll(leads, offset)
        ways_on += leads
        ways_in += comes
        only_way += leads & (np.roll(flags[0], -offset) >> (direction ^ 2) & 1).astype(bool)
    return (ways_on == 1) & (ways_in == 1) & (only_way == 1)


def candidates_by_end(operations):
    """Return (J,) the candidates, grouped by their end, and (J,) the number of each end."""
    ends: dict[tuple[Any, ...], list[int]] = {}
    for number in operations.candidates:
        cells, heading = trace(operations.actions[number])
        ends.setdefault((cells[-1], heading), []).append(number)
    numbers = [number for group in ends.values() for number in group]
    return numbers, [end for end, group in enumerate(ends.values()) for _ in group]


def open_candidates(grid, operations, candidates):
    """Return (K, P, W) the candidates that use only open exits, by type of robot and pose."""
    types, cells = grid.type_cell_flags.shape
    masks = np.zeros((types, 4 * cells, (len(candidates) + 63) // 64), np.uint64)
    for robot_type, flags in enumerate(grid.type_cell_flags):
        start = np.flatnonzero(flags & 15)
        for bit, number in enumerate(candidates):
            for first in range(4):
                is_open = cells_open(grid, flags, start, first, operations.actions[number])
                poses = start[is_open] * 4 + first
                masks[robot_type, poses, bit >> 6] |= np.uint64(1 << (bit & 63))
    return masks


def cells_open(grid, flags, start, heading, actions):
    """Return (starts,) bool: whether the exits allow all moves of an operation.

    If robots must not drive through storage, an operation cannot move on after a move into it.
    """
    storage = (grid.type_cell_flags & NO_WAY_THROUGH != 0).any(axis=0)
    cell, is_open, is_in = start.copy(), np.ones(len(start), bool), np.zeros(len(start), bool)
    for action in actions:
        if action == FORWARD:
            is_open &= (flags[cell] >> heading & 1).astype(bool) & ~is_in
            cell[is_open] += int(grid.offset[heading])
            is_in = storage[cell]
        elif action != WAIT:
            heading = turned_by(heading, action)
    return is_open


# The cells of operations tick by tick, if moves and turns take several ticks.
#
# During a move a robot holds the cell that it leaves and the cell that it enters, by the rule of
# following: under `none` to the end of the move; under `handover` only the new one in the last tick;
# under `convoy` only the new one from the first tick on, since another robot may follow at once. An
# action in progress ends before a plan begins, so a plan begins `delay` ticks from now, in the pose to
# which the action leads. A wait lasts until robots decide again, mostly one tick; a finished plan waits.


def paths_of(offsets, operations, paces, ticks, late):
    """Return two arrays (4 B, O, T): the cell after each tick, and the cell still held.

    Both are offsets, by pace and first heading. `paces`: (move, turn, wait) in ticks; `offsets`: of a
    move, by heading; `late`: 1 if the cell being left is held in the last tick, too.
    """
    shape = 4 * len(paces), len(operations.actions), ticks
    offset, left = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    for b, pace in enumerate(paces):
        for first in range(4):
            for number, actions in enumerate(operations.actions):
                here, held = path_of(offsets, actions, first, pace, late)
                rest = [here[-1]] * (ticks - len(here))
                offset[4 * b + first, number] = here + rest
                left[4 * b + first, number] = held + rest
    return offset, left


def path_of(offsets, actions, heading, pace, late):
    """Return the cells of one operation, and those still held, as lists of offsets by tick."""
    here, held, cell = [], [], 0
    move, turn, wait = pace
    for action in actions:
        before = cell
        if action == FORWARD:
            cell += int(offsets[heading])
        elif action != WAIT:
            heading = turned_by(heading, action)
        span = move if action == FORWARD else wait if action == WAIT else turn
        here += [cell] * span
        held += [before] * (span - 1 + late) + [cell] * (1 - late)
    return here, held


@kernel
def look_where_it_is(view, state, i):
    """Set pose, delay and origin of robot i, which stands, moves or turns."""
    robots = view.robots
    cell = np.int64(robots.cell[i])
    state.pose[i] = NIL
    state.delay[i] = 0
    state.origin[i] = cell
    if cell == NIL:
        return
    if robots.claim[i] != NIL or robots.action[i] == ACTION_TURN:
        state.delay[i] = min(np.int64(robots.busy[i]), state.ticks)
    if robots.claim[i] != NIL:
        cell = np.int64(robots.claim[i])
    heading = np.int64(robots.heading[i])
    state.row[i] = 4 * np.int64(state.pace[robots.type[i]]) + heading
    state.pose[i] = cell * 4 + heading


@kernel
def cell_after(state, i, operation, tick):
    """Return the cell of robot i after a tick of its next operation."""
    pose, done = np.int64(state.pose[U(i)]), tick - np.int64(state.delay[U(i)])
    if done < 0:
        return pose >> 2
    return (pose >> 2) + np.int64(state.offset[U(state.row[U(i)]), U(operation), U(done)])


@kernel
def cell_held(state, i, operation, tick):
    """Return the cell that robot i is leaving and still holds after a tick, else its own cell."""
    pose, done = np.int64(state.pose[i]), tick - np.int64(state.delay[i])
    if done < 0:
        return np.int64(state.origin[i]) if done + 1 < state.holds_late else pose >> 2
    return (pose >> 2) + np.int64(state.left[state.row[i], operation, done])


@kernel
def enter_path(state, i, robot):
    """Write `robot` (or NIL) into all cells of robot i's plan."""
    plan = np.int64(state.plan[U(i)])
    for tick in range(state.ticks):
        state.occupied[U(cell_after(state, i, plan, tick)), U(tick)] = robot
        if state.holds_two:
            state.occupied[cell_held(state, i, plan, tick), tick] = robot
