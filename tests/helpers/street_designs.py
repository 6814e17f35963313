"""Designs of streets on drawn floors, and runs whose metric is a known function of the design."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from automaton.floor.floor_plan import DIRECTIONS, FloorPlan
from automaton.studies.process_pool import run_all
from automaton.studies.street_search.designs import StreetDesign
from automaton.studies.street_search.one_way import with_closed
from automaton.studies.street_search.reasons import ComparedRuns
from automaton.world.resolve import Resolved, resolve


def scenario_on(picture: str, **changes: Any) -> dict[str, Any]:
    """A scenario on a drawn floor."""
    return {
        "name": "drawn",
        "layout": {"picture": picture},
        "fleet": {"robots": 2, "start": "random"},
        "orders": {"generator": "tours", "count": 20},
        "strategy": {"right_of_way": "pibt"},
        "stop": {"when": "never", "max_duration": 100},
    } | changes


def resolved_on(picture: str, **changes: Any) -> Resolved:
    """The same, ready to run."""
    return resolve(scenario_on(picture, **changes))


def design_of(floor_plan: FloorPlan, *streets: tuple[str, int, str, float]) -> StreetDesign:
    """All weights are 1 but along streets: ("row", 2, "west", 4) costs 4 times as much there."""
    cells = floor_plan.kind.size
    moves = np.full((cells, 4), 100, np.int32)
    for axis, line, way, weight in streets:
        direction = DIRECTIONS.index(way)
        along = [
            cell
            for cell in np.flatnonzero(floor_plan.exits.reshape(-1) >> direction & 1).tolist()
            if floor_plan.xy(cell)[1 if axis == "row" else 0] == line
        ]
        moves[along, direction] = round(100 * weight)
    return StreetDesign(moves, np.full(cells, 100, np.int32), np.zeros((cells, 4), np.bool_))


def planted(
    worth: Callable[[StreetDesign], float], metric: str = "throughput", noise: float = 0.0
) -> ComparedRuns:
    """Runs with a metric of 100 x (1 + worth) and noise, half of which the designs share."""

    def runs(
        designs: Sequence[StreetDesign], seeds: Sequence[int], robots: int | None = None
    ) -> list[list[dict[str, Any]]]:
        return [
            [
                {metric: 100 * (1 + worth(design)) + noise_of(seed, 0) + noise_of(seed, number)}
                for seed in seeds
            ]
            for number, design in enumerate(designs, 1)
        ]

    def noise_of(seed: int, number: int) -> float:
        return noise * float(np.random.default_rng([seed, number]).normal())

    return ComparedRuns(runs, metric, metric != "makespan")


def moves_in(design: StreetDesign, floor_plan: FloorPlan, at: tuple[int, int]) -> tuple[bool, ...]:
    """Whether a robot may move east, south, west and north from a cell."""
    cell = floor_plan.cell(*at)
    exits = int(floor_plan.exits.flat[cell])
    return tuple(bool(exits >> d & 1) and not design.closed[cell, d] for d in range(4))


def with_design(resolved: Resolved, design: StreetDesign) -> Resolved:
    """The scenario with a design."""
    floor_plan = with_closed(resolved.floor_plan, design.closed)
    return replace(resolved, floor_plan=floor_plan.with_weights(design.moves, design.waits))


def runs_of(resolved: Resolved) -> ComparedRuns:
    """Runs of a scenario, compared by throughput."""

    def runs(
        designs: Sequence[StreetDesign], seeds: Sequence[int], robots: int | None = None
    ) -> list[list[dict[str, Any]]]:
        scenarios = [with_design(resolved, design) for design in designs]
        return [[run.metrics for run in some] for some in run_all(scenarios, seeds, 1)]

    return ComparedRuns(runs, "throughput", True)
