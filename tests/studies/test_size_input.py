"""What `automaton size` is asked: targets, fleets and strategies as typed, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest

import automaton
from automaton.commands import main
from automaton.errors import InputError
from automaton.studies.process_pool import PersistentPool
from automaton.studies.sizing.fleet_runs import Fleets, run_and_measure_use
from automaton.studies.sizing.fleet_search import (
    Target,
    make_question,
    read_robots,
    read_target,
    robots_of,
    strategies_named,
    strategies_of,
)
from automaton.units import Unit

HALF = Unit(0.5, "s")


def size(capsys: Any, *arguments: str) -> tuple[int, str, str]:
    code = main(["size", *arguments])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--target", "makespn<=3"], "no metric is called 'makespn' (did you mean 'makespan'?)"),
        (["--target", "makespan<3"], "use <= or >=, not <"),
        (["--target", "makespan"], "expected METRIC<=VALUE"),
        (["--target", "makespan<=5h"], "units.tick of the scenario is cycle; use ticks"),
        (["--target", "throughput>=5h"], "throughput is in orders/1000 ticks, not a time"),
        (["--target", "makespan<=soon"], "'soon' is not a number"),
        (["--target", "makespan<=nan"], "'nan' is not a number"),
        (["--target", "delay<=3"], "does not measure delay; it needs measure: {warm_up: N}"),
        (["--robots", "5..2"], "1 <= FIRST <= LAST"),
        (["--robots", "few"], "expected FIRST..LAST, such as 1..12"),
        (["--robots", "1..400"], "automaton: --robots 400: fleet.robots is 400 but the floor has"),
        (["--set", "fleet.start=[[0, 0], [1, 0], [2, 0]]"], "--set fleet.start=random"),
        (["--success-share", "0.99"], "must lie between 0 and 1"),
        (["--success-share", "1.5"], "must lie between 0 and 1"),
        (
            ["--success-share", "95"],
            "--success-share 95: a share must lie between 0 and 1, such as 0.95 or 95%",
        ),
        (["--success-share", "99%"], "must lie between 0 and 1: 0.99 and 0.02"),
        (["--success-share", "much%"], "'much' is not a number above 0"),
        (["--indifference", "0"], "is not a number above 0"),
        (["--alpha", "0.7"], "the error probability must lie between 0 and 0.5"),
        (["--budget", "10"], "a fleet needs at least"),
        (["--budget", "none"], "is not a number of runs"),
        (
            ["--budget", "240", "--strategies", "independent,cooperative,adaptive"],
            "a fleet needs at least 124 runs to pass; each of 3 strategies gets 80",
        ),
        (["--strategies", "cooperativ"], "did you mean 'cooperative'?"),
        (["--strategies", "cooperative,cooperative"], "names a strategy twice"),
        (["--strategies", "routing=fastest"], "automaton: --strategies routing=fastest: "),
        (["--set", "fleet.robot=3"], "did you mean 'robots'?"),
    ],
)
def test_bad_input_is_one_sentence(capsys: Any, arguments: list[str], told: str) -> None:
    usual = {"--target": "makespan<=1700", "--robots": "1..3"}
    given = [text for pair in usual.items() if pair[0] not in arguments for text in pair]
    code, out, err = size(capsys, "tabletop-mini", *given, *arguments)
    assert code == 2
    assert told in err and err.count("\n") == 1 and out == ""


def test_a_floor_made_for_so_many_robots_says_what_frees_it(capsys: Any) -> None:
    options = ("--target", "makespan<=18000", "--robots", "1..5")
    any_fleet = ["fleet.start=random", "strategy.zoning.design=null"]
    code, _, err = size(capsys, "factory", *options)
    settings = " ".join(f"--set {setting}" for setting in any_fleet)
    assert code == 2 and err.endswith(f"; for other fleet sizes use {settings}\n")
    code, _, err = size(capsys, "factory", *options, "--set", any_fleet[0])
    assert code == 2 and "there are 1 (without a design, strategy.zoning.design=null" in err
    with PersistentPool(1, run_and_measure_use) as rounds:
        fleets = Fleets("factory", any_fleet, None, rounds)
        question = make_question(Target("makespan", True, 18_000.0), (1, 5))
        fleets.check(question)
        excluded = fleets.excluded(question)
    assert list(excluded) == [1, 2, 3, 4, 5]
    assert (
        excluded[1]
        == "makespan is at least 36,620 ticks (6.46 h): work of 36,620 robot ticks shared by 1"
    )
    assert excluded[5].startswith(
        "makespan is at least 18,880 ticks (3.331 h): the busiest station works on"
    )


def test_targets_and_fleets_as_typed() -> None:
    assert read_target("makespan <= 3,000") == Target("makespan", True, 3000.0)
    assert read_target("utilization>=60%") == Target("utilization", False, 0.6)
    assert read_target("makespan<=2 h", HALF) == Target("makespan", True, 14_400.0, "h", 7200.0)
    assert read_target("lead_time <= 90s", HALF).value == 180
    assert read_target("lead_time_p95<=00:15:00", HALF).value == 1800
    assert read_target("lead_time_p95<=0.5 d", HALF).value == 86_400
    assert read_robots("3..7") == (3, 7)
    assert read_robots("4") == (4, 4)
    assert strategies_named("adaptive, routing=astar") == (
        "strategy.allocation=adaptive",
        "strategy.routing=astar",
    )
    with pytest.raises(InputError, match="no strategy"):
        strategies_named("none")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("blocked_share<=10", "blocked_share is a share between 0 and 1, such as 10% or 0.1"),
        ("utilization>=90", "utilization is a share between 0 and 1"),
        ("blocked_share<=101%", "blocked_share is a share between 0 and 1"),
        ("blocked_share<=5h", "blocked_share is a share between 0 and 1"),
        ("blocked_share<=-1%", "blocked_share cannot be below 0"),
        ("makespan<=-1", "makespan cannot be below 0"),
        ("throughput>=100%", "'%' is not understood; throughput is in orders/1000 ticks"),
        ("makespan<=100%", "'%' is not understood; makespan is in ticks"),
    ],
)
def test_shares_are_typed_as_shares_and_nothing_else_is(text: str, told: str) -> None:
    with pytest.raises(InputError) as refused:
        read_target(text)
    assert str(refused.value).startswith(f"--target '{text}': {told}")


def test_a_throughput_may_be_typed_as_a_rate() -> None:
    target = read_target("throughput>=120/h", HALF)  # 2 a minute, of 120 ticks
    assert target.value == pytest.approx(1000 / 60)
    assert target.in_unit(target.value) == "orders/1000 ticks (120 /h)"
    assert read_target("throughput>=2 / min", HALF).value == target.value


def test_a_share_may_be_typed_either_way() -> None:
    for text in (
        "blocked_share<=10%",
        "blocked_share <= 10 %",
        "blocked_share<=0.1",
        "blocked_share<=1e-1",
    ):
        assert read_target(text) == Target("blocked_share", True, 0.1)
    assert read_target("utilization>=1").value == read_target("utilization>=100%").value == 1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("makespan<=8 hors", "'hors' is not understood; makespan is in ticks, or a time in ms, s"),
        ("makespan<=8parsec", "'parsec' is not understood; makespan is in ticks, or a time in"),
        ("distance<=700m", "'m' is not understood; distance is in cells"),
        ("lead_time<=00:15", "has two parts, which may be hours and minutes or minutes and seconds"),
        ("lead_time<=1,5 min", "write '1,5 min' with a decimal point, such as 1.5"),
        ("lead_time<=120/h", "lead_time is in ticks, not a rate"),
        ("throughput>=3 h", "throughput is in orders/1000 ticks, not a time"),
        ("throughput>=3 parts", "orders/1000 ticks, or a rate such as 120/h"),
    ],
)  # fmt: skip
def test_units_that_are_not_known_name_those_that_are(text: str, told: str) -> None:
    with pytest.raises(InputError) as refused:
        read_target(text, HALF)
    assert told in str(refused.value)


def test_fleets_and_strategies_from_python_may_be_given_in_several_ways() -> None:
    assert robots_of("1..6") == robots_of((1, 6)) == robots_of([1, 6]) == (1, 6)
    assert robots_of(4) == robots_of("4") == (4, 4)
    named = strategies_named("independent,adaptive")
    assert strategies_of(["independent", "adaptive"]) == strategies_of("independent,adaptive")
    assert strategies_of(("independent", "adaptive")) == named
    assert strategies_of(None) == ("",)


@pytest.mark.parametrize("given", [None, 2.5, (1, 2, 3), [1], ("1", "2"), {1, 2}, range(1, 3)])
def test_fleets_from_python_that_are_none_are_refused(given: Any) -> None:
    with pytest.raises(InputError, match="expected a number"):
        automaton.size("tabletop-mini", "makespan<=1700", robots=given)


@pytest.mark.parametrize("given", [3, [1, 2], {"adaptive": 1}])
def test_strategies_from_python_that_are_none_are_refused(given: Any) -> None:
    with pytest.raises(InputError, match="expected names, such as 'independent,cooperative'"):
        automaton.size("tabletop-mini", "makespan<=1700", robots=1, strategies=given)
