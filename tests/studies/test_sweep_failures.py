"""Strategies and workers that make trouble: a row says so, and all other runs are done."""

from __future__ import annotations

import json
import pickle
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

import pytest
from sweep_studies import (
    TROUBLE,
    row_files,
    small_study,
    started,
    sweep_command,
    swept_here,
    troubled,
)

from automaton import sweep
from automaton.commands import main
from automaton.errors import InputError
from automaton.studies.sweeps import pools, run_keys
from automaton.studies.sweeps.result_store import Store, read_rows
from automaton.studies.sweeps.sweep_plan import make_sweep_plan
from automaton.studies.sweeps.sweep_session import done_in, sweep_into

Capture = pytest.CaptureFixture[str]


def swept_by_worker(study: Path, out: Path, *options: str) -> int:
    """The exit code of the command `sweep`, given here, whose runs one worker process does."""
    return main([*sweep_command(study, out, "--workers", "1")[3:], *options])


class LastingPool(pools.LocalPool):
    """A worker process that stays when a sweep is over."""

    def close(self, now: bool) -> None:
        if now:
            super().close(now)


@pytest.fixture(scope="module")
def worker() -> Iterator[LastingPool]:
    pool = LastingPool(1)
    yield pool
    pool.close(now=True)


@pytest.fixture
def lasting_worker(worker: LastingPool, monkeypatch: pytest.MonkeyPatch) -> None:
    """One process for all sweeps in which no worker is to die."""
    monkeypatch.setattr(pools, "LocalPool", lambda workers: worker)


@pytest.mark.usefixtures("lasting_worker")
def test_a_run_whose_strategy_raises_is_a_row_that_says_so(tmp_path: Path, capfd: Capture) -> None:
    assert swept_by_worker(troubled(tmp_path, "Raises"), tmp_path / "out") == 1
    out, err = capfd.readouterr()
    assert "3 runs failed" in err
    rows = Store(tmp_path / "out").rows().to_pylist()
    assert [row["error"] is None for row in rows] == [True] * 3 + [False] * 3
    assert "two are too many" in rows[3]["error"] and rows[3]["digest"] is None
    assert not rows[0]["finished"] and rows[0]["ticks"] == 50  # nobody does anything: the limit
    assert "3 runs reached the time limit" in out


def test_what_a_strategy_says_is_kept_though_it_is_no_text(tmp_path: Path) -> None:
    failed = swept_here(troubled(tmp_path, "SaysSomethingOdd")).column("error").to_pylist()
    assert failed[:3] == [None] * 3
    assert all("no caf?.csv" in why for why in failed[3:])


@pytest.mark.usefixtures("lasting_worker")
def test_a_strategy_that_never_answers_is_named_in_the_row(tmp_path: Path, capfd: Capture) -> None:
    study, out = troubled(tmp_path, "NeverAnswers"), tmp_path / "out"
    assert swept_by_worker(study, out, "--strategy-timeout", "1") == 1
    assert "3 runs failed" in capfd.readouterr().err
    failed = Store(out).rows().column("error").to_pylist()
    assert failed[:3] == [None] * 3
    assert all(
        "'sweep_studies:NeverAnswers' raised NoAnswer: no answer within 1 s" in why
        for why in failed[3:]
    )


def test_runs_of_a_worker_that_dies_are_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture
) -> None:
    monkeypatch.setenv(TROUBLE, str(tmp_path))
    assert swept_by_worker(troubled(tmp_path, "DiesOnce"), tmp_path / "out", "--json") == 0
    found = json.loads(capfd.readouterr().out)
    assert found["failed"] == 0 and found["done"] == 6 and 1 <= found["repeated"] <= 6
    assert Store(tmp_path / "out").rows().num_rows == 6


def test_runs_that_need_all_memory_are_done_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture
) -> None:
    monkeypatch.setenv(TROUBLE, str(tmp_path))
    study, out = troubled(tmp_path, "NeedsAllMemory"), tmp_path / "out"
    text = study.read_text().replace("[1, 2]", "[1]")
    study.write_text(text.replace("replications: 3", "replications: 4"))
    assert swept_by_worker(study, out, "--workers", "2") == 0, capfd.readouterr().err
    assert Store(out).rows().column("error").to_pylist() == [None] * 4


def test_workers_that_cannot_start_are_told_and_no_run_has_failed(tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    few = {"[independent, cooperative]": "[independent]"}
    study, out = small_study(tmp_path, 1, **few), tmp_path / "out"
    script.write_text(
        f"from automaton import sweep\nsweep({str(study)!r}, out={str(out)!r}, workers=1)\n"
    )
    process = started([sys.executable, str(script)])
    _, err = process.communicate(timeout=120)
    last = err.splitlines()[-1]
    assert last.startswith("automaton.errors.InputError: the workers cannot start"), err
    assert Store(out).rows().num_rows == 0


def test_a_run_that_kills_its_worker_twice_has_failed_until_it_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Capture
) -> None:
    study, out = troubled(tmp_path, "DiesUntilMended"), tmp_path / "out"
    study.write_text(study.read_text().replace("replications: 3", "replications: 2"))
    monkeypatch.setenv(TROUBLE, str(tmp_path))
    assert swept_by_worker(study, out) == 1
    *_, last = capfd.readouterr().err.splitlines()
    assert last.startswith("automaton: 2 runs failed;"), last
    failed = Store(out).rows().column("error").to_pylist()
    assert failed[:2] == [None] * 2
    assert all("the worker process died twice" in why for why in failed[2:])
    # Mended, but they are not done again by themselves: they might kill workers for ever.
    (tmp_path / "mended").touch()
    assert swept_by_worker(study, out) == 1
    said = "2 runs failed; see the column `error` for the reason, or retry with --retry-failed\n"
    assert capfd.readouterr().err == f"automaton: {said}"
    assert [done_in(out, make_sweep_plan(study), retry) for retry in (False, True)] == [4, 2]
    assert swept_here(study, out, retry_failed=True).column("error").to_pylist() == [None] * 4
    (file,) = row_files(out)
    assert read_rows(file).num_rows == 4  # the rows of failures are gone


@pytest.mark.usefixtures("lasting_worker")
@pytest.mark.parametrize(
    ("strategy", "told"), [("Quits", "SystemExit: 0"), ("Interrupts", "raised KeyboardInterrupt (")]
)
def test_a_strategy_that_ends_python_ends_its_run_alone(
    strategy: str, told: str, tmp_path: Path, capfd: Capture
) -> None:
    study, out = troubled(tmp_path, strategy), tmp_path / "out"
    assert swept_by_worker(study, out) == 1
    assert "3 runs failed" in capfd.readouterr().err
    with ThreadPoolExecutor(1) as executor:
        tables = Store(out).rows(), sweep(study, executor=executor)
    for failed in (table.column("error").to_pylist() for table in tables):
        assert failed[:3] == [None] * 3 and all(told in why for why in failed[3:])


def test_ctrl_c_ends_a_sweep_whose_runs_are_done_in_its_own_thread(tmp_path: Path) -> None:
    plan = make_sweep_plan(troubled(tmp_path, "IsInterrupted"))
    _, two, *_ = plan.manifest.runs()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            pools.run_one(plan.scenarios[1], two)
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_scenario_that_another_thread_lets_go_is_still_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools, "_SCENARIOS", {})
    monkeypatch.setattr(pools, "Simulation", lambda resolved, **_: pools._SCENARIOS.clear())
    given = make_sweep_plan(troubled(tmp_path, "Raises")).scenarios[0]
    assert pools._scenario("one", pickle.dumps(given)).scenario == given.scenario


def test_an_executor_is_left_without_the_runs_of_a_sweep_that_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, over = [], Event()

    carry_out = pools.run_chunk

    def run_chunk(chunk: pools.SweepChunk) -> list[run_keys.Row]:
        begun.append(chunk)
        assert len(begun) == 1 or over.wait(20)
        return carry_out(chunk)

    def stop(rows: list[run_keys.Row]) -> None:
        raise InputError("stopped")

    monkeypatch.setattr(pools, "run_chunk", run_chunk)
    plan = make_sweep_plan(troubled(tmp_path, "Raises"))
    with ThreadPoolExecutor(1) as executor:
        with pytest.raises(InputError, match="stopped"):
            backend = pools.ExternalExecutor(executor)
            sweep_into(tmp_path / "out", plan, lambda: backend, on_rows=stop)
        over.set()
    assert len(begun) <= 2  # one that was done, and one that was under way


def test_a_pool_that_cannot_be_ended_leaves_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = []

    def end(workers: pools.Workers, now: bool) -> None:
        ended.append(workers)
        raise OSError("it cannot be ended")

    pool = pools.LocalPool(1)
    first, alone = pool._pool, pool._isolation_pool
    monkeypatch.setattr(pools.Workers, "end", end)
    with pytest.raises(OSError, match="it cannot"):
        pool.restart()
    second = pool._pool
    assert second is not first
    with pytest.raises(OSError, match="it cannot"):
        pool.close(now=True)
    assert ended == [first, second, alone]
