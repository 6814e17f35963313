"""One robot, one pod: a queue of which all is known."""

from __future__ import annotations

import pytest

from automaton.papers import queue_study
from automaton.papers.queue_study import EXPONENTIAL, FIXED, LOGNORMAL, exact_wait, waits
from automaton.papers.reproduction_study import RunCase


@pytest.mark.parametrize(
    ("handling", "ticks"), [(FIXED, 102.0), (EXPONENTIAL, 116.6), (LOGNORMAL, 105.8)]
)
def test_the_formula(handling: str, ticks: float) -> None:
    """As an independent program computed it."""
    assert exact_wait(handling) == pytest.approx(ticks, abs=0.05)


def test_each_wait_follows_from_the_one_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(queue_study, "QUEUE_LINES", 400)
    (figures,) = waits(RunCase({"handling": EXPONENTIAL}), seed=3)
    assert figures["wrong_lines"] == 0
    assert figures["wait"] > 0
