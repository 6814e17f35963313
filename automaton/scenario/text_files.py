"""Text files of users: found by path or shipped name, read within limits, and their lines."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from automaton.errors import InputError, Keys, nearest
from automaton.units import count

MAX_TEXT_BYTES: Final = 8_000_000
MAX_QUOTED: Final = 30  # characters of the error
WHOLE_NUMBER: Final = re.compile(r"[+-]?[0-9]{1,10}")
SHIPPED_FOLDER: Final = Path(__file__).resolve().parent.parent.parent / "layouts"
# First bytes of recordings (automaton.recording.frames), which this package does not import.
RECORDING_START: Final = b"\x93AUTOMATON\r\n"
STUDIES_ARE_SWEPT: Final = "run it with `automaton sweep STUDY --out FOLDER`"


def shipped() -> dict[str, Path]:
    """The scenarios that come with the package, by name."""
    return {
        path.stem: path
        for path in sorted(SHIPPED_FOLDER.glob("*.yaml"), key=lambda path: path.stem)
    }


def find(name: str | Path) -> Path:
    """The file of a scenario: a path, or the name of a shipped one. Raises InputError."""
    path = Path(name)  # for os.path, a name that is too long does not exist
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
    """Whether a file begins like a recording. Raises OSError."""
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
        if size > MAX_TEXT_BYTES:
            limit = MAX_TEXT_BYTES // 1_000_000
            message = f"has {size / 1e6:,.1f} MB; scenarios and floors may have {limit} MB at most"
            raise InputError(message, file)
        if not os.path.isfile(path):
            raise InputError("is not a regular file", file)
        with path.open("rb") as stream:
            content = stream.read(MAX_TEXT_BYTES)
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


# Lines of a text file; errors have line and column.


class ContentLine(NamedTuple):
    """A line with content."""

    number: int  # in the file, from 1
    text: str  # without trailing blanks


def lines_of(path: Path) -> list[str]:
    """Return the lines of a text file with their trailing blanks. Raises InputError."""
    if not os.path.exists(path):
        raise InputError("no such file", str(path))
    return read_text(path).replace("\r", "\n").split("\n")


def content_lines(path: Path) -> list[ContentLine]:
    """Return the lines of a file without empty lines and comments. Raises InputError."""
    lines = (ContentLine(number, text.rstrip()) for number, text in enumerate(lines_of(path), 1))
    return [line for line in lines if line.text and not line.text.lstrip().startswith("#")]


def quoted(text: str) -> str:
    """Return a text as an error shows it, or 'nothing'."""
    shown = text if len(text) <= MAX_QUOTED else text[: MAX_QUOTED - 3] + "..."
    return repr(shown) if text else "nothing"


def whole_number(text: str, what: str, file: str, line: int, column: int = 0) -> int:
    """Return a text as a whole number. `column`: in its file, from 1; 0: unknown.

    Raises InputError.
    """
    word = text.strip()
    if not WHOLE_NUMBER.fullmatch(word):
        place = f"column {column}: " if column else ""
        raise InputError(f"{place}{what} must be a whole number, found {quoted(word)}", file, line)
    return int(word)


def split_columns(text: str, separator: str) -> Iterator[tuple[int, str]]:
    """Yield (column from 1, text) of the parts between separators, blanks included."""
    column = 1
    for part in text.split(separator):
        yield column, part
        column += len(part) + len(separator)


def counted_lines(lines: Sequence[ContentLine], what: str, file: str) -> Sequence[ContentLine]:
    """Return the lines below the count in the first line; `what`: "agent", "task".

    Raises InputError if the number of lines differs from the count.
    """
    if not lines:
        raise InputError(f"is empty; its first line must be the number of {what}s", file)
    stated = whole_number(lines[0].text, f"the number of {what}s", file, lines[0].number)
    below = lines[1:]
    if len(below) != stated or not stated:
        line = below[stated].number if 0 <= stated < len(below) else lines[0].number
        raise InputError(
            f"line {lines[0].number} says {count(stated, what)}, the file has {len(below):,}",
            file,
            line,
        )
    return below


class ListFile(NamedTuple):
    """A file whose lines became the entries of a list or a mapping of a scenario."""

    keys: Keys  # keys of that list
    file: str  # as errors name it
    lines: Any  # line of each entry, from 1, by index in a list or key in a mapping
