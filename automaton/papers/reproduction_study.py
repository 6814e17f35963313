"""The parts of a reproduction: tables with cases to run, printed figures, and claims to judge.

A case is a line or a cell of a printed table. Each table has a runner that computes the figures of its
cases, from runs of scenarios or from any other `MeasuredRepetition`.
"""

from __future__ import annotations

import importlib
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Literal, Protocol, TypeVar

from automaton.errors import InputError, alternatives, nearest
from automaton.papers.claims import Claim, JudgedClaim, judge
from automaton.scenario.document import Override, parse_setting
from automaton.studies.inference.intervals import Interval, student
from automaton.studies.inference.proportions import exact_share
from automaton.studies.process_pool import OnDone, RunFunction, RunResult, run_all, run_and_measure
from automaton.world.resolve import Resolved, resolve

T = TypeVar("T")
Label = str | int
Key = tuple[Label, ...]  # the labels of a case, in order
Settings = tuple[str | Override, ...]  # changes of a scenario, as `--set` takes them


class MeasuredRepetition(Protocol):
    """One repetition of a case: a run, a trial."""

    @property
    def finished(self) -> bool:
        """Whether the repetition finished."""

    @property
    def metrics(self) -> Mapping[str, float]:
        """The metrics of the repetition, without those that do not apply to it."""


@dataclass(frozen=True)
class Repetition:
    """A repetition without a run of a scenario, such as a trial or a training."""

    metrics: Mapping[str, float]
    finished: bool = True


@dataclass(frozen=True)
class Case:
    """One line or cell of a published table, with its labels."""

    labels: Mapping[str, Label]

    @property
    def key(self) -> Key:
        return tuple(self.labels.values())


@dataclass(frozen=True)
class RunCase(Case):
    """A case that runs a scenario; `settings`: settings of `--set`, which apply last."""

    settings: Settings = field(default=(), kw_only=True)

    @property
    def own_settings(self) -> tuple[str, ...]:
        """The settings that distinguish this case, which `--set` must not replace."""
        return ()

    def check(self) -> None:
        """Check the settings before anything runs. Raises InputError."""


@dataclass(frozen=True)
class ScenarioCase(RunCase):
    """A case that runs a scenario given by name."""

    scenario: str
    overrides: tuple[str, ...]

    @property
    def own_settings(self) -> tuple[str, ...]:
        return self.overrides

    def check(self) -> None:
        self.resolved()

    def resolved(self) -> Resolved:
        """Return the scenario with all changes. Raises InputError."""
        return resolve(self.scenario, (*self.overrides, *self.settings))


# The cases of a table for these strategies.
Cases = Callable[[Sequence[str]], Sequence[Case]]
# (cases, seeds, workers, on_done) -> the repetitions of all seeds, by case.
Runner = Callable[[Sequence[Any], Sequence[int], int | None, OnDone | None], list[list[Any]]]


def fixed(cases: Sequence[Case | Mapping[str, Label]]) -> Cases:
    """These cases, or cases with these labels, for all strategies."""
    found = [case if isinstance(case, Case) else Case(case) for case in cases]
    return lambda strategies: found


def crossed(**levels: Iterable[Label]) -> Cases:
    """Cases for all combinations of these labels, for all strategies; the last label varies fastest."""
    combinations = itertools.product(*levels.values())
    return fixed([dict(zip(levels, labels, strict=True)) for labels in combinations])


# Metrics that have other names in reproductions: symbols of the papers, or older names.
NEVER_ASIDE: Final = 1_000_000  # ticks: the robots of some authors do not break wait cycles
PUBLISHED_NAMES: Final = {
    "makespan": "T_total",
    "operations_per_robot": "T_R",
    "operations": "T_Rtotal",
    "empty_moves_share": "E_U_moves",
    "empty_operations_share": "E_U_operations",
    "empty_ticks_share": "E_U_cycles",
    "throughput_per_robot": "completions",
    "battery_depletions": "ran_empty",
}


def with_published_names(result: RunResult) -> RunResult:
    """Return the result of a run with the metric names of reproductions."""
    metrics = {PUBLISHED_NAMES.get(name, name): value for name, value in result.metrics.items()}
    return result._replace(metrics=metrics)


def scenario_runs(
    conduct: RunFunction = run_and_measure,
    change: Callable[[Resolved, int], Resolved] = lambda resolved, seed: resolved,
    scenario_of: Callable[[Any, Path], Resolved] = lambda case, folder: case.resolved(),
    measured: Callable[[RunResult], RunResult] = with_published_names,
) -> Runner:
    """A table's runner that runs the scenario of each case with each seed by `conduct`.

    `change`: changes a scenario for a seed, beyond the random numbers; `scenario_of`: that of a case,
    which may write files to a folder; `measured`: the result of a run with the metrics of the table.
    """

    def run(
        cases: Sequence[Case],
        seeds: Sequence[int],
        workers: int | None = None,
        on_done: OnDone | None = None,
    ) -> list[list[RunResult]]:
        with TemporaryDirectory() as folder:
            scenarios = [scenario_of(case, Path(folder)) for case in cases]
        results = run_all(scenarios, seeds, workers, on_done, conduct, change)
        return [[measured(result) for result in batch] for batch in results]

    return run


def each_seed(of: Callable[[Any, int], Sequence[Mapping[str, float]]]) -> Runner:
    """A table's runner that computes some repetitions of each case for each seed in this process."""

    def run(
        cases: Sequence[Case],
        seeds: Sequence[int],
        workers: int | None = None,
        on_done: OnDone | None = None,
    ) -> list[list[Repetition]]:
        found: list[list[Repetition]] = [[] for _ in cases]
        for seed in seeds:
            for case, batch in zip(cases, found, strict=True):
                done = [Repetition(figures) for figures in of(case, seed)]
                batch += done
                if on_done is not None:
                    on_done(len(done))
        return found

    return run


def read_once(of: Callable[[Key], Mapping[str, float]]) -> Runner:
    """A table's runner that reads the stored figures of each case, independent of seeds."""
    return lambda cases, *_: [[Repetition(of(case.key))] for case in cases]


def unpublished(key: Key, metric: str) -> float | None:
    """No figure is printed."""
    return None


def without_prototype(key: Key, metric: str) -> tuple[float, float] | None:
    """No independent program has computed it."""
    return None


# Repetitions by key of a case -> (metric, key) and its values, one for each repetition.
Together = Callable[
    [Mapping[Key, Sequence[MeasuredRepetition]]], Iterator[tuple[tuple[str, Key], list[float]]]
]


@dataclass(frozen=True)
class PublishedTable:
    """A published table, and how to reproduce it."""

    cases: Cases
    panels: tuple[tuple[str, ...], ...]  # metrics, grouped as printed
    published: Callable[[Key, str], float | None] = unpublished  # printed figure by case, metric
    title: str = ""  # if a reproduction has several tables
    name: str = ""  # for the choice of tables
    run: Runner = field(default_factory=scenario_runs)
    repetition: str = "run"  # the kind of repetition
    per_seed: int = 1  # number of repetitions per seed
    shares: tuple[str, ...] = ()  # metrics shown in percent
    digits: int = 0  # decimals of the other metrics
    seeds: int = 0  # default number of seeds; 0: that of the reproduction
    usual: bool = True  # whether it is made when no table is chosen
    ranked: bool = False  # whether to show 95 % intervals and ranks of printed figures in our runs
    together: Together | None = None  # figures for claims that combine the runs of several cases
    grouped: int = -1  # lines with equal labels[:grouped] form a group
    spread: Literal["sd", "se"] = "sd"  # shown spread: of single repetitions, or of their mean
    printed_sd: Callable[[Key, str], float | None] = unpublished  # printed sd by case, metric
    # Mean and standard error of an independent program by case, metric.
    prototype: Callable[[Key, str], tuple[float, float] | None] = without_prototype
    premise: str = ""  # the table's premise if tables differ in it; the last label of its cases
    stored: Callable[[], str] | None = None  # origin of figures that are read, not computed

    @property
    def metrics(self) -> tuple[str, ...]:
        return tuple(metric for panel in self.panels for metric in panel)


@dataclass(frozen=True)
class Further:
    """A further result of all runs besides tables: a text with a title, and its data."""

    name: str
    title: str
    text: str
    data: Any


@dataclass(frozen=True)
class Headline:
    """A line of the first screen: the claim that begins with `claim`, or a cell of a table."""

    label: str
    claim: str = ""
    figure: int = 0  # index of the shown figure of the claim
    printed: float | None = None  # the printed number, if no row of a table has it
    cell: tuple[str, Key] | None = None  # metric and key of the case
    unit: str = ""  # of a cell: "%" shows shares times 100
    digits: int = 0


@dataclass(frozen=True)
class Reproduction:
    """The reproduction of a publication."""

    name: str
    title: str
    source: str
    tables: tuple[PublishedTable, ...]
    claims: tuple[Claim, ...]
    remarks: tuple[str, ...]
    strategies: tuple[str, ...] = ()  # strategies of the publication; () if there is no choice
    averaged: tuple[str, ...] = ()  # metrics whose mean |error| is reported
    premise: str = ""  # premise of the claims, if tables differ in it
    headlines: tuple[Headline, ...] = ()  # of the first screen
    seeds: int = 60  # default number of seeds
    texts: Callable[[], Sequence[tuple[str, str]]] | None = None  # (title, text), shown at the end
    further: Callable[[Reproduced], Sequence[Further]] | None = None
    from_data: Callable[[Path], Reproduction] | None = None  # with problems from another folder
    claims_title: str = "The publication's claims"
    remarks_title: str = "Where the publication contradicts itself or leaves things open"


@dataclass(frozen=True)
class FigureRow:
    """A metric of a case: the printed figure (None without one) and ours."""

    case: Mapping[str, Label]
    metric: str
    paper: float | None
    mean: float
    sd: float | None  # of single repetitions, n - 1 in the denominator; None for a single one
    repetitions: int
    ranked: bool = False  # whether interval and rank are reported
    rank: float | None = None  # share of repetitions below the printed figure; ties count half
    exact: Interval | None = None  # Clopper and Pearson's interval of a share of repetitions
    stored: bool = False  # whether it was read from a file
    paper_sd: float | None = None  # printed standard deviation
    prototype: tuple[float, float] | None = None  # mean and standard error of another program

    @property
    def standard_errors(self) -> float | None:
        """The difference to the other program's mean in joint standard errors."""
        if self.prototype is None or self.se is None:
            return None
        joint = math.hypot(self.se, self.prototype[1])
        return (self.mean - self.prototype[0]) / joint if joint else None

    @property
    def se(self) -> float | None:
        """The standard error of the mean."""
        return None if self.sd is None else self.sd / math.sqrt(self.repetitions)

    @property
    def half_width(self) -> float | None:
        """The half-width of the 95 % interval of the mean; None for a single repetition."""
        return None if self.se is None else student(self.repetitions - 1) * self.se

    @property
    def error(self) -> float | None:
        """mean / paper - 1."""
        return self.mean / self.paper - 1 if self.paper else None


@dataclass(frozen=True)
class MadeTable:
    """A reproduced table. Unfinished runs count with their maximum number of ticks."""

    table: PublishedTable
    cases: Sequence[Case]
    results: Sequence[Sequence[MeasuredRepetition]]  # by case, then by seed and repetition
    first_seed: int = 1

    @property
    def repetitions(self) -> int:
        return sum(map(len, self.results))

    @property
    def seeds(self) -> int:
        return len(self.results[0]) // self.table.per_seed if self.results else 0

    @property
    def unfinished(self) -> int:
        return sum(not result.finished for batch in self.results for result in batch)

    def rows(self) -> list[FigureRow]:
        """One row for each case and each of its metrics, in the order of the cases."""
        of_runs = {metric for metric in self.table.shares if self._counts_runs(metric)}
        return [
            self._row(case, metric, values, metric in of_runs)
            for case, batch in zip(self.cases, self.results, strict=True)
            for metric in self.table.metrics
            if (values := [one.metrics[metric] for one in batch if metric in one.metrics])
        ]

    def _counts_runs(self, metric: str) -> bool:
        """Whether a metric is 0 or 1 in each repetition, so that its mean is a share."""
        every = (one.metrics.get(metric, 0) for batch in self.results for one in batch)
        return set(every) <= {0, 1}

    def _row(self, case: Case, metric: str, values: Sequence[float], of_runs: bool) -> FigureRow:
        paper = self.table.published(case.key, metric)
        # fsum is exact, so the figures do not depend on the order of summation.
        mean = math.fsum(values) / len(values)
        spread = math.fsum((value - mean) ** 2 for value in values)
        sd = math.sqrt(spread / (len(values) - 1)) if len(values) > 1 else None
        rank = _rank(paper, values) if self.table.ranked else None
        exact = exact_share(round(math.fsum(values)), len(values)) if of_runs else None
        return FigureRow(
            case.labels,
            metric,
            paper,
            mean,
            sd,
            len(values),
            self.table.ranked,
            rank,
            exact,
            stored=self.table.stored is not None,
            paper_sd=self.table.printed_sd(case.key, metric),
            prototype=self.table.prototype(case.key, metric),
        )

    def samples(self) -> Iterator[tuple[tuple[str, Key], list[float]]]:
        """(metric, key of a case) and its values, for metrics that every repetition has."""
        for case, batch in zip(self.cases, self.results, strict=True):
            for metric in batch[0].metrics:
                if all(metric in one.metrics for one in batch):
                    yield (metric, case.key), [one.metrics[metric] for one in batch]
        if self.table.together is not None:
            keys = [case.key for case in self.cases]
            yield from self.table.together(dict(zip(keys, self.results, strict=True)))

    def published(self) -> Iterator[tuple[tuple[str, Key], float]]:
        """(metric, key of a case) and the printed figure, if there is one."""
        for case in self.cases:
            for metric in self.table.metrics:
                value = self.table.published(case.key, metric)
                if value is not None:
                    yield (metric, case.key), value


def _rank(paper: float | None, values: Sequence[float]) -> float | None:
    if paper is None:
        return None
    below = sum(value < paper for value in values) + sum(value == paper for value in values) / 2
    return below / len(values)


@dataclass(frozen=True)
class Reproduced:
    """All reproduced tables of a reproduction."""

    reproduction: Reproduction
    seeds: int
    tables: Sequence[MadeTable]
    first_seed: int = 1
    settings: tuple[str, ...] = ()  # of `--set`, as typed: not the published experiment

    @property
    def repetitions(self) -> int:
        """The number of repetitions that were computed."""
        return sum(made.repetitions for made in self.tables if made.table.stored is None)

    @property
    def unfinished(self) -> int:
        return sum(table.unfinished for table in self.tables)

    def rows(self) -> list[FigureRow]:
        """The rows of all tables."""
        return [row for table in self.tables for row in table.rows()]

    @property
    def premises(self) -> list[str]:
        """The other premises for which a table was made, in their order."""
        return list(dict.fromkeys(one.table.premise for one in self.tables if one.table.premise))

    def mean_errors(self, premise: str = "") -> dict[str, float | None]:
        """Mean |error| by metric over the cases with a printed value, in the tables of a premise."""
        rows = [row for one in self._under(premise) for row in one.rows()]
        means: dict[str, float | None] = {}
        for metric in self.reproduction.averaged:
            errors = [row.error for row in rows if row.metric == metric]
            known = [abs(error) for error in errors if error is not None]
            means[metric] = math.fsum(known) / len(known) if known else None
        return means

    def samples(self, premise: str = "") -> dict[tuple[str, Key], list[float]]:
        """(metric, key of a case) -> the values by which claims are judged."""
        return self._by_case(premise, lambda one: one.samples())

    def repeated(self, premise: str = "") -> dict[tuple[str, Key], str]:
        """(metric, key of a case) -> the kind of its repetitions: run, tour, training."""
        return self._by_case(
            premise, lambda one: ((sample, one.table.repetition) for sample, _ in one.samples())
        )

    def published(self, premise: str = "") -> dict[tuple[str, Key], float]:
        """(metric, key of a case) -> the printed figure, if there is one."""
        return self._by_case(premise, lambda one: one.published())

    def judged(self, premise: str = "") -> list[JudgedClaim]:
        """The verdicts on the claims whose cases were run, from the tables of a premise."""
        facts = self.samples(premise), self.published(premise), self.repeated(premise)
        verdicts = [judge(claim, *facts) for claim in self.reproduction.claims]
        return [claim for claim in verdicts if claim is not None]

    def _under(self, premise: str) -> list[MadeTable]:
        return [one for one in self.tables if one.table.premise == premise]

    def _by_case(
        self, premise: str, of: Callable[[MadeTable], Iterable[tuple[tuple[str, Key], T]]]
    ) -> dict[tuple[str, Key], T]:
        """Values by metric and key of a case as in claims: without the label of another premise."""
        end = -1 if premise else None
        return {
            (metric, key[:end]): value
            for one in self._under(premise)
            for (metric, key), value in of(one)
        }


def tables_named(reproduction: Reproduction, names: Sequence[str]) -> tuple[PublishedTable, ...]:
    """The tables with these names, or the usual ones without names. Raises InputError."""
    known = {table.name: table for table in reproduction.tables if table.name}
    for name in names:
        if not known:
            raise InputError(
                f"{reproduction.name} has no tables to choose from: use --tables without names"
            )
        if name not in known:
            raise InputError(
                f"{reproduction.name} has no table '{name}'{nearest(name, known)}; "
                f"known are {alternatives(known)}"
            )
    usual = tuple(table for table in reproduction.tables if table.usual)
    return tuple(known[name] for name in names) or usual


def with_settings(
    name: str, cases: Sequence[Sequence[Case]], settings: Settings
) -> list[list[Case]]:
    """The cases of all tables with these settings of their scenarios. Raises InputError."""
    if settings and not any(isinstance(case, RunCase) for of_table in cases for case in of_table):
        raise InputError(f"{name} runs no scenarios: omit --set")
    changed = [[_with_settings(name, case, settings) for case in of_table] for of_table in cases]
    for case in (one for of_table in changed for one in of_table if settings):
        if isinstance(case, RunCase):
            case.check()
    return changed


def _with_settings(name: str, case: Case, settings: Settings) -> Case:
    """The case with these settings, which must not replace its own settings."""
    if not isinstance(case, RunCase):
        return case
    own = [parse_setting(text).keys for text in case.own_settings] if settings else []
    for setting in settings:
        one = parse_setting(setting) if isinstance(setting, str) else setting
        if one.keys == ("seed",):
            raise InputError("set seeds with --seed-from N --seeds M", one.argument)
        replaced = any(keys[: len(one.keys)] == one.keys[: len(keys)] for keys in own)
        if replaced or (_gives_types_allocations(one) and ("strategy", "allocation") in own):
            raise InputError(f"the cases of {name} set this themselves; omit it", one.argument)
    return replace(case, settings=settings)


def _gives_types_allocations(setting: Override) -> bool:
    """Whether a setting gives robot types their own strategies."""
    of_types = setting.keys[:2] == ("fleet", "types")
    return of_types and ("strategy" in setting.keys or "strategy" in str(setting.value))


def reproduce(
    reproduction: Reproduction,
    seeds: int | None,
    strategies: Sequence[str] = (),
    workers: int | None = None,
    on_start: Callable[[int], Any] | None = None,
    on_done: OnDone | None = None,
    tables: Sequence[str] = (),
    first_seed: int = 1,
    settings: Settings = (),
) -> Reproduced:
    """Reproduce the usual tables, or the tables with these names.

    `seeds`: number of seeds from `first_seed` on; None: the default of each table. `strategies` replace
    the published ones. `on_start` is called with the number of repetitions. `settings` change the
    scenarios. Raises InputError before any run for an unknown strategy or setting, and if the
    reproduction has no choice of strategies.
    """
    if strategies and not reproduction.strategies:
        raise InputError(f"{reproduction.name} compares no strategies: omit --strategies")
    reproduction = replace(reproduction, tables=tables_named(reproduction, tables))
    chosen = tuple(strategies) or reproduction.strategies
    cases = with_settings(
        reproduction.name, [table.cases(chosen) for table in reproduction.tables], settings
    )
    many = [seeds or table.seeds or reproduction.seeds for table in reproduction.tables]
    plan = list(zip(reproduction.tables, cases, many, strict=True))
    if on_start is not None:
        on_start(
            sum(
                len(of_table) * n * table.per_seed
                for table, of_table, n in plan
                if table.stored is None
            )
        )
    made = [
        MadeTable(
            table,
            of_table,
            table.run(of_table, range(first_seed, first_seed + n), workers, on_done),
            first_seed,
        )
        for table, of_table, n in plan
    ]
    typed = tuple(one if isinstance(one, str) else one.argument for one in settings)
    return Reproduced(reproduction, seeds or reproduction.seeds, made, first_seed, typed)


# The reproductions by name. A new one needs a module and an entry here.


REPRODUCTIONS = {  # name: (module with REPRODUCTION, summary)
    "tabletop": (
        "automaton.papers.tabletop_study",
        "table-top warehouse: independent and cooperative robots (Grzejszczak & Nocoń, Table 3)",
    ),
    "traffic": (
        "automaton.papers.traffic_study",
        "warehouse with slow zones: A* and traffic avoidance (Bhattathiri, Li & Kuhl, Table 5)",
    ),
    "traffic-fleet": (
        "automaton.papers.traffic_fleet",
        "the same warehouse, up to 100 robots, all by one policy: beyond the paper",
    ),
    "auctions": (
        "automaton.papers.auction_study",
        "sequential auctions with charging in the bids (De Ryck et al., sections 4 and 5)",
    ),
    "auctions-floor": (
        "automaton.papers.living_auctions",
        "auctions, batteries, queues and failures in full simulation: beyond the paper",
    ),
    "fleets": (
        "automaton.papers.fleet_study",
        "hundreds of robots on grids, pibt and epibt (Yukhnevich & Andreychuk; Robot Runners)",
    ),
    "guidance": (
        "automaton.papers.guidance_study",
        "hundreds of robots on streets: tasks per tick with pibt (Zhang et al., Table 3)",
    ),
    "queues": (
        "automaton.papers.queue_study",
        "one robot that serves lines one by one: an M/G/1 queue, beside its formula",
    ),
    "zoning": (
        "automaton.papers.zoning_study",
        "zones of a factory that are redesigned (Keith & La, Table 5 and Figure 5)",
    ),
}


def find(name: str) -> Reproduction:
    """The reproduction with this name. Raises InputError for an unknown name."""
    if name not in REPRODUCTIONS:
        raise InputError(
            f"nothing called '{name}' to reproduce{nearest(name, REPRODUCTIONS)}; "
            f"there is {alternatives(REPRODUCTIONS)}"
        )
    module = importlib.import_module(REPRODUCTIONS[name][0])
    found: Reproduction = module.REPRODUCTION
    return found
