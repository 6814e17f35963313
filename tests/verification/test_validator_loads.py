"""The validator on loads and reservations: a recording made by hand for each rule."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from handmade_recordings import FLOOR, E, S, header, played, rules

from automaton.engine.record_codes import (
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_SLOT_RESERVED,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_TRY_DROP,
    EXECUTED_WAIT,
)

# Loads. Slots in table order: 0 = shelf (1, 2), 1 = shelf (2, 2), 2 and 3 = destinations at (5, 1)
# and (5, 2). Orders 0 and 1 lie on shelves 0 and 1; A stands at (1, 1), B at (2, 1).

TO_LAST = {"list": [{"from": [1, 2], "to": [5, 2]}, {"from": [2, 2], "to": [1, 2]}]}


def table(*starts: tuple[int, int]) -> dict[str, Any]:
    return header(FLOOR, list(starts) or [(1, 1), (2, 1)], orders=TO_LAST)


PICK_0 = [(1, CHANGE_ORDER_RESERVED, 0, 0), (1, CHANGE_PICKED, 0, 0)]
PICK_1 = [(1, CHANGE_ORDER_RESERVED, 1, 1), (1, CHANGE_PICKED, 1, 1)]


def test_a_load_is_carried_to_its_destination() -> None:
    way = [{0: EXECUTED_PICK}, {0: E}, {0: E}, {0: E}, {0: S}, {0: EXECUTED_DROP}]
    changes = [*PICK_0, (6, CHANGE_DROPPED, 0, 3), (6, CHANGE_ORDER_RESERVED, 0, -1)]
    assert played(table((1, 1)), *way, changes=changes).valid


@pytest.mark.parametrize(
    ("rule", "changes"),
    [
        ("load", [(1, CHANGE_ORDER_RESERVED, 0, 0)]),  # picks, but what?
        ("order", [(1, CHANGE_PICKED, 0, 0)]),  # not reserved
        ("order", [(1, CHANGE_ORDER_RESERVED, 0, 1), (1, CHANGE_PICKED, 0, 0)]),  # reserved by B
        ("load", [(1, CHANGE_ORDER_RESERVED, 1, 0), (1, CHANGE_PICKED, 0, 1)]),  # not beside it
        (
            "order",
            [
                (1, CHANGE_ORDER_RESERVED, 0, 1),
                (1, CHANGE_ORDER_RESERVED, 0, 0),
                (1, CHANGE_PICKED, 0, 0),
            ],
        ),  # two have it
        ("order", [(1, CHANGE_ORDER_RESERVED, 1, 0), *PICK_0]),  # one has two
        ("order", [(1, CHANGE_ORDER_RESERVED, 1, -1), *PICK_0]),  # nobody had it
        ("order", [*PICK_0, (1, CHANGE_ORDER_RESERVED, 0, -1)]),  # it is carried
        ("slot", [*PICK_0, (1, CHANGE_SLOT_RESERVED, 1, 0)]),  # a full shelf
        ("slot", [*PICK_0, (1, CHANGE_SLOT_RESERVED, 3, 0)]),  # a destination
        ("slot", [(1, CHANGE_SLOT_RESERVED, 0, 0), *PICK_0]),  # full, and before there is a load
        ("slot", [*PICK_0, (1, CHANGE_SLOT_RESERVED, 0, 1)]),  # B has no load
        ("slot", [*PICK_0, (1, CHANGE_SLOT_RESERVED, 0, -1)]),  # nobody had it
        ("duration", [*PICK_0, (1, CHANGE_DURATION, 0, 5)]),
        ("record", [*PICK_0, (1, 99, 0, 0)]),
        ("record", [*PICK_0, (1, CHANGE_ORDER_RESERVED, 7, 0)]),
    ],
)
def test_a_pick_that_breaks_a_rule(rule: str, changes: list[tuple[int, int, int, int]]) -> None:
    assert set(rules(played(table(), {0: EXECUTED_PICK}, changes=changes))) == {rule}


def test_two_robots_reserve_one_shelf() -> None:
    picked = [*PICK_0, *PICK_1, (1, CHANGE_SLOT_RESERVED, 0, 0)]
    both = {0: EXECUTED_PICK, 1: EXECUTED_PICK}
    assert played(table(), both, changes=picked).valid
    assert rules(played(table(), both, changes=[*picked, (1, CHANGE_SLOT_RESERVED, 0, 1)])) == [
        "slot"
    ]
    assert rules(played(table(), both, changes=[*picked, (1, CHANGE_SLOT_RESERVED, 1, 0)])) == [
        "slot"
    ]


@pytest.mark.parametrize(
    ("rule", "rows"),
    [
        (
            None,
            [
                (2, CHANGE_SLOT_RESERVED, 0, 0),
                (2, CHANGE_DROPPED, 0, 0),
                (2, CHANGE_ORDER_RESERVED, 0, -1),
                (2, CHANGE_SLOT_RESERVED, 0, -1),
            ],
        ),
        ("slot", [(2, CHANGE_DROPPED, 0, 0)]),  # an empty shelf, but not reserved
        ("load", []),  # drops, but where?
        (
            "load",
            [(2, CHANGE_SLOT_RESERVED, 0, 0), (2, CHANGE_DROPPED, 0, 0), (2, CHANGE_DROPPED, 0, 0)],
        ),  # the second of none
        ("load", [(2, CHANGE_DROPPED, 0, 3)]),  # its destination, far away
    ],
)
def test_a_drop(rule: str | None, rows: list[tuple[int, int, int, int]]) -> None:
    report = played(table(), {0: EXECUTED_PICK}, {0: EXECUTED_DROP}, changes=[*PICK_0, *rows])
    assert set(rules(report)) == ({rule} if rule else set())


def test_a_drop_at_a_foreign_destination() -> None:
    way = [{0: EXECUTED_PICK}, {0: E}, {0: E}, {0: E}, {0: EXECUTED_DROP}]
    assert rules(played(table((1, 1)), *way, changes=[*PICK_0, (5, CHANGE_DROPPED, 0, 2)])) == [
        "load"
    ]


def test_a_drop_on_a_full_shelf() -> None:
    changes = [*PICK_0, (3, CHANGE_DROPPED, 0, 1)]
    report = played(table((1, 1)), {0: EXECUTED_PICK}, {0: E}, {0: EXECUTED_DROP}, changes=changes)
    assert rules(report) == ["load", "slot"]  # full, and so it cannot have been reserved


def test_a_second_load_and_a_load_from_nowhere() -> None:
    twice = [*PICK_0, (2, CHANGE_PICKED, 0, 0)]
    report = played(table(), {0: EXECUTED_PICK}, {0: EXECUTED_PICK}, changes=twice)
    assert set(rules(report)) == {"load"}
    assert rules(played(table(), {0: 0}, changes=PICK_0)) == ["load"]  # picked without a pick
    assert rules(played(table(), {0: EXECUTED_TRY_DROP})) == ["load"]


def test_two_loads_on_one_shelf_at_the_start() -> None:
    head = copy.deepcopy(table())
    head["orders"]["source"][1] = 0
    assert rules(played(head, {})) == ["load"]


def test_waits_say_how_long_they_take() -> None:
    head = header(FLOOR, [(0, 0)])
    assert rules(played(head, {0: EXECUTED_WAIT})) == ["duration"]
    assert rules(played(head, {0: EXECUTED_WAIT}, changes=[(1, CHANGE_DURATION, 0, 0)])) == [
        "duration"
    ]
    assert played(head, {0: EXECUTED_WAIT}, changes=[(1, CHANGE_DURATION, 0, 4)]).valid
