"""The source files that a module is made of: its own, and those of the modules that it imports.

Only imports that run with the module count, as they are written: not those inside functions, nor under
`if TYPE_CHECKING`. They are found by a regular expression, in 10 ms for a run's modules, since parsing
takes 180 ms; a test compares the two. Nothing is imported to find out. The standard library is left
out, and so are installed packages that have nothing to do with this one.
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
OURS: Final = "automaton"
PUBLIC: Final = "automaton.strategy.kernels"  # what a strategy may call


@cache
def sources_digest(module: str, file: str) -> str:
    """12 hex digits that change with any source line of a module in `file` and of what it imports."""
    digest = hashlib.sha256()
    for path in sorted(sources(module, Path(file))):
        digest.update(path.as_posix().encode() + b"\0" + _digest_of(path))
    return digest.hexdigest()[:12]


@cache
def _digest_of(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def sources(module: str, file: Path) -> set[Path]:
    """The files of a module and, transitively, of the modules that it imports.

    A module without a file, such as a cell of a notebook, may call whatever strategies may.
    """
    sources: set[Path] = set()
    pending = [(module, file)]
    if not file.is_file():
        public = _file_of(PUBLIC)
        assert public is not None
        pending = [(PUBLIC, public)]
    while pending:
        name, path = pending.pop()
        if path not in sources:
            sources.add(path)
            pending += _imports(name, path, module.partition(".")[0])
    return sources


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


def _imported_names(source: str, package: str) -> Iterator[str]:
    """What the import statements of a source may name: each module, and each name in it."""
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
    """Whether a statement lies in a function, or where only type checkers look."""
    for line in reversed(source[:place].splitlines()):
        text = line.lstrip()
        depth = len(line) - len(text)
        if text and depth < indent and text[0] not in ")]}":  # the end of a head of several lines
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
    return not is_installed or top in (OURS, "strategies", home) or OURS in _read(file)


@cache
def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")
