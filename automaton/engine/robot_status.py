"""The condition of a robot: the charge of its battery, and whether it is in order.

A battery holds FULL units when it is full. What an operation takes is paid when it begins, all of
it, so that no robot stops between two cells: one that lacks it is down where it stands.
"""

from __future__ import annotations

from typing import Final

BATTERY_FULL: Final = 1_000_000_000  # units of charge in a full battery: one is 0.0000001 %
BATTERY_PERCENT: Final = BATTERY_FULL // 100

# States of a robot: robots.status.
STATUS_UP: Final = 0
STATUS_FAILING: Final = 1  # a fault takes it out as soon as what it does is over
STATUS_EXHAUSTED: Final = 2  # its battery lacks what its next operation takes
STATUS_DEPLETED: Final = 3  # down on the floor, without charge
STATUS_FAILED: Final = 4  # down on the floor because of a fault
STATUS_TOWED: Final = 5  # off the floor, until it comes back
STATUS_REMOVED: Final = 6  # off the floor for good
STATUS_NAMES: Final = (
    *("running", "failing", "exhausted", "empty battery", "broken down", "towed", "gone"),
)

# Columns of tally.failures.
FAILURE_DEPLETED: Final = 0
FAILURE_FAULT: Final = 1
FAILURE_TOWED: Final = 2
