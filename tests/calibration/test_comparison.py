"""A model beside days of a site: what is measured, the orders of a day, and the verdict."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from automaton.calibration import agreement as judged
from automaton.calibration import output_tuning
from automaton.calibration.agreement import DayResult, agreement, combined, days_needed, holm
from automaton.calibration.agreement_report import missing
from automaton.calibration.compared_days import place_robots, plans_of
from automaton.calibration.fleet_trace import (
    FleetTrace,
    MeasurePlan,
    TraceSampler,
    measured,
    trace_of_log,
)
from automaton.calibration.log_on_floor import placed
from automaton.calibration.output_tuning import TunedValue, tuned_numbers, with_numbers
from automaton.calibration.site_day import ComparedSite, SiteDay, parts_of, read_days
from automaton.calibration.state_log import read_log
from automaton.commands import main
from automaton.commands.arguments import settings_in
from automaton.engine.state import NIL, ORDER_DELIVERED
from automaton.errors import InputError
from automaton.runs.headless import Sampling, run_to_end
from automaton.runs.simulation import Simulation
from automaton.scenario.order_lines import listed_lines
from automaton.world.resolve import resolve

SCENARIO = """\
name: site
layout:
  picture: |
    t..t
    .##.
    t..t
fleet: {robots: 2, kinematics: omni, start: [[1, 0], [2, 0]]}
units: {tick: 1 s, cell: 1 m, clock: "2026-03-02 06:00"}
durations: {pick: 4, drop: 3, handling_jitter: 2}
locations: {north: [0, 0], south: [3, 2]}
orders: {generator: stations, count: 40, mean_interarrival_time: 16}
strategy: {allocation: first-come, right_of_way: retreat}
stop: {when: never, max_duration: 600}
"""
HOURS = [f"hour {k}" for k in range(4)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site, a run of it, and the log of the run."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "site.yaml").write_text(SCENARIO, encoding="utf-8")
    scenario, recording = str(folder / "site.yaml"), str(folder / "day.rec")
    assert main(["run", scenario, "--record", recording]) == 0
    assert main(["export", recording, "--vda5050", str(folder / "day.jsonl"), "--every", "2s"]) == 0
    return folder


def site_in(folder: Path, *settings: str) -> ComparedSite:
    scenario = str(folder / "site.yaml")
    return ComparedSite(scenario, settings, None, resolve(scenario, settings), {}, None, None, {})


def read_day(site: ComparedSite, log: Path, orders: Path | None) -> SiteDay:
    (day,) = read_days(site, log, orders)
    return day


def plan(trace: FleetTrace, *busiest: int, stretch: int = NIL) -> MeasurePlan:
    """A plan for a small trace, with one stretch: a cell."""
    of = np.full(100, NIL, np.int32)
    of[stretch if stretch != NIL else 99] = 0
    return MeasurePlan(1, len(trace.cell), trace.period, of, 1, busiest, False, np.zeros(0))


def trace_of(cells: str, orders: str, loads: str) -> FleetTrace:
    """One robot: the cell, the order and the load in each sample, 10 s apart; "." for none."""
    cell, order = (
        np.array([[NIL if one == "." else int(one)] for one in text], np.int32)
        for text in (cells, orders)
    )
    return FleetTrace(10.0, cell, order, np.array([[one == "1"] for one in loads]))


def test_the_trace_of_a_log_is_that_of_the_run(folder: Path) -> None:
    site = site_in(folder)
    log = read_log([folder / "day.jsonl"])
    place = placed(log, site.base.floor_plan, site.base.scenario.units)
    simulation = Simulation(site.base)
    of_run = plan(trace_of("0" * 301, "." * 301, "0" * 301))._replace(ticks=2, period=2.0)
    sampler = TraceSampler(of_run, 2)
    run_to_end(simulation, sampling=Sampling(2, sampler, None))
    trace = trace_of_log(log, place, int(log.samples.time.min()), 2.0, 301)
    numbers = np.array([*map(int, log.orders), NIL])
    assert np.array_equal(trace.cell, sampler.trace.cell)
    assert np.array_equal(numbers[trace.order], sampler.trace.order)
    assert np.array_equal(trace.load, sampler.trace.load)


def test_quantities_of_a_trace() -> None:
    #                 a pick in cell 2 for 30 s, a drop in cell 5 for 20 s; back without an order
    trace = trace_of("012223455432", ".000000...11", "000011110000")
    of = measured(trace, plan(trace, 3, stretch=2))
    assert of["orders an hour"] == pytest.approx(1 / 110 * 3600)  # the second one is not done
    assert of["lead time"] == of["lead time p95"] == 60
    assert of["time on orders"] == pytest.approx(8 / 12)
    assert of["time at pick-ups"] == 30
    assert of["empty share"] == pytest.approx(5 / 8)
    assert of["stretch 0"] == 40  # 30 s of the pick, and once more on the way back
    assert np.isnan(of["headway 0"])  # of two entries
    released = plan(trace)._replace(released=np.array([-20.0, 90.0]))
    assert measured(trace, released)["lead time"] == 90


def test_orders_are_recovered_from_a_log_and_run_again(folder: Path) -> None:
    day = read_day(site_in(folder), folder / "day.jsonl", None)
    listed = day.resolved.scenario.orders.listed
    simulation = Simulation(resolve(str(folder / "site.yaml")))
    simulation.run(600)
    orders = simulation.world.orders
    assert listed is not None and 20 < len(listed) < 40  # without those near the end
    floor_plan = day.resolved.floor_plan
    slots = [floor_plan.xy(cell) for cell in floor_plan.slots.tolist()]
    pairs = zip(orders.source.tolist(), orders.target.tolist(), strict=True)
    ends = {(slots[a], slots[b]) for a, b in pairs}
    assert all(one.ends in ends for one in listed)
    assert [one.release for one in listed] == sorted(one.release for one in listed)
    assert set(np.unique(day.trace.order).tolist()) == {NIL, *range(len(listed))}
    stop = day.resolved.scenario.stop
    assert (stop.when, stop.max_duration) == ("never", 600)


def test_lead_times_begin_at_the_release_if_a_file_names_the_orders(folder: Path) -> None:
    simulation = Simulation(resolve(str(folder / "site.yaml")))
    release = simulation.world.orders.release_tick.tolist()
    rows = [
        f"{k},north,south,2026-03-02 06:{at // 60:02}:{at % 60:02}" for k, at in enumerate(release)
    ]
    head = ["order,from,to,CREATED", "99,north,south,2026-03-01 06:00"]  # of the day before
    path = folder / "orders.csv"
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    columns = "{order: order, from: from, to: to, released: CREATED}"
    site = site_in(folder, f"orders={{transports: {{file: orders.csv, columns: {columns}}}}}")
    day = read_day(site, folder / "day.jsonl", path)
    assert day.released.tolist() == [float(at) for at in release if at < 600]
    assert f"{len(day.released)} orders of orders.csv" in " ".join(day.notes)
    path.write_text("\n".join(head) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"orders.csv: no order is released during the log"):
        read_day(site._replace(files={}), folder / "day.jsonl", path)  # a command reads it once


def test_a_log_whose_orders_have_no_ends_needs_their_file(folder: Path) -> None:
    messages = [json.loads(line) for line in (folder / "day.jsonl").read_text().splitlines()]
    path = folder / "unloaded.jsonl"
    path.write_text("".join(json.dumps({**one, "loads": []}) + "\n" for one in messages))
    with pytest.raises(InputError, match=r"shows both ends of only 0 % .* --orders"):
        read_day(site_in(folder), path, None)


def test_loads_stand_for_orders_in_a_log_that_names_none(folder: Path) -> None:
    rows = ["robot,time,x,y,load"]
    for line in (folder / "day.jsonl").read_text().splitlines():
        one = json.loads(line)
        place = one["mobileRobotPosition"]
        load = "box" if one["loads"] else ""
        rows.append(f"{one['serialNumber']},{one['timestamp']},{place['x']},{place['y']},{load}")
    path = folder / "day.csv"
    path.write_text("\n".join(rows) + "\n")
    of_loads, of_orders = (
        read_day(site_in(folder), folder / name, None) for name in ("day.csv", "day.jsonl")
    )
    listed = [day.resolved.scenario.orders.listed or () for day in (of_loads, of_orders)]
    ends = [Counter(one.ends for one in orders) for orders in listed]
    assert of_loads.by_load and (ends[0] - ends[1]).total() <= 1
    assert of_loads.trace.order.max() == len(listed[0]) - 1
    path.write_text("\n".join(row.removesuffix("box") for row in rows) + "\n")
    with pytest.raises(InputError, match=r"day.csv: has neither orders nor loads"):
        read_day(site_in(folder), path, None)


def test_trips_of_pods_become_a_line_for_each_visit(tmp_path: Path) -> None:
    scenario = "goods-mini"
    settings = ["orders={lines: {count: 30, mean_interarrival_time: 50}}"]
    settings += ["stop={when: never, max_duration: 1500}", "units.clock=2026-03-02 06:00"]
    recording, log = tmp_path / "day.rec", tmp_path / "day.jsonl"
    command = ["run", scenario, "--record", str(recording)]
    assert main([*command, *(f"--set={one}" for one in settings)]) == 0
    assert main(["export", str(recording), "--vda5050", str(log), "--every", "2s"]) == 0
    base = resolve(scenario, settings)
    site = ComparedSite(scenario, tuple(settings), None, base, {}, None, None, {})
    day = read_day(site, log, None)
    lines = listed_lines(day.resolved.scenario.orders)
    simulation = Simulation(base)
    simulation.run(1500)
    trips = simulation.world.trips
    done = trips.pod[simulation.world.orders.state == ORDER_DELIVERED] + 1
    recovered = Counter(int(line.pod or 0) for line in lines)
    assert len(lines) > 10 and (recovered - Counter(done.tolist())).total() == 0
    assert {line.station for line in lines} == {1}
    assert day.trace.order.max() == len(lines) - 1
    orders = tmp_path / "lines.csv"
    rows = [f"2026-03-0{day} 06:0{day},{day},1,{day},7" for day in (1, 2, 3)]
    orders.write_text("\n".join(["released,pod,station,order,units", *rows]))
    (of_file,) = read_days(site, log, orders)
    (line,) = listed_lines(of_file.resolved.scenario.orders)
    assert (line.release, line.pod, line.order, line.units) == (120, 2, "2", 7)
    with pytest.raises(InputError, match="two logs have one name"):
        plans_of([day, of_file])


def test_a_log_of_several_days_is_divided_at_midnight_of_the_site(folder: Path) -> None:
    hours = [f"2026-03-0{day}T{hour:02}:00:00" for day in (2, 3, 4) for hour in (1, 9, 23)]
    rows = [f"{robot},{hour},{robot + 1}.5,2.5" for robot in (0, 1) for hour in hours]
    path = folder / "days.csv"
    path.write_text("\n".join(["robot,time,x,y", *rows]))
    site = site_in(folder, "units.clock=2026-03-02 06:00+02:00")
    log = read_log([path])
    place = placed(log, site.base.floor_plan, site.base.scenario.units)
    parts = list(parts_of(log, place, site.ahead))
    # 23:00 in UTC is 01:00 of the next day; what is left of the fifth is too short
    assert [(part.date, len(part.log.samples.time)) for part in parts] == [
        ("2026-03-02", 4),
        ("2026-03-03", 6),
        ("2026-03-04", 6),
    ]
    assert all(len(part.place.cell) == len(part.log.usable) for part in parts)


def test_robots_begin_where_the_log_has_them_if_the_floor_allows(folder: Path) -> None:
    base = site_in(folder).base
    xy = base.floor_plan.cell
    for wanted, expected in (
        ((xy(0, 1), xy(3, 1)), (xy(0, 1), xy(3, 1))),
        ((xy(2, 0), NIL), (xy(1, 0), xy(2, 0))),  # the other robot begins there
        ((xy(2, 0), xy(1, 0)), (xy(2, 0), xy(1, 0))),
        ((xy(1, 1), xy(0, 0)), (xy(1, 0), xy(2, 0))),  # a wall, a station
    ):
        simulation = Simulation(base)
        place_robots(simulation, np.array(wanted, np.int32))
        robots = simulation.world.robots
        assert robots.cell[robots.at_index].tolist() == list(expected)
        simulation.run(300)
        assert (simulation.world.orders.state == ORDER_DELIVERED).sum() > 5
    rails = Simulation(site_in(folder, "fleet.kinematics=rail", "orders.count=2").base)
    before = rails.world.robots.cell.tolist()
    place_robots(rails, np.array([xy(0, 1), NIL], np.int32))
    assert rails.world.robots.cell.tolist() == before  # it stands across the only way on


def test_a_number_is_tuned_until_days_agree(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(output_tuning, "DAYS_AND_SEEDS", 5)
    out = folder / "tuned.yaml"
    command = ["calibrate", str(folder / "day.jsonl"), "--floor", str(folder / "site.yaml")]
    command += ["--set", "durations.pick=8", "--tune", "durations.pick", "--pairs", "0"]
    command += ["--workers", "1", "--out", str(out), "--json", "--budget"]
    assert main([*command, "100"]) == 0
    tuned = json.loads(capsys.readouterr().out)["tuned"]
    assert tuned["numbers"][0]["before"] == 8
    assert settings_in(out) == [f"durations.pick={tuned['numbers'][0]['after']}"]
    assert tuned["numbers"][0]["after"] in (3, 4)  # 4 at the site
    lead_time = tuned["outputs"][1]
    before, after = (abs(lead_time[one] / lead_time["site"] - 1) for one in ("before", "after"))
    assert after < 0.05 < before
    assert tuned["runs"] <= 100 and "one day has no spread" in tuned["doubts"][0]
    assert "`compare` needs other days" in out.read_text()
    assert main([*command, "20"]) == 2
    assert "need at least 50 runs" in capsys.readouterr().err


def test_two_numbers_at_most_are_tuned_and_the_rest_of_their_sections_stays() -> None:
    data: dict[str, Any] = {
        "durations": {"pick": 8, "move": {"empty": "1 m/s"}},
        "fleet": {"kinematics": "omni"},
    }
    data["faults"] = {"delays": {"probability": "6/h"}}
    settings: dict[str, Any] = {"durations": {"pick": "7 s"}}
    (speed,) = tuned_numbers(["durations.move.empty"], data)
    with_numbers(settings, data, [TunedValue(speed, 0.5, None)])
    assert settings == {"durations": {"pick": "7 s", "move": {"empty": "0.5 m/s"}}}
    (rate,) = tuned_numbers(["faults.delays.probability"], data)
    assert rate.value(1.5) == "9/h"
    for keys, sentence in (
        ("durations.pik", "did you mean 'durations.pick'"),
        ("fleet.kinematics", "is not a number of the scenario"),
        ("durations.pick,durations.drop,fleet.robots", "names 3 numbers; use 2 at most"),
    ):
        with pytest.raises(InputError, match=sentence):
            tuned_numbers(keys.split(","), data)


# Verdicts, on random quantities.


def days(count: int, draw: Any, shift: float = 0.0, runs: int = 50) -> list[DayResult]:
    """Days whose quantities and runs have equal distributions, but for a relative shift of the days."""

    def sample(factor: float) -> dict[str, float]:
        names = ["orders an hour", "lead time", "time on orders", *HOURS, "stretch 0", "stretch 1"]
        return {name: 100 * factor * (1 + 0.03 * draw.standard_normal()) for name in names}

    return [
        DayResult(f"day {k}", 0, sample(1 + shift), [sample(1.0) for _ in range(runs)])
        for k in range(count)
    ]


def test_a_right_model_rarely_differs_and_a_wrong_one_is_found() -> None:
    draw = np.random.default_rng(1)
    single = [agreement(days(1, draw)).verdict for _ in range(200)]
    assert single.count(judged.DIFFERS) <= 20  # 10 expected at 5 %; standard deviation 3
    assert single.count(judged.MATCHES) == 0  # one day has no spread
    several = [agreement(days(8, draw)).verdict for _ in range(20)]
    assert several.count(judged.MATCHES) >= 17
    wrong = agreement(days(8, draw, shift=0.08))
    assert wrong.verdict == judged.DIFFERS and wrong.first is not None
    assert wrong.differences[0].verdict == judged.DIFFERS
    assert {one.stretch for one in wrong.stretches} == {0, 1}


def test_days_that_all_differ_by_one_amount_differ() -> None:
    equal = {"orders an hour": 100.0, "lead time": 60.0, "stretch 0": 50.0}
    runs = [equal] * 50
    same = [DayResult(f"day {k}", 0, equal, runs) for k in range(3)]
    assert agreement(same).verdict == judged.MATCHES
    slow = [day._replace(real={**equal, "lead time": 90.0}) for day in same]
    assert agreement(slow).differences[1].verdict == judged.DIFFERS
    closed = [day._replace(real={**equal, "stretch 0": 0.0}) for day in same]
    assert agreement(closed).stretches[0].p < judged.ERROR


def test_what_cannot_be_said_names_the_days_that_it_needs() -> None:
    draw = np.random.default_rng(5)
    for shift, spread, sentence in (
        (0.0, 0.1, "to show that lead time is within 10 % needs about"),
        (0.7, 0.5, "beyond 10 %, but so few days may differ by chance; to show it needs about"),
    ):
        values = 1 + shift + spread * draw.standard_normal(3)
        some = [DayResult("", 0, {"lead time": one}, [{"lead time": 1.0}]) for one in values]
        apart = judged.relative_differences(some, "lead time")
        text = missing(judged.difference(some, "lead time", apart, 0.1), 3)
        assert sentence in text and "days like these 3" in text
    one_day = judged.difference(some[:1], "lead time", apart[:1], 1.0)
    assert "needs about 4, 11 or 44 days" in missing(one_day, 1)


def test_days_for_a_match_grow_with_the_square_of_their_spread() -> None:
    assert [days_needed(spread, 0.05) for spread in (0.03, 0.05, 0.1)] == [4, 11, 44]
    few = agreement(days(2, np.random.default_rng(3)))
    assert few.differences[0].days_needed == 2 or few.differences[0].verdict != judged.MATCHES


def test_p_values_are_combined_and_adjusted() -> None:
    assert combined([0.2]) == pytest.approx(0.2)
    assert combined([0.1, 0.1]) == pytest.approx(0.0561, abs=1e-4)  # chi-square of 9.21, 4 degrees
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])


def test_compare_prints_its_verdict(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["compare", str(folder / "site.yaml"), str(folder / "day.jsonl"), "--runs", "20"]
    command += ["--workers", "1", "--seed", "50"]
    assert main([*command, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["verdict"] == "cannot be said" and record["days"][0]["p"] > 0.05
    assert "one day has no spread" in record["sentence"] and record["reasons"] == []
    assert record["days"][0]["model"].keys() == record["days"][0]["site"].keys()
    (folder / "again.jsonl").write_text(
        (folder / "day.jsonl").read_text()[2000:].partition("\n")[2]
    )
    assert main([*command[:3], str(folder / "again.jsonl"), *command[3:]]) == 2
    assert "again repeats the messages of day; a day counts once" in capsys.readouterr().err
    orders = ["--orders", "a.csv", "--orders", "b.csv"]
    assert main([*command, *orders]) == 2
    assert "--orders is there 2 times, but there are 1 log" in capsys.readouterr().err


def test_p_values_of_many_days_can_be_combined() -> None:
    assert combined([0.5] * 500) > 0.9 > 1e-9 > combined([1 / 51] * 500)
    assert combined([1.0]) == 1.0
