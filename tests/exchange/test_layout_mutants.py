"""Layouts that have been damaged: a sentence, or a scenario that `check` accepts, and no traceback.

nice python tests/helpers/layout_mutants.py [MUTANTS] [FIRST]      for many more
"""

from __future__ import annotations

from pathlib import Path

import pytest
from layout_mutants import MUTATED, outcome


@pytest.mark.parametrize("name", MUTATED)
def test_no_mutant_of_a_layout_gives_a_traceback_or_a_bad_scenario(
    name: str, tmp_path: Path
) -> None:
    codes = {outcome(name, seed, tmp_path) for seed in range(40)}
    assert {0, 2} <= codes <= {0, 1, 2}


@pytest.mark.parametrize("name", ["drawn lif", "drawn opentcs"])
def test_drawn_graphs_become_scenarios_or_a_sentence(name: str, tmp_path: Path) -> None:
    codes = {outcome(name, seed, tmp_path) for seed in range(40)}
    assert {0, 2} <= codes <= {0, 1, 2}
