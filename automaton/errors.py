"""Errors that are one sentence: bad input with its file and line, and workers that die."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from automaton.printable import one_line


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
