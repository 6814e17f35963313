"""The tables of robot states in the documentation, and what runs do."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest
from docs_pages import page

from automaton.engine.robot_states import Motion, Task, motions_of, tasks_of
from automaton.engine.state import ACTION_NAMES, World
from automaton.runs.simulation import Simulation
from automaton.vocabulary import CONDITION_WORDS
from automaton.world.resolve import resolve

PAGE = page("docs/explanation/robot-states.md").text
NAMES = {
    "Task": [task.name.lower().replace("_", " ") for task in Task],
    "Motion": [motion.name.lower().replace("_", " ") for motion in Motion],
    "Condition": list(CONDITION_WORDS),
}
REPAIRED = (
    *("faults.failure_probability=0.003", "faults.tow_after=20"),
    "faults.repair_time=30",
)
LOST = (*REPAIRED[:2], "faults.repair_time=null")
REDESIGNS = tuple(
    f"strategy.zoning.{key}" for key in ("patience=1", "hysteresis=0.5", "tolerance=2", "pause=30")
)
TOURS = (
    "orders={generator: tours, count: 60, stops: {from: 1, to: 3}, mean_interarrival_time: 8}",
    "strategy.allocation={name: greedy, reassign: 3}",
)
STOPS = (
    "strategy.charging=none",
    "strategy.allocation=first-come",
    "battery=null",
    "orders={list: [{from: [0, 2], to: [2, 2], stops: [{at: [0, 2], for: 3}, {at: [4, 2], for: 20}]}, "
    "{from: [2, 2], to: [4, 2], stops: [{at: [6, 2], for: 2}, [0, 2]]}, "
    "{stops: [{at: [6, 2], for: 40}, [2, 2]]}, {stops: [[2, 2], {at: [4, 2], for: 9}]}]}",
)
RETRIES = "strategy.right_of_way={name: retreat, retries: 3, max_retries: 5}"
CLOSINGS = "floor.closed=[{cells: [[2, 0], [8, 0]], from: 3, for: 4, every: 8}]"
# What the event of a row has to name if robots did it in the tick in which their motion changed.
NAMED = {
    **{"blocked": "refused", "gate": "gate", "held_back": "stay", "retreat": "retreat"},
    "down": "goes down",
}
# Runs in which every change of state occurs: scenario, settings, seed, ticks.
RUNS = (
    ("tabletop-mini", (), 1, 400),
    ("tabletop-mini", ("strategy.allocation=independent", "fleet.robots=5"), 3, 60),
    ("tabletop-mini", (RETRIES, "fleet.robots=5"), 1, 400),
    ("tabletop-mini", (CLOSINGS, "strategy.allocation=independent", "fleet.robots=5"), 1, 470),
    ("tabletop-mini", LOST, 4, 120),
    ("tabletop-mini", ("fleet.robots=6", "faults.failure_probability=0.01"), 5, 400),
    ("tabletop-mini", REPAIRED, 1, 1270),
    ("tabletop-mini", ("faults.list=[{robot: 0, at: 1}]",), 1, 10),
    ("tabletop-mini", ("faults.list=[{robot: 0, at: 1}]", "faults.repair_time=null"), 1, 10),
    ("tabletop-1", ("fleet.robots=6",), 1, 460),
    ("tabletop-2", ("fleet.robots=5",), 1, 200),
    ("crossing", (), 1, 205),
    ("depots", ("strategy.charging=fill-up",), 1, 300),
    ("depots", (*STOPS, *REPAIRED), 4, 900),
    ("depots-full", ("strategy.charging=threshold",), 1, 300),
    ("depots-line", ("strategy.charging=opportunity", *REPAIRED), 1, 620),
    ("depots-line", ("strategy.charging=opportunity", *REPAIRED), 2, 180),
    ("depots-line", ("strategy.charging=opportunity", *REPAIRED), 4, 560),
    ("depots-line", ("strategy.charging=none", *REPAIRED), 1, 410),
    ("depots-line", ("strategy.charging=none", *LOST[1:], "battery.initial_charge=20"), 1, 200),
    ("depots-line", ("strategy.charging=insertion", *REPAIRED), 2, 340),
    ("warehouse-100-trial", REPAIRED, 6, 140),
    ("tabletop-mini", (*TOURS, *REPAIRED), 3, 140),
    ("tabletop-mini", (*TOURS, *REPAIRED), 2, 206),
    ("factory-single", (), 2, 220),
    ("factory-single", ("strategy.right_of_way=pibt",), 2, 400),
    ("tabletop-mini", ("strategy.right_of_way=pibt", "fleet.robots=5", *REPAIRED), 1, 400),
    ("factory-ddz", (*REDESIGNS, *REPAIRED), 1, 1190),
    ("factory-ddz", (*REDESIGNS, *REPAIRED), 2, 640),
)
Change = tuple[str, str, str]  # kind, state, next state


def section(kind: str) -> str:
    """The part of the page about one kind of state."""
    return PAGE.partition(f"\n## {kind}\n")[2].partition("\n## ")[0]


def table() -> dict[Change, str]:
    """Every change of state that the page names, and its event."""
    changes: dict[Change, str] = {}
    for kind in NAMES:
        for row in re.findall(r"^\| (.+) \|$", section(kind), re.MULTILINE)[1:]:
            states, event, following, _ = row.split(" | ")
            pairs = set(product([kind], states.split(", "), following.split(", ")))
            assert not pairs & set(changes), f"twice in the table: {pairs & set(changes)}"
            changes |= dict.fromkeys(pairs, event)
    return changes


def states(world: World) -> dict[str, list[int]]:
    """Each robot's states after a tick, by kind and identity."""
    robots, tick = world.robots, world.clock.tick
    halt = world.service_zones.halt
    halted = halt >= tick if len(halt) else np.zeros(len(robots.cell), bool)
    arrays = {
        "Task": tasks_of(robots),
        "Motion": motions_of(robots, halted, bool(world.rules.steered[0])),
        "Condition": robots.status,
    }
    return {kind: array[robots.at_index].tolist() for kind, array in arrays.items()}


def changes_of(
    name: str, settings: tuple[str, ...], seed: int, ticks: int
) -> Iterator[tuple[Change, str]]:
    """Yield the changes of state in a run, and what the robot did in that tick."""
    simulation = Simulation(resolve(name, settings), seed=seed)
    before = states(simulation.world)
    while simulation.tick < ticks and not simulation.finished:
        simulation.run(until=simulation.tick + 1)
        after = states(simulation.world)
        robots = simulation.world.robots
        did = [ACTION_NAMES[action] for action in robots.action[robots.at_index]]
        for kind, names in NAMES.items():
            for old, new, action in zip(before[kind], after[kind], did, strict=True):
                if old != new:
                    yield (kind, names[old], names[new]), action
        before = after


@pytest.fixture(scope="module")
def observed() -> dict[Change, dict[str, Any]]:
    """The changes of state in all runs; what robots did then, each with the first run that shows it."""
    found: dict[Change, dict[str, Any]] = {}
    for run in RUNS:
        for change, action in changes_of(*run):
            found.setdefault(change, {}).setdefault(action, run)
    return found


def test_every_change_of_state_is_in_the_table(observed: dict[Change, dict[str, Any]]) -> None:
    assert {change: runs for change, runs in observed.items() if change not in table()} == {}


def test_every_row_of_the_table_occurs(observed: dict[Change, dict[str, Any]]) -> None:
    assert set(table()) - set(observed) == set()


def test_events_of_motion_name_what_robots_do(observed: dict[Change, dict[str, Any]]) -> None:
    events, unnamed = table(), []
    for change, runs in observed.items():
        for action in runs if change[0] == "Motion" else ():
            if NAMED.get(action, "") not in events[change]:
                unnamed.append((change, events[change], action, runs[action]))
    assert unnamed == []
    assert {"blocked", "gate", "move"} <= set(observed["Motion", "waiting", "driving"])
    for state in ("driving", "waiting", "stuck", "retreating", "held back"):
        assert "down" in observed["Motion", state, "standing"]


def test_the_tables_name_all_states() -> None:
    for kind, names in NAMES.items():
        named = {state for one, *pair in table() if one == kind for state in pair}
        assert named == set(names)


def test_the_drawings_show_changes_of_the_table() -> None:
    for kind in ("Task", "Motion"):
        drawn = re.findall(r"^    (\w+) --> (\w+)", section(kind), re.MULTILINE)
        assert len(drawn) > 10
        for pair in drawn:
            old, new = (name.replace("_", " ") for name in pair)
            assert (kind, old, new) in table()
