"""Where ticks lie in a row of characters between the numbers of its first and its last tick.

0 ⣀⣠⣤⣀⣀⣴⣤⣀⣀⣀⣠⣀ 50,000      the whole run
‹12,500 ⣀⣤⣀⣠⣀ 18,750›      a part of it: there is more on either side
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

MIN_TICKS_SHOWN: Final = 16  # ticks that are shown at least
MARGIN: Final = 8  # a part that is left by the present moves on so that this share lies behind it


class Part(NamedTuple):
    """Ticks of a run."""

    first: int
    last: int

    @property
    def ticks(self) -> int:
        return self.last - self.first

    def __contains__(self, tick: object) -> bool:
        return isinstance(tick, int) and self.first <= tick <= self.last

    def within(self, end: int) -> Part:
        """As long, but between 0 and the end."""
        ticks = min(self.ticks, end)
        first = min(max(self.first, 0), end - ticks)
        return Part(first, first + ticks)

    def zoomed(self, steps: int, at: int, end: int) -> Part:
        """Half as long for each step, or twice; the tick `at` stays where it is."""
        ticks = self.ticks >> steps if steps > 0 else self.ticks << -steps
        ticks = min(max(ticks, MIN_TICKS_SHOWN), end)
        before = (at - self.first) * ticks // max(1, self.ticks)
        return Part(at - before, at - before + ticks).within(end)

    def following(self, tick: int, end: int) -> Part:
        """The part that holds this tick: this one, or one that goes on from it."""
        if tick in self:
            return self
        margin = self.ticks // MARGIN
        first = tick - margin if tick > self.last else tick + margin - self.ticks
        return Part(first, first + self.ticks).within(end)


class Track(NamedTuple):
    """A part of a run in so many columns, of which the labels take some."""

    part: Part
    width: int
    more_before: bool = False
    more_after: bool = False

    @property
    def labels(self) -> tuple[str, str]:
        """Beside the track; < and > stand for the signs that there is more."""
        first, last = (f"{tick:,}" for tick in self.part)
        return "<" * self.more_before + first, last + ">" * self.more_after

    @property
    def left(self) -> int:
        """The column in which the track begins."""
        return len(self.labels[0]) + 1

    @property
    def columns(self) -> int:
        """Of the track alone."""
        return max(1, self.width - self.left - len(self.labels[1]) - 1)

    def column_of(self, tick: int) -> int:
        """Where a tick of the part is shown."""
        along = (tick - self.part.first) * (self.columns - 1) // max(1, self.part.ticks)
        return self.left + min(max(along, 0), self.columns - 1)

    def tick_at(self, column: int) -> int:
        """The first tick that is shown there."""
        along = min(max(column - self.left, 0), self.columns - 1)
        return self.part.first - (-along * self.part.ticks // max(1, self.columns - 1))

    def edges(self, many: int) -> NDArray[np.int64]:
        """(many + 1,) ticks that cut the part in pieces of the same length."""
        return np.linspace(*self.part, many + 1).astype(np.int64)


def track_of(part: Part | None, end: int, width: int) -> Track:
    """Of a part, or of the whole run."""
    whole = Part(0, end)
    part = whole if part is None else part
    return Track(part, width, part.first > 0, part.last < end)
