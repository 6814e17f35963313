"""Lines of a text file, with the place of whatever is wrong in them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from automaton.errors import InputError
from automaton.scenario.reading import read_text
from automaton.units import count

WHOLE: Final = re.compile(r"[+-]?[0-9]{1,10}")
MAX_SHOWN: Final = 30  # characters of what is wrong


class Line(NamedTuple):
    """A line with content."""

    number: int  # in its file, from 1
    text: str  # without blanks at its end


def lines_of(path: Path) -> list[str]:
    """Return the lines of a text file, blanks at their ends included. Raises InputError."""
    if not os.path.exists(path):
        raise InputError("no such file", str(path))
    return read_text(path).replace("\r", "\n").split("\n")


def content_lines(path: Path) -> list[Line]:
    """Return the lines of a file that are neither empty nor comments. Raises InputError."""
    lines = (Line(number, text.rstrip()) for number, text in enumerate(lines_of(path), 1))
    return [line for line in lines if line.text and not line.text.lstrip().startswith("#")]


def quoted(text: str) -> str:
    """Return a text as an error shows it, or 'nothing'."""
    shown = text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."
    return repr(shown) if text else "nothing"


def whole_number(text: str, what: str, file: str, line: int, column: int = 0) -> int:
    """Return a text as a whole number. `column`: of its file, from 1; 0: not said.

    Raises InputError.
    """
    word = text.strip()
    if not WHOLE.fullmatch(word):
        place = f"column {column}: " if column else ""
        raise InputError(f"{place}{what} must be a whole number, found {quoted(word)}", file, line)
    return int(word)


def split_columns(text: str, separator: str) -> Iterator[tuple[int, str]]:
    """Yield (column from 1, text) of what lies between separators, blanks included."""
    column = 1
    for part in text.split(separator):
        yield column, part
        column += len(part) + len(separator)


def counted_lines(lines: Sequence[Line], what: str, file: str) -> Sequence[Line]:
    """Return the lines below the count that comes first; `what`: "agent", "task".

    Raises InputError where there are more or fewer lines than the count says.
    """
    if not lines:
        raise InputError(f"is empty; its first line must be the number of {what}s", file)
    stated = whole_number(lines[0].text, f"the number of {what}s", file, lines[0].number)
    below = lines[1:]
    if len(below) != stated or not stated:
        line = below[stated].number if 0 <= stated < len(below) else lines[0].number
        raise InputError(
            f"line {lines[0].number} says {count(stated, what)}, the file has {len(below):,}",
            file,
            line,
        )
    return below
