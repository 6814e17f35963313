"""Distance tables: requested, looked up, and replaced when their memory is needed.

They are computed at the first request and stay until their memory is needed (clock replacement).
The clock hand skips tables used since its last pass, and never replaces a table requested with
`keeps` in this tick. Results do not depend on which tables are present: a missing table is
recomputed.
"""

import numpy as np

from automaton.engine.distance_tables import (
    FAR_PAIR,
    FAR_WORD,
    JOINT,
    POSE16,
    POSE32,
    SPLIT,
    STOP_NO_ROOM,
    UNREACHABLE,
)
from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import NIL
from automaton.engine.table_search import DELTA_BITS, find_costs, find_ticks, is_reached


@kernel
def row_to(tables, cost_set, goal, tick, keeps):
    """The row of the table of a set of costs to a goal cell; NIL once tables.stop is set.

    It is computed if missing. With `keeps` it stays in place for the rest of the tick; otherwise
    the next request may replace it. If a tick keeps more tables than fit, tables.stop is set to
    STOP_NO_ROOM.
    """
    cost_set, goal = np.int64(cost_set), np.int64(goal)
    row = np.int64(tables.row_of[cost_set * tables.number.shape[0] + goal])
    if row != NIL and keeps and row == tables.status.rows - 1:
        forget(tables, row)  # the last row is always replaceable
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
    """The row of an existing table, valid until the next request; NIL: no table."""
    row = np.int64(tables.row_of[np.int64(cost_set) * tables.number.shape[0] + goal])
    if row != NIL:
        tables.used[row] = 1
    return row


@kernel
def has_room_for(tables, more):
    """Whether `more` tables fit without replacing any; True if all possible tables fit."""
    status, goals = tables.status, tables.entries.shape[0] * tables.drivable.shape[0]
    last = min(status.rows - 1, goals)
    return last == goals or status.taken + more <= last


@kernel
def cost_in(tables, row, cell, heading):
    """The cost from a pose to the goal cell of a row; UNREACHABLE: no path, or no row."""
    number = np.int64(tables.number[cell])
    if number < 0 or row < 0:
        return np.int64(UNREACHABLE)
    at = row * tables.status.words + number
    if tables.status.encoding != JOINT:
        return wide_cost_in(tables, row, number, heading)
    word = np.int64(tables.pool[np.uint64(at)])
    if word == FAR_WORD:
        return np.int64(UNREACHABLE)
    least = (word * tables.reciprocal) >> 32
    pattern = word - least * tables.patterns
    return (least + np.int64(tables.excess[np.uint64((pattern << 2) + heading)])) * tables.unit


@kernel
def wide_cost_in(tables, row, number, heading):
    """As `cost_in`, for the other encodings, by the number of the cell."""
    begin = row * tables.status.words
    encoding = tables.status.encoding
    if encoding == SPLIT:
        least = np.int64(tables.pool[np.uint64(begin + number)])
        if least == FAR_WORD:
            return np.int64(UNREACHABLE)
        pair = np.int64(tables.pool[np.uint64(begin + tables.drivable.shape[0] + (number >> 1))])
        pattern = (pair >> ((number & 1) << 3)) & 255
        return (least + np.int64(tables.excess[np.uint64((pattern << 2) + heading)])) * tables.unit
    pose = number * tables.headings + heading
    if encoding == POSE16:
        cost = np.int64(tables.pool[np.uint64(begin + pose)])
        return np.int64(UNREACHABLE) if cost == FAR_WORD else cost * tables.unit
    low = np.int64(tables.pool[np.uint64(begin + 2 * pose)])
    cost = low | (np.int64(tables.pool[np.uint64(begin + 2 * pose + 1)]) << 16)
    return np.int64(UNREACHABLE) if cost == FAR_PAIR else cost * tables.unit


@kernel
def add_row(tables, cost_set, goal, tick, keeps):
    """Compute a missing table; returns its row, or NIL if there is no room or the run is aborted."""
    if tables.stop[0]:
        return np.int64(NIL)
    if tables.status.words == 0:
        lay_out(tables, tables.first_encoding)
    row = free_row(tables, tick, keeps)
    while row != NIL:
        if not find_costs(tables, cost_set, goal):
            return np.int64(NIL)
        if write_row(tables, row):
            write_ticks(tables, row, cost_set, goal)
            tables.owner[row] = cost_set * tables.number.shape[0] + goal
            tables.row_of[tables.owner[row]] = row
            return row
        row = free_row(tables, tick, keeps) if widen(tables, tick) else np.int64(NIL)
    if tables.stop[0] == 0:
        tables.stop[0] = STOP_NO_ROOM
        tables.status.refused = 1
    return row


@kernel
def free_row(tables, tick, keeps):
    """A row without a table, replacing one if needed; NIL if all are kept in this tick.

    The last row is never kept, so a single look-up always has a row.
    """
    status = tables.status
    last = status.rows - 1
    if status.taken < last:
        status.taken += 1
        return status.taken - 1
    for _ in range(2 * last):
        row = status.hand
        status.hand = row + 1 if row + 1 < last else 0
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
    """Remove the table from a row."""
    if tables.owner[row] != NIL:
        tables.row_of[tables.owner[row]] = NIL
        tables.owner[row] = NIL


@kernel
def lay_out(tables, encoding):
    """Divide the pool into rows of an encoding."""
    cells, headings = tables.drivable.shape[0], tables.headings
    words = np.int64(cells)
    if encoding == SPLIT:
        words = cells + ((cells + 1) >> 1)
    elif encoding == POSE16:
        words = cells * headings
    elif encoding == POSE32:
        words = 2 * cells * headings
    status = tables.status
    status.encoding = encoding
    status.costs = words
    status.words = words + (2 * cells * headings if tables.step_ticks.shape[0] else 0)
    words = status.words
    status.rows = min(np.int64(tables.owner.shape[0]), tables.pool.shape[0] // words)
    status.hand = 0


@kernel
def widen(tables, tick):
    """Change to a wider encoding, converting the rows kept in this tick; False if they do not fit."""
    status = tables.status
    wider = SPLIT if status.encoding == JOINT else POSE32
    lay_out(tables, wider)
    taken = status.taken
    status.taken = min(taken, max(status.rows - 1, 0))
    cells = tables.number.shape[0]
    for row in range(tables.owner.shape[0]):
        entry = np.int64(tables.owner[row])
        if entry == NIL:
            continue
        if tables.kept_in[row] != tick:
            forget(tables, row)
            continue
        if row >= status.taken or not find_costs(tables, entry // cells, entry % cells):
            return False
        write_row(tables, row)  # data of a narrower encoding fit the wider one
        write_ticks(tables, row, entry // cells, entry % cells)
    return True


@kernel
def write_row(tables, row):
    """Write the result of a search into a row; False if it does not fit the encoding."""
    encoding = tables.status.encoding
    begin = row * tables.status.words
    if encoding == JOINT:
        return write_joint(tables, begin)
    if encoding == SPLIT:
        return write_split(tables, begin)
    return write_poses(tables, begin, encoding)


@kernel
def write_ticks(tables, row, cost_set, goal):
    """Write the ticks of the ways behind the costs of a row, if the tables have them."""
    if tables.step_ticks.shape[0] == 0:
        return
    find_ticks(tables, cost_set, goal)
    at = row * tables.status.words + tables.status.costs
    for number in range(tables.drivable.shape[0]):
        cell = np.int64(tables.drivable[np.uint64(number)])
        for heading in range(tables.headings):
            ticks = np.int64(UNREACHABLE)
            if is_reached(tables, cell, heading):
                ticks = np.int64(tables.ticks[np.uint64(cell * tables.headings + heading)])
            tables.pool[np.uint64(at)] = ticks & FAR_WORD
            tables.pool[np.uint64(at + 1)] = ticks >> 16
            at += 2


@kernel
def write_joint(tables, begin):
    fits = True
    for number in range(tables.drivable.shape[0]):
        cell = np.uint64(tables.drivable[np.uint64(number)])
        word = np.int64(FAR_WORD)
        if tables.reached[cell]:
            pattern = np.int64(tables.pattern_of[np.uint64(tables.turns[cell])])
            word = np.int64(tables.least[cell]) * tables.patterns + pattern
            fits &= word < FAR_WORD
        tables.pool[np.uint64(begin + number)] = word
    return fits


@kernel
def write_split(tables, begin):
    cells = tables.drivable.shape[0]
    for number in range(cells):
        cell = np.uint64(tables.drivable[number])
        word, pattern = np.int64(FAR_WORD), np.int64(0)
        if tables.reached[cell]:
            word = np.int64(tables.least[cell])
            pattern = np.int64(tables.pattern_of[np.uint64(tables.turns[cell])])
            if word >= FAR_WORD:
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
    """Write POSE16 or POSE32, also from narrow costs."""
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
                if encoding == POSE16 and cost >= FAR_WORD:
                    return False
            at = begin + number * headings + heading
            if encoding == POSE16:
                tables.pool[np.uint64(at)] = cost & FAR_WORD
            else:
                tables.pool[np.uint64(2 * at - begin)] = cost & FAR_WORD
                tables.pool[np.uint64(2 * at - begin + 1)] = cost >> 16
    return True


@kernel
def ticks_in(tables, row, cell, heading):
    """The ticks of the way of least cost from a pose to the goal cell of a row; UNREACHABLE: none."""
    number = np.int64(tables.number[cell])
    if number < 0 or row < 0:
        return np.int64(UNREACHABLE)
    at = row * tables.status.words + tables.status.costs + 2 * (number * tables.headings + heading)
    low = np.int64(tables.pool[np.uint64(at)])
    return low | (np.int64(tables.pool[np.uint64(at + 1)]) << 16)
