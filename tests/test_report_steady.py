"""Reports of steady states: the warm-up, and scenarios that the folder has, lacks, or has changed."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_results import made_up, noise
from read_reports import report, tables

from automaton.experiments import sweep
from automaton.experiments.store import Store
from automaton.experiments.study import Analysis, Study
from automaton.reporting.compose import WITH_WARM_UP, compose
from automaton.reporting.document import Listed
from automaton.reporting.steady_state import steady_section
from automaton.reporting.writing import as_text
from automaton.scenario.reading import find


def test_a_steady_state_is_given_or_refused_with_its_reason() -> None:
    study = replace_study(replications=20, warm_up="mser-5")

    def series(point: int, replication: int) -> list[int]:
        rng = np.random.default_rng((point, replication))
        ramp = np.linspace(0, 1, 50) if point == 0 else np.linspace(0, 1, 400)
        rate = np.concatenate([ramp, np.ones(400 - len(ramp))])
        return rng.poisson(5 * rate).tolist()  # type: ignore[no-any-return]

    results = made_up(study, noise, series=series)
    blocks = list(steady_section(results, {0: 10, 1: 10}))
    (table,) = tables(blocks)
    good, refused = table.rows
    assert "replication-deletion" in good[5] and 470 < float(good[1]) < 530
    assert 300 <= int(good[4].replace(",", "")) <= 800  # of 4,000 ticks, 500 warm up
    assert refused[1] == "-"
    (listed,) = [block for block in blocks if isinstance(block, Listed)]
    assert "not stationary or too short" in listed.items[0]


def test_a_steady_state_of_a_few_runs_rests_on_all_of_them() -> None:
    def series(point: int, replication: int) -> list[int]:
        rng = np.random.default_rng((point, replication))
        return rng.poisson(5, 350).tolist()  # type: ignore[no-any-return]

    results = made_up(replace_study(replications=7, warm_up=0), noise, series=series)
    (table,) = tables(steady_section(results, {0: 10, 1: 10}))
    for row, point in zip(table.rows, (0, 1), strict=True):
        assert row[5] == "14 batch means of 7 runs"
        mean = np.mean([series(point, r) for r in range(7)]) * 1000 / 10
        assert float(row[1]) == pytest.approx(mean, rel=1e-3)


@pytest.fixture
def steady(tmp_path: Path) -> Path:
    """A folder of a steady state, with a copy of its scenario; the study's own lies beside that."""
    shipped = find("warehouse-100").read_text()
    (tmp_path / "own.yaml").write_text(shipped.replace("at_most: 2300", "at_most: 1200"))
    (tmp_path / "steady.yaml").write_text(
        "name: steady\nscenario: own.yaml\nreplications: 20\ndesign: steady-state\nwindow: 20\n"
        "warm_up: 400\npoints: [{fleet.robots: 10}]\nanalysis: {metrics: [throughput, delay, blocked]}\n"
    )
    with ThreadPoolExecutor(1) as executor:
        sweep(tmp_path / "steady.yaml", tmp_path / "deep" / "results", executor)
    return tmp_path / "deep" / "results"


def test_a_steady_state_needs_no_scenario_to_be_reported(steady: Path) -> None:
    (steady / "own.yaml").unlink()
    store = Store(steady)
    document = compose(store)
    told = [item for block in document.blocks if isinstance(block, Listed) for item in block.items]
    assert any("without lower bounds and maps" in item for item in told)
    table = next(one for one in tables(document.blocks) if "orders/1000 ticks" in one.head)
    series = np.array(store.rows().column("series").to_pylist())[:, 400 // 20 :]
    assert float(table.rows[0][1]) == pytest.approx(series.mean() * 1000 / 20, rel=1e-3)


def test_figures_of_whole_runs_say_so_in_a_steady_state(steady: Path) -> None:
    text = as_text(compose(Store(steady)))
    assert "left out of the steady throughput and of task_time" in " ".join(text.split())
    assert text.count(WITH_WARM_UP) == 2  # throughput and blocked, not delay
    assert "for --floor: 0 robots 10" in text


def test_whoever_is_given_a_report_can_repeat_it(steady: Path) -> None:
    text = as_text(compose(Store(steady)))
    study, own = ((steady.parent.parent / f"{n}.yaml").read_text() for n in ("steady", "own"))
    for line in (*study.splitlines(), *own.splitlines()):
        assert line.strip() in text
    (steady / "own.yaml").unlink()
    assert "And own.yaml as it was" in as_text(compose(Store(steady)))


def test_a_scenario_that_changed_gives_no_bounds_and_no_maps(steady: Path, capsys: Any) -> None:
    """Beside the folder's own study, where the report looks first, lies a copy of the scenario."""
    own = steady.parent.parent / "own.yaml"
    code, out, _ = report(capsys, str(steady), "--floor", "0")
    assert code == 0 and "most: no strategy can do better" in out and "Visits, point 0" in out
    (steady / "own.yaml").write_text(own.read_text().replace("count: 2000", "count: 1999"))
    code, out, _ = report(capsys, str(steady))
    assert code == 0 and "no strategy can do better" not in out
    told = "without lower bounds and maps of 1 of 1 point, since another scenario is found now"
    assert told in " ".join(out.split())
    code, _, err = report(capsys, str(steady), "--floor", "0")
    assert code == 2 and "--floor 0: no map can be made" in err and "own.yaml changed" in err


def replace_study(**more: Any) -> Study:
    return Study(
        name="steady",
        scenario="warehouse-100",
        factors={"fleet.robots": (1, 2)},
        design="steady-state",
        analysis=Analysis(metrics=("T_total",)),
        **more,
    )
