"""Which of six tints each zone has: zones that touch differ, also across a crossing.

a a + b b      a and b meet at the crossing, and so do both with c
    c
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from automaton.floor.traffic_zones import TrafficZones
from tui.render.tints import TINTS

# zones that are told from those that they touch; more go by their numbers
MAX_TINTED_ZONES: Final = 50_000
# half of the neighbours: pairs count once
NEIGHBOUR_OFFSETS: Final = ((0, 1), (1, 0), (1, 1), (1, -1))
CROSSING_OFFSETS: Final = ((0, 2), (2, 0))  # across one cell


def tints_of(traffic_zones: TrafficZones, height: int, width: int) -> NDArray[np.int8]:
    """(C,) the tint of each cell, an index of TINTS, or NIL; the border counts in height and width.

    The two zones of a stretch with directions share one. Greedy, in an order that is drawn once and
    for all: rounds are few, and floors of aisles need at most six tints. Were more needed, they
    would be used again.
    """
    number = traffic_zones.of[:, 0].reshape(height, width)
    tint = np.arange(max(traffic_zones.count, 1))
    if traffic_zones.count <= MAX_TINTED_ZONES:
        tint = _coloured(
            len(tint), *_touching(number, traffic_zones.intersection.reshape(height, width))
        )
    return np.where(number == NIL, NIL, tint[number] % len(TINTS)).astype(np.int8).reshape(-1)


def _touching(
    number: NDArray[Any], crossing: NDArray[np.bool_]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Pairs of zones that touch, each both ways."""
    pairs = []
    for dy, dx in (*NEIGHBOUR_OFFSETS, *CROSSING_OFFSETS):
        there = np.roll(number, (-dy, -dx), (0, 1))  # wraps round through the border, in no zone
        apart = (number != NIL) & (there != NIL) & (number != there)
        if (dy, dx) in CROSSING_OFFSETS:
            apart &= np.roll(crossing, (-dy // 2, -dx // 2), (0, 1))
        pairs.append(np.column_stack((number[apart], there[apart])))
    found = np.unique(np.concatenate(pairs), axis=0)
    both = np.concatenate((found, found[:, ::-1]))
    return both[:, 0], both[:, 1]


def _coloured(count: int, one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.int64]:
    """(count,) the lowest tint that no touching zone has had before (Jones & Plassmann's rounds)."""
    turn = np.random.default_rng(1).permutation(count)
    turn = turn - count * np.bincount(one, minlength=count)  # who touches many goes first
    tint = np.full(count, NIL)
    while (tint == NIL).any():
        open_ = tint[one] == NIL
        one, other = one[open_], other[open_]
        waits = np.zeros(count, bool)
        waits[one[(tint[other] == NIL) & (turn[other] < turn[one])]] = True
        taken = np.zeros(count, np.int64)
        settled = tint[other] != NIL
        np.bitwise_or.at(taken, one[settled], 1 << np.minimum(tint[other[settled]], 62))
        now = (tint == NIL) & ~waits
        free = ~taken[now]
        tint[now] = np.round(np.log2((free & -free).astype(float))).astype(np.int64)
    return tint
