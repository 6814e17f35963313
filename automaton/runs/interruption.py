"""Ctrl-C and SIGTERM inside compiled code: even a tick that takes minutes ends at once.

Python runs signal handlers only after compiled code has returned. Long loops in compiled code
therefore poll a flag. A watcher thread reads signals from Python's wakeup descriptor and sets it:

    signal -> a byte in the pipe -> the watcher sets the flag -> the search returns -> the handler raises

Results computed after the flag is set are invalid and must be discarded. The watcher may read a
signal after its handler has raised; such a signal must not end a later run.
"""

from __future__ import annotations

import math
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, NoReturn

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Flag = NDArray[Any]  # (1,) int64: not 0 = return as soon as possible

INTERRUPT_PATIENCE_S: Final = 1.5  # for compiled code that polls no flag
JUST_NOW_S: Final = 0.5
COMPILERS_CALLBACKS: Final = "_raw_object_cache_"  # prefix of names of llvmlite's callbacks
RETRY_S: Final = 0.01  # until a signal is sent again whose exception would be lost
STOP_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
NO_SIGNAL: Final = -1  # no wakeup descriptor


class TerminatedError(KeyboardInterrupt):
    """SIGTERM, such as at the time limit of a job; handlers of KeyboardInterrupt catch it, too."""


class _Watcher:
    """A thread that reads signals while the main thread runs compiled code."""

    def __init__(self) -> None:
        self.flags: list[Flag] = []
        self.answered = -math.inf  # when our handler last ran
        self.other = NO_SIGNAL  # an event loop's wakeup descriptor, which receives signals as well
        self._process = 0
        self._read = self._write = NO_SIGNAL
        self._lock = threading.RLock()  # guards pipe and flags; reentrant, since a handler may run

    @contextmanager
    def listening(self, *flags: Flag) -> Iterator[None]:
        """Let signals set these flags, too, while inside. Main thread only."""
        if self._process != os.getpid():
            self._process = os.getpid()
            self._lock = threading.RLock()
            self._read, self._write = os.pipe()
            os.set_blocking(self._read, False)
            os.set_blocking(self._write, False)
            threading.Thread(target=self._listen, name="signals", daemon=True).start()
        before = signal.set_wakeup_fd(self._write, warn_on_full_buffer=False)
        if before != self._write:
            self.other = before
        outer = len(self.flags)
        try:
            with self._lock:
                self.forget()
                self.flags += flags
            yield
        finally:
            try:
                with self._lock:
                    del self.flags[outer:]
            finally:
                signal.set_wakeup_fd(before)

    def forget(self) -> None:
        """Drop pending signals, which the main thread has handled or is about to handle."""
        if self._process != os.getpid():
            return  # a fork: pipe and lock belong to the parent
        with self._lock:
            while self._next_signal():
                pass

    def _next_signal(self) -> int:
        """Read the next signal from the pipe and pass it on to the event loop; 0 if it is empty."""
        with suppress(BlockingIOError):
            byte = os.read(self._read, 1)
            self._pass_on(byte)
            return byte[0]
        return 0

    def _pass_on(self, byte: bytes) -> None:
        if self.other != NO_SIGNAL:
            try:
                os.write(self.other, byte)
            except BlockingIOError:
                pass  # the pipe is full
            except OSError:
                self.other = NO_SIGNAL  # the event loop has ended

    def _listen(self) -> None:
        poll = select.poll()
        poll.register(self._read, select.POLLIN)
        while True:
            poll.poll()
            with self._lock:
                heard = time.monotonic()
                number = self._next_signal()
                handler = signal.getsignal(number) if number else None
                if number in STOP_SIGNALS and handler in (_on_signal, signal.default_int_handler):
                    for flag in self.flags:  # handlers of other code may let the run continue
                        flag[0] = 1
            if handler is _on_signal:
                self._insist(number, heard)

    def _insist(self, number: int, heard: float) -> None:
        while time.monotonic() < heard + INTERRUPT_PATIENCE_S:
            if self.answered > heard - JUST_NOW_S:  # the handler may run before this thread
                return
            time.sleep(INTERRUPT_PATIENCE_S / 30)
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, _words(number) + b", at once\n")
        os._exit(128 + number)


_WATCHER: Final = _Watcher()


@contextmanager
def interruptible(flag: Flag) -> Iterator[None]:
    """Let signals set `flag` while inside; raise KeyboardInterrupt on exit if it is set.

    Only signals with our own handler or Python's set it, since other handlers may let the run
    continue. Signals reach the main thread only; other threads may set the flag to end a run.
    """
    if threading.current_thread() is threading.main_thread():
        with _WATCHER.listening(flag):
            yield
    else:
        yield
    if flag[0]:
        give_up()


def give_up() -> NoReturn:
    """Raise the exception of the signal handler, which Python runs on entry, or KeyboardInterrupt."""
    raise KeyboardInterrupt


@contextmanager
def signals_raise() -> Iterator[None]:
    """Let SIGINT raise KeyboardInterrupt and SIGTERM TerminatedError while inside.

    If compiled code does not return, they end the process. Signals that already have another handler
    or are ignored stay as they are.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual: dict[signal.Signals, Any] = {
        signal.SIGINT: signal.default_int_handler,
        signal.SIGTERM: signal.SIG_DFL,
    }
    ours = [number for number in STOP_SIGNALS if signal.getsignal(number) is usual[number]]
    for number in ours:
        signal.signal(number, _on_signal)
    tell, sys.unraisablehook = sys.unraisablehook, _raise_again
    try:
        with _WATCHER.listening():
            yield
    finally:
        sys.unraisablehook = tell
        for number in ours:
            signal.signal(number, usual[number])


def _on_signal(number: int, frame: FrameType | None) -> None:
    if _would_be_lost(frame):
        _send_again(number)
        return
    _WATCHER.forget()
    _WATCHER.answered = time.monotonic()
    if number == signal.SIGTERM:
        signal.signal(number, signal.SIG_IGN)  # a second SIGTERM must not cut off the final report
        raise TerminatedError
    raise KeyboardInterrupt


def _raise_again(lost: sys.UnraisableHookArgs) -> None:
    """Send a signal again if its exception was lost, as in `__del__`."""
    if not issubclass(lost.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(lost)
    elif issubclass(lost.exc_type, TerminatedError):
        signal.signal(signal.SIGTERM, _on_signal)
        _send_again(signal.SIGTERM)
    else:
        _send_again(signal.SIGINT)


def _send_again(number: int) -> None:
    threading.Timer(RETRY_S, os.kill, [os.getpid(), number]).start()


def _would_be_lost(frame: FrameType | None) -> bool:
    """Whether an exception raised here would be lost: in a callback of llvmlite, or in our hook."""
    lost_in = (COMPILERS_CALLBACKS, _raise_again.__name__)
    while frame is not None and not frame.f_code.co_name.startswith(lost_in):
        frame = frame.f_back
    return frame is not None


def _words(number: int) -> bytes:
    return b"automaton: terminated" if number == signal.SIGTERM else b"automaton: interrupted"
