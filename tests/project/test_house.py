"""How hard the source is to enter, in measures that may only get better.

A reader opens files: how many there are and how long the chains of their imports, how much of them
stands before the first definition, and which names mean several things.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from strategies.catalogue import CATALOGUE

ROOT = Path(__file__).parents[2]
SOURCES = ("automaton", "strategies", "layouts", "tui")
SHORT = 60  # lines

# What there is. A change that makes one of these larger needs a reason; one that makes it smaller
# writes the new number here.
MOST_FILES = 500
MOST_FOLDERS = 51
MOST_SHORT_FILES = 27
LONGEST_FILE = 650
LONGEST_CHAIN = 24  # of files that import each other in a row
IMPORTS_A_FILE = 5.95  # of ours
HEAD_SHARE = 0.112  # lines before the first definition
CLASSES_OF_ONE_NAME = 6
CONSTANTS_OF_ONE_NAME = 10  # with different values
METHODS_IN_STRINGS = 4  # "retreat", which is also an action of the world
# Words that name a method and other things as well.
ORDINARY = {"decentralized", "independent", "shortest", "static", "threshold", "wait"}
MAY_NAME_METHODS = ("strategies", "automaton.papers", "automaton.bench", "tui.bench", "layouts")


@cache
def sources() -> dict[str, tuple[str, ast.Module]]:
    """Text and syntax of each module, by its dotted name."""
    found = {}
    for top in SOURCES:
        for path in sorted((ROOT / top).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            text = path.read_text(encoding="utf-8")
            found[name.removesuffix(".__init__")] = text, ast.parse(text)
    return found


@cache
def imported() -> dict[str, set[str]]:
    """The modules of ours that each module imports, within functions too."""
    graph: dict[str, set[str]] = {}
    for name, (_, tree) in sources().items():
        graph[name] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                graph[name] |= (inner & sources().keys()) or ({node.module} & sources().keys())
            elif isinstance(node, ast.Import):
                graph[name] |= {alias.name for alias in node.names} & sources().keys()
    return graph


@cache
def chain_from(name: str) -> int:
    """The length of the longest chain of imports that begins with a module."""
    return 1 + max((chain_from(other) for other in imported()[name] - {name}), default=0)


def head(tree: ast.Module) -> int:
    """The last line of docstring and imports."""
    last = 0
    for node in tree.body:
        is_typing = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        is_docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if not (is_typing or is_docstring or isinstance(node, ast.Import | ast.ImportFrom)):
            break
        last = node.end_lineno or last
    return last


def constants(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Name and value of each public constant of a module."""
    for node in tree.body:
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        value = getattr(node, "value", None)
        is_public = isinstance(target, ast.Name) and target.id.isupper() and target.id[0] != "_"
        if is_public and value is not None:
            yield target.id, ast.unparse(value)


def test_there_are_few_files_and_each_is_a_page() -> None:
    lines = {name: text.count("\n") for name, (text, _) in sources().items()}
    folders = {path.parent for top in SOURCES for path in (ROOT / top).rglob("*.py")}
    assert len(lines) <= MOST_FILES and len(folders) <= MOST_FOLDERS
    assert [name for name, count in lines.items() if count >= LONGEST_FILE] == []
    assert sum(1 < count < SHORT for count in lines.values()) <= MOST_SHORT_FILES


def test_imports_are_few_and_their_chains_short() -> None:
    assert max(map(chain_from, imported())) <= LONGEST_CHAIN
    assert sum(map(len, imported().values())) <= IMPORTS_A_FILE * len(imported())


def test_methods_are_known_by_their_declarations() -> None:
    methods = {name for layer in CATALOGUE.values() for name in layer} - ORDINARY
    named = [
        f"{name}:{node.lineno}: {node.value}"
        for name, (text, tree) in sources().items()
        if not name.startswith(MAY_NAME_METHODS) and any(f'"{one}"' in text for one in methods)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and node.value in methods
    ]
    assert len(named) <= METHODS_IN_STRINGS, named


def test_files_begin_with_what_they_are_about() -> None:
    heads = sum(head(tree) for _, tree in sources().values())
    assert heads <= HEAD_SHARE * sum(text.count("\n") for text, _ in sources().values())


def test_a_name_means_one_thing() -> None:
    classes, values = defaultdict(set), defaultdict(set)
    for name, (_, tree) in sources().items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].add(name)
        for constant, value in constants(tree):
            values[constant].add(value)
    several = sorted(name for name, modules in classes.items() if len(modules) > 1)
    assert len(several) <= CLASSES_OF_ONE_NAME, several
    several = sorted(name for name, found in values.items() if len(found) > 1)
    assert len(several) <= CONSTANTS_OF_ONE_NAME, several
