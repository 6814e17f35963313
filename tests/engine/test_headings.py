"""Robots of one fleet that drive differently: each type distinguishes its own headings."""

from __future__ import annotations

from typing import Any, get_args

import msgspec
import numpy as np
import pytest
from small_runs import SmallRun

from automaton.engine.state import ACTION_TURN
from automaton.errors import InputError
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.pictures.picture_lines import robot_line
from automaton.runs.simulation import Simulation
from automaton.scenario.durations import Durations
from automaton.scenario.fleet import FleetType, Kinematics
from automaton.scenario.schema import Scenario
from automaton.tables.columns import NO_TEXT
from automaton.tables.rows import heading_texts, state_form
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve
from tui.render.drawn_robots import robots_of
from tui.render.scene import Scene, floor_of

MIXED = tuple(
    FleetType(name=kinematics, robots=1, kinematics=kinematics)
    for kinematics in ("differential", "omni", "rail")
)
# Three corners, each the way of one robot.
CORNERS = """
A..#B..#C-+
##.###.###|
"""
HALL = """\
+---+
|t.t|
+---+"""


def places(run: SmallRun, ticks: int) -> list[list[tuple[int, int]]]:
    """After each tick where robots A, B and C are."""
    robots = [run.index(name) for name in "ABC"]
    cells = [run.tick().world.robots.cell[robots].tolist() for _ in range(ticks)]
    return [[run.floor_plan.xy(cell) for cell in row] for row in cells]


def test_at_a_corner_only_a_robot_that_turns_takes_the_time_of_a_turn() -> None:
    """Two moves, a turn of three ticks, a move: the omni robot leaves the turn out."""
    run = SmallRun(
        CORNERS, {name: "EES" for name in "ABC"}, types=MIXED, durations=Durations(turn=3)
    )
    assert places(run, 6) == [
        [(1, 0), (5, 0), (9, 0)],
        [(2, 0), (6, 0), (10, 0)],
        *([[(2, 0), (6, 1), (10, 0)]] * 3),
        [(2, 1), (6, 1), (10, 1)],
    ]
    assert run.world.robots.heading[[run.index(name) for name in "ABC"]].tolist() == [1, 0, 1]
    assert run.world.tally.operations[:, ACTION_TURN].sum(axis=1).tolist() == [1, 0, 1]


def test_back_from_where_it_came_a_robot_on_rails_does_not_turn() -> None:
    """The differential robot turns twice, by two ticks each, in the middle of the lane."""
    run = SmallRun(
        "A..#B..#C--", {name: "EW" for name in "ABC"}, types=MIXED, durations=Durations(turn=2)
    )
    columns = [[x for x, _ in row] for row in places(run, 6)]
    assert columns == [[1, 5, 9], *([[1, 4, 8]] * 4), [0, 4, 8]]


def test_the_viewer_shows_where_each_robot_faces_or_comes_from() -> None:
    run = SmallRun(CORNERS, {name: "EES" for name in "ABC"}, types=MIXED)
    scene = Scene(floor_of(run.run.resolved), run.tick(3).snapshot())
    assert robots_of(scene).direction.tolist() == [
        1,
        1,
        1,
    ]  # A and C have turned, B has driven south


def test_tables_and_pictures_name_the_headings_of_each_type() -> None:
    simulation = Simulation(hall())
    names = ["E", "S", "W", "N", "EW", "NS"]  # the most headings first
    form, robots = state_form(simulation.resolved), np.arange(3)
    assert list(form.texts["heading"]) == names
    places = heading_texts(simulation, robots).tolist()
    assert [names[place] if place != NO_TEXT else "" for place in places] == ["NS", "S", ""]
    plan = simulation.resolved.floor_plan
    lines = [robot_line(simulation.world, plan, i, brief=True) for i in range(3)]
    starts = ["A (0, 0) north-south", "B (4, 0) facing south", "C (4, 2)"]
    assert [line[: len(start)] for line, start in zip(lines, starts, strict=True)] == starts
    assert "facing" not in lines[2]


# What the fleet of a scenario may be.


def hall(**parts: Any) -> Resolved:
    """A robot of each type in turn, orders without loads between the stations."""
    types = parts.pop("types", [{"name": one, "kinematics": one} for one in get_args(Kinematics)])
    fleet = {"robots": len(types), "types": [{**one, "robots": 1} for one in types]}
    scenario = {
        "name": "hall",
        "layout": {"picture": HALL},
        "fleet": fleet | {"start": [[0, 0], [4, 0], [4, 2], [0, 2]][: len(types)]},
        "orders": {"list": [{"stops": [[x, y]]} for x, y in ((1, 0), (3, 2), (2, 0), (1, 2))]},
        "durations": {"turn": 2},
        "stop": {"when": "delivered", "max_duration": 300},
        **parts,
    }
    return resolve(msgspec.convert(scenario, Scenario))


@pytest.mark.parametrize(
    ("picture", "missing"),
    [("+++++", "no tracks"), ("|....", "no turntables"), ("..t..", "no tracks and no turntables")],
)
def test_rail_robots_beside_others_need_tracks_and_turntables(picture: str, missing: str) -> None:
    types = [{"name": "cart", "kinematics": "rail"}, {"name": "shuttle", "kinematics": "omni"}]
    layout = {"picture": "\n".join([picture] * 3)}
    with pytest.raises(InputError, match=f"cart drives on rails .* the floor has {missing};"):
        hall(layout=layout, types=types)


def test_a_heading_is_that_of_the_robots_that_have_one() -> None:
    types = [{"name": "amr"}, {"name": "shuttle", "kinematics": "omni"}]
    resolved = hall(types=types)
    fleet = msgspec.structs.replace(resolved.scenario.fleet, heading="north")
    turned = resolve(msgspec.structs.replace(resolved.scenario, fleet=fleet))
    assert Simulation(turned).world.robots.heading.tolist() == [3, 0]


def test_epibt_plans_for_differential_robots_alone() -> None:
    with pytest.raises(InputError, match="differential, found rail and omni; use pibt"):
        hall(strategy={"right_of_way": "epibt"})


# Whole runs.


@pytest.mark.parametrize("right_of_way", ["wait", "retreat", "pibt"])
@pytest.mark.parametrize("routing", ["shortest", "astar", "congestion"])
def test_a_mixed_fleet_delivers_under_every_strategy(routing: str, right_of_way: str) -> None:
    if right_of_way == "pibt" and routing != "shortest":
        return  # it steers, so no route is asked for
    resolved = hall(strategy={"routing": routing, "right_of_way": right_of_way})
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    simulation.run()
    report = validate_stored(recorder.recording())
    assert report.valid, report.violations[:3]
    assert simulation.world.clock.tick < 300 and not simulation.world.tally.illegal.any()
