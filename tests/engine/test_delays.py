"""Robots that are delayed: when they stand, what takes longer by it, and how often it happens."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from automaton.engine.random_numbers import STREAM_DELAYS, random_bits
from automaton.engine.record_codes import CHANGE_DELAYED
from automaton.engine.state import Array
from automaton.errors import InputError
from automaton.history.event_history import EventHistory
from automaton.history.explanation import explain
from automaton.history.snapshot import take_snapshot
from automaton.recording.contents import FRAME_KIND_TICKS, DecodedFrame
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.durations import Distribution, Lognormal, Uniform
from automaton.scenario.fleet import Faults
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import validated
from automaton.verification.move_time_rules import durations_of, poisson_number, repairs_of
from automaton.verification.validator import validate_recording, validate_stored
from automaton.world.draws import delay_ticks, poisson_counts, repair_ticks
from automaton.world.resolve import Resolved, resolve

RARE = 0.02  # of a robot and tick


def scene(**parts: Any) -> dict[str, Any]:
    """A robot drives four cells east; a move takes four ticks."""
    scenario: dict[str, Any] = {
        "name": "delays",
        "layout": {"picture": "....."},
        "fleet": {"robots": 1, "kinematics": "omni", "start": [[0, 0]]},
        "durations": {"move": 4},
        "orders": {"list": [{"stops": [[4, 0]]}]},
        "strategy": {"allocation": "first-come", "routing": "shortest", "right_of_way": "wait"},
        "stop": {"when": "delivered", "max_duration": 1000},
    }
    return scenario | parts


def resolved(scenario: dict[str, Any]) -> Resolved:
    return resolve(msgspec.convert(scenario, Scenario))


def delays(least: int, most: int, probability: float = RARE, **more: Any) -> dict[str, Any]:
    return {"delays": {"probability": probability, "ticks": {"from": least, "to": most}, **more}}


def seed_with_delay_in(tick: int, ticks: int) -> int:
    """A seed with which robot 0 begins a delay in this tick, and in none of these before or after."""
    for seed in range(10_000):
        with np.errstate(over="ignore"):
            draws = [
                int(random_bits(np.uint64(seed), STREAM_DELAYS, at, 0)) >> 32
                for at in range(1, ticks + 1)
            ]
        if [at for at, draw in enumerate(draws, 1) if draw < RARE * 2**32] == [tick]:
            return seed
    raise AssertionError("no such seed")


def run(scenario: dict[str, Any], **more: Any) -> Simulation:
    """A run that the validator has nothing to say against."""
    made = resolved(scenario)
    recorder = MemoryRecorder(made)
    simulation = Simulation(made, on_record=recorder, **more)
    simulation.run()
    assert [str(one) for one in validate_stored(recorder.recording()).violations] == []
    return simulation


@pytest.mark.parametrize(
    ("lasts", "of", "ends"),
    [
        (3, ["move", "turn"], 16 + 3),  # the move under way takes three ticks more
        (3, ["turn"], 16),  # it goes on, and the delay is over when it ends
        (6, ["turn"], 16 + 3),  # it ends in tick 4; the robot stands in 5, 6 and 7
    ],
)
def test_a_delay_in_the_second_tick_of_a_move(lasts: int, of: list[str], ends: int) -> None:
    seed = seed_with_delay_in(2, 30)
    made = run(scene(seed=seed, faults=delays(lasts, lasts, of=of)))
    assert made.tick == ends
    assert made.world.delays.lasted.tolist() == [lasts]
    assert metrics_of(made)["delayed_share"] == pytest.approx(lasts / ends)


def test_a_robot_that_stands_begins_nothing_in_a_delay() -> None:
    made = run(scene(seed=seed_with_delay_in(1, 30), faults=delays(5, 5)))
    assert made.tick == 5 + 16


def test_a_delayed_robot_says_until_when() -> None:
    seed = seed_with_delay_in(2, 30)
    made = resolved(scene(seed=seed, faults=delays(3, 3)))
    simulation = Simulation(made, on_observe=EventHistory())
    simulation.run(3)
    snapshot = take_snapshot(simulation)
    told = explain(snapshot, made.floor_plan, 0)
    assert told.lines == ["robot 0 has been waiting for 2 ticks: robot 0 is delayed up to tick 4"]
    assert told.chain[0].cause == "delayed"
    simulation.run(5)
    assert explain(take_snapshot(simulation), made.floor_plan, 0).lines == [
        "robot 0 is driving for 2 more ticks"
    ]


@pytest.mark.parametrize("events", ["bernoulli", "poisson"])
def test_robots_are_delayed_as_often_as_they_should_be(events: str) -> None:
    """p D / (p D + 1 - p) of their ticks, which is 2.46 % for p = 0.01 and D from 1 to 4.

    A delay comes after (1 - p) / p ticks without one, memoryless: by the central limit theorem for
    renewals with rewards the share of N robot ticks has the variance
    ((1 - s)^2 Var D + s^2 (1 - p) / p^2) / (mean D + (1 - p) / p) / N.
    """
    p, mean, variance, robots, ticks = 0.01, 2.5, 1.25, 20, 20_000
    faults = delays(1, 4, probability=p, events=events)
    made = Simulation(
        resolved(
            scene(
                layout={"picture": "\n".join(["." * robots] * 2)},
                fleet={
                    "robots": robots,
                    "kinematics": "omni",
                    "start": [[x, 0] for x in range(robots)],
                },
                orders={"list": [{"stops": [[0, 1]]}]},
                faults=faults,
                stop={"when": "never", "max_duration": ticks},
            )
        )
    )
    made.run()
    share = p * mean / (p * mean + 1 - p)
    assert share == pytest.approx(0.0246, abs=0.00005)
    reward = (1 - share) ** 2 * variance + share**2 * (1 - p) / p**2
    deviation = (reward / (mean + (1 - p) / p) / (robots * ticks)) ** 0.5
    assert deviation < 0.0005
    assert abs(metrics_of(made)["delayed_share"] - share) < 4 * deviation


def faults_of(given: dict[str, Any]) -> Faults:
    return msgspec.convert(given, Faults)


def shares(table: Array, values: range) -> list[float]:
    return [float((table == value).mean()) for value in values]


def test_durations_are_uniform_or_normal() -> None:
    rules = faults_of(delays(1, 4)).delays
    assert rules is not None
    assert delay_ticks(rules).tolist() == [1, 2, 3, 4]
    rules = faults_of(delays(1, 4, distribution={"gaussian": {}})).delays
    assert rules is not None
    # Between 1.5 and 2.5 lies z from (1/6 - 1/2) / 0.22 to 0, and likewise on the other side.
    assert shares(delay_ticks(rules), range(1, 5)) == pytest.approx(
        [0.06487, 0.43513, 0.43513, 0.06487], abs=0.0001
    )


@pytest.mark.parametrize(
    "distribution",
    [
        Distribution(uniform=Uniform(least=3.5, most=90)),
        Distribution(lognormal=Lognormal(mean=40, sd=25)),
        Distribution(exponential=30.0),
        Distribution(empirical=(3.0, 0.2, 7.5)),
        12,
    ],
)
def test_tables_of_repairs_are_those_of_the_validator(distribution: Any) -> None:
    faults = Faults(repair_in_place=distribution)
    table = repair_ticks(faults)
    assert table.tolist() == repairs_of(msgspec.to_builtins(faults)["repair_in_place"])
    mean = {"lognormal": 40.0, "exponential": 30.0, "uniform": 46.75}
    for name, value in mean.items():
        if getattr(distribution, name, None) is not None:
            assert table.mean() == pytest.approx(value, rel=0.001)


@given(
    st.floats(0.0001, 1),
    st.integers(1, 9),
    st.integers(0, 20),
    st.floats(0, 1),
    st.floats(0, 2),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=20)
def test_its_draws_are_those_of_the_validator(
    mean: float, least: int, more: int, centre: float, spread: float, draw: int
) -> None:
    bell = {"gaussian": {"mean_ratio": centre, "sd_ratio": spread}}
    faults = faults_of(delays(least, least + more, distribution=bell))
    assert faults.delays is not None
    mine = msgspec.to_builtins(faults.delays)
    assert delay_ticks(faults.delays).tolist() == durations_of(mine)
    counts = poisson_counts(mean)
    for one in (draw, *counts.tolist(), *(counts - 1).tolist()):
        assert poisson_number(mean, one) == int((counts <= one).sum())


def test_a_poisson_number_has_its_mean() -> None:
    counts = np.append(poisson_counts(0.3), 2**32)
    weights = np.diff(counts, prepend=0) / 2**32
    numbers = np.arange(len(weights))
    assert weights @ numbers == pytest.approx(0.3, abs=1e-6)
    assert weights @ numbers**2 == pytest.approx(0.3 + 0.09, abs=1e-6)


# Whole runs, with everything that goes with it.

FLOOR = """\
c.........
.########.
..........
=########=
.........."""


@st.composite
def cases(draw: Any) -> dict[str, Any]:
    robots = draw(st.integers(1, 9))
    steered = draw(st.booleans())
    faults: dict[str, Any] = {"list": []}
    if draw(st.booleans()):
        faults |= {"mtbf": draw(st.sampled_from([20, 200]))}
        faults |= {"repair_in_place": draw(st.sampled_from([1, 9, {"exponential": 7}, None]))}
    if draw(st.booleans()) or "mtbf" not in faults:
        faults |= delays(
            draw(st.integers(1, 3)),
            draw(st.integers(3, 20)),
            probability=draw(st.sampled_from([0.02, 0.2, 0.9])),
            events=draw(st.sampled_from(["bernoulli", "poisson"])),
            of=draw(st.sampled_from([["move", "turn"], ["move"], ["turn"], []])),
        )
    battery = {"drain": {"move": 1, "turn": 0.5, "wait": draw(st.sampled_from([0, 0.3]))}}
    cells = [(x, y) for y in (2, 4) for x in range(10)]
    return scene(
        layout={"picture": FLOOR},
        fleet={
            "robots": robots,
            "kinematics": draw(st.sampled_from(["omni", "differential"])),
            "start": draw(st.permutations(cells))[:robots],
        },
        durations={"move": draw(st.integers(1, 3)), "turn": draw(st.integers(1, 2))},
        battery=battery | {"charge_rate": 5} if draw(st.booleans()) else None,
        orders={
            "generator": "tours",
            "count": 40,
            "stops": {"from": 1, "to": 2},
        },
        world={
            "slowdown": draw(st.sampled_from(["none", "zones"])),
            "following": draw(st.sampled_from(["convoy", "handover", "none"])),
        },
        floor={"speed_limits": [{"cells": [[0, 2], [4, 2]], "max_speed": draw(st.integers(1, 4))}]},
        faults=faults,
        strategy={
            "allocation": "first-come",
            **({"right_of_way": "pibt"} if steered else {"right_of_way": "retreat"}),
        },
        stop={"when": "never", "max_duration": 100},
        seed=draw(st.integers(0, 2**32)),
    )


def test_delayed_and_broken_robots_keep_all_rules_however_they_are_stored() -> None:
    delayed = repaired = 0

    @settings(max_examples=30)
    @given(cases(), st.randoms(use_true_random=False))
    def check(case: dict[str, Any], chance: Any) -> None:
        nonlocal delayed, repaired
        made = run(case)
        order = list(range(len(made.world.robots.cell)))
        chance.shuffle(order)
        other = Simulation(made.resolved, storage=np.array(order), on_observe=EventHistory())
        other.run()
        assert other.digest == made.digest
        assert int(made.world.tally.illegal.sum()) == 0
        delayed += int(made.world.delays.lasted.sum())
        repaired += int(made.world.tally.failures[:, 1].sum())

    check()
    assert delayed > 100 and repaired > 10


def test_a_delay_that_is_left_out_or_altered_breaks_a_rule() -> None:
    case = scene(seed=seed_with_delay_in(2, 30), faults=delays(3, 3))
    made = resolved(case)
    recorder = MemoryRecorder(made)
    Simulation(made, on_record=recorder).run()
    recording = recorder.recording()

    def verdict(alter: Any) -> set[str]:
        frames = []
        for kind, content in recording.frames:
            if kind == FRAME_KIND_TICKS:
                content = {**content, "changes": alter(content["changes"].copy())}
            frames.append(DecodedFrame(kind, content))
        return {one.rule for one in validate_recording(recording.header, frames).violations}

    def longer(rows: Array) -> Array:
        rows[rows[:, 1] == CHANGE_DELAYED, 3] += 1
        return rows

    assert verdict(lambda rows: rows) == set()
    assert "delay" in verdict(lambda rows: rows[rows[:, 1] != CHANGE_DELAYED])
    assert "delay" in verdict(longer)


@pytest.mark.parametrize(
    ("faults", "sentence"),
    [
        (delays(4, 1), "faults.delays.ticks.from (4) must not be above to (1)"),
        ({"mtbf": 50, "failure_probability": 0.1}, "mtbf and failure_probability are alternatives"),
    ],
)
def test_what_cannot_be(faults: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        validated(scene(faults=faults), Scenario)
    assert sentence in caught.value.message
