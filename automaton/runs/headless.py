"""One run without a screen: to its end or its limit, with a diagnosis if it does not finish.

Metrics may start after a warm-up and be split into stretches of time: counters are read at the end of
each stretch; orders and parts store their own ticks.
"""

from __future__ import annotations

import dis
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from types import FrameType
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from automaton.drawings.floor_svg import FloorPicture
from automaton.engine.jit.kernel import seconds_compiled
from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_DOWN,
    ACTION_QUEUE,
    ACTION_WAIT,
    NIL,
    ORDER_DELIVERED,
    ORDER_UNRELEASED,
    ORDER_WAITING,
    Array,
)
from automaton.errors import InputError
from automaton.printable import one_line
from automaton.runs import interruption
from automaton.runs.illegal_decisions import (
    NO_ILLEGAL_DECISIONS,
    IllegalDecisions,
    illegal_decisions,
)
from automaton.runs.metrics import (
    OPERATION_STATES,
    Counted,
    counted,
    metrics_by_robot,
    metrics_by_type,
    metrics_of,
    sums_of_orders,
    sums_of_parts,
    uses_of_run,
)
from automaton.runs.periods import Period, PeriodMarks
from automaton.runs.progress import Jam, asked_orders, largest_jam
from automaton.runs.run_diagnosis import (
    JamWatch,
    describe_unfinished_run,
    find_wait_cycles,
    stalled_robots,
)
from automaton.runs.simulation import RECORD_TICKS, Simulation
from automaton.runs.task_metrics import (
    metrics_by_charger,
    metrics_by_class,
    metrics_by_priority,
    metrics_by_station,
    summed,
    sums_of_detours,
    tasks_after,
)
from automaton.scenario.unavailable_metrics import warm_up_of
from automaton.world.resolved import Resolved, StrategyChoice

# Ticks between two checks of the clock and of Ctrl-C. A multiple of the ticks that a recording buffers,
# so that checks change no recording; 5 robots take 0.3 ms for them.
WINDOW_TICKS = 4 * RECORD_TICKS
ACTIONS_WORKING = [action for action in OPERATION_STATES if action != ACTION_WAIT]
ACTIONS_AWAY = [ACTION_CHARGE, ACTION_QUEUE, ACTION_DOWN]

OnWindow = Callable[[Simulation], None]


class OrdersExhausted(NamedTuple):
    """When the orders of a run ran out before its end."""

    taken: int  # tick in which the last order was taken
    delivered: int | None  # tick of the last delivery; None: not all are delivered


class LongestDeadlock(NamedTuple):
    """The longest deadlock of a run, and how many there were."""

    deadlocks: int
    ticks: int  # that the longest one lasted
    first_tick: int  # of the longest one
    cell: tuple[int, int]  # [x, y] of its first robot


class Outcome(NamedTuple):
    """The result of a run."""

    finished: bool  # whether the run met its stop condition, or reached its last tick without one
    ticks: int  # number of executed ticks
    orders: int  # number of customer orders
    delivered: int  # number of delivered customer orders
    digest: str  # digest of the final state, 16 hex digits
    wall_s: float | None  # seconds of the run, without start-up; None for a replay
    metrics: dict[str, float | int]  # metrics by name, times in ticks
    robots: list[dict[str, Any]]  # metrics of each robot
    diagnosis: str  # why the run did not finish, as a phrase; "" if it did
    stopped: bool  # whether the run was stopped at the requested tick
    circles: list[tuple[int, ...]]  # the robots of each wait cycle at the end
    jam: Jam | None  # the largest jam at the end, or None
    ran_out: OrdersExhausted | None  # when orders ran out, if the run goes on without orders
    types: Sequence[dict[str, Any]] = ()  # metrics by type of robot, if there are several
    stations: Sequence[dict[str, Any]] = ()  # metrics by station, if robots carry pods to stations
    chargers: Sequence[dict[str, Any]] = ()  # metrics by charger, if robots have batteries
    priorities: Sequence[dict[str, Any]] = ()  # metrics by priority, if there are several
    classes: Sequence[dict[str, Any]] = ()  # metrics by class, if orders have classes
    uses: Mapping[str, int] = {}  # robot ticks by use
    periods: Sequence[Period] = ()  # the run by hour, or by other periods
    by_period: bool = False  # whether periods were requested, and there are two at least
    deadlock: LongestDeadlock | None = None  # the longest deadlock, or None
    illegal: IllegalDecisions = NO_ILLEGAL_DECISIONS  # illegal decisions of strategies
    tables: Any = None  # tables, of `simulate(tables=True)`: automaton.tables.table_files.Tables
    picture: FloorPicture | None = None  # the floor while robots were busy, of `simulate`
    headline: Sequence[Sequence[str]] = ()  # the metrics that matter first, in words, of `simulate`
    recording: Any = None  # the recording, of `simulate(record=FILE)`: python_api.RecordedRun

    def film(self, **options: Any) -> Any:
        """Return the run as a film for a notebook; see RecordedRun.film.

        Raises InputError if the run was not recorded.
        """
        if self.recording is None:
            raise InputError(
                'this run was not recorded: simulate(..., record="run.rec") records it'
            )
        return self.recording.film(**options)

    def _repr_html_(self) -> str:
        """Show robots at work, how the run ended, and its main metrics, in a notebook."""
        words = f"finished in tick {self.ticks:,}"
        if not self.finished:
            words = f"not finished after tick {self.ticks:,}: {self.diagnosis}"
        shown = "" if self.picture is None else self.picture._repr_html_()
        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th>"
            f"<td style='text-align:left'>{escape(value)}</td></tr>"
            for name, value in self.headline
        )
        return f"{shown}<p>{escape(words)}</p><table>{rows}</table>"


class BusyPicture:
    """The floor at the last look at which at least half of the robots had an order.

    If this never happened, at the last of the looks at which most robots had one. After tick t the next
    look is at t + max(1, t // LOOKS), so that long runs have few.
    """

    LOOKS: Final = 16  # the next look is after this part of the run so far

    def __init__(self) -> None:
        self.picture: FloorPicture | None = None
        self._most = 0  # robots with an order, at most half of the fleet

    def run(self, simulation: Simulation, until: int, advance: Callable[[int], None]) -> None:
        """Advance a run to tick `until` or to its end, and look on the way."""
        while simulation.tick < until and not simulation.finished:
            advance(min(until, simulation.tick + max(1, simulation.tick // self.LOOKS)))
            orders = simulation.world.robots.order
            busy = min(int((orders != NIL).sum()), (len(orders) + 1) // 2)
            if busy >= self._most:
                self._most, self.picture = busy, simulation.picture()


def run_to_end(
    simulation: Simulation,
    on_window: OnWindow | None = None,
    last_worked: Array | None = None,
    until: int | None = None,
    sampling: Sampling | None = None,
    watch: JamWatch | BusyPicture | None = None,
    marks: PeriodMarks | None = None,
) -> float:
    """Run to the stop condition, tick `until` or the limit; return seconds without compilation.

    `on_window` is called at the start and after every WINDOW_TICKS ticks. `last_worked` is an output,
    (n,) int64: the end of the last window in which each stored robot worked. `watch` reports jams,
    `marks` keeps what was counted at the ends of periods.
    """
    limit = simulation.resolved.scenario.stop.max_duration
    limit = limit if until is None else min(limit, until)
    begun = time.perf_counter() - seconds_compiled()
    worked = operations(simulation)

    def advance(end: int) -> None:
        while marks is not None and marks.next_mark(simulation.tick) < end:
            go_on(marks.next_mark(simulation.tick))
            if simulation.finished:
                return
            marks.look(simulation)
        go_on(end)
        if marks is not None:
            marks.look(simulation)

    def go_on(end: int) -> None:
        if sampling is None:
            simulation.run(end)
        else:
            sampling.advance(simulation, end)

    if on_window is not None:
        on_window(simulation)
    if sampling is not None and sampling.period:
        sampling.on_sample(simulation)
    while not simulation.finished and simulation.tick < limit:
        end = min(simulation.tick + WINDOW_TICKS, limit)
        if watch is None:
            advance(end)
        else:
            watch.run(simulation, end, advance)
        if last_worked is not None:
            worked = record_work(simulation, worked, last_worked)
        if on_window is not None:
            on_window(simulation)
    return time.perf_counter() - begun - seconds_compiled()


def record_work(simulation: Simulation, before: Array, last_worked: Array) -> Array:
    """Record the present tick for robots that did more than wait since `before`; return operations.

    A robot off the floor, in its parking bay or in repair, does not count as waiting.
    """
    now = operations(simulation)
    last_worked[(now != before) | (simulation.world.robots.parked == 1)] = simulation.tick
    return now


def operations(simulation: Simulation) -> Array:
    """(n,) int64: operations of each stored robot, plus its ticks of charging, queueing and downtime.

    Waits are not included. The sum grows whenever a robot does anything but wait.
    """
    tally = simulation.world.tally
    total: Array = tally.operations[:, ACTIONS_WORKING].sum((1, 2)) + tally.ticks[
        :, ACTIONS_AWAY
    ].sum((1, 2))
    return total


@contextmanager
def attribute_strategy_errors(resolved: Resolved) -> Iterator[None]:
    """Convert an exception that a strategy raises inside to an InputError that names the strategy."""
    try:
        yield
    except InputError:
        raise
    except BaseException as error:  # a strategy may raise anything
        explained = None if is_from_outside(error) else strategy_failure(error, resolved)
        if explained is None:
            raise
        raise explained from error


def run_once(
    resolved: Resolved,
    on_record: Callable[[Simulation], None] | None = None,
    on_window: OnWindow | None = None,
    until: int | None = None,
    on_end: OnWindow | None = None,
    patience: float | None = None,
    sampling: Sampling | None = None,
    watch: JamWatch | BusyPicture | None = None,
    every: int = 0,
) -> Outcome:
    """Run a scenario with its own seed to its end or to tick `until`, then call `on_end`.

    `patience`: seconds that a Python strategy has for each decision. `sampling`: samples to take
    during the run. `watch` reports jams. `every`: ticks of a period of the outcome; 0: any.

    Raises InputError if a strategy raises an exception.
    """
    last_worked = np.zeros(resolved.scenario.fleet.robots, np.int64)
    with attribute_strategy_errors(resolved):
        on_observe = None if sampling is None else sampling.on_observe
        simulation = Simulation(
            resolved, on_record=on_record, on_observe=on_observe, patience=patience
        )
        marks = PeriodMarks(every)
        wall = run_to_end(simulation, on_window, last_worked, until, sampling, watch, marks)
    if on_end is not None:
        on_end(simulation)
    return outcome_of(simulation, last_worked, marks, wall, until)


def outcome_of(
    simulation: Simulation,
    last_worked: Array | None = None,
    marks: PeriodMarks | None = None,
    wall: float | None = None,
    until: int | None = None,
) -> Outcome:
    """The result of a run that is over. `last_worked`: (n,) tick in which each robot last worked."""
    if last_worked is None:
        last_worked = np.zeros(len(simulation.world.robots.cell), np.int64)
    marks = marks or PeriodMarks()
    orders = asked_orders(simulation.world)
    finished = is_finished(simulation)
    return Outcome(
        finished=finished,
        ticks=simulation.tick,
        orders=len(orders.done),
        delivered=int((orders.done != NIL).sum()),
        digest=simulation.digest,
        wall_s=wall,
        metrics=metrics_of(simulation),
        robots=metrics_by_robot(simulation),
        diagnosis="" if finished else describe_unfinished_run(simulation, last_worked),
        stopped=not finished and simulation.tick == until,
        circles=find_wait_cycles(simulation.world, stalled_robots(simulation, last_worked)),
        jam=largest_jam(simulation.world, simulation.resolved.floor_plan),
        ran_out=orders_exhausted(simulation),
        types=metrics_by_type(simulation),
        stations=metrics_by_station(simulation),
        chargers=metrics_by_charger(simulation),
        priorities=metrics_by_priority(simulation),
        classes=metrics_by_class(simulation),
        uses=uses_of_run(simulation),
        periods=marks.periods(simulation),
        by_period=marks.is_fixed and simulation.tick > marks.ticks,
        deadlock=longest_deadlock(simulation),
        illegal=illegal_decisions(simulation.world, simulation.resolved.floor_plan),
    )


def longest_deadlock(simulation: Simulation) -> LongestDeadlock | None:
    """The longest deadlock of a run, or None; of several that lasted as long, the first one."""
    deadlocks = simulation.world.deadlocks.count
    if not deadlocks.total:
        return None
    cell = simulation.resolved.floor_plan.xy(int(deadlocks.longest_cell))
    return LongestDeadlock(
        int(deadlocks.total), int(deadlocks.longest), int(deadlocks.longest_begin), cell
    )


def is_finished(simulation: Simulation) -> bool:
    """Whether a run is complete: its stop condition holds, or it came to a limit that is an end."""
    scenario = simulation.resolved.scenario
    is_over = simulation.tick >= scenario.stop.max_duration
    return simulation.finished or (is_over and scenario.ends_at_limit)


def orders_exhausted(simulation: Simulation) -> OrdersExhausted | None:
    """When the orders of a run ran out; None if they did not, or if it ends with its orders."""
    orders, stop = simulation.world.orders, simulation.resolved.scenario.stop
    is_open = (orders.state == ORDER_UNRELEASED) | (
        (orders.state == ORDER_WAITING) & (orders.reserved_by == NIL)
    )
    taken = int(orders.dispatched.max(initial=0))
    if not len(orders.state) or stop.when != "never" or is_open.any() or taken >= simulation.tick:
        return None
    done = bool((orders.state == ORDER_DELIVERED).all())
    return OrdersExhausted(taken, int(orders.delivered.max()) if done else None)


class CountedStretches(NamedTuple):
    """The counters of a run at the end of its warm-up, and of each stretch but the last."""

    warm_up: Counted | None  # None: metrics cover the whole run
    stretches: list[Counted]


def run_marked(
    simulation: Simulation,
    every: int = 0,
    watch: JamWatch | BusyPicture | None = None,
    periods: PeriodMarks | None = None,
) -> CountedStretches:
    """Run to the end; `every`: length of a stretch in ticks, 0 for no stretches.

    `periods` keeps what was counted at the ends of periods.
    """
    scenario = simulation.resolved.scenario
    warm_up, limit = warm_up_of(scenario), scenario.stop.max_duration
    borders = range(every, limit, every) if every else range(0)
    at = {}
    for tick in sorted({*borders, *((warm_up,) if warm_up else ())}):
        run_to_end(simulation, until=tick, watch=watch, marks=periods)
        if simulation.tick == tick:
            at[tick] = counted(simulation)
        if simulation.tick == warm_up:
            simulation.world.deadlocks.count.longest = (
                0  # of those that end later, it is entered again
            )
    run_to_end(simulation, watch=watch, marks=periods)
    return CountedStretches(at.get(warm_up), [at[tick] for tick in borders if tick in at])


def sums_by_stretch(simulation: Simulation, stretches: list[Counted]) -> dict[str, list[int]]:
    """Return the sums of metric_sums in each stretch of a finished run; the last ends with the run."""
    ends = [*stretches, counted(simulation)]
    borders = np.array([0, *(one.tick for one in ends)])
    so_far = {name: [one.sums.get(name, 0) for one in ends] for name in ends[-1].sums}
    sums = {name: np.diff(values, prepend=0) for name, values in so_far.items()}
    sums["ticks"] = np.diff(borders)
    sums["robot_ticks"] = sums["ticks"] * len(simulation.world.robots.cell)
    sums |= sums_of_orders(simulation.world, borders)
    sums |= sums_of_parts(simulation.world, borders)
    sums |= sums_of_detours(simulation, borders)
    if simulation.resolved.scenario.measure is not None:
        tasks = tasks_after(simulation, 0)
        sums |= {name: summed(tasks.begun, v, borders) for name, v in tasks.sums.items()}
    return {name: values.tolist() for name, values in sums.items()}


# Samples taken during a run: one every `period` ticks, and its observations.


Take = Callable[[Simulation], None]


class Sampling(NamedTuple):
    """Samples of a run. The run pauses between ticks for each sample, which does not change the run."""

    period: int  # ticks; 0: no samples
    on_sample: Take  # called after tick 0 and after each period
    on_observe: Take | None  # as for Simulation; None: no observation

    def advance(self, simulation: Simulation, until: int) -> None:
        """Advance a run to tick `until` or to its end, and take the samples on the way."""
        if not self.period:
            simulation.run(until)
            return
        while simulation.tick < until and not simulation.finished:
            due = (simulation.tick // self.period + 1) * self.period
            simulation.run(min(due, until))
            if simulation.tick == due:
                self.on_sample(simulation)


# The error message if a strategy raises an exception: strategy, exception, and place in its file.


MAX_ERROR_LENGTH = 300  # characters of the exception's message

# The functions that call a strategy's own code. Their locals name its choice or the strategy.
CALLS = {
    function.__code__
    for function in (
        Simulation._decide,
        Simulation._state,
        Simulation._load_strategy,
        Simulation._validate_strategy,
    )
}


def strategy_failure(error: BaseException, resolved: Resolved) -> InputError | None:
    """The message about an exception that a strategy raised; None if it came from elsewhere."""
    frames = list(traceback.walk_tb(error.__traceback__))
    for depth, (frame, _) in enumerate(frames):
        if frame.f_code in CALLS:
            layer, choice = _choice(frame.f_locals, resolved)
            inner = frames[depth + 1 :]
            return _sentence(error, choice.name, layer, _place(frame, inner))
    return None


def is_from_outside(error: BaseException) -> bool:
    """Whether an error comes from a signal to this process, not from a strategy.

    A signal interrupts at any instruction; a strategy's own KeyboardInterrupt comes from a `raise`.
    """
    place = error.__traceback__
    if type(error) is not KeyboardInterrupt or place is None:
        return isinstance(error, KeyboardInterrupt)
    while place.tb_next is not None:
        place = place.tb_next
    if place.tb_frame.f_globals.get("__name__") == interruption.__name__:
        return True  # raised by a signal handler
    return dis.opname[place.tb_frame.f_code.co_code[place.tb_lasti]] != "RAISE_VARARGS"


def _choice(names: dict[str, Any], resolved: Resolved) -> tuple[str, StrategyChoice]:
    """The layer and the choice of the called strategy, from the caller's locals."""
    if "choice" in names:
        return names["layer"], names["choice"]
    strategy = names["strategy"]
    for layer, choice in resolved.choices:
        if layer == strategy.layer and choice.parameters is strategy.parameters:
            return layer, choice
    return strategy.layer, resolved.strategies[strategy.layer]


def _place(called_from: FrameType, inner: list[tuple[FrameType, int]]) -> str:
    """file:line of the deepest frame in the strategy's own file, else of the deepest frame."""
    if not inner:
        return ""
    strategy = called_from.f_locals.get("strategy")
    module = sys.modules.get(type(strategy).__module__)
    file = getattr(module, "__file__", "")
    own = [place for place in inner if place[0].f_code.co_filename == file]
    frame, line = (own or inner)[-1]
    return f" ({frame.f_code.co_filename}:{line})"


def _sentence(error: BaseException, name: str, layer: str, place: str) -> InputError:
    try:
        what = one_line(" ".join(str(error).split()), MAX_ERROR_LENGTH)
    except Exception:  # the exception's own __str__ may raise
        what = ""
    raised = f"{type(error).__name__}: {what}" if what else type(error).__name__
    title = layer.replace("_", "-")
    return InputError(f"the {title} strategy '{name}' raised {raised}{place}; --debug shows where")


# A run that is created or computed again, by the rules of its past.


class BranchRecorder(Protocol):
    """A recorder of a run whose rules change, such as automaton.recording.recorder."""

    def __call__(self, simulation: Simulation) -> None: ...
    def change(self, simulation: Simulation, settings: tuple[str, ...]) -> None: ...


class PastRules(NamedTuple):
    """Rules that apply after a tick."""

    tick: int
    resolved: Resolved
    settings: tuple[str, ...]  # KEY=VALUE settings of a branch; () at the start


def made(past: Sequence[PastRules], seed: int) -> Simulation:
    """Create a run at its first tick under its last rules, so that its saved states fit its arrays."""
    run = Simulation(past[0].resolved, seed)
    for rules in past[1:]:
        run = run.continue_with(rules.resolved)
    return run


def computed(
    past: Sequence[PastRules], seed: int, tick: int, recorder: BranchRecorder | None = None
) -> Simulation:
    """Compute a run from its start to a tick; record it if a recorder is given.

    Raises InputError if a strategy raises an exception.
    """
    with attribute_strategy_errors(past[-1].resolved):
        run = Simulation(past[0].resolved, seed, on_record=recorder)
        for rules in past[1:]:
            run.run(rules.tick)
            run = run.continue_with(rules.resolved)
            if recorder is not None:
                recorder.change(run, rules.settings)
        run.run(tick)
    return run
