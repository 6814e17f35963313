"""The lines under the map of a film.

    tick 1,234 of 2,616   617 s   3 work   1 wait   23/50 delivered                robot 2   visits

Every number has its place, whatever its value, so that words stand still and few characters change.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from automaton.history.snapshot import summarize
from automaton.units import Unit, number
from tui.render import styles
from tui.render.glyphs import Codes, code, text
from tui.render.styles import style

if TYPE_CHECKING:  # it needs Numba
    from automaton.history.snapshot import Snapshot

GAP: Final = 2
TIME_DIGITS: Final = 5  # "616.5" is as wide as numbers below 1,000 get in most units


class Word(NamedTuple):
    """Something said in one colour."""

    words: str
    fg: int
    gap: int = GAP  # before it


class Status:
    """What is said of each tick, in one row if there is room, else in two; below it the key."""

    def __init__(
        self,
        last: int,
        robots: int,
        orders: int,
        tick: Unit,
        chosen: str,
        key: Sequence[str] = (),  # what the signs of a layer mean, in a row of its own
    ) -> None:
        self.last, self.unit, self.chosen = last, tick, chosen
        self.key = [Word(words, styles.COLOUR_DIM) for words in key]
        self.robots_width, self.orders_width = len(f"{robots:,}"), len(f"{orders:,}")
        self.orders = orders

    @property
    def widths(self) -> tuple[int, int]:
        """Of the words of time, and of those of the fleet."""
        return _width(self._time(self.last)), _width(self._fleet(0, 0, 0, 1))

    @property
    def least(self) -> int:
        """Columns with which nothing is left out."""
        return max(*self.widths, _width(self.key))

    def rows(self, columns: int) -> int:
        """How many it takes, the key included."""
        return (1 if sum(self.widths) <= columns else 2) + bool(self.key)

    def codes(self, snapshot: Snapshot, columns: int) -> Codes:
        """(rows, columns) codes."""
        time = self._time(snapshot.tick)
        now = summarize(snapshot)
        fleet = self._fleet(now.working, now.waiting, now.delivered, now.circling)
        lines = [time + fleet] if sum(self.widths) <= columns else [time, fleet]
        lines += [self.key] if self.key else []
        return np.stack([_line(words, columns) for words in lines])

    def _time(self, tick: int) -> list[Word]:
        last = f"{self.last:,}"
        said = [
            Word(f"tick {tick:>{len(last)},}", styles.COLOUR_SELECTED),
            Word(f"of {last}", styles.COLOUR_DIM, 1),
        ]
        if self.unit.size != 1:
            width = max(TIME_DIGITS, len(number(self.unit.of(self.last))))
            said.append(
                Word(f"{number(self.unit.of(tick)):>{width}} {self.unit.plural}", styles.COLOUR_DIM)
            )
        return said + ([Word(self.chosen, styles.COLOUR_CURSOR)] if self.chosen else [])

    def _fleet(self, working: int, waiting: int, delivered: int, circling: int) -> list[Word]:
        width = self.robots_width
        done = f"{delivered:>{self.orders_width},}/{self.orders:,} delivered"
        said = [
            Word(f"{working:>{width},} work", styles.COLOUR_ROBOT),
            Word(
                f"{waiting:>{width},} wait", styles.COLOUR_WAITING if waiting else styles.COLOUR_DIM
            ),
            Word(done, styles.COLOUR_DONE),
        ]
        if circling:
            said.append(Word(f"{circling:>{width},} in a wait cycle", styles.COLOUR_FAULT))
        return said


def _width(words: list[Word]) -> int:
    return sum(len(word.words) + word.gap for word in words)


def _line(words: list[Word], columns: int) -> Codes:
    """(columns,) codes; words for which there is no room are left out."""
    line = np.full(columns, code(style(styles.COLOUR_TEXT, styles.COLOUR_VOID), 0))
    end = -1  # the first word begins in column 1
    for word in words:
        begin = end + word.gap
        end = begin + len(word.words)
        if end > columns:
            break
        line[begin:end] = code(
            style(word.fg, styles.COLOUR_VOID), np.array(text(word.words), np.uint32)
        )
    return line
