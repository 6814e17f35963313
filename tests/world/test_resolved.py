"""What a resolved scenario carries along: the fleet on its floor, found once, and not sent to workers."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from automaton.world import resolve as resolving
from automaton.world.capabilities import FleetOnFloor
from automaton.world.resolve import resolve


def test_the_fleet_of_the_checks_is_that_of_the_scenario(monkeypatch: pytest.MonkeyPatch) -> None:
    checked: list[FleetOnFloor] = []
    check = resolving.feasible_fleet

    def keep(*given: Any, **named: Any) -> FleetOnFloor:
        checked.append(check(*given, **named))
        return checked[-1]

    monkeypatch.setattr(resolving, "feasible_fleet", keep)
    resolved = resolve("tabletop-mini")
    assert [resolved.fleet] == checked


def test_other_durations_make_another_fleet() -> None:
    resolved = resolve("tabletop-mini")
    durations = msgspec.structs.replace(resolved.scenario.durations, move=7)
    slower = replace(
        resolved, scenario=msgspec.structs.replace(resolved.scenario, durations=durations)
    )
    assert (resolved.fleet.least_move, slower.fleet.least_move) == (1, 7)


def test_the_fleet_is_not_pickled_but_found_again() -> None:
    resolved = resolve("tabletop-mini")
    assert resolved.fleet.served.any()
    sent = pickle.dumps(resolved)
    assert b"FleetOnFloor" not in sent
    received = pickle.loads(sent)
    assert received.scenario == resolved.scenario and received.start == resolved.start
    assert np.array_equal(received.fleet.served, resolved.fleet.served)
