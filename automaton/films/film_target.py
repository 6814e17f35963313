"""Where a film may be written."""

from __future__ import annotations

from pathlib import Path

from automaton.atomic_write import cannot_write_error
from automaton.recording.frames import MAGIC


def checked(path: Path) -> Path:
    """A place for a file, links followed. Raises InputError before anything is computed."""
    try:
        path = path.resolve()
        if path.is_dir():
            raise cannot_write_error("this is a folder", path)
        if not path.parent.is_dir():
            raise cannot_write_error("there is no such folder", path.parent)
        if path.exists() and not path.is_file():
            raise cannot_write_error("this is not a regular file; '-' is standard output", path)
        if path.exists() and _is_recording(path):
            raise cannot_write_error("this is a recording; --out names another file", path)
    except (OSError, RuntimeError) as error:
        raise cannot_write_error(
            getattr(error, "strerror", None) or "links in a circle", path
        ) from None
    return path


def _is_recording(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC
