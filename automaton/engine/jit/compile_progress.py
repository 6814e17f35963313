"""Compilation progress: counts the kernels that a run needs, from the calls of each kernel.

A first run compiles 418 kernels at an even pace, so the share of kernels is the share of time. A
kernel pasted into its callers (`inline`) is not compiled separately and does not count. This module
does not import Numba, so commands without a run start at once.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CodeType, ModuleType
from typing import Any, Final, NamedTuple

BAR_COLUMNS: Final = 20
REFRESH_S: Final = 0.2
CLEAR_LINE: Final = "\r\x1b[K"


class CompileProgress(NamedTuple):
    """Number of kernels compiled and needed, and seconds since compilation began."""

    done: int
    needed: int
    seconds: float

    @property
    def words(self) -> str:
        """A progress bar and numbers, in ASCII."""
        full = BAR_COLUMNS * self.done // max(1, self.needed)
        bar = "#" * full + "." * (BAR_COLUMNS - full)
        share = 100 * self.done // max(1, self.needed)
        return (
            f"compiling (once): {bar} {share} %, {self.done} of {self.needed} kernels, "
            f"{self.seconds:.0f} s"
        )


class Compiling:
    """The compilation under way; can be read from any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.on_terminal = False  # True: overwrite one line of stderr; False: print sentences
        self._clock = clock
        self._begun: float | None = None  # start of the first compilation since `expected`
        self._functions: list[Any] = []
        self._needed: dict[Any, tuple[Any, ...]] = {}  # kernels by the function that calls them
        self._finished: set[Any] = set()
        self._writer: threading.Thread | None = None

    @contextmanager
    def expected(self, functions: list[Any]) -> Iterator[None]:
        """While inside, these functions and everything they call are compiled or loaded."""
        self._begun, self._functions, self._finished = None, functions, set()
        try:
            yield
        finally:
            self._functions, self._needed = [], {}
            if self._writer is not None:
                self._writer.join()
                self._writer = None

    def begin(self) -> None:
        """A kernel is being compiled."""
        if self._begun is None and self._functions:
            self._needed = {plain(one): kernels_of(one) for one in self._functions}
            self._begun = self._clock()

    def finish(self, function: Any) -> None:
        """One of the functions is ready; if it was loaded, its callees were not needed."""
        if self._begun is None:
            self._functions = [one for one in self._functions if one is not function]
        self._finished.add(plain(function))

    def now(self) -> CompileProgress | None:
        """The progress; None while no expected kernel is being compiled."""
        needed, begun = self._needed, self._begun
        if not needed or begun is None:
            return None
        done: dict[Any, bool] = {}
        for function, kernels in needed.items():
            over = function in self._finished
            done |= {one: over or done.get(one, False) or one.is_compiled for one in kernels}
        return CompileProgress(sum(done.values()), len(done), self._clock() - begun)

    def show_in_line(self) -> bool:
        """Show progress in one line of the terminal from now on; returns whether that is possible."""
        if not self.on_terminal or not self._functions:
            return False
        if self._writer is None:
            self._writer = threading.Thread(target=self._write_line, name="compiling", daemon=True)
            self._writer.start()
        return True

    def _write_line(self) -> None:
        from shutil import get_terminal_size

        while self._functions:
            progress = self.now()
            if progress is not None:
                columns = get_terminal_size().columns - 1
                text = f"{CLEAR_LINE}{progress.words[:columns]}"
                print(text, end="", file=sys.stderr, flush=True)
            time.sleep(REFRESH_S)
        print(CLEAR_LINE, end="", file=sys.stderr, flush=True)


COMPILING: Final = Compiling()


def kernels_of(function: Any) -> tuple[Any, ...]:
    """The separately compiled kernels that a function consists of, including itself."""
    reached: dict[Any, Any] = {}
    todo = [function]
    while todo:
        one = todo.pop()
        if plain(one) not in reached:
            reached[plain(one)] = one
            todo += [named for named in _named_in(plain(one)) if _is_kernel(named)]
    return tuple(one for one in reached.values() if _is_kernel(one) and not _is_pasted(one))


def plain(function: Any) -> Any:
    """The Python function of a kernel, or the function itself."""
    return getattr(function, "py_func", function)


def _is_kernel(value: Any) -> bool:
    return hasattr(type(value), "is_compiled")


def _is_pasted(dispatcher: Any) -> bool:
    return bool(dispatcher.targetoptions.get("inline") == "always")


def _named_in(function: Any) -> list[Any]:
    """The values of the global names and enclosing variables of a function."""
    if not hasattr(function, "__code__"):
        return []
    names = {name for code in _codes(function.__code__) for name in code.co_names}
    values = [function.__globals__.get(name) for name in names]
    values += [cell.cell_contents for cell in function.__closure__ or ()]
    modules = [value for value in values if isinstance(value, ModuleType)]
    return values + [getattr(module, name, None) for module in modules for name in names]


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


class UnfitNumbaError(ImportError):
    """The installed Numba lacks parts that compiled code needs, or they differ."""
