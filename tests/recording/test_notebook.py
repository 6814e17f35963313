"""The notebooks of the documentation: their cells run, and show what they say."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from automaton.commands import main

NOTEBOOKS = Path(__file__).parents[2] / "docs" / "notebooks"
LINES = 10


def code_cells(name: str = "recording-to-histogram") -> list[str]:
    cells = json.loads((NOTEBOOKS / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


class Drawn(ModuleType):
    """Stands in for matplotlib.pyplot, an extra, and keeps what is drawn."""

    def __init__(self) -> None:
        super().__init__("matplotlib.pyplot")
        self.ways: list[Any] = []
        self.values: list[Any] = []

    def plot(self, x: Any, y: Any) -> None:
        self.ways.append((x, y))

    def hist(self, values: Any, bins: int) -> None:
        self.values.append(values)

    def show(self) -> None:
        pass


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    pyplot, package = Drawn(), ModuleType("matplotlib")
    package.pyplot = pyplot  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "matplotlib", package)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", pyplot)
    return pyplot


def test_ten_lines_lead_from_a_recording_to_two_drawings(
    drawn: Drawn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    allocation = "strategy.allocation=first-come"
    assert main(["run", "tabletop-mini", "--record", "run.rec", "--set", allocation]) == 0
    names: dict[str, Any] = {}
    for cell in code_cells():
        exec(cell, names)
    [(x, y)] = drawn.ways
    steps = np.abs(np.diff(x)) + np.abs(np.diff(y))
    assert len(x) == names["tables"].states["tick"].to_pylist()[-1] + 1
    assert np.nanmax(steps) == 1  # from each tick to the next a robot moves one cell at most
    [delays] = drawn.values
    assert len(delays) == len(names["tables"].orders) and (delays >= 0).all()


def test_the_notebook_is_short() -> None:
    lines = [line for cell in code_cells() for line in cell.splitlines() if line.strip()]
    assert len(lines) <= LINES


def test_cells_that_end_with_a_run_show_its_floor_and_a_film(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    shown = []
    for cell in code_cells("a-run-in-a-notebook"):
        *statements, last = cell.splitlines()
        exec("\n".join(statements), names)
        shown.append(eval(last, names)._repr_html_())
    end, marked, film = shown
    ticks = names["outcome"].ticks
    assert end.startswith("<div><svg ") and f"finished in tick {ticks:,}" in end
    assert "tick 120" in marked and marked != end
    assert film.startswith("<iframe srcdoc=") and f"&quot;last&quot;:{ticks}" in film
