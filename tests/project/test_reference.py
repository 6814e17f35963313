"""The generated pages of the documentation are those that the code gives now."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from automaton.engine.state import Decisions, World

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def generator() -> ModuleType:
    """The module that writes the pages."""
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_generated_page_is_up_to_date(generator: ModuleType) -> None:
    pages = generator.pages()
    stale = [
        name
        for name, text in pages.items()
        if not (path := DOCS / "reference" / name).exists()
        or path.read_text(encoding="utf-8") != text
    ]
    assert not stale, f"{', '.join(stale)} of docs/reference: stale; run `{generator.COMMAND}`"


def test_no_page_is_left_over_from_an_earlier_generator(generator: ModuleType) -> None:
    marked = [
        path.name
        for path in (DOCS / "reference").glob("*.md")
        if path.read_text(encoding="utf-8").startswith(generator.MARK)
    ]
    assert sorted(marked) == sorted(generator.pages())


@pytest.mark.parametrize("page", ["scenario.md", "study.md", "strategies.md", "floors.md"])
def test_every_key_has_a_meaning(generator: ModuleType, page: str) -> None:
    rows = [line for line in generator.pages()[page].splitlines() if line.startswith("| `")]
    keys = [row for row in rows if row.count(" | ") == 3]
    assert keys
    assert [row for row in keys if row.endswith("|  |")] == []


def test_the_contract_has_every_part_of_the_view_and_of_the_decisions(
    generator: ModuleType,
) -> None:
    parts = {name.partition(".")[0] for name in generator.SEEN}
    assert parts == set(World.struct_classes()) - {"tally"}
    assert Decisions.struct_classes() == generator.DECIDED
