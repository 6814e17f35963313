"""The source files that a module is made of: its own, and those of the modules that it imports.

Only imports at the top level of a module count, as they are written: nothing is imported to find out.
The standard library is left out, and so are installed packages that have nothing to do with this one.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import sys
import sysconfig
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

_IMPORT: Final = re.compile(
    rb"^(?:from[ \t]+([.\w]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]*))",
    re.MULTILINE,
)
_COMMENT: Final = re.compile(rb"#[^\n]*")
_NAME: Final = re.compile(rb"(\w+)(?:[ \t]+as[ \t]+\w+)?")
_INSTALLED: Final = tuple(sysconfig.get_path(name) for name in ("purelib", "platlib"))
OURS: Final = "automaton"


@cache
def sources_digest(module: str, file: str) -> str:
    """12 hex digits that change with any source line of a module in `file` and of what it imports."""
    digest = hashlib.sha256()
    for path in sorted(sources(module, Path(file))):
        digest.update(path.as_posix().encode() + b"\0" + _read(path))
    return digest.hexdigest()[:12]


def sources(module: str, file: Path) -> set[Path]:
    """The files of a module and, transitively, of the modules that it imports."""
    found: set[Path] = set()
    pending = [(module, file)]
    while pending:
        name, path = pending.pop()
        if path not in found:
            found.add(path)
            pending += _imports(name, path, module.partition(".")[0])
    return found


@cache
def _imports(module: str, file: Path, home: str) -> list[tuple[str, Path]]:
    """The modules that a module imports: those of ours, of the package `home`, and beside them."""
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    known = []
    for name in _imported_names(_read(file), package):
        path = _file_of(name)
        if path is not None and _is_followed(name, path, home):
            known.append((name, path))
    return known


def _imported_names(source: bytes, package: str) -> Iterator[str]:
    """What the import statements of a source may name: each module, and each name in it."""
    for origin, names, plain in _IMPORT.findall(source):
        if plain:
            for clause in _COMMENT.sub(b"", plain).split(b","):
                yield clause.split(b" as ")[0].strip().decode()
            continue
        base = _absolute(origin.decode(), package)
        yield base
        for name in _NAME.findall(_COMMENT.sub(b"", names)):
            yield f"{base}.{name.decode()}"


def _absolute(name: str, package: str) -> str:
    """The full name of a module that is named relative to a package."""
    level = len(name) - len(name.lstrip("."))
    if level == 0:
        return name
    parts = package.split(".")
    return ".".join([*parts[: len(parts) - level + 1], *filter(None, [name[level:]])])


@cache
def _file_of(module: str) -> Path | None:
    """The source file of a module; None for what has none here, and for names that are no modules."""
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
    return not is_installed or top in (OURS, "strategies", home) or OURS.encode() in _read(file)


@cache
def _read(path: Path) -> bytes:
    return path.read_bytes()
