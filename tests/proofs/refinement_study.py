"""Whether the answer depends on the tick: throughput of the shipped floors with ticks K times finer.

    python tests/proofs/refinement_study.py [--robot-ticks 80000] [--pairs 400] [SCENARIO ...]

All run with `following: convoy`: under `handover` the world itself goes by the tick. A run lasts for
2,000 coarse ticks at least; small fleets do little in a tick and get more of them. A pair is a run with
K = 1 and one with K, of one seed; the difference is that of their orders done in a coarse tick, as a
share of the mean with K = 1, with Student's 95 % interval. Pairs are made in rounds until the interval
lies within the bound of 3 % or outside it, from 10 to --pairs of them. Seeds that draw a fleet which may
not begin so (three robots in a block for two) give none, and are counted on standard error. So interval
and stopping look at the same pairs: an interval that only just clears the bound is to be taken with
care. Strategies that decide in every tick (`fine`) are shown beside, and not bounded.

The exit code is 1 if a row with coarse decisions is outside the bound, or undecided.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import NamedTuple

import numpy as np

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.runs.headless import run_to_end
from automaton.runs.progress import asked_orders
from automaton.runs.simulation import Simulation
from automaton.scenario.text_files import shipped
from automaton.studies.inference.intervals import mean_interval
from automaton.studies.sweeps.run_keys import seed_of
from automaton.world.resolve import resolve

RIGHTS_OF_WAY = ("pibt", "epibt")
REFINEMENTS = (2, 3, 5)
BOUND = 0.03
FIRST, ROUND = 10, 20  # pairs
HEAD = ("floor", "right of way", "decide", "K", "pairs", "orders/1000 ticks, K = 1")
SHORTEST = 2000  # coarse ticks
COLUMNS = (*HEAD, "difference", "95 % interval", "within 3 %")


class Point(NamedTuple):
    """What is compared with itself at K = 1."""

    scenario: str
    right_of_way: str
    decide: str
    refine: int

    def settings(self, refine: int) -> list[str]:
        routing = "strategy.routing=shortest"  # robots that are steered follow no routes
        following = "world.following=convoy"
        own = [f"strategy.right_of_way={self.right_of_way}", routing, following]
        return [*own, f"refine={refine}", f"decide={self.decide}"]


class Row(NamedTuple):
    """The difference, as a share of the mean at K = 1."""

    pairs: int
    usual: float  # orders in 1,000 coarse ticks
    mean: float
    low: float
    high: float

    @property
    def verdict(self) -> str:
        if self.low >= -BOUND and self.high <= BOUND:
            return "yes"
        return "NO" if self.low > BOUND or self.high < -BOUND else "undecided"


def throughput(point: Point, refine: int, replication: int, robot_ticks: int) -> float:
    """Orders done in 1,000 coarse ticks, up to a tick or to the end of the run."""
    resolved = resolve(point.scenario, point.settings(refine))
    simulation = Simulation(resolved, seed_of(f"refinement {replication}"))
    ticks = max(SHORTEST, robot_ticks // resolved.scenario.fleet.robots)
    run_to_end(simulation, until=ticks * refine)
    done = np.count_nonzero(asked_orders(simulation.world).done != NIL)
    return 1000 * int(done) * refine / simulation.tick


def one_pair(point: Point, replication: int, robot_ticks: int) -> tuple[float, float] | None:
    """The throughput with K = 1 and with K; None: this seed draws a fleet that may not begin so."""
    try:
        usual, fine = (throughput(point, k, replication, robot_ticks) for k in (1, point.refine))
    except InputError:
        return None
    return usual, fine


def row_of(pairs: list[tuple[float, float]]) -> Row:
    usual, fine = np.array(pairs).T
    scale = float(usual.mean()) or 1.0
    interval = mean_interval((fine - usual) / scale)
    assert interval.low is not None
    assert interval.high is not None
    return Row(len(pairs), float(usual.mean()), interval.value, interval.low, interval.high)


def compared(point: Point, robot_ticks: int, most: int, executor: Executor) -> Row:
    """Make pairs until the verdict is clear, or there are `most`."""
    pairs: list[tuple[float, float]] = []
    tried = 0
    while True:
        more = range(tried, min(most, tried + (ROUND if tried else FIRST)))
        futures = [executor.submit(one_pair, point, number, robot_ticks) for number in more]
        pairs += [pair for future in futures if (pair := future.result())]
        tried += len(more)
        if len(pairs) < 2 and tried < most:
            continue
        row = row_of(pairs)
        is_clear = row.verdict != "undecided" if point.decide == "coarse" else tried > FIRST
        if is_clear or tried >= most:
            if tried > len(pairs):
                print(
                    f"{point}: {tried - len(pairs)} of {tried} seeds may not begin", file=sys.stderr
                )
            return row


def points_of(scenarios: list[str]) -> Iterator[Point]:
    for scenario in scenarios:
        for right_of_way in RIGHTS_OF_WAY:
            for decide in ("coarse", "fine"):
                for refine in REFINEMENTS:
                    yield Point(scenario, right_of_way, decide, refine)


def refusal(point: Point) -> str:
    """Why a point cannot be run, "" if it can."""
    try:
        resolve(point.scenario, point.settings(point.refine))
    except InputError as error:
        return error.message
    return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("scenario", nargs="*", default=list(shipped()))
    parser.add_argument(
        "--robot-ticks",
        type=int,
        default=80_000,
        help="of a run, if these are more than its 2,000 coarse ticks",
    )
    parser.add_argument("--pairs", type=int, default=400, help="of a row, at most")
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS), flush=True)
    refused: dict[str, None] = {}
    wrong = 0
    with ProcessPoolExecutor(args.workers) as executor:
        for point in points_of(args.scenario):
            why = refusal(point)
            if why:
                refused[f"{point.scenario}, {point.right_of_way}: {why}"] = None
                continue
            row = compared(point, args.robot_ticks, max(FIRST, args.pairs), executor)
            bounded = point.decide == "coarse"
            wrong += bounded and row.verdict != "yes"
            shares = f"{row.mean:+.1%} | {row.low:+.1%} to {row.high:+.1%}"
            cells = [*map(str, point), str(row.pairs), f"{row.usual:.4g}", shares]
            print("| " + " | ".join([*cells, row.verdict if bounded else "-"]) + " |", flush=True)
    print("\nNot served:\n\n" + "\n".join(f"* {text}" for text in refused))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
