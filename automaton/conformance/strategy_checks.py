"""The checks of a strategy, each on one case: what a child process runs.

A check returns its findings; the digests of a run are compared by `trace`, at every 50th tick.
"""

from __future__ import annotations

import gc
import importlib
import math
import os
import threading
import time
import traceback
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from random import Random
from typing import Any, Final, NamedTuple, TypeAlias

import msgspec
import numpy as np

from automaton.conformance.probed_calls import (
    GuardProbe,
    Probe,
    SightProbe,
    WriteProbe,
    guard_states,
)
from automaton.conformance.random_cases import (
    CASE_TICKS,
    delivery_floor,
    odd_case,
    open_floor,
    random_case,
    with_strategy,
)
from automaton.engine.jit.numba_parts import event
from automaton.errors import InputError
from automaton.runs.illegal_decisions import illegal_decisions
from automaton.runs.simulation import Simulation
from automaton.runs.state_copy import RunState, captured, restore
from automaton.strategy import lookup
from automaton.strategy.patience import NoAnswer

TRACE_STEP: Final = 50  # ticks between compared digests
BRANCH_TICK: Final = 150
JIT_TICKS: Final = 60
MEMORY_SPAN: Final = (1_000, 3_000)
TRACED_LIMIT: Final = 64 << 10
RESIDENT_LIMIT: Final = 1 << 20
CROWDS: Final = (10, 20, 40, 80)  # robots in the measurement of time
STORAGE_ORDERS: Final = 3
MAX_OVERTIMES: Final = 2  # decisions that take too long, until the strategy is not asked any more
OVERTIME_S: Final = 2.0  # a decision that the limit has not ended after so long ends the process
LONGEST_RAISED: Final = 200  # characters of an exception


Reply: TypeAlias = dict[str, Any]  # what a child process answers to a task


class Failure(NamedTuple):
    """What a check reports about a case; tick and robot: NIL if unknown."""

    check: str
    text: str
    times: int = 1
    tick: int = -1
    robot: int = -1
    is_note: bool = False


class StrategyRaisedError(Exception):
    """The strategy has raised something; the text says what and where."""


class CaseRefusedError(Exception):
    """The strategy refuses a case; the text is its sentence."""


class Subject:
    """A strategy and the cases of a check: a name, its layer, its parameters, a seed, a scenario."""

    def __init__(self, request: dict[str, Any]) -> None:
        self.name = request["strategy"]
        self.layer = request["layer"] or layer_of(self.name)
        self.parameters = request.get("parameters") or {}
        self.seed, self.scenario = request["seed"], request.get("scenario")
        self.patience = request["timeout"]
        self.overtimes = 0
        self.cases: dict[int, Any] = {}  # what a case resolves to, or its refusal
        self.kind = lookup.load(self.layer, self.name)

    @property
    def choice(self) -> Any:
        """The strategy as a scenario names it."""
        return {"name": self.name, **self.parameters} if self.parameters else self.name

    @property
    def is_compiled(self) -> bool:
        """Whether its decisions are compiled."""
        return self.kind.compiled is not None

    def document(self, number: int) -> dict[str, Any]:
        """The content of a case."""
        if self.scenario is not None:
            return {**self.scenario, "seed": self.seed + number}
        return random_case(self.seed, number, self.layer)

    def case(self, number: int) -> Any:
        """The case of a number with the strategy. Raises CaseRefusedError."""
        if number not in self.cases:
            try:
                self.cases[number] = self.resolved(self.document(number))
            except CaseRefusedError as refusal:
                self.cases[number] = refusal
        case = self.cases[number]
        if isinstance(case, CaseRefusedError):
            raise case
        return case

    def resolved(self, document: dict[str, Any]) -> Any:
        """A floor with the strategy. Raises CaseRefusedError."""
        try:
            return with_strategy(document, self.layer, self.choice)
        except InputError as error:
            raise CaseRefusedError(str(error)) from None

    def run(self, resolved: Any, probe: type[Probe] | None = None, storage: Any = None) -> Any:
        """A new run of a case; `probe`: the class of a probe around the strategy."""
        with self.raising():
            if probe is None:
                return Simulation(resolved, storage=storage, patience=self.patience)
            strategies = []
            for layer, choice in resolved.choices[:5]:
                one: Any = None
                if choice.name != lookup.NO_STRATEGY:
                    one = lookup.load(layer, choice.name)(choice.parameters)
                strategies.append(probe(one) if layer == self.layer else one)
            run = Simulation(resolved, strategies=strategies, patience=self.patience)
            self.probe_of(run).run = run
            return run

    def probe_of(self, run: Any) -> Any:
        """The strategy of the layer in a run."""
        return next(one for one in run.strategies if one is not None and one.layer == self.layer)

    def go(self, run: Any, until: int) -> None:
        """Run to a tick. Raises StrategyRaisedError."""
        with self.raising(), OVERTIME.watching(run, self.patience):
            run.run(until=until)

    @contextmanager
    def raising(self) -> Iterator[None]:
        """Turn what the strategy raises into StrategyRaisedError, with file and line."""
        try:
            yield
        except (InputError, PermissionError):
            raise
        except BaseException as error:  # a strategy may raise anything
            raise StrategyRaisedError(self.described(error)) from error

    def described(self, error: BaseException) -> str:
        """What was raised and where, in one sentence."""
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if is_foreign(frame.filename)]
        frame = (own or frames)[-1]
        first = f"{type(error).__name__}: {error}".split("\n")[0][:LONGEST_RAISED]
        return f"{first} ({os.path.basename(frame.filename)}:{frame.lineno})"


def layer_of(name: str) -> str:
    """The layer of a class "module:Class". Raises InputError."""
    module, _, kind = name.partition(":")
    layer = "allocation"  # the error for what cannot be imported names one
    with suppress(ImportError):
        layer = getattr(getattr(importlib.import_module(module), kind, None), "layer", layer)
    return layer


def is_foreign(file: str) -> bool:
    """Whether a source file belongs neither to this package nor to a library or to Python."""
    return "/automaton/" not in file and "/lib/python" not in file and "<" not in file


class Compilations(event.Listener):  # type: ignore[misc]
    """Counts the kernels that are being compiled."""

    def __init__(self) -> None:
        self.under_way = 0

    def on_start(self, event: Any) -> None:
        self.under_way += 1

    def on_end(self, event: Any) -> None:
        self.under_way -= 1


class OvertimeGuard:
    """Ends this process while a decision takes far too long: compiled code cannot be stopped."""

    def __init__(self) -> None:
        self.run: Any = None  # what runs now
        self.patience = 0.0
        self.begun = 0  # how many runs have begun
        self.thread: threading.Thread | None = None

    @contextmanager
    def watching(self, run: Any, patience: float) -> Iterator[None]:
        """Watch a run while inside."""
        if self.thread is None:
            self.thread = threading.Thread(target=self.watch, daemon=True)
            self.thread.start()
        self.patience = patience
        self.begun += 1
        self.run = run
        try:
            yield
        finally:
            self.run = None

    def watch(self) -> None:
        """Compare the state of the run with that of a moment ago, for ever.

        A decision may wait for its kernels to be compiled for as long as that takes.
        """
        compilations = Compilations()
        event.register("numba:compile", compilations)
        last, since = None, time.monotonic()
        while True:
            time.sleep(min(0.5, self.patience / 4))
            run = self.run
            now = None if run is None else (self.begun, run.tick, run.python_decisions)
            if now is None or now != last or compilations.under_way:
                last, since = now, time.monotonic()
            elif time.monotonic() - since > self.patience + OVERTIME_S:
                os._exit(OVERTIME_CODE)


OVERTIME_CODE: Final = 97  # exit code of a process that ended itself
OVERTIME: Final = OvertimeGuard()


def trace(
    subject: Subject,
    run: Any,
    last: int = CASE_TICKS,
    every: int = TRACE_STEP,
    at: Callable[[Any], None] = lambda run: None,
) -> list[list[int]]:
    """Run on to a tick; the digests of all arrays at every 50th tick, where `at` is called."""
    out = []
    while run.tick < last and not run.finished:
        subject.go(run, min(last, (run.tick // every + 1) * every))
        out.append([run.tick, *map(int, run.digests())])
        at(run)
    return out


def trace_and_halfway(subject: Subject, run: Any) -> tuple[list[list[int]], list[RunState]]:
    """The trace of a run, and its state at tick 150, unless it ended before."""
    halfway: list[RunState] = []

    def keep_state(run: Any) -> None:
        if run.tick == BRANCH_TICK and not run.finished:
            halfway.append(captured(run.world, run.observation, run.states, []))

    return trace(subject, run, at=keep_state), halfway


def first_difference(subject: Subject, some: Any, other: Any, from_tick: int = 0) -> str:
    """The first tick and array in which two new runs differ."""
    from automaton.engine.digest import DIGEST_NAMES

    pairs = zip(trace(subject, some, every=1), trace(subject, other, every=1), strict=False)
    for one, two in pairs:
        if one[0] > from_tick and one != two:
            k = next(k for k, pair in enumerate(zip(one, two, strict=True)) if pair[0] != pair[1])
            return f"first at tick {one[0]}, in {DIGEST_NAMES[k - 1]}"
    return "not again when the runs are repeated tick by tick"


# Checks of every case.


def check_case(subject: Subject, number: int, only: str | None, reply: Reply) -> None:
    """Legality, repeats, storage and branches on a case; the trace is for the parent."""
    resolved = subject.case(number)

    def enter(check: str, failures: Iterable[Failure]) -> None:
        if only in (None, check):
            reply["found"].extend(failures)
            reply["tried"].append(check)

    run = subject.run(resolved)
    base, halfway = trace_and_halfway(subject, run)
    enter("legality", legality(subject, run, resolved))
    again = subject.run(resolved, Probe)
    repeated = trace(subject, again)
    reply["decisions"] = getattr(subject.probe_of(again), "decisions", 0)
    enter("repeats", repeats(subject, resolved, base, repeated))
    enter("storage", storage(subject, resolved, base, number))
    enter("branches", branches(subject, resolved, base, halfway))
    reply["trace"] = base


def repeats(subject: Subject, resolved: Any, base: Any, repeated: Any) -> Iterator[Failure]:
    """The same digests in two runs of one process."""
    if repeated != base:
        where = first_difference(subject, subject.run(resolved), subject.run(resolved))
        yield Failure("repeats", f"two runs in one process differ, {where}")


def legality(subject: Subject, run: Any, resolved: Any) -> Iterator[Failure]:
    """The illegal decisions of the layer."""
    illegal = illegal_decisions(run.world, resolved.floor_plan)
    many = sum(times for layer, _, times in illegal.by_rule if layer == subject.layer)
    if many:
        first = next((one for one in illegal.first if one.layer == subject.layer), None)
        text = "" if first is None else f"{first.words}"
        tick = -1 if first is None else first.tick
        robot = -1 if first is None or first.robot is None else first.robot
        yield Failure("legality", text, many, tick, robot)


def storage(subject: Subject, resolved: Any, base: Any, number: int) -> Iterator[Failure]:
    """The same digests if robots are stored in up to three other orders."""
    for order in storage_orders(resolved.scenario.fleet.robots, number):
        if trace(subject, subject.run(resolved, storage=order)) != base:
            other = subject.run(resolved, storage=order)
            where = first_difference(subject, subject.run(resolved), other)
            yield Failure("storage", f"robots stored in another order change the run, {where}")
            return


def storage_orders(robots: int, number: int) -> list[Any]:
    """Three random orders of robots; one or two robots have fewer."""
    drawn = (Random(f"{number} {k}").sample(range(robots), robots) for k in count())
    wanted = min(STORAGE_ORDERS, math.factorial(min(robots, 3)) - 1)
    orders: list[list[int]] = [list(range(robots))]
    while len(orders) <= wanted:
        order = next(drawn)
        if order not in orders:
            orders.append(order)
    return [np.array(order, np.int32) for order in orders[1:]]


def branches(
    subject: Subject, resolved: Any, base: Any, halfway: list[RunState]
) -> Iterator[Failure]:
    """The same digests if the run is rebuilt from its arrays at tick 150; none if it ended before."""
    for state in halfway:
        after = subject.run(resolved)
        subject.go(after, 0)
        restore(state, after.world, after.observation, after.states, [])
        after.update_finished()
        rest = trace(subject, after)
        if rest != [row for row in base if row[0] > BRANCH_TICK]:
            text = "keeps state outside its arrays: branches begin from tick 0"
            yield Failure("branches", text, is_note=not subject.is_compiled)


# Checks of some cases.


def survival(subject: Subject, number: int) -> list[Failure]:
    """Odd cases: one robot; no order; none is free; all down; orders that some robots cannot do."""
    resolved = subject.resolved(odd_case(subject.document(number), number))
    subject.go(subject.run(resolved), CASE_TICKS)
    return []


def writes(subject: Subject, number: int) -> list[Failure]:
    """Nothing changes but the strategy's rows, state and workspace."""
    run = subject.run(subject.case(number), WriteProbe)
    subject.go(run, CASE_TICKS)
    return of_probe("writes", subject.probe_of(run))


def information(subject: Subject, number: int) -> list[Failure]:
    """Under limits of information, decisions depend on nothing that is hidden."""
    resolved = subject.case(number)
    if resolved.scenario.information == "everything":
        raise CaseRefusedError("the case does not limit information")
    run = subject.run(resolved, SightProbe)
    subject.go(run, CASE_TICKS)
    probe = subject.probe_of(run)
    with subject.raising():
        probe.replay()
    return of_probe("information", probe)


def of_probe(check: str, probe: Any) -> list[Failure]:
    """The breaches that a probe has noticed, as one failure."""
    if not probe.breaches:
        return []
    first = probe.breaches[0]
    return [Failure(check, first.text, len(probe.breaches), first.tick, first.robot)]


def jit(subject: Subject, number: int, reply: Reply) -> None:
    """The digests at tick 60; with the JIT off, with guarded arrays."""
    from automaton.engine.jit.kernel import jit_is_on

    run = subject.run(subject.case(number), Probe if jit_is_on() else GuardProbe)
    reply["trace"] = trace(subject, run, JIT_TICKS, JIT_TICKS)
    reply["decisions"] = subject.probe_of(run).decisions


def grown(subject: Subject, number: int) -> list[Failure]:
    """Memory of a Python strategy between ticks 1,000 and 3,000.

    What grows is measured again, since modules and caches that are loaded once are not leaks.
    """
    if not growth(subject, number):
        return []
    text = growth(subject, number)
    return [Failure("memory", text)] if text else []


def growth(subject: Subject, number: int) -> str:
    """How much the memory of a run grows, in words; "" if hardly."""
    first, last = MEMORY_SPAN
    document = subject.document(number)
    document = {**document, "stop": {"when": "never", "max_duration": last}}
    run = subject.run(subject.resolved(document))
    subject.go(run, first)
    tracemalloc.start()
    try:
        gc.collect()
        resident, traced = resident_bytes(), tracemalloc.get_traced_memory()[0]
        subject.go(run, last)
        gc.collect()
        more = tracemalloc.get_traced_memory()[0] - traced
    finally:
        tracemalloc.stop()
    resident = resident_bytes() - resident
    if more > TRACED_LIMIT:
        return f"{more >> 10:,} KiB more objects at tick {last:,} than at tick {first:,}"
    return f"{resident >> 20:,} MiB more at tick {last:,}" if resident > RESIDENT_LIMIT else ""


def resident_bytes() -> int:
    """Resident memory of this process; 0 where only Linux could say it."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except FileNotFoundError:
        return 0


# Checks on floors of their own.


def delivery(subject: Subject, number: int) -> list[Failure]:
    """One robot with 5 orders, or 4 robots: something is delivered."""
    floor = delivery_floor(subject.layer, number)
    run = subject.run(subject.resolved(floor))
    subject.go(run, floor["stop"]["max_duration"])
    done = int((run.world.orders.delivered >= 0).sum())
    if done:
        return []
    robots, orders = len(run.world.robots.cell), len(run.world.orders.state)
    who = f"{robots} robot{'s' * (robots > 1)} ({floor['fleet']['kinematics']})"
    text = f"{who} delivered 0 of {orders} orders in {run.tick:,} ticks"
    return [Failure("delivery", text)]


def timing(subject: Subject, number: int, reply: Reply) -> None:
    """Times of calls on one floor with 10, 20, 40 or 80 robots: [ns of a decision, ...]."""
    robots = CROWDS[number]
    row = "t" + "." * 18 + "t"
    rows = [row if y % 5 == 0 else "." * 20 for y in range(20)]
    floor = open_floor(subject.layer, "\n".join(rows), robots, "omni")
    loop = {"closed_loop": {"in_system": robots}}
    floor["orders"] = {"generator": "stations", "count": 1_000, "arrivals": loop}
    floor["stop"] = {"when": "never", "max_duration": CASE_TICKS}
    run = subject.run(subject.resolved(floor), Probe)
    subject.go(run, CASE_TICKS)
    probe = subject.probe_of(run)
    spare = probe.entering_ns(run.arguments(run.strategies.index(probe)))
    ns = [max(0, took - spare) / many for took, many in probe.ns]
    reply |= {"robots": robots, "ns": [round(one) for one in ns]}


def contract(subject: Subject, number: int) -> Iterator[Failure]:
    """The class, its parameters and what it declares, on a run of the first case."""
    kind = subject.kind
    if not (kind.__doc__ or "").strip():
        yield Failure("contract", f"{kind.__name__} has no docstring: `list` shows its line")
    try:
        if not subject.parameters:
            kind.Parameters()
    except TypeError as error:
        yield Failure("contract", f"Parameters have no defaults: {error}")
    try:
        msgspec.json.schema(kind.Parameters)
    except TypeError as error:
        yield Failure("contract", f"Parameters have no JSON Schema: {error}")
    with suppress(CaseRefusedError):
        subject.run(subject.case(number))


SOME_CASES: Final[dict[str, Callable[[Subject, int], Iterable[Failure]]]] = {
    "contract": contract,
    "survival": survival,
    "writes": writes,
    "information": information,
    "memory": grown,
    "delivery": delivery,
}


def answer(subject: Subject, task: dict[str, Any]) -> Reply:
    """Do a task of the parent: a check on a case. What a strategy raises fails `survival`.

    `tried` names the checks that came to their end. A strategy that has often decided for too long is
    not asked any more.
    """
    reply: Reply = {"found": [], "tried": []}
    if subject.overtimes >= MAX_OVERTIMES:
        return reply
    try:
        do(subject, task, reply)
    except CaseRefusedError as refusal:
        reply["refused"] = str(refusal)
    except StrategyRaisedError as error:
        subject.overtimes += isinstance(error.__cause__, NoAnswer)
        name = "jit" if task["check"] == "jit" else "survival"
        reply["found"].append(Failure(name, str(error)))
        reply["is_outside"] = isinstance(error.__cause__, IndexError)
    except PermissionError as error:
        reply["found"].append(Failure("writes", str(error)))
    except InputError as error:
        written = "has written to" in str(error)
        reply["found"].append(Failure("writes" if written else "contract", str(error)))
    return reply


def do(subject: Subject, task: dict[str, Any], reply: Reply) -> None:
    """Do a task and enter what is found."""
    check, number = task["check"], task["case"]
    if check == "size":
        resolved = subject.case(number)
        cells = int(np.count_nonzero(resolved.floor_plan.drivable))
        reply["size"] = cells * resolved.scenario.fleet.robots
        reply["is_limited"] = resolved.scenario.information != "everything"
    elif check == "case":
        check_case(subject, number, task.get("only"), reply)
        return
    elif check == "trace":
        run = subject.run(subject.case(number))
        reply["trace"] = trace(subject, run, every=task.get("every", TRACE_STEP))
    elif check == "jit":
        jit(subject, number, reply)
    elif check == "time":
        timing(subject, number, reply)
    else:
        reply["found"].extend(SOME_CASES[check](subject, number))
    reply["tried"].append(check)


def reply_to(line: str | bytes, subjects: dict[str, Subject]) -> bytes:
    """The reply to a task, both as JSON; `subjects` keeps the strategies between tasks."""
    task = msgspec.json.decode(line)
    key = str([(name, task[name]) for name in ("strategy", "layer", "seed", "parameters")])
    try:
        if key not in subjects:
            subjects[key] = Subject(task)
        subject = subjects[key]
        reply = answer(subject, task)
        reply |= {"layer": subject.layer, "compiled": subject.is_compiled}
    except InputError as error:
        reply = {"bad_input": str(error)}
    return msgspec.json.encode(reply)


def work() -> None:
    """Read tasks as lines of JSON, and answer each with a line; the body of a child process."""
    import sys

    from automaton.engine.jit.kernel import COMPILATIONS, jit_is_on

    COMPILATIONS.announced = sys.stderr.isatty()  # there the parent shows its progress
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a strategy prints goes to stderr
    if not jit_is_on():
        guard_states()
    subjects: dict[str, Subject] = {}
    for line in sys.stdin:
        replies.write(reply_to(line, subjects) + b"\n")
        replies.flush()
