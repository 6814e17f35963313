"""Checks of scenarios are values: they yield keys and sentences, and know no files."""

from __future__ import annotations

import ast
import sys
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

import msgspec
import pytest

from automaton.errors import Finding, InputError, InvalidValueError, refuse
from automaton.scenario import document
from automaton.world import feasibility
from automaton.world.feasibility import check_areas, check_energy, check_listed_starts
from automaton.world.resolve import resolve

WORLD = Path(feasibility.__file__).parent
MODULES = sorted(WORLD.glob("*.py"))


@pytest.mark.parametrize("module", MODULES, ids=lambda path: path.stem)
def test_no_function_of_the_world_takes_a_document(module: Path) -> None:
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            given = node.args
            extra = [one for one in (given.vararg, given.kwarg) if one is not None]
            for one in (*given.posonlyargs, *given.args, *given.kwonlyargs, *extra):
                hint = "" if one.annotation is None else ast.unparse(one.annotation)
                assert "Document" not in hint and one.arg != "document", (module.name, node.lineno)
        if isinstance(node, ast.ImportFrom) and node.module == document.__name__:
            assert [one.name for one in node.names] == ["Override"], module.name


@pytest.mark.parametrize("name", ["tabletop-1", "factory"])
def test_the_document_is_entered_a_few_times_from_a_file_to_resolve(name: str) -> None:
    entries: Counter[str] = Counter()

    def note(frame: FrameType, event: str, argument: Any) -> None:
        caller = "" if frame.f_back is None else frame.f_back.f_code.co_filename
        if event == "call" and frame.f_code.co_filename == document.__file__ != caller:
            entries[frame.f_code.co_name] += 1

    former = sys.getprofile()
    sys.setprofile(note)
    try:
        resolve(name)
    finally:
        sys.setprofile(former)
    assert 0 < entries.total() <= 8


def test_a_check_says_all_that_it_finds() -> None:
    resolved = resolve("tabletop-mini")
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    faults = [{"at": 5, "robot": 99}, {"at": 7, "robot": 100}]
    broken = msgspec.convert(
        {**msgspec.to_builtins(scenario), "faults": {"list": faults}}, type(scenario)
    )
    found = list(check_energy(broken, floor_plan))
    assert [keys for keys, _ in found] == [("faults", "list", k, "robot") for k in (0, 1)]
    assert found[0].sentence.startswith("there is no robot 99: fleet.robots is ")
    assert list(check_areas(scenario, floor_plan)) == []
    far = floor_plan.width
    outside = [keys for keys, _ in check_listed_starts(((far, 0), (far, 1)), 2, floor_plan)]
    assert outside == [("fleet", "start", 0), ("fleet", "start", 1)]


def test_the_first_finding_is_raised_and_the_reader_gives_it_its_line(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError) as raised:
        refuse([Finding(("areas",), "first"), Finding(("layout",), "second")])
    assert (raised.value.keys, str(raised.value)) == (("areas",), "first")
    refuse([])
    file = tmp_path / "two.yaml"
    file.write_text(
        "name: two\nlayout:\n  picture: |\n    t..t\nfleet:\n  robots: 2\n  start:\n"
        "  - [0, 0]\n  - [9, 0]\norders: {tasks: [[[1, 0]]]}\n"
    )
    with pytest.raises(InputError) as placed:
        resolve(file)
    assert (placed.value.file, placed.value.line) == (str(file), 9)
    assert placed.value.message.startswith("robot 1 would start at [9, 0], outside the floor")
    with pytest.raises(InputError) as given:
        resolve(file, ["fleet.start.1=[8, 0]"])
    assert (given.value.file, given.value.line) == ("--set fleet.start.1=[8, 0]", None)
