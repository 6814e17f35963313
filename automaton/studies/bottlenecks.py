"""Bottlenecks: what single changes of a scenario are worth, compared in pairs of runs with equal seeds.

    candidate  a setting that the scenario allows: a faster station, one more charger, one robot more, ...
    screening  some pairs of runs for each candidate
    confirmed  the FINALISTS best and all that may be as good, by runs with fresh seeds

Effects, intervals and p values (both Bonferroni) come from the fresh seeds alone, so selection by the
screening does not bias them. Robots may lose no time at a bottleneck, because a detour causes no
queue: the ticks lost near a change are listed beside its effect, not used to rank it.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
import yaml

from automaton.errors import InputError
from automaton.scenario.changing_floor import OPEN_MOVE, StreetPlan, Streets, cells_of_set
from automaton.scenario.streets import changed_stretches, street_entries
from automaton.studies.inference.intervals import (
    Effect,
    Interval,
    bonferroni,
    effect,
    mean_interval,
)
from automaton.studies.reports.comparisons import compared_runs
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.run_keys import fingerprint
from automaton.units import count
from automaton.world.fleet_warnings import places_of
from automaton.world.resolved import Resolved

PLACE, STATION, ENERGY, FLEET = KINDS = ("place", "station", "energy", "fleet")
OWN: Final = "own"  # the kind of the changes in a file
NEAR: Final = 3  # cells, in rows and in columns
FINALISTS: Final = 8
MAX_FINALISTS: Final = 24
SCREENING_LEVEL: Final = 0.99  # of the intervals that decide which changes may be among the best
ERROR: Final = 0.05  # of all verdicts together
JAMMED_ROBOTS: Final = 2  # without progress at the end of a run that has had a deadlock
UNNAMEABLE: Final = "--set cannot name a station whose name has a dot or '='"

CHANGES_NOTHING: Final = "changes nothing"
JAMS: Final = "jams"
FEW_PAIRS: Final = "too few pairs"
SCREENED: Final = "screened"
CONFIRMED: Final = "confirmed"

Settings = dict[str, Any]  # key of a scenario, such as "fleet.robots" -> its value


class CandidateChange(NamedTuple):
    """A change that a scenario may allow."""

    kind: str
    name: str
    settings: Settings
    cells: tuple[int, ...] = ()  # flat cells of the changed part of the floor; (): it has no place
    objection: str = ""  # why it cannot be tried
    of_street: bool = False  # tried by flow, after all others
    opens: bool = False  # a street on which robots do not drive so far, at least in one direction
    may_cut_off: bool = False  # left out where it leaves no way between places that robots need

    @property
    def texts(self) -> tuple[str, ...]:
        """The settings as KEY=VALUE, as --set takes them."""
        return tuple(f"{key}={in_yaml(value)}" for key, value in self.settings.items())


class CandidateList(NamedTuple):
    """The changes of a scenario: tried, impossible, and left out because there are too many."""

    tried: tuple[CandidateChange, ...]
    refused: tuple[tuple[CandidateChange, str], ...]  # with the reason
    left_out: int


def in_yaml(value: Any) -> str:
    """A value in one line of YAML."""
    plain = json.loads(json.dumps(value))  # equal parts are written out, not as aliases
    text = yaml.safe_dump(plain, default_flow_style=True, width=math.inf, sort_keys=False)
    return text.removesuffix("...\n").strip()


# The changes that a scenario allows, by kind.


def place_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Each door kept open, one more robot in each block, each speed limit lifted; changed streets."""
    floor, floor_plan = resolved.scenario.floor, resolved.floor_plan
    for number, door in enumerate(floor.doors):
        key, (x, y) = f"floor.doors.{number}", door.at
        lasting = resolved.scenario.stop.max_duration
        settings = {f"{key}.opening_time": 1, f"{key}.hold_open": lasting}
        name = f"door [{x}, {y}] stays open"
        yield CandidateChange(PLACE, name, settings, (floor_plan.cell(x, y),))
    for number, block in enumerate(floor.blocks):
        cells, most = tuple(cells_of_set("", block.cells, floor_plan)), block.max_robots + 1
        if len(cells) > 1:  # the world itself limits chargers for two robots by blocks of a cell
            settings = {f"floor.blocks.{number}.max_robots": most}
            yield CandidateChange(PLACE, f"block {number + 1}: {most} robots", settings, cells)
    for number, limit in enumerate(floor.speed_limits):
        cells = tuple(cells_of_set("", limit.cells, floor_plan))
        settings = {f"floor.speed_limits.{number}.max_speed": 1}
        yield CandidateChange(PLACE, f"speed limit {number + 1} lifted", settings, cells)
    for one in changed_stretches(floor_plan):
        settings = further_streets(resolved.own_streets, one.streets)
        opens = any(OPEN_MOVE in street.values() for street in one.streets)
        yield CandidateChange(
            PLACE, one.name, settings, one.cells, "", True, opens, one.may_cut_off
        )


def further_streets(own: Streets | None, streets: Sequence[dict[str, Any]]) -> Settings:
    """The setting that adds streets to those of a scenario."""
    if isinstance(own, StreetPlan):
        return {"streets.then": [*street_entries(own.then), *streets]}
    return {"streets": [*street_entries(own or ()), *streets]}


def station_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Each station in half the time, each with one more place, and one more station if one is closed."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    usual = half_handling(scenario.durations.handling)
    for name, station in scenario.stations.items():
        rest = (floor_plan.cell(*station.at),), UNNAMEABLE if {".", "="} & set(name) else ""
        faster = usual if station.handling is None else half_handling(station.handling)
        if faster:
            settings: Settings = {f"stations.{name}.handling": faster}
            yield CandidateChange(STATION, f"station {name}: handling x 0.5", settings, *rest)
        most = places_of(floor_plan, station)
        if most is not None:
            settings = {f"stations.{name}.max_trips": most + 1}
            yield CandidateChange(STATION, f"station {name}: {most + 1} trips", settings, *rest)
    if usual and len(scenario.stations) < len(floor_plan.stations):
        yield CandidateChange(STATION, "stations: handling x 0.5", {"durations.handling": usual})
    yield from processing_changes(resolved)
    yield from service_changes(resolved)
    yield from one_more(resolved, STATION)


def one_more(resolved: Resolved, kind: str) -> Iterator[CandidateChange]:
    """One more station or charger, if some are closed."""
    what = "station" if kind == STATION else "charger"
    number_open = getattr(resolved.scenario.floor, f"open_{what}s")
    if number_open is not None:
        yield CandidateChange(kind, f"one more {what}", {f"floor.open_{what}s": number_open + 1})


def processing_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Each station that processes parts, in half the time."""
    orders, stations = resolved.scenario.orders, resolved.floor_plan.stations.tolist()
    times: Any = msgspec.to_builtins(orders.processing_time)
    for number in sorted({one for kind in orders.parts or () for one in kind.route}):
        own = times[number - 1] if isinstance(times, tuple) else times
        shorter = {**own, "mean": max(1.0, own["mean"] / 2)} if isinstance(own, dict) else half(own)
        settings = {f"orders.processing_time.{number - 1}": shorter}
        if not isinstance(times, tuple):
            each = [shorter if one == number else own for one in range(1, len(stations) + 1)]
            settings = {"orders.processing_time": each}
        name, cells = f"station {number}: processing x 0.5", (stations[number - 1],)
        yield CandidateChange(STATION, name, settings, cells)


def service_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """The stops of listed orders at each cell, in half the time."""
    by_cell: dict[tuple[int, int], Settings] = {}
    orders = resolved.scenario.orders.listed or ()
    for number, order in enumerate(orders if resolved.order_file is None else ()):
        for place, stop in enumerate(order.stops or ()):
            ticks = getattr(stop, "ticks", 0)
            if ticks > 1:
                key = f"orders.list.{number}.stops.{place}.for"
                by_cell.setdefault(tuple(stop.at), {})[key] = half(ticks)  # type: ignore[union-attr]
    for (x, y), settings in by_cell.items():
        name, cells = f"stops at [{x}, {y}] x 0.5", (resolved.floor_plan.cell(x, y),)
        yield CandidateChange(STATION, name, settings, cells)


def energy_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Charging at twice the rate, one more charger if one is closed, batteries twice as large.

    Charge and rates are shares of the capacity: a battery twice as large loses charge half as fast and
    gains it half as fast.
    """
    if resolved.scenario.battery is None:
        return
    sections = sections_of(resolved, "battery")
    rates = {f"{key}.charge_rate": own.charge_rate for key, own in sections if own.charge_rate}
    drain = {
        f"{key}.drain.{name}": scaled(rate, 0.5)
        for key, own in sections
        for name, rate in msgspec.structs.asdict(own.drain).items()
        if rate and name != "loaded_factor"
    }
    faster, slower = ({key: charging(one, by) for key, one in rates.items()} for by in (2, 0.5))
    yield CandidateChange(ENERGY, "charging rate x 2", faster)
    yield from one_more(resolved, ENERGY)
    yield CandidateChange(ENERGY, "battery capacity x 2", {**drain, **slower})


def fleet_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """Robots and speed of each type, times of operations, and the limits of allocation."""
    fleet, durations = resolved.scenario.fleet, resolved.scenario.durations
    for number, kind in enumerate(fleet.types) if fleet.types else [(None, None)]:
        key, of_type = f"fleet.types.{number}", f" of type {kind.name}" if kind else ""
        for step, word in ((-1, "fewer"), (1, "more")):
            settings: Settings = {"fleet.robots": fleet.robots + step}
            if kind is not None and kind.robots is not None:
                settings[f"{key}.robots"] = kind.robots + step
            yield CandidateChange(FLEET, f"one robot{of_type} {word}", settings)
        if kind is not None and kind.move_time_factor > 1:
            factor = kind.move_time_factor - 1
            settings = {f"{key}.move_time_factor": factor}
            yield CandidateChange(FLEET, f"type {kind.name}: move time factor {factor}", settings)
        else:
            own = kind and kind.durations.move
            where = f"{key}.durations.move" if kind else "durations.move"
            settings = halves({where: durations.move if own is None else own})
            yield CandidateChange(FLEET, f"moves{of_type} x 0.5", settings)
    sections = sections_of(resolved, "durations")
    for name in ("turn", "pick", "drop"):
        settings = halves({f"{key}.{name}": getattr(part, name) for key, part in sections})
        yield CandidateChange(FLEET, f"{name}s x 0.5", settings)
    yield from limit_changes(resolved)


def limit_changes(resolved: Resolved) -> Iterator[CandidateChange]:
    """The number of robots with an order 10 % lower and higher, where the allocation limits it."""
    choices: dict[tuple[str, str], Any] = {
        (f"fleet.types.{number}.strategy.allocation", f" of type {kind.name}"): own
        for number, (kind, own) in enumerate(
            zip(resolved.scenario.fleet.types, resolved.own_allocations, strict=False)
        )
    }
    choices["strategy.allocation", ""] = resolved.strategies["allocation"]
    for (key, of_type), choice in choices.items():
        limit = getattr(choice and choice.parameters, "active", None) or 0
        step = max(1, round(limit / 10))
        for value in (limit - step, limit + step) if limit else ():
            name = f"{value} active robots{of_type}"
            yield CandidateChange(FLEET, name, {f"{key}.active": value})


def sections_of(resolved: Resolved, name: str) -> list[tuple[str, Any]]:
    """The keys and contents of a section of the scenario and of its robot types."""
    scenario = resolved.scenario
    sections = [(name, getattr(scenario, name))]
    types = enumerate(scenario.fleet.types)
    return sections + [(f"fleet.types.{k}.{name}", getattr(kind, name)) for k, kind in types]


def halves(durations: Settings) -> Settings:
    """Settings with half of each duration, where that is another whole number of ticks."""
    plain = {key: msgspec.to_builtins(one) for key, one in durations.items() if one}
    return {key: half(one) for key, one in plain.items() if half(one) != one}


def half(ticks: Any) -> Any:
    """Half of a whole number of ticks, rounded up; of each part of a duration by load."""
    if isinstance(ticks, int):
        return (ticks + 1) // 2
    return {load: half(one) for load, one in ticks.items()}


def half_handling(handling: Any) -> Settings:
    """Half of a handling time, without the parts that take no time."""
    return {part: one for part, one in scaled(handling, 0.5).items() if one}


def charging(rate: Any, factor: float) -> Any:
    """A charging rate, or a curve of [from, rate], times a factor."""
    if isinstance(rate, tuple):
        return [[since, scaled(one, factor)] for since, one in rate]
    return scaled(rate, factor)


def scaled(value: Any, factor: float) -> Any:
    """The numbers of a section times a factor, to six digits; keys without a value are left out."""
    value = msgspec.to_builtins(value)
    if isinstance(value, dict):
        return {key: scaled(one, factor) for key, one in value.items() if one is not None}
    if isinstance(value, list | tuple):
        return [scaled(one, factor) for one in value]
    if isinstance(value, str):
        return value
    number = float(f"{factor * value:.6g}")
    return int(number) if number.is_integer() else number


BY_KIND: Final[Mapping[str, Callable[[Resolved], Iterator[CandidateChange]]]] = {
    PLACE: place_changes,
    STATION: station_changes,
    ENERGY: energy_changes,
    FLEET: fleet_changes,
}


def candidates_of(
    base: Resolved,
    changed: Callable[[Sequence[str]], Resolved],
    own: Sequence[CandidateChange],
    kinds: Sequence[str],
    most: int,
    lost: npt.NDArray[np.float64],
    flow: npt.NDArray[np.float64],
) -> CandidateList:
    """The changes to try: own ones, those without a place, then by the time lost near them, then streets
    by the flow beside them, in turn one on which robots drive and one that opens.

    `base`: the scenario as it is; `changed`: it with further settings, both unrefined; `lost`, `flow`:
    (C,) lost ticks, visits. Changes that would repeat a scenario are not tried. Raises InputError for an
    own change that cannot be run.
    """
    names, known = {one.name for one in own}, {fingerprint(base)}
    further = [one for kind in KINDS if kind in kinds for one in BY_KIND[kind](base)]
    further = [one for one in further if one.settings and one.name not in names]
    further.sort(key=lambda one: precedence(base, one, lost, flow))
    tried: list[CandidateChange] = []
    refused: list[tuple[CandidateChange, str]] = []
    by_flow = [[one for one in further if one.of_street and one.opens == opens] for opens in (0, 1)]
    in_turn = [one for pair in itertools.zip_longest(*by_flow) for one in pair if one]
    candidates = [*own, *(one for one in further if not one.of_street), *in_turn]
    for number, candidate in enumerate(candidates):
        if len(tried) >= max(most, len(own)):
            return CandidateList(tuple(tried), tuple(refused), len(candidates) - number)
        try:
            candidate, resolved = with_same_right_of_way(base, changed, candidate)
        except InputError as error:
            if candidate.kind == OWN:
                raise
            if not candidate.may_cut_off:
                refused.append((candidate, error.message))
            continue
        mark = fingerprint(resolved)
        if mark not in known:
            known.add(mark)
            tried.append(placed(candidate, base, resolved))
    return CandidateList(tuple(tried), tuple(refused), 0)


def with_same_right_of_way(
    base: Resolved, changed: Callable[[Sequence[str]], Resolved], candidate: CandidateChange
) -> tuple[CandidateChange, Resolved]:
    """A change with its scenario, which keeps the right of way of the scenario as it is.

    An own change keeps it unless that is refused. Raises InputError.
    """
    if candidate.objection:
        raise InputError(candidate.objection)
    resolved = changed(candidate.texts)
    keeping = candidate._replace(settings=resolved.with_rule_of(base, candidate.settings))
    if keeping == candidate:
        return candidate, resolved
    try:
        return keeping, changed(keeping.texts)
    except InputError:
        if candidate.kind != OWN:
            raise
        return candidate, resolved


def placed(candidate: CandidateChange, base: Resolved, changed: Resolved) -> CandidateChange:
    """A change with the cells whose kind it changes, unless its place is known."""
    now, then = changed.floor_plan.kind, base.floor_plan.kind
    if candidate.cells or now.shape != then.shape:
        return candidate
    return candidate._replace(cells=tuple(np.flatnonzero(now != then).tolist()))


def precedence(
    base: Resolved,
    one: CandidateChange,
    lost: npt.NDArray[np.float64],
    flow: npt.NDArray[np.float64],
) -> tuple[int, float]:
    """The order of changes: the least is tried first."""
    if not one.cells:
        return 0, 0.0
    if not one.of_street:
        return 1, -lost_near(base, lost, one.cells)
    beside = near(base, one.cells, 1) & base.floor_plan.drivable.reshape(-1)
    return 2, -float(flow[beside].mean())


def lost_near(resolved: Resolved, lost: npt.NDArray[np.float64], cells: Sequence[int]) -> float:
    """The lost ticks within NEAR rows and columns of some cells; `lost`: (C,)."""
    return float(lost[near(resolved, cells, NEAR)].sum())


def near(resolved: Resolved, cells: Sequence[int], reach: int) -> npt.NDArray[np.bool_]:
    """(C,) the cells within some rows and columns of others."""
    height, width = resolved.floor_plan.kind.shape
    inside = np.zeros((height, width), np.bool_)
    for cell in cells:
        row, column = divmod(cell, width)
        rows = slice(max(0, row - reach), row + reach + 1)
        inside[rows, max(0, column - reach) : column + reach + 1] = True
    return inside.reshape(-1)


# Screening.


class ScreenedChange(NamedTuple):
    """A change after its runs with the first seeds; `gain`: above 0 if it makes the metric better."""

    number: int  # of its point
    status: str  # SCREENED, CHANGES_NOTHING, JAMS or FEW_PAIRS
    gain: float = math.nan
    high: float = math.nan  # upper end of the interval of the gain, at SCREENING_LEVEL


def screened(results: Results, metric: str, is_higher_better: bool) -> list[ScreenedChange]:
    """Every change against point 0, which is the scenario as it is."""
    outcomes = []
    for number, status in statuses(results, metric).items():
        outcome = ScreenedChange(number, status)
        if status == SCREENED:
            difference = paired_difference(results, number, 0, metric, SCREENING_LEVEL)
            gain = difference.value if is_higher_better else -difference.value
            outcome = outcome._replace(gain=gain, high=gain + (difference.half or 0.0))
        outcomes.append(outcome)
    return outcomes


def statuses(results: Results, metric: str) -> dict[int, str]:
    """For each point but 0 whether it can be compared with point 0: SCREENED, or why not."""
    base, *points = results.points
    jams, runs, by_point = jammed_runs(results, 0), results.study.max_replications, {}
    for point in points:
        status = SCREENED
        if results.same(point, base, metric):
            status = CHANGES_NOTHING
        elif jams_more(jammed_runs(results, point.number), jams, runs):
            status = JAMS
        elif len(compared_runs(results, point, base, metric)[0]) < 2:
            status = FEW_PAIRS
        by_point[point.number] = status
    return by_point


def jams_more(jammed: int, base: int, runs: int) -> bool:
    """Whether a change jams `jammed` of `runs` runs where `base` jam as it is.

    That is so if more than half of the runs jam in addition, or if the change has significantly more
    of the runs that jam (sign test): 1 of 20 may be chance, 5 of 20 beside 0 are not.
    """
    both = jammed + base
    tail = sum(math.comb(both, k) for k in range(jammed, both + 1))
    return 2 * (jammed - base) > runs or tail < ERROR * 2**both


def jam_text(results: Results, number: int) -> str:
    """Such as "jams in 6 of 20 runs (as it is: 0)"."""
    runs = count(results.study.max_replications, "run")
    jams, base = jammed_runs(results, number), jammed_runs(results, 0)
    return f"{JAMS} in {jams:,} of {runs} (as it is: {base:,})"


def jammed_runs(results: Results, number: int) -> int:
    """The runs of a point that failed, did not finish, or ended in a jam."""
    point = results.points[number]
    starved, deadlocks = (results.values(point, name) for name in ("starved_robots", "deadlocks"))
    ended = sum(n >= JAMMED_ROBOTS and deadlocks.get(r, 0) > 0 for r, n in starved.items())
    return results.counts(point).censored + results.counts(point).failed + ended


def finalists(outcomes: Iterable[ScreenedChange]) -> list[int]:
    """The points to confirm: the best, and those whose interval reaches the last of these."""
    ranked = sorted((one for one in outcomes if one.status == SCREENED), key=lambda one: -one.gain)
    best, others = ranked[:FINALISTS], ranked[FINALISTS:]
    best += [one for one in others if one.high >= best[-1].gain]
    return [one.number for one in best[:MAX_FINALISTS]]


# Confirmation.


class RankedChange(NamedTuple):
    """A confirmed change, by runs with fresh seeds."""

    number: int  # of its point
    effect: Effect  # against the scenario as it is; intervals hold simultaneously
    adjusted: float  # p times the number of confirmed changes, at most 1
    gain: float  # above 0 if the change makes the metric better
    equals_first: bool  # whether the difference to the first is not significant
    pairs: int

    @property
    def is_effect(self) -> bool:
        """Whether the effect is significant."""
        return self.adjusted < ERROR

    @property
    def helps(self) -> bool:
        """Whether the change significantly makes the metric better."""
        return self.is_effect and self.gain > 0


def ranking(results: Results, metric: str, is_higher_better: bool) -> list[RankedChange]:
    """The comparable changes of a study, best first; point 0 is the scenario as it is."""
    numbers = [n for n, status in statuses(results, metric).items() if status == SCREENED]
    if not numbers:
        return []
    level = bonferroni(1 - ERROR, len(numbers))
    effects = [paired(results, number, 0, metric, level) for number in numbers]
    sign = 1 if is_higher_better else -1
    ranked = [
        RankedChange(
            number,
            one,
            min(1.0, len(numbers) * one.p),
            sign * one.difference.value,
            False,
            one.difference.n,
        )
        for number, one in zip(numbers, effects, strict=True)
    ]
    ranked.sort(key=lambda one: -one.gain)
    first, *others = ranked
    level = bonferroni(1 - ERROR, max(1, len(others)))
    alike = [is_equal(results, one.number, first.number, metric, level) for one in others]
    pairs = zip(others, alike, strict=True)
    return [first, *(one._replace(equals_first=equals) for one, equals in pairs)]


def paired(results: Results, a: int, b: int, metric: str, level: float) -> Effect:
    """The effect of a point against another, from runs with the same seeds."""
    x, y = compared_runs(results, results.points[a], results.points[b], metric)
    return effect(list(x.values()), list(y.values()), True, level)


def paired_difference(results: Results, a: int, b: int, metric: str, level: float) -> Interval:
    """The difference of two points with its interval, however few pairs there are."""
    x, y = compared_runs(results, results.points[a], results.points[b], metric)
    return mean_interval(np.subtract(list(x.values()), list(y.values())), level)


def is_equal(results: Results, a: int, b: int, metric: str, level: float) -> bool:
    """Whether the difference of two points is not significant; False for fewer than two pairs."""
    pairs = len(compared_runs(results, results.points[a], results.points[b], metric)[0])
    return pairs >= 2 and paired(results, a, b, metric, level).p >= 1 - level
