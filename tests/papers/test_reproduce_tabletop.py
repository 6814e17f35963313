"""`automaton reproduce tabletop`: the printed table, our runs beside it, the judged claims."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import re
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from remembered_runs import remembered_runs

from automaton.commands import main
from automaton.errors import InputError
from automaton.papers.claim_report import evidence
from automaton.papers.claims import Claim, Figure, judge
from automaton.papers.reproduction_study import REPRODUCTIONS, Reproduced, find, reproduce
from automaton.papers.tabletop_study import (
    REPRODUCTION,
    T_R,
    T_R_TOTAL,
    T_TOTAL,
    published,
)
from automaton.studies.inference.intervals import student
from automaton.studies.process_pool import run_all
from automaton.world.resolve import resolve

SIXTH = ("T_total", "T_R", "least_picks", "sixth_idle")
METRICS = ("T_total", "T_R", "T_Rtotal", "E_U_moves", "E_U_operations", "E_U_cycles")

# Table 3 as it is printed, in its own layout.
TABLE_3 = """
T_total  Ind  5145 3441 3000 2756 2820  5657 3776 3285 3172 3134
T_total  Coop 4621 2961 2364 1853 1957  9436 4670 3764 2944 2736
T_R      Ind  1156  867  887  906 1198  1443  966  873  875 1041
T_R      Coop 1130  834  593  531  671  1848 1097  864  708  787
T_Rtotal Ind  1156 1734 2661 3624 5990  1443 1932 2619 3500 5205
T_Rtotal Coop 1130 1668 1779 2124 3355  1848 2194 2592 2832 3935
"""

# Means over seeds 1 and 2 for N = 1..5: a change of the world or of a strategy shows here.
GOLDEN = {
    "1 independent T_total": [5163.0, 3065.0, 2869.0, 2889.0, 2734.5],
    "1 independent T_Rtotal": [1244.5, 1574.0, 2433.5, 3312.0, 3963.0],
    "1 cooperative T_total": [4623.0, 2885.0, 2280.5, 2159.5, 1804.0],
    "1 cooperative T_Rtotal": [1122.0, 1442.5, 1733.0, 2066.0, 2011.5],
    "2 independent T_total": [5798.0, 3756.0, 3125.5, 3357.0, 3145.5],
    "2 independent T_Rtotal": [1533.0, 2137.0, 2721.5, 4216.0, 4762.0],
    "2 cooperative T_total": [9365.0, 4689.5, 3248.5, 2670.0, 2753.0],
    "2 cooperative T_Rtotal": [1809.0, 1927.0, 2123.0, 2401.0, 3024.5],
}


@pytest.fixture(scope="module", autouse=True)
def each_run_once() -> Iterator[None]:
    with remembered_runs():
        yield


@pytest.fixture(scope="module")
def two_seeds() -> Reproduced:
    return reproduce(REPRODUCTION, seeds=2, workers=1)


@pytest.fixture(scope="module")
def six_seeds() -> Reproduced:
    return reproduce(REPRODUCTION, seeds=6, workers=1)


def test_our_copy_of_table_3_is_the_printed_one() -> None:
    names = {"Ind": "independent", "Coop": "cooperative"}
    for line in TABLE_3.strip().splitlines():
        metric, strategy, *figures = line.split()
        cells = product((1, 2), (1, 2, 3, 4, 5))
        for (configuration, robots), figure in zip(cells, figures, strict=True):
            assert published((configuration, names[strategy], robots), metric) == int(figure)


def test_in_print_t_rtotal_is_n_times_t_r() -> None:
    for key, line in T_R.items():
        assert T_R_TOTAL[key] == tuple(n * figure for n, figure in enumerate(line, 1))
    assert T_TOTAL.keys() == T_R.keys() == T_R_TOTAL.keys()


def test_what_is_not_printed_has_no_figure() -> None:
    assert published((1, "independent", 1), "E_U_moves") is None
    assert published((1, "adaptive", 1), "T_total") is None


def test_there_is_a_row_for_each_metric_of_each_cell(two_seeds: Reproduced) -> None:
    rows = two_seeds.rows()
    expected: list[Any] = list(
        product((1, 2), ("independent", "cooperative"), (1, 2, 3, 4, 5), METRICS)
    )
    expected += [(1, "cooperative", 6, metric) for metric in SIXTH]
    expected += [(*one[:3], "everything", one[3]) for one in expected]
    assert [(*row.case.values(), row.metric) for row in rows] == expected
    assert set(rows[0].case) == {"configuration", "strategy", "robots"}
    assert two_seeds.unfinished == 0


def test_errors_are_relative_to_print(two_seeds: Reproduced) -> None:
    for row in two_seeds.rows():
        if row.metric.startswith("E_U") or row.case["robots"] == 6:
            assert (row.paper, row.error) == (None, None)
        else:
            assert row.paper and row.error == row.mean / row.paper - 1


def test_two_seeds_give_these_figures(two_seeds: Reproduced) -> None:
    """Golden: means of T_total and T_Rtotal over seeds 1 and 2, N = 1..5."""
    found: dict[str, list[float]] = {}
    for row in two_seeds.tables[0].rows():
        if row.metric in ("T_total", "T_Rtotal"):
            label = f"{row.case['configuration']} {row.case['strategy']} {row.metric}"
            found.setdefault(label, []).append(row.mean)
    assert found == GOLDEN


def test_two_workers_give_the_same_as_one() -> None:
    alone, spread = (reproduce(REPRODUCTION, seeds=1, workers=workers) for workers in (1, 2))
    assert spread.rows() == alone.rows()
    assert [made.results for made in spread.tables] == [
        made.results for made in alone.tables
    ]  # digests, too


def test_six_seeds_come_near_the_printed_table(six_seeds: Reproduced) -> None:
    errors = six_seeds.mean_errors()
    assert errors["T_total"] is not None and errors["T_total"] < 0.075
    assert errors["T_Rtotal"] is not None and errors["T_Rtotal"] < 0.14
    assert six_seeds.unfinished == 0


def test_clear_claims_are_decided_by_six_seeds(six_seeds: Reproduced) -> None:
    samples, printed = six_seeds.samples(), six_seeds.published()
    judged = [judge(claim, samples, printed) for claim in REPRODUCTION.claims]
    verdicts = {claim.claim.text: claim.verdict for claim in judged if claim}
    assert len(verdicts) == len(REPRODUCTION.claims)

    def verdict(words: str) -> str:
        return next(verdict for text, verdict in verdicts.items() if words in text)

    assert verdict("cooperation shortens T_total at every N") == "holds"
    assert verdict("T_Rtotal rises faster for independent") == "holds"
    assert verdict("few robots: N = 1 and 2") == "holds"
    assert verdict("few robots (N = 1) finish earlier") == "does not hold"
    assert verdict("5 independent robots finish before") == "does not hold"
    assert verdict("a fifth makes T_total longer") == "does not hold"


def test_the_publication_does_not_bear_out_four_of_its_claims(two_seeds: Reproduced) -> None:
    samples, printed = two_seeds.samples(), two_seeds.published()
    judged = [judge(claim, samples, printed) for claim in REPRODUCTION.claims]
    against = [claim.claim.text for claim in judged if claim and claim.in_print is False]
    assert len(against) == 4
    unprinted = [claim.claim.text for claim in judged if claim and claim.in_print is None]
    assert len(unprinted) == 7
    assert all("E_U" in text or "a sixth cooperative robot" in text for text in unprinted)


def claim_about(words: str) -> Claim:
    [claim] = [claim for claim in REPRODUCTION.claims if words in claim.text]
    return claim


@pytest.mark.parametrize(
    ("cuts", "verdict"),
    [
        ((0.253, 0.298), "does not hold"),
        ((0.299, 0.301), "undecided"),
        ((0.328, 0.331), "holds"),
    ],
)
def test_a_cut_by_30_percent_is_compared_with_30_percent(
    cuts: tuple[float, float], verdict: str
) -> None:
    """Sixty seeds with this interval (Student's); the table's own figure is told besides."""
    low, high = cuts
    spread = (high - low) / 2 * math.sqrt(60) / student(59) * math.sqrt(59 / 60)
    saved = [(low + high) / 2 + sign * spread for sign in [1, -1] * 30]
    samples = {
        ("T_total", (1, "independent", 4)): [1000.0] * 60,
        ("T_total", (1, "cooperative", 4)): [1000 * (1 - one) for one in saved],
    }
    published = {("T_total", (*key, 4)): line[3] for key, line in T_TOTAL.items()}
    judged = judge(claim_about("by 30 %"), samples, published)
    assert judged is not None
    [figure] = judged.figures
    assert (figure.low, figure.high) == pytest.approx(cuts)
    assert judged.verdict == verdict
    assert figure.printed == pytest.approx(0.328, abs=0.0005) and judged.in_print
    assert "30.0 % (as the text says); the paper's own table: 32.8 %, agrees" in evidence(judged)


def test_no_range_of_a_claim_is_without_a_reason() -> None:
    """Where it ends is printed, or is 0 ("more", "less", "never") or half ("most"), or is explained."""
    silent = [
        (name, claim.text, figure.label)
        for name in REPRODUCTIONS
        for claim in find(name).claims
        for figure in claim.figures
        if not figure.why and figure.at_least != figure.at_most
        for end in (figure.at_least, figure.at_most)
        if math.isfinite(end) and end not in (0, 0.5, 1)
    ]
    assert silent == []


def test_a_sixth_cooperative_robot_stays_idle(six_seeds: Reproduced) -> None:
    """In five of six runs: in the others it gets an alley that another robot has just left."""
    idle = [run.metrics["sixth_idle"] for run in six_seeds.tables[1].results[0]]
    picks = [run.metrics["least_picks"] for run in six_seeds.tables[1].results[0]]
    assert idle == [1, 0, 1, 1, 0, 1]
    assert [count == 0 for count in picks] == [one == 1 for one in idle]
    samples = six_seeds.samples()
    judged = judge(claim_about("a sixth"), samples, {})
    assert judged is not None and judged.verdict == "does not hold"
    always = samples | {("sixth_idle", (1, "cooperative", 6)): [1.0] * 6}
    judged = judge(claim_about("a sixth"), always, {})
    assert judged is not None and judged.verdict == "not contradicted"


def test_other_seeds_are_other_runs_of_which_the_claims_are_told(
    two_seeds: Reproduced, capsys: pytest.CaptureFixture[str]
) -> None:
    found = json_of(capsys, "--seeds", "1", "--seed-from", "2", "--workers", "1")
    assert (found["seeds"], found["seed_from"]) == (1, 2)
    second = two_seeds.tables[0].results[0][1].metrics
    rows = {row["metric"]: row["mean"] for row in found["rows"][: len(METRICS)]}
    assert rows == {metric: second[metric] for metric in METRICS}
    [cut] = [claim for claim in found["claims"] if "by 30 %" in claim["claim"]]
    samples = two_seeds.samples()
    four = [samples["T_total", (1, s, 4)][1] for s in ("independent", "cooperative")]
    assert cut["figures"][0]["value"] == pytest.approx(1 - four[1] / four[0])
    assert cut["source"].startswith("In the optimal case of 4 robots")


@pytest.mark.parametrize(
    ("values", "verdict"),
    [([0.0, 1e-6], "undecided"), ([1.0, 1.1], "holds"), ([-1.0, -1.1], "does not hold")],
)
def test_no_difference_is_no_claim_of_more(values: list[float], verdict: str) -> None:
    figure = Figure("more", lambda mean: mean("T", 1), at_least=0, strict=True)
    judged = judge(Claim("more", (figure,)), {("T", (1,)): values}, {("T", (1,)): values[0]})
    assert judged is not None
    assert (judged.verdict, judged.in_print) == (verdict, verdict == "holds")
    nothing = judge(Claim("more", (figure,)), {("T", (1,)): [0.0, 0.0]}, {("T", (1,)): 0.0})
    assert nothing is not None and (nothing.verdict, nothing.in_print) == ("does not hold", False)


def test_a_claim_needs_its_whole_interval() -> None:
    samples = {("T", (1,)): [10.0, 11.0, 12.0, 13.0], ("T", (2,)): [9.0, 9.5, 11.5, 12.0]}
    less = Figure("less", lambda mean: mean("T", 1) - mean("T", 2), at_least=0)
    judged = judge(Claim("T falls", (less,)), samples, {("T", (1,)): 3.0, ("T", (2,)): 4.0})
    assert judged is not None
    [figure] = judged.figures
    # The paired differences are 1, 1.5, 0.5 and 1: mean 1, standard error 0.2041.
    assert figure.value == pytest.approx(1.0)
    assert figure.low == pytest.approx(1 - 3.182446 * math.sqrt(1 / 24))
    assert (judged.verdict, judged.in_print) == ("holds", False)
    wide = Figure("less", less.of, at_least=0.9)
    undecided = judge(Claim("T falls", (less, wide)), samples, {})
    assert undecided is not None
    assert (undecided.verdict, undecided.in_print) == ("undecided", None)
    missing = Figure("less", lambda mean: mean("T", 3))
    assert judge(Claim("T falls", (missing,)), samples, {}) is None


def test_a_range_that_is_ours_has_its_reason_beside_it() -> None:
    """The paper names no number of robots from which congestion grows."""
    figures = claim_about("Congestion").figures
    assert all(figure.why.startswith("from 2 robots on") for figure in figures)
    for figure in (one for claim in REPRODUCTION.claims for one in claim.figures):
        plain = (figure.at_least, figure.at_most) in ((0, math.inf), (-math.inf, 0), (1, math.inf))
        assert plain or figure.why, figure.label


@pytest.mark.parametrize(("degrees", "factor"), [(1, 12.706), (11, 2.201), (59, 2.001)])
def test_students_factor(degrees: int, factor: float) -> None:
    assert student(degrees) == pytest.approx(factor, abs=0.003)


def json_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert main(["reproduce", "tabletop", "--json", *arguments]) == 0
    text, errors = capsys.readouterr()
    assert errors == ""
    found: dict[str, Any] = json.loads(text)
    return found


def test_json_has_the_agreed_keys(capsys: pytest.CaptureFixture[str]) -> None:
    found = json_of(capsys, "--seeds", "1", "--workers", "1")
    assert (found["name"], found["seeds"], found["unfinished"]) == ("tabletop", 1, 0)
    assert found["runs"] == 2 * 21 and len(found["rows"]) == 2 * 124
    [other] = found["premises"]
    assert other["premise"] == "information: everything"
    assert set(other["mean_absolute_error"]) == {"T_total", "T_Rtotal"}
    assert list(other["claims"]) == [claim["claim"] for claim in found["claims"]]
    assert found["settings"] == []
    assert set(found["rows"][0]) == {"case", "metric", "paper", "mean", "sd", "error"}
    assert found["rows"][0]["case"] == {
        "configuration": 1,
        "strategy": "independent",
        "robots": 1,
    }
    assert {claim["verdict"] for claim in found["claims"] if "sixth" not in claim["claim"]} == {
        "undecided"  # no interval
    }


def test_other_strategies_have_no_figures_to_compare_with(
    capsys: pytest.CaptureFixture[str],
) -> None:
    names = "adaptive, independent,adaptive"
    found = json_of(capsys, "--seeds", "1", "--workers", "1", "--strategies", names)
    strategies = {row["case"]["strategy"]: row["paper"] for row in found["rows"][::-1]}
    assert strategies == {"adaptive": None, "independent": 5145}
    assert len(found["rows"]) == 2 * 120


@pytest.mark.parametrize("columns", [80, 200])
def test_the_report_fits_the_terminal(
    columns: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    assert main(["reproduce", "tabletop", "--seeds", "2", "--workers", "1", "--tables"]) == 0
    text, errors = capsys.readouterr()
    assert errors == ""  # no progress in a pipe
    lines = text.splitlines()
    assert max(map(len, lines)) <= columns
    assert "…" not in text and "\x1b" not in text
    cells = [line for line in lines if re.match(r" +[12] +(independent|cooperative) +[1-5] ", line)]
    assert len(cells) == 2 * 20 * (3 if columns == 80 else 2)
    assert "mean |error|: T_total" in text and "(information: everything)" in text
    assert "Claims with another verdict under information: everything" in text
    assert "40 runs, 0 unfinished" in text
    assert "DISAGREES" in text and "mean |error|: T_total " in text


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["tabeltop"], "nothing called 'tabeltop' to reproduce (did you mean 'tabletop'?)"),
        (["tabletop", "--seeds", "0"], "--seeds must be at least 1, not 0"),
        (["tabletop", "--workers", "0"], "--workers must be at least 1, not 0"),
        (
            ["tabletop", "--seed-from", "0"],
            "--seed-from: '0' is not a seed: allowed are whole numbers from 1",
        ),
        (["tabletop", "--seeds", "1e9"], "argument --seeds: '1e9' is not a whole number"),
        (["tabletop", "--set", "fleet.robots=3"], "the cases of tabletop set this themselves"),
        (["tabletop", "--set", "information={radius: 3}"], "the cases of tabletop set this"),
        (["tabletop", "--set", "strategy.allocation.name=adaptive"], "the cases of tabletop set"),
        (
            ["tabletop", "--set", "fleet.types=[{name: a, strategy: {allocation: adaptive}}]"],
            "the cases of tabletop set this themselves",
        ),
        (["tabletop", "--set", "seed=5"], "--set seed=5: set seeds with --seed-from N"),
        (["tabletop", "--set", "durations.turn=x"], "--set durations.turn=x: durations.turn must"),
        (["tabletop", "--set", "nonsense"], "--set nonsense: expected KEY=VALUE"),
        (["traffic", "--set", "durations.turn=3"], "traffic runs no scenarios: omit --set"),
        (["fleets", "--set", "strategy={}"], "the cases of fleets set this themselves"),
        (["queues", "--set", "orders.lines.count=-1"], "--set orders.lines.count=-1: orders.lines"),
        (["tabletop", "--strategies", "adaptiv"], "did you mean 'adaptive'?"),
        (["tabletop", "--strategies", "x"], "automaton: --strategies: allocation strategy 'x' is"),
    ],
)
def test_bad_input_is_one_sentence(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["reproduce", *arguments]) == 2
    errors = capsys.readouterr().err
    assert sentence in errors and errors.count("\n") == 1


def test_a_changed_experiment_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    """Turns that take no longer than a move: everything is faster, in both tables."""
    few = ["--seeds", "1", "--workers", "1", "--strategies", "independent"]
    published, changed = (
        json_of(capsys, *few, *more) for more in ([], ["--set", "durations.turn=1"])
    )
    assert (published["settings"], changed["settings"]) == ([], ["durations.turn=1"])
    for before, after in zip(published["rows"], changed["rows"], strict=True):
        assert before["case"] == after["case"]
        if before["metric"] == "T_total":
            assert after["mean"] < before["mean"]
    said = "NOT THE PUBLISHED EXPERIMENT: made with --set durations.turn=1"
    for more in ([], ["--tables"]):
        command = ["reproduce", "tabletop", *few, "--set", "durations.turn=1", *more]
        assert main(command) == 0
        assert said in " ".join(capsys.readouterr().out.split())


def test_robots_know_the_list_of_orders_alone() -> None:
    tables = [table.cases(REPRODUCTION.strategies) for table in REPRODUCTION.tables]
    informed = [
        {resolve(case.scenario, case.overrides).scenario.information for case in cases}  # type: ignore[attr-defined]
        for cases in tables
    ]
    assert informed == [{"orders"}, {"orders"}, {"everything"}, {"everything"}]


def test_runs_that_do_not_finish_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    stuck = [resolve("tabletop-1", ["strategy.right_of_way=wait", "stop.max_duration=20000"])]
    [results] = run_all(stuck, [1, 2], workers=1)
    assert [result.finished for result in results] == [False, False]
    assert "makespan" not in results[0].metrics


def test_a_strategy_that_fails_in_a_worker_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_failing.py").write_text(
        "from automaton.strategy.api import Strategy\n"
        "class Fails(Strategy):\n"
        "    layer = 'allocation'\n"
        "    def decide(self, view, batch, decisions, memory, workspace):\n"
        "        raise RuntimeError('no idea')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    scenario = resolve("tabletop-mini", ["strategy.allocation=own_failing:Fails"])
    with pytest.raises(InputError, match=r"RuntimeError: no idea \(.*own_failing.py:5\)"):
        run_all([scenario], range(1, 40), workers=2)


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_an_interrupt_leaves_no_process_behind() -> None:
    def interrupt(runs: int) -> None:
        raise KeyboardInterrupt

    before = set(multiprocessing.active_children())
    with pytest.raises(KeyboardInterrupt):
        run_all([resolve("tabletop-1")], range(1, 400), workers=2, on_done=interrupt)
    started = {process.pid for process in set(multiprocessing.active_children()) - before}
    patience = time.monotonic() + 10
    while any(is_running(pid) for pid in started if pid):
        assert time.monotonic() < patience
        time.sleep(0.02)


def test_every_reproduction_is_complete() -> None:
    for name in REPRODUCTIONS:
        found = find(name)
        assert found.name == name and found.remarks and found.claims
        keys = [case.key for table in found.tables for case in table.cases(found.strategies)]
        assert len(set(keys)) == len(keys)
        assert set(found.averaged) <= {name for table in found.tables for name in table.metrics}
