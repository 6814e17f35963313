"""How a fleet does at a moment, in five numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from automaton.world.state import DELIVERED
from automaton.world.waiting import NO_ORDER, NOT_WAITING

if TYPE_CHECKING:  # it needs Numba
    from automaton.history.snapshot import Snapshot


class Tally(NamedTuple):
    """Robots that work, are held up, and wait for each other in a circle; orders."""

    working: int
    waiting: int
    circling: int  # some of those who wait
    delivered: int
    orders: int


def tally(snapshot: Snapshot) -> Tally:
    """Count them. Who is parked or has no order neither works nor waits."""
    robots = snapshot.robots
    waiting = (robots.cause != NOT_WAITING) & (robots.cause != NO_ORDER)
    working = (robots.cause == NOT_WAITING) & (robots.parked == 0)
    state = snapshot.orders.state
    return Tally(
        working=int(np.count_nonzero(working)),
        waiting=int(np.count_nonzero(waiting)),
        circling=int(np.count_nonzero(robots.ring)),
        delivered=int(np.count_nonzero(state == DELIVERED)),
        orders=len(state),
    )
