"""Which way robots face: each type distinguishes its own number of headings.

    omni           1: always heading 0; it moves in any direction at once
    rail           2: its axis, 0 east and west, 1 south and north; it reverses freely
    differential   4: the direction in which it moves, E S W N

A robot moves in a direction if that is, modulo its headings, the heading in which it stands. On a floor
with several kinematics a pose is numbered by the headings of the finest: cell * grid.headings + heading.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel

U = np.uint64  # unsigned where it indexes: saves the test for a negative index


@kernel
def headings_of(grid, robot_type):
    """How many headings robots of a type distinguish."""
    return np.int64(grid.type_headings[U(robot_type)])


@kernel
def heading_towards(grid, robot_type, direction):
    """The heading in which a robot of a type moves in a direction."""
    return direction & (np.int64(grid.type_headings[U(robot_type)]) - 1)


@kernel
def is_facing(view, i, direction):
    """Whether robot i moves in a direction without a turn."""
    robots = view.robots
    return heading_towards(view.grid, robots.type[U(i)], direction) == robots.heading[U(i)]


@kernel
def entry_heading(grid, robot_type, cell):
    """Heading of a robot placed on the floor: vertical if the cell leads north or south."""
    cell_flags = np.int64(grid.cell_flags[cell])
    for direction in (1, 3, 0, 2):
        if (cell_flags >> direction) & 1:
            return heading_towards(grid, robot_type, direction)
    return np.int64(0)
