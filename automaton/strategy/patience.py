"""A time limit for each decision of a strategy in Python: a guard, which never changes a result.

In the main thread an alarm raises NoAnswer, which also ends sleeps and waits for locks and sockets.
In other threads, or if the alarm is in use, a watching thread raises NoAnswer at the next Python
instruction: this does not end waits. Neither interrupts compiled code.
"""

from __future__ import annotations

import ctypes
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn
from weakref import ref

LOOKS = 10  # checks per time limit


class NoAnswer(BaseException):
    """A strategy has not answered in time. Not an Exception, since strategies catch those."""


class Watchdog:
    """Ends decisions of one simulation that take longer than `seconds`."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._lock = threading.Lock()
        self._deciding = 0  # the thread that is watched
        self._until = 0.0
        self._raised = False
        text = f"no answer within {seconds:g} s (--strategy-timeout)"
        self._error = type("NoAnswer", (NoAnswer,), {"__str__": lambda _: text})
        self._thread: threading.Thread | None = None

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Limit the time of a decision, or of making a strategy, in this thread."""
        with self._alarm() if _alarm_is_free() else self._watched():
            yield

    @contextmanager
    def _alarm(self) -> Iterator[None]:
        def ring(*_: object) -> NoReturn:
            raise self._error

        usual = signal.signal(signal.SIGALRM, ring)
        signal.setitimer(signal.ITIMER_REAL, self.seconds, self.seconds)  # repeats
        try:
            try:
                yield
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0)
        finally:  # the alarm may have fired just before the line above
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, usual)

    @contextmanager
    def _watched(self) -> Iterator[None]:
        if self._thread is None:
            self._thread = threading.Thread(target=_look_on, args=(ref(self),), daemon=True)
            self._thread.start()
        self._until = time.monotonic() + self.seconds
        self._raised = False
        self._deciding = threading.get_ident()
        try:
            try:
                yield
            finally:
                self._deciding = 0
        finally:
            self._deciding = 0  # the error may have been raised in the line above
            with self._lock:  # waits for a thread that is about to raise it
                pass
            if self._raised:
                _drop_pending()

    def look(self) -> None:
        """Raise the error if the time is over; repeatedly, since a strategy may catch it."""
        with self._lock:
            if self._deciding and time.monotonic() > self._until:
                self._until = time.monotonic() + self.seconds
                self._raised = True
                _raise_in(self._deciding, self._error)


def _alarm_is_free() -> bool:
    """Whether this is the main thread and its alarm is unused."""
    return (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
        and signal.getitimer(signal.ITIMER_REAL)[0] == 0
    )


def _look_on(watched: ref[Watchdog]) -> None:
    while (watchdog := watched()) is not None:
        watchdog.look()
        pause = watchdog.seconds / LOOKS
        del watchdog
        time.sleep(pause)


def _raise_in(thread: int, error: type[BaseException]) -> None:
    """Raise an error in a thread at its next instruction."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(error))


class _Dropped(BaseException):
    """Takes the place of an error that has not been raised yet."""


def _drop_pending() -> None:
    """Drop an error that is pending in this thread.

    Cancelling it would leave CPython 3.11 looking for it before each instruction, and for ever in a
    function that is profiled or traced. So another one takes its place, and is raised here.
    """
    try:
        _raise_in(threading.get_ident(), _Dropped)
        while True:
            pass
    except _Dropped:
        pass
