"""A bound of time on each decision of a strategy in Python: a guard, which never changes a result.

A thread looks on. When a decision has taken too long, it raises NoAnswer in the thread of the run, at
the next instruction of Python there; who waits in compiled code hears it when that is over.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from weakref import ref

LOOKS = 10  # in the time that a decision may take


class NoAnswer(BaseException):
    """A strategy has not answered in time. No Exception: strategies catch those."""


class Watchdog:
    """Ends the decisions of one simulation that take more than so many seconds."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._lock = threading.Lock()
        self._deciding = 0  # the thread that is watched
        self._until = 0.0
        self._raised = False
        text = f"no answer within {seconds:g} s (--strategy-timeout)"
        self._error = type("NoAnswer", (NoAnswer,), {"__str__": lambda _: text})
        threading.Thread(target=_look_on, args=(ref(self),), daemon=True).start()

    @contextmanager
    def watching(self) -> Iterator[None]:
        """A decision, in this thread."""
        self._until = time.monotonic() + self.seconds
        self._raised = False
        self._deciding = threading.get_ident()
        try:
            yield
        finally:
            self._deciding = 0
            with self._lock:  # the error comes before here, or not any more
                if self._raised:
                    _raise_in(threading.get_ident(), None)

    def look(self) -> None:
        """Raise the error if it is time; again and again, since a strategy may catch it."""
        with self._lock:
            if self._deciding and time.monotonic() > self._until:
                self._until = time.monotonic() + self.seconds
                self._raised = True
                _raise_in(self._deciding, self._error)


def _look_on(watched: ref[Watchdog]) -> None:
    while (watchdog := watched()) is not None:
        watchdog.look()
        pause = watchdog.seconds / LOOKS
        del watchdog
        time.sleep(pause)


def _raise_in(thread: int, error: type[BaseException] | None) -> None:
    """Raise an error in a thread at its next instruction; None: not any more."""
    raised = None if error is None else ctypes.py_object(error)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), raised)
