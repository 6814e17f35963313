"""The files that a scenario consists of: its own, and those that its texts name."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from automaton.errors import InputError
from automaton.scenario.reading import find, read

MAX_NAME: Final = 255  # characters of a file's name; pictures of floors are texts, too


def named_files(scenario: str | Path) -> tuple[Path, ...]:
    """The file of a scenario, and the files beside it that it names; its own first.

    A scenario that cannot be read names no others. Raises InputError if there is no such scenario.
    """
    own = find(scenario)
    try:
        document = read(own)
    except InputError:
        return (own,)
    paths = (document.folder / text for text in _texts(document.data))
    return (own, *dict.fromkeys(path for path in paths if os.path.isfile(path) and path != own))


def _texts(value: Any) -> Iterator[str]:
    """The texts of a document that may be names of files."""
    if isinstance(value, dict):
        for inner in value.values():
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)
    elif isinstance(value, str) and 0 < len(value) <= MAX_NAME and value.isprintable():
        yield value
