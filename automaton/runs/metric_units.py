"""Metrics in the reader's units: a scenario says what a tick stands for, and perhaps what a cell is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from automaton.build.resolve import Resolved
from automaton.runs.metrics import METRIC_CATALOGUE
from automaton.units import Unit, duration, unit


def units_of(resolved: Resolved) -> tuple[Unit, Unit | None]:
    """What a tick and a cell's side stand for; None: the scenario does not say what a cell is."""
    units = resolved.scenario.units
    return unit(units.tick), None if units.cell is None else unit(units.cell)


def to_scenario_units(
    metrics: Mapping[str, float], tick: Unit, cell: Unit | None
) -> dict[str, Any]:
    """Return the metrics in ticks and in cells with the scenario's units; nothing if a tick is just
    a tick.
    """
    found = {}
    for name, value in metrics.items():
        kind = METRIC_CATALOGUE[name][0] if name in METRIC_CATALOGUE else ""
        if kind == "ticks" and tick.name not in ("tick", "ticks"):
            amount, told = duration(value, tick)
        elif kind == "cells" and cell is not None:
            amount, told = cell.of(value), cell.name
        else:
            continue
        found[name] = {"value": amount, "unit": told}
    return found
