"""Build empty distance tables for the costs of robot types or the weights of a strategy."""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from automaton.engine.distance_tables import (
    BYTES_PER_WORD,
    JOINT,
    MAX_PATTERNS,
    POSE16,
    UNREACHABLE,
    DistanceTables,
    is_narrow_for,
)
from automaton.engine.jit.structs import NIL
from automaton.engine.state import MAY_TURN, NO_WAY_THROUGH, Array, Grid
from automaton.engine.table_search import BUCKETS, DELTA_BITS, ENTRIES_PER_CELL, MAX_QUEUES

COORDINATE_BITS = 31


class Costs(NamedTuple):
    """S sets of costs; steps cost at least 1, a turn may cost 0."""

    flags: Array  # (S, C) uint8: bits 0-3 exits E S W N, 4 may turn
    step: Array  # (S,) cost of a step; or (S, C, 4): from cell c in direction d
    turn: Array  # (S,) cost of a turn by 90 degrees
    headings: Array | None = None  # (S,) number distinguished; None: as many as the grid has
    step_ticks: Array | None = None  # (S, C, 4) ticks of a step; None: tables hold costs alone
    turn_ticks: Array | None = None  # (S,) ticks of a turn, with `step_ticks`


def build_tables(grid: Grid, costs: Costs, table_bytes: int, stop: Array) -> DistanceTables:
    """Tables in at most `table_bytes`, but at least room for one; memory is allocated as they are
    filled.

    `stop`: (1,) int64, not 0 when the run is aborted. Raises ValueError for costs that are too small,
    or that could make a path cost UNREACHABLE.
    """
    sets, cells = costs.flags.shape
    check_dearest(grid, costs)
    drivable = len(grid.drivable)
    unit, cost, queue_count, turn_queue, step_queue, step = queues_of(costs, grid.headings > 1)
    turn = int(costs.turn.max()) // unit
    is_narrow = is_narrow_for(grid.headings, turn)
    is_narrow &= bool((costs.flags[:, grid.drivable] & MAY_TURN).all())
    timed = sets if costs.step_ticks is not None else 0
    poses = drivable * grid.headings
    words = (drivable if is_narrow else poses) + (2 * poses if timed else 0)
    goals = sets * drivable + 1  # the last row is always replaceable
    widest = (4 if timed else 2) * poses  # words of the widest table; one always fits
    pool = max(widest, min(table_bytes // BYTES_PER_WORD, goals * widest))
    patterns = turn_patterns(turn if is_narrow else 0)
    sizes = {"C": cells, "S C": sets * cells, "P": cells * grid.headings}
    sizes |= {"R": min(goals, pool // words), "L": 0 if len(step) else most_entries(drivable)}
    sizes |= {"E": most_entries(drivable) if len(step) else 0, "B": BUCKETS if len(step) else 0}
    sizes |= {"N": poses if timed else 0, "M": cells * grid.headings if timed else 0}
    number = np.full(cells, NIL, np.int32)
    entries = entries_of(costs.flags, grid.offset)
    goal_entries = entries if (costs.flags & NO_WAY_THROUGH).any() else entries[:0]
    entries = np.where(costs.flags & NO_WAY_THROUGH, costs.flags & np.uint8(MAY_TURN), entries)
    distinguished = np.full(sets, grid.headings) if costs.headings is None else costs.headings
    order = in_z_order(grid)
    number[order] = np.arange(drivable, dtype=np.int32)
    return DistanceTables.sized(
        sizes,
        headings=grid.headings,
        first_encoding=JOINT if is_narrow else POSE16,
        unit=unit,
        is_narrow=int(is_narrow),
        patterns=len(patterns),
        reciprocal=-(-(1 << 32) // len(patterns)),
        offset=grid.offset,
        drivable=order,
        number=number,
        entries=entries,
        goal_entries=goal_entries,
        cost=cost,
        queue_count=queue_count,
        turn_queue=turn_queue,
        step_queue=step_queue,
        step=step,
        step_ticks=table_of_steps(costs.step_ticks, timed, cells),
        turn_ticks=np.zeros(0, np.int64) if costs.turn_ticks is None else costs.turn_ticks,
        excess=excess_of(patterns),
        pattern_of=numbers_of(patterns),
        pool=np.empty(pool, np.uint16),
        set_headings=distinguished.astype(np.int64),
        alike=np.array(
            [headings_alike(int(one), grid.headings) for one in distinguished], np.int64
        ),
        stop=stop,
    )


def empty_tables() -> DistanceTables:
    """Tables that are never used."""
    extents = ("B", "C", "E", "F", "G", "L", "M", "N", "P", "Q", "R", "S", "S C", "T", "V", "W")
    return DistanceTables.sized(dict.fromkeys((*extents, "words"), 0))


def most_entries(drivable: int) -> int:
    """The most entries of a search."""
    return ENTRIES_PER_CELL * drivable + 8


def table_of_steps(steps: Array | None, sets: int, cells: int) -> Array:
    """(sets, 4C) int32: numbers by step: [s, 4 c + d]."""
    if steps is None or not sets:
        return np.zeros((0, 4 * cells), np.int32)
    table: Array = np.broadcast_to(steps, (sets, cells, 4)).reshape(sets, -1).astype(np.int32)
    return table


def check_dearest(grid: Grid, costs: Costs) -> None:
    """No path costs UNREACHABLE: each cell is left once, by the dearest step after two turns.

    Raises ValueError.
    """
    if costs.step.ndim == 1:
        return
    leaves = (costs.flags[:, :, None] >> np.arange(4, dtype=np.uint8)) & 1 > 0
    steps = np.where(leaves, costs.step, 0).max(axis=2).astype(np.int64).sum(axis=1)
    if int((steps + 2 * costs.turn * len(grid.drivable)).max()) >= UNREACHABLE:
        raise ValueError(f"a path across all cells would cost {UNREACHABLE:,} or more")


def headings_alike(distinguished: int, headings: int) -> int:
    """The set of headings treated as heading 0 by robots that distinguish `distinguished` headings."""
    return sum(1 << heading for heading in range(0, headings, distinguished))


def in_z_order(grid: Grid) -> Array:
    """(F,) int32: the drivable cells in Z-order, so neighbours share cache lines.

    A robot's next cells are in 1.1 cache lines of its table, and in 1.4 with row-by-row order (the
    floor of `automaton bench --only steering`); the cell and all neighbours in 1.5 and 2.9.
    """
    x, y = np.divmod(grid.drivable.astype(np.int64), grid.width)[::-1]
    key = np.zeros(len(x), np.int64)
    for bit in range(COORDINATE_BITS):
        key |= ((x >> bit) & 1) << (2 * bit) | ((y >> bit) & 1) << (2 * bit + 1)
    order: Array = grid.drivable[np.argsort(key)]
    return order


def renew(tables: DistanceTables) -> None:
    """Prepare tables of an earlier run for another run, which reuses their contents.

    Whether a run has enough room must not depend on earlier runs.
    """
    tables.kept_in[:] = NIL
    if tables.status.encoding != tables.first_encoding:
        tables.status[:] = 0
        tables.row_of[:] = NIL
        tables.owner[:] = NIL


def bytes_taken(tables: DistanceTables) -> int:
    """Bytes of the rows used so far."""
    return int(BYTES_PER_WORD * tables.status.taken * tables.status.words)


def turn_patterns(turn: int) -> list[tuple[int, ...]]:
    """All patterns of extra costs of four headings over the best one, for a cost of a turn."""
    return [
        pattern
        for pattern in itertools.product(range(2 * turn + 1), repeat=4)
        if min(pattern) == 0 and all(abs(pattern[h] - pattern[h - 1]) <= turn for h in range(4))
    ]


def excess_of(patterns: list[tuple[int, ...]]) -> Array:
    """[4 pattern + h]: the extra cost of heading h."""
    table = np.zeros((MAX_PATTERNS, 4), np.uint8)
    table[: len(patterns)] = patterns
    return table.reshape(-1)


def numbers_of(patterns: list[tuple[int, ...]]) -> Array:
    """The number of each pattern, indexed by its differences of DELTA_BITS each."""
    table = np.zeros(1 << (4 * DELTA_BITS), np.uint8)
    for number, pattern in enumerate(patterns):
        table[sum(more << (DELTA_BITS * h) for h, more in enumerate(pattern))] = number
    return table


def entries_of(flags: Array, offset: Array) -> Array:
    """(S, C) uint8: steps that lead to a cell, by direction; and whether robots may turn there."""
    entries = flags & np.uint8(MAY_TURN)
    for direction, step in enumerate(offset.tolist()):
        leaves = (flags >> np.uint8(direction)) & np.uint8(1)
        entries |= np.roll(leaves, step, axis=1) << np.uint8(direction)
    return entries


def queues_of(costs: Costs, turns: bool) -> tuple[int, Array, Array, Array, Array, Array]:
    """The unit of all costs; the distinct costs in that unit (S, Q); their number (S,).

    Also the index of the cost of a turn (S,) and of each step (W, 4C); or, with more than MAX_QUEUES
    distinct costs, that of a turn alone and the cost of each step (V, 4C). Without `turns` robots never
    turn.
    """
    sets = len(costs.flags)
    steps = costs.step.reshape(sets, -1).astype(np.int64)
    is_weighted = costs.step.ndim > 1
    distinct: list[list[Any]] = []
    for flags, step, turn in zip(costs.flags, steps, costs.turn.tolist(), strict=True):
        leaves = (flags[:, None] >> np.arange(4, dtype=np.uint8)) & 1 > 0
        used = np.unique(step[leaves.reshape(-1)] if is_weighted else step)
        if len(used) and (used[0] < 1 or turn < 0):
            raise ValueError("a step must cost at least 1 and a turn at least 0")
        distinct.append([*used.tolist(), *([turn] if turns and turn not in used else [])])
    unit = math.gcd(*(value for values in distinct for value in values)) or 1
    no_steps = np.zeros((0, steps.shape[1] if is_weighted else 4 * costs.flags.shape[1]))
    most = max(1, *map(len, distinct))
    if most > MAX_QUEUES:
        zeros = np.zeros(sets, np.int64)
        cost = costs.turn.astype(np.int64)[:, None] // unit
        return unit, cost, zeros, zeros, no_steps.astype(np.uint8), (steps // unit).astype(np.int32)
    cost = np.array([one + [0] * (most - len(one)) for one in distinct], np.int64)
    step_queue = np.zeros((len(cost) if is_weighted else 0, no_steps.shape[1]), np.uint8)
    for row, values in enumerate(distinct[: len(step_queue)]):
        for queue, value in enumerate(values):
            step_queue[row][steps[row] == value] = queue
    turn_queue = [
        one.index(turn) if turns else 0
        for one, turn in zip(distinct, costs.turn.tolist(), strict=True)
    ]
    counts = np.array([max(1, len(one)) for one in distinct], np.int64)
    queues = counts, np.array(turn_queue, np.int64), step_queue
    return unit, cost // unit, *queues, no_steps.astype(np.int32)
