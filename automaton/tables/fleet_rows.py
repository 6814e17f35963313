"""Robots, stations and cells, read off the counters of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from automaton.engine.observation import LOST_EVER, Observation, visits_of
from automaton.engine.state import CLOCK_TICK, NIL, World
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.metrics import busy_ticks, metrics_by_robot
from automaton.runs.task_metrics import Measured
from automaton.tables.columns import (
    NUMBER,
    TEXT,
    TICKS,
    WHOLE,
    Array,
    Column,
    codes_of,
    form_of,
    where,
)
from automaton.tables.order_rows import Table
from automaton.tables.places import columns_and_rows
from automaton.world.pods import station_names


def robot_table(run: Measured) -> Table:
    """One row for each robot, as `run --json` has it."""
    rows = metrics_by_robot(run)
    columns, values, texts = [], {}, {}
    for name, first in rows[0].items():
        column = [row[name] for row in rows]
        kind = _kind_of(name, first)
        meaning = METRIC_CATALOGUE[name][1] if name in METRIC_CATALOGUE else ""
        columns.append(Column(name, kind, meaning))
        if kind == TEXT:
            values[name], texts[name] = codes_of(column)
        else:
            values[name] = np.array(column, np.float64 if kind == NUMBER else np.int64)
    return form_of("robots", run.resolved, tuple(columns), **texts), [values]


def _kind_of(name: str, value: Any) -> str:
    if isinstance(value, str):
        return TEXT
    if isinstance(value, float):
        return NUMBER
    return TICKS if METRIC_CATALOGUE.get(name, ("",))[0] == "ticks" else WHOLE


def station_table(run: Measured) -> Table:
    """One row for each station to which pods are carried, or that works on parts."""
    world, resolved = run.world, run.resolved
    to_pods = len(world.pod_stations.cell) > 0
    visits, work, lines = _of_pods(world) if to_pods else _of_parts(world)
    cells = world.pod_stations.cell if to_pods else world.slots.cell[world.stations.slot]
    x, y = columns_and_rows(resolved.floor_plan, cells)
    names = list(station_names(resolved)) or [str(k + 1) for k in range(len(cells))]
    rows = {
        "station": np.arange(len(cells)),
        "x": x,
        "y": y,
        "visits": visits,
        "lines": lines,
        "work": work,
        "utilization": work / max(1, int(world.clock[CLOCK_TICK])),
    }
    return form_of("stations", resolved, station=names), [rows]


def _of_pods(world: World) -> tuple[Array, Array, Array]:
    """(k,) visits, their ticks and lines that were served."""
    stops, count = world.stops, len(world.pod_stations.cell)
    done = np.flatnonzero(stops.done != NIL)
    station = world.pod_stations.station_at[stops.cell[done]]
    done, station = done[station != NIL], station[station != NIL]
    served = world.lines.served_at[world.lines.done != NIL]
    work = np.bincount(station, stops.ticks[done], count).astype(np.int64)
    return np.bincount(station, minlength=count), work, np.bincount(served, minlength=count)


def _of_parts(world: World) -> tuple[Array, Array, Array]:
    """(k,) parts that were worked on, the ticks of it, and no lines."""
    stations = world.stations
    done = stations.station[stations.completion_tick != NIL]
    parts = np.bincount(done, minlength=len(stations.slot))
    return parts, busy_ticks(world), where(parts < 0, parts)


def cell_table(run: Measured, observation: Observation) -> Table:
    """One row for each cell that robots drive on: visits, ticks lost there, moves out of it."""
    grid, flow = run.world.grid, observation.flow
    cells = grid.drivable
    x, y = columns_and_rows(run.resolved.floor_plan, cells)
    rows = {
        "x": x,
        "y": y,
        "visits": visits_of(flow, grid.offset)[cells],
        "waited": observation.lost_ticks_by_cell[cells, LOST_EVER],
        **{f"flow_{side}": flow[cells, k] for k, side in enumerate("eswn")},
    }
    return form_of("cells", run.resolved), [rows]
