"""Gather what is wrong in the rows of a file: the first of each kind, and where more of them are."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Final

from automaton.errors import InputError, InputErrors
from automaton.units import count

MAX_KINDS: Final = 5  # of mistakes that are shown
MAX_LINES: Final = 10  # that are named, of more rows with a mistake


@dataclass
class _Kind:
    """Mistakes of one kind."""

    lines: list[int]
    sentence: Callable[[], str]  # of the first


@dataclass
class RowErrors:
    """The mistakes in the rows of a file."""

    file: str
    _kinds: dict[Hashable, _Kind] = field(default_factory=dict)

    def add(self, kind: Hashable, lines: Sequence[int], sentence: Callable[[], str]) -> None:
        """Add mistakes of a kind, in the sequence of their lines.

        `sentence` describes the first; of each kind only the one that comes first in the file is asked.
        """
        known = self._kinds.get(kind)
        if known is None:
            self._kinds[kind] = _Kind(list(lines), sentence)
            return
        if lines[0] < known.lines[0]:
            known.sentence = sentence
        known.lines = sorted([*known.lines, *lines])

    def raise_any(self) -> None:
        """Raise InputErrors if there is a mistake."""
        if not self._kinds:
            return
        kinds = sorted(self._kinds.values(), key=lambda kind: kind.lines[0])
        errors = []
        for kind in kinds[:MAX_KINDS]:
            text = kind.sentence() + _more(kind.lines[1:])
            errors.append(InputError(text, self.file, kind.lines[0]))
        if len(kinds) > MAX_KINDS:
            text = f"there are mistakes of {count(len(kinds) - MAX_KINDS, 'more kind')}"
            errors.append(InputError(text, self.file))
        raise InputErrors(errors)


def _more(lines: Sequence[int]) -> str:
    """The rows that have a mistake, too: "; 3 more such rows, in lines 7, 9 and 12"."""
    if not lines:
        return ""
    if len(lines) == 1:
        return f"; 1 more such row, in line {lines[0]}"
    shown, rest = lines[:MAX_LINES], len(lines) - MAX_LINES
    if rest <= 0:
        shown, last = lines[:-1], str(lines[-1])
    else:
        last = f"{rest:,} more"
    where = f"{', '.join(map(str, shown))} and {last}"
    return f"; {len(lines):,} more such rows, in lines {where}"
