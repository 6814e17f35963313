"""What a path does to the zones of the floor: which ones it uses, and what others in them cost.

A move belongs to the zone of the cell that it leaves, so the last cell of a path does not count. All
of this follows the path that the last search left in workspace.came.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import ACTION_MOVE, NIL
from automaton.strategy.kernels import STARTED, limited_ticks, parent_of

WORD = 64  # zones in a word of a set


def words(zones: int) -> int:
    """int64 words of a set of zones, a bit for each."""
    return -(-zones // WORD)


@kernel
def zone_left(grid, pose, how):
    """The zone of the move in direction `how` that ended in a pose; NIL on an intersection."""
    cell = (pose >> (grid.headings >> 1)) - grid.offset[how]
    return np.int64(grid.traffic_zone[cell, how >> 1])


@kernel
def add_zones(grid, workspace, pose, used):
    """Add the zones of the path to a pose to a set; used: (words,) int64, a bit for each zone."""
    at = pose
    while workspace.came[at] != STARTED:
        how = np.int64(workspace.came[at])
        if how < 4:
            zone = zone_left(grid, at, how)
            if zone != NIL:
                used[zone >> 6] |= np.int64(1) << (zone & (WORD - 1))
        at = parent_of(grid, at, how)


@kernel
def delay_of(grid, duration, workspace, pose, count):
    """Ticks that the path to a pose loses to others: a move takes 1 + count[zone] times as long.

    count: (Z,) int32, other robots in each zone (the static reading of slow zones).
    """
    delay = np.int64(0)
    at = pose
    while workspace.came[at] != STARTED:
        how = np.int64(workspace.came[at])
        before = parent_of(grid, at, how)
        if how < 4:
            zone = zone_left(grid, at, how)
            if zone != NIL:
                ticks = limited_ticks(grid, duration[ACTION_MOVE], before // grid.headings, how)
                delay += np.int64(count[zone]) * ticks
        at = before
    return delay


@kernel
def has_zone(used, zone):
    """1 if a zone is in a set, else 0."""
    return (used[zone >> 6] >> (zone & (WORD - 1))) & 1


@kernel
def count_zones(used, count):
    """count[z] += 1 for each zone of a set."""
    for word in range(used.shape[0]):
        bits = used[word]
        for k in range(WORD):
            if bits == 0:
                break
            if (bits >> k) & 1:
                count[word * WORD + k] += 1
                bits &= bits - 1


@kernel
def count_common(used, count):
    """The sum of count[z] over the zones of a set."""
    common = 0
    for zone in range(count.shape[0]):
        if has_zone(used, zone):
            common += np.int64(count[zone])
    return common
