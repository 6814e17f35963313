"""Gather what is wrong in the rows of a file: the first of each kind, and how many more there are."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Final

from automaton.errors import InputError, InputErrors
from automaton.units import count

MAX_KINDS: Final = 5  # of mistakes that are shown


@dataclass
class _Kind:
    """Mistakes of one kind."""

    line: int  # of the first
    sentence: Callable[[], str]
    rows: int


@dataclass
class RowErrors:
    """The mistakes in the rows of a file."""

    file: str
    _kinds: dict[Hashable, _Kind] = field(default_factory=dict)

    def add(self, kind: Hashable, line: int, sentence: Callable[[], str], rows: int = 1) -> None:
        """Add mistakes of a kind, of which the first stands at a line.

        `sentence` describes it; of each kind only the one that comes first in the file is asked.
        """
        known = self._kinds.get(kind)
        if known is None:
            self._kinds[kind] = _Kind(line, sentence, rows)
            return
        known.rows += rows
        if line < known.line:
            known.line, known.sentence = line, sentence

    def raise_any(self) -> None:
        """Raise InputErrors if there is a mistake."""
        if not self._kinds:
            return
        kinds = sorted(self._kinds.values(), key=lambda kind: kind.line)
        errors = []
        for kind in kinds[:MAX_KINDS]:
            more = f"; {kind.rows - 1:,} more such row{'s' if kind.rows > 2 else ''}"
            text = kind.sentence() + (more if kind.rows > 1 else "")
            errors.append(InputError(text, self.file, kind.line))
        if len(kinds) > MAX_KINDS:
            text = f"there are mistakes of {count(len(kinds) - MAX_KINDS, 'more kind')}"
            errors.append(InputError(text, self.file))
        raise InputErrors(errors)
