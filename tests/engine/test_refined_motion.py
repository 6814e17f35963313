"""A world whose tick is K times finer has its robots in the same places: motion without strategies."""

from __future__ import annotations

import pytest
from moving_worlds import WORLDS, MakeWorld, NaiveWorld
from refinement_trials import ALWAYS, ONCE, drawn_case, is_refined, states_of

from automaton.runs.pictures.pictures import Following

CASES = 40


@pytest.mark.parametrize("fine", [2, 3])
@pytest.mark.parametrize("put", [ONCE, ALWAYS])
@pytest.mark.parametrize(("make", "following"), [one for one in WORLDS if one[1] != "handover"])
def test_a_finer_tick_changes_nothing(
    make: MakeWorld, following: Following, put: str, fine: int
) -> None:
    cases = [drawn_case(seed) for seed in range(CASES)]
    assert [c.seed for c in cases if not is_refined(make, c, following, fine, put)] == []


def test_under_handover_a_finer_tick_is_another_world() -> None:
    cases = [drawn_case(seed) for seed in range(CASES)]
    same = sum(is_refined(NaiveWorld, case, "handover", 2, ONCE) for case in cases)
    assert 0 < same < CASES * 3 // 4


def test_the_cases_are_crowded_enough_for_robots_to_follow() -> None:
    followers = 0
    for case in map(drawn_case, range(CASES)):
        for states in states_of(NaiveWorld, case, "convoy", 1, ONCE):
            cells = {cell for cell, _, _ in states}
            followers += sum(claim in cells for _, claim, _ in states)
    assert followers > 100
