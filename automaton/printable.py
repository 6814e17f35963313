"""Make foreign text (names, keys, cells, messages of plug-ins) safe to print.

A terminal obeys control characters: they could clear the screen, or fake output. They are escaped as
`\\u001b`, which is valid in JSON, too. Names are shortened, and a sentence stays on one line.
"""

from __future__ import annotations

import os
import re
import shutil
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final, NoReturn, TextIO

LONGEST_NAME: Final = 100  # characters
LONGEST_SENTENCE: Final = 2000
INDENT: Final = "  "  # of the second line of a sentence
FORMULA_SIGNS: Final = ("=", "+", "-", "@", "\t", "\r")  # spreadsheets compute texts that begin so

# C0, DEL and C1, other line ends, and characters that change the direction of writing.
_OBEYED: Final = "\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
_CONTROLS: Final = re.compile(f"[{_OBEYED}]")
_ALL_CONTROLS: Final = re.compile(f"[\t\n{_OBEYED}]")
# Sequences that this program and its libraries write to terminals: colours, erased parts of lines.
_OURS: Final = re.compile(
    f"(\x1b\\[(?:[0-9;]*m|[0-2]?K|[0-9]*A|\\?25[lh])|\r(?=\x1b\\[(?:[0-2]?K|[0-9]*A)))|[{_OBEYED}]"
)


def escaped(text: str) -> str:
    """Text of any number of lines, other control characters escaped."""
    return text.translate(_SHOWN) if _CONTROLS.search(text) else text


def one_line(text: str, most: int = LONGEST_SENTENCE) -> str:
    """Text as one line of at most `most` characters; a longer one loses its middle."""
    if len(text) > most:
        text = f"{text[: most * 2 // 3]} ... {text[len(text) - most // 3 :]}"
    return _ALL_CONTROLS.sub(_shown, text)


def cleaned(data: Any) -> Any:
    """Data of any depth with all text escaped."""
    if isinstance(data, str):
        return escaped(data)
    if isinstance(data, dict):
        return {cleaned(key): cleaned(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return type(data)(map(cleaned, data))
    return data


def cleaned_document(data: Any) -> Any:
    """Data of a file with all text escaped; keys and each `name` become one line."""
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
    """Output for a terminal, with only the control sequences that this program uses."""
    return _OURS.sub(lambda found: found[1] or _shown(found), text)


def wrapped_sentences(text: str) -> str:
    """Text in which the sentences of this program wrap at the width of the terminal."""
    lines = text.split("\n")
    return "\n".join(wrapped(line) if line.startswith("automaton: ") else line for line in lines)


def wrapped(line: str) -> str:
    """A line in as many lines as the terminal needs; with a word that fits in none, it stays as it is."""
    columns = shutil.get_terminal_size().columns
    if len(line) <= columns or max(map(len, line.split())) > columns - len(INDENT):
        return line
    return textwrap.fill(
        line, columns, subsequent_indent=INDENT, break_long_words=False, break_on_hyphens=False
    )


def _shown(found: re.Match[str]) -> str:
    return {"\n": "\\n", "\t": "\\t", "\r": "\\r"}.get(found[0], f"\\u{ord(found[0]):04x}")


# Separate matches for millions of characters would take 100 bytes each.
_SHOWN: Final = {
    code: _shown(found) for code in range(0x2070) if (found := _CONTROLS.match(chr(code)))
}


class OutputError(Exception):
    """Standard output cannot be written: a disk is full, for example."""


class PrintedText:
    """A standard stream with all output made safe; None: output is discarded.

    Before output to a terminal, `before` is called. Long sentences on stderr wrap at blanks there.
    """

    def __init__(
        self, stream: Any, is_output: bool = True, before: Callable[[], None] = lambda: None
    ) -> None:
        self.stream = _nowhere() if stream is None else stream
        self.is_output = is_output
        self.before = before

    def write(self, text: str) -> int:
        """Write text, with control characters shown; colours only to a terminal. Raises OutputError."""
        if self.stream.isatty():
            self.before()
            shown = for_terminal(text if self.is_output else wrapped_sentences(text))
        else:
            shown = escaped(text)
        with self._writable():
            self.stream.write(shown)
        return len(text)

    @property
    def buffer(self) -> _PrintedBytes:
        """The stream for bytes, which are written unchanged."""
        return _PrintedBytes(self)

    def flush(self) -> None:
        """Flush the stream. Raises OutputError."""
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
        """Discard the output that Python has buffered."""
        os.dup2(os.open(os.devnull, os.O_WRONLY), self.stream.fileno())

    def close(self) -> NoReturn:
        """Refused: a plug-in must not close a stream that others use."""
        raise PermissionError("it tried to close a standard stream")

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


class _PrintedBytes:
    """Writes bytes to a standard stream as `PrintedText` writes text."""

    def __init__(self, printed: PrintedText) -> None:
        self.printed = printed

    def write(self, data: bytes) -> int:
        """Write bytes. Raises OutputError."""
        with self.printed._writable():
            return int(self.printed.stream.buffer.write(data))
        return 0


def _nowhere() -> TextIO:
    return open(os.devnull, "w", encoding="utf-8")
