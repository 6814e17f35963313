"""What `automaton serve` says of requests that fail: nothing where the other side is to blame."""

from __future__ import annotations

import logging
import sys
from typing import Final

from aiohttp.http_exceptions import HttpProcessingError

from automaton.printable import one_line

LONGEST_LINE: Final = 300  # characters
# Requests that are not HTTP, and connections that went away while they were answered.
NOT_OURS: Final = (HttpProcessingError, ConnectionError)


class _OneLine(logging.Handler):
    """Writes what is ours to mend as one line on stderr, without a traceback."""

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, NOT_OURS):
            return
        what = record.getMessage() if error is None else f"{type(error).__name__}: {error}"
        said = one_line(" ".join(what.split()), LONGEST_LINE)
        print(f"automaton: a request failed, {said}", file=sys.stderr, flush=True)


def request_log() -> logging.Logger:
    """Return the logger for the server of aiohttp, which would print a traceback of each request."""
    log = logging.Logger(
        "automaton.serve", logging.ERROR
    )  # of no family: no other handler hears it
    log.addHandler(_OneLine())
    return log
