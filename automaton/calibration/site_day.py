"""A day of a site: its log as a trace, and the scenario with the orders of that day.

The orders come from a file, or from the log: an order is released when its robot takes it, begins where
its load appears and ends where it disappears. Orders taken shortly before the end of the log are left
out: those of them that the log shows to the end are the quick ones.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.calibration.fleet_trace import FleetTrace, trace_of_log
from automaton.calibration.log_on_floor import RobotTracks, placed
from automaton.calibration.state_log import StateLog, read_log
from automaton.errors import InputError
from automaton.floor.floor_plan import CELL_KINDS, NIL, FloorPlan
from automaton.floor.reachability import slot_access
from automaton.scenario.document import Document, Override, override, parse
from automaton.scenario.quantities import SECONDS_OF_DAY
from automaton.scenario.table_fields import NOTHING, TableOptions, TextField
from automaton.scenario.table_reader import NO_TIMES, read_columns
from automaton.units import count, percent
from automaton.world.resolve import resolve
from automaton.world.resolved import Resolved

Array = np.ndarray[Any, Any]

MIN_RECOVERED: Final = 0.8  # of the orders of a log
TAIL_SHARE: Final = 0.95  # of the orders; twice their longest time is left out before the end
MAX_DAY_S: Final = 26 * 3600
OPTIONS: Final = ("file", "sheet", "where", "encoding")  # that decide which rows a file has
EPOCH: Final = datetime.datetime(1970, 1, 1)


class ComparedSite(NamedTuple):
    """A scenario, and how logs and files of orders are read."""

    scenario: str
    settings: tuple[str | Override, ...]
    seed: int | None
    base: Resolved
    log_columns: Mapping[str, str] | None
    order_columns: Mapping[str, str] | None
    order_time: str | None


class SiteDay(NamedTuple):
    """A day of a site."""

    name: str
    begin: int  # milliseconds since 1970
    ticks: int  # of a sample, in the ticks of the runs
    trace: FleetTrace
    resolved: Resolved  # the scenario with the orders of the day
    by_load: bool  # the log names no orders: what a robot carries stands for its order
    released: Array  # (m,) seconds from the start to the release of each order, or (): not known
    notes: tuple[str, ...]


class DayOrders(NamedTuple):
    """The orders of a day."""

    section: dict[str, Any]  # `orders` of the scenario
    number_of: Array  # (o + 1,) number in the trace of each order of the log, NIL: left out
    released: Array
    notes: tuple[str, ...]


def read_day(site: ComparedSite, path: Path, orders: Path | None) -> SiteDay:
    """Read the log of a day, and its orders. Raises InputError."""
    log = read_log([path], site.log_columns)
    scenario, floor_plan = site.base.unrefined.scenario, site.base.floor_plan
    try:
        place = placed(log, floor_plan, scenario.units)
    except InputError as error:
        raise error.at(str(path)) from None
    by_load = not log.orders
    log = log_of_carries(log, str(path)) if by_load else log
    time, tick = log.samples.time, float(scenario.units.scale.tick_seconds)
    begin, end = int(time.min()), int(time.max())
    gaps = np.diff(time)[log.usable[:-1]]
    ticks = max(1, round(float(np.median(gaps)) / 1000 / tick)) if len(gaps) else 1
    rows = int((end - begin) / 1000 / (ticks * tick)) + 1
    if end - begin > 1000 * MAX_DAY_S or rows < 2:
        days = f"{(end - begin) / 1000 / SECONDS_OF_DAY:,.2f} days"
        raise InputError(f"covers {days}; compare needs one log for each day", str(path))
    clock = clock_setting(site, begin)
    if orders is None:
        day = recovered_orders(log, place, floor_plan, begin, tick, str(path))
    else:
        day = orders_of_file(site, log, orders, begin, (rows - 1) * ticks)
    trace = trace_of_log(log, place, begin, ticks * tick, rows)
    trace = trace._replace(order=day.number_of[trace.order].astype(np.int32))
    stop = {"when": "never", "max_duration": (rows - 1) * ticks}
    own = (
        clock,
        Override(f"the orders of {path.name}", ("orders",), day.section),
        Override(f"the duration of {path.name}", ("stop",), stop),
    )
    resolved = resolve(site.scenario, (*site.settings, *own), site.seed)
    robots, simulated = len(log.robots), scenario.fleet.robots
    notes = [f"{path.name}: {note}" for note in (*log.counts.sentences(), *day.notes)]
    if robots != simulated:
        notes.append(
            f"{path.name}: {count(robots, 'robot')} in the log, {simulated:,} in the scenario"
        )
    fine = ticks * resolved.scenario.refine
    return SiteDay(path.stem, begin, fine, trace, resolved, by_load, day.released, tuple(notes))


def log_of_carries(log: StateLog, file: str) -> StateLog:
    """A log without orders in which each time that a robot carries a load is an order.

    Raises InputError for a log without loads.
    """
    samples = log.samples
    begins = (np.diff(samples.load, prepend=0) != 0) | (np.diff(samples.robot, prepend=-1) != 0)
    number = np.cumsum(begins & (samples.load > 0))
    if not number[-1]:
        raise InputError("has neither orders nor loads, so nothing can be compared", file)
    order = np.where(samples.load > 0, number, 0).astype(np.int32)
    names = tuple(map(str, range(1, int(number[-1]) + 1)))
    return log._replace(samples=samples._replace(order=order), orders=names)


def clock_setting(site: ComparedSite, begin: int, before: float = 0) -> Override:
    """The clock of a scenario at the start of a log, or some seconds before."""
    clock = site.base.unrefined.scenario.units.scale.clock
    offset = 0 if clock is None or clock.offset is None else clock.offset
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
    scenario, written = site.base.unrefined.scenario, written_orders(site)
    file: dict[str, Any] = {"file": str(path.resolve())}
    file |= {"time": site.order_time} if site.order_time else {}
    file |= {"columns": dict(site.order_columns)} if site.order_columns else {}
    if scenario.orders.lines is not None:
        section = {"lines": {**options_in(written, "lines"), **file}}
        return DayOrders(section, same_numbers(log), np.zeros(0), ())
    transports = {**options_in(written, "transports"), **file}
    settings = (
        *site.settings,
        clock_setting(site, begin, SECONDS_OF_DAY),
        Override(f"--orders {path}", ("orders",), {"transports": transports}),
    )
    listed = resolve(site.scenario, settings).unrefined.scenario.orders.listed or ()
    tick = scenario.units.scale.tick_seconds
    releases = np.array([order.release for order in listed]) - int(SECONDS_OF_DAY / tick)
    names = order_names(transports, path)
    code = {name: number for number, name in enumerate(log.orders)}
    codes = np.array([code.get(name, NIL) for name in names] or [NIL] * len(listed))
    chosen = np.flatnonzero((releases < ticks) & ((releases >= 0) | (codes != NIL)))
    if not len(chosen):
        raise InputError("no order is released during the log", str(path))
    release = np.maximum(releases[chosen], 0)
    entries = [
        {
            "from": list(order.ends[0]),
            "to": list(order.ends[1]),
            "release": int(at),
            "weight": order.weight,
            "priority": order.priority,
        }
        for order, at in zip(map(listed.__getitem__, chosen.tolist()), release, strict=True)
    ]
    number_of = np.full(len(log.orders) + 1, NIL)
    known = np.flatnonzero(codes[chosen] != NIL)
    number_of[codes[chosen[known]]] = known
    notes = [f"{count(len(chosen), 'order')} of {path.name}"]
    if len(known) < MIN_RECOVERED * len(log.orders):
        notes.append(
            "the orders of the log are not named in the file, so lead times begin when a robot takes "
            "the order"
        )
        return DayOrders({"list": entries}, same_numbers(log), np.zeros(0), tuple(notes))
    return DayOrders({"list": entries}, number_of, release * float(tick), tuple(notes))


def written_orders(site: ComparedSite) -> Mapping[str, Any]:
    """The section `orders` as the scenario has it, before its files were read."""
    data, _ = parse(site.base.source, None)
    orders: Mapping[str, Any] = override(Document(data), site.settings).data.get("orders") or {}
    return orders


def options_in(orders: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """How the file in a section of orders is read; {} if the section names no file."""
    section = orders.get(key)
    return section if isinstance(section, dict) and "file" in section else {}


def same_numbers(log: StateLog) -> Array:
    """The numbers of the orders of a log as they are; the last entry is that of no order."""
    return np.append(np.arange(len(log.orders)), NIL)


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


def recovered_orders(
    log: StateLog, place: RobotTracks, floor_plan: FloorPlan, begin: int, tick: float, file: str
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
            complete[code] = ends, list(floor_plan.xy(source)), list(floor_plan.xy(target))
    if len(complete) < MIN_RECOVERED * max(len(log.orders), 1):
        share = percent(len(complete) / max(len(log.orders), 1), 0)
        text = f"shows both ends of only {share} of its orders"
        raise InputError(f"{text}; name the file of orders by --orders", file)
    longest = np.quantile([ends.done - ends.taken for ends, *_ in complete.values()], TAIL_SHARE)
    last = int(log.samples.time.max()) - 2 * longest
    entries: list[dict[str, Any]] = []
    number_of = np.full(len(log.orders) + 1, NIL)
    for code, (ends, source_xy, target_xy) in sorted(
        complete.items(), key=lambda item: item[1][0].taken
    ):
        if ends.taken <= last:
            number_of[code] = len(entries)
            release = max(0, math.floor((ends.taken - begin) / 1000 / tick))
            entries.append({"from": source_xy, "to": target_xy, "release": release})
    if not entries:
        raise InputError("is too short: no order is done well before its end", file)
    notes = [f"{count(len(entries), 'order')} recovered, each released when a robot takes it"]
    if left := len(log.orders) - len(entries):
        notes.append(f"{count(left, 'order')} left out: they cross the start, or come near the end")
    return DayOrders({"list": entries}, number_of, np.zeros(0), tuple(notes))


class OrderEnds(NamedTuple):
    """When an order was taken and done, and the last messages before its load appears and disappears."""

    taken: int  # milliseconds since 1970
    done: int
    pick: int
    drop: int


def ends_of_orders(log: StateLog) -> Iterator[tuple[int, OrderEnds]]:
    """Yield the number and the ends of each order whose load appears and disappears in the log."""
    samples = log.samples
    rows = np.flatnonzero(samples.order)
    rows = rows[np.lexsort((samples.time[rows], samples.order[rows]))]
    codes, first = np.unique(samples.order[rows], return_index=True)
    for code, own in zip(codes.tolist(), np.split(rows, first[1:]), strict=True):
        loaded = own[samples.load[own] > 0]
        if not len(loaded):
            continue
        pick, drop = int(loaded[0]) - 1, int(loaded[-1])
        if pick >= 0 and drop + 1 < len(samples.time):
            robot = samples.robot[[pick, pick + 1, drop, drop + 1]]
            if (
                robot[0] == robot[1] and robot[2] == robot[3]
            ):  # else it crosses the start or the end
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
