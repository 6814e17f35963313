"""Compile: what a batch needs is there before it begins."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.commands import main
from automaton.commands.compile_command import compile_others
from automaton.scenario.schema import LAYER_NAMES
from automaton.strategy import lookup

OWN = """from automaton.strategy.api import Strategy, kernel


@kernel
def decide(view, batch, decisions, memory, workspace):
    batch.count = view.no_such_field


class Broken(Strategy):
    layer = "right_of_way"
    compiled = decide
"""


def test_the_points_of_a_study_are_compiled_and_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "my.yaml"
    study.write_text(
        "name: my\nscenario: tabletop-mini\nreplications: 1\n"
        "factors: {fleet.robots: [1, 2], strategy.right_of_way: [retreat, wait]}\n"
    )
    assert main(["compile", str(study), "tabletop-1"]) == 0
    assert capsys.readouterr().out.startswith("the world and strategies (4): compiled in ")


def test_strategies_that_no_shipped_scenario_names_are_compiled_too() -> None:
    assert main(["compile", "tabletop-mini"]) == 0
    all_there_are = {(layer, name) for layer in LAYER_NAMES for name in lookup.names(layer)}
    left = {("allocation", "first-come"), ("charging", "none")}
    assert compile_others(all_there_are - left) == left


def test_a_strategy_that_does_not_compile_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own_broken_kernel.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "mine.yaml").write_text(
        "name: mine\nlayout: {picture: 'A..'}\nfleet: {robots: 1, kinematics: omni}\n"
        "orders: {list: [{stops: [[2, 0]]}]}\n"
        "strategy: {allocation: greedy, right_of_way: 'own_broken_kernel:Broken'}\n"
    )
    assert main(["compile", str(tmp_path / "mine.yaml")]) == 2
    assert "own_broken_kernel.py:4: the strategy does not compile: " in capsys.readouterr().err


def test_without_the_compiler_there_is_nothing_to_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("automaton.engine.jit.kernel.jit_is_on", lambda: False)
    assert main(["compile", "tabletop-mini"]) == 2
    assert "NUMBA_DISABLE_JIT turns compiling off; unset it" in capsys.readouterr().err
