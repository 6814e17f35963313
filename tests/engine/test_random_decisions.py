"""Random floors and random decisions, legal and illegal: nothing breaks a rule of the world.

Every example is recorded and judged by the independent validator and by checks of positions, loads
and charges, and run a second time with its robots stored in another order; motion_trials.py goes
through far more of them. The last assertion says which situations the examples went through.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
from hypothesis import given, seed, settings
from physical_checks import PhysicalChecks
from random_cases import TICKS, Case, cases
from traffic_coverage import WANTED, count_illegal, count_traffic_cases

from automaton.engine.state import ACTION_MOVE
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored

EXAMPLES = 300
FURTHER = 3  # rounds of as many examples, until each situation has occurred


def judged(case: Case) -> Simulation:
    """A run, found to keep all rules, however robots are stored."""
    recorder = MemoryRecorder(case.resolved)
    run = Simulation(case.resolved, on_record=recorder)
    run.run()
    report = validate_stored(recorder.recording())
    assert [str(violation) for violation in report.violations] == []
    again = Simulation(case.resolved, storage=np.array(case.storage, np.int32))
    again.run()
    assert again.digest == run.digest, "how robots are stored matters"
    return run


def test_no_decision_breaks_a_rule_of_types() -> None:
    """Two types, drawn orders of weight 1 to 3, areas: what is illegal is refused by the world."""
    reached: Counter[str] = Counter()

    @settings(max_examples=EXAMPLES // 4)
    @given(cases(types=True))
    def check(case: Case) -> None:
        world = judged(case).world
        reached["area"] += bool(case.resolved.scenario.areas)
        reached["slow"] += (
            int(world.rules.duration[0, ACTION_MOVE]) > case.resolved.scenario.durations.move
        )
        reached["heavy"] += bool((world.orders.weight > world.rules.payload[0]).any())

    check()
    assert min(reached.values()) > 10, reached


def test_no_decision_breaks_a_rule() -> None:
    reached: Counter[str] = Counter()

    def check(case: Case) -> None:
        recorder = MemoryRecorder(case.resolved)
        run = Simulation(case.resolved, on_record=recorder)
        checks = PhysicalChecks(run.world)
        for number in range(1, TICKS + 1):
            run.run(until=number)
            checks.tick()
            count_traffic_cases(run.world, reached)
        assert not checks.found, checks.first
        count_illegal(run.world, reached)
        report = validate_stored(recorder.recording())
        assert [str(violation) for violation in report.violations] == []
        assert report.ticks == TICKS
        again = Simulation(case.resolved, storage=np.array(case.storage, np.int32))
        again.run()
        assert again.digest == run.digest, "how robots are stored matters"

    settings(max_examples=EXAMPLES)(given(cases())(check))()
    for further in range(
        FURTHER
    ):  # what is rare may be missing: examples depend on what is imported
        if all(reached[situation] for situation in WANTED):
            break
        more = settings(max_examples=EXAMPLES, derandomize=False)
        seed(further)(more(given(cases())(check)))()
    missing = [situation for situation in WANTED if not reached[situation]]
    assert not missing, f"never reached: {missing}; reached: {dict(reached)}"
