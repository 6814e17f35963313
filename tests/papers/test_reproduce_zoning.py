"""`automaton reproduce zoning`: Table 5 and Figure 5 of Keith & La, and what they claim."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from remembered_runs import remembered_runs
from shared_fixture import shared_fixture

from automaton.commands import main
from automaton.papers.claims import Claim, JudgedClaim, judge
from automaton.papers.reproduction_study import MadeTable, Reproduced, find, reproduce, tables_named
from automaton.papers.zoning_runs import (
    DDZ,
    DDZ_FIXED,
    DDZ_FREE,
    GA,
    GA_PRINTED,
    MANY,
    NO_SHARING,
    PAIRS,
    PRINTED_FIGURES,
    PUBLISHED_CURVES,
    REFERENCE_MEANS,
    SA,
    SMALLER,
    ZONES_FIXED,
    ZONING_SETTINGS,
    completed,
    curve,
    curve_hours,
    curve_text,
    evenness,
    first_legs,
    placements,
    point,
    printed,
    run_watched,
)
from automaton.papers.zoning_study import ZONING_CLAIMS, beside_reference, further
from automaton.runs.simulation import Simulation
from automaton.studies.process_pool import run_jobs
from automaton.world.resolve import resolve


@pytest.fixture(scope="module", autouse=True)
def each_run_once() -> Iterator[None]:
    with remembered_runs():
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Reproduced:
    zoning = find("zoning")
    tables = tables_named(zoning, ())

    def run() -> list[Any]:
        return [table.results for table in reproduce(zoning, 2, workers=1).tables]

    results = shared_fixture(tmp_path_factory, "zoning", run)
    found = [
        MadeTable(table, table.cases(()), of) for table, of in zip(tables, results, strict=True)
    ]
    return Reproduced(replace(zoning, tables=tables), 2, found)


def named(start: str) -> Claim:
    [found] = [claim for claim in ZONING_CLAIMS if claim.text.startswith(start)]
    return found


def judged(claim: Claim, **metrics: dict[str, Sequence[float]]) -> JudgedClaim:
    samples = {(metric, (name,)): of[name] for metric, of in metrics.items() for name in of}
    found = judge(
        claim, samples, {(m, (c,)): v for c, row in PRINTED_FIGURES.items() for m, v in row.items()}
    )
    assert found is not None
    return found


# What is run.


def test_everything_is_run_and_every_claim_can_be_judged(made: Reproduced) -> None:
    assert made.unfinished == 0
    assert {table.table.name for table in made.tables} == {"table5", "claim"}
    samples = made.samples()
    assert all(judge(claim, samples, {}) is not None for claim in ZONING_CLAIMS)
    for name in ZONING_SETTINGS:
        assert samples["parts", (name,)] == [100, 100], name
        assert samples["hours", (name,)] != samples["hours", (SA,)] or name == SA
    assert samples["redesigns", (ZONES_FIXED,)] == [0, 0]
    assert samples["load_shares", (NO_SHARING,)] == [0, 0]
    assert all(("in_balance", (name,)) in samples for name in ZONING_SETTINGS)


def test_the_same_runs_lie_behind_both_tables(made: Reproduced) -> None:
    samples = made.samples()
    for name in (SA, DDZ, DDZ_FREE):
        assert samples["sigma_ft", (name,)] == samples["sigma_ft", (name, MANY)]


def test_zones_that_stay_come_to_the_figures_of_the_other_program(made: Reproduced) -> None:
    by = {(row["configuration"], row["metric"]): row for row in beside_reference(made)}
    assert {name for name, _ in by} == set(REFERENCE_MEANS)
    assert abs(by[ZONES_FIXED, "hours"]["difference"]) < 0.15
    assert abs(by[ZONES_FIXED, "mean_ft"]["difference"]) < 600
    assert abs(by[ZONES_FIXED, "sigma_ft"]["difference"]) < 1000


def test_the_way_to_the_first_station_does_not_count() -> None:
    run = Simulation(resolve("factory"), 3)
    legs = first_legs(run)
    world = run.world
    between = world.service_zones.roads.between
    # Robots begin at WS11, WS1 and WS18; each first picks up at some station: an exact distance.
    starts = [10, 0, 17]
    for robot, start in enumerate(starts):
        cells = int(legs[world.robots.at_index[robot]])
        assert cells in between[start].tolist(), (robot, cells)
    whole = Simulation(resolve("factory"), 3)
    figures = completed(whole)
    moves = whole.world.tally.operations[:, 1].sum(1)
    assert figures["mean_ft"] == pytest.approx(2.5 * float((moves - legs).mean()))
    plain = Simulation(resolve("factory"), 3)
    plain.run()
    assert whole.digest == plain.digest, "looking changes nothing"


def test_runs_are_the_same_whoever_does_them() -> None:
    resolved = resolve("factory", ZONING_SETTINGS[SA])
    jobs = [(resolved, seed) for seed in range(1, 3)]
    assert run_jobs(jobs, 1, run_function=completed) == run_jobs(jobs, 2, run_function=completed)


def test_the_time_ends_with_the_last_work(made: Reproduced) -> None:
    run = Simulation(resolve("factory"), 1)
    figures = completed(run)
    assert figures["hours"] <= run.tick * 0.635055 / 3600 < figures["hours"] + 0.01
    assert figures["hours"] == made.samples()["hours", (SA,)][0]


@pytest.mark.parametrize("name", [SA, NO_SHARING])
def test_a_bystander_sees_the_balance_that_zoning_sees(name: str) -> None:
    """Once a minute, where SA looks every minute or every third: nearly the same share of time."""
    run, plain = (Simulation(resolve("factory", ZONING_SETTINGS[name]), 2) for _ in range(2))
    watched = run_watched(run)
    plain.run()
    assert run.digest == plain.digest, "looking changes nothing"
    own = run.counted["ticks_in_balance"] / run.counted["ticks_watched"]
    assert watched == pytest.approx(own, abs=0.05)


def test_ddz_has_a_time_in_balance_that_is_not_printed(made: Reproduced) -> None:
    shares = made.samples()["in_balance", (DDZ,)]
    assert all(0 <= share < 0.5 for share in shares)
    assert made.samples()["in_balance", (DDZ_FIXED,)] != shares


def test_the_genetic_algorithm_has_its_published_size_too() -> None:
    sizes = []
    for name in (GA, GA_PRINTED):
        parameters: Any = resolve("factory", ZONING_SETTINGS[name]).strategies["zoning"].parameters
        sizes.append((parameters.generations, parameters.population, parameters.poses))
    assert sizes[0][:2] == (12, 30) and sizes[1][:2] == (100, 60)
    assert sizes[0][2] == sizes[1][2]
    assert PRINTED_FIGURES[GA] == PRINTED_FIGURES[GA_PRINTED]


def test_authors_are_cited_by_their_names() -> None:
    assert find("zoning").source.startswith("Russell Keith & Hung La,")


def test_printed_figures() -> None:
    assert printed((SA,), "hours") == 5.94 and printed((GA,), "in_balance") == 0.2371
    assert printed((DDZ_FREE,), "hours") is None and printed((DDZ,), "in_balance") is None
    # The decrease in per cent is that of Table 5, the feet of the abstract are not.
    assert 1 - PRINTED_FIGURES[DDZ]["sigma_ft"] / PRINTED_FIGURES[SA]["sigma_ft"] == pytest.approx(
        0.687, abs=1e-3
    )
    assert PRINTED_FIGURES[SA]["sigma_ft"] - PRINTED_FIGURES[DDZ]["sigma_ft"] == pytest.approx(
        2849.79
    )


# Claims, with figures that are made up.


def test_lower_throughput_holds_where_hours_are_clearly_more() -> None:
    claim = named("Abstract: DDZ has a much lower throughput")
    slow, fast = [8.0, 8.1, 7.9, 8.0], [5.6, 5.5, 5.5, 5.4]
    holds = judged(claim, hours={DDZ: slow, SA: fast, GA: fast})
    assert holds.verdict == "holds" and holds.in_print
    fails = judged(claim, hours={DDZ: fast, SA: fast, GA: fast})
    assert fails.verdict == "does not hold"
    wide = judged(claim, hours={DDZ: [4.0, 9.5, 5.0, 8.5], SA: fast, GA: fast})
    assert wide.verdict == "undecided"


def test_less_sigma_fails_where_it_is_more() -> None:
    claim = named("Abstract, Discussion: DDZ has a lower sigma")
    low, high = [2000.0, 2100.0, 1900.0], [4000.0, 4100.0, 3900.0]  # 2000 apart in each run
    assert judged(claim, sigma_ft={DDZ: high, SA: low, GA: low}).verdict == "does not hold"
    high = [4100.0, 3900.0, 4000.0]
    assert judged(claim, sigma_ft={DDZ: high, SA: low, GA: low}).verdict == "does not hold"
    assert judged(claim, sigma_ft={DDZ: low, SA: high, GA: high}).verdict == "holds"
    assert judged(claim, sigma_ft={DDZ: low, SA: high, GA: high}).in_print


@pytest.mark.parametrize(
    ("one", "verdict"), [(1.0, "holds"), (9.0, "does not hold"), (5.0, "undecided")]
)
def test_the_main_claim_is_judged_by_pairs(one: float, verdict: str) -> None:
    claim = named("The main claim in pairs")
    rng = np.random.default_rng(3)
    values = placements((one + rng.normal(0, 1, 30)).tolist(), (5 + rng.normal(0, 1, 30)).tolist())
    if verdict == "undecided":
        values = placements([1.0, 2.0, 8.0, 9.0], [3.0, 4.0, 6.0, 7.0])
    found = judge(claim, {(SMALLER, (DDZ, SA)): values}, {})
    assert found is not None and found.verdict == verdict


def test_placements_have_the_share_of_all_pairs_as_their_mean() -> None:
    one, other = [3.0, 1.0, 4.0, 1.0], [2.0, 7.0, 1.0, 8.0]
    pairs = [(a < b) + 0.5 * (a == b) for a, b in product(one, other)]
    share = math.fsum(pairs) / len(pairs)
    assert np.mean(placements(one, other)) == pytest.approx(share)
    found = evenness("one", "other", (one, other))
    assert found.share == pytest.approx(share)
    assert 0 <= found.low <= share <= found.high <= 1
    assert evenness("one", "other", (one, other)) == found, "the same draws every time"


def test_four_hundred_runs_are_enough_for_five_points() -> None:
    rng = np.random.default_rng(5)
    one, other = rng.gamma(3, 1000, 400).tolist(), rng.gamma(3, 1100, 400).tolist()
    found = evenness("one", "other", (one, other))
    assert found.half_width <= 0.05
    # The jackknife's interval, by which claims are judged, is as wide.
    values = placements(one, other)
    half = 1.966 * float(np.std(values, ddof=1)) / math.sqrt(400)
    assert half == pytest.approx(found.half_width, abs=0.004)


# Figure 5.


def test_published_curves_never_fall_and_end_as_the_series_do() -> None:
    for name, last in ((SA, 100), (GA, 100), (DDZ, 98)):
        parts = [int(text) for text in PUBLISHED_CURVES[name].split()]
        assert parts == sorted(parts) and parts[-1] == last and len(parts) <= len(curve_hours())


def test_a_curve_that_is_the_printed_one_lies_in_the_band() -> None:
    printed_parts = [int(text) for text in PUBLISHED_CURVES[SA].split()]
    parts = printed_parts + [100] * (len(curve_hours()) - len(printed_parts))
    run = {point(hour): float(n) for hour, n in zip(curve_hours(), parts, strict=True)}
    same = curve(SA, [run, run])
    inside, points = same.within()
    assert inside == points > 15
    *drawn, last = curve_text(same).splitlines()
    assert f"at {inside} of {points}" in last
    assert all("*" in line and "x" not in line for line in drawn if "in print" in line)
    ahead = curve(SA, [{name: min(100.0, n + 20) for name, n in run.items()}])
    assert ahead.within()[0] < points


def test_further_texts_come_with_their_data(made: Reproduced) -> None:
    found = {one.name: one for one in further(made)}
    assert set(found) == {"figure_5", "smaller_sigma", "reference"}
    assert [one["name"] for one in found["figure_5"].data] == [SA, GA, DDZ, DDZ_FREE]
    assert [(one["one"], one["other"]) for one in found["smaller_sigma"].data] == list(PAIRS)
    assert all(one.text.strip() and json.dumps(one.data) for one in found.values())


# The command.


def test_a_table_with_intervals_and_ranks(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["reproduce", "zoning", "--seeds", "2", "--workers", "1", "--tables", "claim"]
    assert main(command) == 0
    text = capsys.readouterr().out
    for words in ("95 %", "+-", "in pairs", "All 4 pairs of 2 runs each", "The main claim"):
        assert words in text
    assert "Figure 5: finished" not in text, "its runs were not made"
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"half_width", "rank"} <= set(found["rows"][0])
    assert len(found["smaller_sigma"]) == len(PAIRS) and "figure_5" not in found


def test_lanes_for_one_robot_are_a_table_of_their_own(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["reproduce", "zoning", "--seeds", "1", "--workers", "1", "--json"]
    assert main([*command, "--tables", "lanes"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {row["case"]["lanes"] for row in found["rows"]} == {"single"}
    assert (
        found["runs"] == len(ZONING_SETTINGS) and found["unfinished"] == 0 and found["claims"] == []
    )
