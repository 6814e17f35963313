"""Sweeps on a Dask cluster: the same rows, also when a worker is killed in the middle."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from sweeping import (
    end_all,
    hasty_command,
    plain,
    row_files,
    small_study,
    started,
    swept_here,
    wait_until,
)

from automaton.commands import main
from automaton.experiments.store import Store

pytest.importorskip("distributed")

REPLICATIONS = 100  # in 4 points: more than are done before the kill


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """The file of a scheduler and its two workers, begun by their command lines."""
    file = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    local = ["--host", "127.0.0.1"]
    processes = [
        started([*dask, "scheduler", *local, "--port", "0", "--no-dashboard", *place(file)])
    ]
    for _ in range(2):
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
        processes.append(started([*dask, "worker", *local, *options, *place(file)]))
    try:
        wait_until(lambda: file.exists() and file.read_text().endswith("}"))
        yield str(file), processes[1:]
    finally:
        end_all(processes)


def place(file: Path) -> list[str]:
    return ["--scheduler-file", str(file)]


def test_a_cluster_gives_the_same_rows_and_survives_a_killed_worker(
    cluster: tuple[str, list[subprocess.Popen[str]]], tmp_path: Path
) -> None:
    scheduler, workers = cluster
    study, out = small_study(tmp_path, REPLICATIONS), tmp_path / "out"
    process = started(hasty_command(study, out, "--scheduler", scheduler, "--json"))
    try:
        wait_until(lambda: row_files(out))
        os.kill(workers[0].pid, signal.SIGKILL)
        told, err = process.communicate(timeout=60)
    finally:
        end_all([process])
    assert process.returncode == 0, err
    found = json.loads(told)
    assert found["done"] == 4 * REPLICATIONS and found["failed"] == 0
    assert found["repeated"] <= REPLICATIONS  # only what was under way, not what was finished
    assert plain(Store(out).rows()) == plain(swept_here(study))


def test_a_scheduler_that_is_not_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("automaton.experiments.cluster.PATIENCE_S", 0.2)
    study, out = small_study(tmp_path, 1), tmp_path / "out"
    assert main(["sweep", str(study), "--out", str(out), "--scheduler", "tcp://127.0.0.1:9"]) == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in capsys.readouterr().err
    assert main(["sweep", str(study), "--out", str(out), "--scheduler", "nonsense://x"]) == 2
    assert "no Dask scheduler answers at nonsense://x" in capsys.readouterr().err
    assert main(["sweep", str(study), "--out", str(out), "--scheduler", "nothing.json"]) == 2
    assert "nothing.json: is no address, such as tcp://" in capsys.readouterr().err
