"""A day of a site: its log as a trace, and the scenario with the orders of that day.

The orders come from a file, or from the log: an order is released when its robot takes it, begins where
its load appears and ends where it disappears; of a pod, the stations at which it is served are its lines.
Orders taken shortly before the end of the log are left out: those of them that the log shows to the end
are the quick ones. A log of several days is divided at midnight.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.calibration.fleet_trace import HOUR_S, FleetTrace, trace_of_log
from automaton.calibration.log_on_floor import RobotTracks, placed
from automaton.calibration.state_log import StateLog, numbers_of_robots, read_log
from automaton.errors import InputError
from automaton.floor.floor_plan import CELL_KINDS, NIL, FloorPlan
from automaton.floor.reachability import slot_access
from automaton.scenario.document import Document, Override, override, parse
from automaton.scenario.order_lines import (
    carries_pods,
    listed_lines,
    pod_cells,
    pod_numbers,
)
from automaton.scenario.table_fields import NOTHING, TableOptions, TextField
from automaton.scenario.table_reader import NO_TIMES, read_columns
from automaton.units import count, percent
from automaton.world.resolve import Resolved as Resolved
from automaton.world.resolve import resolve

Array = np.ndarray[Any, Any]

MIN_RECOVERED: Final = 0.8  # of the orders of a log
TAIL_SHARE: Final = 0.95  # of the orders; twice their longest time is left out before the end
DAY_S: Final = 24 * HOUR_S
MAX_DAY_S: Final = 26 * HOUR_S  # longer logs are divided
MIN_DAY_S: Final = HOUR_S  # shorter parts of a divided log are left out
OPTIONS: Final = ("file", "sheet", "where", "encoding")  # that decide which rows a file has
EPOCH: Final = datetime.datetime(1970, 1, 1)


class OrderFile(NamedTuple):
    """A file of orders that was read."""

    since: int  # milliseconds since 1970 of tick 0
    listed: Sequence[Any]  # orders or lines
    names: Sequence[str]  # of the orders; empty: not known


class ComparedSite(NamedTuple):
    """A scenario, and how logs and files of orders are read."""

    scenario: str
    settings: tuple[str | Override, ...]
    seed: int | None
    base: Resolved
    log_columns: Mapping[str, str] | None
    order_columns: Mapping[str, str] | None
    order_time: str | None
    files: dict[Path, OrderFile]  # of orders that were read

    @property
    def ahead(self) -> int:
        """Milliseconds by which clocks of the site are ahead of those of the log."""
        clock = self.base.unrefined.scenario.units.scale.clock
        return 0 if clock is None else 1000 * (clock.offset or 0)


class SiteDay(NamedTuple):
    """A day of a site."""

    name: str
    begin: int  # milliseconds since 1970
    ticks: int  # of a sample, in the ticks of the runs
    trace: FleetTrace
    resolved: Resolved  # the scenario with the orders of the day
    own: tuple[Override, ...]  # what the day sets in the scenario
    by_load: bool  # the log names no orders: what a robot carries stands for its order
    released: Array  # (m,) seconds from the start to the release of each order, or (): not known
    cells: Array  # (n,) int32 where each robot of the scenario is first in the log; NIL: not known
    notes: tuple[str, ...]
    moves: Array  # (k,) a number of each message of a robot that moved

    @property
    def mark(self) -> str:
        """The override that only the scenario of this day has."""
        return self.own[0].argument


class DayOrders(NamedTuple):
    """The orders of a day."""

    section: dict[str, Any]  # `orders` of the scenario
    number_of: Array  # (o + 1,) number in the trace of each order of the log, NIL: left out
    released: Array
    notes: tuple[str, ...]


def read_days(site: ComparedSite, path: Path, orders: Path | None) -> list[SiteDay]:
    """Read the days of a log, and their orders. Raises InputError."""
    log = read_log([path], site.log_columns)
    units = site.base.unrefined.scenario.units
    try:
        place = placed(log, site.base.floor_plan, units)
        by_load = not log.orders
        log = log_of_carries(log) if by_load else log
        notes = log.counts.sentences()
        parts = list(parts_of(log, place, site.ahead))
        if len(parts) != 1:
            notes.append(f"divided at midnight into {count(len(parts), 'day')}")
        days, left_out = [], []
        for part in parts:
            name = f"{path.stem} {part.date}".rstrip()
            try:
                days.append(day_of(site, name, part, orders, by_load))
            except InputError as error:
                left_out.append(error)
                notes.append(f"{part.date} is left out: it {error.message}")
        if not days:
            raise left_out[0] if left_out else InputError("has no day with messages for an hour")
    except InputError as error:
        raise error.at(str(path)) from None
    of_log = (f"{path.name}: {one}" for one in notes)
    return [days[0]._replace(notes=(*of_log, *days[0].notes)), *days[1:]]


class LoggedDay(NamedTuple):
    """The messages of a day."""

    date: str
    log: StateLog
    place: RobotTracks


def parts_of(log: StateLog, place: RobotTracks, ahead: int) -> Iterator[LoggedDay]:
    """Yield the days of a log; `ahead`: milliseconds by which the site is ahead of UTC."""
    time = log.samples.time
    if time.max() - time.min() <= 1000 * MAX_DAY_S:
        yield LoggedDay("", log, place)
        return
    number = (time + ahead) // (1000 * DAY_S)
    for day in np.unique(number).tolist():
        rows = np.flatnonzero(number == day)
        if np.ptp(time[rows]) < 1000 * MIN_DAY_S:
            continue
        date = f"{EPOCH + datetime.timedelta(days=day):%Y-%m-%d}"
        yield LoggedDay(date, log.part(rows), place.part(rows))


def day_of(
    site: ComparedSite, name: str, part: LoggedDay, orders: Path | None, by_load: bool
) -> SiteDay:
    """A day of a site; `by_load`: what a robot carries stands for its order. Raises InputError."""
    _, log, place = part
    scenario = site.base.unrefined.scenario
    time, tick = log.samples.time, float(scenario.units.scale.tick_seconds)
    begin, end = int(time.min()), int(time.max())
    gaps = np.diff(time)[log.usable[:-1]]
    ticks = max(1, round(float(np.median(gaps)) / 1000 / tick)) if len(gaps) else 1
    rows = int((end - begin) / 1000 / (ticks * tick)) + 1
    if rows < 2:
        raise InputError("has a single message of each robot, so nothing can be compared")
    if orders is not None:
        day = orders_of_file(site, log, orders, begin, (rows - 1) * ticks)
    elif carries_pods(scenario, site.base.floor_plan):
        day = recovered_lines(site, log, place, begin, tick)
    else:
        day = recovered_orders(log, place, site.base.floor_plan, begin, tick)
    trace = trace_of_log(log, place, begin, ticks * tick, rows)
    trace = trace._replace(order=day.number_of[trace.order].astype(np.int32))
    stop = {"when": "never", "max_duration": (rows - 1) * ticks}
    cells, charges = first_states(log, place, scenario.fleet.robots)
    own = [
        Override(f"the orders of {name}", ("orders",), day.section),
        Override(f"the duration of {name}", ("stop",), stop),
        clock_setting(site, begin),
    ]
    if scenario.battery is not None and np.isfinite(charges).all():
        key = ("battery", "initial_charge")
        own.append(Override(f"the charges of {name}", key, charges.round(4).tolist()))
    resolved = resolve(site.scenario, (*site.settings, *own), site.seed)
    robots, simulated = len(log.robots), scenario.fleet.robots
    notes = [f"{name}: {note}" for note in day.notes]
    if robots != simulated:
        notes.append(
            f"{name}: {count(robots, 'robot')} in the log, {simulated:,} in the scenario, which begin at "
            "their starts"
        )
    return SiteDay(
        name,
        begin,
        ticks * resolved.scenario.refine,
        trace,
        resolved,
        tuple(own),
        by_load,
        day.released,
        cells,
        tuple(notes),
        log.marks_of_moves(),
    )


def with_changes(site: ComparedSite, day: SiteDay, changes: Sequence[str]) -> Resolved:
    """The scenario of a day with other settings, KEY=VALUE. Raises InputError."""
    return resolve(site.scenario, (*site.settings, *changes, *day.own), site.seed)


def first_states(log: StateLog, place: RobotTracks, robots: int) -> tuple[Array, Array]:
    """(n,) int32 cell and (n,) percent of charge of each robot of the scenario when it is first in the
    log; NIL and nan: not known.

    Robots whose names are numbers of the fleet are these, others are numbered by name.
    """
    cells, charges = np.full(robots, NIL, np.int32), np.full(robots, np.nan)
    if len(log.robots) != robots:
        return cells, charges
    numbers = numbers_of_robots(log.robots, robots)
    for known, out, values in (
        (place.cell != NIL, cells, place.cell),
        (np.isfinite(log.samples.charge), charges, log.samples.charge),
    ):
        robot, first = np.unique(log.samples.robot[known], return_index=True)
        out[numbers[robot]] = values[known][first]
    return cells, charges


def log_of_carries(log: StateLog) -> StateLog:
    """A log without orders in which each time that a robot carries a load is an order.

    Raises InputError for a log without loads.
    """
    samples = log.samples
    begins = (np.diff(samples.load, prepend=0) != 0) | (np.diff(samples.robot, prepend=-1) != 0)
    number = np.cumsum(begins & (samples.load > 0))
    if not number[-1]:
        raise InputError("has neither orders nor loads, so nothing can be compared")
    order = np.where(samples.load > 0, number, 0).astype(np.int32)
    names = tuple(map(str, range(1, int(number[-1]) + 1)))
    return log._replace(samples=samples._replace(order=order), orders=names)


def clock_setting(site: ComparedSite, begin: int, before: float = 0) -> Override:
    """The clock of a scenario at the start of a log, or some seconds before."""
    clock, offset = site.base.unrefined.scenario.units.scale.clock, site.ahead // 1000
    moment = EPOCH + datetime.timedelta(seconds=round(begin / 1000) + offset - before)
    text = f"{moment:%Y-%m-%d %H:%M:%S}"
    if clock is not None and clock.offset is not None:
        sign, minutes = "-" if offset < 0 else "+", abs(offset) // 60
        text += f"{sign}{minutes // 60:02}:{minutes % 60:02}"
    return Override("the time of the log", ("units", "clock"), text)


# Orders from a file.


def orders_of_file(
    site: ComparedSite, log: StateLog, path: Path, begin: int, ticks: int
) -> DayOrders:
    """The orders of a file that are released during a log, or that a robot of the log does.

    Raises InputError.
    """
    scenario = site.base.unrefined.scenario
    form = "lines" if carries_pods(scenario, site.base.floor_plan) else "transports"
    if path not in site.files or site.files[path].since > begin:
        site.files[path] = read_orders(site, path, form, begin)
    since, listed, names = site.files[path]
    tick = scenario.units.scale.tick_seconds
    releases = np.array([order.release for order in listed])
    releases -= round(Fraction(begin - since, 1000) / tick)
    code = {log.orders[number]: number for number in orders_in(log)}
    codes = np.array([code.get(name, NIL) for name in names] or [NIL] * len(listed))
    chosen = np.flatnonzero((releases < ticks) & ((releases >= 0) | (codes != NIL)))
    if not len(chosen):
        raise InputError("no order is released during the log", str(path))
    release = np.maximum(releases[chosen], 0)
    entries = [
        entry_of(listed[number], int(at))
        for number, at in zip(chosen.tolist(), release, strict=True)
    ]
    what = "line" if form == "lines" else "order"
    notes = [f"{count(len(chosen), what)} of {path.name}"]
    known = np.flatnonzero(codes[chosen] != NIL)
    if form == "transports" and len(known) >= MIN_RECOVERED * len(code):
        number_of = np.full(len(log.orders) + 1, NIL)
        number_of[codes[chosen[known]]] = known
        return DayOrders({"list": entries}, number_of, release * float(tick), tuple(notes))
    whys = {
        "transports": "the orders of the log are not named in the file",
        "lines": "a trip of a pod is not an order of the file",
    }
    notes.append(f"{whys[form]}, so lead times begin when a robot takes the order")
    section = {"list" if form == "transports" else form: entries}
    same_numbers = np.append(np.arange(len(log.orders)), NIL)  # the last: without an order
    return DayOrders(section, same_numbers, np.zeros(0), tuple(notes))


def read_orders(site: ComparedSite, path: Path, form: str, begin: int) -> OrderFile:
    """Read a file of orders, with tick 0 a day before `begin`. Raises InputError."""
    file: dict[str, Any] = {"file": str(path.resolve())}
    file |= {"time": site.order_time} if site.order_time else {}
    file |= {"columns": dict(site.order_columns)} if site.order_columns else {}
    named = {**file_options(site, form), **file}
    settings = (
        *site.settings,
        clock_setting(site, begin, DAY_S),
        Override(f"--orders {path}", ("orders",), {form: named}),
    )
    read = resolve(site.scenario, settings).unrefined.scenario.orders
    listed: Sequence[Any] = read.listed or listed_lines(read)
    since = round(begin / 1000 - DAY_S) * 1000  # clocks have whole seconds
    return OrderFile(since, listed, [] if form == "lines" else order_names(named, path))


def entry_of(order: Any, release: int) -> dict[str, Any]:
    """An order or a line as a scenario writes it, with another release."""
    due = order.due_tick
    return {
        **{key: value for key, value in msgspec.to_builtins(order).items() if value is not None},
        "release": release,
        "due": None if due is None else max(due - order.release, 0),
    }


def file_options(site: ComparedSite, form: str) -> Mapping[str, Any]:
    """How the scenario reads the file in a section of orders; {} if the section names no file."""
    data, _ = parse(site.base.source, None)
    orders = override(Document(data), site.settings).data.get("orders") or {}
    section = orders.get(form)
    return section if isinstance(section, dict) and "file" in section else {}


def order_names(transports: Mapping[str, Any], path: Path) -> list[str]:
    """The name of the order in each row of a file; [] without such a column."""
    column = dict(transports.get("columns") or {}).get("order", "order")
    options = {key: transports[key] for key in OPTIONS if key in transports}
    try:
        table = read_columns(
            path,
            [TextField("order")],
            msgspec.convert(options, TableOptions),
            {"order": column},
            NO_TIMES,
        )
    except InputError:
        return []
    texts = [*table.names["order"], ""]
    return [texts[number] if number != NOTHING else "" for number in table.values["order"].tolist()]


# Orders from the log.


class OrderEnds(NamedTuple):
    """When an order was taken and done, and the last messages before its load appears and disappears."""

    taken: int  # milliseconds since 1970
    done: int
    pick: int
    drop: int


CompleteOrder = tuple[OrderEnds, list[dict[str, Any]]]  # the entries of the section of orders


def recovered_orders(
    log: StateLog, place: RobotTracks, floor_plan: FloorPlan, begin: int, tick: float
) -> DayOrders:
    """The orders that a log shows from their beginning to their end. Raises InputError for too few."""
    gives, takes = slots_at(floor_plan)
    orders = list(ends_of_orders(log))
    is_late = [
        is_after(place, [ends.pick for _, ends in orders], gives),
        is_after(place, [ends.drop for _, ends in orders], takes),
    ]
    complete = {}
    for code, ends in orders:
        picks = cells_at(log, place, ends.pick, is_late[0])
        source = next((gives[cell] for cell in picks if cell in gives), NIL)
        drops = cells_at(log, place, ends.drop, is_late[1], int(log.samples.action[ends.pick + 1]))
        slots = (takes[cell] for cell in drops if cell in takes)
        target = next((slot for slot in slots if slot != source), NIL)
        if NIL not in (source, target):
            xy = floor_plan.xy
            complete[code] = ends, [{"from": list(xy(source)), "to": list(xy(target))}]
    return released_when_taken(log, complete, "list", begin, tick)


def released_when_taken(
    log: StateLog, complete: Mapping[int, CompleteOrder], form: str, begin: int, tick: float
) -> DayOrders:
    """Orders of a log as a section of orders, each released when its robot takes it. `complete`: by
    number in the log.

    Raises InputError if these are too few.
    """
    orders = len(orders_in(log))
    if not orders:
        raise InputError("has no orders")
    if len(complete) < MIN_RECOVERED * orders:
        share = percent(len(complete) / orders, 0)
        text = f"shows both ends of only {share} of its orders"
        raise InputError(f"{text}; name the file of orders by --orders")
    longest = np.quantile([ends.done - ends.taken for ends, _ in complete.values()], TAIL_SHARE)
    last = int(log.samples.time.max()) - 2 * longest
    chosen = {code: one for code, one in complete.items() if one[0].taken <= last}
    number_of = np.full(len(log.orders) + 1, NIL)
    entries: list[dict[str, Any]] = []
    by_time = sorted(chosen, key=lambda code: chosen[code][0].taken)
    for number, code in enumerate(by_time):
        number_of[code] = number
        ends, parts = chosen[code]
        release = max(0, math.floor((ends.taken - begin) / 1000 / tick))
        entries += ({**part, "release": release} for part in parts)
    if not entries:
        raise InputError("is too short: no order is done well before its end")
    notes = [
        f"{count(len(chosen), 'order')} recovered, each released when a robot takes it: so a busy model "
        "falls behind by a few percent, which --orders FILE avoids"
    ]
    if left := orders - len(chosen):
        notes.append(f"{count(left, 'order')} left out: they cross the start, or come near the end")
    return DayOrders({form: entries}, number_of, np.zeros(0), tuple(notes))


def orders_in(log: StateLog) -> list[int]:
    """The numbers of the orders that the messages of a log name."""
    numbers: list[int] = (np.unique(log.samples.order[log.samples.order > 0]) - 1).tolist()
    return numbers


def recovered_lines(
    site: ComparedSite, log: StateLog, place: RobotTracks, begin: int, tick: float
) -> DayOrders:
    """The trips of pods that a log shows completely, with a line for each visit of a station.

    Raises InputError for too few.
    """
    base, complete = site.base.unrefined, {}
    pods, visits = pods_of_loads(log, place, base), StationVisits(log, place, base)
    for code, ends in ends_of_orders(log):
        pod = pods.get(int(log.samples.load[ends.pick + 1]))
        stations = visits.of(ends)
        if pod is not None and stations:
            complete[code] = ends, [{"pod": pod, "station": one} for one in stations]
    return released_when_taken(log, complete, "lines", begin, tick)


class StationVisits:
    """Where robots are served with their pods: in the cells of stations, by an action if the log has
    any there, else where they stand for two messages."""

    def __init__(self, log: StateLog, place: RobotTracks, base: Resolved) -> None:
        number = np.zeros(base.floor_plan.kind.size + 1, np.int64)  # the last: not known
        number[base.floor_plan.stations] = np.arange(len(base.floor_plan.stations)) + 1
        self.station = np.where(log.samples.load > 0, number[place.cell], 0)
        self.action = log.samples.action_id
        is_served = (self.station > 0) & (log.samples.action > 0)
        if not is_served.any():
            stays = (np.diff(place.cell) == 0) & (np.diff(log.samples.robot) == 0)
            is_served = (self.station > 0) & (np.append(stays, False) | np.append(False, stays))
        self.station[~is_served] = 0

    def of(self, ends: OrderEnds) -> list[int]:
        """The number from 1 of the station of each visit of an order."""
        rows = slice(ends.pick + 1, ends.drop + 1)
        station, action = self.station[rows], self.action[rows]
        begins = (np.diff(station, prepend=0) != 0) | (np.diff(action, prepend=0) != 0)
        numbers: list[int] = station[begins & (station > 0)].tolist()
        return numbers


def pods_of_loads(log: StateLog, place: RobotTracks, base: Resolved) -> dict[int, int]:
    """The number from 1 of the pod of each load: of the pod in the cell where the load first appears,
    else of its name. Pods of a day need not stand where those of the scenario do."""
    cells = pod_cells(base.scenario, base.floor_plan)
    free = {cell: number for number, cell in enumerate(cells.tolist(), 1)}
    load, pods = log.samples.load, dict[int, int]()
    appears = (load[1:] > 0) & (np.diff(load) != 0) & (np.diff(log.samples.robot) == 0)
    rows = np.flatnonzero(appears)
    for row in rows[np.argsort(log.samples.time[rows], kind="stable")].tolist():
        if int(load[row + 1]) not in pods:
            near = (cell for cell in cells_at(log, place, row, False) if cell in free)
            pods[int(load[row + 1])] = free.pop(next(near, NIL), 0)
    names, left = pod_numbers(base.scenario, len(cells)), set(free.values())
    for one in [one for one, pod in pods.items() if not pod]:
        pod = names.get(log.loads[one - 1], NIL) + 1
        if pod in left:
            pods[one] = pod
        else:
            del pods[one]
    return pods


def ends_of_orders(log: StateLog) -> Iterator[tuple[int, OrderEnds]]:
    """Yield the number and the ends of each order whose load appears and disappears in the log."""
    samples = log.samples
    rows = np.flatnonzero(samples.order)
    rows = rows[np.lexsort((samples.time[rows], samples.order[rows]))]
    codes, first = np.unique(samples.order[rows], return_index=True)
    for code, own in zip(codes.tolist(), np.split(rows, first)[1:], strict=True):
        loaded = own[samples.load[own] > 0]
        if not len(loaded):
            continue
        pick, drop = int(loaded[0]) - 1, int(loaded[-1])
        if pick >= 0 and drop + 1 < len(samples.time):
            robot = samples.robot[[pick, pick + 1, drop, drop + 1]]
            # Else it crosses the start or the end.
            if robot[0] == robot[1] and robot[2] == robot[3]:
                times = int(samples.time[own[0]]), int(samples.time[drop + 1])
                yield code - 1, OrderEnds(*times, pick, drop)


def is_after(place: RobotTracks, rows: Sequence[int], slots: Mapping[int, int]) -> bool:
    """Whether loads change at the begin of picks or drops, so that robots are still there afterwards."""
    before = sum(int(place.cell[row]) in slots for row in rows)
    return sum(int(place.cell[row + 1]) in slots for row in rows) > before


def cells_at(
    log: StateLog, place: RobotTracks, row: int, is_late: bool, other: int = 0
) -> tuple[int, ...]:
    """The cells where a load may have changed between a message and the next, the likeliest first.

    These are the cells of a running action, then those of the messages, the second one first if it
    `is_late`, then the one on the way. `other`: an action that is not the one sought.
    """
    rows = (row + 1, row) if is_late else (row, row + 1)
    acting = [place.cell[one] for one in rows if log.samples.action[one] not in (0, other)]
    return tuple(map(int, (*acting, *place.cell[list(rows)], place.to_cell[row])))


def slots_at(floor_plan: FloorPlan) -> tuple[dict[int, int], dict[int, int]]:
    """The first slot that gives a load to a robot in a cell, and the first that takes one, by cell."""
    gives: dict[int, int] = {}
    takes: dict[int, int] = {}
    kinds = floor_plan.kind.reshape(-1)[floor_plan.slots]
    for slot, kind, cells in zip(
        floor_plan.slots.tolist(), kinds.tolist(), slot_access(floor_plan).tolist(), strict=True
    ):
        for cell in cells:
            if cell != NIL and CELL_KINDS[kind].gives:
                gives.setdefault(cell, slot)
            if cell != NIL and CELL_KINDS[kind].takes:
                takes.setdefault(cell, slot)
    return gives, takes
