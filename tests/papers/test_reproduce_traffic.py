"""`automaton reproduce traffic`: Table 5 by several readings, and the claims that trials decide."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
import sys
from functools import cached_property
from typing import Any

import numpy as np
import pytest

from automaton.commands import main
from automaton.papers.claims import JudgedClaim, judge
from automaton.papers.reproduction_study import FigureRow, Reproduced, reproduce
from automaton.papers.traffic_study import PLAIN_A_STAR, READINGS, REPRODUCTION, TRAFFIC_CLAIMS
from automaton.papers.traffic_trials import (
    TRIAL_ROBOTS,
    TRIALS,
    Setting,
    exact,
    run_seed,
    tasks_of,
    warehouse,
)

A_STAR = ("static", "A*", "-")
EXACT = ("static", "avoidance", "exact")
TRAINED = ("static", "avoidance", ".40/.84")
CAUTIOUS = ("static", "most cautious", ".40/.84")
TESTED = ("static", "avoidance", ".05/.75")
NETWORK = ("static", "avoidance", "network")
DYNAMIC = ("dynamic", "avoidance", "exact")


class Remembered(Reproduced):
    """Its rows are computed once."""

    @cached_property
    def all_rows(self) -> list[FigureRow]:
        return super().rows()

    def rows(self) -> list[FigureRow]:
        return self.all_rows


@pytest.fixture(scope="module")
def ten_seeds() -> Reproduced:
    return Remembered(**vars(reproduce(REPRODUCTION, seeds=10)))


def row(reproduced: Reproduced, key: tuple[str, str, str], metric: str) -> FigureRow:
    [found] = [
        one for one in reproduced.rows() if tuple(one.case.values()) == key and one.metric == metric
    ]
    return found


def paired(reproduced: Reproduced, key: tuple[str, str, str]) -> list[float]:
    """Time by avoidance less time by plain A*, trial by trial."""
    samples = reproduced.samples()
    plain = samples["time", (key[0], "A*", "-")]
    return [ours - theirs for ours, theirs in zip(samples["time", key], plain, strict=True)]


# Where a thousand trials must come out; each mean has a standard error of 2 to 3.
@pytest.mark.parametrize(
    ("key", "metric", "value", "margin"),
    [
        (A_STAR, "time", 241, 8),
        (A_STAR, "distance", 161, 4),
        (EXACT, "time", 170, 5),
        (TRAINED, "time", 190, 6),
        (CAUTIOUS, "time", 230, 12),
        (NETWORK, "time", 173, 6),
    ],
)
def test_the_means_of_ten_seeds(
    ten_seeds: Reproduced, key: tuple[str, str, str], metric: str, value: float, margin: float
) -> None:
    assert row(ten_seeds, key, metric).mean == pytest.approx(value, abs=margin)


def test_counts_as_bad_as_the_tested_network_gain_nothing(ten_seeds: Reproduced) -> None:
    differences = paired(ten_seeds, TESTED)
    assert abs(math.fsum(differences) / len(differences)) < 3


def test_where_robots_really_meet_avoidance_makes_the_way_longer(ten_seeds: Reproduced) -> None:
    differences = paired(ten_seeds, DYNAMIC)[:500]
    assert math.fsum(differences) > 0
    assert row(ten_seeds, DYNAMIC, "taken").mean >= 0.8


def test_encounters_fall_in_every_reading(ten_seeds: Reproduced) -> None:
    for key in (EXACT, TRAINED, CAUTIOUS, TESTED, NETWORK, DYNAMIC):
        plain = row(ten_seeds, (key[0], "A*", "-"), "encounters").mean
        assert row(ten_seeds, key, "encounters").mean < plain


def test_saving_counts_only_trials_with_an_alternative(ten_seeds: Reproduced) -> None:
    samples = ten_seeds.samples()
    saved, taken = (math.fsum(samples[name, EXACT]) for name in ("saved", "taken"))
    assert row(ten_seeds, EXACT, "saving").mean == pytest.approx(saved / taken)
    assert ("saving", EXACT) not in samples  # no claim can rest on some of the trials


def test_the_robot_never_expects_to_lose(ten_seeds: Reproduced) -> None:
    """With exact counts what is foreseen is what happens, so no trial is worse than plain A*."""
    assert max(paired(ten_seeds, EXACT)) == 0


def test_plain_a_star_has_no_alternative_to_report(ten_seeds: Reproduced) -> None:
    metrics = {one.metric for one in ten_seeds.rows() if tuple(one.case.values()) == A_STAR}
    assert metrics == {"time", "distance", "encounters"}


def verdicts(reproduced: Reproduced) -> dict[str, JudgedClaim]:
    samples, printed = reproduced.samples(), reproduced.published()
    judged = [judge(claim, samples, printed) for claim in REPRODUCTION.claims]
    return {claim.claim.text: claim for claim in judged if claim is not None}


def test_the_claims_that_ten_seeds_decide(ten_seeds: Reproduced) -> None:
    judged = verdicts(ten_seeds)
    assert len(judged) == len(REPRODUCTION.claims)
    shortens, fewer = (
        "Avoidance shortens the travel time",
        "An alternative is taken in less than half",
    )
    for beginning, ending, verdict in (
        (shortens, "(static, exact counts)", "holds"),
        (shortens, "(dynamic, exact counts)", "does not hold"),
        ("It does so by 49.44", "precision .40 and recall .84)", "holds"),
        ("It does so by 49.44", "(static, exact counts)", "does not hold"),
        ("Plain A* has the shorter distance", "(static, exact counts)", "holds"),
        (fewer, "(static, exact counts)", "does not hold"),
        (fewer, "as tested)", "holds"),
        ("Where an alternative is taken", "(static, exact counts)", "does not hold"),
        ("The robot uses fewer zones", "(dynamic, exact counts)", "holds"),
    ):
        [claim] = [
            one
            for text, one in judged.items()
            if text.startswith(beginning) and text.endswith(ending)
        ]
        assert claim.verdict == verdict, claim.claim.text


FRESH = """
import hashlib
from automaton.papers.traffic_trials import tasks_of, warehouse
print(hashlib.sha256(tasks_of(warehouse(), 3).tobytes()).hexdigest())
"""


def test_tasks_are_drawn_by_the_seed_alone_and_alike_in_a_fresh_process() -> None:
    where = warehouse()
    tasks = tasks_of(where, 3)
    fresh = subprocess.run(
        [sys.executable, "-c", FRESH], capture_output=True, text=True, check=True
    )
    assert fresh.stdout.strip() == hashlib.sha256(tasks.tobytes()).hexdigest()
    assert not np.array_equal(tasks, tasks_of(where, 4))
    assert tasks.shape == (TRIALS, TRIAL_ROBOTS, 3)
    assert tasks[0, 0].tolist() == tasks_of(where, 3)[0, 0].tolist()
    assert set(tasks[:, :, 1].ravel().tolist()) <= set(where.docks.tolist())
    assert (len(where.racks), len(where.docks)) == (5769, 64)
    assert run_seed(Setting(exact), 3) == run_seed(Setting(exact), 3)


def test_json_has_the_agreed_keys(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "traffic", "--json", "--seeds", "1"]) == 0
    text, errors = capsys.readouterr()
    found: dict[str, Any] = json.loads(text)
    assert errors == "" and (found["name"], found["seeds"], found["unfinished"]) == (
        "traffic",
        1,
        0,
    )
    assert found["runs"] == 900
    assert set(found["rows"][0]) == {"case", "metric", "paper", "mean", "sd", "error", "paper_sd"}
    assert found["rows"][0]["paper_sd"] == 77.60
    assert found["rows"][0]["case"] == {"slowdown": "static", "path": "A*", "counts": "-"}
    assert found["rows"][0]["paper"] == 229.97
    assert found["remarks"]
    stored = [row for row in found["rows"] if {"table", "study"} & set(row["case"])]
    assert [row.get("stored") for row in found["rows"]] == [
        True if row in stored else None for row in found["rows"]
    ]
    assert len(stored) == 3 * 57 + 4 * 6


@pytest.fixture(scope="module")
def one_seed() -> Reproduced:
    return reproduce(REPRODUCTION, seeds=1)


@pytest.mark.parametrize("columns", [80, 200])
def test_the_report_fits_the_terminal(
    columns: int,
    one_seed: Reproduced,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    # `test_json_has_the_agreed_keys` sees that the command makes the trials.
    study = "automaton.papers.reproduction_study.reproduce"
    monkeypatch.setattr(study, lambda *how, **more: one_seed)
    assert main(["reproduce", "traffic", "--seeds", "1", "--tables"]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= columns and "…" not in text
    words = " ".join(text.split())
    assert "900 trials, 0 unfinished; 1 seed of 100 trials for each case" in words
    assert "one seed gives no interval" not in text  # a hundred trials do
    before, after = text.split("Tables 1 to 4: what the network learns")
    assert "paper stored" in " ".join(after.split()) and " ours " not in after.split("claims")[0]
    assert " ours" in before and "stored" not in before
    assert "(77.6" in text or "77.6" in before  # the printed standard deviation


def test_there_are_no_strategies_to_choose(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "traffic", "--strategies", "astar"]) == 2
    assert "compares no strategies" in capsys.readouterr().err


def test_what_is_claimed_to_be_more_is_not_as_much() -> None:
    """Trials in which avoidance changes nothing bear out no claim that it does."""
    same = {"time": 200.0, "distance": 160.0, "encounters": 5.0, "taken": 0.0, "saved": 0.0}
    readings = [*READINGS, *((slowdown, *PLAIN_A_STAR) for slowdown in ("static", "dynamic"))]
    samples = {(name, key): [value] * 3 for key in readings for name, value in same.items()}
    judged = [judge(claim, samples, {}) for claim in TRAFFIC_CLAIMS]
    verdicts = {one.claim.text: one.verdict for one in judged if one is not None}
    for words in ("shortens the travel time", "shorter distance", "fewer zones", "saves 126.76"):
        found = {verdict for text, verdict in verdicts.items() if words in text}
        assert found == {"does not hold"}, words


def test_standard_deviations_stand_beside_the_printed_ones(ten_seeds: Reproduced) -> None:
    printed = {
        (A_STAR, "time"): 77.60,
        (A_STAR, "distance"): 46.96,
        (EXACT, "time"): 59.81,
        (EXACT, "distance"): 104.26,
        (EXACT, "saving"): 70.35,
    }
    for (key, metric), sd in printed.items():
        assert row(ten_seeds, key, metric).paper_sd == sd
    assert row(ten_seeds, EXACT, "encounters").paper_sd is None
    judged = verdicts(ten_seeds)
    [spread] = [one for text, one in judged.items() if text.startswith("Times spread by 77.60")][:1]
    assert spread.figures[0].value == pytest.approx(row(ten_seeds, A_STAR, "time").sd, rel=1e-3)


def test_more_than_a_closes_fewer_zones(ten_seeds: Reproduced) -> None:
    """As printed: fewer alternatives, and less is saved than by closing zones with A or more."""
    more_than = ("static", "more than A", "exact")
    assert row(ten_seeds, more_than, "taken").mean < row(ten_seeds, EXACT, "taken").mean
    assert row(ten_seeds, more_than, "time").mean > row(ten_seeds, EXACT, "time").mean
    assert max(paired(ten_seeds, more_than)) == 0
