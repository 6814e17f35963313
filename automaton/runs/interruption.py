"""Ctrl-C and SIGTERM inside compiled code: a tick that takes minutes ends within a moment.

Python runs the handler of a signal only when compiled code has returned. So whatever may take long
there looks at a flag now and then, and a thread that hears of signals through Python's wakeup
descriptor sets it:

    signal -> a byte in the pipe -> the watcher sets the flag -> the search returns -> the handler raises

What is computed after the flag is set is worthless, and nobody may keep it. The watcher may hear of a
signal when its handler has long raised: such a signal ends no later run.
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

INTERRUPT_PATIENCE_S: Final = 1.5  # with compiled code that looks at no flag
JUST_NOW_S: Final = 0.5
COMPILERS_CALLBACKS: Final = "_raw_object_cache_"  # names of functions of llvmlite begin so
RETRY_S: Final = 0.01  # until a signal comes again that came where it cannot be heard
STOP_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
NO_SIGNAL: Final = -1  # no wakeup descriptor


class TerminatedError(KeyboardInterrupt):
    """SIGTERM, such as at the time limit of a job: what minds Ctrl-C minds it, too."""


class _Watcher:
    """The thread that hears of signals while the main thread runs compiled code."""

    def __init__(self) -> None:
        self.flags: list[Flag] = []
        self.answered = -math.inf  # when our handler last ran
        self.other = NO_SIGNAL  # an event loop's descriptor: it hears of signals as well
        self._process = 0
        self._read = self._write = NO_SIGNAL
        self._lock = threading.RLock()  # of the pipe and the flags; a handler may come in between

    @contextmanager
    def listening(self, *flags: Flag) -> Iterator[None]:
        """While inside, signals set these flags, too. In the main thread only."""
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
        """Forget the signals that came so far: the main thread has handled them, or is about to."""
        if self._process != os.getpid():
            return  # a fork: pipe and lock are its parent's
        with self._lock:
            while self._next_signal():
                pass

    def _next_signal(self) -> int:
        """The next signal in the pipe, which an event loop hears of as well; 0 if it is empty."""
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
                pass  # it is full of signals
            except OSError:
                self.other = NO_SIGNAL  # its loop has ended

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
                    for flag in self.flags:  # somebody else's handler may let the run go on
                        flag[0] = 1
            if handler is _on_signal:
                self._insist(number, heard)

    def _insist(self, number: int, heard: float) -> None:
        while time.monotonic() < heard + INTERRUPT_PATIENCE_S:
            if self.answered > heard - JUST_NOW_S:  # it may be quicker than this thread
                return
            time.sleep(INTERRUPT_PATIENCE_S / 30)
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, _words(number) + b", at once\n")
        os._exit(128 + number)


_WATCHER: Final = _Watcher()


@contextmanager
def interruptible(flag: Flag) -> Iterator[None]:
    """While inside, a signal sets `flag`; who leaves with it set leaves by KeyboardInterrupt.

    Only signals that end what goes on do: a handler of somebody else may want the run to go on. Other
    threads hear of none, but may set the flag of a run to end it.
    """
    if threading.current_thread() is threading.main_thread():
        with _WATCHER.listening(flag):
            yield
    else:
        yield
    if flag[0]:
        give_up()


def give_up() -> NoReturn:
    """Raise what the handler of the signal raises, which Python calls on entry, or KeyboardInterrupt."""
    raise KeyboardInterrupt


@contextmanager
def signals_raise() -> Iterator[None]:
    """While inside, SIGINT and SIGTERM raise, or end the process where compiled code does not return.

    SIGINT raises KeyboardInterrupt, SIGTERM TerminatedError; but not where somebody minds or ignores them
    already.
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
        signal.signal(number, signal.SIG_IGN)  # what is known is told once, whole
        raise TerminatedError
    raise KeyboardInterrupt


def _raise_again(lost: sys.UnraisableHookArgs) -> None:
    """Send a signal again whose exception was lost, as in `__del__`."""
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
    """Whether an exception that is raised here is lost: a callback of the compiler, or our own hook."""
    lost_in = (COMPILERS_CALLBACKS, _raise_again.__name__)
    while frame is not None and not frame.f_code.co_name.startswith(lost_in):
        frame = frame.f_back
    return frame is not None


def _words(number: int) -> bytes:
    return b"automaton: terminated" if number == signal.SIGTERM else b"automaton: interrupted"
