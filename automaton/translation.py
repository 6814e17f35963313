"""Metrics in the reader's units: a scenario says what a tick stands for, and perhaps what a cell is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from automaton.metrics import GLOSSARY
from automaton.scenario.resolve import Resolved
from automaton.units import Unit, duration, unit


def units_of(resolved: Resolved) -> tuple[Unit, Unit | None]:
    """What a tick and a cell's side stand for; None: the scenario does not say what a cell is."""
    units = resolved.scenario.units
    return unit(units.tick), None if units.cell is None else unit(units.cell)


def translated(metrics: Mapping[str, float], tick: Unit, cell: Unit | None) -> dict[str, Any]:
    """The metrics in ticks and in cells as values with units; nothing if a tick is just a tick."""
    found = {}
    for name, value in metrics.items():
        kind = GLOSSARY[name][0] if name in GLOSSARY else ""
        if kind == "ticks" and tick.name not in ("tick", "ticks"):
            amount, told = duration(value, tick)
        elif kind == "cells" and cell is not None:
            amount, told = cell.of(value), cell.name
        else:
            continue
        found[name] = {"value": amount, "unit": told}
    return found
