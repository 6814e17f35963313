"""`automaton reproduce traffic-fleet`: every robot of the warehouse follows the same policy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from automaton.papers.reproduction_study import ScenarioCase, find, scenario_runs
from automaton.papers.traffic_fleet import (
    A_STAR,
    AVOIDANCE,
    CHANCE,
    CONGESTION,
    FLEET_SIZES,
    LARGEST_FLEET,
    ROUTING_POLICIES,
    TIME_AVERAGE,
    UNDELAYED,
    delayed_fleets,
    fleets,
)
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

Figures = dict[tuple[str, int | str], dict[str, float]]  # (policy, robots or chance) -> metrics


def chosen() -> Iterator[ScenarioCase]:
    """The cases on which the claims rest, but for avoidance by small fleets."""
    for case in fleets([A_STAR, AVOIDANCE, TIME_AVERAGE, UNDELAYED, CONGESTION]):
        if case.labels["robots"] == LARGEST_FLEET or case.labels == {
            "policy": CONGESTION,
            "robots": 6,
        }:
            yield case
    yield from fleets([A_STAR])[:1]
    yield from delayed_fleets([A_STAR, CONGESTION])


@pytest.fixture(scope="module")
def one_seed() -> Figures:
    cases = list(chosen())
    results = scenario_runs()(cases, [1], 1, None)
    assert all(result.finished for [result] in results)
    return {case.key: dict(result.metrics) for case, [result] in zip(cases, results, strict=True)}


def test_a_hundred_robots_lose_little_time_to_each_other(one_seed: Figures) -> None:
    assert one_seed[CONGESTION, 100]["delay"] <= 7
    assert one_seed[A_STAR, 100]["delay"] == pytest.approx(47, abs=4)
    gain = one_seed[CONGESTION, 100]["completions"] / one_seed[A_STAR, 100]["completions"]
    assert gain >= 1.2


def test_avoidance_used_by_everybody_is_harmful(one_seed: Figures) -> None:
    assert one_seed[AVOIDANCE, 100]["delay"] > 150


def test_to_know_the_tasks_of_the_others_is_not_enough(one_seed: Figures) -> None:
    """Only who knows the plans loses less than by A*; to know when is not worth much alone."""
    for policy in (TIME_AVERAGE, UNDELAYED):
        assert 40 < one_seed[policy, LARGEST_FLEET]["delay"] < 110


def test_a_small_fleet_loses_nothing(one_seed: Figures) -> None:
    assert one_seed[CONGESTION, 6]["delay"] <= one_seed[A_STAR, 6]["delay"] < 4


def test_plans_that_are_not_kept_are_borne(one_seed: Figures) -> None:
    assert one_seed[CONGESTION, CHANCE]["delay"] <= 27
    assert one_seed[A_STAR, CHANCE]["delay"] == pytest.approx(62, abs=6)


def test_every_policy_faces_the_same_orders() -> None:
    orders = [
        Simulation(resolve(case.scenario, case.overrides), seed=2).world.orders
        for case in fleets(list(ROUTING_POLICIES))
        if case.labels["robots"] == 20
    ]
    assert len(orders) == len(ROUTING_POLICIES)
    for other in orders[1:]:
        assert np.array_equal(other.source, orders[0].source)
        assert np.array_equal(other.target, orders[0].target)


def test_any_routing_strategy_may_be_compared() -> None:
    cases = fleets(["shortest"])
    assert [case.labels["robots"] for case in cases] == list(FLEET_SIZES)
    assert resolve(cases[0].scenario, cases[0].overrides).strategies["routing"].name == "shortest"


def test_there_are_no_printed_figures() -> None:
    reproduction = find("traffic-fleet")
    for table in reproduction.tables:
        for case in table.cases(reproduction.strategies):
            assert all(table.published(case.key, metric) is None for metric in table.metrics)
