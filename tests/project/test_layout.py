"""The tests themselves: they lie as the sources do, and what several need holds no tests."""

from __future__ import annotations

import ast
from fnmatch import fnmatch
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
OF_THEIR_OWN = {"helpers", "project"}  # project: documents, distribution, words


def test_tests_lie_in_the_folders_of_the_sources() -> None:
    folders = {path.parent.relative_to(TESTS) for path in TESTS.rglob("test_*.py")}
    folders -= {Path(name) for name in OF_THEIR_OWN}
    sources = (TESTS.parent / "automaton", TESTS.parent)
    assert [str(one) for one in folders if not any((top / one).is_dir() for top in sources)] == []
    assert not list((TESTS / "helpers").glob("test_*.py"))


def test_every_test_file_is_collected(request: pytest.FixtureRequest) -> None:
    """No folder has a name that pytest passes by, as it does with `build` unless told otherwise."""
    config = request.config
    assert [config.rootpath / path for path in config.getini("testpaths")] == [TESTS]
    passed_by = config.getini("norecursedirs")
    found = sorted(path.relative_to(TESTS) for path in TESTS.rglob("test_*.py"))
    assert "test_*.py" in config.getini("python_files") and found
    folders = {name for path in found for name in path.parts[:-1]}
    assert [one for one in sorted(folders) if any(fnmatch(one, p) for p in passed_by)] == []
    assert not list(TESTS.rglob("conftest.py"))[1:], "it could leave out tests"


def test_every_helper_is_used_or_run_by_hand() -> None:
    every = [*TESTS.rglob("*.py"), TESTS / "matrix"]
    texts = {path: path.read_text(encoding="utf-8") for path in every}
    for helper in (TESTS / "helpers").glob("*.py"):
        others = "".join(text for path, text in texts.items() if path != helper)
        assert helper.stem in others or "run by hand" in texts[helper], helper.name


def test_no_test_module_imports_another() -> None:
    found = []
    for path in sorted(TESTS.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            found += [f"{path.name}: {name}" for name in names if name.startswith("test_")]
    assert found == []
