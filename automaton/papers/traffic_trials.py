"""The trials of Bhattathiri, Li & Kuhl on their warehouse, and the results of their network.

A seed determines the figures of each trial. A *predictor* estimates the number of other robots that use
each zone from their start, pick-up and drop-off cells; their actual paths determine the real number.

Training takes minutes, so it is not part of a reproduction: the network and the figures of Tables 1 to
4 are read from files that `automaton train traffic` wrote and can write again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from automaton.engine.state import ACTION_COUNT, NIL, Array, Grid
from automaton.floor.floor_plan import DOCK, EAST, RACK
from automaton.papers.reproduction_study import Case, Key, PublishedTable, read_once
from automaton.papers.training_report import COLUMNS, PRINTED_TABLES, TrainingRow, from_json
from automaton.scenario.floor_section import generator_type
from automaton.scenario.robot_types import RobotType
from automaton.world.prepared_floor import PreparedFloor, floor_for
from strategies.routing import monte_carlo
from strategies.routing.astar import LARGER_G, RouteSpace, route_space
from strategies.routing.predicted_paths import CERTAIN, USED_SHARE, false_alarms
from strategies.routing.routing_parameters import network_for, predicted_zones, shipped
from strategies.routing.traffic_avoidance import LEAST_TIME, MOST_CAUTIOUS

WAREHOUSE_SIDE: Final = 100  # cells
TRIAL_ROBOTS: Final = 6  # five are active, one is dispatched
TRIALS: Final = 100  # per seed
MOST_THRESHOLD: Final = 6  # A = 1..6
WAREHOUSE_SCENARIO: Final = "warehouse-100"
COMMAND: Final = "automaton train traffic --tables --out FILE"
DEPTHS_COMMAND: Final = "automaton train traffic --depths --epochs 5 --out FILE"
DEPTH_FIGURES: Final = ("least", "constant", "precision", "recall")


class Warehouse(NamedTuple):
    """The warehouse, ready for trials."""

    grid: Grid
    duration: Array  # (A,) int32
    racks: Array  # (k,) int32: the cell from which each rack is served
    docks: Array  # (k,) int32
    workspace: RouteSpace
    trial: monte_carlo.MonteCarloWorkspace


Predictor = Callable[[Warehouse, int, Array], Array]  # warehouse, seed, tasks -> (trials, Z) int32


@dataclass(frozen=True)
class Setting:
    """One reading of the experiment."""

    predictor: Predictor
    slowdown: Literal["static", "dynamic"] = "static"
    cautious: bool = False  # whether to take the feasible path of least A regardless of its time
    more_than: bool = False  # whether zones close with more than A other robots instead of with A


@cache
def warehouse(side: int = WAREHOUSE_SIDE) -> Warehouse:
    """The warehouse E1, or one like it of another size; undirected zones, moves of one tick."""
    plan = generator_type("racks")(preset="E1", rows=side, columns=side).build()  # type: ignore[attr-defined]
    floor = floor_for(plan, "undirected", (RobotType(kinematics="omni"),))
    duration = np.ones(ACTION_COUNT, np.int32)
    duration.setflags(write=False)
    grid = floor.grid.read_only()
    return Warehouse(
        grid,
        duration,
        stands(floor, RACK),
        stands(floor, DOCK),
        route_space(grid),
        monte_carlo.monte_carlo_workspace(
            TRIAL_ROBOTS, 2 * floor.longest_route, grid.traffic_zone_count
        ),
    )


def stands(floor: PreparedFloor, kind: int) -> Array:
    """(k,) the cells from which the slots of a kind are served; docks are served from the east."""
    access = floor.slot_access[floor.grid.kind[floor.slot_cell] == kind]
    found: Array = np.where(access[:, EAST] != NIL, access[:, EAST], access.max(1))
    return found.astype(np.int32)


def tasks_of(where: Warehouse, seed: int, trials: int = TRIALS) -> Array:
    """(trials, ROBOTS, 3) int32: start, pick-up and drop-off cells."""
    tasks = np.zeros((trials, TRIAL_ROBOTS, 3), np.int32)
    with np.errstate(over="ignore"):
        monte_carlo.draw_tasks(np.uint64(seed), where.racks, where.docks, tasks)
    return tasks


def noisy(precision: float, recall: float) -> Predictor:
    """A predictor with random errors of this precision and recall, for each zone and robot."""
    add = false_alarms(precision, recall, USED_SHARE)

    def predict(where: Warehouse, seed: int, tasks: Array) -> Array:
        foreseen = np.zeros((len(tasks), where.grid.traffic_zone_count), np.int32)
        chances = round(recall * CERTAIN), round(add * CERTAIN)
        arguments = (where.grid, where.duration, where.workspace, where.trial, LARGER_G)
        with np.errstate(over="ignore"):
            monte_carlo.count_foreseen(*arguments, np.uint64(seed), tasks, *chances, foreseen)
        return foreseen

    return predict


exact: Final = noisy(precision=1, recall=1)


class Trial(NamedTuple):
    """The dispatched robot in one trial: with plain A*, and with the path that it chose."""

    plain: Mapping[str, float]
    chosen: Mapping[str, float]


def run_seed(setting: Setting, seed: int) -> list[Trial]:
    """The TRIALS trials of a seed, with the same tasks for every setting."""
    where = warehouse()
    tasks = tasks_of(where, seed)
    out = np.zeros((TRIALS, monte_carlo.TRIAL_COLUMNS), np.int64)
    with np.errstate(over="ignore"):
        monte_carlo.run_trials(
            where.grid,
            where.duration,
            where.workspace,
            where.trial,
            LARGER_G,
            np.uint64(seed),
            tasks,
            setting.predictor(where, seed, tasks),
            MOST_THRESHOLD,
            2 if setting.more_than else 1,
            MOST_CAUTIOUS if setting.cautious else LEAST_TIME,
            int(setting.slowdown == "dynamic"),
            out,
        )
    return [_figures(row.tolist()) for row in out]


def _figures(row: Sequence[int]) -> Trial:
    """The metrics of a trial; `saving` exists only if the path differs from that of plain A*."""
    plain, chosen = (
        row[: monte_carlo.TRIAL_CHOSEN],
        row[monte_carlo.TRIAL_CHOSEN : monte_carlo.TRIAL_ALTERNATIVE],
    )
    names = ("time", "distance", "encounters")
    taken, saved = (
        row[monte_carlo.TRIAL_ALTERNATIVE],
        plain[monte_carlo.TRIAL_TIME] - chosen[monte_carlo.TRIAL_TIME],
    )
    found = with_squares(dict(zip(names, chosen, strict=True))) | {"taken": taken, "saved": saved}
    if taken:
        found["saving"] = saved
    return Trial(with_squares(dict(zip(names, plain, strict=True))), found)


def with_squares(metrics: dict[str, int]) -> dict[str, int]:
    """The metrics of a trial with the squares needed for standard deviations."""
    return metrics | {f"{name}_squared": metrics[name] ** 2 for name in ("time", "distance")}


# The shipped network, and the stored results of its trainings.


def network(where: Warehouse, seed: int, tasks: Array) -> Array:
    """(trials, Z) int32: number of other robots that the shipped network predicts in each zone.

    A robot uses the zones of both of its legs.
    """
    trained = network_for(where.grid, where.duration, shipped(WAREHOUSE_SCENARIO))
    zones = where.grid.traffic_zone[tasks[:, 1:], 0].astype(np.int64)  # (trials, others, 3)
    start, pick, drop = zones.reshape(-1, 3).T  # all robots in one call of the network
    used = predicted_zones(trained, start, pick) | predicted_zones(trained, pick, drop)
    foreseen: Array = used.reshape(*zones.shape[:2], -1).sum(axis=1, dtype=np.int32)
    return foreseen


@cache
def stored(what: str = "tables") -> dict[str, Any]:
    """A file with the results of Tables 1 to 4 or of `depths`: settings and rows."""
    path = shipped(WAREHOUSE_SCENARIO).with_name(f"{WAREHOUSE_SCENARIO}-{what}.json")
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def rows() -> dict[Key, TrainingRow]:
    """The rows by their labels, in printed order; the printed loss comes first."""
    in_print = [(table, keep) for table, figures in PRINTED_TABLES.items() for keep in figures]
    found = sorted(
        from_json(stored()["rows"]), key=lambda row: in_print.index((row.table, row.monitored))
    )
    return {tuple(labels(row).values()): row for row in found}


def labels(row: TrainingRow) -> dict[str, str | int]:
    """The labels of a row, short enough for a line."""
    return {"table": row.table, "monitored": row.short, "loss": row.loss}


def published(key: Key, metric: str) -> float | None:
    """The printed figure; the paper prints one for each row, regardless of the loss."""
    return rows()[key].paper.get(metric)


def origin() -> str:
    """The origin of the stored figures, in words."""
    found = stored()
    settings = found["settings"]
    return (
        f"From a file that `{COMMAND}` wrote: {settings['legs']:,} legs, batches of "
        f"{settings['batch']}, at most {settings['epochs']} epochs, seed {settings['seed']}; Tables 1 "
        "and 2 with output bias, 3 and 4 with sample weights; 1 and 3 on the training legs, 2 and 4 on "
        "other legs. A row uses the weights of the last epoch that improved all of its monitored "
        "metrics."
    )


def depths() -> dict[Key, dict[str, Any]]:
    """The trainings by loss and number of hidden layers."""
    return {("depth", row["loss"], row["hidden"]): row for row in stored("depths")["rows"]}


def depth_figures(key: Key) -> dict[str, float]:
    """The results of one training; `beyond`: its loss minus the loss of a constant answer."""
    row = depths()[key]
    return {name: row[name] for name in DEPTH_FIGURES} | {"beyond": row["least"] - row["constant"]}


def origin_of_depths() -> str:
    """The origin of the stored trainings, in words."""
    settings = stored("depths")["settings"]
    return (
        f"From a file that `{DEPTHS_COMMAND}` wrote: {settings['legs']:,} legs, batches of "
        f"{settings['batch']}, at most {settings['epochs']} epochs, seed {settings['seed']}; the least "
        "loss of an epoch, compared with the least loss of a constant answer."
    )


DEPTHS_TABLE: Final = PublishedTable(
    title="Deeper networks: what they learn",
    cases=lambda strategies: [
        Case({"study": study, "loss": loss, "hidden": hidden}) for study, loss, hidden in depths()
    ],
    panels=(DEPTH_FIGURES,),
    run=read_once(depth_figures),
    stored=origin_of_depths,
    repetition="training",
    shares=("precision", "recall"),
    digits=4,
    grouped=2,
)

TABLES_1_TO_4: Final = PublishedTable(
    title="Tables 1 to 4: what the network learns",
    cases=lambda strategies: [Case(labels(row)) for row in rows().values()],
    panels=(COLUMNS,),
    published=published,
    run=read_once(lambda key: rows()[key].ours),
    stored=origin,
    repetition="training",
    shares=COLUMNS,
    digits=2,
    grouped=1,
)
