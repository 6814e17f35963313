"""Messages of real robots as columns.

A log is read once, line by line. Each message is a row: where a robot was, what it carried and what it
did at the time of the stamp. Rows are ordered by robot, then by time. Formats of lines: log_lines.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.log_lines import NOT_NUMBERED, ROW_FIELDS, LineReader, LogNames
from automaton.errors import InputError
from automaton.units import count

Array = np.ndarray[Any, Any]

MAX_GAP_MS: Final = (
    31_000  # VDA 5050 asks for a message every 30 s; a second for clocks that differ
)
NUMBER_WIDTH: Final = 20  # digits of numbers in names, to sort these
ORDER_PAUSE_MS: Final = 3_600_000  # sites begin with number 1 again, as each day
MIN_SILENT_S: Final = 360.0  # 0.1 h
CLOCK_STEP_MS: Final = 1000  # smaller steps back are unordered messages
NEAR_MS: Final = 1000  # between messages of two files whose places are compared
MIN_NEAR: Final = 10
MAX_ELSEWHERE: Final = 0.2  # share of these messages that find a robot elsewhere
NIL: Final = -1
MESSAGES_AT_A_TIME: Final = 8192  # rows held as Python objects


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
    doubled: int  # messages repeated with their stamp and number
    unordered: int  # messages older than one of their robot before them
    missing: int  # messages that the numbers of others show to be lost
    clock_steps: int  # messages with a later number but an earlier stamp than the one before
    gaps: int  # pauses of a robot above 30 s
    versions: dict[str, int]  # messages by version of the standard
    one_stamp: int = 0  # messages with the stamp of the one before, so that no time is between them
    silent_s: float = 0.0  # seconds of pauses of all robots at once

    def sentences(self) -> list[str]:
        """What was read and what was wrong, as lines of a report."""
        versions = [name for name in self.versions if name]
        of = f" of VDA 5050 {', '.join(versions)}" if versions else ""
        if len(self.versions) > 1:
            of += f" ({', '.join(f'{many:,}' for many in self.versions.values())})"
        lines = [f"{count(self.messages, 'message')}{of}"]
        if self.skipped:
            why = ", ".join(f"{name} {many:,}" for name, many in self.skipped.items())
            lines.append(f"{count(sum(self.skipped.values()), 'line')} skipped: {why}")
        words = {
            "doubled": self.doubled,
            "unordered": self.unordered,
            "missing": self.missing,
            "clock stepped back": self.clock_steps,
            "pauses above 30 s": self.gaps,
            "with the stamp of the message before": self.one_stamp,
        }
        wrong = ", ".join(f"{name} {many:,}" for name, many in words.items() if many)
        lines += [wrong] if wrong else []
        if self.silent_s >= MIN_SILENT_S:
            lines.append(f"no message of any robot for {self.silent_s / 3600:,.1f} h in all")
        return lines


class StateLog(NamedTuple):
    """A log as it was read."""

    samples: Samples
    robots: tuple[str, ...]
    loads: tuple[str, ...]
    actions: tuple[str, ...]
    orders: tuple[str, ...]
    usable: Array  # (n,) bool: row i and the next are of one robot, without gap or clock step
    counts: LogCounts

    def part(self, rows: Array) -> StateLog:
        """Some of the messages; `rows`: sorted."""
        samples = Samples(*(column[rows] for column in self.samples))
        return self._replace(
            samples=samples, usable=self.usable[rows] & (np.diff(rows, append=-1) == 1)
        )

    def marks_of_moves(self) -> Array:
        """(k,) a number for each message that finds its robot elsewhere than the one before; equal for
        equal messages."""
        samples = self.samples
        x, y = (np.nan_to_num(np.round(1000 * one)).astype(np.int64) for one in samples[2:4])
        moved = np.append(False, (np.diff(x) != 0) | (np.diff(y) != 0)) & np.append(
            False, np.diff(samples.robot) == 0
        )
        mixed = samples.time * 1_000_003 + samples.robot
        for one in (x, y):
            mixed = mixed * 1_000_003 + one  # wraps
        marks: Array = np.unique(mixed[moved])
        return marks

    def rows_of_robots(self) -> list[slice]:
        """The rows of each robot."""
        firsts = np.searchsorted(self.samples.robot, np.arange(len(self.robots) + 1)).tolist()
        return [slice(*ends) for ends in itertools.pairwise(firsts)]


def numbers_of_robots(names: Sequence[str], robots: int) -> Array:
    """(n,) the number in a fleet of each robot of a log: its name, if all are numbers of the fleet.

    Else robots are numbered by name; "agv-10" comes behind "agv-9".
    """
    of_fleet = {str(number): number for number in range(robots)}
    if of_fleet.keys() >= set(names):
        return np.array([of_fleet[name] for name in names], np.int64)
    keys = [re.sub(r"[0-9]+", lambda digits: digits[0].zfill(NUMBER_WIDTH), name) for name in names]
    return np.argsort(sorted(range(len(keys)), key=keys.__getitem__))


TYPES: Final = {
    **dict.fromkeys(("x", "y", "theta", "charge"), np.float64),
    **dict.fromkeys(("time", "action_id", "header"), np.int64),
    **dict.fromkeys(("robot", "load", "action", "order"), np.int32),
    **dict.fromkeys(("charging", "driving"), np.int8),
    "down": np.bool_,
}


def read_log(paths: Iterable[Path], columns: Mapping[str, str] | None = None) -> StateLog:
    """Read files of VDA 5050 state messages, or CSV files, as one log.

    `columns`: names of columns in CSV files by field, such as {"robot": "agv"}. Files that end in .gz
    are decompressed. Raises InputError for a file that cannot be read, or without any message.
    """
    names = LogNames()
    reader = LineReader(names, columns or {})
    files: list[dict[str, Array]] = []
    paths = list(paths)
    for path in paths:
        parts: dict[str, list[Array]] = {name: [] for name in ROW_FIELDS}
        rows = reader.rows(path)
        while block := list(itertools.islice(rows, MESSAGES_AT_A_TIME)):
            for name, values in zip(ROW_FIELDS, zip(*block, strict=True), strict=True):
                parts[name].append(np.array(values, TYPES[name]))
        if not parts["time"]:
            raise InputError(f"has no state message{reader.first_reason}", str(path))
        files.append({name: np.concatenate(parts.pop(name)) for name in ROW_FIELDS})
    for (one, first), (other, second) in itertools.combinations(zip(files, paths, strict=True), 2):
        if (robot := _contradicted(one, other)) != NIL:
            name = list(names.robots)[robot]
            raise InputError(
                f"has robot {name} elsewhere than {first} at equal times; if they are two days with one "
                "clock, give each its own date (units.clock)",
                str(second),
            )
    files.sort(key=lambda one: int(one["time"][0]))
    arrays = {name: np.concatenate([one.pop(name) for one in files]) for name in ROW_FIELDS}
    return _ordered(arrays, names, reader)


def _contradicted(one: dict[str, Array], other: dict[str, Array]) -> int:
    """A robot that two files have in different places at equal times, or NIL.

    Files that repeat messages, or share those of a robot, agree: no message is farther from the nearest
    one of the other file than the robot can drive.
    """
    begin = max(one["time"].min(), other["time"].min()) - NEAR_MS
    end = min(one["time"].max(), other["time"].max()) + NEAR_MS
    a, b = (_rows_between(file, begin, end) for file in (one, other))
    if len(a["time"]) < MIN_NEAR or len(b["time"]) < MIN_NEAR:
        return NIL
    keys = [rows["robot"] * np.int64(end - begin + 1) + rows["time"] - begin for rows in (a, b)]
    after = np.minimum(np.searchsorted(*keys), len(keys[0]) - 1)
    before = np.maximum(after - 1, 0)
    is_nearer = abs(keys[0][before] - keys[1]) < abs(keys[0][after] - keys[1])
    at = np.where(is_nearer, before, after)
    late = abs(keys[0][at] - keys[1])
    apart = np.hypot(a["x"][at] - b["x"], a["y"][at] - b["y"])
    near = (a["robot"][at] == b["robot"]) & (late <= NEAR_MS) & np.isfinite(apart)
    steps, elapsed = np.hypot(np.diff(a["x"]), np.diff(a["y"])), np.diff(keys[0])
    speeds = (steps / np.maximum(elapsed, 1))[(np.diff(a["robot"]) == 0) & (steps > 0)]
    if near.sum() < MIN_NEAR or not len(speeds):
        return NIL
    reach = 2 * np.quantile(speeds, 0.99) * (late + NEAR_MS / 2)
    elsewhere = near & (apart > reach)
    is_contradicted = elsewhere.sum() > MAX_ELSEWHERE * near.sum()
    return int(b["robot"][np.argmax(elsewhere)]) if is_contradicted else NIL


def _rows_between(file: dict[str, Array], begin: int, end: int) -> dict[str, Array]:
    """Robot, time and place of the messages of a stretch, by robot and time."""
    rows = np.flatnonzero((file["time"] >= begin) & (file["time"] <= end))
    rows = rows[np.lexsort((file["time"][rows], file["robot"][rows]))]
    return {name: file[name][rows] for name in ("robot", "time", "x", "y")}


def _ordered(arrays: dict[str, Array], names: LogNames, reader: LineReader) -> StateLog:
    """The log of rows in the order of their arrival."""
    robots = tuple(sorted(names.robots))  # in any order of files
    number = {name: rank for rank, name in enumerate(robots)}
    arrays["robot"] = np.array([number[name] for name in names.robots], np.int32)[arrays["robot"]]
    arrays, doubled = _without_repetitions(arrays)
    unordered, steps, missing = _arrivals(arrays)
    rows = np.lexsort((arrays["header"], arrays["time"], arrays["robot"]))
    for name in ROW_FIELDS:
        arrays[name] = arrays[name][rows]
    del arrays["header"]
    samples = Samples(**arrays)
    if reader.counts_actions:
        samples = samples._replace(action_id=_counted_actions(samples))
    order, orders = _distinct_orders(samples, tuple(names.orders))
    samples, pauses = samples._replace(order=order), np.diff(np.sort(samples.time))
    pair = samples.robot[1:] == samples.robot[:-1]
    elapsed = np.diff(samples.time)
    gaps = pair & (elapsed > MAX_GAP_MS)
    usable = np.append(pair & ~gaps & (elapsed > 0), False)
    for robot, back_to, latest in steps:
        usable[_between(samples, robot, back_to, latest)] = False
    counts = LogCounts(
        messages=len(samples.time),
        lines=reader.lines,
        skipped=dict(reader.skipped),
        doubled=doubled,
        unordered=unordered,
        missing=missing,
        clock_steps=len(steps),
        gaps=int(gaps.sum()),
        versions=dict(reader.versions),
        one_stamp=int((pair & (elapsed == 0)).sum()),
        silent_s=float(pauses[pauses > MAX_GAP_MS].sum()) / 1000,
    )
    return StateLog(
        samples, robots, tuple(names.loads), tuple(names.actions), orders, usable, counts
    )


def _distinct_orders(samples: Samples, names: Sequence[str]) -> tuple[Array, tuple[str, ...]]:
    """(n,) the order of each message, and the names of all: an order that no message names for a while
    is another one when its name comes back."""
    rows = np.flatnonzero(samples.order)
    rows = rows[np.lexsort((samples.time[rows], samples.order[rows]))]
    of, time = samples.order[rows], samples.time[rows]
    begins = (np.diff(of, prepend=0) != 0) | (np.diff(time, prepend=time[:1]) > ORDER_PAUSE_MS)
    order = np.zeros_like(samples.order)
    order[rows] = np.cumsum(begins)
    return order, tuple(names[number - 1] for number in of[begins].tolist())


def _without_repetitions(arrays: dict[str, Array]) -> tuple[dict[str, Array], int]:
    """The rows without those that repeat an earlier one's robot, stamp and number; and how many."""
    keys = arrays["header"], arrays["time"], arrays["robot"]
    order = np.lexsort(keys)
    again = np.ones(max(len(order) - 1, 0), np.bool_)
    for key in keys:
        again &= np.diff(key[order]) == 0
    repeated = order[1:][again]
    if len(repeated):
        arrays = {name: np.delete(array, repeated) for name, array in arrays.items()}
    return arrays, len(repeated)


def _arrivals(arrays: dict[str, Array]) -> tuple[int, list[tuple[int, int, int]], int]:
    """The number of unordered rows; robot, stamp, and the stamp before, of each step back of a clock;
    and the number of missing messages."""
    order = np.argsort(arrays["robot"], kind="stable")
    robot, time, header = (arrays[name][order] for name in ("robot", "time", "header"))
    same, later = np.diff(robot) == 0, np.diff(time)
    numbered = (header[1:] != NOT_NUMBERED) & (header[:-1] != NOT_NUMBERED)
    stepped = same & numbered & (later < -CLOCK_STEP_MS) & (np.diff(header) > 0)
    unordered = same & (later < 0) & ~stepped
    steps = np.flatnonzero(stepped)
    rows = zip(robot[steps].tolist(), time[steps + 1].tolist(), time[steps].tolist(), strict=True)
    # A robot that starts again begins with a low number. Between two starts each number is sent once.
    begins = ~same | ~numbered | ((np.diff(header) < 0) & (later >= 0))
    first = np.append(0, np.flatnonzero(begins) + 1)
    sent = np.maximum.reduceat(header, first) - np.minimum.reduceat(header, first) + 1
    rows_of_start = np.diff(first, append=len(header))
    return int(np.count_nonzero(unordered)), list(rows), int((sent - rows_of_start).clip(0).sum())


def _between(samples: Samples, robot: int, first: int, last: int) -> slice:
    """The rows of a robot with stamps from `first` to `last`."""
    begin, end = np.searchsorted(samples.robot, (robot, robot + 1))
    low = begin + np.searchsorted(samples.time[begin:end], first)
    high = begin + np.searchsorted(samples.time[begin:end], last, side="right")
    return slice(max(int(low) - 1, 0), int(high))


def _counted_actions(samples: Samples) -> Array:
    """(n,) numbers of the runs of rows with one action, which a CSV file does not number."""
    begins = (np.diff(samples.action, prepend=0) != 0) | (np.diff(samples.robot, prepend=-1) != 0)
    number: Array = np.where(samples.action > 0, np.cumsum(begins), 0)
    return number
