"""Tables as files: equal figures in every form, whole groups of stopped runs, what is refused."""

from __future__ import annotations

import builtins
import json
import statistics
from pathlib import Path
from typing import Any

import openpyxl
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest

from automaton import simulate
from automaton.commands import main
from automaton.errors import InputError
from automaton.python_api import settings_of
from automaton.runs.headless import run_once
from automaton.runs.simulation import Simulation
from automaton.tables import columns, table_files
from automaton.tables.columns import TABLES
from automaton.tables.table_run import WantedTables, period_of, table_run
from automaton.world.resolve import resolve

RUN = ["run", "tabletop-mini", "--set", "orders.mean_interarrival_time=40"]
STATES = ["--states", "50", "--events"]


def written(folder: Path, form: str, *more: str) -> Path:
    assert main([*RUN, f"--{form}", str(folder), *STATES, *more]) in (0, 1)
    return folder


def rows_of_workbook(path: Path, sheet: str) -> list[dict[str, Any]]:
    head, *rows = openpyxl.load_workbook(path)[sheet].iter_rows(values_only=True)
    return [dict(zip(head, row, strict=True)) for row in rows]


def in_16_digits(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows as openpyxl writes them."""
    return [
        {name: float(f"{v:.16g}") if isinstance(v, float) else v for name, v in row.items()}
        for row in rows
    ]


def test_all_forms_have_the_same_figures(tmp_path: Path) -> None:
    csv, parquet, xlsx = (written(tmp_path / form, form) for form in table_files.FORMATS)
    options = pyarrow.csv.ConvertOptions(strings_can_be_null=True)
    for name in TABLES:
        rows = pyarrow.parquet.read_table(parquet / f"{name}.parquet").to_pylist()
        read = pyarrow.csv.read_csv(csv / f"{name}.csv", convert_options=options).to_pylist()
        assert read == rows, name
        assert rows_of_workbook(xlsx / table_files.WORKBOOK, name) == in_16_digits(rows), name
    texts = {(folder / "metrics.json").read_text() for folder in (csv, parquet, xlsx)}
    assert len(texts) == 1


def test_no_text_of_a_csv_is_a_formula() -> None:
    names = ["=1", "-x", "a-b", None]
    table = pa.table(
        {"name": names, "coded": pa.array(names).dictionary_encode(), "n": [-1, 2, 3, 4]}
    )
    safe = table_files.without_formulas(table).to_pydict()
    assert safe["name"] == safe["coded"] == ["'=1", "'-x", "a-b", None]
    assert safe["n"] == [-1, 2, 3, 4]


def test_figures_are_those_of_the_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "out"
    one_robot_each = "strategy.allocation=first-come"
    main([*RUN, "--parquet", str(folder), *STATES, "--json", "--set", one_robot_each])
    report = json.loads(capsys.readouterr().out)
    read = pyarrow.parquet.read_table
    document = json.loads((folder / "metrics.json").read_text())
    for key in ("seed", "finished", "ticks", "orders", "delivered", "digest", "metrics"):
        assert document[key] == report[key], key
    robots = read(folder / "robots.parquet").to_pylist()
    assert robots == report["robots"]
    orders = read(folder / "orders.parquet").to_pylist()
    done = [row["lead_time"] for row in orders if row["done"] is not None]
    assert (len(orders), len(done)) == (report["orders"], report["delivered"])
    assert statistics.fmean(done) == pytest.approx(report["metrics"]["lead_time"])
    trips = read(folder / "trips.parquet").to_pylist()
    assert all(row["drive"] >= row["least_drive"] >= 0 for row in trips)
    assert [row["delivered"] for row in trips] == [row["done"] for row in orders]
    cells = read(folder / "cells.parquet").to_pylist()
    assert sum(row["visits"] for row in cells) == sum(robot["moves"] for robot in robots)


def test_the_same_seed_writes_the_same_bytes(tmp_path: Path) -> None:
    first, second = (written(tmp_path / name, "csv") for name in ("a", "b"))
    for path in sorted(first.iterdir()):
        assert (second / path.name).read_bytes() == path.read_bytes(), path.name


def test_tables_change_nothing_in_a_run(tmp_path: Path) -> None:
    folder = written(tmp_path / "out", "parquet", "--until", "300")
    run = Simulation(resolve("tabletop-mini", []))
    assert json.loads((folder / "metrics.json").read_text())["ticks"] == 300
    plain = simulate("tabletop-mini", **{"orders.mean_interarrival_time": 40})
    whole = simulate(
        "tabletop-mini", tables=True, states=7, events=True, **{"orders.mean_interarrival_time": 40}
    )
    assert whole.digest == plain.digest and run.tick == 0
    assert whole._replace(wall_s=None, tables=None, picture=None) == plain._replace(
        wall_s=None, picture=None
    )


def test_the_scenario_that_is_written_runs_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = written(tmp_path / "out", "csv", "--seed", "5")
    capsys.readouterr()
    assert main(["check", str(folder / "scenario.yaml")]) == 0
    main(["run", str(folder / "scenario.yaml"), "--json"])
    digest = json.loads(capsys.readouterr().out.partition("ok\n")[2])["digest"]
    assert digest == json.loads((folder / "metrics.json").read_text())["digest"]


@pytest.fixture
def small_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns, "GROUP_ROWS", 16)


@pytest.mark.usefixtures("small_groups")
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_a_run_that_is_stopped_leaves_whole_groups(form: str, tmp_path: Path) -> None:
    resolved = resolve("tabletop-mini", [])
    options = WantedTables(states=10, folder=tmp_path, form=form)

    def stop(simulation: Simulation) -> None:
        sample(simulation)
        if simulation.tick == 200:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), table_run(resolved, options) as run:
        sample = run.sampling.on_sample
        run_once(resolved, sampling=run.sampling._replace(on_sample=stop))
    robots = resolved.scenario.fleet.robots
    kept = 21 * robots // 16 * 16
    read = pyarrow.csv.read_csv if form == "csv" else pyarrow.parquet.read_table
    states = read(tmp_path / f"states.{form}")
    assert len(states) == kept and states["tick"].to_pylist()[-1] == (kept - 1) // robots * 10
    assert {path.name for path in tmp_path.iterdir()} == {f"states.{form}"}


@pytest.mark.usefixtures("small_groups")
@pytest.mark.parametrize("is_there", [False, True])
def test_a_run_that_fails_leaves_nothing_behind(is_there: bool, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    if is_there:
        folder.mkdir()
        (folder / "notes.txt").write_text("mine")
    options = WantedTables(states=10, folder=folder, form="csv")

    def fail(simulation: Simulation) -> None:
        sample(simulation)
        if simulation.tick == 200:
            raise InputError("the strategy raised")

    with (
        pytest.raises(InputError, match="the strategy raised"),
        table_run(resolve("tabletop-mini", []), options) as run,
    ):
        sample = run.sampling.on_sample
        run_once(resolve("tabletop-mini", []), sampling=run.sampling._replace(on_sample=fail))
    assert [path.name for path in tmp_path.rglob("*.*")] == (["notes.txt"] if is_there else [])
    assert folder.exists() == is_there


@pytest.mark.usefixtures("small_groups")
def test_groups_end_to_end_are_the_table(tmp_path: Path) -> None:
    folder = written(tmp_path / "out", "parquet")
    file = pyarrow.parquet.ParquetFile(folder / "states.parquet")
    sizes = [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]
    assert set(sizes[:-1]) == {16} and 0 < sizes[-1] <= 16


def test_a_folder_that_holds_another_run_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    written(tmp_path, "csv")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for form in table_files.FORMATS:
        with pytest.raises(InputError, match=r"already holds another run \(cells\.csv\)"):
            simulate("tabletop-mini", tables=True, folder=tmp_path)
        assert main([*RUN, f"--{form}", str(tmp_path)]) == 2
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_too_many_rows_are_refused_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"tables of [\d,]+ rows are expected.*set folder="):
        simulate("tabletop-mini", tables=True, states=1, **{"stop.max_duration": 10_000_000})
    with pytest.raises(InputError, match=r"the table states may have [\d,]+ rows"):
        options = WantedTables(states=1, folder=tmp_path / "out", form="xlsx")
        long = settings_of({"stop.max_duration": 1_000_000})
        with table_run(resolve("tabletop-mini", long), options):
            pass


def test_buffers_are_small() -> None:
    count = sum(len(TABLES[name]) for name in ("events", "states"))
    widest = max(map(len, TABLES.values()))
    assert 8 * columns.GROUP_ROWS * (count + widest) < 64_000_000


def test_events_that_fill_the_memory_end_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_files, "MAX_ROWS_IN_MEMORY", 3)
    with pytest.raises(InputError, match="set folder="):
        simulate("tabletop-mini", tables=True, events=True)


@pytest.mark.parametrize(
    ("module", "form", "extra"),
    [("pyarrow", "csv", "experiments"), ("openpyxl", "xlsx", "excel")],
)
def test_what_is_not_installed_is_named_with_its_extra(
    module: str, form: str, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.partition(".")[0] == module:
            raise ImportError(f"No module named {name!r}")
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    assert main([*RUN, f"--{form}", str(tmp_path / "out")]) == 2
    assert f"pip install 'fleet-automaton[{extra}]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("states", "said"),
    [
        ("10 m", "states: '10 m' is a length"),
        ("0.1 s", "units.tick is '1 cycle', which is not a time"),
        (0, "the period of states, 0, is less than a tick"),
        (2.5, "states must be a period such as '10 s' or a number of ticks, not 2.5"),
    ],
)
def test_periods_that_are_none(states: Any, said: str) -> None:
    with pytest.raises(InputError) as caught:
        period_of(states, resolve("tabletop-mini", []))
    assert said in str(caught.value)


def test_periods_are_rounded_to_ticks() -> None:
    goods = resolve("goods-60x40", [])
    assert [period_of(text, goods) for text in ("10 s", "1 min", "7", 7)] == [20, 120, 7, 7]


def test_what_a_run_does_not_have_is_named() -> None:
    tables = simulate("tabletop-mini", tables=True).tables
    assert tables.names == ("orders", "lines", "trips", "robots", "stations")
    assert tables.lines.num_rows == 0
    with pytest.raises(AttributeError, match=r"this run has no table 'states'; events=True and"):
        tables["states"]
    with pytest.raises(InputError, match="need tables=True"):
        simulate("tabletop-mini", events=True)
    assert main([*RUN, "--states", "10"]) == 2
