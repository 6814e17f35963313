"""What else `automaton size` answers: sure shares, most days, conditions, stations, kept runs."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from remembered_runs import remembered_runs
from statistics_trials import sure_days, synthetic

from automaton.commands import main
from automaton.documents.text_output import as_text
from automaton.errors import InputError
from automaton.studies.inference.proportions import (
    SureShare,
    bound_rank,
    confidence_sequence,
    expected_runs,
    fixed_runs,
    share_test,
)
from automaton.studies.sizing.fleet_runs import Fleets, in_ratio, read_mix
from automaton.studies.sizing.fleet_search import (
    FleetConfig,
    FleetRun,
    InfeasibleFleetError,
    Target,
    make_question,
)
from automaton.studies.sizing.sizing_figures import parking_document
from automaton.studies.sizing.sizing_report import answer_document, belief
from automaton.studies.sizing.sizing_session import ParkingSession, SizingSession
from automaton.world.resolve import resolve

HALL = """\
name: hall
layout:
  picture: |
    ============
    =pppp==pppp=
    ============
    =t===t===t==
    ============
fleet:
  robots: 3
  kinematics: omni
  types: [{name: slow, robots: 1, move_time_factor: 2}, {name: fast}]
durations: {handling: {visit: 10, line: {uniform: {from: 2, to: 14}}}}
orders: {lines: {count: 60, mean_interarrival_time: 20, per_order: {mean: 2}}}
strategy: {allocation: first-come, routing: shortest}
stop: {when: delivered, max_duration: 20000}
"""
ASKED = ["tabletop-mini", "--target", "makespan<=1800", "--robots", "1..3", "--workers", "1"]
QUICK = ["--success-share", "0.8", "--indifference", "0.15", "--alpha", "0.1"]


@pytest.fixture(scope="module", autouse=True)
def each_run_once() -> Iterator[None]:
    with remembered_runs():
        yield


@pytest.fixture
def hall(tmp_path: Path) -> str:
    path = tmp_path / "hall.yaml"
    path.write_text(HALL, encoding="utf-8")
    return str(path)


def size(capsys: Any, *arguments: str) -> tuple[int, str, str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "1000")  # nothing wraps
        code = main(["size", *arguments])
    out, err = capsys.readouterr()
    return code, out, err


def as_record(capsys: Any, *arguments: str) -> dict[str, Any]:
    code, out, err = size(capsys, *arguments, "--json")
    assert code in (0, 1), err
    record: dict[str, Any] = json.loads(out)
    return record


# A share that is shown for sure.


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0, 1), max_size=250), st.sampled_from([0.3, 0.87, 0.99]))
def test_a_fleet_passes_when_its_confidence_sequence_reaches_the_share(
    draws: list[float], share: float
) -> None:
    """The ratio of the test against the interval that the table shows, run by run."""
    outcomes, error = [draw < share for draw in draws], 0.2
    expected, met = ("undecided", len(outcomes)), 0
    for runs, good in enumerate(outcomes, 1):
        met += good
        seen = confidence_sequence(met, runs, 1 - error)
        assert seen.low is not None and seen.high is not None
        if seen.low >= share or seen.high < share:
            expected = ("meets" if seen.low >= share else "fails", runs)
            break
    assert SureShare(share, error).verdict(outcomes) == expected


def test_the_days_that_a_sure_share_takes_are_computed() -> None:
    """Against 206, 286, 598 and 1,615 by simulation; Wald's test 140, 292 and 601."""
    sure = expected_runs(SureShare(0.95, 0.01), [0.995, 0.99, 0.98, 0.97, 0.95], 6000)
    assert [round(one.runs) for one in sure[:4]] == [207, 289, 610, 1605]
    assert sure[4].undecided > 0.99
    wald = expected_runs(share_test(0.95, 0.02, 0.01), [0.99, 0.97, 0.95], 6000)
    assert [round(one.runs) for one in wald] == [139, 295, 606]


def test_the_days_that_are_computed_are_those_of_searches() -> None:
    test, rng = SureShare(0.9, 0.05), np.random.default_rng(3)
    runs = [test.verdict(rng.random(400) < 0.97)[1] for _ in range(2000)]
    [expected] = expected_runs(test, [0.97], 400)
    assert np.mean(runs) == pytest.approx(expected.runs, abs=4 * np.std(runs) / 2000**0.5)


def test_fixed_numbers_of_days_and_their_worst_ones() -> None:
    assert [fixed_runs(0.95, 0.01, misses) for misses in range(4)] == [90, 130, 165, 198]
    days = (89, 90, 200, 300, 500, 1000)
    assert [bound_rank(n, 0.95, 0.01) for n in days] == [0, 1, 4, 7, 14, 35]


def test_only_a_sure_share_is_called_at_least(capsys: Any) -> None:
    code, out, err = size(
        capsys, *ASKED, "--assure", "--success-share", "0.8", "--alpha", "0.1", "--budget", "200"
    )
    assert code == 0
    sentence = "With 2 robots makespan is 1,800 ticks or less on"
    assert f"{sentence} at least 80 % of days, with 90 % confidence\n" in out
    assert "There is no indifference zone" in out and "| required share" in out
    assert [line.split(": ")[1][:12] for line in err.splitlines()[:2]] == [
        "--assure",
        "without --as",
    ]
    assert re.search(r"a fixed number of days: \d+ without a miss, \d+ with one", err)
    _, out, err = size(capsys, *ASKED, *QUICK, "--budget", "200")
    assert f"{sentence} more than 65 % of days, with 90 % confidence\n" in out
    assert "at least" not in out and err == ""


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--assure", "--mean"], "--assure shows a share of days without a zone around it: omit --mean"),
        (["--assure", "--indifference", ".01"], "omit --indifference"),
        (
            ["--assure", "--alpha", "0.03", "--budget", "149"],
            "to show 95 % of days, a fleet needs 150 days without a miss (90 if their number were fixed)",
        ),
        (["--assure", "--success-share", "0.9999"], "a fleet needs 104,444 days without a miss"),
        (["--mix", "slow=1"], "--mix 'slow=1': no type is called 'slow'; fleet.types is empty"),
    ],
)  # fmt: skip
def test_what_cannot_be_shown_is_refused(capsys: Any, arguments: list[str], reason: str) -> None:
    code, out, err = size(capsys, *ASKED, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1) and reason in err


# What the answer reaches on most days.


def ranked(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
    """The makespan of replication r is 100 - r % 100, so the worst of any hundred is the first."""
    return [
        FleetRun(True, {"makespan": 100.0 - r % 100, "throughput": 1.0 + r % 100})
        for r in range(first, first + number)
    ]


@pytest.mark.parametrize(
    ("target", "sentence"),
    [
        (Target("makespan", True, 200.0), "with 1 robot makespan is 98 ticks or less"),
        (Target("throughput", False, 1.0, "/h", 0.5), "1 robot delivers 6 per hour or more"),
        (Target("makespan", True, 97.5), "with 1 robot makespan is 98 ticks or less"),
    ],
)
def test_most_days_are_bounded_by_one_of_the_worst(target: Target, sentence: str) -> None:
    session = SizingSession(
        make_question(target, (1, 1)), ranked, watch=lambda place, r: f"watch {place.size} {r}"
    )
    session.go()
    bound, [candidate] = session.bound, session.searches[0].candidates
    assert bound is not None and (bound.days, bound.rank) == (300, 7)
    assert bound.worst == next(r for r in range(candidate.after, 500) if r % 100 == 0)
    text = as_text(answer_document({"": session}, "made up", "", 0.0), 1000)
    assert f"On 95 % of days {sentence} (99 % confidence; the 7th " in text
    assert f"\nwatch 1 {bound.worst}\n" in text
    looser = "may be looser than makespan <= 97.5. It does not contradict the verdict"
    assert (looser in text) == (target.value == 97.5) and text.count("may be looser") < 2


def test_days_that_did_not_finish_are_the_worst() -> None:
    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        return [
            FleetRun(r < 200 or r % 20 > 0, {"makespan": 1.0}) for r in range(first, first + number)
        ]

    session = SizingSession(make_question(Target("makespan", True, 2.0), (1, 1)), run)
    session.go()
    assert session.bound is not None and (session.bound.value, session.bound.worst_value) == (
        None,
        None,
    )
    text = as_text(answer_document({"": session}, "made up", "", 0.0), 1000)
    assert (
        "On 95 % of days with 1 robot makespan has no bound, because too many runs did not" in text
    )


def test_the_worst_day_can_be_watched(capsys: Any) -> None:
    asked = [*ASKED, *QUICK, "--budget", "400", "--set", "durations.turn=21"]
    record = as_record(capsys, *asked)
    _, out, _ = size(capsys, *asked)
    [command] = [line for line in out.splitlines() if line.startswith("automaton watch")]
    seed = record["bound"]["worst"]
    assert command == (
        f"automaton watch tabletop-mini --seed {seed} --set durations.turn=21 --set fleet.robots=2"
    )
    settings = [word for word in command.split() if "=" in word]
    assert main(["run", "tabletop-mini", "--seed", str(seed), "--set", settings[0], "--set", settings[1],
                 "--json"]) == 0  # fmt: skip
    run = json.loads(capsys.readouterr().out)
    assert run["metrics"]["makespan"] == record["bound"]["worst_value"]


# Conditions.


def test_each_condition_has_the_answer_that_it_has_alone(capsys: Any, tmp_path: Path) -> None:
    file = tmp_path / "conditions.yaml"
    file.write_text(
        "- {name: calm}\n- {name: slow turns, set: {durations.turn: 28}}\n", encoding="utf-8"
    )
    asked = [*ASKED, *QUICK]
    budget = ("--budget", "400")
    both = as_record(capsys, *asked, "--conditions", str(file), "--budget", "800")["conditions"]
    assert [one.pop("name") for one in both] == ["calm", "slow turns"]
    alone = (
        as_record(capsys, *asked, *budget),
        as_record(capsys, *asked, *budget, "--set", "durations.turn=28"),
    )
    assert [one["robots"] for one in both] == [one["robots"] for one in alone] == [2, 3]
    for one, other in zip(both, alone, strict=True):
        assert one == {
            key: value for key, value in other.items() if key not in ("scenario", "seed")
        }
    code, out, _ = size(capsys, *asked, "--conditions", str(file), "--budget", "800")
    assert code == 0
    assert re.search(r"^calm +2 robots +\d+\.\d % .* ticks or less$", out, re.M)
    assert re.search(r"^slow turns +3 robots ", out, re.M)
    assert "Each condition is a search of its own: 90 % confidence holds for each answer" in out
    code, _, err = size(capsys, *asked, "--conditions", str(file), "--budget", "16")
    assert code == 2 and "each of 2 searches gets 8" in err


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("- {name: a, sett: {}}", ":1: unknown key 'sett'"),
        ("- {name: a, set: {durations.trun: 3}}", "(did you mean 'turn'?)"),
        ("", ": is empty; list the changes"),
        ("- {name: a}\n- {name: a}", ":2: the name 'a' appears twice (first in line 1)"),
        (
            "- {name: a}\n- {name: b, set: {fleet.robots: 2}}",
            ":2: 'b' sets fleet.robots, which varies",
        ),
        ("- {name: a, set: {durations.turn: 22}}", ":1: 'a' changes nothing"),
    ],
)
def test_a_list_of_conditions_is_checked(
    capsys: Any, tmp_path: Path, content: str, reason: str
) -> None:
    file = tmp_path / "conditions.yaml"
    file.write_text(content, encoding="utf-8")
    code, out, err = size(capsys, *ASKED, "--conditions", str(file))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert str(file) in err and reason in err


# Other quantities, and steps.


def test_sizes_in_steps_share_the_error_among_those_that_are_tested() -> None:
    run = synthetic([0.1] * 5 + [1.0] * 3, np.random.default_rng(1))
    session = SizingSession(make_question(Target("makespan", True, 0.0), (2, 9), step=3), run)
    session.go()
    assert session.question.candidates == 3 and session.question.last == 8
    assert [one.place.size for one in session.searches[0].candidates] == [2, 5, 8]
    assert session.gains[""].size == 8 and session.gains[""].effect is not None
    text = as_text(answer_document({"": session}, "made up", "", 0.0), 1000)
    assert "The last 3 robots (5 -> 8) change mean makespan by -" in text
    assert "Answer: 8 robots (5 are too few; 6 to 7 were not tried)\n" in text


def test_an_answer_in_steps_names_the_size_between_that_was_not_tried() -> None:
    for first, shares, said in (
        (6, [0.1, 1.0], "8 robots (6 are too few; 7 was not tried)"),
        (1, [0.1, 1.0], "3 robots (1 is too few; 2 was not tried)"),
        (6, [1.0, 1.0], "6 robots\n"),
    ):
        question = make_question(Target("makespan", True, 0.0), (first, first + 2), step=2)
        run = synthetic([shares[0]] * (first + 1) + shares[1:] * 2, np.random.default_rng(1))
        session = SizingSession(question, run)
        session.go()
        text = as_text(answer_document({"": session}, "made up", "", 0.0), 1000)
        assert f"Answer: {said}" in text


def test_a_fleet_that_passes_is_enough_even_if_smaller_ones_are_undecided() -> None:
    for budget, said in (
        (700, r"8 robots are enough; undecided from 5 to 7 \(5: \d+ of \d+ days meet the target; "),
        (200, r"undecided between 5 and 8, or more \(the budget is spent\)"),
    ):
        question = make_question(
            Target("makespan", True, 0.0), (2, 9), step=3, budget=budget, assure=True
        )
        run = synthetic([0.1] * 3 + [0.95] * 3 + [1.0] * 3, np.random.default_rng(1))
        session = SizingSession(question, run)
        session.go()
        text = as_text(answer_document({"": session}, "made up", "", 0.0), 1000)
        assert re.search(f"^Answer: {said}", text, re.M), text


def test_the_fewest_stations_that_meet_the_target(capsys: Any, hall: str) -> None:
    given = (
        hall,
        "--vary",
        "stations",
        "1..3",
        "--target",
        "lead_time_p95<=330",
        *QUICK,
        "--budget",
        "450",
        "--workers",
        "1",
    )
    record = as_record(capsys, *given)
    assert (record["varied"], record["stations"]) == ("floor.open_stations", 2)
    assert [one["verdict"] for one in record["answers"][0]["candidates"]] == [
        "fails",
        "meets",
    ]
    code, out, _ = size(capsys, *given)
    assert code == 0 and "hall: how many stations so that 80.0 % of runs have" in out
    assert (
        "Answer: 2 stations\nWith 2 stations lead_time_p95 is 330 ticks or less on more than" in out
    )
    assert "The last station (1 -> 2) changes mean lead_time_p95 by -" in out


def test_the_fewest_chargers_that_meet_the_target(capsys: Any, tmp_path: Path) -> None:
    file, battery = (
        tmp_path / "charged.yaml",
        "{drain: {move: 0.5, turn: 0, wait: 0.05}, charge_rate: 0.5, initial_charge: 60}",
    )
    charged = HALL.replace("=t===t===t==\n    ============", "=t===t===t==\n    c====c==c==c")
    charged = charged.replace("routing: shortest", "routing: shortest, charging: threshold")
    file.write_text(f"{charged}battery: {battery}\n", encoding="utf-8")
    options = (
        "--set",
        "fleet.robots=5",
        "--vary",
        "chargers",
        "1..4",
        "--step",
        "3",
        "--budget",
        "200",
        "--workers",
        "1",
    )
    record = as_record(capsys, str(file), *options, "--target", "lead_time_p95<=700", *QUICK)
    assert (record["varied"], record["chargers"]) == ("floor.open_chargers", 4)
    few, many = record["answers"][0]["candidates"]
    assert few["use"]["chargers"] > many["use"]["chargers"] > 0


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--vary", "statons", "1..2"], "--vary statons: cannot vary (did you mean 'stations'?)"),
        (["--vary", "stations", "1..9"], "--vary stations 9: floor.open_stations is 9, but"),
        (["--vary", "chargers", "2..1"], "--vary chargers '2..1': expected FIRST..LAST"),
        (["--vary", "stations", "1..2", "--robots", "1..2"], "size needs either --robots A..B, or"),
        ([], "size needs either --robots A..B, or"),
        (["--vary", "stations", "1..2", "--mix", "slow=1"], "--mix: the fleet stays as it is"),
        (["--robots", "3..4", "--mix", "slow:fst=1:2"], "no type is called 'fst' (did you mean 'fast'?)"),
        (["--robots", "3..4", "--mix", "slow:fast=1"], "give each type once and one number for each"),
        (["--robots", "3..4", "--mix", "many"], "expected TYPE=NUMBER or A:B=1:3"),
        (["--robots", "3..4", "--mix", "slow=5"], "none is left for fast"),
        (
            ["--robots", "4..5", "--set", "fleet.types=[{name: a, robots: 1}, {name: b, robots: 2}]"],
            "; for other fleet sizes use --mix, such as --mix a=1",
        ),
    ],
)  # fmt: skip
def test_what_varies_is_checked(capsys: Any, hall: str, options: list[str], reason: str) -> None:
    code, out, err = size(capsys, hall, "--target", "makespan<=4000", *options)
    assert (code, out, err.count("\n")) == (2, "", 1) and reason in err


def test_types_follow_the_size_of_the_fleet(hall: str) -> None:
    for mix, counts in (
        ("slow=2", [2, 5]),
        ("slow:fast=1:3", [2, 5]),
        ("fast : slow = 1 : 1", [4, 3]),
    ):
        mixed = read_mix(mix, resolve(hall).scenario.fleet)(7)
        numbers = [f"{key}={'null' if value is None else value}" for key, value in mixed.items()]
        assert resolve(hall, ["fleet.robots=7", *numbers]).scenario.fleet.counts == counts


@given(st.integers(0, 200), st.lists(st.integers(0, 9), min_size=1, max_size=4).filter(sum))
def test_a_ratio_is_kept_as_well_as_whole_robots_allow(number: int, parts: list[int]) -> None:
    counts = in_ratio(number, parts)
    assert sum(counts) == number
    assert all(
        abs(one - number * part / sum(parts)) < 1 for one, part in zip(counts, parts, strict=True)
    )


# Kept runs and progress.


def test_an_interrupted_search_goes_on_where_it_was(
    capsys: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    asked = [*ASKED, *QUICK, "--budget", "400"]
    whole = as_record(capsys, *asked)
    run, rounds, made = Fleets._run, 0, 0

    def counted(fleets: Fleets, resolved: Any, seeds: Any) -> list[FleetRun]:
        nonlocal rounds, made
        rounds, made = rounds + 1, made + len(seeds)
        if rounds in (4, 9):
            raise KeyboardInterrupt
        return run(fleets, resolved, seeds)

    monkeypatch.setattr(Fleets, "_run", counted)
    out = ("--out", str(tmp_path / "runs"))
    assert size(capsys, *asked, *out)[0] == 130
    rows = tmp_path / "runs" / "rows" / "size.jsonl"
    with rows.open("a", encoding="utf-8") as file:
        file.write('["cut off", tru')  # as a killed process leaves it
    assert size(capsys, *asked, *out)[0] == 130
    assert as_record(capsys, *asked, *out) == whole
    before, made = made, 0
    assert as_record(capsys, *asked, *out) == whole and made == 0 < before
    kinds = [line.startswith('["cut off') for line in rows.read_text("utf-8").splitlines()]
    assert kinds.count(True) == 1 and len(kinds) > 400 - 150
    assert as_record(capsys, *asked, *out, "--set", "durations.turn=21") != whole and made > 0


def test_a_folder_is_written_by_one_search_at_a_time(capsys: Any, tmp_path: Path) -> None:
    from automaton.studies.sizing.fleet_runs import kept_in

    with kept_in(tmp_path):
        code, _, err = size(capsys, *ASKED, "--out", str(tmp_path))
    assert code == 2 and "writes to this folder" in err
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError), kept_in(tmp_path / "file"):
        pass


def test_progress_has_the_present_belief(capsys: Any, monkeypatch: Any) -> None:
    lines: list[str] = []
    monkeypatch.setattr("automaton.commands.size_command.show_line", lines.append)
    assert size(capsys, *ASKED, *QUICK, "--budget", "400")[0] == 0
    assert lines[0] == "1 robot; 0 of at most 400 runs" and lines[-1] == ""
    assert any(
        re.fullmatch(r"2 robots: \d+ of \d+ days meet the target, undecided; \d+ of at most 400 runs",
                     line) for line in lines
    )  # fmt: skip
    assert "1 robot, durations -10 %" in [line.partition(";")[0] for line in lines]


def test_the_belief_about_a_mean_is_the_mean() -> None:
    session = SizingSession(
        make_question(Target("makespan", True, 90.0), (1, 1), mean=True), ranked
    )
    session.go()
    assert belief(session, FleetConfig(1)).startswith("1 robot: mean makespan 5")


# Parking a part of the fleet.

ACTIVE = "strategy.allocation.active"


def crowd(means: dict[str, float], alone: float = 0.0, spread: float = 2.0) -> Any:
    """A runner whose throughput depends on the limit of robots with orders; "": no limit.

    A fleet of another size than 40 has the mean `alone`; 0: it cannot be run.
    """

    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        if place.size != 40 and not alone:
            raise InfeasibleFleetError("40 starts are listed")
        mean = means[place.strategy.rpartition("=")[2]] if place.size == 40 else alone
        salt = place.size + len(means) * sum(map(ord, place.strategy))
        noise = [
            np.random.default_rng((r, salt)).normal(0, spread) for r in range(first, first + number)
        ]
        return [FleetRun(True, {"throughput": mean + one}) for one in noise]

    return run


def parked(run: Any, budget: int = 20_000) -> tuple[ParkingSession, str]:
    question = make_question(
        Target("throughput", False, 0.0),
        (10, 30),
        ("",),
        None,
        1.0,
        budget=budget,
        mean=True,
        step=10,
    )
    session = ParkingSession(question, 40, run)
    session.go()
    return session, as_text(parking_document(session, "crowd"), 1000)


def test_a_crowd_is_better_with_a_part_of_it_parked() -> None:
    session, text = parked(crowd({"10": 50.0, "20": 115.0, "30": 108.0, "": 100.0}, alone=120.0))
    assert session.limit == 20 and session.is_better
    better = (
        r"^Better with 20 of 40 robots parked: throughput \+1[45]\.\d % \(\+1[345]\.\d to \+1[56]"
    )
    assert re.search(better, text, re.M)
    assert "With a fleet of 20 robots, without parked ones: +" in text
    assert re.search(r"^20 +11[45]\.?\d* +200 +left$", text, re.M)
    assert session.best is not None and session.spent == sum(session.best.runs) + 3 * 60


@pytest.mark.parametrize("means", [(90.0, 95.0, 100.0, 100.0), (90.0, 95.0, 100.6, 100.0)])
def test_a_gain_below_the_zone_is_none(means: tuple[float, ...]) -> None:
    session, text = parked(crowd(dict(zip(("10", "20", "30", ""), means, strict=True)), spread=0.5))
    assert not session.is_better and "No number of parked robots is better by 1 %" in text
    if session.limit is not None:
        assert "With a fleet of 30 robots, without parked ones: 40 starts are listed" in text


def test_a_budget_that_separates_no_limits_leaves_it_undecided() -> None:
    session, text = parked(crowd(dict.fromkeys(("10", "20", "30", ""), 100.0), spread=20), 820)
    assert (
        session.best is not None
        and len(session.best.left) > 1
        and "Undecided: the budget is spent" in text
    )


def test_ctrl_c_prints_that_nothing_is_known_about_parking(capsys: Any, monkeypatch: Any) -> None:
    def interrupted(*_: Any) -> list[FleetRun]:
        raise KeyboardInterrupt

    monkeypatch.setattr(Fleets, "_run", interrupted)
    code, out, _ = size(
        capsys, "random-400", "--vary", ACTIVE, "100..300", "--set", "measure.warm_up=5"
    )
    assert code == 130 and "Undecided: " in out


def test_a_crowd_that_jams_is_not_compared() -> None:
    runs = crowd({"10": 100.0, "20": 110.0, "30": 100.0, "": 120.0}, alone=90.0)

    def run(place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        jammed = not place.strategy and place.size == 40
        return [one._replace(finished=not jammed) for one in runs(place, first, number)]

    _, text = parked(run)
    assert "Not compared, since runs did not finish: all with orders" in text
    assert "No number of parked robots is better" in text and "not comparable" in text


def test_few_days_give_a_bound_if_they_are_enough() -> None:
    for budget, days in ((150, None), (200, 130), (1000, 300)):
        question = make_question(Target("makespan", True, 200.0), (1, 1), budget=budget)
        session = SizingSession(question, ranked)
        session.go()
        assert (session.bound and session.bound.days) == days


def test_the_command_compares_numbers_of_robots_with_orders(capsys: Any) -> None:
    given = ("random-400", "--set", "fleet.robots=10", "--set", "stop.max_duration=40", "--set",
             "measure.warm_up=10", "--vary", ACTIVE, "5..10", "--step", "5",
             "--workers", "1")  # fmt: skip
    code, out, _ = size(capsys, *given)
    assert code == 0
    assert "how many of 10 robots should have orders for the highest throughput?" in out
    assert "No number of parked robots is better by 1 %" in out
    assert re.search(r"^all +\S+ +\d+ +left$", out, re.M) and not re.search(r"^10 ", out, re.M)
    record = as_record(capsys, *given, "--target", "lead_time")
    assert (record["metric"], record["varied"], record["robots"]) == ("lead_time", ACTIVE, 10)


@pytest.mark.parametrize(
    ("scenario", "options", "reason"),
    [
        ("tabletop-mini", [], "allocation cooperative cannot limit the number of robots with an order; "),
        ("random-400", ["--set", "fleet.robots=5"], "the fleet has 5 robots, so no more can have orders"),
        ("random-400", ["--target", "throughpt"], "is better high or low (did you mean 'throughput'?)"),
        ("random-400", ["--target", "robots"], "expected a metric that is better high or low"),
        ("random-400", ["--assure"], f"--assure: --vary {ACTIVE} compares means; omit it"),
        ("random-400", ["--strategies", "greedy"], f"--strategies: --vary {ACTIVE} compares means"),
        ("random-400", ["--budget", "1300"], "the first stage takes 1,400 runs; a larger --step has"),
    ],
)  # fmt: skip
def test_what_cannot_be_parked_is_refused(
    capsys: Any, scenario: str, options: list[str], reason: str
) -> None:
    code, out, err = size(capsys, scenario, "--vary", ACTIVE, "5..10", *options)
    assert (code, out, err.count("\n")) == (2, "", 1) and reason in err


def test_bad_days_of_a_real_scenario_keep_their_promises() -> None:
    """The trial `days` in small."""
    assert sure_days(60, 1500, 300, 1)
