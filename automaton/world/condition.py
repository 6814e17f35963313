"""The condition of a robot: the charge of its battery, and whether it is in order.

A battery holds FULL units when it is full. What an operation takes is paid when it begins, all of
it, so that no robot stops between two cells: one that lacks it is out of order where it stands.
"""

from __future__ import annotations

from typing import Final

FULL: Final = 1_000_000  # units of charge in a full battery: one is 0.0001 %
PERCENT: Final = FULL // 100

# States of a robot: robots.status.
RUNNING: Final = 0
FAILING: Final = 1  # a fault takes it out as soon as what it does is over
EXHAUSTED: Final = 2  # its battery lacks what its next operation takes
EMPTY: Final = 3  # out of order on the floor, for want of energy
BROKEN: Final = 4  # out of order on the floor, for a fault
TOWED: Final = 5  # off the floor, until it comes back
GONE: Final = 6  # off the floor for good
STATUS_NAMES: Final = (
    *("running", "failing", "exhausted", "empty battery", "broken down", "towed", "gone"),
)

# Columns of tally.out.
RAN_EMPTY: Final = 0
BROKE_DOWN: Final = 1
WAS_TOWED: Final = 2
