"""Write files atomically: a file gets its name when it is complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from automaton.errors import InputError


@contextmanager
def atomic_writer(path: Path) -> Iterator[BinaryIO]:
    """Open a file that replaces `path` at the end, unless something goes wrong. Raises InputError."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("xb") as file:
            yield file
        os.replace(part, path)
    except OSError as error:
        raise cannot_write_error(error.strerror or str(error), path) from error
    finally:
        with suppress(OSError):  # of a file system that is read-only
            part.unlink(missing_ok=True)


def cannot_write_error(why: str, path: Path) -> InputError:
    """The error about a file that cannot be written."""
    return InputError(f"cannot write it: {why}", str(path))
