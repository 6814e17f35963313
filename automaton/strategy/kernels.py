"""The kernels that compiled strategies may call: the world's public view, in compiled form.

Strategies import compiled code from here and nowhere else (an import contract holds this).
"""

from __future__ import annotations

from automaton.jit import kernel
from automaton.kernels.charging_curve import CURVE_RATE, charging_ticks, level_after
from automaton.kernels.holders import lane_of
from automaton.kernels.motion import has_room
from automaton.kernels.operations import first_cell
from automaton.kernels.random_numbers import (
    STREAM_ABORTS,
    STREAM_RETREATS,
    STREAM_STRATEGY,
    random_between,
    random_bits,
    splitmix64,
)
from automaton.kernels.search import (
    STARTED,
    TURNED_AHEAD,
    TURNED_BEHIND,
    UNREACHABLE,
    begin_search,
    distance,
    find_path,
    follow_gradient,
    is_closed,
    mark_goal,
    nearest_mark,
    parent_of,
    pop,
    push,
    write_path,
)
from automaton.kernels.slot_access import can_bring, can_do, dropoff_cell, pickup_cell
from automaton.kernels.zone_segments import copy_segment

__all__ = [
    "CURVE_RATE",
    "STARTED",
    "STREAM_ABORTS",
    "STREAM_RETREATS",
    "STREAM_STRATEGY",
    "TURNED_AHEAD",
    "TURNED_BEHIND",
    "UNREACHABLE",
    "begin_search",
    "can_bring",
    "can_do",
    "charging_ticks",
    "copy_segment",
    "distance",
    "dropoff_cell",
    "find_path",
    "first_cell",
    "follow_gradient",
    "has_room",
    "is_closed",
    "kernel",
    "lane_of",
    "level_after",
    "mark_goal",
    "nearest_mark",
    "parent_of",
    "pickup_cell",
    "pop",
    "position",
    "push",
    "random_between",
    "random_bits",
    "splitmix64",
    "write_path",
]


@kernel
def position(view, i):
    """The cell from which a robot drives on: in a long move the one that it enters, in a parking
    bay its home."""
    return first_cell(view.robots, i)
