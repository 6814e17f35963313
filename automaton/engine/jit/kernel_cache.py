"""The cache of compiled kernels, which detects edits in any source file.

Numba checks only a kernel's own file to decide whether a cached kernel is fresh; it misses a
changed callee in another file. So each module has its own cache folder, named by a hash of all its
sources: an edit in a strategy recompiles only that strategy.

A read-only cache, such as that of a container image, is read; missing kernels go to a temporary
folder or, without one, each process compiles them.
"""

from __future__ import annotations

import atexit
import hashlib
import importlib.util
import os
import re
import shutil
import stat
import sys
import sysconfig
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fcntl import LOCK_EX, flock
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numba
from numba import njit

from automaton.engine.jit.numba_parts import CacheLocator, FunctionCache, config

CACHES_KEPT = 4
UNUSED_S = 7 * 86_400.0  # age at which kernels in the temporary folder are removed
LOCK_FILE = "lock"  # lock file in the folder of a module, held while saving


class CachePlaces(NamedTuple):
    """Where compiled kernels are written, and where else they are read."""

    root: Path
    is_writable: bool  # False: no folder is writable, and `root` is `filled`
    filled: Path | None  # a cache that this process cannot write to


@cache
def cache_places() -> CachePlaces:
    """Return the folders of compiled kernels, with a subfolder for each module.

    If they cannot be written, a temporary folder is used, which later processes of the same user
    find again. A message says so when it is made, unless there is a cache to read.
    """
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    root = Path(os.environ.get("AUTOMATON_CACHE_DIR") or Path(home) / "automaton") / "kernels"
    with suppress(OSError):  # there may be no temporary folder
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
            f"automaton: compiled code cannot be kept in {root} ({reason}); it is kept in "
            f"{instead} instead. Set AUTOMATON_CACHE_DIR to choose a folder",
            file=sys.stderr,
            flush=True,
        )
    return CachePlaces(instead, True, filled)


def _check_writable(root: Path) -> None:
    """Raises OSError if the folder is not writable."""
    root.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=root):
        pass


def cache_root() -> Path:
    """Return the folder for compiled kernels, with a subfolder for each module."""
    return cache_places().root


@cache
def cache_folder(module: str, file: str) -> Path:
    """The cache folder of a module in `file`; made if needed, removing older generations."""
    versions = f"{numba.__version__} {sys.version_info[:2]}"
    digest = hashlib.sha256(f"{versions} {sources_digest(module, file)}".encode()).hexdigest()[:12]
    folder = cache_root() / f"{module}-{digest}"
    if folder.is_dir():
        with suppress(OSError):
            os.utime(folder)  # mark it as in use
        return folder
    if not cache_places().is_writable:
        return folder
    folder.mkdir(exist_ok=True)
    generations = sorted(cache_root().glob(f"{module}-????????????"), key=_age)
    for stale in generations[:-CACHES_KEPT]:
        shutil.rmtree(stale, ignore_errors=True)
    return folder


def filled_folder(folder: Path) -> Path | None:
    """Return the counterpart of a cache folder in the read-only cache, if any."""
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
    """A folder owned by this user only, since compiled code is loaded from it.

    If another user owns that name, use a folder that is removed with this process.
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
    """Whether this user owns the folder and no other user can write to it."""
    try:
        status = root.lstat()
    except FileNotFoundError:
        return False
    is_closed = not status.st_mode & 0o022
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and is_closed


def _remove_unused(root: Path) -> None:
    """Remove generations in the temporary folder that no process has used for days."""
    if not _is_mine(root):
        return
    with suppress(OSError):
        for folder in root.iterdir():
            if folder.stat().st_mtime < time.time() - UNUSED_S:
                shutil.rmtree(folder, ignore_errors=True)
        root.rmdir()  # fails if files are left


class RootCache(FunctionCache):  # type: ignore[misc]
    """The cache of a kernel that Python or the loop calls.

    Numba first imports what it compiles with, which takes 0.25 s in each process; machine code of
    kernels, which allocate nothing, needs none of it.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        return self._load_overload(sig, target_context)


def with_cache(function: Any, options: dict[str, Any], folder: Path) -> Any:
    """Return Numba's dispatcher of a function, which reads and writes compiled code in a folder.

    A read-only cache comes first: no process can have changed it.
    """
    filled = filled_folder(folder)
    kind = getattr(options.get("pipeline_class"), "cache_class", RootCache)
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
    """Return whether a compiled version of the function is in the cache, for any arguments."""
    caches = (dispatcher._cache, getattr(dispatcher._cache, "reader", None))
    files = (getattr(one, "_cache_file", None) for one in caches)
    return any(file is not None and os.path.exists(file._index_path) for file in files)


_MAKING = threading.RLock()  # Numba has one global cache folder for all threads


@contextmanager
def _caching_in(folder: Path) -> Iterator[None]:
    """While inside, Numba makes its caches in this folder; other packages keep their folders."""
    with _MAKING:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(folder)
        try:
            yield
        finally:
            config.CACHE_DIR = before


def _reader(kind: Any, function: Any, folder: Path) -> Any:
    """Return a cache in a read-only folder: it loads and does not save."""
    with _caching_in(folder):
        check = CacheLocator.ensure_cache_path
        CacheLocator.ensure_cache_path = lambda self: (
            None
        )  # Numba rejects folders that it cannot write
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
    """Make a cache look into another one first when it loads."""
    load = writer.load_overload

    def load_overload(signature: Any, context: Any) -> Any:
        compiled = reader.load_overload(signature, context)
        return load(signature, context) if compiled is None else compiled

    writer.reader = reader
    writer.load_overload = load_overload


def _saved_alone(dispatcher: Any) -> Any:
    """Let only one process at a time save to the cache: Numba reads the index and replaces it,
    which would lose entries of other processes."""
    save = dispatcher._cache.save_overload

    def save_overload(signature: Any, compiled: Any) -> None:
        folder = Path(dispatcher._cache.cache_path)
        folder.mkdir(parents=True, exist_ok=True)  # it may have been removed as an old generation
        with (folder / LOCK_FILE).open("ab") as lock:
            with suppress(OSError):  # some network folders do not support locks
                flock(lock, LOCK_EX)
            save(signature, compiled)

    dispatcher._cache.save_overload = save_overload
    return dispatcher


# The source files of a module: its own, and those of the modules that it imports.
#
# Only imports that run with the module count, not those inside functions or under `if
# TYPE_CHECKING`. A regular expression finds them without importing anything: 10 ms for the modules
# of a run, while parsing takes 180 ms; a test compares the two. The standard library and installed
# packages unrelated to this one are left out.


_IMPORT: Final = re.compile(
    r"""
    (?: ^(?P<indent>[ \t]*) | ;[ \t]* )
    (?: from[ \t]+(?P<origin>[.\w]+)[ \t]+import\b[ \t]*
        (?P<names> \((?:[^)#]|\#[^\n]*)*\) | (?:\\\n|[^\n;])* )
      | import[ \t]+(?P<modules> (?:\\\n|[^\n;])* ) )
    """,
    re.MULTILINE | re.VERBOSE,
)
_COMMENT: Final = re.compile(r"#[^\n]*")
_NAME: Final = re.compile(r"(\w+)(?:[ \t]+as[ \t]+\w+)?")
_LATER: Final = re.compile(r"(?:async[ \t]+)?def\b|if[ \t]+(?:\w+\.)?TYPE_CHECKING\b")
_INSTALLED: Final = tuple(sysconfig.get_path(name) for name in ("purelib", "platlib"))
OWN_PACKAGE: Final = "automaton"
PUBLIC_API: Final = "automaton.strategy.api"  # what a strategy may call


@cache
def sources_digest(module: str, file: str) -> str:
    """12 hex digits that change with any source line of a module in `file` or of its imports."""
    digest = hashlib.sha256()
    for path in sorted(sources(module, Path(file))):
        digest.update(path.as_posix().encode() + b"\0" + _digest_of(path))
    return digest.hexdigest()[:12]


@cache
def _digest_of(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def sources(module: str, file: Path) -> set[Path]:
    """The files of a module and, transitively, of the modules that it imports.

    A module without a file, such as a cell of a notebook, may call anything that strategies may
    call.
    """
    sources: set[Path] = set()
    pending = [(module, file)]
    if not file.is_file():
        public = _file_of(PUBLIC_API)
        assert public is not None
        pending = [(PUBLIC_API, public)]
    while pending:
        name, path = pending.pop()
        if path not in sources:
            sources.add(path)
            pending += _imports(name, path, module.partition(".")[0])
    return sources


@cache
def _imports(module: str, file: Path, home: str) -> list[tuple[str, Path]]:
    """The relevant imports of a module: from this project, the package `home`, and their neighbours."""
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    known = []
    for name in _imported_names(_read(file), package):
        path = _file_of(name)
        if path is not None and _is_followed(name, path, home):
            known.append((name, path))
    return known


def _imported_names(source: str, package: str) -> Iterator[str]:
    """All names that may be modules in the import statements of a source."""
    for statement in _IMPORT.finditer(source):
        if statement["indent"] and _runs_later(source, statement.start(), len(statement["indent"])):
            continue
        names = _COMMENT.sub("", statement["names"] or statement["modules"]).replace("\\\n", " ")
        if statement["origin"] is None:
            for clause in names.split(","):
                yield clause.split(" as ")[0].strip()
            continue
        base = _absolute(statement["origin"], package)
        yield base
        for name in _NAME.findall(names):
            yield f"{base}.{name}"


def _runs_later(source: str, place: int, indent: int) -> bool:
    """Whether a statement is inside a function or under `if TYPE_CHECKING`."""
    for line in reversed(source[:place].splitlines()):
        text = line.lstrip()
        depth = len(line) - len(text)
        if text and depth < indent and text[0] not in ")]}":  # not the end of a long head
            if _LATER.match(text):
                return True
            indent = depth
        if indent == 0:
            break
    return False


def _absolute(name: str, package: str) -> str:
    """The full name of a module that is named relative to a package."""
    level = len(name) - len(name.lstrip("."))
    if level == 0:
        return name
    parts = package.split(".")
    return ".".join([*parts[: len(parts) - level + 1], *filter(None, [name[level:]])])


@cache
def _file_of(module: str) -> Path | None:
    """The source file of a module; None if it has none, or the name is not a module."""
    top, *parts = module.split(".")
    for folder in _folders(top) if parts else ():
        place = folder.joinpath(*parts)
        for path in (place.with_suffix(".py"), place / "__init__.py"):
            if path.is_file():
                return path
    return _top_file(top) if not parts else None


@cache
def _folders(top: str) -> tuple[Path, ...]:
    spec = _spec(top)
    return tuple(map(Path, spec.submodule_search_locations or ())) if spec else ()


def _top_file(top: str) -> Path | None:
    spec = _spec(top)
    is_source = spec is not None and spec.origin is not None and spec.origin.endswith(".py")
    return Path(spec.origin) if is_source and spec and spec.origin else None


@cache
def _spec(top: str) -> importlib.machinery.ModuleSpec | None:
    if top in sys.stdlib_module_names or not top.isidentifier():
        return None
    try:
        return importlib.util.find_spec(top)
    except ValueError:  # a module without a spec, such as __main__
        return None


@cache
def _is_followed(module: str, file: Path, home: str) -> bool:
    """Whether a module may hold kernels, or constants of kernels."""
    top = module.partition(".")[0]
    is_installed = any(file.is_relative_to(folder) for folder in _INSTALLED)
    return (
        not is_installed or top in (OWN_PACKAGE, "strategies", home) or OWN_PACKAGE in _read(file)
    )


@cache
def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")
