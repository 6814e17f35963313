"""Fleets that are steered break no rule on random floors: a sample of `steering_trials.py`."""

from __future__ import annotations

import pytest
from steering_trials import STRATEGIES, scenario_of, trials

from automaton.world.resolve import resolve


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_random_fleets_break_no_rule_and_give_no_illegal_answer(strategy: str) -> None:
    found = list(trials(strategy, 50_000))[-1]
    assert found.wrong == [] and found.runs > 2


def test_trials_are_of_all_kinds() -> None:
    drawn = [scenario_of("pibt", seed) for seed in range(1, 60)]
    assert {one.fleet.kinematics for one in drawn} == {"rail", "differential", "omni"}
    pictures = "".join(one.layout["picture"] for one in drawn)
    assert set("bct=~><v^+-|#") <= set(pictures)
    assert {one.orders.generator for one in drawn} == {"stations", "visits", "tours"}
    assert {one.strategy.zoning for one in drawn} == {"none", "static", "annealing"}
    assert {one.world.following for one in drawn} == {"convoy", "handover", "none"}
    assert {"everything"} < {str(one.information) for one in drawn}
    assert any(one.areas for one in drawn) and any(one.battery for one in drawn)
    assert any(one.faults.listed for one in drawn) and any(
        one.world.slowdown == "zones" for one in drawn
    )
    assert any(one.fleet.when_idle == "leave" for one in drawn)


def test_a_trial_has_the_same_scenario_again() -> None:
    one, again = (resolve(scenario_of("epibt", 3)) for _ in range(2))
    assert one.scenario == again.scenario and one.start == again.start
