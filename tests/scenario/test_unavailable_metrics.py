"""Which metrics a scenario can have is known before it runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.text_files import shipped
from automaton.scenario.unavailable_metrics import not_measured
from automaton.world.resolve import resolve

COUNTED_BY_STRATEGIES = {
    "alternative_routes",
    "deadlocks_resolved",
    "balanced_share",
    "shared_orders",
    "messages",
    "redesigns",
}
ONCE_ONE_HAS_ENDED = {"part_flow_time", "makespan", "longest_standstill"}


LISTED = """
name: listed
layout: {picture: "i....d"}
fleet: {robots: 1, kinematics: omni, start: [[1, 0]]}
orders: ORDERS
stop: {when: never, max_duration: 60}
"""
AT_ONCE = "{list: [{from: [0, 0], to: [5, 0]}]}"
LATER = "{list: [{from: [0, 0], to: [5, 0], release: 9}]}"
OF_A_FILE = "{transports: {file: orders.csv}}"


@pytest.mark.parametrize("name", shipped())
def test_what_a_scenario_is_said_not_to_measure_is_what_its_runs_lack(name: str) -> None:
    check(name)


@pytest.mark.parametrize(
    ("orders", "lead_times"), [(AT_ONCE, False), (LATER, True), (OF_A_FILE, True)]
)
def test_orders_that_are_listed_with_their_ticks_have_lead_times(
    orders: str, lead_times: bool, tmp_path: Path
) -> None:
    (tmp_path / "orders.csv").write_text("released,from_x,from_y,to_x,to_y\n9,0,0,5,0\n")
    (tmp_path / "listed.yaml").write_text(LISTED.replace("ORDERS", orders))
    assert ("lead_time" in check(tmp_path / "listed.yaml")) == lead_times


def check(scenario: str | Path) -> set[str]:
    """That what is told of a scenario's metrics is true; those that it has."""
    resolved = resolve(scenario)
    simulation = Simulation(resolved)
    simulation.run(min(3000, resolved.scenario.stop.max_duration))
    lacking = set(METRIC_CATALOGUE) - set(metrics_of(simulation))
    told = set(not_measured(resolved.scenario))
    assert told <= lacking
    assert lacking - told <= COUNTED_BY_STRATEGIES | ONCE_ONE_HAS_ENDED
    return set(METRIC_CATALOGUE) - lacking
