"""Compilation: the one decorator of every kernel, and a cache that notices an edit in any file.

Numba looks only at a kernel's own file when it decides whether a cached kernel is fresh; a changed
callee in another file goes unnoticed. So the cache folder is named by a hash of all the sources.
"""

from __future__ import annotations

import atexit
import hashlib
import importlib.util
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import njit, types

import automaton.struct_types  # noqa: F401  teaches Numba what a Struct is
from automaton.numba_parts import config, event

F = TypeVar("F", bound=Callable[..., Any])

# What kernels are made of: they import nothing else (tested), so only these name the cache.
KERNEL_SOURCES = {
    "automaton": (
        "compiled.py",
        "numba_parts.py",
        "struct.py",
        "struct_types.py",
        "auctions",
        "kernels",
        "world/cells.py",
        "world/condition.py",
        "world/partition.py",
        "world/places.py",
        "world/route_space.py",
        "world/state.py",
        "world/waiting.py",
        "recording/codes.py",
        "strategy/kernels.py",
        "strategy/layer.py",
        "zoning",
    ),
    "strategies": (".",),
}
CACHES_KEPT = 4
UNUSED_S = 7 * 86_400.0  # after which kernels in the temporary folder are removed
WORLD = "the world"
FIRST_RUN = "first run of this version on this machine (about a minute): the world"
FIRST_USE = "first use on this machine: "
PATIENCE_S = 1.0  # before it is said that something is being compiled


def jit_is_on() -> bool:
    """False when NUMBA_DISABLE_JIT=1: kernels then run as plain Python, 300 times slower."""
    return not config.DISABLE_JIT


@cache
def source_hash() -> str:
    """12 hex digits that change with any source line that a kernel is made of."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version_info[:2]}".encode())
    for package, places in KERNEL_SOURCES.items():
        for place in places:
            root = _folder(package) / place
            for path in [root] if root.is_file() else sorted(root.rglob("*.py")):
                digest.update(path.as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _folder(package: str) -> Path:
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        raise ImportError(f"package {package!r} is not installed")
    return Path(spec.origin).parent


@cache
def cache_folder() -> Path:
    """Where compiled kernels of these sources live; made if needed, older generations removed.

    Where nothing can be written, they live in a temporary folder, which later processes of the same
    user find again; that is said when it is made.
    """
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    root = Path(os.environ.get("AUTOMATON_CACHE_DIR") or Path(home) / "automaton") / "kernels"
    try:
        folder, _ = _generation(root)
    except OSError as error:
        instead = _temporary_root()
        folder, is_new = _generation(instead)
        if is_new:
            print(
                f"automaton: compiled code cannot be kept in {root} ({error.strerror}), so it goes to "
                f"{instead}; AUTOMATON_CACHE_DIR names another folder",
                file=sys.stderr,
                flush=True,
            )
    _remove_unused(_shared_root())
    return folder


def _generation(root: Path) -> tuple[Path, bool]:
    """The folder of these sources in `root`, and whether it was made now. Raises OSError."""
    folder = root / source_hash()
    is_new = not folder.is_dir()
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):  # it can be written, and is used now
        pass
    generations = sorted(root.iterdir(), key=lambda path: path.stat().st_mtime)
    for stale in generations[:-CACHES_KEPT]:
        shutil.rmtree(stale, ignore_errors=True)
    return folder, is_new


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


def folder_for(function: Callable[..., Any]) -> Path:
    """The cache folder of a kernel: for a plug-in's, one that its neighbours' sources name too."""
    if function.__module__.split(".")[0] in KERNEL_SOURCES:
        return cache_folder()
    source = Path(function.__code__.co_filename)
    digest = hashlib.sha256()
    for path in sorted(source.parent.glob("*.py")):
        digest.update(path.as_posix().encode() + path.read_bytes())
    return cache_folder() / f"plug-in-{digest.hexdigest()[:12]}"


def kernel(function: F | None = None, *, signature: Any = None, inline: bool = False) -> Any:
    """Compile `function` (nogil, cached across processes).

    With `signature` it is compiled at import for exactly these types; `inline` asks Numba to paste
    it into its callers. The cache folder is set only while the decorator runs, so that kernels of
    other packages in the same process keep their own.
    """
    if function is None:
        return lambda f: kernel(f, signature=signature, inline=inline)
    options: dict[str, Any] = {"cache": True, "nogil": True, "_nrt": False}
    if inline:
        options["inline"] = "always"
    if not jit_is_on():
        return function
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder_for(function))
    try:
        if signature is not None:
            return njit(signature, **options)(function)
        return _with_one_signature(njit(**options)(function))
    finally:
        config.CACHE_DIR = before


def _with_one_signature(dispatcher: Any) -> Any:
    """Have compiled callers pass every integer as int64 (uint64 stays), never as a constant.

    Numba would compile a kernel anew for each width and each literal (187 compilations for 129
    kernels): 23 s of CPU at the first start instead of 19.
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
        self._kernels_before = (
            False  # whether the cache held any when this process began to compile
        )
        self._timer = threading.Timer(0.0, print)

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth > 1:
            return  # a kernel that another one calls
        self._begun = time.perf_counter()
        if self.seconds == 0.0:
            self._kernels_before = any(cache_folder().glob("*/*.nbi"))
        subject = subject_of(event.data["dispatcher"].py_func.__module__)
        if not self.announced:
            self._timer = threading.Timer(PATIENCE_S, self.tell, [subject])
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._timer.cancel()
            self.seconds += time.perf_counter() - self._begun

    def tell(self, subject: str) -> None:
        """Say that something is compiled, once in a process."""
        if subject not in self._told:
            self._told.add(subject)
            part = "another part of the world" if subject == WORLD else subject
            is_first = subject == WORLD and not self._kernels_before
            text = FIRST_RUN if is_first else FIRST_USE + part
            print(f"automaton: {text} is compiled, once ...", file=sys.stderr, flush=True)


def subject_of(module: str) -> str:
    """What a kernel is about: the folder of ours that it lies in, or a plug-in's module."""
    first, _, rest = module.partition(".")
    if first not in KERNEL_SOURCES or not rest:
        return module
    folder = rest.split(".")[0].replace("_", " ")
    return WORLD if folder in ("kernels", "world") else folder


COMPILATIONS = _Compilations()
event.register("numba:compile", COMPILATIONS)


def seconds_compiled() -> float:
    """Seconds that this process has spent on compiling: no time of a run."""
    return COMPILATIONS.seconds


@contextmanager
def first_compilation_announced() -> Iterator[None]:
    """Say on stderr why the first run of all waits while the world is compiled in here."""
    marker = cache_folder() / "complete"
    if not jit_is_on() or marker.exists():
        yield
        return
    COMPILATIONS.tell(WORLD)
    COMPILATIONS.announced = True
    try:
        yield
    finally:
        COMPILATIONS.announced = False
    marker.touch()
