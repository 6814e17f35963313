"""One robot in one state has one name: in pictures, explanations, tables, drawings, films and panels."""

from __future__ import annotations

import pytest
from panel_harness import PanelHarness, moment, of_robot, run_in_harness, said, shown
from textual.pilot import Pilot

from automaton.drawings.floor_svg import floor_svg
from automaton.drawings.moment import drawn_floor, moment_of
from automaton.engine.observation import is_waiting
from automaton.engine.robot_states import Task, tasks_of
from automaton.engine.state import ACTION_NAMES, NIL
from automaton.films.recorded_stretch import FilmColumns
from automaton.history.explanation import explain
from automaton.history.snapshot import Snapshot, take_snapshot
from automaton.runs.pictures.picture_lines import name_of, robot_line
from automaton.runs.simulation import Simulation
from automaton.tables.rows import state_form, state_rows_of
from automaton.vocabulary import (
    ACTION_PHRASES,
    STATE_OF_ACTION,
    STATE_WORDS,
    RobotState,
    phrase_of,
    robot_state,
)
from automaton.world.resolve import resolve
from tui.render.scene import Scene, floor_of
from tui.widgets.inspector import Inspector
from tui.widgets.robot_table import Robots
from tui.widgets.status import describe

MOMENTS = (
    ("tabletop-1", 300, ("fleet.robots=5", "strategy.right_of_way=wait")),
    ("tabletop-mini", 30, ("faults.list=[{robot: 0, at: 9}]",)),
    ("goods-mini", 18, ()),
    ("depots-full", 240, ("strategy.charging=threshold",)),
)


def moment_in(name: str, tick: int, settings: tuple[str, ...]) -> Simulation:
    """An observed run at a tick."""
    simulation = Simulation(
        resolve(name, list(settings)), 1, on_observe=Simulation.empty_observation
    )
    simulation.run(until=tick)
    return simulation


@pytest.mark.parametrize("case", MOMENTS, ids=lambda case: case[0])
def test_text_drawings_and_tables_agree(case: tuple[str, int, tuple[str, ...]]) -> None:
    simulation = moment_in(*case)
    world, floor_plan = simulation.world, simulation.resolved.floor_plan
    snapshot, floor = take_snapshot(simulation), drawn_floor(simulation.resolved)
    scene = Scene(floor_of(simulation.resolved), snapshot)
    still = moment_of(floor, world, simulation.observation)
    drawing, film = (
        floor_svg(floor, still),
        FilmColumns(floor, len(snapshot.robots), case[1], case[1]),
    )
    film.take(simulation)
    codes = state_rows_of(simulation, None)["action"]
    assert state_form(simulation.resolved).texts["action"] == ACTION_NAMES
    tasks = tasks_of(snapshot.robots)
    for robot in range(len(snapshot.robots)):
        state = robot_state(snapshot.robots, robot)
        word, phrase = STATE_WORDS[state], phrase_of(state)
        told = explain(snapshot, floor_plan, robot).lines[0]
        assert (
            f"robot {robot} is {phrase}" in told or f"robot {robot} has been {phrase} for" in told
        )
        assert film.moment_at(case[1]).doing[robot] == state == still.doing[robot]
        cell = int(snapshot.robots.cell[robot])
        if cell != NIL:
            assert f"<title>robot {robot}: {word}</title>" in drawing
            assert f" {word}" in describe(scene, cell).partition(f"robot {robot}")[2]
        line = robot_line(world, floor_plan, int(world.robots.at_index[robot]))
        assert line.startswith(f"{name_of(robot)} ") and picture_agrees(
            line, snapshot, robot, state
        )
        if not is_waiting(snapshot.robots.cause[robot]) and state != RobotState.PARKED:
            assert state in (STATE_OF_ACTION[codes[robot]], RobotState.CHARGING)
        if tasks[robot] in (Task.PARKED, Task.PICKING, Task.DROPPING, Task.AT_STOP, Task.CHARGING):
            assert (
                word == Task(int(tasks[robot])).name.lower().replace("_", " ")
                or state == RobotState.WAITING
            )


def picture_agrees(line: str, snapshot: Snapshot, robot: int, state: RobotState) -> bool:
    """Whether the line of a picture names the action, which is the state's if the robot gets on."""
    fleet = snapshot.robots
    phrases = ACTION_PHRASES[fleet.action[robot]]
    if fleet.busy[robot] and STATE_OF_ACTION[fleet.action[robot]] == state:
        return f"{phrase_of(state)} for " in line
    return bool(fleet.action[robot] == 0 or phrases.present in line or phrases.past in line)


@pytest.mark.parametrize("case", MOMENTS, ids=lambda case: case[0])
def test_panels_agree(case: tuple[str, int, tuple[str, ...]]) -> None:
    view = moment(case[1], case[0], *case[2])
    fleet = view.snapshot.robots
    states = [robot_state(fleet, robot) for robot in range(len(fleet))]
    for robot, state in enumerate(states):
        heading = shown(Inspector(), of_robot(view, robot), 90).partition("cell ")[0]
        assert STATE_WORDS[state] in heading or phrase_of(state) in heading
    robots = Robots()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        robots.show(view)
        await pilot.pause()
        rows = [row for row in said(robots)[1:] if row]
        for robot, state in enumerate(states):
            assert f" {STATE_WORDS[state]} " in f"{rows[robot]} "

    run_in_harness(robots, story, 100, 40)
