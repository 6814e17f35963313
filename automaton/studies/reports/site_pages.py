"""What a report says about the site: its picture, its inputs, its results by hour, deadlocks and maps.

Inputs are the settings of a scenario as written, with the levels of a study and with rounding errors.
Results by hour are means over the complete runs of a point. Maps come from the repetition of a run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

import msgspec
import numpy as np

from automaton.documents.report_document import (
    Block,
    Curves,
    Heading,
    HeatMap,
    Panels,
    ReportCurve,
    ShareBars,
    SvgDrawing,
    Table,
    Text,
)
from automaton.engine.observation import LOST_EVER, visits_of
from automaton.engine.state import NIL, Array
from automaton.errors import InputError
from automaton.floor.floor_plan import CELL_KINDS, DRIVABLE
from automaton.runs.bottleneck import flow_name, joined, rate_unit
from automaton.runs.headless import attribute_strategy_errors
from automaton.runs.metric_catalogue import (
    OF_DELIVERED_ORDERS,
    TIME_TITLE,
    UNEQUAL_SHARE,
    mean_time_shares,
    time_shares,
    units_of,
)
from automaton.runs.periods import (
    Period,
    kept_period,
    kept_periods,
    mean_period,
    moment,
    ticks_of_period,
)
from automaton.runs.run_report import OPTIONAL_COLUMNS, periods_table, shown_columns, time_text
from automaton.runs.simulation import Simulation, empty_floor
from automaton.scenario.order_lines import listed_lines
from automaton.studies.reports.comparisons import point_name, setting_text
from automaton.studies.reports.metric_tables import Scenarios
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import PERIODS_COLUMN, USES_COLUMN, Point
from automaton.units import Unit, count, duration, number, unit
from automaton.world.conversion_table import roundings, tick_values
from automaton.world.resolved import Resolved

Record = dict[str, Any]
MAX_SITES: Final = 3  # tables of inputs
MAX_POINTS_READ: Final = 100  # whose settings are compared
MAX_ENTRIES: Final = 6  # of a list that is printed
MAX_PERIODS_SHOWN: Final = 24
MAX_HOURLY_POINTS: Final = 4
MAX_TIME_POINTS: Final = 8
MAX_DEADLOCKED: Final = 4  # points in a sentence
SECTIONS: Final = (
    *("units", "fleet", "durations", "orders", "pods", "stations", "battery", "faults", "areas"),
    *("floor", "strategy", "world", "stop", "measure"),
)
LEAST_ERROR: Final = 0.01  # of a rounded value, from which it is printed
WITH_DEFAULTS: Final = ("durations", "strategy")  # sections of which all values are shown
PLACE_KEYS: Final = ("at", "queue", "start", "list")  # cells of the floor, which the picture shows
UNMARKED: Final = ("wall", "floor", "track", "turntable")  # kinds of cells that are not counted


# The picture of the site.


def site_picture(results: Results, scenarios: Scenarios) -> Iterator[Block]:
    """The floor of the first point without robots; nothing if its scenario is missing."""
    resolved = scenarios.get(0)
    if resolved is None:
        return
    sites = list(dict.fromkeys(point.scenario for point in results.points))
    name = sites[0] if len(sites) == 1 else f"{sites[0]}, the first of {len(sites)} scenarios"
    yield SvgDrawing(empty_floor(resolved).svg, f"{name}: {size_text(resolved)}")


def size_text(resolved: Resolved) -> str:
    """The size of a floor: "60 x 40 cells of 1.2 m (72 x 48 m)"."""
    plan, cell = resolved.floor_plan, resolved.unrefined.scenario.units.cell
    text = f"{plan.width:,} x {plan.height:,} cells"
    if cell is None:
        return text
    side = unit(cell)
    sides = " x ".join(number(side.of(cells)) for cells in (plan.width, plan.height))
    return f"{text} of {cell} ({sides} {side.name})"


# The inputs.


def inputs_section(results: Results, scenarios: Scenarios) -> Iterator[Block]:
    """One table of settings for each scenario of a study; nothing if they are missing."""
    sites: dict[str, list[Resolved]] = {}
    for point in results.points[:MAX_POINTS_READ]:
        if point.number in scenarios:
            sites.setdefault(point.scenario, []).append(scenarios[point.number].unrefined)
    if sites:
        yield Heading("Inputs")
    for name, resolved in list(sites.items())[:MAX_SITES]:
        yield from [Heading(name, 3)] if len(sites) > 1 else []
        yield Table(("input", "value"), input_rows(resolved), left=2)
    if len(sites) > MAX_SITES:
        yield Text(f"Inputs of {len(sites) - MAX_SITES:,} more scenarios are not shown.")


def input_rows(points: Sequence[Resolved]) -> list[list[str]]:
    """The settings of the points of one scenario; values of a setting that differ are listed."""
    plan = points[0].floor_plan
    kinds = [(kind.name, int((plan.kind == kind.code).sum())) for kind in CELL_KINDS]
    rows = [["floor", size_text(points[0])]]
    rows += [[f"cells: {name}", f"{n:,}"] for name, n in kinds if n and name not in UNMARKED]
    every = [inputs_of(resolved) for resolved in points]
    keys = dict.fromkeys(key for inputs in every for key in inputs)
    for key in sorted(keys, key=lambda key: SECTIONS.index(key.partition(".")[0])):
        texts = list(dict.fromkeys(inputs[key] for inputs in every if key in inputs))
        varied = "varied: " if len(texts) > 1 else ""
        some = "" if all(key in inputs for inputs in every) else "at some points: "
        rows.append([key, f"{some or varied}{', '.join(texts)}"])
    return rows


def inputs_of(resolved: Resolved) -> dict[str, str]:
    """The settings of a scenario by key, in the units in which they are written."""
    scenario = resolved.scenario
    texts = {one.key: one.text for one in resolved.conversions}
    tick = units_of(resolved)[0]
    for one in roundings(resolved):
        if not one.conversion.is_moment and abs(one.error) >= LEAST_ERROR:
            texts[one.conversion.key] += f" (simulated {one.difference(tick)})"
    texts = {key: tick_text(ticks, tick) for key, ticks in tick_values(scenario).items()} | texts
    inputs = {}
    for section in SECTIONS:
        for key, value in settings_in(getattr(scenario, section), section):
            inputs[key] = input_text(key, value, texts)
    inputs |= lines_of_days(resolved)
    return with_equal_joined(inputs, scenario.stations)


def input_text(key: str, value: Any, texts: Mapping[str, str]) -> str:
    """A setting as it is written; `texts`: those with units, also inside lists, by key."""
    if key in texts:
        return texts[key]
    if isinstance(value, tuple) and any(inner.startswith(f"{key}[") for inner in texts):
        parts = [input_text(f"{key}[{place}]", inner, texts) for place, inner in enumerate(value)]
        return f"[{', '.join(parts)}]" if len(parts) <= MAX_ENTRIES else value_text(value)
    return value_text(value)


def lines_of_days(resolved: Resolved) -> dict[str, str]:
    """The number of lines or orders of the files from which a seed draws one, by key."""
    several = {
        "orders.lines": [len(listed_lines(day.orders)) for day in resolved.days],
        "orders.transports": [len(day.orders.listed or ()) for day in resolved.days],
    }
    return {
        key: f"{count(len(sizes), 'file')} of {resolved.day_pattern}, {range_text(sizes)} lines"
        for key, sizes in several.items()
        if resolved.day_pattern and any(sizes)
    }


def range_text(numbers: Sequence[int]) -> str:
    """The least and the largest of some numbers: "470 to 701"."""
    least, most = min(numbers), max(numbers)
    return f"{least:,}" if least == most else f"{least:,} to {most:,}"


def tick_text(ticks: float, tick: Unit) -> str:
    """A number of ticks in the unit of the site: "22 cycles", "1 cycle"."""
    return f"1 {tick.name}" if tick.of(ticks) == 1 else time_text(ticks, tick)


def settings_in(value: Any, key: str) -> Iterator[tuple[str, Any]]:
    """The settings of a section with their keys, without defaults."""
    if is_struct(value):
        for field in msgspec.structs.fields(value):
            inner = getattr(value, field.name)
            if field.encode_name not in PLACE_KEYS and (
                key in WITH_DEFAULTS or inner != default_of(field)
            ):
                yield from settings_in(inner, f"{key}.{field.encode_name}")
    elif isinstance(value, Mapping) and "name" not in value:
        for name, inner in value.items():
            yield from settings_in(inner, f"{key}.{name}")
    elif isinstance(value, tuple) and 0 < len(value) <= MAX_ENTRIES and is_struct(value[0]):
        for place, inner in enumerate(value):
            yield from settings_in(inner, f"{key}[{place}]")
    elif value not in (None, "", "none", (), {}):
        yield key, value


def is_struct(value: Any) -> bool:
    """Whether a value is a section of a scenario."""
    return isinstance(value, msgspec.Struct)


def default_of(field: Any) -> Any:
    """The default of a field of a scenario; None if it must be given."""
    if field.default is not msgspec.NODEFAULT:
        return field.default
    return None if field.default_factory is msgspec.NODEFAULT else field.default_factory()


def value_text(value: Any) -> str:
    """A setting as in a file; of a long list, the number of its entries."""
    if isinstance(value, Sequence) and not isinstance(value, str) and len(value) > MAX_ENTRIES:
        return count(len(value), "entry", "entries")
    if isinstance(value, Mapping):
        return ", ".join(
            str(one) if key == "name" else f"{key} {one}" for key, one in value.items()
        )
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return number(value) if is_number else setting_text(msgspec.to_builtins(value))


def with_equal_joined(inputs: Mapping[str, str], names: Iterable[str]) -> dict[str, str]:
    """Settings that all stations share, once for all."""
    stations = {f"stations.{name}.": name for name in names}
    joined_inputs: dict[str, str] = {}
    for key, text in inputs.items():
        first = next((start for start in stations if key.startswith(start)), "")
        rest = key.removeprefix(first)
        if first and all(inputs.get(f"{start}{rest}") == text for start in stations):
            key = f"stations.{rest}"
        joined_inputs[key] = text
    return joined_inputs


# Results by hour: means over the complete runs of a point.


def hours_section(
    results: Results, scenarios: Scenarios, points: Sequence[Point], every: str | None
) -> Iterator[Block]:
    """Small charts for each scenario of these points, and a table for each point.

    Raises InputError for a period that runs do not have.
    """
    sites: dict[str, list[tuple[Point, list[Period]]]] = {}
    for point in points:
        periods = mean_periods(runs_by_period(results, scenarios, point, every))
        if len(periods) > 1:
            sites.setdefault(point.scenario, []).append((point, periods))
    if not sites:
        if every is not None:
            raise InputError(
                f"--every {every}: no run has two such periods; they need a tick that is a time "
                "(units.tick)"
            )
        return
    has = {name for name in OPTIONAL_COLUMNS if results.has(name)}
    for place, (name, shown) in enumerate(list(sites.items())[:MAX_SITES]):
        shown = shown[:MAX_HOURLY_POINTS]
        resolved = scenarios[shown[0][0].number]
        flow, length = flow_name(resolved), time_text(shown[0][1][0].ticks, units_of(resolved)[0])
        by = "hour" if length in ("1 h", "60 min") else length
        yield Heading(f"Results by {by}{f', {name}' if len(sites) > 1 else ''}")
        if place == 0:
            yield Text(
                "Means over the complete runs of the points of the decision that reach the period: "
                f"{flow} done {rate_unit(resolved)}, {flow} open at its end, numbers of robots, and "
                "the share of time in which stations and chargers are busy."
            )
        yield panels(results, resolved, shown, has)
        for point, periods in shown:
            yield Heading(point_name(results.study, point), 3)
            yield periods_table(scenarios[point.number], periods, has)


def time_section(results: Results, points: Sequence[Point]) -> Iterator[Block]:
    """Where the time of the robots went at some points: a bar and a line of a table for each."""
    bars = []
    for point in points[:MAX_TIME_POINTS]:
        stored = results.stored(point, USES_COLUMN)
        uses = [dict(one.as_py()) for is_complete, one in stored if is_complete and one is not None]
        runs = [time_shares(one) for one in uses if one]
        bars += [(point_name(results.study, point), mean_time_shares(runs))] if runs else []
    if not bars:
        return
    yield Heading(TIME_TITLE[0].upper() + TIME_TITLE[1:])
    yield Text("Shares of the robots' time in whole runs: means over the complete runs of a point.")
    block = ShareBars(TIME_TITLE, bars)
    yield from (block, block.table)


def panels(
    results: Results, resolved: Resolved, shown: Sequence[tuple[Point, list[Period]]], has: set[str]
) -> Panels:
    """A small chart for each column of the table, with a line for each point of a scenario."""
    longest = max((periods for _, periods in shown), key=len)
    names = [one.name for one in longest]
    charts = []
    for column in shown_columns(resolved, longest, has):
        lines = []
        for point, periods in shown:
            values, none = [column.value(one) for one in periods], [math.nan] * len(periods)
            x = list(range(len(periods)))
            lines.append(ReportCurve(point_name(results.study, point), x, values, none, none))
        title, unit = column.head, column.unit
        charts.append(Curves(title, "from", unit, lines, names, from_zero=True, is_in_order=True))
    return Panels(f"Results by hour, {shown[0][0].scenario}", charts)


def mean_periods(runs: Sequence[Sequence[Period]]) -> list[Period]:
    """The means of the periods of some runs, each of the runs that come to it."""
    most = max(map(len, runs), default=0)
    return [mean_period([run[k] for run in runs if len(run) > k]) for k in range(most)]


def runs_by_period(
    results: Results, scenarios: Scenarios, point: Point, every: str | None
) -> list[list[Period]]:
    """The periods of each complete run of a point. Raises InputError."""
    resolved = scenarios.get(point.number)
    quarter = 0 if resolved is None else kept_period(resolved)
    stored = results.stored(point, PERIODS_COLUMN) if quarter else []
    if resolved is None or not stored:
        return []
    columns = [column.as_py() for is_complete, column in stored if is_complete]
    runs = [kept_periods(resolved, one) for one in columns if one is not None]
    ticks = ticks_of_period(resolved, every)
    if every is None:
        longest = max((run[-1].end for run in runs), default=0)
        many = -(-longest // (ticks * MAX_PERIODS_SHOWN)) or 1
        ticks = ticks * many if longest >= 2 * ticks else quarter
    if ticks % quarter:
        shortest = time_text(quarter, units_of(resolved)[0])
        raise InputError(
            f"--every {every}: the runs were counted in periods of {shortest}; give a multiple of it"
        )
    many = ticks // quarter
    return [[joined(run[at : at + many]) for at in range(0, len(run), many)] for run in runs]


def period_records(results: Results, scenarios: Scenarios, every: str | None) -> Iterator[Record]:
    """One record for each point and period, in ticks of the scenario, robots and shares."""
    for point in results.points:
        runs = runs_by_period(results, scenarios, point, every)
        refine = scenarios[point.number].scenario.refine if runs else 1
        for k, one in enumerate(mean_periods(runs)):
            row = {"point": point.number, "point_name": point_name(results.study, point)}
            row |= {"runs": sum(len(run) > k for run in runs), "from": one.name}
            for name, value in one.as_json().items():
                if name.endswith("queues") and isinstance(value, list):
                    continue
                row[name] = (sum(value) if value else None) if isinstance(value, list) else value
            row |= {"begin": one.begin // refine, "end": one.end // refine}
            del row["name"], row["places"]
            yield row


# Deadlocks.


def deadlock_remarks(results: Results, scenarios: Scenarios) -> Iterator[str]:
    """A sentence about deadlocks: where, the longest one, and whether the means include these runs."""
    names = ("deadlocks", "longest_standstill", "standstill_at", "standstill_from", "seed")
    if by_point := affected(results, *names):
        yield (
            f"deadlocks in {affected_text(results, by_point)}. "
            f"{longest_text(results, scenarios, by_point)} "
            f"{included_text([run for _, own in by_point for run in own])}"
        )


def delivery_remarks(results: Results) -> Iterator[str]:
    """The caveat that points deliver different shares of their orders, if a metric is of those only."""
    shares = unequal_shares(results)
    metrics = ", ".join(name for name in results.reported if name in OF_DELIVERED_ORDERS)
    if shares and metrics:
        worst, best = (
            f"{100 * shares[number]:.0f} % with {point_name(results.study, results.points[number])}"
            for number in sorted(shares, key=shares.__getitem__)[:: len(shares) - 1]
        )
        yield (
            f"points deliver different shares of their orders, {worst} and {best}: {metrics} count "
            "delivered orders only, so a point that leaves orders open looks better; compare delivered "
            "and oldest_order as well"
        )


def unequal_shares(results: Results) -> dict[int, float]:
    """The share of orders that each point delivered; empty if all are about equal.

    Not of a steady state, where the orders of the warm-up do not count.
    """
    shares = {}
    for point in results.points if results.cut is None else ():
        orders = sum(results.values(point, "orders").values())
        if orders:
            shares[point.number] = sum(results.values(point, "delivered").values()) / orders
    is_unequal = shares and max(shares.values()) - min(shares.values()) >= UNEQUAL_SHARE
    return shares if is_unequal else {}


def jam_remarks(results: Results) -> Iterator[str]:
    """A sentence about jams: where, and the first one in words."""
    if by_point := affected(results, "jam", "seed"):
        point, ((_, words, seed), *_) = by_point[0]
        yield (
            f"jams in {affected_text(results, by_point)}. One of them: "
            f"{point_name(results.study, point)}, seed {seed}, {words}"
        )


Affected = list[tuple[Point, list[tuple[Any, ...]]]]  # points and their runs


def affected(results: Results, *names: str) -> Affected:
    """The points with runs whose first of these columns is set, and these runs, most runs first."""
    by_point = [
        (point, runs)
        for point in results.points
        if (runs := [run for run in results.stored(point, *names) if run[1]])
    ]
    return sorted(by_point, key=lambda one: -len(one[1]))


def affected_text(results: Results, by_point: Affected) -> str:
    """Such as "3 of 20 runs: today (2 of 10 runs); robots 12 (1 of 10 runs)"."""
    done = sum(results.counts(point).done for point in results.points)
    where = [
        f"{point_name(results.study, point)} ({len(own):,} of "
        f"{count(results.counts(point).done, 'run')})"
        for point, own in by_point[:MAX_DEADLOCKED]
    ]
    more = len(by_point) - len(where)
    rest = f"; and {count(more, 'more point')}" if more else ""
    runs = sum(len(own) for _, own in by_point)
    return f"{runs:,} of {count(done, 'run')}: {'; '.join(where)}{rest}"


def longest_text(results: Results, scenarios: Scenarios, by_point: Affected) -> str:
    """The longest deadlock of all runs, with its place and time."""
    point, run = max(
        ((point, run) for point, runs in by_point for run in runs), key=lambda one: one[1][2] or 0
    )
    _, _, ticks, cell, begin, seed = run
    lasted, name = duration(ticks or 0, results.units.tick)
    text = f"The longest lasted {number(lasted)} {name}"
    if cell is not None:
        resolved = scenarios.get(point.number)
        when = f"tick {begin:,}" if resolved is None else moment(resolved.unrefined, begin)
        text += f" at {cell} from {when}"
    return f"{text} ({point_name(results.study, point)}, seed {seed})."


def included_text(runs: Sequence[tuple[Any, ...]]) -> str:
    """Whether the means include runs with deadlocks."""
    complete = sum(bool(run[0]) for run in runs)
    if complete == len(runs):
        return "The means include these runs"
    if not complete:
        return "None of these runs is complete: the means exclude them"
    return f"The means include the {complete:,} of these runs that are complete"


# Maps of lost time and visits at a design point, from the repetition of one of its runs.


def floor_maps(
    resolved: Resolved, seed: int, digest: str, name: str, after: int = 0
) -> Iterator[HeatMap]:
    """Maps of the lost robot time and the visits of each cell, in the ticks after tick `after`.

    `digest`: digest of the run in the results; a note reports a repetition with another digest.
    """
    with attribute_strategy_errors(resolved):
        simulation = Simulation(resolved, seed, on_observe=Simulation.empty_observation)
        simulation.run(after)
        before = observed(simulation)
        simulation.run()
    grid = simulation.world.grid
    lost, in_zone, visits = (
        now - then for now, then in zip(observed(simulation), before, strict=True)
    )
    ticks = (
        f"{simulation.tick:,} ticks" if not after else f"ticks {after + 1:,} to {simulation.tick:,}"
    )
    note = f"One run, seed {seed}, {ticks}"
    if simulation.digest != digest:
        note += "; the current code gives a different result than the study"
    zone = grid.traffic_zone.max(axis=1)
    slowed = np.where(zone == NIL, 0.0, by_cell(in_zone, zone))
    yield time_map(resolved, f"Lost time, {name}", "", lost, note)
    if slowed.any():
        yield time_map(resolved, f"Reduced speed, {name}", " by cell of a zone", slowed, note)
    yield heat_map(resolved, f"Visits, {name}", "robots", visits, note)


def time_map(resolved: Resolved, title: str, what: str, ticks: Array, note: str) -> HeatMap:
    """A map of robot time, in the unit that suits its largest value."""
    most = float(ticks.max(initial=0)) or 1.0
    amount, name = duration(most, units_of(resolved)[0])
    return heat_map(resolved, title, f"robot {name}{what}", ticks * (amount / most), note)


def heat_map(resolved: Resolved, title: str, name: str, values: Array, note: str) -> HeatMap:
    """A map of the floor with axes in metres, or in cells without a size."""
    cell = units_of(resolved)[1]
    side, axis = (1.0, "cells") if cell is None else (cell.size, cell.name)
    return HeatMap(title, name, laid_out(resolved, values), note, axis, side)


def observed(simulation: Simulation) -> tuple[Array, Array, Array]:
    """Lost robot ticks by cell, ticks at reduced speed by zone, and visits by cell, all so far."""
    grid, observation = simulation.world.grid, simulation.observation
    return (
        observation.lost_ticks_by_cell[:, LOST_EVER].astype(np.float64),
        observation.lost_in_zone.astype(np.float64),
        visits_of(observation.flow, grid.offset).astype(np.float64),
    )


def lost_and_visits(resolved: Resolved, seeds: Sequence[int]) -> Array:
    """(2, C) lost robot ticks, in ticks of the scenario, and visits by cell; the mean of runs."""
    sums: Array = np.zeros((2, resolved.floor_plan.kind.size))
    for seed in seeds:
        with attribute_strategy_errors(resolved):
            simulation = Simulation(resolved, seed, on_observe=Simulation.empty_observation)
            simulation.run()
        lost, _, visits = observed(simulation)
        sums += lost / resolved.scenario.refine, visits
    return sums / len(seeds)


def by_cell(lost: Array, zone: Array) -> Array:
    """(C,) ticks of each zone, spread evenly over its cells."""
    cells = np.bincount(zone[zone != NIL], minlength=len(lost))
    shared: Array = (lost / np.maximum(cells, 1))[np.maximum(zone, 0)]
    return shared


def laid_out(resolved: Resolved, values: Array) -> Array:
    """(height, width) values of cells; NaN where robots cannot drive."""
    floor_plan = resolved.floor_plan
    field = np.where(DRIVABLE[floor_plan.kind.reshape(-1)], values, np.nan)
    inner: Array = field.reshape(floor_plan.kind.shape)[1:-1, 1:-1]
    return inner
