"""Whether any answer of any strategy is safe: long trials, run by hand.

    python tests/helpers/answer_trials.py [ANSWERS]

Runs shipped floors under strategies of wild_answers.py, in one layer or in all of them, until so many
answers were given (default 1,000,000). Every run is recorded and judged by the independent
validator. Prints how many answers there were and how many were illegal, and exits with 1 if one did
anything else than be legal or be counted. With NUMBA_BOUNDSCHECK=1, and a folder of
its own in AUTOMATON_CACHE_DIR, compiled code raises IndexError where it leaves an array.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

from wild_answers import ANSWERS

from automaton.engine.state import LAYER_NAMES
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.illegal_decisions import RULE_NAMES, illegal_decisions
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolve import resolve

FLOORS = {  # settings, and ticks to run
    "tabletop-mini": ((), 200),
    "depots": ((), 100),
    "tabletop-1": (("information=orders", "fleet.robots=6"), 100),
    "warehouse-100": (("fleet.robots=40",), 60),
    "factory": (("fleet.robots=3",), 200),
    "factory-ddz": ((), 100),
}
WILD = {layer: f"wild_answers:Wild{layer.title().replace('_', '')}" for layer in LAYER_NAMES}
POWERED = "depots"  # elsewhere there is nothing to charge
STEERING = "steering"  # in a mix: a right of way that holds robots back
WILD[STEERING] = "wild_answers:WildSteering"
LAYER_OF = {**dict(zip(LAYER_NAMES, LAYER_NAMES, strict=True)), STEERING: "right_of_way"}
MIXES = (*((layer,) for layer in LAYER_NAMES), LAYER_NAMES, LAYER_NAMES[1:], (STEERING,))


class Trial(NamedTuple):
    """What a run under wild strategies came to."""

    answers: Counter[str]
    illegal: Counter[str]
    rules: Counter[str]  # that were broken
    broken: list[str]  # rules, by the validator


def trials(first_seed: int = 1) -> Iterator[tuple[str, Trial]]:
    """Endless runs: every floor with every mix of wild and shipped layers, then with other seeds."""
    seed = first_seed
    while True:
        for floor in FLOORS:
            for mix in MIXES:
                yield f"{floor} {'+'.join(mix)} seed {seed}", trial(floor, mix, seed)
        seed += 1


def trial(floor: str, mix: tuple[str, ...], seed: int) -> Trial:
    """One run in which the layers of `mix` are wild."""
    settings, ticks = FLOORS[floor]
    if not floor.startswith(POWERED):
        mix = tuple(layer for layer in mix if layer != "charging")
    wild = [
        f"strategy.{LAYER_OF[layer]}={{name: '{WILD[layer]}', seed: {seed}, "
        f"share: {0.1 + seed % 9 / 10}}}"
        for layer in mix
    ]
    resolved = resolve(floor, [*settings, *wild], seed)
    before, recorder = ANSWERS.copy(), MemoryRecorder(resolved)
    run = Simulation(resolved, on_record=recorder)
    run.run(until=ticks)
    illegal = dict(zip(LAYER_NAMES, run.world.tally.illegal.tolist(), strict=True))
    found = illegal_decisions(run.world, resolved.floor_plan)
    assert found.total == sum(illegal.values()) == sum(many for _, _, many in found.by_rule)
    rules = Counter({f"{layer}: {rule}": many for layer, rule, many in found.by_rule})
    report = validate_stored(recorder.recording())
    broken = [str(violation) for violation in report.violations]
    return Trial(ANSWERS - before, Counter(illegal), rules, broken)


def main(arguments: list[str]) -> int:
    """Run trials until there were so many answers."""
    wanted = int(arguments[0]) if arguments else 1_000_000
    answers: Counter[str] = Counter()
    illegal: Counter[str] = Counter()
    rules: Counter[str] = Counter()
    broken = 0
    runs: Any = 0
    for name, found in trials():
        runs += 1
        answers += found.answers
        illegal += found.illegal
        rules += found.rules
        if found.broken:
            broken += 1
            print(f"{name}: {found.broken[0]}", flush=True)
        print(f"\r{answers.total():,} answers", end="", file=sys.stderr, flush=True)
        if answers.total() >= wanted:
            break
    print(file=sys.stderr)
    print(f"{answers.total():,} answers in {runs:,} runs, {broken} with a broken rule")
    print(f"rules that none broke: {', '.join(sorted(set(filter(None, RULE_NAMES)) - set(rules)))}")
    for layer in LAYER_NAMES:
        print(f"{layer}: {answers[layer]:,} answers, {illegal[layer]:,} counted as illegal")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
