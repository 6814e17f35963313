"""`automaton reproduce auctions-floor`: auctions, batteries, queues and failures in full simulation."""

from __future__ import annotations

import json

import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.papers.claims import judge
from automaton.papers.living_auctions import (
    AUCTION_KINDS,
    CHARGING_STRATEGIES,
    LAST_FAILURE,
    LEAST_SHARE,
    SAFE,
    SATURATED,
    TOW_AFTER,
    to_the_end,
    with_failure,
    with_lines,
)
from automaton.papers.reproduction_study import Reproduced, find, reproduce
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.studies.process_pool import run_jobs
from automaton.world.resolve import resolve


@pytest.fixture(scope="module")
def one_seed() -> Reproduced:
    return reproduce(find("auctions-floor"), 1, workers=1)


def value(made: Reproduced, metric: str, *key: str | int) -> float:
    [found] = made.samples()[metric, key]
    return found


def test_every_claim_rests_on_cases_that_are_run(one_seed: Reproduced) -> None:
    samples = one_seed.samples()
    claims = one_seed.reproduction.claims
    assert all(judge(claim, samples, {}) is not None for claim in claims)
    assert one_seed.unfinished == 0


def test_nobody_is_stranded_and_throughput_is_what_energy_allows(one_seed: Reproduced) -> None:
    for name in SAFE:
        assert value(one_seed, "ran_empty", name) == 0
        assert value(one_seed, "all_delivered", name) == 1
        assert value(one_seed, "share", name) >= LEAST_SHARE
    assert value(one_seed, "ran_empty", "insertion, may strand") > 0
    assert value(one_seed, "share", "infinite batteries") == 1


def test_the_least_share_is_that_of_the_scenario_s_batteries() -> None:
    battery = resolve("depots-full").scenario.battery
    assert battery is not None and isinstance(battery.charge_rate, float)
    kc, kr = battery.drain.move, battery.charge_rate
    assert pytest.approx(0.8 * kr / (kc + kr)) == LEAST_SHARE


def test_waits_strand_robots_unless_plans_keep_a_reserve(one_seed: Reproduced) -> None:
    for wait in ("0.01", "0.05", "0.1"):
        assert value(one_seed, "stranded", wait, 0) == 1
        assert value(one_seed, "stranded", wait, 20) == 0


def test_two_stand_in_line_in_a_tenth_of_all_ticks(one_seed: Reproduced) -> None:
    assert value(one_seed, "in_line", "in the bids") > 0.1
    assert value(one_seed, "wait", "left out") > 0


def test_every_kind_of_auction_delivers_the_same_orders(one_seed: Reproduced) -> None:
    assert all(value(one_seed, "delivered", name) == 200 for name in AUCTION_KINDS)
    assert all(value(one_seed, "messages", name) > 0 for name in AUCTION_KINDS)


# How runs are made.


def test_a_failure_depends_on_the_seed_alone() -> None:
    one, other = (resolve("depots", [f"faults.repair_time={repair}"]) for repair in ("null", "600"))
    drawn = [
        [with_failure(case, seed).scenario.faults for seed in range(200)] for case in (one, other)
    ]
    assert [fault.listed for fault in drawn[0]] == [fault.listed for fault in drawn[1]]
    [(first,), *_] = [fault.listed for fault in drawn[0]]
    assert 1 <= first.at <= LAST_FAILURE
    assert {fault.listed[0].robot for fault in drawn[0]} == {0, 1, 2, 3}
    assert {(fault.tow_after, fault.repair_time) for fault in drawn[0]} == {(TOW_AFTER, None)}
    ticks = sorted(fault.listed[0].at for fault in drawn[0])
    assert ticks[20] < 0.2 * LAST_FAILURE and ticks[180] > 0.8 * LAST_FAILURE


def test_looking_at_lines_changes_no_run() -> None:
    resolved = resolve("depots-line", ["orders.count=30"])
    plain, watched = Simulation(resolved, 5), Simulation(resolved, 5)
    plain.run()
    figures = with_lines(watched)
    assert watched.digest == plain.digest
    assert figures["delivered"] == 30 and 0 <= figures["in_line"] <= 1
    in_line = figures["wait"] * figures["stays"]
    assert figures["lost_charger_queue"] >= in_line * (1 - 1e-9), "who stands behind the line, too"


def test_jobs_come_back_in_their_order_whoever_does_them() -> None:
    scenarios = [resolve(name, ["orders.count=10"]) for name in ("depots", "depots-full")]
    jobs = [(scenarios[seed % 2], seed) for seed in range(1, 8)]
    alone = run_jobs(jobs, 1, run_function=to_the_end)
    assert run_jobs(jobs, 2, run_function=to_the_end) == alone
    assert [result.seed for result in alone] == list(range(1, 8))
    assert all("recovered" in result.metrics for result in alone)


def test_with_never_strand_no_robot_runs_empty_in_many_runs() -> None:
    settings = {name: CHARGING_STRATEGIES[name] for name in ("insertion", "fill-up")}
    for charging in settings.values():
        resolved = resolve("depots-full", [SATURATED, "orders.count=50", *charging])
        for seed in range(1, 31):
            run = Simulation(resolved, seed)
            run.run()
            figures = metrics_of(run)
            assert (run.finished, figures["battery_depletions"], figures["delivered"]) == (
                True,
                0,
                50,
            ), seed


def test_if_a_robot_is_gone_for_good_the_others_deliver_everything() -> None:
    resolved = resolve(
        "depots",
        [
            "orders={generator: stations, count: 60, mean_interarrival_time: 20}",
            "faults.repair_time=null",
        ],
    )
    recovered = 0
    for seed in range(1, 41):
        run = Simulation(with_failure(resolved, seed), seed)
        figures = to_the_end(run)
        assert figures["all_delivered"] == 1, seed
        recovered += figures["recovered"]
    assert recovered >= 8, "loads that the robot carried when it failed"


# The command.


def test_tables_may_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["reproduce", "auctions-floor", "--seeds", "2", "--workers", "1", "--json"]
    assert main([*command, "--tables", "failures"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["runs"] == 4 and made["unfinished"] == 0
    assert {row["case"]["robot"] for row in made["rows"]} == {
        "gone for good",
        "back after 600 ticks",
    }
    assert [claim["claim"] for claim in made["claims"]] == [
        "If a robot fails, all orders are delivered"
    ]


def test_an_unknown_table_is_named_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"no table 'line' \(did you mean 'lines'"):
        reproduce(find("auctions-floor"), 1, tables=["line"])
    with pytest.raises(InputError, match="use --tables without names"):
        reproduce(find("tabletop"), 1, tables=["lines"])
