"""Make the tables of a run: events and states while it goes on, the others when it is over."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

from automaton.errors import InputError
from automaton.runs.sampling import Sampling
from automaton.runs.simulation import Simulation
from automaton.scenario.pods import LineDemand
from automaton.scenario.quantities import TIME, Dimension, read_amount
from automaton.tables.arrow_groups import GroupBuffer
from automaton.tables.columns import Array, Form
from automaton.tables.fleet_rows import cell_table, robot_table, station_table
from automaton.tables.observed_rows import EventTaker, event_form, state_form, state_rows_of
from automaton.tables.order_rows import Table, line_table, order_table, trip_table
from automaton.tables.run_documents import metrics_document, scenario_lines
from automaton.tables.table_files import PARQUET, Tables, sink_for
from automaton.world.resolve import Resolved


class TableOptions(NamedTuple):
    """Which tables, and where they go."""

    states: str | int | None = None  # a period, as ticks or as text with a unit; None: no states
    events: bool = False
    robots: Sequence[int] | None = None  # events and states of these alone
    folder: Path | None = None  # None: into memory
    form: str = PARQUET


class TableRun:
    """The tables of one run: give its `sampling` to the run, and end it with `finish`."""

    def __init__(self, resolved: Resolved, options: TableOptions, until: int | None = None) -> None:
        """`until`: the tick where the run ends, if not before. Raises InputError."""
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
        assert self._states is not None, "there is a period"
        self._states.append(state_rows_of(simulation, self._robots))

    def finish(self, simulation: Simulation) -> None:
        """Write what is left, and the tables that are read off a run when it is over."""
        for buffer in self._buffers:
            buffer.flush()
        for form, rows in tables_at_end(simulation, self.sampling.on_observe is not None):
            buffer = GroupBuffer(form, self._sink.write)
            for piece in rows:
                buffer.append(piece)
            buffer.flush()
        self._sink.describe(metrics_document(simulation), scenario_lines(simulation))

    def close(self) -> None:
        """What was written stays; groups that are not full are lost unless the run has an end."""
        self._sink.close()

    def tables(self) -> Tables:
        """The tables, after `close`."""
        return self._sink.tables()


def tables_at_end(simulation: Simulation, is_observed: bool) -> Iterator[Table]:
    """The tables that are read off the arrays of a run that is over."""
    yield order_table(simulation)
    yield line_table(simulation)
    yield trip_table(simulation)
    yield robot_table(simulation)
    yield station_table(simulation)
    if is_observed:
        yield cell_table(simulation, simulation.observation)


@contextmanager
def table_run(
    resolved: Resolved, options: TableOptions, until: int | None = None
) -> Iterator[TableRun]:
    """Make the tables of a run within; whatever happens, files are closed. Raises InputError.

    Of a run that is interrupted, what was written stays; of one that fails, no file and no new folder.
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
    """Remove the files that are not among those of before; the folder, too, if it was not there."""
    with suppress(OSError):
        for path in set(folder.iterdir()) - (before or set()):
            path.unlink()
        if before is None:
            folder.rmdir()


def period_of(states: str | int, resolved: Resolved) -> int:
    """Ticks of a period. Raises InputError for what is not one."""
    if isinstance(states, bool) or not isinstance(states, (str, int)):
        raise InputError(f"states must be a period such as '10 s', or ticks; found {states!r}")
    if isinstance(states, str) and states.strip().isdecimal():
        states = int(states)
    factor = resolved.scenario.refine
    exact = Fraction(states * factor) if isinstance(states, int) else _read_period(states, resolved)
    ticks = math.floor(exact + Fraction(1, 2))
    if ticks < 1:
        raise InputError(f"states are taken every {states}, which is less than a tick")
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
    """How many rows the larger tables have at most, if the run takes all of its ticks."""
    fleet = resolved.scenario.fleet.robots if robots is None else len(robots)
    states = (ticks // period + 1) * fleet if period else 0
    orders = resolved.scenario.orders
    if isinstance(orders.lines, LineDemand):
        asked = orders.lines.drawn
    else:
        asked = len(orders.lines or orders.listed or ()) or orders.count or 0
    return {"states": states, "orders": asked}
