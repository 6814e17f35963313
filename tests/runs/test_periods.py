"""A run by period, its bottleneck, and whether it is complete when its limit comes."""

from __future__ import annotations

import json

import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.runs.bottleneck import bottleneck_sentences, bottlenecks_of, saturated
from automaton.runs.headless import run_once
from automaton.runs.periods import Period, ticks_of_period
from automaton.world.resolve import resolve

CALM = Period(
    begin=0,
    end=100,
    name="tick 0",
    done=10,
    backlog=5,
    late=None,
    on_orders=5.0,
    in_traffic=0.0,
    in_station_queues=0.0,
    charging=0.0,
    to_chargers=0.0,
    for_chargers=0.0,
    down=0.0,
    stations=(0.5, 0.5),
    station_queues=(0.0, 0.0),
    chargers=(0.5,),
    charger_queues=(0.0,),
)
NAMES = ("P1", "P2")


@pytest.mark.parametrize(
    ("change", "resource"),
    [
        ({}, ""),
        ({"chargers": (0.95,), "charger_queues": (0.8,), "stations": (1.0, 1.0)}, "chargers"),
        ({"chargers": (0.95,)}, ""),
        ({"stations": (1.0, 0.95)}, "stations"),
        ({"stations": (0.2, 0.95)}, "station P2"),
        ({"in_traffic": 3.0}, "traffic"),
        ({"on_orders": 9.8}, "robots"),
        ({"on_orders": 9.8, "backlog": 0}, ""),
        ({"on_orders": 6.0, "charging": 2.0, "to_chargers": 1.0, "down": 1.0}, "robots"),
    ],
)
def test_what_is_saturated_in_a_period(change: dict[str, object], resource: str) -> None:
    assert saturated(CALM._replace(**change), 10, NAMES) == resource  # type: ignore[arg-type]


def test_the_bottleneck_is_what_is_saturated_for_longest() -> None:
    calm = CALM._replace(on_orders=1.0)
    busy = calm._replace(on_orders=3.0)
    full = calm._replace(chargers=(1.0,), charger_queues=(2.0,))
    shapes = [busy, full, full, calm, full, busy]
    periods = [one._replace(begin=100 * k, end=100 * (k + 1)) for k, one in enumerate(shapes)]
    first, second = bottlenecks_of(periods, 3, NAMES)
    assert (first.resource, first.share, first.first, first.last) == ("chargers", 0.5, 1, 2)
    assert (second.resource, second.first) == ("robots", 0)
    [text] = bottleneck_sentences(resolve("tabletop-mini", ["fleet.robots=3"]), periods, ())
    assert text.startswith(
        "Chargers were the bottleneck, saturated for 50 % of the run; the longest"
    )
    assert "tick 100 to tick 300: 1 of 1 charger busy; 2 robots standing on the way to one." in text
    assert "Robots were also saturated" in text


def test_periods_add_up_to_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "goods-mini", "--every", "50", "--json"]) == 0
    run = json.loads(capsys.readouterr().out)
    periods = run["periods"]
    assert [one["begin"] for one in periods] == [0, 50, 100]
    assert periods[-1]["end"] == run["ticks"] and periods[-1]["backlog"] == 0
    assert sum(one["done"] for one in periods) == run["metrics"]["lines_done"]

    def robot_ticks(name: str) -> float:
        return sum(one[name] * (one["end"] - one["begin"]) for one in periods)

    assert robot_ticks("on_orders") == pytest.approx(run["robot_time"]["on_orders"])
    assert robot_ticks("in_station_queues") == pytest.approx(run["metrics"]["lost_station_queue"])
    served = sum(one["stations"][0] * (one["end"] - one["begin"]) for one in periods)
    assert served / run["ticks"] == pytest.approx(run["stations"][0]["service_share"])
    assert main(["run", "goods-mini", "--every", "50"]) == 0
    assert "lines/h" in capsys.readouterr().out


def test_chargers_are_as_busy_as_the_robots_that_charge(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "depots", "--json"]) == 0
    run = json.loads(capsys.readouterr().out)
    busy = sum(row["utilization"] * row["places"] for row in run["chargers"]) * run["ticks"]
    assert busy == pytest.approx(run["robot_time"]["charging"])
    lost = sum(row["mean_queue"] for row in run["chargers"]) * run["ticks"]
    assert lost == pytest.approx(run["metrics"]["lost_charger_queue"])


def test_looking_at_periods_changes_no_run() -> None:
    resolved = resolve("tabletop-1")
    assert run_once(resolved).digest == run_once(resolved, every=7).digest


@pytest.mark.parametrize(
    ("settings", "text", "ticks"),
    [
        (["units.tick=0.5 s"], None, 7200),
        (["units.tick=0.5 s"], "15min", 1800),
        ([], "500", 500),
        ([], None, 0),
    ],
)
def test_a_period_is_an_hour_a_time_or_ticks(
    settings: list[str], text: str | None, ticks: int
) -> None:
    assert ticks_of_period(resolve("tabletop-mini", settings), text) == ticks


@pytest.mark.parametrize("text", ["often", "0", "0.1 s", "-5"])
def test_another_period_is_one_sentence(text: str) -> None:
    with pytest.raises(InputError, match="--every"):
        ticks_of_period(resolve("tabletop-mini", ["units.tick=0.5 s"]), text)


SHORT = ["--set", "stop.max_duration=500", "--json"]


def test_a_limit_is_the_end_of_a_shift_and_else_a_failure(
    capsys: pytest.CaptureFixture[str],
) -> None:
    clock = ["--set", "units={tick: 1 s, clock: '06:00'}"]
    for settings, is_complete in (
        ([], False),
        (["--set", "stop.at_limit=end"], True),
        (clock, True),
        ([*clock, "--set", "stop.at_limit=failure"], False),
    ):
        assert main(["run", "tabletop-1", *SHORT, *settings]) == (0 if is_complete else 1)
        run = json.loads(capsys.readouterr().out)
        assert run["finished"] == is_complete and "makespan" not in run["metrics"]


def test_a_run_that_never_ends_cannot_fail_at_its_limit() -> None:
    with pytest.raises(InputError, match="no run would ever be complete"):
        resolve("tabletop-1", ["stop={when: never, at_limit: failure}"])


def test_deadlocks_are_told_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "tabletop-mini", "--set", "strategy.right_of_way=wait"]) == 1
    head = capsys.readouterr().out.split("All metrics")[0]
    assert "1 deadlock, " in head and "(8, 1) from tick 158" in head
