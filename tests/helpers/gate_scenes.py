"""Small floors with closed cells, doors, blocks and lifts, and where their robots are, tick by tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from automaton.engine.observation import CAUSES
from automaton.engine.state import NIL
from automaton.history.event_history import EventHistory
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.world.resolve import Resolved, resolve

AISLE = "........"


def gate_scenario(
    floor: dict[str, Any], *stops: tuple[int, int], picture: str = AISLE, **parts: Any
) -> dict[str, Any]:
    """The keys of a scenario: one robot at (0, 0), or those of `start`, and a tour to each stop."""
    start = parts.pop("start", [[0, 0]])
    strategy = {
        "allocation": "first-come",
        "routing": parts.pop("routing", "shortest"),
        "right_of_way": parts.pop("right_of_way", "wait"),
    }
    kinematics = parts.pop("kinematics", "omni")
    given = {
        "name": "gates",
        "layout": {"picture": picture},
        "fleet": {"robots": len(start), "kinematics": kinematics, "start": start},
        "floor": floor,
        "orders": {"list": [{"stops": [list(stop)]} for stop in stops]},
        "strategy": strategy,
        "stop": {"when": "delivered", "max_duration": 200},
    }
    return given | parts


def gate_scene(floor: dict[str, Any], *stops: tuple[int, int], **parts: Any) -> Resolved:
    """The same, checked."""
    return resolve(msgspec.convert(gate_scenario(floor, *stops, **parts), Scenario))


def watched(scene: Resolved, until: int | None = None) -> Simulation:
    """The run up to a tick, observed."""
    run = Simulation(scene, on_observe=EventHistory())
    run.run(until)
    return run


def track(scene: Resolved, ticks: int, robot: int = 0) -> list[tuple[int, int]]:
    """Where a robot is after each tick, in (x, y)."""
    run = Simulation(scene)
    cells = []
    for tick in range(1, ticks + 1):
        run.run(tick)
        cell = int(run.world.robots.cell[run.world.robots.at_index[robot]])
        cells.append((-1, -1) if cell == NIL else scene.floor_plan.xy(cell))
    return cells


def first_tick(scene: Resolved, cell: tuple[int, int], robot: int = 0, within: int = 100) -> int:
    """The tick after which a robot first is in a cell, 0: in none of these."""
    cells = track(scene, within, robot)
    return cells.index(cell) + 1 if cell in cells else 0


def lost(run: Simulation, robot: int = 0) -> dict[str, int]:
    """The ticks that a robot has lost, by cause."""
    i = run.world.robots.at_index[robot]
    ticks = run.observation.lost[i].tolist()
    return {cause.name: n for cause, n in zip(CAUSES, ticks, strict=True) if n}


def delivered(scene: Resolved) -> Sequence[int]:
    """The ticks in which the tours are done."""
    run = Simulation(scene)
    run.run()
    ticks: list[int] = run.world.orders.delivered.tolist()
    return ticks
