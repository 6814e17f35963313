"""A sample of the mutants of `python tests/proofs/mutated_files.py`, of all kinds of files."""

from __future__ import annotations

from collections import Counter

import pytest
from file_mutants import SLOW, cases, draw, outcome

# One from each kind of file; what they read and run is compiled for other tests, too.
SAMPLED = (
    *("scenario crossing", "scenario depots", "scenario goods-mini", "study goods-fleet"),
    *("import site-1.lif", "import site-opentcs.xml", "import problem.json", "import a.scen"),
    *("import problem", "import hall.yaml", "output.json"),
    *("tables lines.csv", "tables lines.xlsx", "tables orders.csv"),
)
EACH = 12


@pytest.mark.parametrize("name", SAMPLED)
def test_whole_files_are_accepted(name: str) -> None:
    case = cases()[name]
    assert outcome(case, case.files) == "accepted"


@pytest.mark.parametrize("name", SAMPLED)
def test_mutants_are_refused_in_a_sentence_or_accepted_and_run(name: str) -> None:
    outcomes: Counter[str] = Counter()
    for number in range(EACH):
        said = outcome(*draw(number, 1, name))
        assert said in ("accepted", "refused"), f"--only '{name}' --seed 1 --first {number}: {said}"
        outcomes[said] += 1
    assert outcomes["refused"] > 0


def test_cases_have_names_of_their_own() -> None:
    assert set(SAMPLED) | {f"scenario {name}" for name in SLOW} <= set(cases())
