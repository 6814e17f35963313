"""Compilation: the one decorator of every kernel, and a cache that notices an edit in any file.

Numba looks only at a kernel's own file when it decides whether a cached kernel is fresh; a changed
callee in another file goes unnoticed. So each module has a cache folder of its own, named by a hash of
the sources that it is made of: whoever edits a strategy compiles that strategy, and nothing else.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from fcntl import LOCK_EX, flock
from functools import cache, update_wrapper
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import njit, types

import automaton.engine.jit.struct_types  # noqa: F401  teaches Numba what a Struct is
from automaton.engine.jit.compile_progress import COMPILING
from automaton.engine.jit.kernel_sources import sources_digest
from automaton.engine.jit.numba_parts import config, event

F = TypeVar("F", bound=Callable[..., Any])

ENGINE = "automaton.engine"  # packages whose kernels are the world
LOOP = "automaton.engine.loop"  # compiled in every first run, and last
CACHES_KEPT = 4
CALLEES = "callees"  # a folder beside the kernels that Python calls
# What Python and C call a kernel by, which takes a fifth of the time in which a kernel is compiled.
NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
UNUSED_S = 7 * 86_400.0  # after which kernels in the temporary folder are removed
LOCK = "lock"  # a file in the folder of a module, held by who saves
WORLD = "the world"
FIRST_RUN_NOTICE = "first run of this version on this machine (about a minute): the world"
FIRST_USE_NOTICE = "first use on this machine: "
COMPILE_NOTICE_DELAY_S = 1.0  # before it is said that something is being compiled


def jit_is_on() -> bool:
    """False when NUMBA_DISABLE_JIT=1: kernels then run as plain Python, 300 times slower."""
    return not config.DISABLE_JIT


@cache
def cache_root() -> Path:
    """Where compiled kernels live, in a folder for each module.

    Where nothing can be written, they live in a temporary folder, which later processes of the same
    user find again; that is said when it is made.
    """
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    root = Path(os.environ.get("AUTOMATON_CACHE_DIR") or Path(home) / "automaton") / "kernels"
    _remove_unused(_shared_root())
    try:
        _check_writable(root)
    except OSError as error:
        instead = _temporary_root()
        is_new = not any(instead.iterdir())
        _check_writable(instead)
        if is_new:
            print(
                f"automaton: compiled code cannot be kept in {root} ({error.strerror}), so it goes to "
                f"{instead}; AUTOMATON_CACHE_DIR names another folder",
                file=sys.stderr,
                flush=True,
            )
        root = instead
    return root


def _check_writable(root: Path) -> None:
    """Raises OSError if no kernels can be kept there."""
    root.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=root):
        pass


@cache
def cache_folder(module: str, file: str) -> Path:
    """Where the kernels of a module in `file` live; made if needed, older generations removed."""
    versions = f"{numba.__version__} {sys.version_info[:2]}"
    digest = hashlib.sha256(f"{versions} {sources_digest(module, file)}".encode()).hexdigest()[:12]
    folder = cache_root() / f"{module}-{digest}"
    if folder.is_dir():
        with suppress(OSError):
            os.utime(folder)  # it is in use
        return folder
    folder.mkdir(exist_ok=True)
    generations = sorted(cache_root().glob(f"{module}-????????????"), key=_age)
    for stale in generations[:-CACHES_KEPT]:
        shutil.rmtree(stale, ignore_errors=True)
    return folder


def _age(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except OSError:  # another process has removed it
        return 0.0


def _shared_root() -> Path:
    return Path(tempfile.gettempdir()) / f"automaton-kernels-{os.getuid()}"


def _temporary_root() -> Path:
    """A folder of this user's alone: compiled code is loaded from it.

    Where somebody else holds its name, it is one that ends with this process.
    """
    root = _shared_root()
    try:
        root.mkdir(mode=0o700, exist_ok=True)
        found = root.lstat()
        if (
            stat.S_ISDIR(found.st_mode)
            and found.st_uid == os.getuid()
            and not found.st_mode & 0o022
        ):
            return root
    except FileExistsError:
        pass
    own = Path(tempfile.mkdtemp(prefix="automaton-kernels-"))
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return own


def _is_mine(root: Path) -> bool:
    """Whether it is a folder that this user owns and nobody else can write to."""
    try:
        found = root.lstat()
    except FileNotFoundError:
        return False
    is_closed = not found.st_mode & 0o022
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and is_closed


def _remove_unused(root: Path) -> None:
    """Remove the generations in the temporary folder that nobody used for days."""
    if not _is_mine(root):
        return
    with suppress(OSError):
        for folder in root.iterdir():
            if folder.stat().st_mtime < time.time() - UNUSED_S:
                shutil.rmtree(folder, ignore_errors=True)
        root.rmdir()  # unless something is left


def kernel(
    function: F | None = None, *, signature: Any = None, inline: bool = False, cached: bool = True
) -> Any:
    """Compile `function` (nogil, cached across processes).

    With `signature` it is compiled at import for exactly these types; `inline` asks Numba to paste
    it into its callers; without `cached` it lies in the caches of its callers only.
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
        with _caching_in(folder):
            dispatcher = njit(cache=True, **options)(function)
        dispatcher.compile(signature)  # for long; meanwhile others ask how far it is
        dispatcher.disable_compile()
        return dispatcher
    return Kernel(function, options, folder)


class Kernel:
    """A function that is compiled when it is first called, by Python or by a kernel that is compiled.

    Its dispatcher is made at that moment: one takes half a millisecond, and a run that finds everything
    in the cache calls ten kernels of 480. Python and kernels have one each, with caches of their own:
    what only kernels call has nothing by which Python could call it. `folder`: the caches, named when
    the sources are imported.
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
        """What Python calls, and the loop as a first-class function."""
        if self._for_python is None:
            with _MAKING:
                if self._for_python is None:
                    self._for_python = self._make(self._folder, {})
        return self._for_python

    @property
    def callee(self) -> Any:
        """What kernels call."""
        if self._for_kernels is None:
            with _MAKING:
                if self._for_kernels is None:
                    folder = self._folder and self._folder / CALLEES
                    self._for_kernels = self._make(folder, NO_WRAPPERS)
        return self._for_kernels

    def _make(self, folder: Path | None, more: dict[str, Any]) -> Any:
        options = self.targetoptions | more
        if folder is None:
            return _with_one_signature(njit(**options)(self.py_func))
        with _caching_in(folder):
            dispatcher = njit(cache=True, **options)(self.py_func)
        return _saved_alone(_with_one_signature(dispatcher))

    @property
    def is_compiled(self) -> bool:
        """Whether this process has compiled it, or this or another one has for kernels."""
        if any(one and one.overloads for one in (self._for_python, self._for_kernels)):
            return True
        file = getattr(self.callee._cache, "_cache_file", None)
        return file is not None and os.path.exists(file._index_path)

    @property
    def _numba_type_(self) -> Any:
        return self.callee._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)


_MAKING = threading.RLock()  # the folder of caches is one for all threads


@contextmanager
def _caching_in(folder: Path) -> Iterator[None]:
    """While inside, Numba makes caches in a folder; kernels of other packages keep their own."""
    with _MAKING:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(folder)
        try:
            yield
        finally:
            config.CACHE_DIR = before


def _with_one_signature(dispatcher: Any) -> Any:
    """Have compiled callers pass every integer as int64 (uint64 stays), never as a constant.

    Numba would compile a kernel again for each width and each literal (187 compilations for 129
    kernels): 23 s of CPU at the first start instead of 19.
    """
    resolve = dispatcher.get_call_template

    def get_call_template(arguments: Any, keywords: Any) -> Any:
        return resolve([_widened(kind) for kind in arguments], keywords)

    dispatcher.get_call_template = get_call_template
    return dispatcher


def _saved_alone(dispatcher: Any) -> Any:
    """Let one process at a time enter what it compiled into the cache: Numba would read the index, and
    replace it without what others have entered meanwhile."""
    save = dispatcher._cache.save_overload

    def save_overload(signature: Any, compiled: Any) -> None:
        folder = Path(dispatcher._cache.cache_path)
        folder.mkdir(parents=True, exist_ok=True)  # it may be among the removed generations
        with (folder / LOCK).open("ab") as lock:
            with suppress(OSError):  # some network folders have no locks
                flock(lock, LOCK_EX)
            save(signature, compiled)

    dispatcher._cache.save_overload = save_overload
    return dispatcher


def _widened(kind: Any) -> Any:
    kind = types.unliteral(kind)
    if isinstance(kind, types.Integer) and kind != types.uint64:
        return types.int64
    return kind


class _Compilations(event.Listener):  # type: ignore[misc]
    """Notes how long this process compiles, and says on stderr what, unless it is done at once.

    Numba lets one thread compile at a time, and tells only of what is not in the cache.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self.announced = False  # somebody has said why it takes long
        self._depth = 0
        self._begun = 0.0
        self._told: set[str] = set()
        self._timer = threading.Timer(0.0, print)

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth > 1:
            return  # a kernel that another one calls
        self._begun = time.perf_counter()
        COMPILING.begin()
        subject = subject_of(event.data["dispatcher"].py_func.__module__)
        if not self.announced:
            self._timer = threading.Timer(COMPILE_NOTICE_DELAY_S, self.announce, [subject])
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._timer.cancel()
            self.seconds += time.perf_counter() - self._begun

    def announce(self, subject: str) -> None:
        """Announce that something is compiled, once in a process."""
        if COMPILING.show_in_line():
            return
        if subject not in self._told:
            self._told.add(subject)
            part = "another part of the world" if subject == WORLD else subject
            is_first = subject == WORLD and not world_marker().exists()
            text = FIRST_RUN_NOTICE if is_first else FIRST_USE_NOTICE + part
            print(f"automaton: {text} is compiled, once ...", file=sys.stderr, flush=True)


def subject_of(module: str) -> str:
    """What a kernel is about: the folder of ours that it lies in, or a plug-in's module."""
    first, _, rest = module.partition(".")
    if module.startswith(ENGINE):
        return WORLD
    if first not in ("automaton", "strategies") or not rest:
        return module
    return rest.split(".")[0].replace("_", " ")


def world_marker() -> Path:
    """A file that is there when the world has been compiled in this version."""
    return cache_folder(LOOP, str(Path(__file__).parent.parent / "loop.py")) / "complete"


COMPILATIONS = _Compilations()
event.register("numba:compile", COMPILATIONS)


def seconds_compiled() -> float:
    """Seconds that this process has spent on compiling: no time of a run."""
    return COMPILATIONS.seconds


@contextmanager
def first_compilation_announced() -> Iterator[None]:
    """Say on stderr why the first run of all waits while the world is compiled in here."""
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
    world_marker().touch()
