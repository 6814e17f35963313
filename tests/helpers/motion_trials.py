"""Whether random floors and decisions ever break a rule of motion, loads or energy: run by hand.

    nice python tests/helpers/motion_trials.py [TICKS] [SEED]

Capacities, move times, slow zones, extra ticks, `following`, parking bays, faults and batteries are
drawn; all five layers answer at random. Positions, loads and charges are checked after every tick
by `physical_checks`, and each recording is verified. Exits with 1 if anything is found; the tests
run a sample. A failing floor is named by its seed: `motion_trials.py 1 SEED` runs the floors of
that seed alone.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import partial

from hypothesis import HealthCheck, Phase, given, seed, settings
from physical_checks import PhysicalChecks
from random_cases import Case, cases

from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify_recording

TICKS = 1_000_000
RUN_TICKS = 250
FLOORS = 50  # of a seed
KINDS = (
    *("collision", "swap", "overlap on an edge", "jump", "load", "battery", "down"),
    "not verified",
)


def trial(case: Case) -> PhysicalChecks:
    """Run a case under all checks, and verify its recording."""
    recorder = MemoryRecorder(case.resolved)
    run = Simulation(case.resolved, on_record=recorder)
    checks = PhysicalChecks(run.world)
    while not run.finished and run.tick < case.resolved.scenario.stop.max_duration:
        run.run(until=run.tick + 1)
        checks.tick()
    verified = verify_recording(recorder.recording())
    if not verified.passed:
        checks.found["not verified"] += 1
        first = verified.difference or verified.report.violations[0]
        checks.first["not verified"] = str(first)
    return checks


def floors(number: int, do: Callable[[int, Case], None]) -> None:
    """Draw the floors of a seed, the same ones every time."""
    count = 0

    @seed(number)
    @settings(
        max_examples=FLOORS,
        phases=[Phase.generate],
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(cases(types=number % 3 == 0, ticks=RUN_TICKS))
    def each(case: Case) -> None:
        nonlocal count
        do(count, case)
        count += 1

    each()


def trials(ticks: int, first: int) -> bool:
    """Run floors until so many ticks are done; says what was found."""
    found: Counter[str] = Counter()
    done = runs = 0
    begun = time.monotonic()

    def check(number: int, floor: int, case: Case) -> None:
        nonlocal done, runs
        checks = trial(case)
        done, runs = done + checks.ticks, runs + 1
        found.update(checks.found)
        for kind, text in checks.first.items():
            print(f"seed {number}, floor {floor}: {kind}: {text}", flush=True)

    number = first
    while done < ticks:
        floors(number, partial(check, number))
        number += 1
        told = ", ".join(f"{found[kind]} {kind}" for kind in KINDS)
        seconds = time.monotonic() - begun
        print(f"{done:,} ticks of {runs:,} runs in {seconds:.0f} s: {told}", flush=True)
    return not found.total()


if __name__ == "__main__":
    given_ticks, given_seed = (*map(int, sys.argv[1:]), *(TICKS, 1)[len(sys.argv) - 1 :])
    sys.exit(0 if trials(given_ticks, given_seed) else 1)
