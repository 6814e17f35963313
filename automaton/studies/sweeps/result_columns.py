"""Columns of the results: their names, their types, and what may be a factor."""

from __future__ import annotations

import json
from typing import Any, Final

from automaton.errors import nearest
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.metric_sums import SUMS
from automaton.scenario.schema import Scenario

# The columns of every row, before the factors and the metrics, with their types.
RESULT_COLUMNS: Final = {
    "key": "text",  # of the run: scenario, seed and code
    "study": "text",
    "scenario": "text",  # as the study names it
    "point": "int",  # number of the design point, from 0
    "replication": "int",  # from 0
    "seed": "int",
    "finished": "bool",
    "error": "text",  # why the run failed; null: it did not
    "ticks": "int",
    "orders": "int",
    "delivered": "int",
    "digest": "text",
    "wall_s": "float",  # of the run, setting up included
    "cpu_s": "float",
}
SERIES: Final = "series"  # deliveries in each window, where a study asks for them
# what automaton.runs.metric_sums adds up, in each stretch of some windows; likewise
SUMS_COLUMN: Final = "sums"
TICKS_PER_SECOND: Final = "ticks_per_second"  # of reports: `ticks` by `cpu_s`
# What an analysis may name beside the metrics: unit and meaning.
RUN_METRICS: Final = {
    "ticks": ("ticks", "ticks of the run"),
    "orders": ("orders", "orders of the run"),
    TICKS_PER_SECOND: (
        "ticks/s",
        "by CPU time of the whole run; it differs from machine to machine",
    ),
}
FIXED_KEYS: Final = ("name", "summary", "seed")  # of a scenario, no factors


def check_factor(key: str) -> str | None:
    """What is wrong with a key as a factor, or None."""
    first = key.split(".")[0]
    parts = key.split(".")
    if "" in parts:
        return f"'{key}' is not a key of a scenario, such as fleet.robots"
    if first in FIXED_KEYS and len(parts) == 1:
        why = "the seeds follow from the study's" if key == "seed" else "it changes no run"
        return f"{key} is not a factor: {why}"
    names = Scenario.__struct_fields__
    if first not in names:
        return f"unknown key '{first}'{nearest(first, names)}; allowed: {', '.join(names)}"
    if key in RESULT_COLUMNS:
        return f"{key} as a whole is not a factor; vary a part of it, such as {key}.count"
    return None


def column_type(levels: tuple[Any, ...]) -> str:
    """What a column of these levels holds: "int", "float", "bool", or "text"."""
    kinds = {type(level) for level in levels if level is not None}
    if kinds == {bool}:
        return "bool"
    if kinds == {int} and all(abs(level) < 2**63 for level in levels if level is not None):
        return "int"
    return "float" if kinds and kinds <= {int, float} else "text"


def column_value(level: Any, kind: str) -> Any:
    """A level as its column holds it: words as they are, lists and mappings as JSON."""
    if level is None:
        return None
    if kind == "text" and not isinstance(level, str):
        return json.dumps(level, ensure_ascii=False)
    return float(level) if kind == "float" else level


def metric_names(counted: tuple[str, ...] = ()) -> tuple[str, ...]:
    """All metrics that a row may have: those of every run, then what strategies count themselves.

    `delivered` stands among the first columns.
    """
    known = tuple(name for name in METRIC_CATALOGUE if name not in RESULT_COLUMNS)
    return (*known, *(name for name in counted if name not in known))


def sum_names(counted: tuple[str, ...] = ()) -> tuple[str, ...]:
    """What a row of a steady state adds up: also what strategies count themselves."""
    return (*SUMS, *(name for name in counted if name not in SUMS))
