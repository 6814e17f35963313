"""`automaton size`: the search on fleets of known quality, real tiny runs, and bad input."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from remembered_runs import remembered_runs
from statistics_trials import synthetic

import automaton
from automaton.commands import main
from automaton.documents.text_output import as_text
from automaton.engine.state import ORDER_DELIVERED
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.runs.task_metrics import metrics_by_station
from automaton.scenario.durations import Distribution
from automaton.studies.process_pool import PersistentPool
from automaton.studies.sizing.fleet_runs import Checked, Fleets, longer, run_and_measure_use
from automaton.studies.sizing.fleet_search import (
    Candidate,
    FleetConfig,
    FleetRun,
    FleetSearch,
    Target,
    judged,
    make_question,
    read_target,
)
from automaton.studies.sizing.sizing_figures import picture
from automaton.studies.sizing.sizing_report import answer_document, changed, with_half
from automaton.studies.sizing.sizing_session import RunBudget, SizingSession
from automaton.studies.sweeps.run_keys import replication_seeds
from automaton.units import Unit
from automaton.world.resolve import resolve

ZERO = Target("makespan", True, 0.0)


@pytest.fixture(scope="module", autouse=True)
def each_run_once() -> Iterator[None]:
    with remembered_runs():
        yield


def searched(shares: list[float], budget: int = 100_000, **more: Any) -> FleetSearch:
    question = make_question(ZERO, (1, len(shares)), budget=budget, **more)
    search = FleetSearch(question, "", synthetic(shares, np.random.default_rng(1)), budget)
    search.go()
    return search


def test_the_smallest_fleet_that_passes_is_the_answer() -> None:
    search = searched([0.2, 0.5, 0.99, 1.0])
    assert search.answer == ("answered", 3, None)
    assert [one.verdict for one in search.candidates] == ["fails", "fails", "meets"]


def test_nothing_is_inferred_by_monotony() -> None:
    assert searched([1.0, 0.2, 1.0]).answer.size == 1
    assert searched([0.2, 1.0, 0.2, 1.0]).answer.size == 2


def test_what_no_fleet_reaches_is_not_reachable() -> None:
    assert searched([0.1, 0.2, 0.3]).answer == ("not reachable", None, None)


def test_a_fleet_on_the_edge_is_undecided_when_the_budget_is_spent() -> None:
    search = searched([0.1, 0.95, 1.0], budget=400)
    assert search.answer == ("undecided", 3, 2)
    assert search.spent <= 400


def test_a_budget_that_ends_before_any_fleet_passes_leaves_the_top_open() -> None:
    search = searched([0.95] * 4, budget=150)
    assert search.answer == ("undecided", None, 1)


def test_bounds_exclude_without_runs() -> None:
    question = make_question(ZERO, (1, 3))
    run = synthetic([1.0, 1.0, 1.0], np.random.default_rng(1))
    search = FleetSearch(question, "", run, question.budget, {1: "too much work"})
    search.go()
    assert search.answer.size == 2
    assert search.candidates[0].runs == []


def test_a_run_that_does_not_finish_fails() -> None:
    def censored(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        return [FleetRun(False, {"makespan": 0.0})] * number

    for mean in (False, True):
        question = make_question(ZERO, (1, 1), mean=mean, indifference=0.02)
        search = FleetSearch(question, "", censored, question.budget)
        search.go()
        assert search.answer.kind == "not reachable"


def test_what_a_run_did_not_measure_is_missed(capsys: Any) -> None:
    """Runs so short that no task ends have no delay, which is not a delay of 0."""
    short = ("--set", "measure={warm_up: 5}", "--set", "stop={when: never, max_duration: 10}")
    for options in ((), ("--mean", "--indifference", "1")):
        code, out, _ = size(
            capsys, "tabletop-mini", "--target", "delay<=5", "--robots", "1", "--workers", "1",
            *short, *options,
        )  # fmt: skip
        assert code == 1 and "not reachable up to 1 robot" in out
        told = r"^1: \d+ runs without delay, because nothing was completed; these runs miss the target$"
        assert re.search(told, out, re.M)


def test_means_are_judged_in_the_direction_of_the_target() -> None:
    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        rng = np.random.default_rng(place.size)
        values = rng.normal(10 * place.size, 3, first + number)[first:]
        return [FleetRun(True, {"throughput": value}) for value in values]

    at_least = make_question(Target("throughput", False, 25.0), (1, 5), mean=True, indifference=1.0)
    search = FleetSearch(at_least, "", run, at_least.budget)
    search.go()
    assert search.answer.size == 3
    at_most = make_question(Target("throughput", True, 25.0), (1, 5), mean=True, indifference=1.0)
    search = FleetSearch(at_most, "", run, at_most.budget)
    search.go()
    assert search.answer.size == 1


def test_what_follows_a_verdict_on_a_mean_does_not_change_it() -> None:
    question = make_question(Target("makespan", True, 100.0), (1, 1), mean=True)
    good, cut = FleetRun(True, {"makespan": 90.0}), FleetRun(False, {"makespan": 90.0})
    assert (
        judged([good] * 250 + [cut], question) == judged([good] * 250, question) == ("meets", 200)
    )
    assert judged([good] * 150 + [cut] + [good] * 100, question) == ("fails", 151)


def test_several_strategies_share_the_error_and_the_best_is_selected() -> None:
    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        rng = np.random.default_rng(len(place.strategy))
        values = rng.normal(100 if place.strategy == "better" else 110, 5, first + number)
        slow = 1000 if place.size < 2 else 0
        return [FleetRun(True, {"makespan": value + slow}) for value in values[first:]]

    question = make_question(Target("makespan", True, 200.0), (1, 4), ("worse", "better"))
    assert question.candidates == 8
    session = SizingSession(question, run)
    session.go()
    assert [search.answer.size for search in session.searches] == [2, 2]
    assert session.best is not None and session.best.left == ("better",)
    assert session.place == FleetConfig(2, "better")
    gain = session.gains["worse"].effect
    assert gain is not None and gain.difference.value == pytest.approx(-1000, abs=5)
    assert session.spent <= question.budget and session.complete


def test_a_strategy_that_may_do_with_less_leaves_the_smallest_fleet_open() -> None:
    rng = np.random.default_rng(1)
    sure, edge = synthetic([0.1, 0.1, 1.0], rng), synthetic([0.1, 0.95, 1.0], rng)

    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        return (edge if place.strategy == "edge" else sure)(place, first, number)

    session = SizingSession(make_question(ZERO, (1, 3), ("edge", "sure"), budget=1200), run)
    session.go()
    assert session.place == FleetConfig(3, "sure")
    assert not session.settled
    assert session.searches[0].answer == ("undecided", 3, 2)


def texts(session: SizingSession) -> str:
    return as_text(answer_document({"": session}, "made up", "", 0.0), 1000)


def test_the_zone_of_a_mean_is_told_in_the_time_that_was_typed() -> None:
    target = read_target("makespan<=30s", Unit(0.5, "s"))
    session = SizingSession(
        make_question(target, (1, 1), mean=True), synthetic([1.0], np.random.default_rng(1))
    )
    told = texts(session)
    assert "so that on average makespan <= 60 ticks (30 s)?" in told
    assert "Indifference zone 0.6 ticks (0.3 s): " in told


def test_runs_of_the_answer_that_did_not_finish_are_told_with_it() -> None:
    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        return [FleetRun(r != 7, {"makespan": 0.0}) for r in range(first, first + number)]

    session = SizingSession(make_question(ZERO, (1, 1), budget=500), run)
    session.go()
    told = texts(session)
    assert f"Answer: 1 robot; 1 of {session.spent} runs did not finish\n" in told
    assert "did not finish" not in texts(SizingSession(session.question, run))


def test_orders_that_are_listed_are_the_same_demand_in_all_runs(capsys: Any) -> None:
    listed = "orders={list: [{from: [1, 1], to: [3, 1]}]}"
    given = (
        "tabletop-mini", "--target", "makespan<=100000", "--robots", "1", "--workers", "1",
        "--success-share", "0.5", "--indifference", "0.3", "--budget", "20",
    )  # fmt: skip
    same = "all runs have the same listed orders"
    assert same not in size(capsys, *given)[1]
    assert same in size(capsys, *given, "--set", listed)[1]


def test_a_fleet_that_a_bound_excludes_shows_the_runs_it_had_all_the_same() -> None:
    run = synthetic([0.0, 1.0, 1.0], np.random.default_rng(1))
    session = SizingSession(make_question(ZERO, (1, 2), budget=1000), run, {1: "too much work"})
    session.go()
    assert len(session.searches[0].candidates[0].runs) == 60  # for what the second robot gains
    told = texts(session)
    assert re.search(r"^ +1 +60 +0 +0 .*fails \(bound\)$", told, re.M)
    assert "1: fails without a run, too much work" in told
    assert "The verdict states the number of runs that decided it" in told


def test_what_is_left_of_the_budget_and_what_would_be_needed_are_told() -> None:
    run = synthetic([0.0, 1.0, 1.0], np.random.default_rng(1))
    session = SizingSession(
        make_question(ZERO, (1, 3), budget=450), run, {}, {10: ["durations.turn=2"]}
    )
    session.go()
    assert session.moved == [] and session.place == FleetConfig(2)
    left = session.left  # the bound of the answer takes them
    assert 0 < left < 300 and session.spent == 450
    assert (
        f"longer: not examined, 300 runs are needed, but only {left} of the budget are left"
        in texts(session)
    )


def test_a_fleet_that_is_decided_after_the_search_is_followed_up() -> None:
    """Runs that are shown for the largest fleet may decide it."""

    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        return [
            FleetRun(True, {"makespan": float(r in (10, 11, 12))})
            for r in range(first, first + number)
        ]

    question = make_question(
        ZERO, (1, 1), ("slow",), budget=900, success_share=0.9, indifference=0.05
    )
    session = SizingSession(question, run, {}, {10: ["durations.turn=2"]})
    search = FleetSearch(question, "slow", run, 30)
    search.go()
    session.searches.append(search)
    assert session.place is None
    session._follow_up(RunBudget(run, 800))
    assert session.place == FleetConfig(1, "slow") and len(session.moved) == 1


def test_a_real_answer_is_the_same_for_any_number_of_workers(monkeypatch: Any) -> None:
    monkeypatch.setattr("automaton.studies.process_pool.POOL_START_DELAY_S", 0.0)
    question = make_question(
        Target("makespan", True, 1700.0), (1, 4), budget=200, success_share=0.9, indifference=0.08
    )
    found = []
    for workers in (1, 2):
        with PersistentPool(workers, run_and_measure_use) as rounds:
            fleets = Fleets("tabletop-mini", (), None, rounds)
            session = SizingSession(question, fleets, fleets.excluded(question), {10: [""]})
            session.go()
            found.append([one.runs for search in session.searches for one in search.candidates])
            place = session.place
    assert found[0] == found[1]
    assert place is not None and place.size == 3


def size(capsys: Any, *arguments: str) -> tuple[int, str, str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "1000")  # nothing wraps
        code = main(["size", *arguments])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_command_answers_in_text(capsys: Any) -> None:
    code, out, _ = size(
        capsys, "tabletop-mini", "--target", "makespan<=1700", "--robots", "1..4",
        "--budget", "700", "--workers", "1", "--price", "1500",
    )  # fmt: skip
    assert code == 0
    assert "Answer: 3 robots, 4,500 at 1,500 each" in out
    assert re.search(r"^ +1 +10 +0 +0 .*fails after \d+$", out, re.M)
    for told in ("Estimand", "Indifference zone 0.02", "Robot time lost", "The last robot (2 -> 3)",
                 "Assumptions", "Durations 10 % longer", "Used", "error 0.05 / 4"):  # fmt: skip
        assert told in out
    # The fleet of the answer and the next ones, and where the time of their robots went.
    _, _, times = out.partition("\nWhere the time of the robots went, in whole runs:\n")
    rows = re.findall(r"^([23]) robots +([\d.% ]+)$", times, re.M)
    assert [row[0] for row in rows] == ["2", "3"]
    for _, shares in rows:
        assert sum(map(float, re.findall(r"[\d.]+", shares))) == pytest.approx(100, abs=0.4)


def test_the_candidates_are_drawn_one_below_the_other() -> None:
    search = searched([0.0, 0.5, 1.0])
    head, *lines, ends = picture(search, search.question)
    assert head == "robots  share with its 95 % interval; | indifference zone"
    assert re.fullmatch(r" {5}1  o-+ +\| \|", lines[0])  # far from the zone, which begins at 93 %
    assert re.fullmatch(r" {5}2  +-+o-+ +\| \|", lines[1])
    assert re.fullmatch(r" {5}3  +\|-\|-o", lines[2])
    assert [line.index("o") - 8 for line in lines] == [0, pytest.approx(30, abs=8), 60]
    assert ends.split() == ["0", "%", "100", "%"]


def test_shares_and_means_are_plotted(capsys: Any, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    code, out, err = size(
        capsys, "tabletop-mini", "--target", "makespan<=1700", "--robots", "3", "--budget", "300",
        "--workers", "1", "--plots", str(tmp_path),
    )  # fmt: skip
    assert code == 0 and "ends of the indifference zone" in out
    names = ["mean-t-total-by-robots", "share-of-runs-with-t-total-1-700"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{name}.{form}" for name in names for form in ("png", "svg")
    ]
    assert err.count("automaton: wrote ") == 4


def test_a_mean_whose_interval_would_reach_below_0_is_told_with_its_ends() -> None:
    one = Candidate(FleetConfig(1))
    one.runs = [FleetRun(True, {"starved_robots": count}) for count in (0.0, 0.0, 0.0, 0.0, 5.0)]
    mean = one.mean("starved_robots")
    assert mean is not None and with_half(mean, "robots") == "1 (0 to 3.776)"
    one.runs = one.runs[1:]
    mean = one.mean("starved_robots")
    assert mean is not None and with_half(mean, "robots") == "1.25 (too few runs)"
    one.runs = [FleetRun(True, {"starved_robots": count}) for count in (4.0, 4.0, 4.0, 5.0)]
    mean = one.mean("starved_robots")
    assert mean is not None and with_half(mean, "robots") == "4.25 +- 0.7956"
    assert with_half(mean, "share") == "425 % +- 79.56 %"


def test_means_are_drawn_on_a_scale_that_holds_them_and_the_zone() -> None:
    question = make_question(ZERO._replace(value=100.0), (1, 2), mean=True, indifference=5.0)
    search = FleetSearch(question, "", lambda *_: [], question.budget)
    for robots, ticks in ((1, [128.0, 132.0]), (2, [80.0, 80.0])):
        search.candidates.append(Candidate(FleetConfig(robots)))
        search.candidates[-1].runs = [FleetRun(True, {"makespan": one}) for one in ticks]
    head, one, two, ends = picture(search, question)
    assert head == "robots  mean makespan with its 95 % interval; | indifference zone"
    low, high = (int(text) for text in ends.split())
    at = {value: 8 + round((value - low) / (high - low) * 60) for value in (80, 95, 105, 130)}
    assert low <= 80 and one[at[95]] == one[at[105]] == "|" and one[at[130]] == "o"
    assert two[at[80]] == "o" and two[at[95]] == two[at[105]] == "|"


def test_the_command_answers_in_json_and_says_what_is_not_reachable(capsys: Any) -> None:
    code, out, _ = size(
        capsys, "tabletop-mini", "--target", "makespan<=100", "--robots", "1..2", "--json",
        "--workers", "1",
    )  # fmt: skip
    assert code == 1
    found = json.loads(out)
    assert found["robots"] is None
    assert found["answers"][0]["kind"] == "not reachable"
    candidates = found["answers"][0]["candidates"]
    assert candidates[0]["excluded"].startswith("makespan is at least")
    assert candidates[1]["lost"]["lost_waiting"] > 0  # the largest fleet is shown all the same


def test_sizes_from_python_are_those_of_the_command(capsys: Any) -> None:
    found = automaton.size(
        "tabletop-mini", "makespan<=1700", (1, 2), success_share=0.9, indifference=0.08,
        budget=350, workers=1, durations__turn=20,
    )  # fmt: skip
    code, out, _ = size(
        capsys, "tabletop-mini", "--target", "makespan<=1700", "--robots", "1..2", "--json",
        "--success-share", "0.9", "--indifference", "0.08", "--budget", "350", "--workers", "1",
        "--set", "durations.turn=20",
    )  # fmt: skip
    assert code == 0 and json.loads(out) == found.record
    assert (found.robots, found.strategy, found.settled) == (2, "", True)
    rows = found.candidates.to_pylist()
    assert [row["verdict"] for row in rows] == ["fails", "meets"]
    last = rows[-1]
    assert last["robots"] == 2 and last["met"] / last["runs"] == last["share"]
    assert last["share_low"] < last["share"] <= last["share_high"]
    assert last["mean_low"] < last["mean"] < last["mean_high"] < 1700
    with pytest.raises(InputError, match="1 <= FIRST <= LAST"):
        automaton.size("tabletop-mini", "makespan<=1700", robots=0)


def test_depots_tell_the_use_of_stations_and_chargers(capsys: Any) -> None:
    code, out, _ = size(
        capsys, "depots", "--target", "lead_time<=1", "--robots", "4", "--budget", "90",
        "--workers", "1", "--set", "orders.count=10",
    )  # fmt: skip
    assert code == 1
    assert "not reachable up to 4 robots" in out
    assert re.search(r"Utilization: robots at stations .* %, chargers .* %, robots .* %", out)


def test_replications_have_the_seeds_of_a_sweep() -> None:
    seeds = replication_seeds(1, 0, 50)
    assert replication_seeds(1, 20, 10) == seeds[20:30]
    assert len(set(seeds)) == 50 and not set(seeds) & set(replication_seeds(2, 0, 50))


def test_durations_ten_percent_longer_in_whole_ticks() -> None:
    resolved = resolve("tabletop-1")
    assert longer(resolved, 10) == [
        "durations.turn=24", "durations.pick=10", "durations.drop=10", "world.extra_tick_probability=0.1"
    ]  # fmt: skip
    assert longer(resolved, -10) == ["durations.turn=20", "durations.pick=8", "durations.drop=8"]
    assert longer(resolve("warehouse-100"), -10) == []


def test_visits_at_stations_take_longer_too() -> None:
    handling = "{visit: 10, line: {uniform: {from: 2, to: 4}}}"
    resolved = resolve("goods-mini", (f"durations.handling={handling}",))
    settings = [one for one in longer(resolved, 10) if ".handling" in one]
    assert settings == [
        "durations.handling.visit=11",
        "durations.handling.line.uniform.from=2.2",
        "durations.handling.line.uniform.to=4.4",
    ]
    moved = resolve("goods-mini", (f"durations.handling={handling}", *settings))
    assert isinstance(line := moved.scenario.durations.handling.line, Distribution)
    assert line.uniform is not None and line.uniform.most == 4.4


def test_stations_are_in_use_while_they_serve_pods() -> None:
    used = []
    for visit in (10, 30):
        run = Simulation(resolve("goods-mini", (f"durations.handling={{visit: {visit}}}",)))
        used.append(run_and_measure_use(run)["station_use"])
        shares = [station["service_share"] for station in metrics_by_station(run)]
        assert used[-1] == pytest.approx(sum(shares) / len(shares))
    assert used[1] > 1.5 * used[0] > 0


def test_ctrl_c_prints_what_is_known(capsys: Any, monkeypatch: Any) -> None:
    calls, run = 0, Fleets.__call__

    def interrupted(fleets: Fleets, place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        nonlocal calls
        calls += 1
        if calls > 4:
            raise KeyboardInterrupt
        return run(fleets, place, first, number)

    monkeypatch.setattr(Fleets, "__call__", interrupted)
    code, out, err = size(
        capsys, "tabletop-mini", "--target", "makespan<=1700", "--robots", "1..4", "--workers", "1"
    )  # fmt: skip
    assert code == 130 and err.endswith("automaton: interrupted\n")
    assert "the runs are not stored; with --out DIR they are" in err
    assert "undecided between 3 and 4, or more (interrupted)" in out
    assert "Interrupted: results so far" in out
    assert re.search(r"^ +1 .* fails after", out, re.M)


def test_the_first_run_tells_whether_there_is_such_a_metric() -> None:
    question = make_question(Target("energy", True, 1.0), (1, 1))
    with PersistentPool(1, run_and_measure_use) as rounds:
        runner = Checked(Fleets("tabletop-mini", (), None, rounds), question)
        with pytest.raises(InputError, match="does not measure energy"):
            runner(FleetConfig(1), 0, 5)


SMALL = ["fleet.robots=3", "orders.count=200", "stop.max_duration=600", "measure.warm_up=200"]


def test_figures_of_a_steady_state_leave_the_start_up_out() -> None:
    """Robots start empty: before their first orders are done nothing is delivered."""
    run = Simulation(resolve("warehouse-100", SMALL))
    figures = run_and_measure_use(run)
    orders = run.world.orders
    late = int(((orders.state == ORDER_DELIVERED) & (orders.delivered > 200)).sum())
    assert figures["delivered"] == late < int((orders.state == ORDER_DELIVERED).sum())
    assert figures["throughput"] == 1000 * late / 400
    assert figures["throughput"] == pytest.approx(3 * figures["throughput_per_robot"])


def test_a_steady_state_is_asked_for_its_mean_after_the_warm_up(capsys: Any) -> None:
    given = ("warehouse-100", "--robots", "3", "--budget", "200", "--workers", "1")
    settings = [text for setting in SMALL for text in ("--set", setting)]
    answers = []
    for target in ("throughput>=12", "throughput_per_robot>=4"):  # the same question
        _, out, _ = size(capsys, *given, "--target", target, *settings)
        assert "after a warm-up of 200 ticks?" in out
        metric = target.partition(">")[0]
        assert (
            f"Estimand: the mean of {metric} after the first 200 ticks over independent runs" in out
        )
        answers.append(re.findall(r"(?:fails|meets|undecided)[^\n]*", out)[0])
    assert answers[0] == answers[1]
    _, out, _ = size(capsys, *given, "--target", "throughput>=12", *settings, "--json")
    found = json.loads(out)
    assert (found["estimand"], found["warm_up"]) == ("mean", 200)
    _, out, _ = size(
        capsys, *given, "--target", "throughput>=12", "--success-share", ".9", *settings
    )
    assert "that reach throughput >= 12 after the first 200 ticks; required: 90.0 %" in out


def test_the_length_of_runs_without_an_end_of_their_own_is_no_target(capsys: Any) -> None:
    assert main(["size", "warehouse-100", "--target", "makespan<=2400", "--robots", "1..2"]) == 2
    assert "makespan is the same for every fleet" in capsys.readouterr().err


def test_a_target_of_0_needs_a_zone_of_its_own(capsys: Any) -> None:
    assert main(["size", "warehouse-100", "--target", "delay<=0", "--robots", "1..2"]) == 2
    assert "a target of 0 needs an --indifference zone" in capsys.readouterr().err


@pytest.mark.parametrize("measure", ["measure=null", "measure={warm_up: 0}"])
def test_a_steady_state_without_a_warm_up_is_no_target(measure: str, capsys: Any) -> None:
    code, out, err = size(
        capsys, "warehouse-100", "--target", "throughput>=100", "--robots", "17", "--set", measure
    )  # fmt: skip
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "would include the start-up" in err and "--set measure.warm_up=N" in err


def test_shorter_durations_say_what_becomes_of_moves() -> None:
    assert changed(["durations.turn=20"]) == "turn 20, moves unchanged"
    late = "world.extra_tick_probability=0.1"
    assert changed(["durations.turn=24", late]) == "turn 24, 10 % of moves a tick longer"
