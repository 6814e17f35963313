"""Which metrics a scenario can have is known before it runs."""

from __future__ import annotations

import pytest

from automaton.glossary import GLOSSARY
from automaton.metrics import metrics_of
from automaton.scenario.measures import not_measured
from automaton.scenario.reading import shipped
from automaton.scenario.resolve import resolve
from automaton.simulation import Simulation

COUNTED_BY_STRATEGIES = {"alternatives", "in_balance", "load_shares", "messages", "redesigns"}
ONCE_ONE_HAS_ENDED = {"part_time"}


@pytest.mark.parametrize("name", shipped())
def test_what_a_scenario_is_said_not_to_measure_is_what_its_runs_lack(name: str) -> None:
    resolved = resolve(name)
    simulation = Simulation(resolved)
    simulation.run(min(3000, resolved.scenario.stop.at_most))
    lacking = set(GLOSSARY) - set(metrics_of(simulation))
    told = set(not_measured(resolved.scenario))
    assert told <= lacking
    assert lacking - told <= COUNTED_BY_STRATEGIES | ONCE_ONE_HAS_ENDED
