"""Whether the shipped strategies go together, on every shipped scenario.

    python tests/helpers/strategy_pairs.py [TICKS [SCENARIO ...]]

On each scenario any two strategies of two layers occur together in a run, or are refused in one
sentence beside the scenario's own; one run tries as many pairs as it can. A run goes on for TICKS, and
if nothing is delivered by then to the first delivery, or to the scenario's last tick. Its verdict:

    delivered   something reached its target
    jammed      nothing did, and robots have long waited for cells that others hold: `run` says whose
    empty       nothing did, and all robots are down: their batteries ran empty
    SILENT      nothing did, and nothing says why
    ILLEGAL     an answer of a strategy broke a rule, whatever was delivered
    RAISED      Python raised something

The last three are faults, and so is a refusal of more than a line; the exit code is 1 then. The tests
run a sample, in which only trials under the right of way `wait` may jam: `test_strategy_pairs.py`.
"""

from __future__ import annotations

import sys
import time
import traceback
import zlib
from collections import Counter
from collections.abc import Iterator
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from automaton.engine.observation import DEADLOCK_TICKS
from automaton.engine.state import ORDER_DELIVERED, STATUS_DEPLETED
from automaton.errors import InputError
from automaton.runs.headless import run_to_end
from automaton.runs.metrics import illegal_by_layer
from automaton.runs.run_diagnosis import blockers_of, describe_unfinished_run, stalled_robots
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import LAYER_NAMES
from automaton.scenario.text_files import shipped
from automaton.strategy.lookup import names
from automaton.world.resolve import Resolved, resolve

TICKS = 8000
MAX_ROBOTS = 40  # scenarios with more robots are tried with so many: some strategies are in Python
MORE = 4 * DEADLOCK_TICKS  # ticks between two looks for a first delivery
FAULTS = ("SILENT", "ILLEGAL", "RAISED")
MAY_JAM = ("right_of_way", "wait")  # it "shows which deadlocks a floor has"
PAIRS_FOR_ONE = 9  # in the sample
Pair = tuple[tuple[str, str], tuple[str, str]]  # (layer, strategy) twice


class Trial(NamedTuple):
    """A scenario with strategies in place of some of its own."""

    scenario: str
    strategies: tuple[tuple[str, str], ...]  # (layer, strategy), in the order of layers

    @property
    def settings(self) -> list[str]:
        """As on the command line; a strategy that is the scenario's own keeps its parameters."""
        own = dict(OWN[self.scenario])
        fewer = [f"fleet.robots={MAX_ROBOTS}"] if self.scenario in LARGE else []
        return fewer + [
            f"strategy.{one}={name}" for one, name in self.strategies if own[one] != name
        ]

    def with_one(self, layer: str, name: str) -> Trial:
        """The same with another strategy in a layer."""
        return Trial(self.scenario, tuple({**dict(self.strategies), layer: name}.items()))

    @property
    def may_jam(self) -> bool:
        """Whether nothing promises that its robots get past each other."""
        return MAY_JAM in self.strategies

    @property
    def pairs(self) -> set[Pair]:
        """Any two of its strategies."""
        return set(combinations(self.strategies, 2))

    def __str__(self) -> str:
        return " ".join((self.scenario, *(f"--set {setting}" for setting in self.settings)))


class Verdict(NamedTuple):
    """What became of a trial."""

    word: str
    told: str = ""

    @property
    def is_fault(self) -> bool:
        """Whether something is to be mended."""
        return self.word in FAULTS or "\n" in self.told


def own_strategies(scenario: str) -> tuple[tuple[str, str], ...]:
    """The strategies that a scenario picks."""
    strategies = resolve(scenario).strategies
    return tuple((layer, strategies[layer].name) for layer in LAYER_NAMES)


OWN = {scenario: own_strategies(scenario) for scenario in shipped()}
LARGE = {scenario for scenario in OWN if resolve(scenario).scenario.fleet.robots > MAX_ROBOTS}


def resolved(trial: Trial) -> Resolved | Verdict:
    """The scenario made ready, or why it is refused."""
    try:
        return resolve(trial.scenario, trial.settings)
    except InputError as error:
        return Verdict("refused", str(error))


def covering(scenario: str) -> Iterator[Trial]:
    """Trials in which every pair of strategies occurs, or is refused beside the scenario's own."""
    own = Trial(scenario, OWN[scenario])
    left = {
        pair
        for one, other in combinations(LAYER_NAMES, 2)
        for pair in product(*([(layer, name) for name in names(layer)] for layer in (one, other)))
    }
    for pair in sorted(left):
        if pair not in left:
            continue
        trial = own.with_one(*pair[0]).with_one(*pair[1])
        if not isinstance(resolved(trial), Verdict):
            for layer in LAYER_NAMES:
                if layer not in dict(pair):
                    trial = with_most_new(trial, layer, left)
        left -= trial.pairs if not isinstance(resolved(trial), Verdict) else {pair}
        yield trial


def with_most_new(trial: Trial, layer: str, left: set[Pair]) -> Trial:
    """The trial with that strategy of a layer which adds most pairs that are still to be tried."""
    others = [trial.with_one(layer, name) for name in names(layer)]
    for other in sorted(others, key=lambda other: -len(other.pairs & left)):
        if other == trial or not isinstance(resolved(other), Verdict):
            return other
    return trial


def sample() -> list[Trial]:
    """A few dozen trials that are not refused: each strategy and each scenario occurs.

    Each strategy is tried alone, and one of PAIRS_FOR_ONE pairs. What is tried, and where, follows from
    a hash of names: a new strategy adds trials and changes none.
    """
    strategies = [(layer, name) for layer in LAYER_NAMES for name in names(layer)]
    pairs = [(a, b) for a, b in combinations(strategies, 2) if a[0] != b[0]]
    picked = [pair for pair in pairs if hash_of(pair) % PAIRS_FOR_ONE == 0]
    found = [taken(one) for one in strategies]
    if None in found:
        raise ValueError(f"no scenario takes {strategies[found.index(None)]}")
    trials = dict.fromkeys(trial for trial in (*found, *(taken(*pair) for pair in picked)) if trial)
    missing = set(OWN) - {trial.scenario for trial in trials}
    return [*trials, *(Trial(scenario, OWN[scenario]) for scenario in sorted(missing))]


def taken(*strategies: tuple[str, str]) -> Trial | None:
    """A trial with these strategies on a scenario that takes them, not its own if there is one."""

    def place(scenario: str) -> tuple[bool, int]:
        return set(strategies) <= set(OWN[scenario]), hash_of((scenario, *strategies))

    for scenario in sorted(OWN, key=place):
        trial = Trial(scenario, OWN[scenario])
        for layer, name in strategies:
            trial = trial.with_one(layer, name)
        if not isinstance(resolved(trial), Verdict):
            return trial
    return None


def hash_of(names: object) -> int:
    """A number that is the same in every process."""
    return zlib.crc32(repr(names).encode())


def verdict(trial: Trial, ticks: int = TICKS) -> Verdict:
    """Run a trial and judge it."""
    ready = resolved(trial)
    if isinstance(ready, Verdict):
        return ready
    try:
        simulation = Simulation(ready)
        last_worked = np.zeros(ready.scenario.fleet.robots, np.int64)
        run_to_end(simulation, last_worked=last_worked, until=ticks)
        while not is_over(simulation):
            run_to_end(simulation, last_worked=last_worked, until=simulation.tick + MORE)
    except InputError as error:
        return Verdict("refused", str(error))
    except Exception:
        return Verdict("RAISED", traceback.format_exc())
    return judged(simulation, last_worked)


def is_over(simulation: Simulation) -> bool:
    """Whether something was delivered, or never will be."""
    if (simulation.world.orders.state == ORDER_DELIVERED).any() or simulation.finished:
        return True
    return simulation.tick >= simulation.resolved.scenario.stop.max_duration


def judged(simulation: Simulation, last_worked: np.ndarray) -> Verdict:
    """The verdict on a run that is over."""
    illegal = {layer: many for layer, many in illegal_by_layer(simulation).items() if many}
    if illegal:
        return Verdict("ILLEGAL", str(illegal))
    delivered = int((simulation.world.orders.state == ORDER_DELIVERED).sum())
    if delivered:
        return Verdict("delivered", f"{delivered:,} by tick {simulation.tick:,}")
    told = describe_unfinished_run(simulation, last_worked)
    if (simulation.world.robots.status >= STATUS_DEPLETED).all():
        return Verdict("empty", told)
    jammed = blockers_of(simulation.world, stalled_robots(simulation, last_worked))
    return Verdict("jammed" if jammed else "SILENT", told)


def main(ticks: int = TICKS, scenarios: tuple[str, ...] = ()) -> int:
    """Try all pairs; print what is not delivered; 1 if there is a fault."""
    count: Counter[str] = Counter()
    faults, begun = 0, time.monotonic()
    for scenario in scenarios or sorted(OWN):
        for trial in covering(scenario):
            found = verdict(trial, ticks)
            count[found.word] += 1
            faults += found.is_fault
            if found.word != "delivered" and (found.word != "refused" or found.is_fault):
                print(f"{found.word}: {trial}\n    {found.told}", flush=True)
        print(f"{scenario}: {time.monotonic() - begun:.0f} s, {dict(count)} so far", flush=True)
    print(f"{sum(count.values()):,} trials, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if sys.argv[1:] else TICKS, tuple(sys.argv[2:])))
