"""Speed limits: moves between cells of a slow spot take their time, and all plans count with it."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from handmade_recordings import E, W, header, played, rules
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from random_floors import pictures
from reference_costs import CostSet
from reference_paths import FAR

from automaton.engine.record_codes import CHANGE_DURATION
from automaton.errors import InputError
from automaton.floor.reachability import NO_WAY, Driving, ticks_between
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.validator import validate_stored
from automaton.world.bounds import bounds
from automaton.world.resolve import Resolved, resolve

SPUR = """\
......
##.###
##.###"""


def scene(picture: str, *limits: dict[str, Any], **parts: Any) -> dict[str, Any]:
    scenario = {
        "name": "limits",
        "layout": {"picture": picture},
        "fleet": {"robots": 1, "kinematics": "omni", "start": [[0, 0]]},
        "floor": {"speed_limits": list(limits)},
        "orders": {"list": [{"stops": [[2, 2]]}]},
        "strategy": {"allocation": "first-come", "routing": "shortest", "right_of_way": "wait"},
        "stop": {"when": "delivered", "max_duration": 500},
    }
    return scenario | parts


def resolved(scenario: dict[str, Any]) -> Resolved:
    return resolve(msgspec.convert(scenario, Scenario))


def run(scenario: dict[str, Any]) -> Simulation:
    """A finished run that the validator has nothing to say against."""
    made = resolved(scenario)
    recorder = MemoryRecorder(made)
    simulation = Simulation(made, on_record=recorder)
    simulation.run()
    assert validate_stored(recorder.recording()).violations == []
    return simulation


def limit(first: Any, last: Any, ticks: int) -> dict[str, Any]:
    return {"cells": {"from": first, "to": last}, "max_speed": ticks}


def test_a_spur_is_slow_both_ways_and_its_junction_is_not() -> None:
    """Two moves along the row take a tick each, two into the spur three, and so back."""
    tours = {"list": [{"stops": [[2, 2], [5, 0]]}]}
    made = run(scene(SPUR, limit([2, 0], [2, 2], 3), orders=tours))
    assert made.tick == 2 + 2 * 3 + 2 * 3 + 3
    assert metrics_of(made)["slowdown_ticks"] == 4 * 2


def test_a_faster_limit_changes_nothing_and_of_several_the_slowest_counts() -> None:
    plain, slow = [[0, 0], [5, 0]], [[0, 0], [3, 0]]
    limits = ({"cells": plain, "max_speed": 1}, {"cells": slow, "max_speed": 2})
    made = run(scene(SPUR, *limits, limit([1, 0], [2, 0], 4)))
    assert made.tick == 2 + 4 + 1 + 1


def test_slow_zones_multiply_what_a_limit_makes_of_a_move() -> None:
    """Two robots are in the only zone when the first sets out; the last has nothing to do."""
    fleet = {"robots": 2, "kinematics": "omni", "start": [[0, 0], [3, 0]]}
    orders = {"list": [{"stops": [[1, 0]]}]}
    given = {"fleet": fleet, "orders": orders, "world": {"slowdown": "zones"}}
    assert run(scene("....", limit([0, 0], [1, 0], 3), **given)).tick == 2 * 3


def test_bounds_count_with_limits() -> None:
    """A load is carried over the two cells between shelf and destination, or none at all."""
    orders = {"list": [{"from": [0, 1], "to": [2, 1]}]}
    picture = "...\ns#d"
    free = bounds(resolved(scene(picture, orders=orders)))
    slow = bounds(resolved(scene(picture, limit([0, 0], [2, 0], 5), orders=orders)))
    assert (free.work, slow.work) == (2 + 2, 2 + 10)


def test_a_move_that_is_too_quick_breaks_a_rule() -> None:
    limits = {"floor": {"speed_limits": [limit([1, 0], [2, 0], 3)]}}
    orders = {"list": [{"stops": [[3, 0]]}]}
    head = header("....", [(0, 0)], orders=orders, **limits)
    told = [(2, CHANGE_DURATION, 0, 3)]
    assert played(
        head, {0: E}, {0: E}, {}, {}, {0: W}, changes=[*told, (5, CHANGE_DURATION, 0, 3)]
    ).valid
    assert rules(played(head, {0: E}, {0: E}, {0: E})) == ["move time"]
    report = played(head, {0: E}, changes=[(1, CHANGE_DURATION, 0, 3)])
    assert rules(report) == ["move time"]


@pytest.mark.parametrize(
    ("cells", "sentence"),
    [
        (
            {"from": [0, 0], "to": [9, 0]},
            "speed limit 1 has the cell [9, 0], outside the floor of 6 x 3 cells",
        ),
        (
            [[0, 0], [2, 1]],
            "speed limit 1 goes from [0, 0] to [2, 1]: along neither a row nor a column",
        ),
        ([[0, 1], [1, 1]], "speed limit 1 has no cell on which robots drive"),
    ],
)
def test_cells_that_cannot_be_limited(cells: Any, sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        resolved(scene(SPUR, {"cells": cells, "max_speed": 2}))
    assert caught.value.message == sentence


# All routers, against Dijkstra in plain Python.

SYMBOLS = ".......##><v^"
ROUTERS = ("shortest", "astar", "congestion", "pibt")


@st.composite
def drives(draw: Any) -> tuple[dict[str, Any], str]:
    """A robot that drives somewhere on a random floor with limits, and how it plans its way."""
    width, height = draw(st.integers(2, 6)), draw(st.integers(1, 5))
    picture = draw(pictures(SYMBOLS, width, height))
    x, y = st.integers(0, width - 1), st.integers(0, height - 1)
    corners = draw(st.lists(st.tuples(x, y, x, y, st.integers(1, 6)), max_size=3))
    cells = [
        (column, row)
        for row, line in enumerate(picture.split("\n"))
        for column, symbol in enumerate(line)
        if symbol != "#"
    ]
    assume(len(cells) > 1)
    start, goal = draw(st.permutations(cells))[:2]
    kinematics = draw(st.sampled_from(["omni", "differential"]))
    planned = draw(st.sampled_from(ROUTERS))
    strategy = {"allocation": "first-come"}
    if planned == "pibt":
        strategy |= {"right_of_way": "pibt"}
    else:
        strategy |= {"routing": planned, "right_of_way": "wait"}
    scenario = scene(
        picture,
        *(limit((a, b), (c, d), ticks) for a, b, c, d, ticks in corners),
        fleet={"robots": 1, "kinematics": kinematics, "start": [start]},
        durations={"move": draw(st.integers(1, 3)), "turn": draw(st.integers(1, 3))},
        orders={"list": [{"stops": [goal]}]},
        strategy=strategy,
    )
    return scenario, kinematics


def costs(made: Resolved, kinematics: str) -> CostSet:
    """Ticks of every move, by the limits as the scenario has them."""
    plan, durations = made.floor_plan, made.scenario.durations
    steps = {(cell, d): durations.moves.empty for cell in range(plan.kind.size) for d in range(4)}
    for one in made.scenario.floor.speed_limits:
        (x, y), (u, v) = one.cells.first, one.cells.last  # type: ignore[union-attr]
        for row in range(min(y, v), max(y, v) + 1):
            for column in range(min(x, u), max(x, u) + 1):
                for d, (dx, dy) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1))):
                    inside = min(x, u) <= column + dx <= max(x, u)
                    if inside and min(y, v) <= row + dy <= max(y, v):
                        key = plan.cell(column, row), d
                        steps[key] = max(steps[key], one.max_speed)
    return CostSet(plan, kinematics, steps, durations.turns.empty)


def test_every_plan_takes_the_least_ticks() -> None:
    limited = 0

    @settings(max_examples=100)
    @given(drives())
    def check(case: tuple[dict[str, Any], str]) -> None:
        nonlocal limited
        scenario, kinematics = case
        try:
            made = resolved(scenario)
        except InputError:
            assume(False)
        simulation = Simulation(made)
        robots, wanted = simulation.world.robots, costs(made, kinematics)
        goal = made.floor_plan.cell(*made.scenario.orders.listed[0].stop_cells[0])  # type: ignore[index]
        pose = int(robots.cell[0]), int(robots.heading[0])
        least = wanted.cost(pose, goal)
        durations = made.scenario.durations
        driving = Driving(
            int(simulation.world.grid.headings), durations.moves[0], durations.turns[0]
        )
        found = ticks_between(made.floor_plan, driving, goal, backwards=True)[pose]
        assert found == (NO_WAY if least == FAR else least)
        away = ticks_between(
            made.floor_plan, driving, pose[0], backwards=False, heading_there=pose[1]
        )
        assert away[goal].min() == found
        if least == FAR:
            return
        made = run(scenario).resolved
        assert run(scenario).tick == least
        limited += bool(np.any(made.floor_plan.min_move_ticks > durations.moves[0]))

    check()
    assert limited > 20
