"""Traffic avoidance (Bhattathiri, Li & Kuhl): A* around the zones in which many others are
predicted.

For A = 1, 2, ... the zones with A or more others are closed (or with more than A), save those that
touch the robot's own start, pick-up or drop-off; each A that still leaves a way gives a candidate, and
so does plain A*.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from automaton.strategy.kernels import UNREACHABLE
from strategies.routing.astar.astar import search
from strategies.routing.astar.frontier import OPEN_COST
from strategies.routing.traffic_avoidance.path_zones import delay_of

PLAIN = 0  # in place of A: nothing is closed

# Which candidate is taken: of least predicted time, ties to plain A*, then to least A.
LEAST_TIME = 0
MOST_CAUTIOUS = 1  # the one of least A


@kernel
def choose_threshold(
    grid, robot_type, duration, workspace, ties, seed, start, pick, drop, most, least_count, rule
):
    """The A = 1..most of the candidate that is taken, or PLAIN.

    `least_count`: of A = 1, the fewest others for which a zone is closed: 1, or 2 for "more than A".

    Reads the others in each zone from workspace.count; `start` is a pose, `pick` and `drop` are
    cells,
    `pick` may be NIL. Leaves workspace.closed for any A: close_zones sets it again.
    """
    chosen = PLAIN
    offset = least_count - 1
    least = foreseen_time(
        grid, robot_type, duration, workspace, ties, seed, start, pick, drop, PLAIN
    )
    for threshold in range(1, most + 1):
        if close_zones(grid, workspace, threshold + offset, start, pick, drop) == 0:
            break  # a larger A closes nothing either
        ticks = foreseen_time(
            grid, robot_type, duration, workspace, ties, seed, start, pick, drop, threshold
        )
        if rule == MOST_CAUTIOUS and ticks < UNREACHABLE:
            return np.int64(threshold)
        if ticks < least:
            least = ticks
            chosen = threshold
    return np.int64(chosen)


@kernel
def foreseen_time(grid, robot_type, duration, workspace, ties, seed, start, pick, drop, threshold):
    """Ticks of both legs with the others of workspace.count in their zones, or UNREACHABLE."""
    ticks = 0
    pose = np.int64(start)
    for leg in range(2):
        target = drop if leg else pick
        if target == NIL:
            continue
        pose = search(
            grid, robot_type, duration, workspace, ties, seed, pose, target, threshold != PLAIN
        )
        if pose == NIL:
            return UNREACHABLE
        ticks += workspace.state[OPEN_COST] + delay_of(
            grid, duration, workspace, pose, workspace.count
        )
    return ticks


@kernel
def close_zones(grid, workspace, threshold, start, pick, drop):
    """Close the zones with that many others, save the robot's own; how many there are before that."""
    busy = 0
    for zone in range(workspace.closed.shape[0]):
        workspace.closed[zone] = workspace.count[zone] >= threshold
        busy += workspace.closed[zone]
    open_zones(grid, workspace, start >> (grid.headings >> 1))
    open_zones(grid, workspace, drop)
    if pick != NIL:
        open_zones(grid, workspace, pick)
    return busy


@kernel
def open_zones(grid, workspace, cell):
    """Open the zones that touch a cell: those that it is in, and those of the cells beside it.

    So whoever stands on an intersection may leave it, be that a zone of its own or none.
    """
    open_cell(grid, workspace, cell)
    for way in range(4):
        open_cell(grid, workspace, cell + grid.offset[way])


@kernel
def open_cell(grid, workspace, cell):
    for column in range(2):
        if grid.traffic_zone[cell, column] != NIL:
            workspace.closed[grid.traffic_zone[cell, column]] = 0
