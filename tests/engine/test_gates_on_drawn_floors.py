"""Drawn floors with gates under every right of way: a sample of `tests/helpers/gate_trials.py`."""

from __future__ import annotations

from gate_trials import trials


def test_on_drawn_floors_no_rule_is_broken_and_storage_does_not_matter() -> None:
    wrong, figures = trials(range(24))
    assert wrong == []
    assert figures["floors"] > 10 and figures["delivered"] > 100 and figures["lost"] > 100
    for kind in ("closings", "doors", "blocks", "lifts"):
        assert figures[kind] > 0, f"no floor has {kind}"
