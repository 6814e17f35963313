"""Sweeps on a Dask cluster: the same rows, also when a worker is killed in the middle."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from docs_pages import page
from sweep_studies import (
    end_all,
    hasty_command,
    plain,
    row_files,
    small_study,
    started,
    started_cluster,
    swept_here,
    wait_until,
)

from automaton import sweep
from automaton.commands import main
from automaton.errors import InputError
from automaton.studies.sweeps.pools import DaskCluster
from automaton.studies.sweeps.result_store import Store

# Looked for, not imported: that takes a second, in each worker that collects this module.
pytestmark = pytest.mark.skipif(not find_spec("distributed"), reason="it is not installed")

REPLICATIONS = 10  # in 4 points, each written by itself: more than are done before the kill


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """The file of a scheduler and its two workers, begun by their command lines."""
    file = tmp_path / "scheduler.json"
    processes = started_cluster(file)
    try:
        yield str(file), processes[1:]
    finally:
        end_all(processes)


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
    assert found["repeated"] <= 3  # only what was under way, not what was finished
    assert plain(Store(out).rows()) == plain(swept_here(study))
    # From Python, by the address that the file holds; one worker is left.
    few, address = small_study(tmp_path, 2), json.loads(Path(scheduler).read_text())["address"]
    assert address.startswith("tcp://")
    assert plain(sweep(few, scheduler=address)) == plain(swept_here(few))


def test_a_scheduler_that_is_not_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("automaton.studies.sweeps.pools.SCHEDULER_TIMEOUT_S", 0.2)
    monkeypatch.setattr("automaton.studies.sweeps.pools.ADDRESS_FILE_RETRY_S", 0.0)
    study, out = small_study(tmp_path, 1), tmp_path / "out"
    assert main(["sweep", str(study), "--out", str(out), "--scheduler", "tcp://127.0.0.1:9"]) == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in capsys.readouterr().err
    assert main(["sweep", str(study), "--out", str(out), "--scheduler", "nonsense://x"]) == 2
    assert "no Dask scheduler answers at nonsense://x" in capsys.readouterr().err
    assert main(["sweep", str(study), "--out", str(out), "--scheduler", "nothing.json"]) == 2
    assert "nothing.json: is not an address, such as tcp://" in capsys.readouterr().err
    for text in ("{}", "[]", "", '{"address"'):
        (tmp_path / "cluster.json").write_text(text)
        with pytest.raises(InputError, match=r"cluster\.json: is not a Dask scheduler file"):
            DaskCluster(str(tmp_path / "cluster.json"))
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127.0.0.1:9"):
        sweep(study, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(InputError, match="one of executor, workers and scheduler"):
        sweep(study, workers=1, scheduler="tcp://127.0.0.1:9")


def command(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/bash\n{text}\n")
    path.chmod(0o755)


def test_the_slurm_job_of_the_page_runs(tmp_path: Path) -> None:
    blocks = page("docs/how-to/run-on-a-cluster.md").blocks
    (job,) = (block.text for block in blocks if "#SBATCH" in block.text)
    found = tmp_path / "bin"
    found.mkdir()
    command(found / "srun", 'exec "$@"')  # one task, on this node
    for module in ("dask", "automaton"):
        command(found / module, f'exec {sys.executable} -m {module} "$@"')
    small_study(tmp_path, 3).rename(tmp_path / "my-fleet.yaml")
    (tmp_path / "job.sh").write_text(job)
    (tmp_path / "cluster.json").write_text('{"address": "tcp://127.0.0.1:9"}')  # it is stale
    path = f"{found}{os.pathsep}{os.environ['PATH']}"
    # A batch script ends with its sweep; then Slurm ends what is left of its job.
    process = started(["bash", "-c", f"cd {tmp_path} && bash job.sh 2> log > told"], PATH=path)
    try:
        process.wait(timeout=120)
    finally:
        end_all([process])
    assert process.returncode == 0, (tmp_path / "log").read_text()
    assert "small: 12 runs in results" in (tmp_path / "told").read_text()
    assert Store(tmp_path / "results").rows().num_rows == 12
