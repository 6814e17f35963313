"""The provenance of a run: hashes of sources and files, versions of libraries."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import platform
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Final

from automaton.errors import InputError
from automaton.scenario.text_files import content_hash
from automaton.strategy.lookup import files_of
from automaton.world.resolved import Resolved

PACKAGES: Final = ("automaton", "strategies", "layouts")
# Files of these packages that determine runs: code, networks, and data that the code may read.
DECIDING: Final = (".py", ".npz", ".yaml", ".json")
LIBRARIES: Final = ("fleet-automaton", "numpy", "numba", "msgspec")
MAIN: Final = "__main__"  # the script of a Python program, which has no module specification
MANIFEST: Final = "sweep.json"  # a folder with this file holds results, no sources
Sources = dict[str, str]  # file -> 16 hex digits of its content


def sources_of(plugins: Iterable[str] = ()) -> Sources:
    """The files that determine runs: those of automaton's packages and of plug-ins, given by module.

    Files count by content and by name, not by the place where they are installed.
    """
    sources = package_sources()
    for plugin in plugins:
        sources |= plugin_sources(plugin)
    return dict(sorted(sources.items()))


@cache
def loaded_sources(plugins: tuple[str, ...] = ()) -> Sources:
    """As sources_of, as of the first call in this process; `plugins`: "module:Class" names."""
    return sources_of(plugin.partition(":")[0] for plugin in plugins)


def package_sources() -> Sources:
    """The files of automaton's packages that determine runs."""
    sources: Sources = {}
    for package in PACKAGES:
        root = home_of(package)
        paths = (path for path in (root / package).rglob("*") if path.suffix in DECIDING)
        sources |= _contents(paths, root)
    return sources


def plugin_sources(plugin: str) -> Sources:
    """The files of a plug-in, given by its module."""
    root, files = plugin_files(plugin)
    return _contents(files, root)


def plugin_files(plugin: str) -> tuple[Path, list[Path]]:
    """The folder of a plug-in's module, and the files that determine it.

    These are the module, or all files of the package, and those that it imports from the same folder,
    and so on. What it imports by a computed name is not found.
    """
    top = plugin.partition(".")[0]
    if top == MAIN:
        file = getattr(sys.modules[MAIN], "__file__", None)
        if file is None:  # a notebook
            return Path(), []
        root, top = Path(file).absolute().parent, Path(file).stem
    else:
        root = home_of(top)
    files_by_name: dict[str, list[Path]] = {}
    waiting = [top]
    while waiting:
        name = waiting.pop()
        is_foreign = name in PACKAGES or name in sys.stdlib_module_names
        if name in files_by_name or (is_foreign and name != top):
            continue
        files_by_name[name] = _module_files(root, name)
        if not is_installed(root):
            waiting += (other for path in files_by_name[name] for other in _imported(path))
    return root, [path for files in files_by_name.values() for path in files]


def is_installed(root: Path) -> bool:
    """Whether a folder holds installed packages, which do not belong to a plug-in."""
    paths = sysconfig.get_paths()
    return any(root.resolve() == Path(paths[name]).resolve() for name in ("purelib", "platlib"))


def _module_files(root: Path, name: str) -> list[Path]:
    """The files of a module or package in a folder; [] if it is not there."""
    if (root / f"{name}.py").is_file() and not (root / name / "__init__.py").is_file():
        return [root / f"{name}.py"]
    files = list(_own_files(root / name)) if (root / name).is_dir() else []
    return files if any(path.suffix == ".py" for path in files) else []


def _imported(path: Path) -> Iterator[str]:
    """The names of modules, up to the first dot, that a Python file imports."""
    if path.suffix != ".py":
        return
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):  # such as a template
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.partition(".")[0]


def _own_files(root: Path) -> Iterator[Path]:
    """The files of a package, without caches, hidden files and results folders."""
    for path in sorted(root.iterdir()):
        if path.name.startswith(".") or path.name == "__pycache__" or path.suffix == ".pyc":
            continue
        if path.is_file():
            yield path
        elif path.is_dir() and not path.is_symlink() and not (path / MANIFEST).exists():
            yield from _own_files(path)


def home_of(name: str) -> Path:
    """The folder that holds a package (possibly without __init__.py) or module. Raises InputError."""
    spec = importlib.util.find_spec(name)
    if spec is not None and spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations))).parent
    if spec is None or spec.origin is None:
        raise InputError(f"the package {name} is not installed here")
    return Path(spec.origin).parent


def _contents(files: Iterable[Path], root: Path) -> Sources:
    """Hashes of files by path relative to `root`; broken links are skipped."""
    return {
        path.relative_to(root).as_posix(): _hashed(path, found.st_mtime_ns, found.st_size)
        for path in files
        if path.is_file() and (found := path.stat())
    }


@lru_cache(maxsize=4096)
def _hashed(path: Path, written: int, size: int) -> str:
    """16 hex digits of the content of a file, which is read again once it was written."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def changed_sources(before: Sources, now: Sources) -> list[str]:
    """The differences between two states of the code, such as "strategies/own.py changed"."""
    return [
        f"{file} {'is new' if file not in before else 'is gone' if file not in now else 'changed'}"
        for file in sorted({*before, *now})
        if before.get(file) != now.get(file)
    ]


def first_changes(changes: list[str]) -> str:
    """The first changes, and the number of others; "" without any."""
    more = len(changes) - 3
    return ", ".join([*changes[:3], *([f"and {more} more"] if more > 0 else [])])


def file_hashes(resolved: Resolved) -> dict[str, Any]:
    """{"files": {file: hash of its content}} of the files that strategies read; {} without any."""
    files = [file for _, choice in resolved.choices for file in files_of(choice.parameters)]
    return {"files": {str(file): content_hash(file) for file in files}} if files else {}


def recorded_files(resolved: Resolved) -> dict[str, Any]:
    """Hashes of the files of strategies, and of order files as of the reading of the scenario."""
    found = {**file_hashes(resolved).get("files", {}), **dict(resolved.files)}
    return {"files": found} if found else {}


@cache
def versions() -> dict[str, str]:
    """The versions of Python and of the installed LIBRARIES, by name."""
    from importlib import metadata  # slow: it imports the email package, 5 % of the time of `check`

    found = {"python": platform.python_version()}
    for library in LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found
