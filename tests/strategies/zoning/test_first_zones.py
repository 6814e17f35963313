"""The zones with which a run begins, where the scenario gives none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, resolve
from strategies.zoning import monitored

NEGOTIATED = "strategy.zoning={name: decentralized, adjacency: 300}"
LIMITED = "information={radius: 131, shape: circle, orders: zones}"
NONE_FOUND = "zoning found no zones for 3 robots on this floor"


def factory(*settings: str) -> Resolved:
    return resolve("factory", list(settings))


@pytest.mark.parametrize("settings", [(NEGOTIATED,), (NEGOTIATED, LIMITED)], ids=["all", "limited"])
def test_zones_are_looked_for_beforehand_as_robots_will(
    settings: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Robots that negotiate could not say that there are none."""
    tried: list[Any] = []
    find = monitored.first_zones

    def noted(*arguments: Any) -> int:
        tried.append(arguments[6])
        return int(find(*arguments))

    monkeypatch.setattr(monitored, "first_zones", noted)
    run = Simulation(factory(*settings))
    run.run(until=1)
    (design,) = tried
    assert np.array_equal(design.zone, run.world.service_zones.design.zone)
    assert len(set(design.zone.tolist())) == 3


def test_where_there_are_none_a_run_does_not_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(monitored, "first_zones", lambda *_: 0)
    with pytest.raises(InputError, match=NONE_FOUND):
        Simulation(factory(NEGOTIATED))
    monkeypatch.setattr(monitored, "first_zones", lambda *_: 0)
    with pytest.raises(InputError, match=NONE_FOUND):
        Simulation(factory("strategy.zoning=annealing")).run(until=1)


def test_zones_that_are_given_are_not_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(monitored, "first_zones", lambda *_: 0)
    run = Simulation(resolve("factory-ddz", []))
    given = run.world.service_zones.design.zone.copy()
    run.run(until=1)
    assert np.array_equal(run.world.service_zones.design.zone, given)
