"""Compilation: the decorator of all kernels, and the messages during compilation.

`kernel` is the one decorator; `U` is the type of an index, and `prefetch` a hint to the memory.
"""

from __future__ import annotations

import gc
import operator
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import update_wrapper
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

import automaton.engine.jit.struct_types  # noqa: F401  teaches Numba what a Struct is
from automaton.engine.jit.compile_progress import COMPILING
from automaton.engine.jit.kernel_cache import cache_folder, filled_folder, is_in_cache, with_cache
from automaton.engine.jit.numba_parts import LINKS_OTHERWISE, BaseFunction, config, event

U = np.uint64  # unsigned index: spares the test for negative values
F = TypeVar("F", bound=Callable[..., Any])

ENGINE = "automaton.engine"  # packages whose kernels make up the world
LOOP = "automaton.engine.loop"  # compiled last in every first run
COMPLETE = "complete"
# Folder, inside the folder of kernels called from Python, for kernels called from kernels.
CALLEES = "machine-code" if LINKS_OTHERWISE else "callees"
# Wrappers for calls from Python and C take 20 % of a kernel's compile time.
NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
ROOTS: dict[str, Any] = {}  # options of kernels that Python calls
OF_KERNELS: dict[str, Any] = NO_WRAPPERS  # and of kernels that only kernels call
if not LINKS_OTHERWISE:
    from automaton.engine.jit.callees import CalleeCompiler, RootCompiler

    ROOTS = {"pipeline_class": RootCompiler}
    OF_KERNELS = NO_WRAPPERS | {"pipeline_class": CalleeCompiler}
WORLD = "the world"
FIRST_RUN_NOTICE = "first run of this version on this machine (half a minute): compiling the world"
FIRST_USE_NOTICE = "first use on this machine: compiling "
# Compilation makes millions of objects that live until it ends: garbage collection after every 700
# objects would take 10 % of the time.
GARBAGE_THRESHOLD = (
    50_000,
    50,
    1000,
)  # numbers of objects and collections that trigger a collection
COMPILE_NOTICE_DELAY_S = 1.0  # delay of the notice about a compilation


def jit_is_on() -> bool:
    """False when NUMBA_DISABLE_JIT=1: kernels then run as plain Python, 300 times slower."""
    return not config.DISABLE_JIT


def kernel(
    function: F | None = None, *, signature: Any = None, inline: bool = False, cached: bool = True
) -> Any:
    """Compile `function` (nogil, cached across processes).

    With `signature` it is compiled at import for exactly these types; `inline` asks Numba to paste
    it into its callers; without `cached` only the caches of its callers contain it.
    """
    if function is None:
        return lambda f: kernel(f, signature=signature, inline=inline, cached=cached)
    if not jit_is_on():
        return function
    options: dict[str, Any] = {"nogil": True, "_nrt": False}
    if inline:
        options["inline"] = "always"
    if not cached:
        return Kernel(function, options, None)
    folder = cache_folder(function.__module__, function.__code__.co_filename)
    if signature is not None:
        dispatcher = with_cache(function, options | ROOTS, folder)
        dispatcher.compile(signature)  # takes long; other threads ask for the progress meanwhile
        dispatcher.disable_compile()
        return dispatcher
    return Kernel(function, options, folder)


class Kernel:
    """A function that is compiled at its first call from Python, or with the first kernel that
    calls it.

    Its dispatcher is made only then: this takes 0.5 ms, and a run from a full cache calls 10 of 480
    kernels. Python and kernels use separate dispatchers and caches: a kernel that only kernels call
    has no wrapper for Python. `folder`: the caches, named when the sources are imported.
    """

    def __init__(self, function: Any, options: dict[str, Any], folder: Path | None) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self.targetoptions = options
        self._folder = folder
        self._for_python: Any = None
        self._for_kernels: Any = None

    @property
    def dispatcher(self) -> Any:
        """The dispatcher for calls from Python, and by the loop as a first-class function."""
        if self._for_python is None:
            with _MAKING_DISPATCHER:
                if self._for_python is None:
                    self._for_python = self._make(self._folder, ROOTS)
        return self._for_python

    @property
    def callee(self) -> Any:
        """The dispatcher for calls from kernels."""
        if self._for_kernels is None:
            with _MAKING_DISPATCHER:
                if self._for_kernels is None:
                    folder = self._folder and self._folder / CALLEES
                    self._for_kernels = self._make(folder, OF_KERNELS)
        return self._for_kernels

    def _make(self, folder: Path | None, more: dict[str, Any]) -> Any:
        options = self.targetoptions | more
        if folder is None:
            return _with_one_signature(njit(**options)(self.py_func))
        return _with_one_signature(with_cache(self.py_func, options, folder))

    @property
    def is_compiled(self) -> bool:
        """Whether this process has compiled it, or any process has compiled it for kernels."""
        if any(one and one.overloads for one in (self._for_python, self._for_kernels)):
            return True
        return is_in_cache(self.callee)

    @property
    def _numba_type_(self) -> Any:
        return self.callee._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)


def first_class(function: Any, signature: Any) -> Any:
    """The function to pass to compiled code that calls a kernel by this signature; compiled or
    loaded.

    Numba looks a signature up twice whenever a function is passed; here this happens once.
    """
    dispatcher = getattr(function, "dispatcher", function)
    result = dispatcher.get_compile_result(signature)
    dispatcher.get_compile_result = lambda _: result
    return dispatcher


_MAKING_DISPATCHER = threading.RLock()  # makes the dispatcher of a kernel only once


def _with_one_signature(dispatcher: Any) -> Any:
    """Make compiled callers pass every integer as int64 (uint64 stays), never as a constant.

    Otherwise Numba compiles a kernel for each width and literal (187 compilations for 129 kernels):
    23 s of CPU at the first start instead of 19 s.
    """
    resolve = dispatcher.get_call_template

    def get_call_template(arguments: Any, keywords: Any) -> Any:
        return resolve([_widened(kind) for kind in arguments], keywords)

    dispatcher.get_call_template = get_call_template
    return dispatcher


def _widened(kind: Any) -> Any:
    kind = types.unliteral(kind)
    if isinstance(kind, types.Integer) and kind != types.uint64:
        return types.int64
    return kind


# A hint to load an element into the cache; it does not change results. It makes 1 million robots on
# 16 million cells 2 times faster (`automaton bench --only step`).
FOR_WRITING = 1
KEEP_CLOSE = 3  # of 0..3
DATA = 1


@intrinsic  # type: ignore[untyped-decorator]
def _prefetch(typing: Any, array: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        place = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [place.type, number, number, number])
        hint = builder.module.declare_intrinsic("llvm.prefetch", [place.type], kind)
        builder.call(hint, [place, number(FOR_WRITING), number(KEEP_CLOSE), number(DATA)])
        return context.get_dummy_value()

    return types.void(array, index), generate


def _ignored(array: Any, index: Any) -> None:
    """Without the JIT there is nothing to hint at."""


prefetch = _prefetch if jit_is_on() else _ignored


@intrinsic  # type: ignore[untyped-decorator]
def _lowest_bit(typing: Any, word: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.IntType(1)(1))

    return types.int64(word), generate


def _lowest_bit_of(word: Any) -> int:
    return (int(word) & -int(word)).bit_length() - 1


# The number of the lowest bit of a uint64 other than 0.
lowest_bit = _lowest_bit if jit_is_on() else _lowest_bit_of


# Without this, Numba infers the type of each `a + b` again: it tries dozens of templates, each of
# which checks all compiler options. This takes 20 % of a first run.
REMEMBERED_OPERATORS = frozenset(getattr(operator, name) for name in operator.__all__) - {
    operator.contains
}
REMEMBERED_OPERANDS = types.Number, types.Boolean, types.Array, types.BaseTuple


def remember_types_of_operators() -> None:
    """Infer the type of each operator once per types of operands: compiler options do not change it."""
    infer = BaseFunction.get_call_type

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if self.typing_key not in REMEMBERED_OPERATORS or not all(
            isinstance(one, REMEMBERED_OPERANDS) for one in args
        ):
            return infer(self, context, args, kws)
        inferred = vars(self).setdefault("_inferred", {})
        if args not in inferred:
            inferred[args] = infer(self, context, args, kws)
        return inferred[args]

    BaseFunction.get_call_type = get_call_type  # type: ignore[method-assign]


remember_types_of_operators()


# Messages during compilation.


class _Compilations(event.Listener):  # type: ignore[misc]
    """Measures the compile time of this process, and says on stderr what takes longer than a
    moment.

    Numba compiles in one thread at a time, and reports only kernels that are not in the cache.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self.announced = False  # the reason for the delay has been printed
        self._depth = 0
        self._begun = 0.0
        self._collected = gc.get_threshold()
        self._told: set[str] = set()
        self._timer = threading.Timer(0.0, print)

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth > 1:
            return  # a callee of the kernel under way
        self._begun = time.perf_counter()
        self._collected = gc.get_threshold()
        gc.set_threshold(*map(max, self._collected, GARBAGE_THRESHOLD))
        COMPILING.begin()
        module = event.data["dispatcher"].py_func.__module__
        if not self.announced:
            self._timer = threading.Timer(COMPILE_NOTICE_DELAY_S, self.announce, [module])
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._timer.cancel()
            gc.set_threshold(*self._collected)
            self.seconds += time.perf_counter() - self._begun

    def announce(self, module: str) -> None:
        """Say that a module is being compiled, once per subject and process."""
        if COMPILING.show_in_line():
            return
        subject = subject_of(module)
        if subject not in self._told:
            self._told.add(subject)
            name = module.rpartition(".")[2].replace("_", " ")
            part = f"another part of the world ({name})" if subject == WORLD else subject
            is_first = subject == WORLD and not world_marker().exists()
            text = FIRST_RUN_NOTICE if is_first else FIRST_USE_NOTICE + part
            print(f"automaton: {text}, once ...", file=sys.stderr, flush=True)


def subject_of(module: str) -> str:
    """The subject of a kernel: its folder in this project, or the module of a plug-in."""
    first, _, rest = module.partition(".")
    if module.startswith(ENGINE):
        return WORLD
    if first not in ("automaton", "strategies") or not rest:
        return module
    return rest.split(".")[0].replace("_", " ")


def world_marker() -> Path:
    """A file that exists once this version of the world has been compiled."""
    folder = cache_folder(LOOP, str(Path(__file__).parent.parent / "loop.py"))
    filled = filled_folder(folder)
    return (filled if filled and (filled / COMPLETE).exists() else folder) / COMPLETE


COMPILATIONS = _Compilations()
event.register("numba:compile", COMPILATIONS)


def seconds_compiled() -> float:
    """Seconds that this process has spent compiling; excluded from run times."""
    return COMPILATIONS.seconds


@contextmanager
def first_compilation_announced() -> Iterator[None]:
    """While inside, say on stderr that the first run waits for the world to be compiled."""
    if not jit_is_on() or world_marker().exists():
        yield
        return
    before = COMPILATIONS.announced
    if not before:
        COMPILATIONS.announce(WORLD)
    COMPILATIONS.announced = True
    try:
        yield
    finally:
        COMPILATIONS.announced = before
    with suppress(OSError):  # the folder may be read-only
        world_marker().touch()
