"""The tables of robot states in the documentation, and what runs do."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest
from docs_pages import page

from automaton.build.resolve import resolve
from automaton.engine.robot_states import Motion, Task, motions_of, tasks_of
from automaton.engine.robot_status import STATUS_NAMES
from automaton.engine.state import CLOCK_TICK, World
from automaton.runs.simulation import Simulation

PAGE = page("docs/explanation/robot-states.md").text
NAMES = {
    "Task": [task.name.lower().replace("_", " ") for task in Task],
    "Motion": [motion.name.lower().replace("_", " ") for motion in Motion],
    "Condition": list(STATUS_NAMES),
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
# Runs in which every change of state occurs: scenario, settings, seed, ticks.
RUNS = (
    ("tabletop-mini", (), 1, 400),
    ("tabletop-mini", ("strategy.allocation=independent", "fleet.robots=5"), 3, 60),
    ("tabletop-mini", LOST, 4, 120),
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


def table() -> set[Change]:
    """Every change of state that the page names."""
    changes: set[Change] = set()
    for kind in NAMES:
        for row in re.findall(r"^\| (.+) \|$", section(kind), re.MULTILINE)[1:]:
            states, _, following, _ = row.split(" | ")
            pairs = set(product([kind], states.split(", "), following.split(", ")))
            assert not pairs & changes, f"twice in the table: {pairs & changes}"
            changes |= pairs
    return changes


def states(world: World) -> dict[str, list[int]]:
    """Each robot's states after a tick, by kind and identity."""
    robots, tick = world.robots, world.clock[CLOCK_TICK]
    halt = world.service_zones.halt
    halted = halt >= tick if len(halt) else np.zeros(len(robots.cell), bool)
    arrays = {
        "Task": tasks_of(robots),
        "Motion": motions_of(robots, halted, bool(world.rules.steered[0])),
        "Condition": robots.status,
    }
    return {kind: array[robots.at_index].tolist() for kind, array in arrays.items()}


def changes_of(name: str, settings: tuple[str, ...], seed: int, ticks: int) -> Iterator[Change]:
    """Yield the changes of state in a run."""
    simulation = Simulation(resolve(name, settings), seed=seed)
    before = states(simulation.world)
    while simulation.tick < ticks and not simulation.finished:
        simulation.run(until=simulation.tick + 1)
        after = states(simulation.world)
        for kind, names in NAMES.items():
            for old, new in zip(before[kind], after[kind], strict=True):
                if old != new:
                    yield kind, names[old], names[new]
        before = after


@pytest.fixture(scope="module")
def observed() -> dict[Change, Any]:
    """The changes of state in all runs, each with the first run that shows it."""
    found: dict[Change, Any] = {}
    for run in RUNS:
        for change in changes_of(*run):
            found.setdefault(change, run)
    return found


def test_every_change_of_state_is_in_the_table(observed: dict[Change, Any]) -> None:
    assert {change: run for change, run in observed.items() if change not in table()} == {}


def test_every_row_of_the_table_occurs(observed: dict[Change, Any]) -> None:
    assert table() - set(observed) == set()


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
