"""The divergence of two runs, recorded or live: the first tick in which their robots act differently."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.errors import InputError
from automaton.recording.contents import Content
from automaton.recording.frames import Recording, StoredFrames

DIFFERENT_START = (
    "the runs differ from the start: they have different fleets, floors or order lists"
)


class Divergence(NamedTuple):
    """The outcome of a comparison."""

    tick: int | None  # the first different tick, or None
    text: str


def first_difference(one: Recording, other: Recording) -> Divergence:
    """Compare the actions of robots tick by tick; if they are equal, the digests of states.

    Raises InputError if ticks are missing in a recording.
    """
    if not begin_alike(one.header, other.header):
        return Divergence(0, DIFFERENT_START)
    # Separate frame stores, since the player decodes the others in its own thread.
    mine, its = (StoredFrames(recording.stored().payloads) for recording in (one, other))
    return compared(mine, its)


def compared(mine: StoredFrames, its: StoredFrames) -> Divergence:
    """The first tick with different actions, else with different digests, else the different ends."""
    state: int | None = None  # the first tick whose digests differ
    for begin, end, left, right in _common_stretches(mine, its, 1):
        acted = _first_action(left, right, begin, end)
        if acted is not None:
            return acted
        state = _first_state(left, right, begin, end) if state is None else state
    if state is not None:
        text = "all robots act the same, but internal state that affects no action differs"
        return Divergence(state, f"{text}, at the latest from tick {state:,}")
    ends = mine.last_tick, its.last_tick
    if ends[0] != ends[1]:
        tick = min(ends) + 1
        return Divergence(tick, f"the runs are equal up to tick {min(ends):,}, where one ends")
    return Divergence(None, f"the runs are equal in all {ends[0]:,} ticks")


def first_action(one: StoredFrames, other: StoredFrames, tick: int) -> Divergence | None:
    """The first tick from `tick` on in which robots act differently, if any."""
    for begin, end, left, right in _common_stretches(one, other, tick):
        acted = _first_action(left, right, begin, end)
        if acted is not None:
            return acted
    return None


def begin_alike(one: Content, other: Content) -> bool:
    """Whether two headers have the same fleet, orders, slots and floor."""
    for part in ("robots", "orders", "slots"):
        if any(not np.array_equal(one[part][name], other[part][name]) for name in one[part]):
            return False
    return all(
        np.array_equal(one["floor"][name], other["floor"][name])
        for name in ("kind", "exits", "capacity", "bays")
    )


def _common_stretches(
    one: StoredFrames, other: StoredFrames, tick: int
) -> Iterator[tuple[int, int, Content, Content]]:
    """First and last tick that a frame of each run have in common, from `tick` on, and the frames."""
    while True:
        left, right = one.ticks_with(tick), other.ticks_with(tick)
        if left is None or right is None:
            return
        for name, frame in zip("AB", (left, right), strict=True):
            if frame["first"] > tick:
                raise InputError(
                    f"recording {name} has fewer ticks than it declares: the file was altered"
                )
        end = min(frame["first"] + len(frame["executed"]) - 1 for frame in (left, right))
        yield tick, end, left, right
        tick = end + 1


def _first_action(one: Content, other: Content, begin: int, end: int) -> Divergence | None:
    """The first tick of a stretch in which robots act differently."""
    did = _rows(one, "executed", begin, end) != _rows(other, "executed", begin, end)
    acted = np.flatnonzero(did.any(axis=1))
    if not acted.size:
        return None
    return _acted(begin + int(acted[0]), np.flatnonzero(did[acted[0]]))


def _acted(tick: int, robots: NDArray[np.intp]) -> Divergence:
    who = f"robot {robots[0]}" + (f" and {len(robots) - 1} more" if len(robots) > 1 else "")
    return Divergence(tick, f"the runs differ first at tick {tick:,}: {who}; x goes there")


def _first_state(one: Content, other: Content, begin: int, end: int) -> int | None:
    """The first tick for which both runs have digests that differ."""
    mine, its = _rows(one, "digests", begin, end), _rows(other, "digests", begin, end)
    both = mine.any(axis=1) & its.any(axis=1)
    differ = np.flatnonzero(both & (mine != its).any(axis=1))
    return begin + int(differ[0]) if differ.size else None


def _rows(frame: Content, name: str, begin: int, end: int) -> NDArray[np.uint64]:
    first = frame["first"]
    rows: NDArray[np.uint64] = frame[name][begin - first : end + 1 - first]
    return rows
