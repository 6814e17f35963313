"""What a fleet did, in one form for logs and for simulated runs: samples of all robots at equal times.

    time        0   P   2P  3P          row k: the states at k P seconds after the start
    robot 0     A   A   B   B           a log: the last message up to half a period later
    robot 1     C   C   C   D           a run: the state after that tick

All quantities that are compared come from these samples, so that the period of the messages has the same
effect on both sides.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.log_on_floor import RobotTracks
from automaton.calibration.state_log import MAX_GAP_MS, StateLog
from automaton.engine.state import NIL
from automaton.runs.headless import Sampling, run_to_end
from automaton.runs.simulation import Simulation

Array = np.ndarray[Any, Any]

HOUR_S: Final = 3600
BUSIEST: Final = 5  # cells whose headways are compared
MIN_ENTRIES: Final = 3  # of a cell, for a headway
ORDERS_AN_HOUR: Final = "orders an hour"
LEAD_TIME: Final = "lead time"
LEAD_TIME_P50: Final = "lead time p50"
LEAD_TIME_P95: Final = "lead time p95"
ORDER_SHARE: Final = "time on orders"
EMPTY_SHARE: Final = "empty share"
PICK_TIME: Final = "time at pick-ups"
DROP_TIME: Final = "time at drop-offs"
HOURLY: Final = "hour "  # prefixes of quantities that are there several times
HEADWAY: Final = "headway "
STRETCH: Final = "stretch "


class FleetTrace(NamedTuple):
    """Samples of n robots at k times."""

    period: float  # seconds between two samples
    cell: (
        Array  # (k, n) int32 flat cell that a robot is in or leaves; NIL: off the floor, not known
    )
    order: Array  # (k, n) int32 its order; NIL: none
    load: Array  # (k, n) bool

    @property
    def hours(self) -> int:
        """Hours begun."""
        return int(-(-(len(self.cell) - 1) * self.period // HOUR_S))


class MeasurePlan(NamedTuple):
    """How a trace is measured: equal for a day and all of its runs."""

    ticks: int  # of a sample
    samples: int
    period: float  # seconds between two samples
    stretch_of: Array  # (cells,) int32 the stretch of each cell, or NIL
    stretches: int
    busiest: tuple[int, ...]  # cells
    by_load: bool  # the log names no orders: what a robot carries stands for its order
    # (m,) seconds after the start in which each order was released; (): lead times begin when a robot
    # takes the order.
    released: Array


def empty_trace(period: float, rows: int, robots: int) -> FleetTrace:
    """A trace without robots, to be filled."""
    shape = rows, robots
    cell, order = np.full(shape, NIL, np.int32), np.full(shape, NIL, np.int32)
    return FleetTrace(period, cell, order, np.zeros(shape, np.bool_))


def trace_of_log(
    log: StateLog, place: RobotTracks, begin: int, period: float, rows: int
) -> FleetTrace:
    """The trace of a log from `begin`, in milliseconds since 1970, with `rows` samples."""
    samples, robots = log.samples, len(log.robots)
    trace = empty_trace(period, rows, robots)
    times = begin + np.arange(rows) * 1000 * period
    for robot, own_rows in enumerate(log.rows_of_robots()):
        own = samples.time[own_rows]
        row = np.searchsorted(own, times + 500 * period, side="right") - 1
        age = times - own[np.maximum(row, 0)]
        known = (row >= 0) & (age <= MAX_GAP_MS + 1000 * period)
        at = own_rows.start + row[known]
        trace.cell[known, robot] = place.cell[at]
        trace.order[known, robot] = samples.order[at] - 1
        trace.load[known, robot] = samples.load[at] > 0
    return trace


class TraceSampler:
    """Takes the samples of a simulated run."""

    def __init__(self, plan: MeasurePlan, robots: int) -> None:
        self.ticks, self.by_load = plan.ticks, plan.by_load
        self.trace = empty_trace(plan.period, plan.samples, robots)

    def __call__(self, simulation: Simulation) -> None:
        """Store the state after the present tick."""
        row, robots = simulation.tick // self.ticks, simulation.world.robots
        if row < len(self.trace.cell):
            index = robots.at_index
            cell = np.where(robots.cell == NIL, robots.bay, robots.cell)
            self.trace.cell[row] = cell[index]
            self.trace.order[row] = (robots.load if self.by_load else robots.order)[index]
            self.trace.load[row] = robots.load[index] != NIL


def measured_run(simulation: Simulation, plan: MeasurePlan) -> dict[str, float]:
    """Run to the end, and measure what a log of the run would show."""
    sampler = TraceSampler(plan, len(simulation.world.robots.cell))
    run_to_end(simulation, sampling=Sampling(plan.ticks, sampler, None))
    return measured(sampler.trace, plan)


def measured(trace: FleetTrace, plan: MeasurePlan) -> dict[str, float]:
    """All quantities of a trace, in seconds, orders and shares; nan where a day has no such event."""
    taken, done, order = orders_of(trace)
    begin = plan.released[order] if len(plan.released) else taken * trace.period
    end = (done + 1) * trace.period  # in the first sample without the order
    lead = (end - begin)[done < len(trace.cell) - 1]
    end = end[done < len(trace.cell) - 1]
    hours = np.bincount((end // HOUR_S).astype(np.int64), minlength=trace.hours)
    moved = np.diff(trace.cell, axis=0) != 0
    moved &= (trace.cell[1:] != NIL) & (trace.cell[:-1] != NIL)
    entries = int(moved.sum())
    dwell = rows_at_once(trace)
    at_work = (trace.cell != NIL) & (trace.order != NIL)
    at_work[1:] |= moved
    seconds = np.bincount(
        plan.stretch_of[trace.cell[at_work]] + 1, minlength=plan.stretches + 1
    )  # the first: cells of no stretch
    return {
        ORDERS_AN_HOUR: len(lead) * HOUR_S / ((len(trace.cell) - 1) * trace.period),
        LEAD_TIME: float(lead.mean()) if len(lead) else np.nan,
        LEAD_TIME_P50: float(np.quantile(lead, 0.5)) if len(lead) else np.nan,
        LEAD_TIME_P95: float(np.quantile(lead, 0.95)) if len(lead) else np.nan,
        ORDER_SHARE: float((trace.order != NIL).mean()),
        PICK_TIME: standing_time(trace, dwell, ~trace.load[:-1] & trace.load[1:]),
        DROP_TIME: standing_time(trace, dwell, trace.load[:-1] & ~trace.load[1:]),
        EMPTY_SHARE: float((moved & ~trace.load[1:]).sum() / entries) if entries else np.nan,
        **{f"{HOURLY}{k}": float(many) for k, many in enumerate(hours[: trace.hours].tolist())},
        **{
            f"{HEADWAY}{k}": headway(moved, trace.cell[1:], cell, trace.period)
            for k, cell in enumerate(plan.busiest)
        },
        **{f"{STRETCH}{k}": many * trace.period for k, many in enumerate(seconds[1:].tolist())},
    }


def orders_of(trace: FleetTrace) -> tuple[Array, Array, Array]:
    """First row and last row of each order, and its number, by number."""
    row, robot = np.nonzero(trace.order != NIL)
    number, which = np.unique(trace.order[row, robot], return_inverse=True)
    first, last = np.full(len(number), len(trace.order)), np.full(len(number), NIL)
    np.minimum.at(first, which, row)
    np.maximum.at(last, which, row)
    return first, last, number


def rows_at_once(trace: FleetTrace) -> Array:
    """(k, n) how many rows in sequence a robot is in the cell of each row with the order of that row."""
    cell, order = trace.cell, trace.order
    rows, edge = np.arange(len(cell))[:, None], np.ones((1, cell.shape[1]), np.bool_)
    moved = (cell[1:] != cell[:-1]) | (order[1:] != order[:-1])
    first = np.maximum.accumulate(np.where(np.concatenate((edge, moved)), rows, 0))
    ends = np.where(np.concatenate((moved, edge)), rows, len(cell))
    last = np.minimum.accumulate(ends[::-1])[::-1]
    out: Array = last - first + 1
    return out


def standing_time(trace: FleetTrace, dwell: Array, changes: Array) -> float:
    """The mean time that robots stand where their load changes, in seconds; nan without a change.

    `changes`: (k - 1, n) bool, between two rows. The load may change at the begin or the end of an
    operation, so the cell of the longer stay counts. Robots that are also blocked there would hide small
    differences of the operation, so the mean is that of the shorter half.
    """
    row, robot = np.nonzero(changes)
    if not len(row):
        return np.nan
    rows = np.sort(np.maximum(dwell[row, robot], dwell[row + 1, robot]))
    return float(rows[: (len(rows) + 1) // 2].mean()) * trace.period


def headway(moved: Array, into: Array, cell: int, period: float) -> float:
    """The mean time between two entries of robots into a cell, in seconds."""
    rows = np.nonzero(moved & (into == cell))[0]
    return float(np.diff(rows).mean()) * period if len(rows) >= MIN_ENTRIES else np.nan


def entries_of(trace: FleetTrace, cells: int) -> Array:
    """(cells,) how often robots enter each cell."""
    into, before = trace.cell[1:], trace.cell[:-1]
    moved = (into != before) & (into != NIL) & (before != NIL)
    return np.bincount(into[moved], minlength=cells)
