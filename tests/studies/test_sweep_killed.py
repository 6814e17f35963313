"""Sweeps that are stopped or killed: nothing half-written, no process left, and they go on."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from shared_fixture import shared_fixture
from sweep_studies import (
    end_all,
    hasty_command,
    of_session,
    plain,
    row_files,
    small_study,
    started,
    swept_here,
    wait_until,
)

from automaton.studies.sweeps.pools import ExternalExecutor
from automaton.studies.sweeps.result_store import Store
from automaton.studies.sweeps.run_keys import Row
from automaton.studies.sweeps.sweep_plan import make_sweep_plan
from automaton.studies.sweeps.sweep_session import sweep_into

REPLICATIONS = 25  # in 4 points, each written by itself: more than are done before the kill


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_study(tmp_path_factory.mktemp("killed"), REPLICATIONS)


@pytest.fixture(scope="module")
def expected(study: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """The rows of a sweep that nobody disturbs."""
    return shared_fixture(tmp_path_factory, "undisturbed", lambda: plain(swept_here(study)))


def resumed(study: Path, out: Path) -> list[dict[str, Any]]:
    rows = plain(swept_here(study, out))
    assert len(row_files(out)) == 1 and not list(out.rglob("*.writing"))
    return rows


@pytest.mark.parametrize(
    ("number", "workers", "code", "told"),
    [(signal.SIGINT, "1", 130, "interrupted"), (signal.SIGTERM, "2", 143, "terminated")],
)
def test_a_signal_keeps_what_is_done(
    number: int,
    workers: str,
    code: int,
    told: str,
    study: Path,
    expected: list[dict[str, Any]],
    tmp_path: Path,
) -> None:
    out = tmp_path / "out"
    process = started(hasty_command(study, out, "--workers", workers))
    try:
        wait_until(lambda: row_files(out))
        os.killpg(process.pid, number)  # as a terminal or a scheduler does: to all processes
        _, err = process.communicate(timeout=20)
        wait_until(lambda: not of_session(process.pid))
    finally:
        end_all([process])
    assert process.returncode == code, err
    kept = len(Store(out).keys())
    assert 0 < kept < 4 * REPLICATIONS
    assert err == (
        f"automaton: stopped; {kept} of 100 runs are stored in {out}; repeat the command to resume\n"
        f"automaton: {told}\n"
    )
    assert resumed(study, out) == expected


@pytest.mark.parametrize(
    ("kill", "workers"), [(os.kill, "2"), (os.killpg, "1")], ids=["coordinator", "group"]
)
def test_a_killed_sweep_goes_on_to_the_same_table(
    kill: Callable[[int, int], None],
    workers: str,
    study: Path,
    expected: list[dict[str, Any]],
    tmp_path: Path,
) -> None:
    out = tmp_path / "out"
    process = started(hasty_command(study, out, "--workers", workers))
    try:
        wait_until(lambda: row_files(out))
        kill(process.pid, signal.SIGKILL)
        process.communicate(timeout=20)
        wait_until(lambda: not of_session(process.pid))
    finally:
        end_all([process])
    assert 0 < len(Store(out).keys()) < 4 * REPLICATIONS
    assert resumed(study, out) == expected


def test_ctrl_c_while_workers_end_keeps_all_rows(tmp_path: Path) -> None:
    class Interrupted(ExternalExecutor):
        def close(self, now: bool) -> None:
            if not now:
                raise KeyboardInterrupt

    plan, told, out = make_sweep_plan(small_study(tmp_path)), [], tmp_path / "out"
    with ThreadPoolExecutor(1) as executor, pytest.raises(KeyboardInterrupt):
        sweep_into(out, plan, lambda: Interrupted(executor), on_rows=told.extend)
    assert len(told) == Store(out).rows().num_rows == 24


def test_a_second_ctrl_c_keeps_the_rows_that_were_told(tmp_path: Path) -> None:
    class AtOnce(Executor):
        def submit(self, run: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
            future: Future[Any] = Future()
            future.set_result(run(*arguments, **options))
            return future

    def stop(rows: list[Row]) -> None:
        told.extend(rows)
        raise KeyboardInterrupt

    plan, told, out = make_sweep_plan(small_study(tmp_path)), [], tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        sweep_into(out, plan, lambda: ExternalExecutor(AtOnce()), on_rows=stop)
    assert len(told) == Store(out).rows().num_rows == 2  # first chunks are of one run
