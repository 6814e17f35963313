"""Bottlenecks: what single changes of a scenario are worth, compared in pairs of runs with equal seeds.

    candidate  a setting that the scenario allows: a faster station, one more charger, one robot more, ...
    screening  some pairs of runs for each candidate
    confirmed  the FINALISTS best and all that may be as good, by runs with fresh seeds

Effects, intervals (Bonferroni) and p values (Holm) come from the fresh seeds alone, so selection by the
screening does not bias them. Robots may lose no time at a bottleneck, because a detour causes no
queue: the ticks lost near a change are listed beside its effect, not used to rank it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.engine.observation import LOST_EVER
from automaton.engine.state import Array
from automaton.errors import InputError
from automaton.floor.cells import CHARGER
from automaton.floor.floor_plan import FloorPlan
from automaton.runs.headless import attribute_strategy_errors
from automaton.runs.simulation import Simulation
from automaton.scenario.changing_floor import cells_of_set
from automaton.scenario.document import Override, keys_of
from automaton.scenario.durations import Handling
from automaton.scenario.orders import OrderStop
from automaton.studies.inference.intervals import (
    Effect,
    bonferroni,
    effect,
    holm,
)
from automaton.studies.reports.comparisons import compared_runs
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.named_changes import Levels, NamedChange
from automaton.studies.sweeps.run_keys import fingerprint
from automaton.studies.sweeps.study import Point
from automaton.studies.sweeps.sweep_plan import resolve_changes
from automaton.world.fleet_warnings import places_of
from automaton.world.resolve import Resolved, resolve

PLACE, STATION, ENERGY, FLEET = KINDS = ("place", "station", "energy", "fleet")
UNNAMEABLE: Final = "--set cannot name a station whose name has a dot or '='"
OWN: Final = "own"  # the kind of the changes in a file
NEAR: Final = 3  # cells, in rows and in columns
LOOKED_AT: Final = 5  # runs of the unchanged scenario in which lost time is located
FINALISTS: Final = 8
MAX_FINALISTS: Final = 24
SCREENING_LEVEL: Final = 0.99  # of the intervals that decide who may be among the best
ERROR: Final = 0.05  # of all verdicts together
JAMMED_ROBOTS: Final = 2  # without progress at the end of a run that has had a deadlock

CHANGES_NOTHING: Final = "changes nothing"
JAMS: Final = "jams"
TOO_FEW: Final = "too few pairs"
SCREENED: Final = "screened"
CONFIRMED: Final = "confirmed"


class CandidateChange(NamedTuple):
    """A change that a scenario may allow."""

    kind: str
    name: str
    settings: Levels
    cells: tuple[int, ...] = ()  # flat cells of the changed part of the floor; (): it has no place
    objection: str = ""  # why it cannot be tried

    @property
    def overrides(self) -> tuple[Override, ...]:
        """The settings as on the command line."""
        return tuple(Override(key, keys_of(key), value) for key, value in self.settings.items())


class CandidateList(NamedTuple):
    """The changes of a scenario: tried, impossible, and left out because there are too many."""

    tried: tuple[CandidateChange, ...]
    refused: tuple[tuple[CandidateChange, str], ...]  # with the reason
    left_out: int


# The changes that a scenario allows, by kind.


def place_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Each door kept open, one more robot in each block, each speed limit lifted."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    for number, door in enumerate(scenario.floor.doors):
        key, (x, y) = f"floor.doors.{number}", door.at
        opened = {f"{key}.opening_time": 1, f"{key}.hold_open": scenario.stop.max_duration}
        name = f"door [{x}, {y}] stays open"
        yield CandidateChange(PLACE, name, opened, (floor_plan.cell(x, y),))
    # The world itself limits chargers for two robots by blocks.
    chargers = set(np.flatnonzero(floor_plan.kind == CHARGER).tolist())
    for number, block in enumerate(scenario.floor.blocks):
        cells = tuple(cells_of_set("", block.cells, floor_plan))
        if not set(cells) <= chargers:
            most = block.max_robots + 1
            settings = {f"floor.blocks.{number}.max_robots": most}
            yield CandidateChange(PLACE, f"block {number + 1}: {most} robots", settings, cells)
    for number, limit in enumerate(scenario.floor.speed_limits):
        cells = tuple(cells_of_set("", limit.cells, floor_plan))
        settings = {f"floor.speed_limits.{number}.max_speed": 1}
        yield CandidateChange(PLACE, f"speed limit {number + 1} lifted", settings, cells)


def station_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Each station in half the time, each with one more place, and one more station if one is closed."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    usual = scenario.durations.handling
    for name, station in scenario.stations.items():
        key, cells = f"stations.{name}", (floor_plan.cell(*station.at),)
        rest = (cells, UNNAMEABLE if "." in name or "=" in name else "")
        if (station.handling or usual) != Handling():
            faster = {f"{key}.handling": half_handling(station.handling or usual)}
            yield CandidateChange(STATION, f"station {name}: handling x 0.5", faster, *rest)
        most = places_of(floor_plan, station)
        if most is not None:
            wider: Levels = {f"{key}.max_trips": most + 1}
            yield CandidateChange(STATION, f"station {name}: {most + 1} trips", wider, *rest)
    if usual != Handling() and len(scenario.stations) < len(floor_plan.stations):
        settings = {"durations.handling": half_handling(usual)}
        yield CandidateChange(STATION, "stations: handling x 0.5", settings)
    yield from processing_changes(resolved)
    yield from service_changes(resolved)
    if scenario.floor.open_stations is not None:
        opened: Levels = {"floor.open_stations": scenario.floor.open_stations + 1}
        yield CandidateChange(STATION, "one more station", opened)


def processing_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Each station that processes parts, in half the time."""
    orders, stations = resolved.scenario.orders, resolved.floor_plan.stations.tolist()
    times: Any = msgspec.to_builtins(orders.processing_time)
    for number in sorted({one for kind in orders.parts or () for one in kind.route}):
        own = times[number - 1] if isinstance(times, tuple) else times
        shorter = {**own, "mean": max(1.0, own["mean"] / 2)} if isinstance(own, dict) else half(own)
        if isinstance(times, tuple):
            settings = {f"orders.processing_time.{number - 1}": shorter}
        else:
            each = [shorter if one == number else own for one in range(1, len(stations) + 1)]
            settings = {"orders.processing_time": each}
        name = f"station {number}: processing x 0.5"
        yield CandidateChange(STATION, name, settings, (stations[number - 1],))


def service_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """The stops of listed orders at each cell, in half the time."""
    by_cell: dict[tuple[int, int], Levels] = {}
    orders = resolved.scenario.orders.listed or ()
    for number, order in enumerate(orders if resolved.order_file is None else ()):
        for place, stop in enumerate(order.stops or ()):
            if isinstance(stop, OrderStop) and stop.ticks > 1 and not isinstance(stop.at, str):
                settings = by_cell.setdefault((stop.at[0], stop.at[1]), {})
                settings[f"orders.list.{number}.stops.{place}.for"] = half(stop.ticks)
    for (x, y), settings in by_cell.items():
        name, cells = f"stops at [{x}, {y}] x 0.5", (resolved.floor_plan.cell(x, y),)
        yield CandidateChange(STATION, name, settings, cells)


def energy_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Charging at twice the rate, one more charger if one is closed, batteries twice as large.

    Charge and rates are shares of the capacity: a battery twice as large loses charge half as fast and
    gains it half as fast.
    """
    scenario = resolved.scenario
    if scenario.battery is None:
        return
    sections: list[tuple[str, Any]] = [("battery", scenario.battery)]
    for number, kind in enumerate(scenario.fleet.types):
        sections.append((f"fleet.types.{number}.battery", kind.battery))
    rates = {
        f"{key}.charge_rate": own.charge_rate
        for key, own in sections
        if own.charge_rate is not None
    }
    drain = {
        f"{key}.drain.{name}": scaled(rate, 0.5)
        for key, own in sections
        for name, rate in msgspec.structs.asdict(own.drain).items()
        if rate and name != "loaded_factor"
    }
    faster = {key: charging(rate, 2.0) for key, rate in rates.items()}
    yield CandidateChange(ENERGY, "charging rate x 2", faster)
    if scenario.floor.open_chargers is not None:
        settings = {"floor.open_chargers": scenario.floor.open_chargers + 1}
        yield CandidateChange(ENERGY, "one more charger", settings)
    slower = {key: charging(rate, 0.5) for key, rate in rates.items()}
    yield CandidateChange(ENERGY, "battery capacity x 2", {**drain, **slower})


def fleet_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Robots, speeds and handling times of each type, and the limits of allocation."""
    fleet, durations = resolved.scenario.fleet, resolved.scenario.durations
    for number, kind in enumerate(fleet.types) if fleet.types else [(None, None)]:
        key, of_type = f"fleet.types.{number}", f" of type {kind.name}" if kind else ""
        for step, word in ((-1, "fewer"), (1, "more")):
            settings: Levels = {"fleet.robots": fleet.robots + step}
            if kind is not None and kind.robots is not None:
                settings[f"{key}.robots"] = kind.robots + step
            yield CandidateChange(FLEET, f"one robot{of_type} {word}", settings)
        if kind is not None and kind.move_time_factor > 1:
            factor = kind.move_time_factor - 1
            settings = {f"{key}.move_time_factor": factor}
            yield CandidateChange(FLEET, f"type {kind.name}: move time factor {factor}", settings)
        else:
            own = kind and kind.durations.move
            where = "durations.move" if kind is None else f"{key}.durations.move"
            settings = halves({where: durations.move if own is None else own})
            yield CandidateChange(FLEET, f"moves{of_type} x 0.5", settings)
    for name in ("turn", "pick", "drop"):
        sections: list[tuple[str, Any]] = [("durations", durations)]
        sections += [(f"fleet.types.{k}.durations", t.durations) for k, t in enumerate(fleet.types)]
        settings = halves({f"{key}.{name}": getattr(part, name) for key, part in sections})
        yield CandidateChange(FLEET, f"{name}s x 0.5", settings)
    yield from limit_changes(resolved)


def limit_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """The number of robots with an order 10 % lower and higher, where the allocation limits it."""
    choices = [("strategy.allocation", "", resolved.strategies["allocation"])]
    choices += [
        (f"fleet.types.{number}.strategy.allocation", f" of type {kind.name}", own)
        for number, (kind, own) in enumerate(
            zip(resolved.scenario.fleet.types, resolved.own_allocations, strict=False)
        )
        if own is not None
    ]
    for key, of_type, choice in choices:
        limit = getattr(choice.parameters, "active", None)
        if limit:
            step = max(1, round(limit / 10))
            for value in (limit - step, limit + step):
                name = f"{value} active robots{of_type}"
                yield CandidateChange(FLEET, name, {f"{key}.active": value})


def halves(durations: Levels) -> Levels:
    """Settings with half of each duration, where that is another whole number of ticks."""
    plain = {key: msgspec.to_builtins(one) for key, one in durations.items() if one}
    return {key: half(one) for key, one in plain.items() if half(one) != one}


def half(ticks: Any) -> Any:
    """Half of a whole number of ticks, rounded up; of each part of a duration by load."""
    if isinstance(ticks, int):
        return (ticks + 1) // 2
    return {load: half(one) for load, one in ticks.items()}


def scaled(value: Any, factor: float) -> Any:
    """The numbers of a section times a factor, to six digits; keys without a value are left out."""
    if isinstance(value, msgspec.Struct):
        value = msgspec.to_builtins(value)
    if isinstance(value, Mapping):
        return {key: scaled(one, factor) for key, one in value.items() if one is not None}
    if isinstance(value, list | tuple):
        return [scaled(one, factor) for one in value]
    if isinstance(value, str):
        return value
    number = float(f"{factor * value:.6g}")
    return int(number) if number.is_integer() else number


def half_handling(handling: Handling) -> Levels:
    """Half of a handling time, without the parts that take no time."""
    return {part: one for part, one in scaled(handling, 0.5).items() if one}


def charging(rate: Any, factor: float) -> Any:
    """A charging rate, or a curve of [from, rate], times a factor."""
    if isinstance(rate, tuple):
        return [[since, scaled(one, factor)] for since, one in rate]
    return scaled(rate, factor)


BY_KIND: Final[Mapping[str, Callable[[Resolved], Iterator[CandidateChange]]]] = {
    PLACE: place_changes,
    STATION: station_changes,
    ENERGY: energy_changes,
    FLEET: fleet_changes,
}


def candidates_of(
    scenario: str,
    settings: Sequence[str | Override],
    own: Sequence[NamedChange],
    kinds: Sequence[str],
    most: int,
    lost: Array,
) -> CandidateList:
    """The changes to try: those of a file, those without a place, then by the time lost near them.

    `lost`: (C,) lost ticks of the scenario with its settings. Changes that would repeat a scenario
    are not tried. Raises InputError for a change of the file that cannot be run.
    """
    base = resolve(scenario, settings).unrefined
    tried: list[CandidateChange] = []
    refused: list[tuple[CandidateChange, str]] = []
    known = {fingerprint(base): ""}
    for change, resolved in zip(own, resolve_changes(scenario, settings, own), strict=True):
        first = known.setdefault(fingerprint(resolved.unrefined), change.name)
        if first != change.name and change.settings:
            text = f"'{first}' and '{change.name}' are the same scenario"
            raise InputError(text, *change.place)
        if change.settings:
            candidate = CandidateChange(OWN, change.name, change.settings)
            tried.append(placed(candidate, base, resolved))
    names = {one.name for one in own}
    further = [one for kind in KINDS if kind in kinds for one in BY_KIND[kind](base)]
    further = [one for one in further if one.settings and one.name not in names]
    plan = base.floor_plan
    further.sort(key=lambda one: -lost_near(plan, lost, one.cells) if one.cells else -math.inf)
    for number, candidate in enumerate(further):
        if len(tried) >= most:
            return CandidateList(tuple(tried), tuple(refused), len(further) - number)
        try:
            candidate, resolved = with_same_right_of_way(scenario, settings, base, candidate)
        except InputError as error:
            refused.append((candidate, error.message))
            continue
        mark = fingerprint(resolved)
        if mark not in known:
            known[mark] = candidate.name
            tried.append(placed(candidate, base, resolved))
    return CandidateList(tuple(tried), tuple(refused), 0)


def placed(candidate: CandidateChange, base: Resolved, changed: Resolved) -> CandidateChange:
    """A change with the cells whose kind it changes, unless its place is known."""
    now, then = changed.floor_plan.kind, base.floor_plan.kind
    if candidate.cells or now.shape != then.shape:
        return candidate
    return candidate._replace(cells=tuple(np.flatnonzero(now != then).tolist()))


def with_same_right_of_way(
    scenario: str, settings: Sequence[str | Override], base: Resolved, candidate: CandidateChange
) -> tuple[CandidateChange, Resolved]:
    """A change with its scenario, which keeps the right of way of the unchanged scenario.

    The default depends on durations and on the floor: without this, two things would change at once.
    Raises InputError.
    """
    if candidate.objection:
        raise InputError(candidate.objection)
    resolved = resolve(scenario, (*settings, *candidate.overrides)).unrefined
    own, now = (one.scenario.strategy.right_of_way for one in (base, resolved))
    if own != now:
        keeping = {**candidate.settings, "strategy.right_of_way": msgspec.to_builtins(own)}
        candidate = candidate._replace(settings=keeping)
        resolved = resolve(scenario, (*settings, *candidate.overrides)).unrefined
    return candidate, resolved


# Where the unchanged scenario loses time: what a heat map shows.


def lost_ticks(resolved: Resolved, seeds: Sequence[int]) -> Array:
    """(C,) lost robot ticks by cell, the mean over runs with these seeds, in ticks of the scenario."""
    total: Array = np.zeros(resolved.floor_plan.kind.size)
    for seed in seeds:
        with attribute_strategy_errors(resolved):
            simulation = Simulation(resolved, seed, on_observe=Simulation.empty_observation)
            simulation.run()
        total += simulation.observation.lost_ticks_by_cell[:, LOST_EVER]
    return total / (len(seeds) * resolved.scenario.refine)


def lost_near(floor_plan: FloorPlan, lost: Array, cells: Sequence[int]) -> float:
    """The lost ticks within NEAR rows and columns of some cells."""
    is_near, stride = np.zeros(floor_plan.kind.shape, np.bool_), floor_plan.kind.shape[1]
    for cell in cells:
        row, column = divmod(cell, stride)
        rows = slice(max(0, row - NEAR), row + NEAR + 1)
        is_near[rows, max(0, column - NEAR) : column + NEAR + 1] = True
    return float(lost[is_near.reshape(-1)].sum())


# Screening.


class ScreenedChange(NamedTuple):
    """A change after its runs with the first seeds; `gain`: above 0 if it makes the metric better."""

    number: int  # of its point
    status: str  # SCREENED, CONFIRMED, CHANGES_NOTHING, JAMS or TOO_FEW
    gain: float = math.nan
    high: float = math.nan  # upper end of the interval of the gain, at SCREENING_LEVEL


def screened(results: Results, metric: str, is_higher_better: bool) -> list[ScreenedChange]:
    """Every change against the first point, which is the unchanged scenario."""
    base, *points = results.points
    jams = jammed_runs(results, base)
    outcomes = []
    for point in points:
        status = status_of(results, point, metric, jams)
        gain = ScreenedChange(point.number, status)
        if status == SCREENED:
            found = paired(results, point, base, metric, SCREENING_LEVEL).difference
            assert found.half is not None
            value = found.value if is_higher_better else -found.value
            gain = gain._replace(gain=value, high=value + found.half)
        outcomes.append(gain)
    return outcomes


def status_of(results: Results, point: Point, metric: str, jams: int) -> str:
    """Whether a point can be compared with the first, of which so many runs jam."""
    base = results.points[0]
    if results.same(point, base, metric):
        return CHANGES_NOTHING
    if jammed_runs(results, point) > 2 * jams:
        return JAMS
    pairs = len(compared_runs(results, point, base, metric)[0])
    return SCREENED if pairs >= 2 else TOO_FEW


def jammed_runs(results: Results, point: Point) -> int:
    """The runs of a point that failed, did not finish, or ended in a jam."""
    counts = results.counts(point)
    starved, deadlocks = (results.values(point, name) for name in ("starved_robots", "deadlocks"))
    ended = sum(n >= JAMMED_ROBOTS and deadlocks.get(r, 0) > 0 for r, n in starved.items())
    return counts.censored + counts.failed + ended


def finalists(outcomes: Iterable[ScreenedChange]) -> list[int]:
    """The points to confirm: the best, and those whose interval reaches the last of these."""
    ranked = sorted((one for one in outcomes if one.status == SCREENED), key=lambda one: -one.gain)
    if not ranked:
        return []
    least = ranked[:FINALISTS][-1].gain
    chosen = ranked[:FINALISTS] + [one for one in ranked[FINALISTS:] if one.high >= least]
    return [one.number for one in chosen[:MAX_FINALISTS]]


# Confirmation.


class RankedChange(NamedTuple):
    """A confirmed change, by runs with fresh seeds."""

    number: int  # of its point
    effect: Effect  # against the unchanged scenario; intervals hold simultaneously
    adjusted: float  # Holm-adjusted p
    is_effect: bool
    is_better: bool  # whether the mean of the metric is better
    as_good_as_first: bool  # whether the difference to the first is not significant
    pairs: int


class Ranking(NamedTuple):
    """The confirmed changes, best first, and those that could not be compared."""

    changes: tuple[RankedChange, ...]
    others: tuple[ScreenedChange, ...]


def ranking(results: Results, metric: str, is_higher_better: bool) -> Ranking:
    """Rank the changes of a study whose first point is the unchanged scenario."""
    base, *points = results.points
    jams = jammed_runs(results, base)
    statuses = {point.number: status_of(results, point, metric, jams) for point in points}
    compared = [point for point in points if statuses[point.number] == SCREENED]
    others = [ScreenedChange(n, status) for n, status in statuses.items() if status != SCREENED]
    if not compared:
        return Ranking((), tuple(others))
    level = bonferroni(1 - ERROR, len(compared))
    effects = [paired(results, point, base, metric, level) for point in compared]
    adjusted = holm([one.p for one in effects])
    sign = 1 if is_higher_better else -1
    order = sorted(range(len(compared)), key=lambda k: -sign * effects[k].difference.value)
    first, among = compared[order[0]], bonferroni(1 - ERROR, max(1, len(compared) - 1))
    ranked = [
        RankedChange(
            compared[k].number,
            effects[k],
            adjusted[k],
            adjusted[k] < ERROR,
            sign * effects[k].difference.value > 0,
            k != order[0] and equals(results, compared[k], first, metric, among),
            len(compared_runs(results, compared[k], base, metric)[0]),
        )
        for k in order
    ]
    return Ranking(tuple(ranked), tuple(others))


def paired(results: Results, a: Point, b: Point, metric: str, level: float) -> Effect:
    """The effect of a point against another, from runs with the same seeds."""
    x, y = compared_runs(results, a, b, metric)
    return effect(list(x.values()), list(y.values()), True, level)


def equals(results: Results, a: Point, b: Point, metric: str, level: float) -> bool:
    """Whether two points do not differ significantly."""
    if len(compared_runs(results, a, b, metric)[0]) < 2:
        return False
    difference = paired(results, a, b, metric, level).difference
    return difference.holds(0.0)
