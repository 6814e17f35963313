"""A scenario in finer ticks: which numbers grow, which shrink, and what does not fit any more."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from automaton.commands import main
from automaton.world.resolve import Resolved, resolve

YARD = """name: yard
layout:
  picture: |
    .........
    .c#.#c#..
    .........
fleet: {robots: 2, start: random, kinematics: differential}
units: {tick: 0.6 s, cell: 1.2 m}
durations: {move: 1.2 m/s, turn: {empty: 1, loaded: 2}, pick: 3, handling_jitter: 2}
orders:
  list:
    - {stops: [{at: [0, 0], for: 4}], release: 5, due: 30}
    - {stops: [[8, 2]], due: {at: 50}}
battery: {drain: {move: 0.3}, charge_rate: [[0, 3], [80, 1.5]]}
faults: {failure_probability: 0.003, tow_after: 20, list: [{robot: 1, at: 7}]}
floor:
  closed: [{cells: [[3, 0]], from: 4, for: 6, every: 20}]
  speed_limits: [{cells: [[0, 0], [4, 0]], max_speed: 4}]
strategy: {right_of_way: {name: retreat, wait_empty: [2, 6]}, charging: none}
measure: {warm_up: 10}
stop: {when: never, max_duration: 100}
"""


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    path = tmp_path / "yard.yaml"
    path.write_text(YARD)
    return path


def refined(path: Path, *settings: str) -> Resolved:
    return resolve(path, ["refine=3", *settings])


def test_every_duration_is_multiplied_after_it_was_rounded(yard: Path) -> None:
    durations = refined(yard).scenario.durations
    assert (durations.moves.empty, durations.pick, durations.handling_jitter) == (6, 9, 6)
    assert (durations.turns.empty, durations.turns.loaded) == (3, 6)
    scenario = refined(yard).scenario
    assert scenario.measure is not None
    assert (scenario.stop.max_duration, scenario.measure.warm_up) == (300, 30)
    assert scenario.floor.speed_limits[0].max_speed == 12
    assert scenario.faults.tow_after == 60
    assert refined(yard).floor_plan.min_move_ticks.max() == 12


def test_rates_and_chances_are_divided(yard: Path) -> None:
    scenario = refined(yard).scenario
    assert scenario.faults.failure_probability == pytest.approx(0.001)
    assert scenario.battery is not None
    assert scenario.battery.drain.move == pytest.approx(0.1)
    assert scenario.battery.charge_rate == ((0.0, 1.0), (80.0, 0.5))


def test_what_happens_in_a_tick_happens_when_it_begins_and_is_due_when_it_ends(yard: Path) -> None:
    scenario = refined(yard).scenario
    first, second = scenario.orders.listed or ()
    assert (first.release, first.due_tick, first.stop_ticks) == (13, 105, (12,))
    assert (second.release, second.due_tick) == (0, 150)
    assert scenario.faults.listed[0].at == 19
    closing = scenario.floor.closed[0]
    assert (closing.begin, closing.ticks, closing.every) == (10, 18, 60)


def test_a_tick_is_so_much_shorter_and_parameters_of_strategies_go_along(yard: Path) -> None:
    resolved = refined(yard)
    assert resolved.scenario.units.tick == "0.2 s"
    assert resolved.strategies["right_of_way"].parameters.wait_empty == (6, 18)  # type: ignore[attr-defined]
    assert refined(yard, "units.tick=1 cycle", "durations.move=2").scenario.units.tick.endswith(
        " cycle"
    )


def test_a_scenario_that_is_not_refined_stays_as_it_is_read(yard: Path) -> None:
    resolved = resolve(yard, ["refine=1"])
    assert resolved.unrefined is resolved
    assert resolved.scenario == resolve(yard).scenario


def test_a_refined_scenario_goes_to_another_process(yard: Path) -> None:
    resolved = refined(yard)
    again = pickle.loads(pickle.dumps(resolved))
    assert (again.scenario, again.strategies) == (resolved.scenario, resolved.strategies)
    assert again.unrefined.scenario == resolve(yard, ["refine=3"]).unrefined.scenario


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--refine", "0"], "--refine: '0' is not a refinement: allowed are 1 to 1000"),
        (["--refine", "x"], "--refine: 'x' is not a refinement"),
        (["--decide", "fine"], "--decide fine: needs --refine K"),
        (
            ["--refine", "9", "--set", "durations.move=8000"],
            "durations.move takes 72,000 ticks instead of 8,000, and at most 65,535 are allowed; "
            "refine 8 still fits",
        ),
        (
            ["--refine", "900", "--set", "stop.max_duration=9000000"],
            "stop.max_duration takes 8,100,000,000 ticks",
        ),
        (
            ["--refine", "60", "--set", "strategy.right_of_way=epibt"],
            "with refine 60 strategy.right_of_way is epibt: it plans 256 ticks at most",
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_a_sentence(
    yard: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in ("check", "run"):
        assert main([command, str(yard), *arguments]) == 2
        printed = capsys.readouterr().err
        assert words in printed
        assert printed.count("\n") == 1


def test_check_says_that_the_tick_is_refined(
    yard: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(yard), "--refine", "3"]) == 0
    assert "tick refined 3 times: 0.2 s, ok" in capsys.readouterr().out
