"""Run a scenario once, without the viewer, and print its metrics.

Exit code 0: finished; 1: it did not finish; 2: bad input or a failing strategy.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
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
from automaton.commands.watch import viewer
from automaton.errors import InputError
from automaton.units import count, ticks_and_time, unit
from automaton.world.resolve import Resolved, resolve

if TYPE_CHECKING:
    from automaton.documents.report_document import Block, ReportDocument
    from automaton.runs.headless import Outcome, Sampling
    from automaton.runs.simulation import Simulation
    from automaton.tables.table_run import TableRun

FORMS = {
    "csv": "as CSV files",
    "parquet": "as Parquet files, for pandas, polars or DuckDB",
    "xlsx": "as one workbook (needs fleet-automaton[excel])",
}


PROGRESS_INTERVAL_S = 2.0  # a tick that takes longer is named


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton run`."""
    add_scenario_arguments(parser)
    add_refinement_arguments(parser)
    parser.add_argument("--record", type=Path, metavar="FILE", help="record every tick in FILE")
    text = "stop at this tick at the latest"
    parser.add_argument("--until", type=whole("a tick", 1), metavar="TICK", help=text)
    add_timeout_argument(parser)
    parser.add_argument(
        "--every",
        metavar="PERIOD",
        help="split the report into periods of this length (ticks, or a time such as 15min); default: "
        "an hour",
    )
    add_table_arguments(parser)
    parser.add_argument(
        "--picture", action="store_true", help="draw the floor at the end of the run"
    )
    text = "with --picture, show a layer of the viewer: streets, visits, waiting, ..."
    parser.add_argument("--layer", default="", metavar="NAME", help=text)
    add_output_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run, report, and note on stderr why a run did not finish."""
    from automaton.runs.headless import run_once
    from automaton.runs.periods import ticks_of_period
    from automaton.runs.run_diagnosis import JamWatch, note_jam
    from automaton.runs.run_report import run_document

    output = output_of(args)
    if args.layer and not args.picture:
        raise InputError("--layer needs --picture")
    if args.layer:
        viewer("playback.film").check_layer(args.layer)
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
                drawn.append(draw(simulation, args.layer))
            if tables is not None:
                tables.finish(simulation)

        sampling = None if tables is None else tables.sampling
        sampling = observed(sampling) if args.layer else sampling
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
    """Pictures of the final state of a run."""

    picture: str  # the grid
    zones: str  # service zones and the work at stations; "" without either

    def as_json(self) -> dict[str, list[str]]:
        """The pictures for the JSON of the run."""
        zones = {"service_zones": self.zones.splitlines()} if self.zones else {}
        return {"picture": self.picture.splitlines(), **zones}

    def blocks(self) -> Iterator[Block]:
        """The grid; below it zones and stations, in the colors of the zones."""
        from automaton.documents.report_document import CharacterPicture, Text
        from strategies.zoning.service_zone_lines import coloured

        yield Text(self.picture, code=True)
        if self.zones:
            yield CharacterPicture(coloured(self.zones))


def observed(sampling: Sampling | None) -> Sampling:
    """Samples of a run that is observed, as layers need it."""
    from automaton.runs.headless import Sampling
    from automaton.runs.simulation import Simulation

    sampling = sampling or Sampling(0, lambda simulation: None, None)
    return sampling._replace(on_observe=sampling.on_observe or Simulation.empty_observation)


def draw(simulation: Simulation, layer: str) -> Drawn:
    """Draw the current state of a run, with a layer unless it is ""."""
    if layer:
        return Drawn(viewer("playback.film").layer_text(simulation, layer), "")
    from automaton.runs.pictures import picture_of
    from strategies.zoning.service_zone_lines import partition_picture

    zones = partition_picture(simulation.world, simulation.resolved.floor_plan)
    return Drawn(picture_of(simulation, brief=True), zones)


@contextlib.contextmanager
def recorder(path: Path | None, resolved: Resolved) -> Iterator[Any]:
    """The recorder that receives each tick, or None."""
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
    """Show the progress of a long run, even within a long tick; yields None without a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    limit = resolved.scenario.stop.max_duration
    watched: list[Simulation] = []
    last = [0, time.monotonic()]  # the tick, and since when

    def words() -> str:
        if not watched:
            return f"preparing {resolved.scenario.name}"
        simulation, now = watched[0], time.monotonic()
        if simulation.tick != last[0]:
            last[:] = simulation.tick, now
        if now - last[1] >= PROGRESS_INTERVAL_S:
            return f"computing tick {simulation.tick:,}"
        from automaton.runs.progress import asked_orders

        ends = asked_orders(simulation.world).done
        done = int((ends >= 0).sum())
        ticks = f"tick {simulation.tick:,} of at most {limit:,}"
        return f"{ticks}, {done:,} of {len(ends):,} orders delivered"

    def watch(simulation: Simulation) -> None:
        watched[:] = [simulation]

    show_line(words)
    try:
        yield watch
    finally:
        show_line("")


def refinement_of(resolved: Resolved) -> dict[str, Any]:
    """The refinement of ticks; {} without one."""
    scenario = resolved.scenario
    return {} if scenario.refine == 1 else {"refine": scenario.refine, "decide": scenario.decide}


def as_json(resolved: Resolved, outcome: Outcome) -> dict[str, Any]:
    """The run as one object; times are in ticks, in `metrics_in_units` in the scenario's units."""
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
        **({"order_file": resolved.days[resolved.day].name} if resolved.day_pattern else {}),
        **({"skipped_rows": skipped} if (skipped := resolved.skipped_rows) else {}),
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
        **({"classes": list(outcome.classes)} if outcome.classes else {}),
        "deadlock": None if outcome.deadlock is None else outcome.deadlock._asdict(),
        "illegal_decisions": outcome.illegal.as_json(),
        "robot_time": dict(outcome.uses),
        "bottleneck": bottleneck_sentences(resolved, outcome.periods),
        **({"periods": [one.as_json() for one in outcome.periods]} if outcome.by_period else {}),
        **({"metrics_in_units": told} if told else {}),
    }


# Tables of a run in a folder, and printed events.


def add_table_arguments(parser: argparse.ArgumentParser) -> None:
    """The tables of a run and their format: `csv`, `parquet`, `xlsx`, `states`, `events`."""
    forms = parser.add_mutually_exclusive_group()
    for form, what in FORMS.items():
        text = f"write tables of orders, lines, trips, robots and stations to a new folder, {what}"
        forms.add_argument(f"--{form}", type=Path, metavar="DIR", help=text)
    parser.add_argument(
        "--states",
        metavar="PERIOD",
        help="sample robot states every PERIOD (ticks, or a time such as 10s), and add tables of these "
        "states and of cells",
    )
    parser.add_argument(
        "--events",
        action="store_true",
        help="print all events; with --csv, --parquet or --xlsx, write tables of events and of "
        "cells instead",
    )


@contextlib.contextmanager
def written_tables(
    args: argparse.Namespace, resolved: Resolved
) -> Iterator[TableRun | EventLines | None]:
    """The writer of the requested tables, the collector of events to print, or None."""
    folders = {form: getattr(args, form) for form in FORMS}
    form = next((form for form, folder in folders.items() if folder is not None), None)
    if form is None:
        if args.states is not None:
            raise InputError("--states needs a folder: add --csv, --parquet or --xlsx DIR")
        yield EventLines() if args.events else None
        return
    from automaton.tables.table_run import WantedTables, table_run

    options = WantedTables(args.states, args.events, folder=folders[form], form=form)
    with table_run(resolved, options, args.until) as tables:
        yield tables


class EventLines:
    """Collects the events of a run (only the last ones of a long run) and prints a line for each."""

    def __init__(self) -> None:
        from automaton.history.event_history import EventHistory
        from automaton.runs.headless import Sampling

        self._history = EventHistory()
        self._rows: list[dict[str, Any]] = []
        self._has_trips = False
        self.sampling = Sampling(0, lambda simulation: None, self._history)

    def finish(self, simulation: Simulation) -> None:
        """Read the events at the end of the run."""
        from automaton.runs.illegal_decisions import explainer
        from automaton.tables.columns import rows_as_objects
        from automaton.tables.rows import event_form, event_rows

        events = self._history.events
        self._rows = rows_as_objects(
            event_form(simulation.resolved), event_rows(simulation, events)
        )
        explain = explainer(simulation.world, simulation.resolved.floor_plan)
        for row, event in zip(self._rows, events.tolist(), strict=True):
            if row["rule"] is not None:
                row["sentence"] = explain(event[0], *event[2:]).words
        self._has_trips = simulation.resolved.scenario.orders.lines is not None

    def as_json(self) -> dict[str, Any]:
        """The events for the JSON of the run."""
        return {"events": [_named(row, self._has_trips) for row in self._rows]}

    def blocks(self) -> Iterator[Block]:
        """One line for each event."""
        from automaton.documents.report_document import Text

        dropped = self._history.log.dropped
        first = [f"{count(dropped, 'earlier event')} not shown"] if dropped else []
        lines = first + [_line(row, self._has_trips) for row in self._rows]
        yield Text("\n".join(lines), code=True)


def _named(row: dict[str, Any], has_trips: bool) -> dict[str, Any]:
    """An event, with `order` renamed `trip` if robots take trips."""
    return {"trip" if has_trips and key == "order" else key: row[key] for key in row}


def _line(row: dict[str, Any], has_trips: bool) -> str:
    parts = [f"tick {row['tick']:>7,}  {row['event']:<16}"]
    names = {"robot": "robot", "order": "trip" if has_trips else "order"}
    parts += [f"{name} {row[key]}" for key, name in names.items() if row[key] is not None]
    if row["rule"] is not None:
        return "  ".join([*parts, f"{row['rule'].partition(':')[0]}: {row['sentence']}"])
    if row["value"] is not None:
        parts.append(f"{row['value']:g}")
    if row["x"] is not None:
        parts.append(f"at ({row['x']}, {row['y']})")
    return "  ".join(parts).rstrip()
