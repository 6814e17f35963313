"""A run by period, its bottleneck, and whether it is complete when its limit comes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from automaton.commands import main
from automaton.documents.text_output import as_text
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.runs.bottleneck import (
    bottleneck_sentences,
    bottlenecks_of,
    facts,
    joined,
    others,
    saturated,
)
from automaton.runs.headless import run_once
from automaton.runs.periods import Period, ticks_of_period, waiting_parts
from automaton.runs.run_report import run_document
from automaton.runs.simulation import Simulation
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
    aside=0.0,
    down=0.0,
    delayed=0.0,
    refused=0.0,
    idle=5.0,
    stations=(0.5, 0.5),
    station_queues=(0.0, 0.0),
    station_parts=(),
    chargers=(0.5,),
    charger_queues=(0.0,),
    places=(1,),
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
        ({"on_orders": 9.8, "idle": 0.2}, "robots"),
        ({"on_orders": 9.8, "idle": 0.2, "backlog": 0}, ""),
        ({"on_orders": 9.8, "idle": 0.0, "aside": 2.0}, ""),
        ({"chargers": (0.9, 0.1), "charger_queues": (1.0, 0.0), "places": (9, 1)}, ""),
        ({"chargers": (1.0, 0.1), "charger_queues": (1.0, 0.0), "places": (9, 1)}, "chargers"),
    ],
)
def test_what_is_saturated_in_a_period(change: dict[str, object], resource: str) -> None:
    expected = [resource] if resource else []
    assert saturated(CALM._replace(**change), 10, NAMES) == expected  # type: ignore[arg-type]


FEW_BUSY = CALM._replace(
    stations=(1.0, 0.95, 0.1, 0.1, 0.1), station_queues=(3.0, 1.0, 0.0, 0.0, 0.0)
)


@pytest.mark.parametrize(
    ("parts", "first", "queue"), [((2.0, 5.0, 9, 0, 0), "B", "4.5 parts"), ((), "A", "3 robots")]
)
def test_of_stations_that_are_saturated_equally_long_the_one_with_the_longest_queue_is_first(
    parts: tuple[float, ...], first: str, queue: str
) -> None:
    """Though in a single period the queue of the other was longer."""
    names = ("A", "B", "C", "D", "E")
    other = tuple(4.0 if k < 2 else 0.0 for k in range(5)) if parts else ()
    periods = [
        FEW_BUSY._replace(begin=100 * k, end=100 * (k + 1), station_parts=shape)
        for k, shape in enumerate((parts, other))
    ]
    both = bottlenecks_of(periods, 10, names)
    assert {(one.resource, one.share, one.first, one.last) for one in both} == {
        ("station A", 1.0, 0, 1),
        ("station B", 1.0, 0, 1),
    }
    assert both[0].resource == f"station {first}"
    assert facts(both[0].resource, joined(periods), 10, names)[1] == f"{queue} in its queue"


def test_stations_that_are_saturated_by_turns_outlast_chargers() -> None:
    """Each counts in all periods in which it works all the time."""
    few = FEW_BUSY._replace(station_queues=(0.0,) * 5)
    full = few._replace(chargers=(1.0,), charger_queues=(2.0,))
    periods = [
        one._replace(begin=100 * k, end=100 * (k + 1), station_parts=(k % 2, 1 - k % 2, 0, 0, 0))
        for k, one in enumerate([full, full, few, few, few])
    ]
    shares = {one.resource: one.share for one in bottlenecks_of(periods, 10, tuple("ABCDE"))}
    assert shares == {"station A": 0.6, "station B": 0.6, "chargers": 0.4}


def test_of_many_saturated_resources_three_are_described_and_the_others_named() -> None:
    periods = [
        CALM._replace(
            begin=100 * k,
            end=100 * (k + 1),
            stations=tuple(1.0 if k >= 2 * one else 0.1 for one in range(4)) + (0.1,) * 5,
            station_queues=(0.0,) * 9,
        )
        for k in range(8)
    ]
    [text] = bottleneck_sentences(resolve("tabletop-mini"), periods)
    assert text.startswith("Station 1 was the bottleneck, saturated for 100 % of the run;")
    assert text.count("also saturated, from") == 2
    assert text.endswith("Also saturated: station 4.")


def test_parts_wait_from_their_arrival_to_the_beginning_of_their_work() -> None:
    run = Simulation(resolve("factory"), seed=1)
    waited = np.zeros((2, len(run.world.stations.slot)))
    for tick in range(400):
        run.run(until=tick + 1)
        jobs = run.world.stations
        come = (jobs.arrival_tick != NIL) & (jobs.arrival_tick <= tick)
        begun = jobs.completion_tick != NIL
        for job, done in zip(jobs.in_service, jobs.job_done_tick, strict=True):
            begun[job] |= job != NIL and done - jobs.processing_time[job] <= tick
        waited[tick // 200] += np.bincount(jobs.station[come & ~begun], minlength=waited.shape[1])
    assert waited.any()
    means = waiting_parts(run.world, np.array([0, 200, 400]))
    assert (200 * means).round().tolist() == waited.tolist()


ON_ORDERS = ("driving_loaded", "driving_empty", "turning", "handling")  # uses of time on orders


def test_the_bottleneck_is_what_is_saturated_for_longest() -> None:
    calm = CALM._replace(on_orders=1.0)
    busy = calm._replace(on_orders=3.0, idle=0.0)
    full = calm._replace(chargers=(1.0,), charger_queues=(2.0,))
    shapes = [busy, full, full, calm, full, busy]
    periods = [one._replace(begin=100 * k, end=100 * (k + 1)) for k, one in enumerate(shapes)]
    first, second = bottlenecks_of(periods, 3, NAMES)
    assert (first.resource, first.share, first.first, first.last) == ("chargers", 0.5, 1, 2)
    assert (second.resource, second.first) == ("robots", 0)
    [text] = bottleneck_sentences(resolve("tabletop-mini", ["fleet.robots=3"]), periods)
    assert text.startswith(
        "Chargers were the bottleneck, saturated for 50 % of the run; the longest"
    )
    assert (
        "stretch was from tick 100 to tick 300: 1 of 1 charger busy; 2 robots standing on the way to a "
        "charger." in text
    )
    assert "Robots were also saturated, from tick 0 to tick 100: " in text


def test_periods_add_up_to_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "goods-mini", "--every", "50", "--json"]) == 0
    run = json.loads(capsys.readouterr().out)
    periods = run["periods"]
    assert [one["begin"] for one in periods] == [0, 50, 100]
    assert periods[-1]["end"] == run["ticks"] and periods[-1]["backlog"] == 0
    assert sum(one["done"] for one in periods) == run["metrics"]["lines_done"]

    def robot_ticks(name: str) -> float:
        return sum(one[name] * (one["end"] - one["begin"]) for one in periods)

    on_orders = sum(run["robot_time"][name] for name in ON_ORDERS)
    assert robot_ticks("on_orders") == pytest.approx(on_orders)
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


USES = [
    *("on_orders", "in_traffic", "in_station_queues", "charging", "to_chargers", "for_chargers"),
    *("aside", "down", "delayed", "refused", "idle"),
]


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("tabletop-1", []),
        ("bad-day", []),
        ("depots", []),
        ("goods-mini", []),
        ("tabletop-1", ["strategy.right_of_way=pibt", "fleet.robots=6", "refine=2"]),
    ],
)
@pytest.mark.parametrize("every", [7, 100])
def test_in_each_period_each_robot_is_used_for_one_thing(
    name: str, settings: list[str], every: int
) -> None:
    resolved = resolve(name, settings)
    outcome = run_once(resolved, until=1500, every=every)
    robots, ticks = resolved.scenario.fleet.robots, dict.fromkeys(USES, 0.0)
    for period in outcome.periods:
        uses = {one: getattr(period, one) for one in USES}
        assert sum(uses.values()) == pytest.approx(robots) and min(uses.values()) > -1e-9, uses
        ticks = {one: ticks[one] + uses[one] * period.ticks for one in USES}
    assert ticks["on_orders"] == pytest.approx(sum(outcome.uses[name] for name in ON_ORDERS))
    assert ticks["idle"] == pytest.approx(outcome.uses["idle"])


def test_many_stations_and_chargers_are_not_left_out_in_silence() -> None:
    outcome = run_once(resolve("depots"))
    many = outcome._replace(chargers=tuple(outcome.chargers) * 60)
    said = as_text(run_document(resolve("depots"), many))
    rest = 60 * len(outcome.chargers) - 50
    assert f"... and {rest} more chargers: --json prints all" in said


def test_places_of_chargers_are_told_where_they_are_not_one_each() -> None:
    full = CALM._replace(chargers=(1.0, 0.5), charger_queues=(2.0, 0.0), places=(8, 2))
    assert facts("chargers", full, 10)[0] == "9 of 10 places of 2 chargers busy"
    assert "chargers 90 % busy" in others("robots", full, 10)


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
