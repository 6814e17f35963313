"""Run a scenario once, without a screen, and print its metrics.

Exit code 0: finished; 1: it did not finish; 2: bad input, a failing strategy included.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from automaton.commands.arguments import (
    add_output_arguments,
    add_refinement_arguments,
    add_scenario_arguments,
    add_timeout_argument,
    note,
    output_of,
    print_warnings,
    settings_of,
    show_line,
    whole,
)
from automaton.errors import InputError
from automaton.units import count, ticks_and_time, unit
from automaton.world.resolve import Resolved, resolve

if TYPE_CHECKING:
    from automaton.documents.report_document import Block, ReportDocument
    from automaton.runs.headless import Outcome
    from automaton.runs.simulation import Simulation
    from automaton.tables.table_run import TableRun

FORMS = {
    "csv": "as CSV files",
    "parquet": "as Parquet files, for pandas, polars or DuckDB",
    "xlsx": "as one workbook (extra excel)",
}


PROGRESS_DELAY_S = 1.0  # before a run on a terminal begins to say how far it is
REFRESH_S = 0.2
PROGRESS_INTERVAL_S = 2.0  # from then on it says which tick is being computed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton run`."""
    add_scenario_arguments(parser)
    add_refinement_arguments(parser)
    parser.add_argument("--record", type=Path, metavar="FILE", help="keep every tick in FILE")
    parser.add_argument(
        "--until", type=whole("a tick", 1), metavar="TICK", help="stop there, if not before"
    )
    add_timeout_argument(parser)
    parser.add_argument(
        "--every",
        metavar="PERIOD",
        help="show the run by this period (ticks, or a time such as 15min); default an hour",
    )
    add_table_arguments(parser)
    parser.add_argument("--picture", action="store_true", help="draw the grid at the end")
    add_output_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run, report, and say on stderr if the run did not finish."""
    from automaton.runs.headless import run_once
    from automaton.runs.periods import ticks_of_period
    from automaton.runs.run_diagnosis import JamWatch, note_jam
    from automaton.runs.run_report import run_document

    output = output_of(args)
    resolved = resolve(args.scenario, settings_of(args), args.seed)
    if args.until is not None:
        args.until *= resolved.scenario.refine
    print_warnings(resolved)
    every = ticks_of_period(resolved, args.every)
    with (
        written_tables(args, resolved) as tables,
        recorder(args.record, resolved) as on_record,
        progress(resolved) as on_window,
    ):
        drawn: list[Drawn] = []

        def on_end(simulation: Simulation) -> None:
            if args.picture:
                drawn.append(draw(simulation))
            if tables is not None:
                tables.finish(simulation)

        sampling = None if tables is None else tables.sampling
        outcome = run_once(
            resolved,
            on_record,
            on_window,
            args.until,
            on_end,
            args.strategy_timeout,
            sampling,
            JamWatch(partial(note_jam, resolved.scenario.name)),
            every,
        )
    parts: list[Drawn | EventLines] = [*drawn]
    parts += [tables] if isinstance(tables, EventLines) else []

    def document() -> ReportDocument:
        out = run_document(resolved, outcome)
        out.blocks[:0] = [block for part in reversed(parts) for block in part.blocks()]
        return out

    def data() -> dict[str, Any]:
        more = (part.as_json() for part in parts)
        return {**as_json(resolved, outcome), **{k: v for part in more for k, v in part.items()}}

    output.write(document, data)
    if outcome.finished or outcome.stopped:
        return 0
    scenario = resolved.scenario
    limit = ticks_and_time(scenario.stop.max_duration, unit(scenario.units.tick))
    note(f"{scenario.name} did not finish within {limit}: {outcome.diagnosis}")
    return 1


class Drawn(NamedTuple):
    """Pictures of the end of a run."""

    picture: str  # the grid
    zones: str  # the zones that robots serve and the work at stations; "" without either

    def as_json(self) -> dict[str, list[str]]:
        """What they add to the JSON of the run."""
        zones = {"service_zones": self.zones.splitlines()} if self.zones else {}
        return {"picture": self.picture.splitlines(), **zones}

    def blocks(self) -> Iterator[Block]:
        """The grid; below it zones and stations, zones in their colours."""
        from automaton.documents.report_document import CharacterPicture, Text
        from strategies.zoning.service_zone_lines import coloured

        yield Text(self.picture, code=True)
        if self.zones:
            yield CharacterPicture(coloured(self.zones))


def draw(simulation: Simulation) -> Drawn:
    """Draw the state that a run has come to."""
    from automaton.runs.pictures import picture_of
    from strategies.zoning.service_zone_lines import partition_picture

    zones = partition_picture(simulation.world, simulation.resolved.floor_plan)
    return Drawn(picture_of(simulation, brief=True), zones)


@contextlib.contextmanager
def recorder(path: Path | None, resolved: Resolved) -> Iterator[Any]:
    """What a simulation hands its ticks to, or None."""
    if path is None:
        yield None
        return
    from automaton.recording.recorder import Recorder

    try:
        with Recorder(path, resolved, resolved.scenario.seed) as on_record:
            yield on_record
    except OSError as error:
        raise InputError(f"cannot write the recording: {error.strerror}", str(path)) from error


@contextlib.contextmanager
def progress(resolved: Resolved) -> Iterator[Any]:
    """What says on a terminal how far a long run is, also within a long tick; None in a pipe."""
    if not sys.stderr.isatty():
        yield None
        return
    limit = resolved.scenario.stop.max_duration
    watched: list[Simulation] = []
    over = threading.Event()

    def tell() -> None:
        pause, told, tick, since = PROGRESS_DELAY_S, False, 0, time.monotonic()
        while not over.wait(pause):
            pause = REFRESH_S
            for simulation in watched:
                now = time.monotonic()
                if simulation.tick != tick:
                    tick, since = simulation.tick, now
                show_line(words(simulation, now - since))
                told = True
        if told:
            show_line("")

    def words(simulation: Simulation, seconds: float) -> str:
        if seconds >= PROGRESS_INTERVAL_S:
            return f"computing tick {simulation.tick:,}, {seconds:.0f} s"
        from automaton.runs.progress import asked_orders

        ends = asked_orders(simulation.world).done
        done = int((ends >= 0).sum())
        ticks = f"tick {simulation.tick:,} of at most {limit:,}"
        return f"{ticks}, {done:,} of {len(ends):,} orders delivered"

    def watch(simulation: Simulation) -> None:
        watched[:] = [simulation]

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield watch
    finally:
        over.set()
        teller.join()


def refinement_of(resolved: Resolved) -> dict[str, Any]:
    """How the ticks of a run were refined; nothing if they were not."""
    scenario = resolved.scenario
    return {} if scenario.refine == 1 else {"refine": scenario.refine, "decide": scenario.decide}


def as_json(resolved: Resolved, outcome: Outcome) -> dict[str, Any]:
    """The run as one object; times are in ticks, `metrics_in_units` has them in the units of the
    scenario."""
    from automaton.runs.bottleneck import bottleneck_sentences
    from automaton.runs.metric_catalogue import to_scenario_units, units_of

    tick, cell = units_of(resolved)
    told = to_scenario_units(outcome.metrics, tick, cell)
    if cell is not None:
        feet = [cell.of(robot["moves"]) for robot in outcome.robots]
        told["distance_by_robot"] = {"value": feet, "unit": cell.name}
    return {
        "scenario": resolved.scenario.name,
        "seed": resolved.scenario.seed,
        **refinement_of(resolved),
        "finished": outcome.finished,
        "stopped": outcome.stopped,
        "ticks": outcome.ticks,
        "orders": outcome.orders,
        "delivered": outcome.delivered,
        "wait_cycles": [list(circle) for circle in outcome.circles],
        "jam": None if outcome.jam is None else outcome.jam._asdict(),
        "orders_exhausted": None if outcome.ran_out is None else outcome.ran_out._asdict(),
        "digest": outcome.digest,
        "wall_s": None if outcome.wall_s is None else round(outcome.wall_s, 6),
        "metrics": outcome.metrics,
        "robots": outcome.robots,
        **({"types": list(outcome.types)} if outcome.types else {}),
        **({"stations": list(outcome.stations)} if outcome.stations else {}),
        **({"chargers": list(outcome.chargers)} if outcome.chargers else {}),
        **({"priorities": list(outcome.priorities)} if outcome.priorities else {}),
        "deadlock": None if outcome.deadlock is None else outcome.deadlock._asdict(),
        "robot_time": dict(outcome.uses),
        "bottleneck": bottleneck_sentences(resolved, outcome),
        **({"periods": [one.as_json() for one in outcome.periods]} if outcome.by_period else {}),
        **({"metrics_in_units": told} if told else {}),
    }


# The tables that a run leaves in a folder, and the events that it prints.


def add_table_arguments(parser: argparse.ArgumentParser) -> None:
    """Which tables a run leaves, and in which form: `csv`, `parquet`, `xlsx`, `states`, `events`."""
    forms = parser.add_mutually_exclusive_group()
    for form, what in FORMS.items():
        text = f"write tables of orders, lines, trips, robots and stations {what} into a new folder"
        forms.add_argument(f"--{form}", type=Path, metavar="DIR", help=text)
    parser.add_argument(
        "--states",
        metavar="PERIOD",
        help="sample robot states every PERIOD (ticks, or a time such as 10s); adds a table of cells",
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
    from automaton.tables.table_run import WantedTables, table_run

    options = WantedTables(args.states, args.events, folder=folders[form], form=form)
    with table_run(resolved, options, args.until) as tables:
        yield tables


class EventLines:
    """Keeps the events of a run, of a long one the last ones, and writes a line for each."""

    def __init__(self) -> None:
        from automaton.history.event_history import EventHistory
        from automaton.runs.headless import Sampling

        self._history = EventHistory()
        self._rows: list[dict[str, Any]] = []
        self._has_trips = False
        self.sampling = Sampling(0, lambda simulation: None, self._history)

    def finish(self, simulation: Simulation) -> None:
        """Read the events of a run that is over."""
        from automaton.tables.columns import rows_as_objects
        from automaton.tables.rows import event_form, event_rows

        rows = event_rows(simulation, self._history.events)
        self._rows = rows_as_objects(event_form(simulation.resolved), rows)
        self._has_trips = simulation.resolved.scenario.orders.lines is not None

    def as_json(self) -> dict[str, Any]:
        """What they add to the JSON of a run."""
        return {"events": [_named(row, self._has_trips) for row in self._rows]}

    def blocks(self) -> Iterator[Block]:
        """One line for each event."""
        from automaton.documents.report_document import Text

        dropped = self._history.log.dropped
        first = [f"{count(dropped, 'event')} before these are not kept"] if dropped else []
        lines = first + [_line(row, self._has_trips) for row in self._rows]
        yield Text("\n".join(lines), code=True)


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
