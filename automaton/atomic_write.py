"""Write files atomically: a file gets its final name when it is complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from automaton.errors import InputError


@contextmanager
def atomic_writer(path: Path) -> Iterator[BinaryIO]:
    """Open a file that replaces `path` at the end, unless an exception is raised. Raises InputError."""
    try:
        with replacing(path, path.with_name(f".{path.name}.{os.getpid()}.part")) as file:
            yield file
    except OSError as error:
        raise cannot_write_error(error.strerror or str(error), path) from error


@contextmanager
def replacing(path: Path, part: Path, durable: bool = False) -> Iterator[BinaryIO]:
    """Open the file `part`, which gets the name `path` at the end, unless an exception is raised.

    durable: the data is on the disk before the file gets its name, and then the name, too. Raises
    OSError.
    """
    try:
        part.unlink(missing_ok=True)  # left by a killed process
        with part.open("xb") as file:
            yield file
            if durable:
                file.flush()
                os.fsync(file.fileno())
        put_in_place(part, path, durable)
    finally:
        with suppress(OSError):  # of a read-only file system
            part.unlink(missing_ok=True)


def put_in_place(part: Path, path: Path, durable: bool = False) -> None:
    """Give a complete file its final name. Raises OSError."""
    os.replace(part, path)
    if durable:
        handle = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def cannot_write_error(why: str, path: Path) -> InputError:
    """The error about a file that cannot be written."""
    return InputError(f"cannot write it: {why}", str(path))
