"""The tables that a run leaves in a folder, and the events that it prints."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from automaton.errors import InputError
from automaton.units import count
from automaton.world.resolve import Resolved

if TYPE_CHECKING:
    from automaton.runs.simulation import Simulation
    from automaton.tables.table_run import TableRun

FORMS = {
    "csv": "as CSV files",
    "parquet": "as Parquet files, for pandas, polars or DuckDB",
    "xlsx": "as one workbook (extra excel)",
}


def add_table_arguments(parser: argparse.ArgumentParser) -> None:
    """Which tables a run leaves, and in which form: `csv`, `parquet`, `xlsx`, `states`, `events`."""
    forms = parser.add_mutually_exclusive_group()
    for form, what in FORMS.items():
        text = f"write tables of orders, lines, trips, robots and stations {what} into a new folder"
        forms.add_argument(f"--{form}", type=Path, metavar="DIR", help=text)
    parser.add_argument(
        "--states",
        metavar="PERIOD",
        help="a table of what robots are like every so many ticks, or every 10s, and one of cells",
    )
    parser.add_argument(
        "--events",
        action="store_true",
        help="a table of events, and one of cells; without a folder, print the events",
    )


@contextlib.contextmanager
def written_tables(
    args: argparse.Namespace, resolved: Resolved
) -> Iterator[TableRun | EventLines | None]:
    """What makes the tables that the arguments ask for, or keeps events, or None."""
    folders = {form: getattr(args, form) for form in FORMS}
    form = next((form for form, folder in folders.items() if folder is not None), None)
    if form is None:
        if args.states is not None:
            raise InputError("--states is a table; say where with --csv, --parquet or --xlsx DIR")
        yield EventLines() if args.events else None
        return
    from automaton.tables.table_run import TableOptions, table_run

    options = TableOptions(args.states, args.events, folder=folders[form], form=form)
    with table_run(resolved, options, args.until) as tables:
        yield tables


class EventLines:
    """Keeps the events of a run, of a long one the last ones, and writes a line for each."""

    def __init__(self) -> None:
        from automaton.history.event_history import EventHistory
        from automaton.runs.sampling import Sampling

        self._history = EventHistory()
        self._rows: list[dict[str, Any]] = []
        self._has_trips = False
        self.sampling = Sampling(0, lambda simulation: None, self._history)

    def finish(self, simulation: Simulation) -> None:
        """Read the events of a run that is over."""
        from automaton.tables.columns import rows_as_objects
        from automaton.tables.observed_rows import event_form, event_rows

        rows = event_rows(simulation, self._history.events)
        self._rows = rows_as_objects(event_form(simulation.resolved), rows)
        self._has_trips = simulation.resolved.scenario.orders.lines is not None

    def as_json(self) -> dict[str, Any]:
        """What they add to the JSON of a run."""
        return {"events": [_named(row, self._has_trips) for row in self._rows]}

    def lines(self) -> list[str]:
        """One line for each event."""
        dropped = self._history.log.dropped
        first = [f"{count(dropped, 'event')} before these are not kept"] if dropped else []
        return first + [_line(row, self._has_trips) for row in self._rows]


def _named(row: dict[str, Any], has_trips: bool) -> dict[str, Any]:
    """An event with `trip` instead of `order` where robots take trips."""
    return {"trip" if has_trips and key == "order" else key: row[key] for key in row}


def _line(row: dict[str, Any], has_trips: bool) -> str:
    parts = [f"tick {row['tick']:>7,}  {row['event']:<16}"]
    names = {"robot": "robot", "order": "trip" if has_trips else "order"}
    parts += [f"{name} {row[key]}" for key, name in names.items() if row[key] is not None]
    if row["value"] is not None:
        parts.append(f"{row['value']:g}")
    if row["x"] is not None:
        parts.append(f"at ({row['x']}, {row['y']})")
    return "  ".join(parts).rstrip()
