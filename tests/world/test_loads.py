"""Robots with a load: their moves and turns take other ticks, and other areas are closed to them."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from handmade_recordings import rules

from automaton.errors import InputError
from automaton.recording.contents import FRAME_KIND_CONDITIONS
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.validator import validate_recording
from automaton.world.bounds import bounds, least_ticks
from automaton.world.resolve import Resolved, resolve

LANE = """\
s.....d
......."""
SLOW_LOADED = {"move": {"empty": 2, "loaded": 5}, "pick": 3, "drop": 2}


def scene(picture: str = LANE, **parts: Any) -> Resolved:
    """A robot at (1, 1) that brings the load of the shelf to the right, and drives home."""
    fleet = {"robots": 1, "kinematics": "omni", "start": [(1, 1)], **parts.pop("fleet", {})}
    scenario = {
        "name": "loads",
        "layout": {"picture": picture},
        "fleet": fleet,
        "orders": {"list": [{"from": (0, 0), "to": (6, 0)}]},
        "strategy": {"right_of_way": "wait", "allocation": "first-come"},
        "measure": {},
        **parts,
    }
    return resolve(msgspec.convert(scenario, Scenario))


def ran(resolved: Resolved) -> tuple[Simulation, MemoryRecorder]:
    """Run it, recorded and validated; nothing may be illegal."""
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    simulation.run()
    recording = recorder.recording()
    report = validate_recording(recording.header, recording.frames)
    assert report.valid, report.violations[:3]
    assert not simulation.world.tally.illegal.any()
    return simulation, recorder


def visited(resolved: Resolved, loaded: bool) -> set[tuple[int, int]]:
    """The cells where the robot was with its load, or without one."""
    simulation, cells = Simulation(resolved), set()
    robots = simulation.world.robots
    while not simulation.finished:
        simulation.run(simulation.tick + 1)
        if (robots.load[0] >= 0) == loaded:
            cells.add(resolved.floor_plan.xy(int(robots.cell[0])))
    return cells


def test_a_move_takes_longer_with_a_load() -> None:
    """1 move of 2 ticks, 3 to pick up, 4 moves of 5, 2 to set down, 5 moves of 2 home."""
    simulation, _ = ran(scene(durations=SLOW_LOADED))
    assert simulation.tick == 2 + 3 + 4 * 5 + 2 + 5 * 2
    assert metrics_of(simulation)["task_time"] == 2 + 3 + 4 * 5 + 1
    assert not simulation.world.tally.slowdown_ticks.any()


def test_a_turn_takes_longer_with_a_load() -> None:
    """North to the shelf, a turn of 4 ticks with the load, and one of 1 in either corner home."""
    durations = {**SLOW_LOADED, "turn": {"empty": 1, "loaded": 4}}
    fleet = {"kinematics": "differential", "heading": "north"}
    simulation, _ = ran(scene(durations=durations, fleet=fleet))
    assert simulation.tick == 2 + 3 + 4 + 4 * 5 + 2 + 5 * 2 + 2 * 1


def test_the_least_time_of_a_task_counts_the_way_with_the_load() -> None:
    for fleet in ({}, {"kinematics": "differential", "heading": "north"}):
        simulation, _ = ran(scene(durations=SLOW_LOADED, fleet=fleet))
        assert metrics_of(simulation)["delay"] == 0


def test_a_type_has_durations_of_its_own_and_those_of_all() -> None:
    own = {"move": {"empty": 1, "loaded": 3}, "drop": 7}
    tug = {"name": "tug", "move_time_factor": 2, "durations": own}
    simulation, _ = ran(scene(durations={"pick": 5}, fleet={"types": [tug]}))
    assert simulation.tick == 1 * 2 + 5 + 4 * 3 * 2 + 7 + 5 * 1 * 2


def test_a_load_begins_to_matter_in_a_branch_and_no_longer_does_in_another() -> None:
    """After 6 ticks the robot is in its first move with the load, which ends as it began."""
    alike, slow = scene(durations={**SLOW_LOADED, "move": 2}), scene(durations=SLOW_LOADED)
    for before, then, first, others in ((alike, slow, 2, 5), (slow, alike, 5, 2)):
        simulation = Simulation(before)
        simulation.run(6)
        branch = simulation.continue_with(then)
        branch.run()
        assert branch.tick == 2 + 3 + first + 3 * others + 2 + 5 * 2


def test_bounds_carry_loads_as_robots_with_a_load_drive() -> None:
    resolved = scene(durations=SLOW_LOADED)
    assert bounds(resolved).work == 3 + 4 * 5 + 2
    simulation, _ = ran(resolved)
    assert least_ticks(bounds(resolved), 1)[0] <= simulation.tick


def test_bounds_take_each_operation_from_the_type_that_is_fastest_in_it() -> None:
    types = [
        {"name": "tug", "robots": 1, "durations": {"move": {"empty": 1, "loaded": 4}, "pick": 1}},
        {"name": "cart", "durations": {"move": 6, "drop": 2}},
    ]
    fleet = {"robots": 2, "start": [(1, 1), (2, 1)], "types": types}
    resolved = scene(durations={"pick": 9, "drop": 9}, fleet=fleet)
    assert bounds(resolved).work == 1 + 4 * 4 + 2


def test_an_area_is_closed_to_robots_with_a_load_alone() -> None:
    above = scene(areas={"shut": {"from": [3, 0], "to": [3, 0], "closed_to": ["loaded"]}})
    assert (3, 0) not in visited(above, loaded=True)
    below = scene(areas={"shut": {"from": [1, 1], "to": [1, 1], "closed_to": ["loaded"]}})
    assert (1, 1) in visited(below, loaded=False)


def test_a_load_that_areas_cut_off_is_refused() -> None:
    shut = {"shut": {"from": [3, 0], "to": [3, 1], "closed_to": ["loaded"]}}
    with pytest.raises(InputError, match=r"cannot be served: areas cut off robots with its load"):
        scene(areas=shut)


def test_an_area_is_closed_to_robots_without_a_load_alone() -> None:
    resolved = scene(areas={"shut": {"from": [3, 0], "to": [3, 0], "closed_to": ["empty"]}})
    assert (3, 0) in visited(resolved, loaded=True)
    assert (3, 0) not in visited(resolved, loaded=False)


def test_an_area_is_closed_to_all() -> None:
    resolved = scene(areas={"shut": {"from": [3, 0], "to": [3, 0], "closed_to": ["all"]}})
    assert (3, 0) not in visited(resolved, loaded=True) | visited(resolved, loaded=False)


def test_a_lane_back_that_is_closed_to_loads_cuts_nothing_off() -> None:
    """Loads go right on the upper lane; nobody brings one back on the lower one."""
    ring = "s>>>>vd\n#^<<<<#"
    resolved = scene(ring, areas={"back": {"from": [2, 1], "to": [4, 1], "closed_to": ["loaded"]}})
    simulation, _ = ran(resolved)
    assert metrics_of(simulation)["delivered"] == 1


def test_an_order_between_parts_of_the_floor_that_areas_keep_apart_is_refused() -> None:
    """No load passes between the upper and the lower lane, each with a shelf and a goal."""
    picture = "s....d\ns.....\n......\ns....d"
    areas = {"middle": {"from": [0, 2], "to": [5, 2], "closed_to": ["loaded"]}}
    along = [{"from": (0, 0), "to": (5, 0)}, {"from": (0, 3), "to": (5, 3)}]
    simulation, _ = ran(scene(picture, areas=areas, orders={"list": along}))
    assert metrics_of(simulation)["delivered"] == 2
    across = {"from": (0, 1), "to": (5, 3)}
    with pytest.raises(InputError, match=r"with a load cannot drive from \[1, 1\] to \[4, 3\]"):
        scene(picture, areas=areas, orders={"list": [*along, across]})


def test_the_validator_counts_the_moves_of_a_robot_with_a_load_itself() -> None:
    _, recorder = ran(scene(durations=SLOW_LOADED))
    recording = recorder.recording()
    scenario = recording.header["scenario"]
    slower = {**scenario["durations"], "move": {"empty": 2, "loaded": 6}}
    header = {**recording.header, "scenario": {**scenario, "durations": slower}}
    frames = [frame for frame in recording.frames if frame.kind != FRAME_KIND_CONDITIONS]
    assert "busy" in rules(validate_recording(header, frames))


def test_the_validator_knows_what_is_closed_to_a_robot_with_a_load() -> None:
    _, recorder = ran(scene())
    recording = recorder.recording()
    for group, times in (("loaded", 1), ("empty", 0), ("all", 1)):
        areas = {"shut": {"from": [3, 0], "to": [3, 0], "closed_to": [group]}}
        scenario = {**recording.header["scenario"], "areas": areas}
        report = validate_recording({**recording.header, "scenario": scenario}, recording.frames)
        assert rules(report).count("area") >= times
        assert times or not rules(report)
