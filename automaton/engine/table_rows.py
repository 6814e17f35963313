"""Distance tables that are asked for, looked up, and replaced when their memory is needed.

They are computed when they are first asked for, and stay until their memory is needed. A clock hand
passes over them: it spares those looked at since it came by last, and never takes one that was asked
for with `keeps` in this tick. Contents decide nothing: a table that is gone is computed again.
"""

import numpy as np

from automaton.engine.cost_search import DELTA_BITS, find_costs
from automaton.engine.distance_tables import (
    FAR,
    FAR_PAIR,
    JOINT,
    POSE16,
    POSE32,
    SPLIT,
    STOP_NO_ROOM,
    TABLES_ENCODING,
    TABLES_HAND,
    TABLES_REFUSED,
    TABLES_ROWS,
    TABLES_TAKEN,
    TABLES_WORDS,
    UNREACHABLE,
)
from automaton.engine.jit.fields import NIL
from automaton.engine.jit.kernel import kernel


@kernel
def row_to(tables, cost_set, goal, tick, keeps):
    """The row of the table of a set of costs to a goal cell; NIL once tables.stop is set.

    It is computed if it is not there. With `keeps` it stays where it is for the rest of the tick;
    else it may be gone with the next row that is asked for. If the tick keeps more than there is room
    for, tables.stop is set to STOP_NO_ROOM.
    """
    cost_set, goal = np.int64(cost_set), np.int64(goal)
    row = np.int64(tables.row_of[cost_set * tables.number.shape[0] + goal])
    if row != NIL and keeps and row == tables.status[TABLES_ROWS] - 1:
        forget(tables, row)  # the last row is never kept
        row = np.int64(NIL)
    if row == NIL:
        row = add_row(tables, cost_set, goal, tick, keeps)
        if row == NIL:
            return row
    tables.used[row] = 1
    if keeps:
        tables.kept_in[row] = tick
    return row


@kernel
def known_row(tables, cost_set, goal):
    """The row of a table that is there, good until the next one is asked for; NIL: it is not."""
    row = np.int64(tables.row_of[np.int64(cost_set) * tables.number.shape[0] + goal])
    if row != NIL:
        tables.used[row] = 1
    return row


@kernel
def has_room_for(tables, more):
    """Whether so many more tables fit without one being replaced; True where all there can be do."""
    status, goals = tables.status, tables.entries.shape[0] * tables.drivable.shape[0]
    last = min(status[TABLES_ROWS] - 1, goals)
    return last == goals or status[TABLES_TAKEN] + more <= last


@kernel
def cost_in(tables, row, cell, heading):
    """What it costs from a pose to the goal cell of a row; UNREACHABLE: no way, or no row."""
    number = np.int64(tables.number[cell])
    if number < 0 or row < 0:
        return np.int64(UNREACHABLE)
    at = row * tables.status[TABLES_WORDS] + number
    if tables.status[TABLES_ENCODING] != JOINT:
        return wide_cost_in(tables, row, number, heading)
    word = np.int64(tables.pool[np.uint64(at)])
    if word == FAR:
        return np.int64(UNREACHABLE)
    least = (word * tables.reciprocal) >> 32
    pattern = word - least * tables.patterns
    return (least + np.int64(tables.excess[np.uint64((pattern << 2) + heading)])) * tables.unit


@kernel
def wide_cost_in(tables, row, number, heading):
    """The same in the other encodings, by the number of the cell."""
    begin = row * tables.status[TABLES_WORDS]
    encoding = tables.status[TABLES_ENCODING]
    if encoding == SPLIT:
        least = np.int64(tables.pool[np.uint64(begin + number)])
        if least == FAR:
            return np.int64(UNREACHABLE)
        pair = np.int64(tables.pool[np.uint64(begin + tables.drivable.shape[0] + (number >> 1))])
        pattern = (pair >> ((number & 1) << 3)) & 255
        return (least + np.int64(tables.excess[np.uint64((pattern << 2) + heading)])) * tables.unit
    pose = number * tables.headings + heading
    if encoding == POSE16:
        cost = np.int64(tables.pool[np.uint64(begin + pose)])
        return np.int64(UNREACHABLE) if cost == FAR else cost * tables.unit
    low = np.int64(tables.pool[np.uint64(begin + 2 * pose)])
    cost = low | (np.int64(tables.pool[np.uint64(begin + 2 * pose + 1)]) << 16)
    return np.int64(UNREACHABLE) if cost == FAR_PAIR else cost * tables.unit


@kernel
def add_row(tables, cost_set, goal, tick, keeps):
    """Compute a table that is not there; its row, or NIL if there is no room or the run is given up."""
    if tables.stop[0]:
        return np.int64(NIL)
    if tables.status[TABLES_WORDS] == 0:
        lay_out(tables, tables.first_encoding)
    row = free_row(tables, tick, keeps)
    while row != NIL:
        if not find_costs(tables, cost_set, goal):
            return np.int64(NIL)
        if write_row(tables, row):
            tables.owner[row] = cost_set * tables.number.shape[0] + goal
            tables.row_of[tables.owner[row]] = row
            return row
        row = free_row(tables, tick, keeps) if widen(tables, tick) else np.int64(NIL)
    if tables.stop[0] == 0:
        tables.stop[0] = STOP_NO_ROOM
        tables.status[TABLES_REFUSED] = 1
    return row


@kernel
def free_row(tables, tick, keeps):
    """A row that has no table, or no longer has one; NIL if all are kept in this tick.

    The last row is never kept, so that there always is one for a single look-up.
    """
    status = tables.status
    last = status[TABLES_ROWS] - 1
    if status[TABLES_TAKEN] < last:
        status[TABLES_TAKEN] += 1
        return status[TABLES_TAKEN] - 1
    for _ in range(2 * last):
        row = status[TABLES_HAND]
        status[TABLES_HAND] = row + 1 if row + 1 < last else 0
        if tables.kept_in[row] == tick:
            continue
        if tables.used[row]:
            tables.used[row] = 0
            continue
        forget(tables, row)
        return row
    if keeps or last < 0:
        return np.int64(NIL)
    forget(tables, last)
    return last


@kernel
def forget(tables, row):
    """Take the table out of a row."""
    if tables.owner[row] != NIL:
        tables.row_of[tables.owner[row]] = NIL
        tables.owner[row] = NIL


@kernel
def lay_out(tables, encoding):
    """Divide the pool into rows of this encoding."""
    cells, headings = tables.drivable.shape[0], tables.headings
    words = np.int64(cells)
    if encoding == SPLIT:
        words = cells + ((cells + 1) >> 1)
    elif encoding == POSE16:
        words = cells * headings
    elif encoding == POSE32:
        words = 2 * cells * headings
    status = tables.status
    status[TABLES_ENCODING] = encoding
    status[TABLES_WORDS] = words
    status[TABLES_ROWS] = min(np.int64(tables.owner.shape[0]), tables.pool.shape[0] // words)
    status[TABLES_HAND] = 0


@kernel
def widen(tables, tick):
    """Go on to a wider encoding, with the rows that are kept in this tick; False if they do not fit."""
    status = tables.status
    wider = SPLIT if status[TABLES_ENCODING] == JOINT else POSE32
    lay_out(tables, wider)
    taken = status[TABLES_TAKEN]
    status[TABLES_TAKEN] = min(taken, max(status[TABLES_ROWS] - 1, 0))
    cells = tables.number.shape[0]
    for row in range(tables.owner.shape[0]):
        entry = np.int64(tables.owner[row])
        if entry == NIL:
            continue
        if tables.kept_in[row] != tick:
            forget(tables, row)
            continue
        if row >= status[TABLES_TAKEN] or not find_costs(tables, entry // cells, entry % cells):
            return False
        write_row(tables, row)  # what fits the narrower encoding fits the wider one
    return True


@kernel
def write_row(tables, row):
    """Write what a search has found into a row; False if it does not fit the encoding."""
    encoding = tables.status[TABLES_ENCODING]
    begin = row * tables.status[TABLES_WORDS]
    if encoding == JOINT:
        return write_joint(tables, begin)
    if encoding == SPLIT:
        return write_split(tables, begin)
    return write_poses(tables, begin, encoding)


@kernel
def write_joint(tables, begin):
    fits = True
    for number in range(tables.drivable.shape[0]):
        cell = np.uint64(tables.drivable[np.uint64(number)])
        word = np.int64(FAR)
        if tables.reached[cell]:
            pattern = np.int64(tables.pattern_of[np.uint64(tables.turns[cell])])
            word = np.int64(tables.least[cell]) * tables.patterns + pattern
            fits &= word < FAR
        tables.pool[np.uint64(begin + number)] = word
    return fits


@kernel
def write_split(tables, begin):
    cells = tables.drivable.shape[0]
    for number in range(cells):
        cell = np.uint64(tables.drivable[number])
        word, pattern = np.int64(FAR), np.int64(0)
        if tables.reached[cell]:
            word = np.int64(tables.least[cell])
            pattern = np.int64(tables.pattern_of[np.uint64(tables.turns[cell])])
            if word >= FAR:
                return False
        tables.pool[np.uint64(begin + number)] = word
        pair = np.uint64(begin + cells + (number >> 1))
        if number & 1:
            tables.pool[pair] = np.int64(tables.pool[pair]) | (pattern << 8)
        else:
            tables.pool[pair] = pattern
    return True


@kernel
def write_poses(tables, begin, encoding):
    """POSE16 and POSE32; from narrow costs, too."""
    headings = tables.headings
    for number in range(tables.drivable.shape[0]):
        cell = np.int64(tables.drivable[number])
        for heading in range(headings):
            cost = np.int64(FAR_PAIR)
            if (np.int64(tables.reached[cell]) >> heading) & 1:
                if tables.is_narrow:
                    delta = (np.int64(tables.turns[cell]) >> (DELTA_BITS * heading)) & 7
                    cost = np.int64(tables.least[cell]) + delta
                else:
                    cost = np.int64(tables.costs[cell * headings + heading])
                if encoding == POSE16 and cost >= FAR:
                    return False
            at = begin + number * headings + heading
            if encoding == POSE16:
                tables.pool[np.uint64(at)] = cost & FAR
            else:
                tables.pool[np.uint64(2 * at - begin)] = cost & FAR
                tables.pool[np.uint64(2 * at - begin + 1)] = cost >> 16
    return True
