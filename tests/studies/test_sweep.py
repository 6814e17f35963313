"""Many runs into a folder: whoever does them, and whatever goes wrong, each row is there once."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from sweep_studies import OwnThread, environment, plain, row_files, small_study, swept_here

from automaton import simulate, sweep
from automaton.commands import main
from automaton.documents.report_document import Table
from automaton.errors import InputError
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.simulation import Simulation
from automaton.studies.reports.build_report import compose
from automaton.studies.reports.study_results import read_results
from automaton.studies.sweeps import pools, run_keys, sweep_session
from automaton.studies.sweeps.result_store import Store
from automaton.studies.sweeps.study import RESULT_COLUMNS, Study
from automaton.studies.sweeps.sweep_plan import make_sweep_plan
from automaton.world.resolve import resolve


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the results of the small study, by one process."""
    folder = tmp_path_factory.mktemp("swept")
    assert (
        main(["sweep", str(small_study(folder)), "--out", str(folder / "out"), "--workers=1"]) == 0
    )
    return folder / "out"


def test_rows_are_those_of_single_runs(swept: Path) -> None:
    table = Store(swept).rows()
    assert table.column_names[:6] == list(RESULT_COLUMNS)[:6]
    assert table.column_names[6:8] == ["fleet.robots", "strategy.allocation"]
    assert {*RESULT_COLUMNS, *METRIC_CATALOGUE} <= set(table.column_names)
    rows = table.to_pylist()
    assert len(rows) == len({row["key"] for row in rows}) == 24
    for row in rows[::5]:
        allocation = f"strategy.allocation={row['strategy.allocation']}"
        robots = f"fleet.robots={row['fleet.robots']}"
        run = Simulation(resolve("tabletop-mini", [robots, allocation]), row["seed"])
        run.run()
        assert (run.digest, run.tick) == (row["digest"], row["ticks"])
        assert row["finished"] and row["error"] is None and row["delivered"] == row["orders"] == 25
        assert row["makespan"] == row["ticks"] and row["wall_s"] > 0 and row["cpu_s"] > 0
        assert row["lead_time"] is None  # not every run has it; the column is there all the same


def test_each_replication_has_the_same_seed_at_every_point(swept: Path) -> None:
    seeds: dict[int, set[int]] = {}
    for row in Store(swept).rows().to_pylist():
        seeds.setdefault(row["replication"], set()).add(row["seed"])
    assert len(seeds) == 6 and all(len(found) == 1 for found in seeds.values())
    assert len({seed for found in seeds.values() for seed in found}) == 6


def test_without_common_random_numbers_all_seeds_differ(tmp_path: Path) -> None:
    study = small_study(tmp_path, seed=1, **{"seed: 1": "common_random_numbers: false"})
    runs = list(make_sweep_plan(study).manifest.runs())
    assert len({run.seed for run in runs}) == len({run.key for run in runs}) == 24


def test_two_processes_and_threads_give_the_same_rows(swept: Path, tmp_path: Path) -> None:
    expected = plain(Store(swept).rows())
    study = small_study(tmp_path)
    assert main(["sweep", str(study), "--out", str(tmp_path / "two"), "--workers", "2"]) == 0
    assert plain(Store(tmp_path / "two").rows()) == expected
    with ThreadPoolExecutor(2) as executor:
        assert plain(sweep(study, executor=executor)) == expected
        assert executor.submit(int).result() == 0  # left open


def test_what_is_done_is_not_done_again(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files, times = row_files(swept), Store(swept).rows().column("wall_s")
    study = small_study(tmp_path)
    assert main(["sweep", str(study), "--out", str(swept), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["runs"], told["existing"], told["done"]) == (24, 24, 0)
    assert row_files(swept) == files and Store(swept).rows().column("wall_s") == times
    assert sorted(path.name for path in swept.iterdir()) == [
        ".lock",
        "rows",
        "study.yaml",
        "sweep.json",
    ]


def test_more_replications_keep_those_that_are_done(tmp_path: Path) -> None:
    few = swept_here(small_study(tmp_path, 2), tmp_path / "out")
    more = swept_here(small_study(tmp_path, 3), tmp_path / "out")
    assert (few.num_rows, more.num_rows) == (8, 12)
    assert set(few.column("wall_s").to_pylist()) < set(more.column("wall_s").to_pylist())
    with pytest.raises(InputError, match="holds 3 replications; the study asks for fewer"):
        swept_here(small_study(tmp_path, 2), tmp_path / "out")


def test_other_code_is_refused_and_recomputed_on_demand(
    swept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    study, out = small_study(tmp_path, 1), tmp_path / "out"
    now = run_keys.sources_of()
    before = {**now, "automaton/runs/metrics.py": "0" * 16, "strategies/gone.py": "1" * 16}
    monkeypatch.setattr(run_keys, "sources_of", lambda plugins: before)
    plan = make_sweep_plan(study)
    out.joinpath("rows").mkdir(parents=True)
    sweep_session.write_manifest(out, plan.manifest)
    monkeypatch.undo()
    assert main(["sweep", str(study), "--out", str(out), "--workers", "1"]) == 2
    said = capsys.readouterr().err
    assert (
        "holds results of other code: automaton/runs/metrics.py changed, strategies/gone.py is gone"
        in said
    )
    assert "--recompute" in said and said.count("\n") == 1
    assert swept_here(study, out, recompute=True).num_rows == 4


def test_after_another_order_of_points_each_row_is_of_its_own_point(tmp_path: Path) -> None:
    """Keys hold no point: rows that are there belong to the points of the study as it is now."""
    study, out = small_study(tmp_path, 3), tmp_path / "out"
    swept_here(study, out)
    text = study.read_text()
    for before, after in [
        ("[1, 2]", "[2, 1]"),
        ("  fleet.robots: [1, 2]\n", "  durations.turn: [22, 5]\n  fleet.robots: [2, 1, 3]\n"),
        ("name: small", "name: other"),
    ]:
        study.write_text(text.replace(before, after))
        fresh = plain(swept_here(study, tmp_path / after.replace(" ", "").strip()))
        assert plain(swept_here(study, out, recompute=True)) == fresh
        assert plain(Store(out).rows()) == fresh


def test_rows_of_other_code_are_never_taken_for_these(swept: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    study = small_study(tmp_path)
    (out / "rows").mkdir(parents=True)
    for path in row_files(swept):
        (out / "rows" / path.name).write_bytes(path.read_bytes())
    plan = make_sweep_plan(study)
    sweep_session.write_manifest(out, plan.manifest)
    assert Store(out).rows().num_rows == 24
    other = plan.manifest.__class__(**{**manifest_fields(plan.manifest), "sources": {"a": "b"}})
    sweep_session.write_manifest(out, other)
    assert Store(out).rows().num_rows == 0 and Store(out).keys() == set()


def manifest_fields(manifest: run_keys.Manifest) -> dict[str, object]:
    return {name: getattr(manifest, name) for name in manifest.__struct_fields__}


def test_plug_ins_count_as_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    plug_in = tmp_path / "own_allocation.py"
    text = "from sweep_studies import Raises\n\n\nclass Own(Raises):\n    pass\n"
    plug_in.write_text(text)
    study = tmp_path / "own.yaml"
    study.write_text(
        "name: own\nscenario: tabletop-mini\nreplications: 1\n"
        "points: [{strategy.allocation: 'own_allocation:Own'}]\n"
    )
    before = make_sweep_plan(study).manifest
    plug_in.write_text(text + "# changed\n")
    now = make_sweep_plan(study).manifest
    assert before.points == now.points and before.keys().isdisjoint(now.keys())
    assert sweep_session.difference(before, now).endswith(": own_allocation.py changed")


def test_another_study_seed_point_or_floor_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    floor = tmp_path / "floor.txt"
    floor.write_text("b.$.d\nb....\n#....\n")
    scenario = tmp_path / "own.yaml"
    scenario.write_text(
        "name: own\nlayout: {file: floor.txt}\nfleet: {robots: 1}\norders: {generator: picture-loads}\n"
    )
    text = "name: one\nscenario: own.yaml\nfactors: {fleet.robots: [1, 2]}\nreplications: 1\n"
    study, out = tmp_path / "one.yaml", tmp_path / "out"
    study.write_text(text)
    assert swept_here(study, out).num_rows == 2
    for before, after, said in [
        ("name: one", "name: two", "of the study 'one', not of 'two'"),
        ("replications: 1", "replications: 1\nseed: 2", "with seed 1, not 2"),
        (
            "[1, 2]",
            "[2, 1]",
            "point 0 was own.yaml, fleet.robots 1 and is now own.yaml, fleet.robots 2",
        ),
        ("[1, 2]", "[1]", "holds results of 2 points, not 1"),
    ]:
        study.write_text(text.replace(before, after))
        with pytest.raises(InputError, match=said):
            swept_here(study, out)
    study.write_text(text)
    floor.write_text("b.$.d\nb....\n#...s\n")
    with pytest.raises(
        InputError, match=r"own.yaml, fleet.robots 1 has changed \(its file, its floor"
    ):
        swept_here(study, out)


def test_a_changed_analysis_is_told_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study, out = small_study(tmp_path, 1), tmp_path / "out"
    assert swept_here(study, out).num_rows == 4
    study.write_text(study.read_text() + "analysis: {metrics: [makespan]}\n")
    assert main(["sweep", str(study), "--out", str(out), "--workers", "1"]) == 0
    assert "has changed since 4 runs were made" in capsys.readouterr().err
    assert [one.analysis for one in Store(out).manifest.earlier] == [None]
    assert main(["sweep", str(study), "--out", str(out), "--workers", "1"]) == 0
    assert capsys.readouterr().err == ""


def test_runs_that_are_added_and_another_warm_up_are_kept_in_mind(tmp_path: Path) -> None:
    study, out = tmp_path / "steady.yaml", tmp_path / "out"
    text = (
        "name: steady\nscenario: tabletop-mini\nreplications: {}\ndesign: steady-state\n{}"
        "window: 15\npoints: [{{stop.when: never, stop.max_duration: 999}}]\n"
        "analysis: {{metrics: [operations]}}\n"
    )
    told = []
    for replications, warm_up in ((5, "warm_up: mser-5\n"), (6, "warm_up: mser-5\n"), (6, "")):
        study.write_text(text.format(replications, warm_up))
        swept_here(study, out)
        found = read_results(Store(out))
        told.append((found.earlier, list(found.raised)))
    assert told == [(0, []), (0, [5]), (1, [5])]
    (row,) = (row for table in design_tables(out) for row in table.rows if row[0] == "runs")
    assert "raised from 5 after runs had been made" in row[1]
    # Begun again, but the same runs count: what was declared before is not forgotten.
    swept_here(study, out, recompute=True)
    assert len(Store(out).manifest.earlier) == 2


def design_tables(out: Path) -> list[Table]:
    return [block for block in compose(Store(out)).blocks if isinstance(block, Table)]


def test_a_dry_run_tells_what_it_would_take_and_writes_nothing(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study, out = small_study(tmp_path), tmp_path / "out"
    assert main(["sweep", str(study), "--out", str(out), "--dry-run", "--workers", "3"]) == 0
    text = capsys.readouterr().out
    assert "small: 4 points x 6 replications = 24 runs\n" in text
    assert "with 3 workers" in text and "by 4 pilot runs" in text and "disk: " in text
    assert " to start; " in text  # what starting and loading takes is part of the time
    assert not out.exists()
    monkeypatch.setattr(pools, "LocalPool", OwnThread)
    assert main(["sweep", str(study), "--out", str(swept), "--dry-run", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["runs"], found["done"], found["wall_s"], found["bytes"]) == (24, 24, 0, 0)


def test_a_dry_run_counts_what_recompute_would_leave_as_it_is(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools, "LocalPool", OwnThread)
    study = small_study(tmp_path)
    study.write_text(study.read_text().replace("[1, 2]", "[2, 3]"))
    command = ["sweep", str(study), "--out", str(swept), "--dry-run", "--json"]
    told = []
    for options in ([], ["--recompute"]):
        assert main([*command, *options]) == 0
        told.append(json.loads(capsys.readouterr().out)["done"])
    assert told == [0, 12]


def test_studies_and_single_runs_from_python(tmp_path: Path) -> None:
    study = Study(
        name="python",
        scenario="tabletop-mini",
        listed=({"fleet.robots": 1}, {"fleet.robots": 2, "durations.turn": 5}),
        replications=1,
    )
    table = swept_here(study)
    assert table.column("durations.turn").to_pylist() == [None, 5]
    row = table.to_pylist()[1]
    outcome = simulate("tabletop-mini", row["seed"], fleet__robots=2, **{"durations.turn": 5})
    assert outcome.digest == row["digest"]
    for workers in (-1, 0, 1025):
        with pytest.raises(InputError, match=f"workers must be from 1 to 1,024, found {workers}"):
            sweep(study, workers=workers)
    with pytest.raises(InputError, match="did you mean 'robots'"):
        simulate("tabletop-mini", fleet__robot=2)


def test_steady_states_keep_a_series_of_deliveries(tmp_path: Path) -> None:
    study = tmp_path / "steady.yaml"
    study.write_text(
        "name: steady\nscenario: tabletop-mini\nreplications: 2\ndesign: steady-state\n"
        "warm_up: 100\nwindow: 50\npoints: [{stop.when: never, stop.max_duration: 999}]\n"
    )
    table = swept_here(study)
    row = table.to_pylist()[0]
    after = sum(row["sums"]["delivered"]) - sum(row["series"][:2])  # the warm-up has two windows
    assert after == row["delivered"] and row["sums"]["charge"] is None
    assert len(row["sums"]["moves"]) == 4  # stretches of five windows, the last ends with the run
    assert len(row["series"]) == 19 and sum(row["series"][2:]) <= row["delivered"]
    assert row["finished"] and row["throughput_per_robot"] is not None  # measured after the warm-up


@pytest.mark.parametrize("command", ["sweep", "what-if", "bottlenecks"])
def test_without_pyarrow_a_sentence_comes_before_any_scenario_is_read(command: str) -> None:
    files = ["no-such-file.yaml"] * (2 if command == "what-if" else 1)
    code = (
        "import sys; sys.modules['pyarrow'] = None; from automaton.commands import main; "
        f"sys.exit(main([{command!r}, *{files!r}, '--out', 'o']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment()
    )
    assert done.returncode == 2 and "fleet-automaton[experiments]" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "--out DIR is missing"),
        (("--out", "x", "--workers", "0"), "'0' is not a number of processes"),
        (
            ("--out", "x", "--workers", "2", "--scheduler", "tcp://a:1"),
            "leave it out with --scheduler",
        ),
        (("--dry-run", "--scheduler", "tcp://a:1"), "leave --scheduler out"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    arguments: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", str(small_study(tmp_path)), *arguments]) == 2
    assert said in capsys.readouterr().err
