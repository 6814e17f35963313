"""Errors that are one sentence: bad input with its file and line, and workers that die.

Checks know values, not files. They yield what they find wrong, each a `Finding`; functions that cannot go
on raise `InvalidValueError`. Whoever has read the file gives the error its line.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from automaton.printable import one_line

Keys = tuple[str | int, ...]  # the way to a value of a document: ("fleet", "start", 0)
WHOLE_LIST: Final = -1  # in the place of an index: the list as such, and what it lacks


class InputError(Exception):
    """Something that a user wrote is wrong; `str` gives "FILE:LINE: sentence"."""

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
        """The same error with its place, unless it already has one."""
        if self.file is not None:
            return self
        return InputError(self.message, file, line)


class InputErrors(InputError):
    """Several things that are wrong; `str` gives a line for each."""

    def __init__(self, errors: Sequence[InputError]) -> None:
        first = errors[0]
        others = "".join(f"; {error}" for error in errors[1:])
        super().__init__(first.message + others, first.file, first.line)
        self.errors = tuple(errors)

    def __str__(self) -> str:
        return "\n".join(map(str, self.errors))


class Finding(NamedTuple):
    """What a check has to say against a value."""

    keys: Keys  # the way to the value
    sentence: str


class InvalidValueError(InputError):
    """A value is wrong, and its keys are known; whoever has read the file knows its line."""

    def __init__(self, keys: Keys, message: str) -> None:
        super().__init__(message)
        self.keys = keys

    def __reduce__(self) -> tuple[type[InvalidValueError], tuple[Keys, str]]:
        return type(self), (self.keys, self.message)


def refuse(findings: Iterable[Finding]) -> None:
    """Raise InvalidValueError for the first of the findings, if there are any.

    So a check may rely on what the checks before it look at.
    """
    for keys, sentence in findings:
        raise InvalidValueError(keys, sentence)


class WorkerDiedError(Exception):
    """A worker process ended by itself, or somebody ended it."""

    def __init__(self) -> None:
        super().__init__("a worker process died, or was killed; fewer --workers take less memory")


def nearest(name: str, candidates: Iterable[str]) -> str:
    """A closing phrase that names the candidate most like `name`: " (did you mean 'x'?)" or ""."""
    import difflib  # only needed on the way to an error

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
