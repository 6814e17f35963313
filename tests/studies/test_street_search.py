"""The search for streets: what it varies, that it can be resumed, and how its result is tested."""

from __future__ import annotations

import argparse
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from streets_trials import crowd
from sweep_studies import OwnThread, interrupting

from automaton.commands import main, streets_command, sweep_command
from automaton.floor.floor_plan import WEIGHT_UNIT
from automaton.scenario.street_files import street_table, streets_of_text
from automaton.scenario.streets import StreetWeights, streets_on
from automaton.studies.street_search import evolution, finishing, verdict
from automaton.studies.street_search.candidates import CANDIDATES_FILE
from automaton.studies.street_search.design_runs import with_design
from automaton.studies.street_search.designs import StreetDesign, stretches
from automaton.studies.street_search.evolution import (
    ROWS,
    STRETCHES,
    UNCHANGED,
    NamedDesign,
    SearchQuestion,
    Stage,
    crisscross,
    design_of,
)
from automaton.studies.street_search.street_output import write_scenario, write_streets
from automaton.studies.sweeps import pools
from automaton.studies.sweeps.run_keys import seed_of
from automaton.world.resolve import resolve

RING = "#########\n#.......#\n#.#####.#\n#.......#\n#########"
RUNS = 34  # of the small search


class TwoThreads(OwnThread):
    """Runs of two designs at the same time."""

    def __init__(self, workers: int | None = None) -> None:
        pools.ExternalExecutor.__init__(self, ThreadPoolExecutor(2))


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few runs in every part of a search, in this process."""
    small = {"START_RUNS": 2, "FIRST_POPULATION": 4, "POPULATION": 4, "FULL_SEARCH": 1}
    for name, value in small.items():
        monkeypatch.setattr(evolution, name, value)
    monkeypatch.setattr(verdict, "SELECT_RUNS", 2)
    monkeypatch.setattr(verdict, "HELD_OUT_PAIRS", 3)
    monkeypatch.setattr(verdict, "FLEET_SHARES", (1.0,))
    for name in ("SELECT_RUNS_EACH", "REASON_PAIRS", "LOSS_PAIRS"):
        monkeypatch.setattr(finishing, name, 2)
    monkeypatch.setattr(pools, "LocalPool", OwnThread)


def searched(folder: Path, *options: str, name: str = "out") -> dict[str, Any]:
    """The JSON of a small search, and the contents of its files."""
    scenario = folder / "crowd.yaml"
    scenario.write_text(json.dumps(crowd()))
    out = folder / name
    code = main(["streets", str(scenario), "--out", str(out), "--runs", str(RUNS), *options])
    files = ("streets.csv", CANDIDATES_FILE, "report.txt")
    return {"code": code} | {one: (out / one).read_text() for one in files if (out / one).exists()}


def question(**more: Any) -> SearchQuestion:
    usual: dict[str, Any] = {"metric": "throughput", "is_higher_better": True, "robots": (None,)}
    return SearchQuestion(**{**usual, "seed": 1, "runs": 3000, "detail": STRETCHES, **more})


def test_stretches_end_at_obstacles() -> None:
    floor_plan = resolve(crowd(RING)).floor_plan
    found = [[floor_plan.xy(cell) for cell in one.cells] for one in stretches(floor_plan)]
    assert [(one[0], one[-1], len(one)) for one in found] == [
        ((1, 1), (7, 1), 7),
        ((1, 3), (7, 3), 7),
        ((1, 1), (1, 3), 3),
        ((7, 1), (7, 3), 3),
    ]


def test_shelf_blocks_have_635_numbers() -> None:
    layout = {"generator": "shelf-blocks", "columns": 36, "rows": 33, "block": 10}
    floor_plan = resolve({**crowd(), "layout": layout}).floor_plan
    usual = StreetWeights(floor_plan)
    design = StreetDesign(usual.moves, usual.waits, usual.closed)
    numbers = [len(Stage(one, floor_plan, design).numbers(design)) for one in (ROWS, STRETCHES)]
    assert numbers == [139, 635]


def test_a_number_is_the_logarithm_of_the_weights_of_a_row() -> None:
    floor_plan = resolve(crowd(RING)).floor_plan
    usual = StreetWeights(floor_plan)
    usual.closed[floor_plan.cell(3, 1), 0] = True
    as_it_is = StreetDesign(usual.moves, usual.waits, usual.closed)
    stage = Stage(ROWS, floor_plan, as_it_is)
    numbers = np.linspace(-1, 1, len(stage.groups) + 1)
    design = stage.design(numbers)
    first = [design.moves[floor_plan.cell(x, 1), 0] for x in range(1, 7)]
    assert first == [37, 37, WEIGHT_UNIT, 37, 37, 37]  # 100 / e; a closed move has no number
    assert (design.waits == 272).all() and design.closed[floor_plan.cell(3, 1), 0]
    assert np.allclose(stage.numbers(design), numbers, atol=0.02)


def test_closed_moves_and_weights_of_a_design_are_read_back() -> None:
    floor_plan = resolve(crowd(RING)).floor_plan
    weights = streets_on(floor_plan, None)
    weights.moves[floor_plan.cell(2, 1), 0], weights.waits[floor_plan.cell(7, 3)] = 37, 272
    weights.closed[floor_plan.cell(3, 1), 2] = True
    cells = np.flatnonzero(floor_plan.drivable)
    at = [floor_plan.xy(cell) for cell in cells]
    names = ("east", "south", "west", "north")
    moves, waits = weights.moves[cells] / WEIGHT_UNIT, weights.waits[cells] / WEIGHT_UNIT
    text = street_table(names, moves, waits, at, "", weights.closed[cells])
    assert text.splitlines()[1:] == ["2,1,0.37,,,,", "3,1,,,closed,,", "7,3,,,,,2.72"]
    read = streets_on(floor_plan, streets_of_text(text, floor_plan)[0])
    assert (read.moves == weights.moves).all() and (read.closed == weights.closed).all()


@pytest.mark.usefixtures("small")
def test_a_search_is_repeatable_and_resumable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = searched(tmp_path)
    assert "streets.csv" in whole and whole["code"] in (0, 1)
    rows = sweep_command.Listener.rows
    monkeypatch.setattr(sweep_command.Listener, "rows", interrupting(rows, 17))
    assert searched(tmp_path, name="cut")["code"] == 130
    monkeypatch.setattr(sweep_command.Listener, "rows", rows)
    log = tmp_path / "cut" / CANDIDATES_FILE
    assert len(log.read_text().splitlines()) < len(whole[CANDIDATES_FILE].splitlines())
    monkeypatch.setattr(pools, "LocalPool", TwoThreads)
    resumed = searched(tmp_path, name="cut")
    assert resumed["streets.csv"] == whole["streets.csv"]
    assert resumed[CANDIDATES_FILE] == whole[CANDIDATES_FILE]

    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join([*lines[:2], lines[2][:40]]))
    capsys.readouterr()
    assert searched(tmp_path, name="cut") == resumed
    assert "goes on from generation 2" in capsys.readouterr().err


@pytest.mark.usefixtures("small")
def test_the_folder_has_the_scenario_with_its_streets(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = searched(tmp_path, "--json")
    answer = json.loads(capsys.readouterr().out)
    resolved = resolve(tmp_path / "out" / "crowd-streets.yaml")
    assert len(resolved.floor_plan.move_weights) and found["code"] == (not answer["is_gain"])
    own = [one for one in answer["fleets"] if one["asked"]]
    assert [one["robots"] for one in own] == [8] and own[0]["pairs"] == 3
    assert own[0]["beside"]["detour_share"] > 0


@pytest.mark.usefixtures("small")
def test_the_gain_is_that_of_seeds_that_nothing_was_chosen_by(tmp_path: Path) -> None:
    seeds: dict[str, set[int]] = {}

    def runs(designs: Any, of: Any, robots: int | None = None) -> list[list[dict[str, Any]]]:
        seeds.setdefault(phase, set()).update(of)
        return [
            [{"throughput": float(d.moves[0, 0] + s % 7), "error": None, "finished": True}
             for s in of]
            for d in designs
        ]  # fmt: skip

    def design(weight: int) -> StreetDesign:
        return StreetDesign(
            np.full((9, 4), weight), np.full(9, WEIGHT_UNIT), np.zeros((9, 4), np.bool_)
        )

    asked = question(runs=RUNS)
    phase = "choice"
    finalists = [NamedDesign(str(number), design(100 + number)) for number in (0, 3, 9, 2)]
    assert verdict.choose(asked, finalists, runs).place == 2
    phase = "verdict"
    judged = verdict.judge(asked, design(100), design(110), runs, 8, True)
    assert judged.gain is not None and judged.gain.difference.value == 10
    searches = {seed_of(f"1 {phase} {r}") for phase in ("search", "start") for r in range(999)}
    assert not seeds["choice"] & seeds["verdict"] and not searches & seeds["verdict"]


def test_a_design_whose_runs_do_not_finish_is_never_chosen() -> None:
    def runs(designs: Any, of: Any, robots: int | None = None) -> list[list[dict[str, Any]]]:
        return [
            [{"throughput": 9.0 * number, "error": None, "finished": number < 1} for _ in of]
            for number, _ in enumerate(designs)
        ]

    none = StreetDesign(
        np.full((1, 4), WEIGHT_UNIT), np.full(1, WEIGHT_UNIT), np.zeros((1, 4), np.bool_)
    )
    finalists = [NamedDesign(UNCHANGED, none), NamedDesign("jams", none)]
    assert verdict.choose(question(), finalists, runs).place == 0
    judged = verdict.judge(question(), none, none, runs, 8, True)
    assert judged.gain is None and not judged.is_gain(True)


@pytest.mark.parametrize(
    ("changed", "options", "told"),
    [
        ({"fleet": {"robots": 1, "kinematics": "omni", "start": "random"}}, [], "two robots"),
        ({"orders": {"list": []}}, [], "must hold at least one order"),
        ({}, ["--runs", "95"], "the 40 runs of the start designs and two generations take 96 runs"),
        ({}, ["--robots", "1"], "'1' is not a number of robots: allowed are 2 to"),
        ({}, ["--metric", "throughputs"], "did you mean 'throughput'"),
        ({}, ["--metric", "orders"], "neither direction is better"),
        ({}, ["--detail", "cells"], "invalid choice: 'cells'"),
    ],
)
def test_input_errors_are_a_sentence(
    changed: dict[str, Any],
    options: list[str],
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    scenario = tmp_path / "crowd.yaml"
    scenario.write_text(json.dumps({**crowd(), **changed}))
    assert main(["streets", str(scenario), "--out", str(tmp_path / "o"), *options]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1 and not (tmp_path / "o").exists()


@pytest.mark.usefixtures("small")
def test_a_folder_of_another_search_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    searched(tmp_path)
    capsys.readouterr()
    for options, told in (
        (["--runs", str(RUNS + 8)], f"a search with --runs {RUNS}, not {RUNS + 8}"),
        (["--detail", "rows"], "a search with --detail stretches, not rows"),
        (["--seed", "2"], "a study with seed 1, not 2"),
        (["--set", "fleet.robots=9"], "other scenarios"),
    ):
        assert searched(tmp_path, *options)["code"] == 2
        error = capsys.readouterr().err
        assert told in error and "--recompute" in error
    assert searched(tmp_path, "--detail", "rows", "--recompute")["code"] in (0, 1)


def test_the_package_that_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "cmaes", None)
    assert main(["streets", "tabletop-mini", "--out", str(tmp_path / "o")]) == 2
    assert "pip install 'fleet-automaton[optimize]'" in capsys.readouterr().err


def test_a_forecast_says_how_many_cores_are_of_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(pools, "LocalPool", OwnThread)
    scenario = tmp_path / "crowd.yaml"
    scenario.write_text(json.dumps(crowd()))
    assert main(["streets", str(scenario), "--out", str(tmp_path / "o"), "--runs", "200",
                 "--workers", "2", "--dry-run"]) == 0  # fmt: skip
    told = capsys.readouterr().out
    assert "generations 4 x 24 (rows) and 2 x 32 (stretches)" in " ".join(told.split())
    assert "uses at most 32 cores" in " ".join(told.split()) and "2 workers" in told


def test_rules_of_streets_stay_in_the_search_and_in_its_result(tmp_path: Path) -> None:
    """The scenario as it is has its closed and open moves and its capacities; so has the result."""
    rules = [
        {"row": 1, "columns": [3, 5], "west": "closed"},
        {"at": [4, 3], "west": "open", "capacity": 2},
        {"row": 3, "east": 0.5},
    ]
    ring = RING.replace("#.......#\n#########\n", "#..>>...#\n#########\n")
    scenario = tmp_path / "crowd.yaml"
    scenario.write_text(json.dumps({**crowd(ring), "streets": rules}))
    parser = argparse.ArgumentParser()
    streets_command.add_arguments(parser)
    parser.set_defaults(refine=None, decide=None)
    asked = streets_command.asked_of(parser.parse_args([str(scenario), "--out", str(tmp_path)]))
    base, as_given = asked.base(None), asked.resolved.floor_plan
    assert with_design(base, asked.as_it_is).floor_plan == as_given
    design = crisscross(base.floor_plan, (0, 0), asked.as_it_is)
    design.closed[as_given.cell(2, 3), 0] = True
    then = write_streets(tmp_path, asked.drawn.floor_plan, base.floor_plan, design)
    path = tmp_path / "crowd-streets.yaml"
    write_scenario(path, str(scenario), [streets_command.rule_of(base)], then)
    assert resolve(path).floor_plan == with_design(base, design).floor_plan


def test_a_design_without_weights_is_read_back(tmp_path: Path) -> None:
    floor_plan = resolve(crowd(RING)).floor_plan
    assert not write_streets(tmp_path, floor_plan, floor_plan, design_of(floor_plan))
    assert streets_of_text((tmp_path / "streets.csv").read_text(), floor_plan) == ((), [])


def test_guidance_that_replaces_weights_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / "crowd.yaml"
    scenario.write_text(json.dumps(crowd()))
    lattice = "strategy.right_of_way={name: pibt, guidance: lattice}"
    assert main(["streets", str(scenario), "--out", str(tmp_path / "o"), "--set", lattice]) == 2
    assert "its lattice weights would replace those of streets" in capsys.readouterr().err
