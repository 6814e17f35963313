"""Messages of real robots as columns.

A log is read once. Each message is a row: where a robot was, what it carried and what it did at the
time of the stamp. Rows are ordered by robot, then by time.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

Array = np.ndarray[Any, Any]

MAX_GAP_MS: Final = 30_000  # VDA 5050 asks for a message every 30 s; longer pauses are gaps
UNKNOWN: Final = -1  # a load or a flag that is not known


class Samples(NamedTuple):
    """The messages of all robots; ordered by robot, then by time."""

    robot: Array  # (n,) int32: index in StateLog.robots
    time: Array  # (n,) int64: milliseconds since 1970-01-01, as stamped
    x: Array  # (n,) float64: metres in the log's frame, before origin and rotation; nan: not known
    y: Array  # (n,) float64: likewise
    theta: Array  # (n,) float64: radians, counter-clockwise; nan: not known
    load: Array  # (n,) int32: 0 none, else index + 1 in StateLog.loads; -1 not known
    charge: Array  # (n,) float64: percent; nan: not known
    charging: Array  # (n,) int8: 0 or 1; -1 not known
    driving: Array  # (n,) int8: 0 or 1; -1 not known
    action: Array  # (n,) int32: 0 none running, else index + 1 in StateLog.actions
    action_id: Array  # (n,) int64: 0, or a number that differs between two actions
    order: Array  # (n,) int32: 0 none, else index + 1 in StateLog.orders
    down: Array  # (n,) bool: an error with level FATAL, or a state that says so


class LogCounts(NamedTuple):
    """What was read, and what was wrong with it."""

    messages: int  # rows of the log
    lines: int  # lines read, empty ones not counted
    skipped: dict[str, int]  # lines that are not messages, by reason
    doubled: int  # messages repeated with the same stamp
    unordered: int  # messages older than one of the same robot before them
    missing: int  # messages that header numbers show to be lost
    clock_steps: int  # messages with a later header number but an earlier stamp
    gaps: int  # pauses of a robot above 30 s


class StateLog(NamedTuple):
    """A log as it was read."""

    samples: Samples
    robots: tuple[str, ...]
    loads: tuple[str, ...]
    actions: tuple[str, ...]
    orders: tuple[str, ...]
    usable: Array  # (n,) bool: row i and the next are of one robot, without gap or clock step
    counts: LogCounts
