"""Whether the statistics keep their promises: long trials, run by hand.

    python tests/helpers/statistics_trials.py TRIAL [STUDIES]

TRIAL is one of coverage, rounds, families, answers, changes, steady, batches, search, days, pairing.

Each prints what it measured and exits with 1 if a promise is broken. The tests run them in small.
"""

from __future__ import annotations

import contextlib
import itertools
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from automaton.studies.inference.intervals import (
    DEFAULT_CONFIDENCE,
    STUDENT_MIN_RUNS,
    bonferroni,
    effect,
    fewest,
    mean_interval,
    next_round,
    skewness,
    student,
)
from automaton.studies.inference.proportions import (
    SureShare,
    batches,
    feasible,
    region,
    select_least,
)
from automaton.studies.inference.steady_state import (
    NotSteadyError,
    WarmUp,
    batch_means,
    mser5,
    replication_deletion,
)
from automaton.studies.reports.comparisons import answers, comparisons
from automaton.studies.reports.what_if import NO_DIFFERENCE, what_ifs
from automaton.studies.sizing.fleet_search import (
    Candidate,
    FleetConfig,
    FleetRun,
    FleetSearch,
    Question,
    Target,
    make_question,
)
from automaton.studies.sizing.sizing_session import BOUND_DAYS, RunBudget, day_bound
from automaton.studies.sweeps.run_keys import replication_seeds
from automaton.studies.sweeps.study import Analysis, Study

Values = Any
STUDIES = 2000
SIZES = (10, 20, STUDENT_MIN_RUNS)
SHIPPED = (  # a scenario of each kind, a setting of it, the metric of a run, runs in its pool
    ("tabletop-1", ("fleet.robots=5",), "makespan", 2000),
    ("tabletop-2", (), "makespan", 2000),
    ("depots", (), "lead_time", 1000),
    ("factory", (), "makespan", 300),
    ("warehouse-100", (), "delay", 300),
)
LOAD = 0.8
CUSTOMERS = 1000
QUEUES = {0.5: (300, 1000, 5000), 0.8: (1000, 5000, 20_000), 0.9: (5000, 20_000, 50_000)}  # by load
SERIES = {
    0.0: (150, 1000),
    0.9: (300, 1000, 3000, 10_000),
    0.98: (1000, 3000, 10_000),
}  # AR(1) by r
HIDDEN = (  # runs, observations, r, share of the variance
    (1, 1000, 0.98, 0.05), (1, 1000, 0.99, 0.1), (1, 1000, 0.995, 0.1), (1, 3000, 0.995, 0.05),
    (5, 1000, 0.99, 0.1), (5, 1000, 0.995, 0.1), (15, 300, 0.98, 0.1), (1, 20_000, 0.98, 0.05),
)  # fmt: skip
LEAST_COVERAGE = 0.93  # of batch means


def shipped_runs(
    scenario: str, settings: tuple[str, ...], metric: str, number: int, workers: int | None = None
) -> Values:
    """(number,) a metric of replications of one seed; kept between calls."""
    from automaton.studies.process_pool import run_jobs
    from automaton.world.resolve import resolve

    name = "-".join([scenario, *settings, metric, str(number)]).replace("=", "")
    path = Path(tempfile.gettempdir()) / f"automaton-trials-{name}.npy"
    if path.exists():
        return np.load(path)
    resolved = resolve(scenario, settings)
    jobs = [(resolved, one) for one in replication_seeds(1, 0, number)]
    values = np.array([float(one.metrics[metric]) for one in run_jobs(jobs, workers)])
    np.save(path, values)
    return values


def tabletop_runs(number: int, *settings: str) -> Values:
    """(number,) makespan of tabletop-1."""
    return shipped_runs("tabletop-1", settings, "makespan", number)


def waits(
    rng: np.random.Generator,
    queues: int,
    customers: int,
    from_empty: bool = True,
    load: float = LOAD,
) -> Values:
    """(queues, customers) waiting times of M/M/1, service 1: W' = max(0, W + S - A)."""
    found = np.zeros((queues, customers))
    wait = np.zeros(queues)
    if not from_empty:  # a steady state: 0 with probability 1 - load, else exponential
        busy = rng.random(queues) < load
        wait = np.where(busy, rng.exponential(1 / (1 - load), queues), 0.0)
    for customer in range(customers):
        found[:, customer] = wait
        step = rng.exponential(1.0, queues) - rng.exponential(1 / load, queues)
        wait = np.maximum(0.0, wait + step)
    return found


def coverage(
    draw: Callable[[int, int], Values],
    truth: float,
    n: int,
    studies: int,
    level: float = DEFAULT_CONFIDENCE,
) -> float:
    """The share of studies of n runs whose interval holds the truth."""
    values = draw(studies, n)
    return float(np.mean([mean_interval(row, level).holds(truth) for row in values]))


def run_in_rounds(runs: Values, at_least: int, at_most: int, precision: float) -> tuple[int, int]:
    """(runs, rounds) that a study of one mean makes of these runs until it is so precise."""
    n, rounds = at_least, 1
    while True:
        sample = runs[:n]
        half = precision * abs(float(sample.mean()))
        wanted = fewest(float(sample.var(ddof=1)), 1.0, half, DEFAULT_CONFIDENCE)
        following = next_round(n, wanted, at_most)
        if following is None:
            return n, rounds
        n, rounds = following, rounds + 1


def round_coverage(
    pool: Values, at_least: int, needed: int, studies: int, seed: int = 11
) -> tuple[float, float, float]:
    """Coverage, mean runs and rounds of studies whose precision takes `needed` runs of a pool."""
    truth, rng = float(pool.mean()), np.random.default_rng(seed)
    precision = (
        student(needed - 1, DEFAULT_CONFIDENCE) * float(pool.std()) / np.sqrt(needed) / truth
    )
    found = []
    for _ in range(studies):
        runs = pool[rng.integers(0, len(pool), 10 * needed)]
        n, rounds = run_in_rounds(runs, at_least, len(runs), precision)
        found.append((mean_interval(runs[:n]).holds(truth), n, rounds))
    held, mean_runs, mean_rounds = np.mean(np.array(found, np.float64), axis=0)
    return float(held), float(mean_runs), float(mean_rounds)


def round_coverages(studies: int = STUDIES, workers: int | None = None) -> bool:
    """Intervals of studies that go on until they are narrow; of normal runs 93 % is promised."""
    rng, kept = np.random.default_rng(12), True
    pools = {"normal": rng.normal(100, 10, 100_000)}
    for scenario, settings, metric, number in SHIPPED[:2]:
        pools[f"{scenario}: {metric}"] = shipped_runs(scenario, settings, metric, number, workers)
    for name, pool in pools.items():
        for at_least in (10, 20, 30):
            for needed in (40, 150):
                held, runs, rounds = round_coverage(pool, at_least, needed, studies)
                text = f"{name}, from {at_least} runs, {needed} needed: {runs:.0f} in {rounds:.1f} rounds"
                shown(text, held, studies)
                kept &= name != "normal" or held >= 0.93 - 2 * np.sqrt(0.05 * 0.95 / studies)
    return kept


def false_families(n: int, comparisons: int, families: int, seed: int = 9) -> float:
    """The share of families of intervals of n normal runs in which any misses the truth."""
    rng, level = np.random.default_rng(seed), bonferroni(DEFAULT_CONFIDENCE, comparisons)
    drawn = rng.normal(size=(families, comparisons, n))
    held = [all(mean_interval(row, level).holds(0.0) for row in one) for one in drawn]
    return 1 - float(np.mean(held))


def families(studies: int = STUDIES) -> bool:
    """Families of intervals of which any misses; at most 5 %, and 2 standard errors, is promised."""
    kept = True
    most = 0.05 + 2 * np.sqrt(0.05 * 0.95 / studies)
    for n, many in ((5, 1), (5, 10), (10, 2), (10, 20), (20, 20), (30, 20)):
        found = false_families(n, many, studies)
        shown(f"normal, n = {n}: families of {many} with a miss", found, studies)
        kept &= found <= most
    return kept


def lost_best(n: int, studies: int, is_skewed: bool = False, points: int = 5) -> float:
    """The share of studies whose answer leaves out the best point, if all have the same mean.

    Then it is hardest to keep: any of them, say the first one, is the best as much as any other.
    """
    from synthetic_results import study_of, synthetic_store

    study = study_of({"fleet.robots": tuple(range(points))}, n)
    lost = 0
    for number in range(studies):
        rng = np.random.default_rng(number)
        runs = 100 + 10 * (
            rng.exponential(1, (points, n)) if is_skewed else rng.normal(0, 1, (points, n))
        )
        results = synthetic_store(study, lambda point, r, runs=runs: float(runs[point, r]))
        lost += all(point.number != 0 for point in answers(results)[0].candidates)
    return lost / studies


def lost_answers(studies: int = STUDIES) -> bool:
    """Answers that leave out the best point; at most 5 %, and 2 standard errors, is promised."""
    most = 0.05 + 2 * np.sqrt(0.05 * 0.95 / studies)
    shares = {}
    for is_skewed, n in itertools.product((False, True), (5, 12, STUDENT_MIN_RUNS)):
        shares[is_skewed, n] = lost_best(n, studies, is_skewed)
        kind = "exponential (skew 2)" if is_skewed else "normal"
        shown(f"{kind}, n = {n}: the best of five points left out", shares[is_skewed, n], studies)
    return max(shares.values()) <= most


def false_verdicts(n: int, studies: int, changes: int = 4) -> float:
    """The share of studies in which any of some changes without effect gets a verdict.

    All points share noise with the baseline, as runs with the same seed do.
    """
    from synthetic_results import synthetic_store

    metrics = ("makespan", "throughput", "lead_time", "late_share")
    points = [{"name": f"point {number}"} for number in range(changes + 1)]
    analysis = Analysis(metrics=metrics)
    study = Study(name="n", scenario="n", listed=points, replications=n, analysis=analysis)
    false = 0
    for number in range(studies):
        rng = np.random.default_rng(number)
        own = rng.normal(0, 6, (len(metrics), changes + 1, n))
        runs = 100 + 8 * rng.normal(size=n) + own
        columns = {
            name: lambda point, r, runs=one: float(runs[point, r])
            for name, one in zip(metrics, runs, strict=True)
        }
        results = synthetic_store(study, columns["makespan"], **columns)
        outcomes = what_ifs(results, comparisons(results))
        false += any(one.verdict != NO_DIFFERENCE for one in outcomes)
    return false / studies


def verdicts(studies: int = STUDIES) -> bool:
    """Studies with a verdict on a change without effect; at most 5 %, and 2 standard errors."""
    most = 0.05 + 2 * np.sqrt(0.05 * 0.95 / studies)
    shares = {n: false_verdicts(n, studies) for n in (5, 20)}
    for n, share in shares.items():
        shown(f"{n} pairs: 4 changes without effect on 4 metrics, any verdict", share, studies)
    return max(shares.values()) <= most


def drawn_from(pool: Values, seed: int) -> Callable[[int, int], Values]:
    """Studies of runs drawn from a pool: its mean is their truth."""
    rng = np.random.default_rng(seed)
    return lambda studies, n: pool[rng.integers(0, len(pool), (studies, n))]


def shown(name: str, found: float, studies: int) -> bool:
    error = np.sqrt(found * (1 - found) / studies)
    print(f"{name:<62} {100 * found:6.2f} % +- {200 * error:.2f}", flush=True)
    return True


def coverages(studies: int = STUDIES, workers: int | None = None) -> bool:
    """Coverage of 95 % intervals of the mean: of normal runs, of shipped scenarios, of a queue.

    Studies are drawn from a pool of runs, whose mean is their truth. 93 to 97 % are promised from the
    number of runs on that has no warning.
    """
    rng = np.random.default_rng(1)
    queue = waits(rng, 40_000, CUSTOMERS // 4).mean(axis=1)
    pools = {"normal": rng.normal(10, 2, 40_000), "M/M/1, mean delay of 250 customers": queue}
    for scenario, settings, metric, number in SHIPPED:
        name = " ".join([scenario, *settings, metric])
        pools[name] = shipped_runs(scenario, settings, metric, number, workers)
    kept = True
    for seed, (name, pool) in enumerate(pools.items()):
        print(f"{name}: {len(pool):,} runs, skew {skewness(pool):.1f}", flush=True)
        for n in SIZES:
            found = coverage(drawn_from(pool, seed), float(pool.mean()), n, studies)
            shown(f"  n = {n}{'' if n >= STUDENT_MIN_RUNS else ' (warned)'}", found, studies)
            kept &= n != STUDENT_MIN_RUNS or 0.93 <= found <= 0.97
    return kept


def steady_coverages(studies: int = STUDIES) -> bool:
    """Coverage of the steady-state delay of M/M/1, LOAD / (1 - LOAD): the true value is known."""
    rng, truth = np.random.default_rng(4), LOAD / (1 - LOAD)
    held: dict[str, list[bool]] = {"replication-deletion": [], "batch means": []}
    refused = {name: 0 for name in held}
    for _ in range(studies):
        series = waits(rng, 30, 5 * CUSTOMERS)
        for name, interval in (
            ("replication-deletion", lambda s=series: deleted(s)),
            ("batch means", lambda: batch_means(waits(rng, 1, 100 * CUSTOMERS, False)[0])),
        ):
            if name == "batch means" and len(held[name]) + refused[name] >= studies // 10:
                continue
            try:
                held[name].append(interval().holds(truth))
            except NotSteadyError:
                refused[name] += 1
    for name, found in held.items():
        shown(f"M/M/1 steady, {name} ({refused[name]} refused)", float(np.mean(found)), len(found))
    return True


def batch_coverages(studies: int = STUDIES) -> bool:
    """Coverage of batch means: the delay of M/M/1, independent values, AR(1) alone and under noise.

    LEAST_COVERAGE is promised, less 2 standard errors, of the intervals that are not refused.
    """
    return all([told(*case) for case in batch_cases(studies)])


def batch_cases(studies: int) -> Iterator[tuple[str, Values, float]]:
    """Name, series and true mean of each case."""
    rng = np.random.default_rng(4)
    for load, lengths in QUEUES.items():
        for n in lengths:
            series = waits(rng, studies, n, False, load)
            yield f"M/M/1 at load {load:g}, {n:,}", series, load / (1 - load)
    yield "exponential, 150", rng.exponential(size=(studies, 150)), 1.0
    for r, lengths in SERIES.items():
        for n in lengths:
            yield f"AR(1) {r:g}, {n:,}", autoregressive(rng, studies, n, r), 0.0
    for runs, n, r, share in HIDDEN:
        name = f"{runs} x {n:,}, {100 * share:g} % AR(1) {r:g}, noise"
        yield name, under_noise(rng, studies, runs, n, r, share), 0.0


def told(name: str, series: Values, truth: float) -> bool:
    """Print the coverage of batch means; whether it is what is promised."""
    found, given, width = batch_coverage(series, truth)
    refused = (
        f"{100 * (1 - given / len(series)):.1f} % refused, {width:.1f} times as wide as needed"
    )
    shown(f"{name}: {refused}", found, max(1, given))
    error = np.sqrt(LEAST_COVERAGE * (1 - LEAST_COVERAGE) / max(1, given))
    return bool(given == 0 or found >= LEAST_COVERAGE - 2 * error)


def autoregressive(rng: np.random.Generator, studies: int, n: int, r: float) -> Values:
    """(studies, n) series of y' = r y + normal noise, from their steady state with mean 0."""
    y = rng.normal(size=(n, studies))
    y[0] /= np.sqrt(1 - r * r)
    for t in range(1, n):
        y[t] += r * y[t - 1]
    return y.T


def under_noise(
    rng: np.random.Generator, studies: int, runs: int, n: int, r: float, share: float
) -> Values:
    """(studies, runs, n) AR(1) series with this share of the variance, the rest independent noise."""
    slow = autoregressive(rng, studies * runs, n, r) * np.sqrt(1 - r * r)
    mixed = np.sqrt(share) * slow + np.sqrt(1 - share) * rng.normal(size=slow.shape)
    return mixed.reshape(studies, runs, n)


def batch_coverage(series: Values, truth: float) -> tuple[float, int, float]:
    """Coverage of the intervals by batch means, how many were given, and their mean width.

    The width is relative to that of the known distribution of the mean.
    """
    held, halves = [], []
    for one in series:
        with contextlib.suppress(NotSteadyError):
            interval = batch_means(one)
            held.append(interval.holds(truth))
            halves.append(interval.half)
    means = series.reshape(len(series), -1).mean(axis=1)
    needed = 1.96 * float(np.sqrt(((means - truth) ** 2).mean()))
    return float(np.mean(held or [0])), len(held), float(np.mean(halves or [0])) / needed


def deleted(series: Values) -> Any:
    cut: WarmUp = mser5(series)
    return replication_deletion(series, cut.cut)


def synthetic(shares: list[float], rng: np.random.Generator) -> Callable[..., list[FleetRun]]:
    """A runner whose fleets of 1, 2, ... robots meet `x <= 0` in these shares of runs."""

    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        missed = rng.random(number) >= shares[place.size - 1]
        return [FleetRun(True, {"makespan": float(bad)}) for bad in missed]

    return run


def asked_of(shares: list[float]) -> Question:
    return make_question(Target("makespan", True, 0.0), (1, len(shares)), budget=1_000_000)


def wrong_answers(shares: list[float], studies: int, seed: int = 5) -> tuple[float, float]:
    """The share of searches with a wrong verdict, and the mean number of runs of a search."""
    rng, question = np.random.default_rng(seed), asked_of(shares)
    wrong = spent = 0
    for _ in range(studies):
        search = FleetSearch(question, "", synthetic(shares, rng), question.budget)
        search.go()
        wrong += any(
            (one.verdict == "meets") != (shares[one.place.size - 1] > question.success_share)
            for one in search.candidates
        )
        spent += search.spent
    return wrong / studies, spent / studies


def wrong_means(
    pool: Values, side: float, studies: int, error: float = 0.05
) -> tuple[float, float]:
    """Wrong verdicts on the mean when it lies just `side` zones (-1 or 1) off the bound."""
    rng = np.random.default_rng(6)
    zone = 0.01 * float(pool.mean())
    limits, bound = region(zone, error), float(pool.mean()) - side * zone
    wrong, runs = 0, 0
    for _ in range(studies):
        verdict, after, number = "undecided", 0, 4000
        while verdict == "undecided":
            sample = pool[rng.integers(0, len(pool), number)]
            verdict, after = feasible(batches(sample), bound, limits)
            number *= 2
        wrong += verdict == ("meets" if side > 0 else "fails")
        runs += 10 * after
    return wrong / studies, runs / studies


def wrong_selections(pool: Values, studies: int, systems: int = 3) -> float:
    """How often Kim & Nelson miss the best of several, all others being one zone worse."""
    rng = np.random.default_rng(8)
    zone, wrong = 0.01 * float(pool.mean()), 0
    for _ in range(studies):
        means = [
            batches(pool[rng.integers(0, len(pool), 4000)]) + zone * (index > 0)
            for index in range(systems)
        ]
        wrong += select_least(means, zone, 0.05).left != (0,)
    return wrong / studies


def searches(studies: int = STUDIES) -> bool:
    """Wrong answers at the boundaries; at most the error, and 2 standard errors, is promised."""
    kept = True
    most = 0.05 + 2 * np.sqrt(0.05 * 0.95 / studies)
    cases = ([0.93], [0.97], [0.93] * 4 + [0.97], [0.93] * 8, [0.97] * 3)
    for shares in cases:
        wrong, runs = wrong_answers(list(shares), studies)
        shown(f"wrong verdicts, shares {shares}, {runs:,.0f} runs", wrong, studies)
        kept &= wrong <= most
    pool = tabletop_runs(100_000, "fleet.robots=5")
    for side in (-1, 1):
        wrong, runs = wrong_means(pool, side, studies)
        shown(
            f"wrong verdicts, mean {side:+d} zone, table-top N = 5, {runs:,.0f} runs",
            wrong,
            studies,
        )
        kept &= wrong <= most
    wrong = wrong_selections(pool, studies)
    shown("wrong selections of 3, others one zone worse, table-top N = 5", wrong, studies)
    return kept and wrong <= most


BAD_DAYS = ("faults.delays={probability: 0.01, ticks: {from: 1, to: 4}}",)  # of tabletop-mini
LONG_SEARCH = 20_000  # days
SURE = {"success_share": 0.95, "alpha": 0.01, "assure": True}


def false_assurances(fleets: int, studies: int, budget: int) -> float:
    """The share of searches that call any fleet sure, if all meet the target on 94 % of days."""
    rng, question = (
        np.random.default_rng(21),
        make_question(Target("makespan", True, 0.0), (1, fleets), budget=budget, **SURE),
    )
    wrong = 0
    for _ in range(studies):
        search = FleetSearch(question, "", synthetic([0.94] * fleets, rng), budget)
        search.go()
        wrong += search.answer.size is not None
    return wrong / studies


def false_verdict_of_days(studies: int) -> float:
    """The share of fleets that pass within LONG_SEARCH days, if 94 % of days meet the target."""
    rng, test = np.random.default_rng(22), SureShare(SURE["success_share"], SURE["alpha"])
    passed = (test.verdict(rng.random(LONG_SEARCH) < 0.94)[0] == "meets" for _ in range(studies))
    return sum(passed) / studies


def bounds_that_hold(pool: Values, bounds: int) -> float:
    """The share of bounds from 300 days of a pool that 95 % of its days keep; greater is worse."""
    rng, question = np.random.default_rng(23), make_question(Target("makespan", True, 0.0), (1, 1))
    held = 0
    for _ in range(bounds):
        sample = rng.choice(pool, BOUND_DAYS, replace=False)
        runs = [FleetRun(True, {"makespan": float(one)}) for one in sample]
        fleet = Candidate(FleetConfig(1), runs)
        found = day_bound(fleet, RunBudget(lambda *_: [], 0), question)
        assert found is not None and found.value is not None
        held += float(np.mean(pool <= found.value)) >= question.success_share
    return held / bounds


def sure_days(
    studies: int = STUDIES, number: int = 20_000, budget: int = 2000, workers: int | None = None
) -> bool:
    """Sure shares, bounds that most days keep, and shares of disjoint sets of days."""
    most = 0.01 + 0.005
    kept = True
    for fleets in (1, 4):
        wrong = false_assurances(fleets, studies, budget)
        shown(f"{fleets} fleets at 94 %: 'at least 95 %' within {budget:,} days", wrong, studies)
        kept &= wrong <= most
    wrong = false_verdict_of_days(studies)
    shown(f"a fleet at 94 %: 'at least 95 %' within {LONG_SEARCH:,} days", wrong, studies)
    pool = shipped_runs("tabletop-mini", BAD_DAYS, "makespan", number, workers)
    held = bounds_that_hold(pool, studies // 2)
    shown(f"bounds from {BOUND_DAYS} of {number:,} days that hold (99 %)", held, studies // 2)
    fifth = number // 5
    target = float(np.quantile(pool, 0.95))
    one, other = (
        float(np.mean(part <= target)) for part in (pool[:fifth], pool[fifth : 2 * fifth])
    )
    print(f"shares of two sets of {fifth:,} days: {100 * one:.2f} % and {100 * other:.2f} %")
    return bool(
        kept
        and wrong <= most
        and held >= 0.99 - 2 * np.sqrt(0.99 * 0.01 / (studies // 2))
        and abs(one - other) <= 0.01 * np.sqrt(4000 / fifth)
    )


def pairing(number: int = STUDIES) -> bool:
    """Cooperative against independent with four robots: the published 30 %, and what pairing does."""
    for robots in (1, 4):
        fleet = f"fleet.robots={robots}"
        a = tabletop_runs(number, fleet, "strategy.allocation=cooperative")
        b = tabletop_runs(number, fleet, "strategy.allocation=independent")
        found = effect(a, b)
        relative = found.relative
        assert relative is not None and relative.low is not None and relative.high is not None
        print(
            f"N = {robots}: makespan {a.mean():.1f} against {b.mean():.1f}: "
            f"{100 * relative.value:.2f} % "
            f"({100 * relative.low:.2f} to {100 * relative.high:.2f}), {number:,} seeds; "
            f"correlation {found.correlation:+.2f}, variance ratio {found.variance_ratio:.2f}"
        )
    return True


def parts() -> Iterator[tuple[str, Callable[..., bool]]]:
    yield from {
        "coverage": coverages,
        "rounds": round_coverages,
        "families": families,
        "answers": lost_answers,
        "changes": verdicts,
        "steady": steady_coverages,
        "batches": batch_coverages,
        "search": searches,
        "days": sure_days,
        "pairing": pairing,
    }.items()


if __name__ == "__main__":
    begun = time.perf_counter()
    chosen = dict(parts())[sys.argv[1]]
    good = chosen(*map(int, sys.argv[2:]))
    print(f"{time.perf_counter() - begun:.0f} s")
    sys.exit(0 if good else 1)
