"""Imports go one way: no circle of files, and no two packages that import each other.

Imports inside functions and for types alone count, too: who reads one file reads what it names.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Set
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
    return {name: set(imports(tree, trees.keys())) - {name} for name, tree in trees.items()}


def imports(tree: ast.Module, ours: Set[str]) -> Iterator[str]:
    """Which of our modules the imports of one may mean: `from a import b` is a.b, or else a."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in ours)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                if submodule in ours:
                    yield submodule
                elif node.module in ours:
                    yield node.module


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
