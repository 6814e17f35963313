"""What it costs to go on after a step in each direction: of many robots at once, each with its own table.

Tables lie far from each other, so nearly every look-up waits for the memory. The first pass only
reads: it is so short that the processor has ten robots on the way at once. The second one computes.
"""

import numpy as np

from automaton.engine.distance_tables import FAR, JOINT, TABLES_ENCODING, TABLES_WORDS, UNREACHABLE
from automaton.engine.facilities import NO_WAY_THROUGH
from automaton.engine.headings import heading_towards
from automaton.engine.jit.kernel import kernel
from automaton.engine.table_rows import cost_in

U = np.uint64  # unsigned where it indexes: saves the test for a negative index


@kernel
def find_step_costs(view, tables, robots, count, table, out):
    """Enter the costs after a step E, S, W, N of the first `count` robots listed, which are on the floor.

    `table`: by robot, rows of `tables`. out[i, d]: the cost from the next cell of robot i, with the
    heading of direction d, to the goal cell of its table; UNREACHABLE: no way, or the exit is not open.
    """
    if tables.status[TABLES_ENCODING] == JOINT:
        read_words(view, tables, robots, count, table, out)
        decode_words(view, tables, robots, count, out)
        close_storage(view, robots, count, out)
        return
    for k in range(count):
        i = np.int64(robots[U(k)])
        for direction in range(4):
            out[U(i), U(direction)] = step_cost(view, tables, i, direction, table[U(i)])
    close_storage(view, robots, count, out)


@kernel
def close_storage(view, robots, count, out):
    """Robots step into no cell through which no way with a load leads, but into their goal.

    Those without a load could, but would find no place there to make way for one with a load.
    """
    grid, first_loaded = view.grid, view.rules.loaded_types
    for k in range(count if first_loaded else 0):
        i = np.int64(robots[U(k)])
        robot_type = np.int64(view.robots.type[U(i)])
        if robot_type < first_loaded:
            robot_type += first_loaded
        for direction in range(4):
            to = np.int64(view.robots.cell[U(i)]) + grid.offset[direction]
            is_barred = np.int64(grid.type_cell_flags[robot_type, to]) & NO_WAY_THROUGH
            if is_barred and to != view.robots.goal_cell[U(i)]:
                out[U(i), U(direction)] = UNREACHABLE


@kernel
def step_cost(view, tables, i, direction, row):
    """The cost after a step of one robot in any encoding."""
    grid, robot_type = view.grid, np.int64(view.robots.type[U(i)])
    cell = np.int64(view.robots.cell[U(i)])
    if (np.int64(grid.type_cell_flags[U(robot_type), U(cell)]) >> direction) & 1 == 0:
        return np.int64(UNREACHABLE)
    heading = heading_towards(grid, robot_type, direction)
    return cost_in(tables, row, cell + grid.offset[direction], heading)


@kernel
def read_words(view, tables, robots, count, table, out):
    """Enter the words of the next cells, FAR where an exit is closed; without a branch."""
    cells, types, flags_of = view.robots.cell, view.robots.type, view.grid.type_cell_flags
    pool, number, offset = tables.pool, tables.number, tables.offset
    east, south, west, north = offset[0], offset[1], offset[2], offset[3]
    words = U(tables.status[TABLES_WORDS])
    for k in range(count):
        i = U(robots[U(k)])
        cell = np.int64(cells[i])
        flags = np.int64(flags_of[U(types[i]), U(cell)])
        begin = U(max(np.int64(table[i]), 0)) * words
        e, s, w, n = flags & 1, (flags >> 1) & 1, (flags >> 2) & 1, (flags >> 3) & 1
        out[i, U(0)] = np.int64(pool[begin + U(number[U(cell + east * e)])]) | FAR * (1 - e)
        out[i, U(1)] = np.int64(pool[begin + U(number[U(cell + south * s)])]) | FAR * (1 - s)
        out[i, U(2)] = np.int64(pool[begin + U(number[U(cell + west * w)])]) | FAR * (1 - w)
        out[i, U(3)] = np.int64(pool[begin + U(number[U(cell + north * n)])]) | FAR * (1 - n)


@kernel
def decode_words(view, tables, robots, count, out):
    """Replace the words by costs."""
    excess, reciprocal, patterns = tables.excess, tables.reciprocal, tables.patterns
    unit = tables.unit
    for k in range(count):
        i = U(robots[U(k)])
        for direction in range(4):
            word = np.int64(out[i, U(direction)])
            least = (word * reciprocal) >> 32
            more = np.int64(excess[U(((word - least * patterns) << 2) + direction)])
            cost = (least + more) * unit
            out[i, U(direction)] = cost if word != FAR else UNREACHABLE
