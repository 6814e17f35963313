"""Text of others - names, keys, cells, messages of plug-ins - as it may be shown.

A terminal obeys control characters: they could clear the screen, or write what nobody has said. They
are shown as `\\u001b`, which is right in JSON, too. Names are cut, and a sentence stays one line.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, NoReturn, TextIO

LONGEST_NAME: Final = 100  # characters
LONGEST_SENTENCE: Final = 2000
FORMULA_SIGNS: Final = ("=", "+", "-", "@", "\t", "\r")  # what begins so, spreadsheets compute

# C0, DEL and C1, what else ends a line, and what turns the direction of writing.
_OBEYED: Final = "\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
_CONTROLS: Final = re.compile(f"[{_OBEYED}]")
_ALL_CONTROLS: Final = re.compile(f"[\t\n{_OBEYED}]")
# What this program and its libraries write to terminals: colours, and parts of lines again.
_OURS: Final = re.compile(
    f"(\x1b\\[(?:[0-9;]*m|[0-2]?K|[0-9]*A|\\?25[lh])|\r(?=\x1b\\[(?:[0-2]?K|[0-9]*A)))|[{_OBEYED}]"
)


def escaped(text: str) -> str:
    """Text of any number of lines without other control characters."""
    return text.translate(_SHOWN) if _CONTROLS.search(text) else text


def one_line(text: str, most: int = LONGEST_SENTENCE) -> str:
    """Text as one line of at most so many characters; too long a one loses its middle."""
    if len(text) > most:
        text = f"{text[: most * 2 // 3]} ... {text[len(text) - most // 3 :]}"
    return _ALL_CONTROLS.sub(_shown, text)


def cleaned(data: Any) -> Any:
    """Data of any depth in which all text is escaped."""
    if isinstance(data, str):
        return escaped(data)
    if isinstance(data, dict):
        return {cleaned(key): cleaned(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return type(data)(map(cleaned, data))
    return data


def cleaned_document(data: Any) -> Any:
    """Data of a file in which all text is escaped; a key is one line, and so is a `name`."""
    if isinstance(data, list):
        return [cleaned_document(value) for value in data]
    if not isinstance(data, dict):
        return cleaned(data)
    return {
        one_line(key): one_line(value, LONGEST_NAME)
        if key == "name" and isinstance(value, str)
        else cleaned_document(value)
        for key, value in data.items()
    }


def for_terminal(text: str) -> str:
    """Output as a terminal may get it: of control sequences only those that this program uses."""
    return _OURS.sub(lambda found: found[1] or _shown(found), text)


def _shown(found: re.Match[str]) -> str:
    return {"\n": "\\n", "\t": "\\t", "\r": "\\r"}.get(found[0], f"\\u{ord(found[0]):04x}")


# A match of its own for each of millions of characters would take a hundred bytes each.
_SHOWN: Final = {
    code: _shown(found) for code in range(0x2070) if (found := _CONTROLS.match(chr(code)))
}


class OutputError(Exception):
    """Standard output cannot be written: a disk is full."""


class PrintedText:
    """A standard stream to which whatever is printed goes through here; None: it goes nowhere."""

    def __init__(self, stream: Any, is_output: bool = True) -> None:
        self.stream = _nowhere() if stream is None else stream
        self.is_output = is_output

    def write(self, text: str) -> int:
        """Write text, with control characters shown; colours only to a terminal. Raises OutputError."""
        shown = for_terminal(text) if self.stream.isatty() else escaped(text)
        with self._writable():
            self.stream.write(shown)
        return len(text)

    @property
    def buffer(self) -> _PrintedBytes:
        """The stream as one of bytes, which are written as they are."""
        return _PrintedBytes(self)

    def flush(self) -> None:
        """Write what is held back. Raises OutputError."""
        with self._writable():
            self.stream.flush()

    @contextmanager
    def _writable(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            raise
        except OSError as error:
            self.give_up()
            if self.is_output:
                reason = (error.strerror or str(error)).lower()
                raise OutputError(f"standard output cannot be written: {reason}") from None

    def give_up(self) -> None:
        """What Python still holds back goes nowhere."""
        os.dup2(os.open(os.devnull, os.O_WRONLY), self.stream.fileno())

    def close(self) -> NoReturn:
        """Refused: a plug-in that closes it takes it away from everybody."""
        raise PermissionError("it has closed a standard stream")

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


class _PrintedBytes:
    """What writes bytes to a standard stream as `PrintedText` writes text."""

    def __init__(self, printed: PrintedText) -> None:
        self.printed = printed

    def write(self, data: bytes) -> int:
        """Write bytes. Raises OutputError."""
        with self.printed._writable():
            return int(self.printed.stream.buffer.write(data))
        return 0


def _nowhere() -> TextIO:
    return open(os.devnull, "w", encoding="utf-8")
