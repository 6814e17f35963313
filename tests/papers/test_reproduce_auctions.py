"""`automaton reproduce auctions`: its tables, the verdicts, the drawings."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import re
from statistics import mean
from typing import Any

import pytest
from shared_fixture import shared_fixture

from automaton.commands import main
from automaton.papers.auction_study import (
    CHARGING_TABLE,
    EFFORTS,
    EFFORTS_BY_ROBOTS,
    EXAMPLE,
    HORIZON,
    REPRODUCTION,
    ROLLING,
)
from automaton.papers.auction_trials import drawing, pictures, route
from automaton.papers.claim_report import evidence
from automaton.papers.claims import judge
from automaton.papers.reproduction_study import MadeTable, PublishedTable, Reproduced


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What `--json` prints for two seeds."""

    def run() -> dict[str, Any]:
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            assert main(["reproduce", "auctions", "--seeds", "2", "--json"]) == 0
        found: dict[str, Any] = json.loads(out.getvalue())
        return found

    return shared_fixture(tmp_path_factory, "auctions printed", run)


def rows(printed: dict[str, Any], metric: str, **case: object) -> list[float]:
    return [
        row["mean"] for row in printed["rows"] if row["metric"] == metric and row["case"] == case
    ]


def test_the_worked_example_is_that_of_the_paper(printed: dict[str, Any]) -> None:
    known = [row for row in printed["rows"] if row["paper"] is not None]
    assert len(known) == 14
    assert all(row["mean"] == row["paper"] for row in known)
    assert rows(printed, "bid", setting="reserve 10 %", robot=2) == [156]
    assert rows(printed, "bid", setting="reserve 20 %", robot=1) == [257]
    assert rows(printed, "c2", setting="reserve 20 %", robot=1) == [292]
    assert rows(printed, "bid", setting="reserve 20 %", robot=2) == []
    assert rows(printed, "c1", setting="reserve 20 %", robot=2) == []
    assert rows(printed, "bid", setting="never strand", robot=1) == []
    assert rows(printed, "bid", setting="never strand", robot=2) == []
    assert rows(printed, "c2", setting="chargers 1, 2, 3", robot=2) == [101]
    assert rows(printed, "bid", setting="chargers 1, 2, 3", robot=2) == [66]


def test_all_sizes_are_there(printed: dict[str, Any]) -> None:
    for m in range(1, 7):
        assert rows(printed, "LB", floor="full", robots=m)[0] >= 1
        for n in range(1, 11):
            best = rows(printed, "optimum", robots=m, tasks=n)[0]
            assert 0 < best <= rows(printed, "LB", robots=m, tasks=n)[0]
    cases = {json.dumps(row["case"]) for row in printed["rows"]}
    # Section 4 without robot 2 at a reserve of 20 %, ratios, epsilons, Figures 4, 5 (by tasks and by
    # robots), 6, the horizon.
    assert len(cases) == 15 + 10 + 4 + 60 + 10 + 6 + 2 * 10 + 13 + 3 + 6


def test_two_seeds_decide_what_is_certain(printed: dict[str, Any]) -> None:
    verdicts = {claim["claim"]: claim["verdict"] for claim in printed["claims"]}
    assert len(verdicts) == len(REPRODUCTION.claims)
    first = next(text for text in verdicts if text.startswith("Robot 1 wins"))
    assert verdicts[first] == "holds"
    assert verdicts["Without resource constraints robot 2 would have obtained the task"] == "holds"
    assert verdicts["The auction's work grows linearly with the tasks"] == "does not hold"
    assert verdicts["The optimum's work grows exponentially with the tasks"] == "holds"
    robots = "The auction's work grows linearly with the robots ({} after a sale)"
    assert verdicts[robots.format("only the winner bids again")] == "does not hold"


def made(table: PublishedTable, seeds: int) -> MadeTable:
    cases = table.cases(())
    return MadeTable(table, cases, table.run(cases, range(1, seeds + 1), None, None))


@pytest.fixture(scope="module")
def horizon(tmp_path_factory: pytest.TempPathFactory) -> MadeTable:
    """Five runs of 200 batches for each case, as the reference."""

    def run() -> list[Any]:
        return list(made(HORIZON, 5).results)

    return MadeTable(
        HORIZON, HORIZON.cases(()), shared_fixture(tmp_path_factory, "auctions horizon", run)
    )


def test_claims_are_judged_by_what_was_run(horizon: MadeTable) -> None:
    """Twenty seeds of the tables without the genetic algorithm, five of batches back to back."""
    tables = [made(EXAMPLE, 20), made(CHARGING_TABLE, 20), horizon]
    reproduced = Reproduced(REPRODUCTION, 20, tables)
    judged = [judge(claim, reproduced.samples(), {}) for claim in REPRODUCTION.claims]
    verdicts = {one.claim.text: one.verdict for one in judged if one is not None}
    just_enough = [verdicts[text] for text in verdicts if text.startswith("Just enough beats")]
    assert just_enough[:2] == ["does not hold", "does not hold"]
    fewer = "With fewer than six tasks no charging is needed (reserve {} %)"
    assert verdicts[fewer.format(0)] == "not contradicted"
    assert verdicts[fewer.format(20)] == "does not hold"
    assert verdicts["... always, in every single tour"] == "does not hold"
    kept = "... in every tour in which the threshold rule keeps the 20 %"
    assert verdicts[kept] == "not contradicted"
    assert len(verdicts) == 3 + 7 + 6


def test_batch_after_batch_just_enough_gets_stuck_and_filling_up_is_best(
    horizon: MadeTable,
) -> None:
    """The shares of stuck batches within 0.1 of the reference's."""
    values = dict(horizon.samples())
    for size, stuck in ((2, 0.33), (4, 0.50), (8, 0.84)):
        found = {
            name: tuple(mean(values[one, ("linear", size)]) for one in (name, f"stuck {name}"))
            for name in ROLLING
        }
        assert found["r0"][1] == pytest.approx(stuck, abs=0.1)
        assert all(found[name][1] == 0 for name in ROLLING if name != "r0")
        safe = {name: seconds for name, (seconds, _) in found.items() if name != "r0"}
        assert min(safe, key=lambda name: safe[name]) == "fill-up"
        if size < 8:
            assert safe["r0 reach"] > safe["thr20 safe"]


def test_a_taper_makes_filling_up_dearer(horizon: MadeTable) -> None:
    values = dict(horizon.samples())
    for size in (2, 4):
        costs = [values["fill-up", (curve, size)][0] for curve in ("linear", "taper")]
        assert costs[0] < costs[1]


def test_efforts_are_those_of_the_formulas() -> None:
    found = made(EFFORTS, 2)
    for row in found.rows():
        n = int(row.case["tasks"])
        if row.metric == "LB bids":
            assert row.mean == 2 * n + n * (n - 1) // 2
    by_robots = {
        (row.metric, row.case["robots"]): row.mean for row in made(EFFORTS_BY_ROBOTS, 2).rows()
    }
    for m in range(1, 7):
        assert by_robots["LB bids", m] == 10 * m + 45
        assert by_robots["all bids", m] == 55 * m
        assert by_robots["LB places", m] <= by_robots["all places", m]


def test_bids_are_counted_so_that_one_seed_decides() -> None:
    reproduced = Reproduced(REPRODUCTION, 1, [made(EFFORTS, 1), made(EFFORTS_BY_ROBOTS, 1)])
    judged = [judge(claim, reproduced.samples(), {}) for claim in REPRODUCTION.claims]
    bids = {
        (one.claim.text, figure.figure.label): (round(figure.value, 3), figure.verdict)
        for one in judged
        if one is not None
        for figure in one.figures
        if "exponent of bids" in figure.figure.label
    }
    assert list(bids.values()) == [
        (1.7, "does not hold"),
        (1.0, "holds"),  # 55 m
        (0.437, "does not hold"),  # 10 m + 45
    ]


def test_what_may_be_otherwise_is_said_of_tours(printed: dict[str, Any]) -> None:
    reproduced = Reproduced(REPRODUCTION, 1, [made(CHARGING_TABLE, 1)])
    [claim] = [one for one in REPRODUCTION.claims if one.text.startswith("... in every tour in")]
    found = judge(claim, reproduced.samples(), {}, reproduced.repeated())
    assert found is not None and found.figures[0].runs == CHARGING_TABLE.per_seed > 1
    assert " of tours (95 %)" in evidence(found)
    [known] = [one for one in printed["claims"] if one["claim"] == claim.text]
    assert [figure["repetition"] for figure in known["figures"]] == ["tour"]


def test_routes_run_over_lanes_only() -> None:
    cells = route((1, 5, 4, 14))
    assert cells[0] == (2, 0)
    assert cells[-1] == (0, 8)
    assert len(cells) == 1 + 2 + 2 + 6
    assert drawing([(5, 4), (), (8,)]).splitlines()[:3] == [
        "              1 A           2 B           3 C",
        "              A             .             C",
        "4* A   A      5* A   .      6      .      7 C    C      8* C",
    ]


def test_the_pictures_show_the_same_tasks_by_auction_and_optimum() -> None:
    (auction, by_auction), (optimum, by_optimum) = pictures()
    assert auction.startswith("Figure 2") and optimum.startswith("Figure 3")
    starred = [sorted(re.findall(r"(\d+)\*", text)) for text in (by_auction, by_optimum)]
    assert starred[0] == starred[1]
    assert len(starred[0]) == 10
    ends = [float(text.splitlines()[-1].split()[-2]) for text in (by_auction, by_optimum)]
    assert ends[0] >= ends[1]


def test_the_report_shows_steps_pictures_and_standard_errors(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "automaton.papers.auction_study.REPRODUCTION",
        dataclasses.replace(REPRODUCTION, tables=(EXAMPLE, EFFORTS, HORIZON)),
    )
    assert main(["reproduce", "auctions", "--seeds", "2", "--tables"]) == 0
    text = capsys.readouterr().out
    for line in (
        "robot 2 at 1 with 45 %: [5, 4, 9]: c1 = 20 + 20 + 30 = 70 s",
        "  charging: [5, 2, 4, 9, 14]: to the charger 20 + 40 = 60 s, arriving with 15 %; on from it "
        "60 + 30 + 30 = 120 s; 9 s of charging; c2 = 189 s",
        "  bids: MiniSum 119, MiniMax 189, with epsilon 0.5: 154 (charging ignored: 65)",
        "robot 1 wins; with charging ignored it would be robot 2",
        "Figure 3, the optimum: 10 tasks, 3 robots (seed 12)",
        "Paper's claims",
    ):
        assert line in text
    assert "mean and se over the seeds" in text


def test_computing_times_are_those_of_figures_5_and_6c(printed: dict[str, Any]) -> None:
    """The text has no seconds: nothing stands beside ours, and its statements are judged."""
    for computing, metrics in (
        ("Figure 5", ("optimum ms", "m^n ms", "GA ms", "auction ms")),
        ("Figure 6c", ("as needed us", "threshold us", "no battery us")),
    ):
        for n in range(1, 11):
            for metric in metrics:
                assert rows(printed, metric, computing=computing, tasks=n)[0] > 0
    timed = [row for row in printed["rows"] if "computing" in row["case"]]
    assert all(row["paper"] is None for row in timed)
    slow, fast = (
        rows(printed, f"{name} ms", computing="Figure 5", tasks=10)[0] for name in ("GA", "auction")
    )
    assert slow > 10 * fast
    judged = [claim["claim"] for claim in printed["claims"] if "Figure" in claim["claim"]]
    assert len([text for text in judged if text.startswith(("Figure 5", "Figure 6c"))]) == 7
