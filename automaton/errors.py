"""Errors as one sentence: invalid input with file and line, and workers that die.

Checks know values, not files. They yield a `Finding` for each error; functions that cannot continue
raise `InvalidValueError`. The code that has read the file adds the line to the error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from automaton.printable import one_line

Keys = tuple[str | int, ...]  # keys of a value in a document: ("fleet", "start", 0)
WHOLE_LIST: Final = -1  # instead of an index: the list itself, for missing entries


class InputError(Exception):
    """An error in the user's input; `str` gives "FILE:LINE: sentence"."""

    def __init__(self, message: str, file: str | None = None, line: int | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line

    def __str__(self) -> str:
        if self.file is None:
            return one_line(self.message)
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return one_line(f"{place}: {self.message}")

    def at(self, file: str | None, line: int | None = None) -> InputError:
        """The same error with file and line, unless it already has them."""
        if self.file is not None:
            return self
        return InputError(self.message, file, line)


class InputErrors(InputError):
    """Several errors; `str` gives a line for each."""

    def __init__(self, errors: Sequence[InputError]) -> None:
        first = errors[0]
        others = "".join(f"; {error}" for error in errors[1:])
        super().__init__(first.message + others, first.file, first.line)
        self.errors = tuple(errors)

    def __str__(self) -> str:
        return "\n".join(map(str, self.errors))


class Finding(NamedTuple):
    """The objection of a check to a value."""

    keys: Keys  # keys of the value
    sentence: str


class InvalidValueError(InputError):
    """An invalid value at known keys; the code that has read the file knows the line."""

    def __init__(self, keys: Keys, message: str) -> None:
        super().__init__(message)
        self.keys = keys

    def __reduce__(self) -> tuple[type[InvalidValueError], tuple[Keys, str]]:
        return type(self), (self.keys, self.message)


def refuse(findings: Iterable[Finding]) -> None:
    """Raise InvalidValueError for the first finding, if there is one.

    So a check may rely on the checks before it.
    """
    for keys, sentence in findings:
        raise InvalidValueError(keys, sentence)


class WorkerDiedError(Exception):
    """A worker process died or was killed."""

    def __init__(self) -> None:
        super().__init__("a worker process died, or was killed; fewer --workers take less memory")


def nearest(name: str, candidates: Iterable[str]) -> str:
    """A phrase with the candidate most similar to `name`: " (did you mean 'x'?)" or ""."""
    import difflib  # only needed for an error

    known = list(candidates)
    lowered = {candidate.lower(): candidate for candidate in known}
    close = difflib.get_close_matches(name.lower(), lowered, n=1, cutoff=0.6)
    return f" (did you mean '{lowered[close[0]]}'?)" if close else ""


def alternatives(candidates: Iterable[str]) -> str:
    """The candidates as text for an error: "a, b or c"."""
    known = list(candidates)
    if len(known) < 2:
        return "".join(known)
    return f"{', '.join(known[:-1])} or {known[-1]}"
