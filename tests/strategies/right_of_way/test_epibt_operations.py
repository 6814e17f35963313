"""The operations of EPIBT: how many there are, and that what is left of a plan is always one of them."""

from __future__ import annotations

import pytest
import reference_epibt

from strategies.right_of_way.epibt.epibt_state import (
    FULL_WAIT,
    ends_in_turn,
    operations_of,
    trace,
    weight,
)

DEPTHS = (3, 4, 5)
LETTERS = {"F": 0, "R": 1, "L": 2, "W": 3}


@pytest.mark.parametrize(
    ("depth", "classes", "candidates"), [(3, 31, 16), (4, 88, 47), (5, 249, 135)]
)
def test_so_many_operations_differ(depth: int, classes: int, candidates: int) -> None:
    """The counts of the paper."""
    operations = operations_of(depth)
    assert len(operations.actions) == classes
    assert len({trace(actions) for actions in operations.actions}) == classes
    assert len(operations.candidates) == candidates


def test_candidates_of_three_actions() -> None:
    """Ascending by weight; robots that wait first turn as late as they can."""
    operations = operations_of(3)
    texts = [operations.texts[number] for number in operations.candidates]
    assert " ".join(texts) == ("WWF WRF WLF RRF WFW RFW LFW FWW WFF RFF LFF FWF FRF FLF FFW FFF")


@pytest.mark.parametrize("depth", DEPTHS)
def test_what_is_left_of_a_plan_after_a_tick_is_an_operation(depth: int) -> None:
    """The cells of the rest are those of the plan, seen from where its first action leads."""
    operations = operations_of(depth)
    for actions, following in zip(operations.actions, operations.following, strict=True):
        rest = trace((*actions[1:], LETTERS["W"]))
        assert trace(operations.actions[following]) == rest


@pytest.mark.parametrize("depth", DEPTHS)
def test_no_candidate_ends_in_a_turn_or_waits_throughout(depth: int) -> None:
    operations = operations_of(depth)
    assert FULL_WAIT not in operations.candidates
    assert not any(ends_in_turn(operations.actions[number]) for number in operations.candidates)


def test_the_list_is_that_of_a_second_implementation() -> None:
    for depth in (3, 4):
        operations = operations_of(depth)
        assert operations.texts == reference_epibt.classes(depth)
        assert [operations.texts[number] for number in operations.candidates] == [
            text
            for text in reference_epibt.classes(depth)[1:]
            if not reference_epibt.ends_in_turn(text)
        ]


def test_of_equal_ends_the_early_move_weighs_more() -> None:
    early, late = (tuple(LETTERS[letter] for letter in text) for text in ("FWW", "WWF"))
    assert weight(early) > weight(late)
