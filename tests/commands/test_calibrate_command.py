"""`automaton calibrate` on the command line: bad input in a sentence, and pairs of models.

The page "Fit the model to your site" runs the whole way from a log to settings and a verdict.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from automaton.commands import main
from automaton.studies.model_pairs import Change, compare_pairs
from automaton.world.resolve import resolve

MESSAGES = "robot,time,x,y\n" + "".join(f"0,{second},{second}.5,0.5\n" for second in range(8))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("--out f.yaml", "calibrate needs a LOG, or --orders FILE"),
        ("{log} --out f.yaml", "a log needs --floor SCENARIO"),
        ("{log} --orders {log} --out f.yaml", "--orders is fitted without a LOG"),
        (
            "{log} --floor goods-mini --out f.yaml --actions lift=pick",
            "'lift' is not an operation; use pick, drop or handling",
        ),
        ("{log} --floor goods-mini --out f.yaml --pairs 1", "'1' is not a number of pairs, or 0"),
        ("{log} --floor goods-mini --out no/f.yaml", "there is no folder no"),
        ("{folder}/no.csv --floor goods-mini --out f.yaml", "no.csv"),
    ],
)
def test_bad_input_is_a_sentence(
    arguments: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.csv"
    log.write_text(MESSAGES)
    assert main(["calibrate", *arguments.format(log=log, folder=tmp_path).split()]) == 2
    assert sentence in capsys.readouterr().err


def test_a_missing_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "scipy", None)
    assert main(f"calibrate log.csv --floor goods-mini --out {tmp_path}/f.yaml".split()) == 2
    assert "pip install 'fleet-automaton[calibrate]'" in capsys.readouterr().err


def test_a_log_that_says_little_gives_no_settings_but_reasons(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = tmp_path / "log.csv", tmp_path / "f.yaml"
    log.write_text(MESSAGES)
    assert main(f"calibrate {log} --floor goods-mini --out {out} --pairs 0".split()) == 0
    assert "faults.mtbf: 0 of at least 10 breakdowns" in capsys.readouterr().out
    assert "Not fitted" in out.read_text() and out.read_text().endswith("{}\n")


def test_pairs_of_one_model_are_the_same_and_a_finer_tick_counts_in_the_same_time() -> None:
    model = resolve("tabletop-mini")
    same = compare_pairs(model, model, 2, 1)
    assert same["throughput"].value == 0 and not same["throughput"].matters
    finer = compare_pairs(model, resolve("tabletop-mini", ["refine=2"]), 2, 1)
    assert abs(finer["throughput"].value) < 0.2
    assert not Change(0.02, -0.01, 0.05).matters and Change(0.02, 0.01, 0.03).matters
