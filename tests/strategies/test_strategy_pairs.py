"""Any shipped strategies deliver together, or are refused: a sample of `strategy_pairs.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import strategy_pairs
from strategy_pairs import OWN, Trial, Verdict, judged, resolved, sample, verdict

from automaton.runs.headless import run_to_end
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import LAYER_NAMES
from automaton.strategy.lookup import names
from automaton.world.resolve import resolve

SAMPLE = sample()
NEWEST = {"allocation": "first-come", "right_of_way": "epibt"}  # taken for such


def test_each_strategy_and_each_scenario_occurs_in_the_sample() -> None:
    occurring = {strategy for trial in SAMPLE for strategy in trial.strategies}
    assert occurring == {(layer, name) for layer in LAYER_NAMES for name in names(layer)}
    assert {trial.scenario for trial in SAMPLE} == set(OWN)


@pytest.mark.parametrize("trial", SAMPLE, ids=str)
def test_what_is_not_refused_delivers_by_legal_answers(trial: Trial) -> None:
    found = verdict(trial, ticks=1500)
    assert found.word == "delivered" or (found.word == "jammed" and trial.may_jam), found


def test_a_new_strategy_changes_no_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the others were tried with and where stays as it was."""
    for layer, new in NEWEST.items():
        others = [name for name in names(layer) if name != new]
        monkeypatch.setattr(
            strategy_pairs,
            "names",
            lambda one, layer=layer, others=others: others if one == layer else names(one),
        )
        before = [trial for trial in sample() if trial.strategies != OWN[trial.scenario]]
        assert set(before) <= set(SAMPLE)


def test_every_pair_is_run_or_refused_in_a_sentence() -> None:
    trials = list(strategy_pairs.covering("tabletop-mini"))
    found = [resolved(trial) for trial in trials]
    tried, refused = set(), []
    for trial, ready in zip(trials, found, strict=True):
        if isinstance(ready, Verdict):
            refused.append(trial)
            assert ready.told.count("\n") == 0 and "strategy." in ready.told
        else:
            tried |= trial.pairs
    for one in LAYER_NAMES:
        for other in LAYER_NAMES[LAYER_NAMES.index(one) + 1 :]:
            for name in names(one):
                for colleague in names(other):
                    pair = ((one, name), (other, colleague))
                    assert pair in tried or any(pair in trial.pairs for trial in refused)


HEAD_ON = """
name: head-on
layout:
  picture: |
    $.....$
    #d###d#
fleet: {robots: 2, start: [[1, 0], [5, 0]]}
orders: {list: [{from: [0, 0], to: [5, 1]}, {from: [6, 0], to: [1, 1]}]}
strategy: {right_of_way: wait}
stop: {when: delivered, max_duration: 5000}
"""


@pytest.mark.parametrize(
    ("setting", "word", "told"),
    [
        ("seed=1", "jammed", "deadlock: robots 0 and 1 form a wait cycle"),
        ("strategy.allocation=example_strategies:Idle", "SILENT", "nothing was delivered"),
        ("strategy.allocation=example_strategies:Greedy", "ILLEGAL", "allocation"),
        ("fleet={robots: 1, start: [[1, 0]]}", "delivered", "2 by tick"),
    ],
)
def test_a_jam_is_told_apart_from_doing_nothing(
    tmp_path: Path, setting: str, word: str, told: str
) -> None:
    path = tmp_path / "head-on.yaml"
    path.write_text(HEAD_ON)
    simulation = Simulation(resolve(path, [setting]))
    last_worked = np.zeros(len(simulation.world.robots.cell), np.int64)
    run_to_end(simulation, last_worked=last_worked)
    found = judged(simulation, last_worked)
    assert found.word == word and told in found.told
    assert found.is_fault == word.isupper()
