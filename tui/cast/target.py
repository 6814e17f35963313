"""The file that is made: it takes its name when it is whole, so that nothing is half-written."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from automaton.errors import InputError
from automaton.recording.frames import MAGIC


def checked(path: Path) -> Path:
    """A place for a file, links followed. Raises InputError before anything is computed."""
    try:
        path = path.resolve()
        if path.is_dir():
            raise _refusal("this is a folder", path)
        if not path.parent.is_dir():
            raise _refusal("there is no such folder", path.parent)
        if path.exists() and not path.is_file():
            raise _refusal("this is no ordinary file; '-' is standard output", path)
        if path.exists() and _is_recording(path):
            raise _refusal("this is a recording; --out names another file", path)
    except (OSError, RuntimeError) as error:
        raise _refusal(getattr(error, "strerror", None) or "links in a circle", path) from None
    return path


@contextmanager
def written(path: Path) -> Iterator[BinaryIO]:
    """A file that replaces `path` at the end, unless something goes wrong."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("xb") as file:
            yield file
        os.replace(part, path)
    except OSError as error:
        raise _refusal(error.strerror or str(error), path) from error
    finally:
        part.unlink(missing_ok=True)


def _is_recording(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def _refusal(why: str, path: Path) -> InputError:
    return InputError(f"cannot write it: {why}", str(path))
