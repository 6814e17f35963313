"""Streets in words and as a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from street_designs import design_of

from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import EAST, WEST, FloorPlan
from automaton.studies.inference.intervals import Interval, effect
from automaton.studies.street_search.designs import StreetDesign
from automaton.studies.street_search.one_way import OneWay
from automaton.studies.street_search.reasons import (
    FewerStreets,
    GroupChange,
    GuidedStreet,
    Reason,
    streets_of,
)
from automaton.studies.street_search.street_report import (
    drawn_streets,
    fewer_words,
    how_compared,
    one_way_words,
    reasons_in_words,
    reasons_table,
    sentence,
)

RING = "......\n.####.\n......"
CLOCKWISE = (
    ("row", 0, "west", 4),
    ("row", 2, "east", 4),
    ("column", 0, "south", 4),
    ("column", 5, "north", 4),
)


def ring(*streets: Any) -> tuple[StreetDesign, FloorPlan]:
    floor_plan = draw_floor(RING)
    return design_of(floor_plan, *streets), floor_plan


def test_a_ring_is_drawn_with_an_arrow_in_each_cell() -> None:
    design, floor_plan = ring(*CLOCKWISE)
    design.closed[[floor_plan.cell(x, 0) for x in range(1, 6)], WEST] = True
    assert drawn_streets(design, floor_plan, ascii_only=True) == [
        "EEEEEs",
        "n####s",
        "nwwwww",
    ]
    assert drawn_streets(design, floor_plan, ascii_only=False) == [
        "↠↠↠↠↠⇣",
        "⇡####⇣",
        "⇡⇠⇠⇠⇠⇠",
    ]


def test_a_weak_preference_is_no_arrow() -> None:
    assert drawn_streets(*ring(("row", 0, "west", 1.2), ("row", 2, "west", 1.25)), True) == [
        "......",
        ".####.",
        "eeeee.",
    ]


def test_equal_streets_that_cross_are_drawn_in_turn() -> None:
    floor_plan = draw_floor("....\n....\n....")
    streets = [("row", y, "west", 2) for y in range(3)]
    streets += [("column", x, "north", 2) for x in range(4)]
    rows = drawn_streets(design_of(floor_plan, *streets), floor_plan, True)
    assert {*rows[0][:3], *rows[1][:3]} == {"e", "s"}
    assert rows[0][0] != rows[0][1] != rows[1][1]


def reason_of(gain: float, spread: float) -> tuple[Reason, FloorPlan]:
    """A reason whose street is worth this."""
    design, floor_plan = ring(CLOCKWISE[0])
    [street] = streets_of(design, floor_plan)
    without = 100 + np.arange(40) % 7
    noise = spread * np.where(np.arange(40) % 2, 1.0, -1.0)
    return Reason(street, effect(without * (1 + gain) + noise, without, True), gain), floor_plan


def test_a_reason_says_what_a_street_is_worth_and_for_whom() -> None:
    reason, floor_plan = reason_of(0.02, 0.5)
    name = "row 0, east 4 times as cheap: +2.0 % (+1.8 to +2.2)"
    assert sentence(reason, floor_plan) == name
    more, less = Interval(0.06, 0.041, 0.079, 40, "t"), Interval(-0.03, -0.039, -0.021, 40, "t")
    reason = reason._replace(costs=GroupChange("from station 3 to station 7", more))
    reason = reason._replace(saves=GroupChange("from the north to the south", less))
    assert sentence(reason, floor_plan) == (
        f"{name}; costs orders from station 3 to station 7 +6.0 % lead time (+4.1 to +7.9); "
        "saves orders from the north to the south -3.0 % lead time (-3.9 to -2.1)"
    )


def test_streets_without_effect_are_in_the_table_and_not_in_the_sentences() -> None:
    (useful, floor_plan), (useless, _) = reason_of(0.02, 0.5), reason_of(0.0, 0.5)
    table = reasons_table([useful, useless], floor_plan, "throughput")
    assert [row[-1] for row in table.rows] == [
        "+2.0 % (+1.8 to +2.2)",
        "+0.0 % (-0.2 to +0.2), not significant",
    ]
    items = reasons_in_words([useful, useless], floor_plan, "throughput", 0.03).items
    assert len(items) == 3 and items[1] == "1 of 2 streets have a significant effect on throughput"
    assert items[2] == ("the 2 largest gains add up to +2.0 %; all streets together gain +3.0 %")


def test_screened_streets_are_counted_and_those_without_effect_in_any_run_named() -> None:
    (useful, floor_plan), (idle, _) = reason_of(0.02, 0.5), reason_of(0.0, 0.0)
    ranked = [useful, reason_of(0.01, 0.5)[0]._replace(is_confirmed=False), idle]
    ranked[2] = idle._replace(is_confirmed=False)
    items = reasons_in_words(ranked, floor_plan, "throughput", 0.03).items
    assert items[1:4] == [
        "without effect in any run: row 0",
        "1 of 3 streets have a significant effect on throughput",
        "streets with less clear effects that were screened only: 2, of which the intervals of 1 "
        "exclude 0",
    ]
    assert len(reasons_table(ranked, floor_plan, "throughput").rows) == 1
    assert "All were screened in 40 pairs; the 1 with" in how_compared(ranked)
    assert "screened" not in how_compared(ranked[:1])


def test_what_became_one_way_and_what_was_left_out_is_said() -> None:
    design, _ = ring()
    worth, _ = reason_of(-0.002, 0.5)
    street = GuidedStreet((), EAST, (4.0, 4.0), False)
    kept = OneWay(design, (1, 2, 3), (4,), (), worth.worth, True)  # type: ignore[arg-type]
    assert one_way_words(kept) == (
        "one-way streets: 3, -0.2 % (-0.4 to -0.0) against weights alone; "
        "two-way: 0 that robots need both ways, 1 that do better so"
    )
    assert one_way_words(kept._replace(is_kept=False)).startswith("weights alone stay, because")
    none = OneWay(design, (), (), (), None, False)
    assert one_way_words(none).startswith("no street is one-way: no move costs 4 times")
    needed = one_way_words(none._replace(two_way=(1,)))  # type: ignore[arg-type]
    assert needed.startswith("no street is one-way; two-way: 1 that robots need both ways")
    less = FewerStreets(design, (street,), worth.worth, True)
    change = " (-0.2 % (-0.4 to -0.0))"
    assert fewer_words(less) == (
        "streets left out, none of which has a significant effect alone: 1; "
        "without all of them -0.2 % (-0.4 to -0.0), where a loss of 0.5 % is allowed"
    )
    assert fewer_words(less._replace(is_kept=False)).endswith(
        f"because together they have one{change}"
    )
    assert fewer_words(less._replace(removed=())) == "no street is left out"
