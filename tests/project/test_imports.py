"""Imports go one way: no circle of files, and no two packages that import each other.

Imports inside functions and for types alone count, too: who reads one file reads what it names.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCES = ("automaton", "strategies", "layouts", "tui")


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def modules() -> dict[str, set[str]]:
    """What each of our modules imports of our modules."""
    trees = {
        name_of(path): ast.parse(path.read_text(encoding="utf-8"))
        for top in SOURCES
        for path in (ROOT / top).rglob("*.py")
    }
    return {
        name: {imported for imported in imports(tree) if imported in trees} - {name}
        | {
            package
            for package, submodule in pairs(tree)
            if package in trees and submodule not in trees and package != name
        }
        for name, tree in trees.items()
    }


def pairs(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Of `from a import b`: a, a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, f"{node.module}.{alias.name}") for alias in node.names)


def imports(tree: ast.Module) -> Iterator[str]:
    """The modules that `import a.b` and `from a import b` may mean."""
    yield from (submodule for _, submodule in pairs(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_files_import_each_other_in_no_circle() -> None:
    assert len(modules()) > 400
    TopologicalSorter(modules()).prepare()  # raises CycleError, which names the files


def test_no_two_packages_import_each_other() -> None:
    between = {
        (name.rpartition(".")[0], other.rpartition(".")[0])
        for name, others in modules().items()
        for other in others
    }
    apart = {
        (a, b)
        for a, b in between
        if not (f"{a}.".startswith(f"{b}.") or f"{b}.".startswith(f"{a}."))
    }
    assert {(a, b) for a, b in apart if (b, a) in apart} == set()
