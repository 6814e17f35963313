"""The network of Bhattathiri, Li & Kuhl in their reproduction: what it foresees, and Tables 1 to 4.

Training takes minutes, so it is no part of a reproduction: the network and the figures of the tables
are read from files that `automaton train traffic` wrote, and that it writes anew on request.
"""

from __future__ import annotations

import json
from functools import cache
from typing import Any, Final

import numpy as np

from automaton.engine.state import Array
from automaton.papers.reproduction_study import Case, Key, Table, read_once
from automaton.papers.traffic.traffic_trials import Warehouse
from automaton.papers.training.training_tables import COLUMNS, PRINTED, Row, from_json
from strategies.routing.routing_parameters import network_for, predicted_zones, shipped

SCENARIO: Final = "warehouse-100"
COMMAND: Final = "automaton train traffic --tables --out FILE"
DEPTHS_COMMAND: Final = "automaton train traffic --depths --epochs 5 --out FILE"


def network(where: Warehouse, seed: int, tasks: Array) -> Array:
    """(trials, Z) int32: the other robots that the shipped network predicts in each zone.

    A robot uses the zones of either of its two legs.
    """
    trained = network_for(where.grid, where.duration, shipped(SCENARIO))
    zones = where.grid.traffic_zone[tasks[:, 1:], 0].astype(np.int64)  # (trials, others, 3)
    start, pick, drop = zones.reshape(-1, 3).T  # of all robots, in one call of the network
    used = predicted_zones(trained, start, pick) | predicted_zones(trained, pick, drop)
    foreseen: Array = used.reshape(*zones.shape[:2], -1).sum(axis=1, dtype=np.int32)
    return foreseen


@cache
def stored(what: str = "tables") -> dict[str, Any]:
    """A file of results, of Tables 1 to 4 or of `depths`: how they were made, and the rows."""
    path = shipped(SCENARIO).with_name(f"{SCENARIO}-{what}.json")
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def rows() -> dict[Key, Row]:
    """The rows by their labels, in the order of print; the printed loss first."""
    in_print = [(table, keep) for table, figures in PRINTED.items() for keep in figures]
    found = sorted(
        from_json(stored()["rows"]), key=lambda row: in_print.index((row.table, row.monitored))
    )
    return {tuple(labels(row).values()): row for row in found}


def labels(row: Row) -> dict[str, str | int]:
    """What a row is called, short enough for a line."""
    return {"table": row.table, "monitored": row.short, "loss": row.loss}


def published(key: Key, metric: str) -> float | None:
    """The printed figure: the paper prints one for each row, whatever the loss."""
    return rows()[key].paper.get(metric)


def origin() -> str:
    """How the stored figures were made."""
    found = stored()
    settings = found["settings"]
    return (
        f"From a file that `{COMMAND}` wrote: {settings['legs']:,} legs, batches of "
        f"{settings['batch']}, at most {settings['epochs']} epochs, seed {settings['seed']}; Tables 1 "
        "and 2 with output bias, 3 and 4 with sample weights; 1 and 3 on the legs of the training, "
        "2 and 4 on others. A row keeps the weights of the epoch that last improved all that it "
        "monitors."
    )


def depths() -> dict[Key, dict[str, Any]]:
    """The trainings by loss and hidden layers."""
    return {("depth", row["loss"], row["hidden"]): row for row in stored("depths")["rows"]}


def depth_figures(key: Key) -> dict[str, float]:
    """One training; beyond: by how much the loss stays above that of a constant answer."""
    row = depths()[key]
    return {name: row[name] for name in DEPTH} | {"beyond": row["least"] - row["constant"]}


def origin_of_depths() -> str:
    """How the stored trainings were made."""
    settings = stored("depths")["settings"]
    return (
        f"From a file that `{DEPTHS_COMMAND}` wrote: {settings['legs']:,} legs, batches of "
        f"{settings['batch']}, at most {settings['epochs']} epochs, seed {settings['seed']}; the least "
        "loss of an epoch, beside the least of a constant answer."
    )


DEPTH: Final = ("least", "constant", "precision", "recall")
DEPTHS: Final = Table(
    title="Deeper networks: what they learn",
    cases=lambda strategies: [
        Case({"study": study, "loss": loss, "hidden": hidden}) for study, loss, hidden in depths()
    ],
    panels=(DEPTH,),
    run=read_once(depth_figures),
    stored=origin_of_depths,
    repetition="training",
    digits=4,
    grouped=2,
)

TABLES_1_TO_4: Final = Table(
    title="Tables 1 to 4: what the network learns",
    cases=lambda strategies: [Case(labels(row)) for row in rows().values()],
    panels=(COLUMNS,),
    published=published,
    run=read_once(lambda key: rows()[key].ours),
    stored=origin,
    repetition="training",
    digits=2,
    grouped=1,
)
