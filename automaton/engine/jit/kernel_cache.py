"""The cache of compiled kernels, which notices an edit in any file.

Numba looks only at a kernel's own file when it decides whether a cached kernel is fresh; a changed
callee in another file goes unnoticed. So each module has a cache folder of its own, named by a hash of
the sources that it is made of: an edit in a strategy compiles that strategy, and nothing else.

A cache that cannot be written, such as that of an image, is read: what it lacks is kept in a temporary
folder, or compiled by each process where there is no such folder either.
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
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fcntl import LOCK_EX, flock
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba
from numba import njit

from automaton.engine.jit.kernel_sources import sources_digest
from automaton.engine.jit.numba_parts import CacheLocator, FunctionCache, config

CACHES_KEPT = 4
UNUSED_S = 7 * 86_400.0  # after which kernels in the temporary folder are removed
LOCK = "lock"  # a file in the folder of a module, held by who saves


class CachePlaces(NamedTuple):
    """Where compiled kernels are written, and where they are read besides."""

    root: Path
    is_writable: bool  # False: nothing can be written anywhere, and `root` is `filled`
    filled: Path | None  # a cache that this process cannot write to


@cache
def cache_places() -> CachePlaces:
    """Return the folders of compiled kernels, which hold a folder for each module.

    Where nothing can be written, they live in a temporary folder, which later processes of the same
    user find again; that is said when it is made, unless there is something to read.
    """
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    root = Path(os.environ.get("AUTOMATON_CACHE_DIR") or Path(home) / "automaton") / "kernels"
    with suppress(OSError):  # there is no temporary folder
        _remove_unused(_shared_root())
    try:
        _check_writable(root)
        return CachePlaces(root, True, None)
    except OSError as error:
        reason = error.strerror
    filled = root if os.path.isdir(root) else None
    try:
        instead = _temporary_root()
        is_new = not any(instead.iterdir())
        _check_writable(instead)
    except OSError:
        return CachePlaces(root, False, root)
    if is_new and filled is None:
        print(
            f"automaton: compiled code cannot be kept in {root} ({reason}), so it goes to "
            f"{instead}; AUTOMATON_CACHE_DIR names another folder",
            file=sys.stderr,
            flush=True,
        )
    return CachePlaces(instead, True, filled)


def _check_writable(root: Path) -> None:
    """Raises OSError if no kernels can be kept there."""
    root.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=root):
        pass


def cache_root() -> Path:
    """Return where compiled kernels are written, in a folder for each module."""
    return cache_places().root


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
    if not cache_places().is_writable:
        return folder
    folder.mkdir(exist_ok=True)
    generations = sorted(cache_root().glob(f"{module}-????????????"), key=_age)
    for stale in generations[:-CACHES_KEPT]:
        shutil.rmtree(stale, ignore_errors=True)
    return folder


def filled_folder(folder: Path) -> Path | None:
    """Return what stands for a folder of the cache in the one that is only read, if there is one."""
    places = cache_places()
    if places.filled is None:
        return None
    filled = places.filled / folder.relative_to(places.root)
    return filled if os.path.isdir(filled) else None


def _age(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except OSError:  # another process has removed it
        return 0.0


def _shared_root() -> Path:
    return Path(tempfile.gettempdir()) / f"automaton-kernels-{os.getuid()}"


def _temporary_root() -> Path:
    """A folder of this user's alone: compiled code is loaded from it.

    Where another user holds its name, it is one that ends with this process.
    """
    root = _shared_root()
    with suppress(FileExistsError):
        root.mkdir(mode=0o700, exist_ok=True)
        if _is_mine(root):
            return root
    own = Path(tempfile.mkdtemp(prefix="automaton-kernels-"))
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return own


def _is_mine(root: Path) -> bool:
    """Whether it is a folder that this user owns and no other user can write to."""
    try:
        status = root.lstat()
    except FileNotFoundError:
        return False
    is_closed = not status.st_mode & 0o022
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and is_closed


def _remove_unused(root: Path) -> None:
    """Remove the generations in the temporary folder that no process used for days."""
    if not _is_mine(root):
        return
    with suppress(OSError):
        for folder in root.iterdir():
            if folder.stat().st_mtime < time.time() - UNUSED_S:
                shutil.rmtree(folder, ignore_errors=True)
        root.rmdir()  # unless something is left


def with_cache(function: Any, options: dict[str, Any], folder: Path) -> Any:
    """Return Numba's dispatcher of a function, which reads and writes compiled code in a folder.

    Kernels of a cache that can only be read come first: no process can have changed them.
    """
    filled = filled_folder(folder)
    kind = getattr(options.get("pipeline_class"), "cache_class", FunctionCache)
    reader = None if filled is None else _reader(kind, function, filled)
    dispatcher = njit(**options)(function)
    if not cache_places().is_writable:
        if reader is not None:
            dispatcher._cache = reader
        return dispatcher
    with _caching_in(folder):
        dispatcher._cache = kind(function)
    if reader is not None:
        _read_first(reader, dispatcher._cache)
    return _saved_alone(dispatcher)


def is_in_cache(dispatcher: Any) -> bool:
    """Return whether a process has compiled the function for some arguments and kept that."""
    caches = (dispatcher._cache, getattr(dispatcher._cache, "reader", None))
    files = (getattr(one, "_cache_file", None) for one in caches)
    return any(file is not None and os.path.exists(file._index_path) for file in files)


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


def _reader(kind: Any, function: Any, folder: Path) -> Any:
    """Return a cache of a kind in a folder that cannot be written: it loads, and saves nothing."""
    with _caching_in(folder):
        check = CacheLocator.ensure_cache_path
        CacheLocator.ensure_cache_path = lambda self: (
            None
        )  # Numba takes no folder that it cannot write
        try:
            reader = kind(function)
        finally:
            CacheLocator.ensure_cache_path = check
    load = reader.load_overload

    def load_overload(signature: Any, context: Any) -> Any:
        with suppress(OSError):
            return load(signature, context)
        return None

    reader.load_overload = load_overload
    reader.save_overload = lambda signature, compiled: None
    return reader


def _read_first(reader: Any, writer: Any) -> None:
    """Have a cache load what it can from another one."""
    load = writer.load_overload

    def load_overload(signature: Any, context: Any) -> Any:
        compiled = reader.load_overload(signature, context)
        return load(signature, context) if compiled is None else compiled

    writer.reader = reader
    writer.load_overload = load_overload


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
