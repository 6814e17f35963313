"""What `check` accepts, `run` begins: with starts, homes, blocks, lifts, closings and batteries."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st
from random_floors import pictures

from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.world.resolve import resolve

WIDTH, HEIGHT = 8, 5
TICKS = 20
SYMBOLS = "......................==~~##bt>^"
LAST_ROW = "t..c...t"
CELL = st.tuples(st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1))


def path(cells: tuple[tuple[int, int], int, bool]) -> list[list[int]]:
    """The ends of a part of a row or a column."""
    (x, y), length, along_x = cells
    last = [min(x + length, WIDTH - 1), y] if along_x else [x, min(y + length, HEIGHT - 1)]
    return [[x, y], last]


PATH = st.tuples(CELL, st.integers(1, 4), st.booleans()).map(path)
GATES = st.fixed_dictionaries(
    {},
    optional={
        "blocks": st.lists(
            st.fixed_dictionaries({"cells": PATH, "max_robots": st.integers(1, 3)}), max_size=2
        ),
        "lifts": st.lists(
            st.fixed_dictionaries({"shaft": PATH, "travel_time": st.integers(1, 12)}), max_size=2
        ),
        "closed": st.lists(
            st.fixed_dictionaries({"cells": PATH, "from": st.integers(0, 9), "for": st.just(3)}),
            max_size=1,
        ),
    },
)
BATTERY = {"drain": {"move": 0.1, "wait": 0.01}, "charge_rate": 1.0}
STRATEGIES = st.fixed_dictionaries(
    {
        "allocation": st.sampled_from(["first-come", "shortest-job"]),
        "right_of_way": st.sampled_from(["wait", "pibt", "retreat"]),
    }
)


@st.composite
def scenarios(draw: st.DrawFn) -> dict[str, Any]:
    start = draw(
        st.one_of(
            st.sampled_from(["random", "random", "parking-bays"]),
            st.lists(CELL.map(list), min_size=1, max_size=5, unique_by=tuple),
        )
    )
    robots = len(start) if isinstance(start, list) else draw(st.integers(1, 5))
    fleet = {
        "robots": robots,
        "kinematics": draw(st.sampled_from(["omni", "differential"])),
        "start": start,
        "when_idle": draw(st.sampled_from(["park", "leave"])),
    }
    orders = {"generator": "visits", "count": draw(st.integers(1, 4))}
    given = {
        "name": "accepted",
        "layout": {"picture": draw(pictures(SYMBOLS, WIDTH, HEIGHT - 1)) + f"\n{LAST_ROW}"},
        "fleet": fleet,
        "orders": orders,
        "floor": draw(GATES),
        "strategy": draw(STRATEGIES),
        "stop": {"when": "delivered", "max_duration": 200},
        "seed": draw(st.integers(0, 3)),
    }
    if draw(st.booleans()):
        given["battery"] = BATTERY
        given["strategy"] = given["strategy"] | {"charging": "threshold"}
    return given


@settings(max_examples=200)
@given(scenarios(), st.integers(0, 1000))
def test_what_is_accepted_begins_with_any_seed(given: dict[str, Any], seed: int) -> None:
    try:
        resolved = resolve(msgspec.convert(given, Scenario))
    except (InputError, msgspec.ValidationError):
        return
    for one in (None, seed):
        run = Simulation(resolved, one)
        run.run(until=TICKS)
        assert run.tick == TICKS or run.finished
        note(f"tick {run.tick}")
    ACCEPTED.append(seed)


ACCEPTED: list[int] = []


def test_many_of_them_are_accepted() -> None:
    """Otherwise the test before says little."""
    if not ACCEPTED:
        pytest.skip("the test before has not run")
    assert len(ACCEPTED) > 40, len(ACCEPTED)


def test_waits_that_a_refined_tick_makes_too_long_are_refused() -> None:
    waits = "strategy.right_of_way={name: retreat, wait_empty: [1, 9000]}"
    with pytest.raises(InputError, match=r"its waits take up to 90,000 ticks; at most 65,535"):
        resolve("crossing", [waits, "refine=10"])
