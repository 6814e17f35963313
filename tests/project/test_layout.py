"""The tests themselves: what several of them need lies in modules that hold no tests."""

from __future__ import annotations

import ast
from pathlib import Path


def test_no_test_module_imports_another() -> None:
    found = []
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            found += [f"{path.name}: {name}" for name in names if name.startswith("test_")]
    assert found == []
