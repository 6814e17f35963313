"""Guidance weights for large fleets: tasks per tick with `pibt`, beside the printed table.

Zhang, Jiang, Bhatt, Nikolaidis & Li: Guidance Graph Optimization for Lifelong Multi-Agent Path Finding,
IJCAI 2024, Table 3. The project ships no third-party problems: `--data FOLDER` reads the authors' floors
from FOLDER and its subfolders. Without it, setups 2, 4 and 10 run on generated floors, which are equal to
the authors', unweighted and with crisscross streets.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from automaton.errors import InputError
from automaton.exchange.guidance_graph import SYMBOL_OF, layout_rows, streets_text
from automaton.papers.claims import Claim, above, claim, mean_of
from automaton.papers.reproduction_study import (
    NEVER_ASIDE,
    Case,
    Headline,
    Key,
    PublishedTable,
    Reproduction,
    RunCase,
    Runner,
    fixed,
    scenario_runs,
)
from automaton.studies.process_pool import RunResult
from automaton.world.resolve import Resolved, resolve

GUIDANCE_TICKS: Final = 1000
TASKS_EACH: Final = 200  # per robot: more than it can do
TASKS_PER_TICK: Final = "tasks_per_tick"

UNWEIGHTED: Final = "unweighted"
CRISSCROSS_STREETS: Final = "crisscross"
BY_CMA_ES: Final = "CMA-ES"
BY_PIU: Final = "PIU"  # the update model of the authors
GUIDANCES: Final = (UNWEIGHTED, CRISSCROSS_STREETS, BY_CMA_ES, BY_PIU)


@dataclass(frozen=True)
class Setup:
    """A row of the table: a floor, a fleet, and the cells of its goals."""

    floor: str
    robots: int
    cells: str | tuple[str, str]
    generated: Mapping[str, Any] | None = None  # the layout, if a generator makes the floor
    optimised: bool = True  # whether the authors' weights are for this number of robots


BLOCKS: Final = {"generator": "shelf-blocks", "columns": 36, "rows": 33, "block": 10}
OPEN: Final = {"generator": "random", "columns": 48, "rows": 48, "obstacles": 0}
ALTERNATELY: Final = ("stations", "racks")
GOALS_OUTSIDE: Final = "1, goals outside dead ends"
GOALS_EVERYWHERE: Final = "1, goals everywhere"

SETUPS: Final = {
    GOALS_OUTSIDE: Setup("random-32-32-20", 400, "no-dead-ends"),
    GOALS_EVERYWHERE: Setup("random-32-32-20", 400, "all"),
    "2": Setup("warehouse-33-36", 400, ALTERNATELY, BLOCKS),
    "4": Setup("empty-48-48", 1000, "all", OPEN),
    "10": Setup("warehouse-33-36", 150, ALTERNATELY, BLOCKS, optimised=False),
}
AUTHORS_FILES: Final = {  # of the authors, without .json, by floor and weights
    ("random-32-32-20", UNWEIGHTED): "pibt_random_unweight_32x32",
    ("warehouse-33-36", UNWEIGHTED): "pibt_warehouse_33x36_w_mode",
    ("empty-48-48", UNWEIGHTED): "pibt_empty-48-48",
    ("random-32-32-20", CRISSCROSS_STREETS): (
        "pibt_random_unweight_32x32_alternate_baseline_bi-directed"
    ),
    ("warehouse-33-36", CRISSCROSS_STREETS): (
        "pibt_warehouse_33x36_w_mode_alternate_baseline_bi-directed"
    ),
    ("empty-48-48", CRISSCROSS_STREETS): "pibt_empty-48-48_alternate_baseline_bi-directed",
    ("random-32-32-20", BY_CMA_ES): "pibt_random_cma-es_32x32_400_agents_four-way-move",
    ("warehouse-33-36", BY_CMA_ES): ("pibt_warehouse-33x36_w_mode_cma-es_400_agents_four-way-move"),
    ("empty-48-48", BY_CMA_ES): "pibt_empty-48-48_cma-es_1000_agents_four-way-move",
    ("random-32-32-20", BY_PIU): ("pibt_random_cma-es_piu-transfer_32x32_400_agents_four-way-move"),
    ("warehouse-33-36", BY_PIU): (
        "pibt_warehouse-33x36_w_mode_cma-es-piu-transfer_400_agents_four-way-move"
    ),
    ("empty-48-48", BY_PIU): "pibt_empty-48-48_cma-es-piu_1000_agents_four-way-move",
}

PRINTED_TASKS_PER_TICK: Final = {
    ("2", UNWEIGHTED): 5.22,
    ("4", UNWEIGHTED): 19.48,
    ("10", UNWEIGHTED): 3.75,
    ("2", CRISSCROSS_STREETS): 6.65,
    ("4", CRISSCROSS_STREETS): 23.84,
    ("2", BY_CMA_ES): 7.64,
    ("4", BY_CMA_ES): 24.04,
    ("2", BY_PIU): 7.28,
    ("4", BY_PIU): 25.98,
}
# Mean and standard error of an independent program that follows the authors' code.
PROTOTYPE_TASKS_PER_TICK: Final = {
    (GOALS_OUTSIDE, UNWEIGHTED): (5.616, 0.021),
    ("2", UNWEIGHTED): (5.216, 0.013),
    ("4", UNWEIGHTED): (19.397, 0.033),
    ("10", UNWEIGHTED): (3.749, 0.005),
    (GOALS_OUTSIDE, CRISSCROSS_STREETS): (7.063, 0.029),
    ("2", CRISSCROSS_STREETS): (6.646, 0.013),
    ("4", CRISSCROSS_STREETS): (23.869, 0.016),
    ("10", CRISSCROSS_STREETS): (4.780, 0.005),
    (GOALS_OUTSIDE, BY_CMA_ES): (8.503, 0.020),
    ("2", BY_CMA_ES): (7.633, 0.010),
    ("4", BY_CMA_ES): (24.031, 0.011),
    (GOALS_OUTSIDE, BY_PIU): (8.240, 0.022),
    ("2", BY_PIU): (7.285, 0.012),
    ("4", BY_PIU): (25.985, 0.013),
}


class GuidanceCase(RunCase):
    """A setup with its weights."""

    @property
    def own_settings(self) -> tuple[str, ...]:
        return (f"fleet.robots={SETUPS[str(self.labels['setup'])].robots}",)


def published(key: Key, metric: str) -> float | None:
    """The printed number of tasks per tick."""
    setup, weights = map(str, key)
    return PRINTED_TASKS_PER_TICK.get((setup, weights))


def prototype(key: Key, metric: str) -> tuple[float, float] | None:
    """The prototype's mean and its standard error."""
    setup, weights = map(str, key)
    return PROTOTYPE_TASKS_PER_TICK.get((setup, weights))


# The authors' floors.


def layout_of(path: Path) -> dict[str, Any]:
    """The layout of a scenario from an authors' file. Raises InputError.

    Obstacles are racks on floors with cells `e`, which are those above and below racks.
    """
    rows = layout_rows(path)
    has_racks = any("e" in row for row in rows)
    marks = SYMBOL_OF | (dict.fromkeys("@T", "r") if has_racks else {})
    return {"picture": "\n".join("".join(marks[cell] for cell in row) for row in rows)}


def found_files(folder: Path) -> dict[tuple[str, str], Path]:
    """The authors' files in a folder and its subfolders, by floor and weights. Raises InputError."""
    if not folder.is_dir():
        raise InputError("is not a folder", str(folder))
    paths = {path.stem: path for path in sorted(folder.rglob("*.json")) if path.is_file()}
    known = {key: paths[stem] for key, stem in AUTHORS_FILES.items() if stem in paths}
    if not known:
        names = ", ".join(f"{stem}.json" for stem in list(AUTHORS_FILES.values())[:2])
        raise InputError(f"has no floor of the authors, such as {names}", str(folder))
    return known


# Runs.


def scenario_of(setup: Setup, layout: Mapping[str, Any]) -> dict[str, Any]:
    """The scenario of a setup."""
    orders = {
        "generator": "tours",
        "assign": "round-robin",
        "count": TASKS_EACH * setup.robots,
        "cells": setup.cells,
    }
    pibt = {"name": "pibt", "ties": "fixed", "deadlock_patience": NEVER_ASIDE}
    return {
        "name": "guidance",
        "layout": layout,
        "fleet": {"robots": setup.robots, "kinematics": "omni", "start": "random"},
        "orders": orders,
        "strategy": {"allocation": "greedy", "right_of_way": pibt},
        "stop": {"when": "never", "max_duration": GUIDANCE_TICKS},
    }


def runs_on(files: Mapping[tuple[str, str], Path]) -> Runner:
    """A table's runner, on the authors' floors where there are files, else on generated floors."""

    def scenario(case: GuidanceCase, folder: Path) -> Resolved:
        setup = SETUPS[str(case.labels["setup"])]
        path = files.get((setup.floor, UNWEIGHTED))
        layout = setup.generated if path is None else layout_of(path)
        assert layout is not None, "only setups with a floor have cases"
        content = scenario_of(setup, layout)
        weights = str(case.labels["weights"])
        if (setup.floor, weights) in files and weights != UNWEIGHTED:
            text = streets_text(files[setup.floor, weights])
            (folder / "streets.csv").write_text(text, encoding="utf-8")
            content["streets"] = {"file": "streets.csv"}
        elif weights == CRISSCROSS_STREETS:
            content["streets"] = {"preset": "crisscross"}
        (folder / "guidance.yaml").write_text(json.dumps(content))
        return resolve(folder / "guidance.yaml", case.settings)

    return scenario_runs(scenario_of=scenario, measured=per_tick)


def per_tick(result: RunResult) -> RunResult:
    """The result of a run with the finished tasks per tick as its only metric."""
    return result._replace(metrics={TASKS_PER_TICK: result.metrics["delivered"] / GUIDANCE_TICKS})


def tables_of(files: Mapping[tuple[str, str], Path]) -> list[PublishedTable]:
    """A table for each setup whose floor is known."""
    tables = []
    for name in ("1", "2", "4", "10"):
        members = [one for one in SETUPS if one.split(",")[0] == name]
        setup = SETUPS[members[0]]
        if setup.generated is None and (setup.floor, UNWEIGHTED) not in files:
            continue
        cases: list[Case] = [
            GuidanceCase({"setup": member, "weights": weights})
            for weights in GUIDANCES
            for member in members
            if weights in GUIDANCES[:2] or (setup.optimised and (setup.floor, weights) in files)
        ]
        tables.append(
            PublishedTable(
                title=f"Setup {name}: {setup.floor}, {setup.robots:,} robots; tasks per tick",
                name=f"setup-{name}",
                cases=fixed(cases),
                panels=((TASKS_PER_TICK,),),
                run=runs_on(files),
                published=published,
                prototype=prototype,
                digits=3,
                spread="se",
            )
        )
    return tables


def reproduction_of(files: Mapping[tuple[str, str], Path]) -> Reproduction:
    """The reproduction on these floors."""
    tables = tables_of(files)
    keys = [case.key for table in tables for case in table.cases(())]
    return replace(
        WITHOUT_TABLES,
        tables=tuple(tables),
        headlines=tuple(
            Headline(f"{setup}: {weights}", cell=(TASKS_PER_TICK, (setup, weights)), digits=3)
            for setup, weights in keys
        ),
        source=WITHOUT_TABLES.source
        + ("" if files else "; setup 1 and optimised weights need --data FOLDER"),
        remarks=GUIDANCE_REMARKS[1:] if files else GUIDANCE_REMARKS,
    )


def from_data(folder: Path) -> Reproduction:
    """The reproduction with the authors' floors. Raises InputError."""
    return reproduction_of(found_files(folder))


def gain(setups: Sequence[str], text: str, more: Sequence[str], than: str) -> Claim:
    """The claim that some weights finish more tasks than others."""
    return claim(
        text,
        *(
            above(
                f"setup {setup}: {weights} - {than}",
                mean_of(TASKS_PER_TICK, setup, weights) - mean_of(TASKS_PER_TICK, setup, than),
                digits=2,
            )
            for setup in setups
            for weights in more
        ),
    )


WHERE_FLOORS_ARE: Final = (
    "Setups 2, 4 and 10 run on generated floors. The floor of setup 1 and the optimised weights belong "
    "to third parties and are not part of the project: they are on GitHub (lunjohnzhang/ggo_public, "
    "folder maps/competition). `automaton reproduce guidance --data FOLDER` reads them."
)
GUIDANCE_REMARKS: Final = (
    WHERE_FLOORS_ARE,
    "A run has 1,000 ticks from random starts, no warm-up. Robots know one task at a time. Ties between "
    "equal steps are fixed (west, east, south, north): with ties by hash, the default of pibt, the "
    "unweighted numbers differ by up to 5 %.",
    "The prototype is an independent program that orders robots as the authors do: by the time since "
    "their last finished task, then by the distance to their goal. pibt orders by the time alone, which "
    "lowers throughput by up to 0.5 %.",
    "Setup 1 as printed (unweighted 5.52, crisscross 6.84) measures a fleet that shrinks: until March "
    "2024 the authors' robots retired where their goal had at most one neighbour (145 to 201 of 400 in a "
    "run), the fewer the better the weights. Here all robots drive, so no printed number stands beside "
    "them. Without the rules of dead ends that pibt has, such a fleet jams.",
)

WITHOUT_TABLES: Final = Reproduction(
    name="guidance",
    title="Guidance for large fleets: tasks per tick of hundreds of robots with pibt",
    source="Zhang et al., Guidance Graph Optimization for Lifelong Multi-Agent Path Finding, IJCAI "
    "2024, Table 3",
    tables=(),
    claims=(
        gain(
            ("2", "4"),
            "Crisscross finishes more tasks than no weights",
            (CRISSCROSS_STREETS,),
            UNWEIGHTED,
        ),
        gain(
            (GOALS_OUTSIDE, "2", "4"),
            "Optimised weights finish more tasks than crisscross",
            (BY_PIU, BY_CMA_ES),
            CRISSCROSS_STREETS,
        ),
    ),
    remarks=(),
    remarks_title="What is compared",
    seeds=50,
    from_data=from_data,
)
REPRODUCTION: Final = reproduction_of({})
