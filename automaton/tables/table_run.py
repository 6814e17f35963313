"""Write the tables of a run: events and states during the run, all others at its end.

The metrics and the scenario of the run are written as well.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
import yaml

from automaton.errors import InputError
from automaton.floor.drawn_floors import floor_drawing, legend_entry
from automaton.runs.headless import Sampling, is_finished
from automaton.runs.metric_catalogue import to_scenario_units, units_of
from automaton.runs.metrics import metrics_by_type, metrics_of
from automaton.runs.progress import asked_orders
from automaton.runs.provenance import versions
from automaton.runs.simulation import Simulation
from automaton.scenario.order_lines import LineTable
from automaton.scenario.orders import LineDemand
from automaton.scenario.quantities import TIME, Dimension, read_amount
from automaton.tables.columns import Array, Form, GroupBuffer
from automaton.tables.rows import (
    EventTaker,
    Table,
    cell_table,
    event_form,
    line_table,
    order_table,
    robot_table,
    state_form,
    state_rows_of,
    station_table,
    trip_table,
)
from automaton.tables.table_files import PARQUET, Tables, sink_for
from automaton.world.resolved import Resolved


class WantedTables(NamedTuple):
    """The requested tables, and their destination."""

    states: str | int | None = None  # a period, as ticks or as text with a unit; None: no states
    events: bool = False
    robots: Sequence[int] | None = None  # robots whose events and states are recorded; None: all
    folder: Path | None = None  # None: keep tables in memory
    form: str = PARQUET


class TableRun:
    """The tables of one run: pass `sampling` to the run, and call `finish` at its end."""

    def __init__(self, resolved: Resolved, options: WantedTables, until: int | None = None) -> None:
        """`until`: the tick at which the run ends at the latest. Raises InputError."""
        self._resolved = resolved
        period = 0 if options.states is None else period_of(options.states, resolved)
        robots = _robots(options.robots, resolved.scenario.fleet.robots)
        limit = resolved.scenario.stop.max_duration
        expected = expected_rows(resolved, period, robots, min(limit, until or limit))
        self._sink = sink_for(options.folder, options.form, expected)
        self._buffers: list[GroupBuffer] = []
        self._states = self._buffer(state_form(resolved)) if period else None
        events = self._buffer(event_form(resolved)) if options.events else None
        self._robots = robots
        taker = EventTaker(events.append if events else None, robots)
        observes = period > 0 or options.events
        self.sampling = Sampling(period, self._sample, taker if observes else None)

    def _buffer(self, form: Form) -> GroupBuffer:
        self._buffers.append(GroupBuffer(form, self._sink.write))
        return self._buffers[-1]

    def _sample(self, simulation: Simulation) -> None:
        assert self._states is not None, "a period is set"
        self._states.append(state_rows_of(simulation, self._robots))

    def finish(self, simulation: Simulation) -> None:
        """Write the remaining rows, and the tables of the finished run."""
        for buffer in self._buffers:
            buffer.flush()
        for form, rows in tables_at_end(simulation, self.sampling.on_observe is not None):
            buffer = GroupBuffer(form, self._sink.write)
            for piece in rows:
                buffer.append(piece)
            buffer.flush()
        self._sink.describe(metrics_document(simulation), scenario_lines(simulation))

    def close(self) -> None:
        """Close all files; rows of incomplete groups are lost unless `finish` was called."""
        self._sink.close()

    def tables(self) -> Tables:
        """The tables, after `close`."""
        return self._sink.tables()


def tables_at_end(simulation: Simulation, is_observed: bool) -> Iterator[Table]:
    """The tables from the arrays of a finished run."""
    yield order_table(simulation)
    yield line_table(simulation)
    yield trip_table(simulation)
    yield robot_table(simulation)
    yield station_table(simulation)
    if is_observed:
        yield cell_table(simulation, simulation.observation)


@contextmanager
def table_run(
    resolved: Resolved, options: WantedTables, until: int | None = None
) -> Iterator[TableRun]:
    """Write the tables of a run inside; always close the files. Raises InputError.

    If the run is interrupted, written rows stay; if it fails, new files and a new folder are removed.
    """
    folder = options.folder
    before = None if folder is None or not folder.is_dir() else set(folder.iterdir())
    run = TableRun(resolved, options, until)
    try:
        yield run
    except Exception:
        run.close()
        if folder is not None:
            _remove_new(folder, before)
        raise
    except BaseException:
        run.close()
        raise
    run.close()


def _remove_new(folder: Path, before: set[Path] | None) -> None:
    """Remove files that did not exist before, and the folder if it is new."""
    with suppress(OSError):
        for path in set(folder.iterdir()) - (before or set()):
            path.unlink()
        if before is None:
            folder.rmdir()


def period_of(states: str | int, resolved: Resolved) -> int:
    """Ticks of a period. Raises InputError for an invalid period."""
    if isinstance(states, bool) or not isinstance(states, (str, int)):
        raise InputError(
            f"states must be a period such as '10 s' or a number of ticks, not {states!r}"
        )
    if isinstance(states, str) and states.strip().isdecimal():
        states = int(states)
    factor = resolved.scenario.refine
    exact = Fraction(states * factor) if isinstance(states, int) else _read_period(states, resolved)
    ticks = math.floor(exact + Fraction(1, 2))
    if ticks < 1:
        raise InputError(f"the period of states, {states}, is less than a tick")
    return ticks


def _read_period(text: str, resolved: Resolved) -> Fraction:
    try:
        return TIME.number(read_amount(text, (Dimension.TIME,)), resolved.scenario.units.scale)
    except InputError as error:
        raise InputError(f"states: {error.message}") from None


def _robots(robots: Sequence[int] | None, count: int) -> Array | None:
    if robots is None:
        return None
    for robot in robots:
        if robot not in range(count):
            raise InputError(f"there is no robot {robot!r}; robots are 0 to {count - 1:,}")
    return np.unique(np.array(robots, np.int64))


def expected_rows(
    resolved: Resolved, period: int, robots: Array | None, ticks: int
) -> dict[str, int]:
    """Maximum number of rows of the larger tables, if the run uses all of its ticks."""
    fleet = resolved.scenario.fleet.robots if robots is None else len(robots)
    states = (ticks // period + 1) * fleet if period else 0
    orders = resolved.scenario.orders
    if isinstance(orders.lines, LineDemand):
        asked = orders.lines.drawn
    else:
        asked = len(orders.lines or orders.listed or ()) or orders.count or 0
    return {"states": states, "orders": asked}


# The metrics of a run, and its scenario.


LISTS: Final = ("listed", "lines", "tasks")  # fields of orders that may have a million entries
WIDTH: Final = 100


def metrics_document(simulation: Simulation) -> dict[str, Any]:
    """The values of `run --json` for the whole run."""
    resolved, metrics = simulation.resolved, metrics_of(simulation)
    orders = asked_orders(simulation.world)
    in_units = to_scenario_units(metrics, *units_of(resolved))
    types = metrics_by_type(simulation)
    return {
        "scenario": resolved.scenario.name,
        "seed": simulation.seed,
        "finished": is_finished(simulation),
        "ticks": simulation.tick,
        "orders": len(orders.done),
        "delivered": int((orders.done >= 0).sum()),
        "digest": simulation.digest,
        "metrics": metrics,
        **({"types": types} if types else {}),
        **({"metrics_in_units": in_units} if in_units else {}),
    }


def scenario_lines(simulation: Simulation) -> Iterator[str]:
    """The scenario with all defaults, times in ticks, the seed, and a comment with versions."""
    orders = simulation.resolved.scenario.orders
    values = {name: getattr(orders, name) for name in LISTS}
    lists = {name: value for name, value in values.items() if isinstance(value, tuple | LineTable)}
    data = _sections(simulation.resolved.scenario)
    data["orders"] = _sections(orders, lists)
    data["seed"] = simulation.seed
    data["layout"] = _layout(simulation)
    used = ", ".join(f"{name} {version}" for name, version in versions().items())
    yield f"# The scenario of the run, with {used}.\n"
    keys = {f"  {_key_of(orders, name)}: []": entries for name, entries in lists.items()}
    text = yaml.dump(data, Dumper=ScenarioDumper, sort_keys=False, allow_unicode=True, width=WIDTH)
    for line in text.splitlines():
        if line not in keys:
            yield line + "\n"
            continue
        yield line.removesuffix(" []") + "\n"
        for entry in keys[line]:
            values = msgspec.to_builtins(entry)
            if isinstance(values, dict):
                values = {name: value for name, value in values.items() if value is not None}
            yield f"    - {msgspec.json.encode(values).decode()}\n"


def _sections(struct: msgspec.Struct, lists: Container[str] = ("orders",)) -> dict[str, Any]:
    """The fields of a struct by key, with an empty list for each of `lists`."""
    return {
        field.encode_name: []
        if field.name in lists
        else msgspec.to_builtins(getattr(struct, field.name))
        for field in msgspec.structs.fields(struct)
    }


def _key_of(struct: msgspec.Struct, name: str) -> str:
    """The key of a field in files."""
    fields = msgspec.structs.fields(struct)
    return next(field.encode_name for field in fields if field.name == name)


def _layout(simulation: Simulation) -> dict[str, Any]:
    """The layout; a floor from a file becomes a drawing if possible."""
    layout: dict[str, Any] = dict(simulation.resolved.scenario.layout)
    if "file" not in layout:
        return layout
    try:
        drawing = floor_drawing(simulation.resolved.floor_plan)
    except InputError:
        return layout
    legend = {mark: legend_entry(symbol) for mark, symbol in drawing.legend}
    others = {name: value for name, value in layout.items() if name not in ("file", "legend")}
    return {"picture": drawing.picture + "\n", "legend": legend, **others}


class ScenarioDumper(yaml.SafeDumper):
    """A YAML dumper that writes texts of several lines as blocks."""


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = "|" if "\n" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style)


ScenarioDumper.add_representer(str, _text)
