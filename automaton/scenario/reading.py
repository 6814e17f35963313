"""Scenarios as files: found by path or by the name of a shipped one, read within limits."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any, Final

from automaton.errors import InputError, nearest
from automaton.scenario.document import Document, parse

MAX_BYTES: Final = 8_000_000
STUDY_KEYS: Final = frozenset(
    ("scenario", "factors", "points", "replications", "analysis", "common_random_numbers")
)
SHIPPED_FOLDER: Final = Path(__file__).resolve().parent.parent.parent / "layouts"


# What recordings begin with (automaton.evidence.recording.frames): scenarios know none.
RECORDING_START: Final = b"\x93AUTOMATON\r\n"
STUDIES_ARE_SWEPT: Final = "`automaton sweep STUDY --out FOLDER` does its runs"


def shipped() -> dict[str, Path]:
    """The scenarios that come with the package, by name."""
    return {
        path.stem: path
        for path in sorted(SHIPPED_FOLDER.glob("*.yaml"), key=lambda path: path.stem)
    }


def find(name: str | Path) -> Path:
    """The file of a scenario: a path, or the name of a shipped one. Raises InputError."""
    path = Path(name)  # os.path takes a name that is too long for one that there is not
    if os.path.isfile(path):
        return path
    known = shipped()
    if str(name) in known:
        return known[str(name)]
    if os.path.isdir(path):
        raise InputError("is a folder, not a scenario file", str(name))
    if os.path.exists(path):
        raise InputError("is not a regular file", str(name))
    if os.sep in str(name) or path.suffix in (".yaml", ".yml"):
        raise InputError("no such file", str(name))
    if str(name) in {path.stem for path in (SHIPPED_FOLDER / "studies").glob("*.yaml")}:
        raise InputError(f"'{name}' is a study; {STUDIES_ARE_SWEPT}")
    hint = nearest(str(name), known) or f"; there are {', '.join(known)}"
    raise InputError(f"no file and no shipped scenario is called '{name}'{hint}")


def is_recording(path: Path) -> bool:
    """Whether a file begins as recordings do. Raises OSError."""
    if not os.path.isfile(path):
        return False
    with path.open("rb") as stream:
        return stream.read(len(RECORDING_START)) == RECORDING_START


def read_text(path: Path) -> str:
    """The text of a file of at most MAX_BYTES bytes. Raises InputError."""
    file = str(path)
    try:
        if is_recording(path):
            raise InputError("is a recording, not a scenario; automaton replay shows it", file)
        size = path.stat().st_size
        if size > MAX_BYTES:
            limit = MAX_BYTES // 1_000_000
            message = f"has {size / 1e6:,.1f} MB; scenarios and floors may have {limit} MB at most"
            raise InputError(message, file)
        if not os.path.isfile(path):
            raise InputError("is not a regular file", file)
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read: {reason}", file) from None
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("is UTF-16 text; save it as UTF-8", file)
    if b"\0" in content[:4096]:
        raise InputError("is not a text file (it holds zero bytes)", file)
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        byte = content[error.start]
        raise InputError(f"is not UTF-8 text (byte {byte:#04x})", file, line) from None


def content_hash(file: Path) -> str:
    """16 hex digits of the content of a file; "" if it cannot be read, or is not a regular file."""
    if not os.path.isfile(file):
        return ""
    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()[:16]
    except OSError:
        return ""


def is_study(data: dict[str, Any]) -> bool:
    """Whether what a file says means to be a study and not a scenario."""
    return "layout" not in data and not STUDY_KEYS.isdisjoint(data)


def read(name: str | Path) -> Document:
    """Read a scenario by path or by shipped name, without checking what it says."""
    path = find(name)
    text = read_text(path)
    file = str(path)
    data, root = parse(text, file)
    if data is None:
        raise InputError("is empty; a scenario needs at least name, layout and fleet", file)
    if not isinstance(data, dict):
        raise InputError("a scenario has keys such as name, layout and fleet; found none", file, 1)
    return Document(data=data, file=file, folder=path.parent, text=text, root=root)
