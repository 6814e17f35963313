"""A file that takes its name when it is whole, so that nothing is left half-written."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from automaton.errors import InputError


@contextmanager
def written(path: Path) -> Iterator[BinaryIO]:
    """A file that replaces `path` at the end, unless something goes wrong. Raises InputError."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("xb") as file:
            yield file
        os.replace(part, path)
    except OSError as error:
        raise refusal(error.strerror or str(error), path) from error
    finally:
        with suppress(OSError):  # of a file system that is read-only
            part.unlink(missing_ok=True)


def refusal(why: str, path: Path) -> InputError:
    """The error about a file that cannot be written."""
    return InputError(f"cannot write it: {why}", str(path))
