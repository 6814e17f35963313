"""The generated pages of the documentation are those that the code gives now."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from automaton.engine.decisions import Decisions
from automaton.engine.state import World
from automaton.strategy import api

DOCS = Path(__file__).parents[2] / "docs"
PLUG_IN = """
import msgspec

from automaton.strategy.api import Strategy
from tui.render.layer import Layer
from tui.widgets.panel import Panel


class Lazy(Strategy):
    layer = "allocation"

    class Parameters(msgspec.Struct):
        naps: int = 3


class Dust(Layer):
    key, label = "f11", "Dust"


NOTES = Panel("notes", "plug_in:Notes", key="u", label="Notes")
"""
ENTRY_POINTS = """
[automaton.strategies]
allocation.lazy = plug_in:Lazy

[automaton.layers]
dust = plug_in:Dust

[automaton.panels]
notes = plug_in:NOTES
"""
STALE = """
import runpy, sys
from pathlib import Path
from automaton.strategy.lookup import names
from tui.registration import layers, panels
assert "lazy" in names("allocation") and "dust" in layers().by_name and "notes" in panels().by_name
pages = runpy.run_path(sys.argv[1] + "/generate.py")["pages"]()
for name, text in pages.items():
    if Path(sys.argv[1], "reference", name).read_text(encoding="utf-8") != text:
        print(name)
"""


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


def test_plug_ins_of_other_packages_are_in_no_page(tmp_path: Path) -> None:
    information = tmp_path / "plug_in-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: plug-in\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(ENTRY_POINTS)
    (tmp_path / "plug_in.py").write_text(PLUG_IN)
    done = subprocess.run(
        [sys.executable, "-c", STALE, str(DOCS)],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


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


def test_every_role_of_a_field_has_a_meaning(generator: ModuleType) -> None:
    roles = dict(generator._roles())
    assert set(roles) >= {"`SCRATCH`", "`STOP`", "`CONSTANT`", "`STATE`"} and all(roles.values())


def test_strategies_import_every_constant_of_the_contract_from_one_module(
    generator: ModuleType,
) -> None:
    named = set(re.findall(r"`([A-Z]+_[A-Z_]*[A-Z])`", generator.contract_page()))
    constants = named - {name.strip("`") for name, _ in generator._roles()}
    assert len(constants) > 60 and constants - vars(api).keys() == set()


def test_the_contract_has_every_part_of_the_view_and_of_the_decisions(
    generator: ModuleType,
) -> None:
    parts = {name.partition(".")[0] for name in generator.SEEN}
    assert parts == set(World.struct_classes()) - {"tally", "time_use", "deadlocks", "refusals"}
    assert Decisions.struct_classes() == generator.DECIDED
