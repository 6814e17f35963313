"""Signals: the viewer leaves in good order, and by force if it cannot.

A lost connection (SIGHUP) leaves Textual with a terminal that takes nothing any more: its writer
dies and the program would hang. Then the run is closed here, so that its recording is whole.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
CLOSE_TIMEOUT_S: Final = 3.0


@contextmanager
def handled(leave: Callable[[int], None], close: Callable[[], None]) -> Iterator[None]:
    """While inside, a signal calls `leave(exit code)`; `close` if that did not help in time."""

    def on_signal(number: int, _: FrameType | None) -> None:
        code = 128 + number
        guard = threading.Timer(CLOSE_TIMEOUT_S, _leave_by_force, (code, close))
        guard.daemon = True
        guard.start()
        leave(code)

    before = {number: signal.signal(number, on_signal) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave_by_force(code: int, close: Callable[[], None]) -> None:
    closing = threading.Thread(target=close, daemon=True)
    closing.start()
    closing.join(CLOSE_TIMEOUT_S)  # a strategy that hangs is not waited for
    os._exit(code)
