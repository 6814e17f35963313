"""Check a strategy on random floors: does it keep the contract, and only that?

    from automaton.conformance import conformance

    conformance("mine:Eager", floors=50)  # AssertionError with the page of the verdict if it does not

The strategy runs in child processes, so that a crash or an endless loop ends a case and not the check.
"""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, NamedTuple, TypeAlias

from automaton.documents.text_output import terminal_width, wrapped
from automaton.errors import InputError, nearest
from automaton.units import count

CONFORMANCE_CHECKS: Final = {
    "contract": "class, parameters, declarations and reset",
    "legality": "decisions that break no rule",
    "survival": "nothing raised, no crash, no endless decision",
    "repeats": "equal digests again, and in another process",
    "jit": "equal digests without the compiler; indices inside",
    "storage": "equal digests however robots are stored",
    "writes": "nothing written but its own rows and state",
    "memory": "memory that does not grow",
    "information": "nothing decided by what is hidden",
    "delivery": "something delivered on easy floors",
    "branches": "a run goes on from its arrays",
    "time": "CPU time of a decision",
}
OF_A_CASE: Final = ("legality", "repeats", "storage", "branches")  # checked on every case
PAGE_WIDTH: Final = 100
MANY_REFUSED: Final = 0.8
SLOW_NS: Final = 1_000_000
STEEP: Final = 1.5
OVERTIME_CODE: Final = 97  # of automaton.conformance.strategy_checks
MAX_DEATHS: Final = 2  # of a child process, until the strategy is not asked any more
DELIVERY_FLOORS: Final = 6
SMALLEST_CASES: Final = 20  # that run without the compiler
DEATH: Final = (1, -1, -1, 0)  # of a finding: times, no tick, no robot, not a note
EARLIER_CASE: Final = "an earlier case may have broken its memory"
OK, FAILS, NOTE, LEFT_OUT = "ok", "FAILS", "note", "left out"
CHILD_PROGRAM: Final = (
    "import sys, json; sys.path[:] = json.loads(sys.argv[1]); "
    "from automaton.conformance.strategy_checks import work; work()"
)


Task: TypeAlias = dict[str, Any]
# Called with what is done, such as "case 37 of 200", and at the beginning with the whole: "200 cases".
Progress: TypeAlias = Callable[[str, str], None]


class CheckRequest(NamedTuple):
    """What is checked, and how."""

    strategy: str  # "module:Class", or "layer:name"
    floors: int = 200
    seed: int = 1
    only: str | None = None
    case: int | None = None
    scenario: str | None = None  # its name or file, for the commands
    document: Mapping[str, Any] | None = None  # its content
    parameters: Mapping[str, Any] | None = None
    timeout: float = 60.0

    def wants(self, check: str) -> bool:
        """Whether a check is to be done."""
        return self.only in (None, check)

    def command(self, check: str, case: int | None) -> str:
        """The command that repeats a check on a case."""
        words = ["automaton", "check-strategy", self.strategy, "--only", check]
        words += [] if case is None else ["--case", str(case)]
        words += [] if self.seed == 1 else ["--seed", str(self.seed)]
        words += [] if self.scenario is None else ["--scenario", self.scenario]
        if self.parameters:
            words += ["--parameters", json.dumps(dict(self.parameters))]
        return shlex.join(words)


class CheckResult(NamedTuple):
    """A line of the verdict."""

    name: str
    verdict: str
    cases: int
    times: int = 0
    text: str = ""
    case: int | None = None
    tick: int | None = None
    robot: int | None = None
    command: str = ""


class Verdict(NamedTuple):
    """The results of all checks."""

    strategy: str
    layer: str
    compiled: bool
    cases: int
    refused: int
    decisions: int
    checks: tuple[CheckResult, ...]
    ns: dict[str, float | None]
    refusal: str = ""  # the first one

    @property
    def conforms(self) -> bool:
        """Whether no check fails."""
        return all(check.verdict != FAILS for check in self.checks)

    def lines(self, width: int | None = PAGE_WIDTH) -> list[str]:
        """The page, in lines of at most `width` characters, or as wide as the terminal; but for
        commands.
        """
        width = terminal_width() if width is None else width
        form = "compiled" if self.compiled else "Python"
        answer = "conforms" if self.conforms else "does not conform"
        head = f"{self.strategy} ({self.layer.replace('_', ' ')}, {form}) {answer}: "
        head += f"{count(self.cases, 'case')}, {self.refused} refused, "
        out = [*wrapped(head + count(self.decisions, "decision"), width), ""]
        for one in self.checks:
            what = one.text or f"{CONFORMANCE_CHECKS[one.name]} ({count(one.cases, 'case')})"
            out += wrapped(what, width, f"{one.name:12} {one.verdict:9} ", " " * 23)
            if one.command:
                out.append(f"    {one.command}")
        if self.refusal and self.refused > MANY_REFUSED * self.cases:
            out += ["", *wrapped(f"Most cases are refused: {self.refusal}", width)]
        return out

    def as_json(self) -> dict[str, Any]:
        """The verdict as one object."""
        fields = ("name", "verdict", "text", "case", "tick", "robot", "command")
        head = ("strategy", "layer", "compiled", "cases", "refused", "decisions", "conforms")
        checks = [
            {field: getattr(one, field) for field in fields} | {"count": one.times}
            for one in self.checks
        ]
        return {name: getattr(self, name) for name in head} | {"checks": checks, "ns": self.ns}


def conformance(
    strategy: str,
    floors: int = 200,
    *,
    seed: int = 1,
    only: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    timeout: float = 60.0,
) -> Verdict:
    """Check a strategy, "module:Class" or "layer:name", like `automaton check-strategy`.

    Raises AssertionError with the page of the verdict if it does not conform, and InputError for a
    strategy that cannot be loaded or that refuses all cases.
    """
    request = CheckRequest(strategy, floors, seed, only, parameters=parameters, timeout=timeout)
    verdict = checked(request)
    if not verdict.conforms:
        raise AssertionError("\n".join(verdict.lines()))
    return verdict


# Child processes.


class Child:
    """A process that does tasks one after another; it is started again when it dies."""

    def __init__(self, hash_seed: int, has_jit: bool = True) -> None:
        self.environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed)}
        if not has_jit:
            self.environment["NUMBA_DISABLE_JIT"] = "1"
        self.process: subprocess.Popen[str] | None = None
        self.strategy, self.deaths = "", 0  # the strategy, and how often it ended the process

    def ask(self, task: dict[str, Any]) -> dict[str, Any]:
        """Do a task; a process that dies fails `survival`."""
        strategy = f"{task['layer']}:{task['strategy']}"
        if strategy != self.strategy:
            self.strategy, self.deaths = strategy, 0
        if self.deaths == MAX_DEATHS:
            return {"found": []}
        is_fresh = self.process is None
        reply = self.reply_to(task)
        if "death" not in reply:
            return reply
        self.deaths += 1
        if is_fresh or reply["death"] == OVERTIME_CODE:
            return reply
        alone = self.reply_to(task)
        if "death" in alone:
            return alone
        text = f"{reply['found'][0][1]}, but not when it did this case alone: {EARLIER_CASE}"
        return alone | {
            "found": [["survival", text, *DEATH], *alone["found"]],
            "death": reply["death"],
        }

    def reply_to(self, task: dict[str, Any]) -> dict[str, Any]:
        """Do a task; the reply names the exit code as `death` if the process dies."""
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-c", CHILD_PROGRAM, json.dumps(sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env=self.environment,
            )
        process = self.process
        assert process.stdin is not None and process.stdout is not None
        line = ""
        try:
            process.stdin.write(json.dumps(task) + "\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except BrokenPipeError:
            pass
        if line:
            reply: dict[str, Any] = json.loads(line)
            return reply
        self.close()
        code, seconds = process.returncode, task["timeout"]
        if code == OVERTIME_CODE:
            text = f"decides for longer than {seconds:g} s (--strategy-timeout)"
        elif code < 0:
            text = f"the process died by {signal.Signals(-code).name}"
        else:
            text = f"the process ended with code {code}"
        return {"found": [["survival", text, *DEATH]], "death": code}

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            assert self.process.stdin is not None
            self.process.stdin.close()
            self.process.wait()
            self.process = None


class Children:
    """Two processes with different hash seeds, and two without the compiler."""

    def __init__(self) -> None:
        self.pair = [Child(1), Child(2)]
        self.plain = [Child(1, has_jit=False), Child(1, has_jit=False)]
        self.pool = ThreadPoolExecutor(2)

    def side_by_side(
        self,
        tasks: Iterable[list[Task]],
        pair: Iterable[Any] | None = None,
        done: Callable[[Task], None] = lambda _: None,
    ) -> list[list[dict[str, Any]]]:
        """The replies to two lists of tasks, one for each of a pair of processes.

        `done` is called after each task, by two threads.
        """

        def all_of(child: Child, some: list[Task]) -> list[dict[str, Any]]:
            replies = []
            for task in some:
                replies.append(child.ask(task))
                done(task)
            return replies

        return list(self.pool.map(all_of, pair or self.pair, tasks))

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        for child in (*self.pair, *self.plain):
            child.close()
        self.pool.shutdown()


# The check.


class StrategyCheck:
    """The checks of a strategy, and what they have found so far."""

    def __init__(self, request: CheckRequest, children: Children, progress: Progress) -> None:
        self.request, self.children, self.progress = request, children, progress
        layer, _, name = request.strategy.partition(":")
        is_named = layer in ("zoning", "charging", "allocation", "routing", "right_of_way")
        self.task = {
            "layer": layer if is_named else None,
            "strategy": name if is_named else request.strategy,
            "seed": request.seed,
            "scenario": request.document,
            "parameters": request.parameters,
            "timeout": request.timeout,
        }
        only = request.case
        self.numbers = list(range(request.floors)) if only is None else [only]
        self.found: dict[str, list[tuple[int | None, list[Any]]]] = defaultdict(list)
        self.asked: dict[str, int] = {}  # cases of each check, and those that it came to the end of
        self.tried: dict[str, int] = defaultdict(int)
        self.accepted: dict[int, dict[str, Any]] = {}
        self.refused, self.refusal = 0, ""
        self.layer, self.compiled = "", False
        self.has_died = False  # a process, by a signal
        self.outside: list[int] = []  # cases with an index outside an array

    def of(self, check: str, numbers: Iterable[int], **more: Any) -> list[dict[str, Any]]:
        """Tasks of a check."""
        return [{**self.task, "check": check, "case": number, **more} for number in numbers]

    def counted(self, total: int, unit: str, more: str = "") -> Callable[[Task], None]:
        """Begin to show how many tasks of a kind are done; what to call after each."""
        done = iter(range(1, total + 1))
        self.progress(f"{unit} 0 of {total:,}{more}", f"{count(total, unit)}{more}")

        def count_one(task: Task) -> None:
            if task["check"] != "trace":  # the second run of a case
                self.progress(f"{unit} {next(done, total):,} of {total:,}{more}", "")

        return count_one

    def enter(self, case: int | None, reply: dict[str, Any]) -> None:
        """Enter the findings of a reply. Raises InputError if the strategy cannot be loaded."""
        if "bad_input" in reply:
            raise InputError(reply["bad_input"])
        self.layer, self.compiled = (
            reply.get("layer", self.layer),
            reply.get("compiled", self.compiled),
        )
        for check, *rest in reply.get("found", ()):
            self.found[check].append((case, rest))
        for check in reply.get("tried", ()):
            self.tried[check] += 1
        self.has_died |= reply.get("death", 0) < 0

    def check_contract(self) -> None:
        """The class, and which cases the strategy accepts. Raises InputError if none."""
        shown = self.counted(len(self.numbers), "case", " looked at")
        first = self.children.pair[0].ask(self.of("contract", self.numbers[:1])[0])
        self.enter(self.numbers[0], first)
        self.asked["contract"] = 1
        halves = [self.of("size", some) for some in (self.numbers[::2], self.numbers[1::2])]
        replies = self.children.side_by_side(halves, done=shown)
        for half, some in zip(halves, replies, strict=True):
            for task, reply in zip(half, some, strict=True):
                if "refused" in reply:
                    self.refused += 1
                    self.refusal = self.refusal or reply["refused"]
                    continue
                self.enter(task["case"], reply)
                self.accepted[task["case"]] = reply
        self.accepted = dict(sorted(self.accepted.items()))
        if not self.accepted:
            raise InputError(f"no case is accepted: {self.refusal}", self.request.strategy)

    def check_cases(self) -> None:
        """Legality, repeats, storage and branches on every case, in two processes."""
        replies, others = self.replies_to_cases()
        for number, reply in replies.items():
            self.enter(number, reply)
            self.accepted[number] |= reply
        for name in OF_A_CASE:
            self.asked[name] = len(self.accepted)
        for number, other in others.items():
            reply = self.accepted[number]
            if "trace" not in reply or "trace" not in other:
                self.tried["repeats"] -= "repeats" in reply["tried"]
                continue
            repeats = not any(case == number for case, _ in self.found["repeats"])
            if repeats and reply["trace"] != other["trace"]:
                where = self.difference(number)
                text = f"a process with another hash seed runs differently, {where}"
                self.found["repeats"].append((number, [text, *DEATH]))

    def replies_to_cases(self) -> list[dict[int, dict[str, Any]]]:
        """The replies to `case` by number, and to `trace`, which the other process runs."""
        checks = ("case", "trace") if self.request.wants("repeats") else ("case",)
        halves: list[list[dict[str, Any]]] = [[], []]
        for k, number in enumerate(self.accepted):
            for check in checks:
                which = (k + (check == "trace")) % 2
                halves[which] += self.of(check, [number], only=self.request.only)
        replies: dict[str, dict[int, dict[str, Any]]] = {"case": {}, "trace": {}}
        shown = self.counted(len(self.accepted), "case")
        for half, some in zip(halves, self.children.side_by_side(halves, done=shown), strict=True):
            for task, reply in zip(half, some, strict=True):
                replies[task["check"]][task["case"]] = reply
        return [dict(sorted(some.items())) for some in replies.values()]

    def difference(self, number: int) -> str:
        """The first tick in which two processes differ."""
        tasks = self.of("trace", [number], every=1)
        pair = [replies[0]["trace"] for replies in self.children.side_by_side([tasks, tasks])]
        rows = zip(*pair, strict=False)
        tick = next((one[0] for one, other in rows if one != other), None)
        return "not again tick by tick" if tick is None else f"first at tick {tick}"

    def check_some(self) -> None:
        """The checks that take some of the cases."""
        known = list(self.accepted)
        share = len(known)
        by_decisions = sorted(known, key=lambda k: -self.accepted[k].get("decisions", 0))
        chosen = {
            "survival": known[: max(5, share // 8)],
            "writes": known[::5],
            "information": [k for k in known if self.accepted[k].get("is_limited")][
                : max(2, share // 5)
            ],
            "delivery": list(range(DELIVERY_FLOORS)),
            "memory": [] if self.compiled else by_decisions[: 5 if share >= 50 else 1],
        }
        if self.request.case is not None:
            chosen = {check: [self.request.case] for check in chosen}
        tasks = []
        for check, numbers in chosen.items():
            if self.request.wants(check) and numbers:
                self.asked[check] = len(numbers)
                tasks += self.of(check, numbers)
        if not tasks:
            return
        names = ", ".join(dict.fromkeys(task["check"] for task in tasks))
        shown = self.counted(len(tasks), "run", f" for {names}")
        halves = [tasks[::2], tasks[1::2]]
        every = self.children.side_by_side(halves, done=shown)
        for half, replies in zip(halves, every, strict=True):
            for task, reply in zip(half, replies, strict=True):
                self.enter(task["case"], reply)

    def check_jit(self, numbers: list[int]) -> None:
        """A compiled strategy without the compiler, then with it where no index is outside."""
        self.asked["jit"] = self.asked.get("jit", 0) + len(numbers)
        tasks = self.of("jit", numbers)
        halves = [tasks[::2], tasks[1::2]]
        shown = self.counted(len(tasks), "case", " without the compiler")
        plain = self.children.side_by_side(halves, self.children.plain, shown)
        sound = [
            [task for task, reply in zip(half, replies, strict=True) if "trace" in reply]
            for half, replies in zip(halves, plain, strict=True)
        ]
        pairs = zip(sound, self.children.side_by_side(sound), strict=True)
        compiled = {
            task["case"]: reply
            for some, replies in pairs
            for task, reply in zip(some, replies, strict=True)
        }
        for half, replies in zip(halves, plain, strict=True):
            for task, reply in zip(half, replies, strict=True):
                case, other = task["case"], compiled.get(task["case"], {"found": []})
                self.enter(case, {**reply, "tried": other.get("tried", ())})
                self.enter(case, {**other, "tried": ()})
                self.accepted[case].setdefault("decisions", reply.get("decisions", 0))
                if reply.get("is_outside"):
                    self.outside.append(case)
                if "trace" in other and reply["trace"] != other["trace"]:
                    text = "without the compiler (NUMBA_DISABLE_JIT=1) the run differs at tick 60"
                    self.found["jit"].append((case, [text, *DEATH]))

    def smallest(self) -> list[int]:
        """The cases that run without the compiler: all if nothing else is checked."""
        known = sorted(self.accepted, key=lambda k: (self.accepted[k].get("size", 0), k))
        share = max(2, min(SMALLEST_CASES, len(known) // 10))
        return known if self.request.only == "jit" else known[:share]

    def explain_deaths(self) -> None:
        """Find the case that broke the memory of a process, by running all without the compiler."""
        tried = set(self.smallest())
        rest = [number for number in self.accepted if number not in tried]
        if not self.outside and rest and self.request.wants("jit"):
            self.check_jit(rest)
        if self.outside:
            text = f"an index is outside its array in case {min(self.outside)}, see jit"
            for _, finding in self.found["survival"]:
                if finding[0].startswith("the process"):
                    finding[0] = f"{finding[0].removesuffix(': ' + EARLIER_CASE)}; {text}"

    def times(self) -> dict[str, float | None]:
        """CPU time of a decision in ns, and its slope over 10 to 80 robots."""
        halves = [self.of("time", some) for some in ((0, 1, 2), (3,))]  # 70 robots, and 80
        shown = self.counted(4, "run", " for time")
        replies = [one for half in self.children.side_by_side(halves, done=shown) for one in half]
        self.tried["time"] = sum(bool(reply.get("ns")) for reply in replies)
        timed = [(reply["robots"], sorted(reply["ns"])) for reply in replies if reply.get("ns")]
        every = sorted(ns for _, some in timed for ns in some)
        if not every:
            return {"median": None, "p99": None, "slope": None}
        slope = None
        if len(timed) > 1:
            import math

            points = [
                (math.log(robots), math.log(max(1, some[len(some) // 2]))) for robots, some in timed
            ]
            x = sum(one for one, _ in points) / len(points)
            y = sum(two for _, two in points) / len(points)
            spread = sum((one - x) ** 2 for one, _ in points)
            slope = round(sum((one - x) * (two - y) for one, two in points) / spread, 2)
        p99 = every[min(len(every) - 1, len(every) * 99 // 100)]
        return {"median": every[len(every) // 2], "p99": p99, "slope": slope}

    def result(self, name: str) -> CheckResult:
        """The line of a check."""
        cases, asked = self.tried[name], self.asked.get(name, 0)
        some = sorted(self.found.get(name, []), key=lambda one: -1 if one[0] is None else one[0])
        if not some:
            if name == "jit" and not self.compiled:
                return CheckResult(name, LEFT_OUT, 0, text="it is not compiled")
            if name == "memory" and self.compiled:
                return CheckResult(name, OK, 0, text="compiled kernels cannot allocate")
            if name == "information" and not (asked or self.found["survival"]):
                return CheckResult(name, LEFT_OUT, 0, text="no case limits information")
            return self.unfailing(name, cases, asked)
        case, (text, _, tick, robot, is_note) = some[0]
        many = sum(one[1] for _, one in some)
        where = [f"case {case}"] if case is not None else []
        where += [f"tick {tick}"] if tick >= 0 else []
        where += [f"robot {robot}"] if robot >= 0 else []
        cases_text = count(len({case for case, _ in some}), "case")
        words = "illegal decision" if name == "legality" else "time"
        sentence = f"{count(many, words)} in {cases_text}; first: {', '.join(where)}: {text}"
        return CheckResult(
            name,
            NOTE if is_note else FAILS,
            cases,
            many,
            sentence,
            case,
            tick if tick >= 0 else None,
            robot if robot >= 0 else None,
            self.request.command(name, case),
        )

    def unfailing(self, name: str, cases: int, asked: int) -> CheckResult:
        """The line of a check that has found nothing: it is left out if no case came to its end."""
        if asked and not cases:
            why = "the strategy refuses them"
            if self.found["survival"]:
                why = "the strategy raised or ended the process, see survival"
            return CheckResult(name, LEFT_OUT, 0, text=f"no case could be tried: {why}")
        if cases < asked:
            text = f"{CONFORMANCE_CHECKS[name]} ({count(cases, 'case')}; {asked - cases} not tried)"
            return CheckResult(name, OK, cases, text=text)
        return CheckResult(name, OK, cases)

    def verdict(self) -> Verdict:
        """Do all checks: those without the compiler first, before an index outside an array does harm."""
        wants = self.request.wants
        self.check_contract()
        has_jit_off = self.compiled and wants("jit")
        if has_jit_off:
            self.check_jit(self.smallest())
        if not has_jit_off or self.request.only is None:
            self.check_cases()
        self.check_some()
        if self.compiled and self.has_died:
            self.explain_deaths()
        ns: dict[str, float | None] = {"median": None, "p99": None, "slope": None}
        if wants("time") and self.request.case is None:
            ns = self.times()
        checks = [
            self.result(name) for name in CONFORMANCE_CHECKS if wants(name) and name != "time"
        ]
        raised = self.found.get("survival")
        if self.request.only not in (None, "survival") and raised:
            checks.append(self.result("survival"))
        if wants("time"):
            checks.append(time_line(ns, self.tried["time"]))
        decisions = sum(one.get("decisions", 0) for one in self.accepted.values())
        return Verdict(
            self.request.strategy,
            self.layer,
            self.compiled,
            len(self.numbers),
            self.refused,
            decisions,
            tuple(checks),
            ns,
            self.refusal,
        )


def time_line(ns: Mapping[str, float | None], cases: int) -> CheckResult:
    """The line of the times: a note if they are long, or grow steeply with the fleet."""
    if ns["median"] is None:
        return CheckResult("time", LEFT_OUT, 0, text="no floor with a crowd was accepted")
    median, slope = ns["median"], ns["slope"]
    text = f"{median:,.0f} ns of CPU time for a decision (median), {ns['p99']:,.0f} ns (p99)"
    if slope is not None:
        text += f"; exponent over 10 to 80 robots {slope:g}"
    is_long = median >= SLOW_NS or (slope is not None and slope >= STEEP)
    return CheckResult("time", NOTE if is_long else OK, cases, text=text)


def checked(
    request: CheckRequest,
    progress: Progress = lambda *_: None,
    children: Children | None = None,
) -> Verdict:
    """Check a strategy. Raises InputError if it cannot be loaded, or refuses all cases."""
    if request.only is not None and request.only not in CONFORMANCE_CHECKS:
        hint = nearest(request.only, CONFORMANCE_CHECKS)
        raise InputError(
            f"unknown check {request.only!r}{hint}; there are {', '.join(CONFORMANCE_CHECKS)}"
        )
    if children is not None:
        return StrategyCheck(request, children, progress).verdict()
    with Children() as own:
        return StrategyCheck(request, own, progress).verdict()
