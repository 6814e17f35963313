"""Whether sweeps keep their promises when they are killed or large: long trials, run by hand.

    python tests/helpers/sweep_trials.py kills [KILLS] | cluster | memory [RUNS]

Each prints what it measured and exits with 1 if a promise is broken. The tests run them in small.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from sweep_studies import (
    end_all,
    of_session,
    plain,
    row_files,
    small_study,
    started,
    started_cluster,
    sweep_command,
    swept_here,
    wait_until,
)

from automaton.studies.sweeps.result_store import Store

KILLS = 30
RUNS = 100_000
POINTS = 4  # of a small study
LATEST = 2.5  # seconds after its start in which a sweep is killed


def kills(folder: Path, count: int) -> bool:
    """Kill as many sweeps, the coordinator alone and its whole group in turn, and go on at once."""
    study = small_study(folder, 400)
    expected = plain(swept_here(study))
    drawn = random.Random(1)
    equal = 0
    for k in range(count):
        out = folder / f"out-{k}"
        process = started(sweep_command(study, out, "--workers", "2"))
        time.sleep(drawn.uniform(0.0, LATEST))
        (os.kill if k % 2 else os.killpg)(process.pid, signal.SIGKILL)
        goes_on = started(sweep_command(study, out, "--workers", "2"))
        goes_on.communicate(timeout=120)
        process.communicate(timeout=20)
        wait_until(lambda: not of_session(process.pid) and not of_session(goes_on.pid))  # noqa: B023
        rows = Store(out).rows()
        equal += plain(rows) == expected and len(set(rows["key"].to_pylist())) == len(rows)
    print(f"{count} sweeps killed: {equal} equal tables, no row twice, no process left")
    return equal == count


def cluster(folder: Path) -> bool:
    """The rows of a pool of one, of a pool of two, of a cluster, and of one that loses a worker."""
    study = small_study(folder, 400)
    tables = [plain(swept_here(study))]
    for workers in ("1", "2"):
        out = folder / f"pool-{workers}"
        process = started(sweep_command(study, out, "--workers", workers))
        process.communicate(timeout=120)
        tables.append(plain(Store(out).rows()))
    repeated = []
    for killed in (False, True):
        file = folder / f"scheduler-{killed}.json"
        processes = started_cluster(file)
        try:
            out = folder / f"cluster-{killed}"
            process = started(sweep_command(study, out, "--scheduler", str(file), "--json"))
            if killed:
                wait_until(lambda: row_files(out))  # noqa: B023
                os.kill(processes[1].pid, signal.SIGKILL)
            told, _ = process.communicate(timeout=120)
            repeated.append(json.loads(told)["repeated"])
            tables.append(plain(Store(out).rows()))
        finally:
            end_all(processes)
    equal = all(table == tables[0] for table in tables)
    print(f"thread, pools of 1 and 2, cluster, cluster that loses a worker: equal {equal}")
    print(f"runs started twice: {repeated[0]} and {repeated[1]} of {len(tables[0]):,}")
    return equal


def memory(folder: Path, runs: int) -> bool:
    """A sweep of many short runs: the most memory that any of its processes ever held."""
    study, out = small_study(folder, runs // POINTS), folder / "out"
    begun = time.monotonic()
    process = started(sweep_command(study, out))
    most: dict[int, int] = {}
    while process.poll() is None:
        for number in of_session(process.pid):
            most[number] = max(most.get(number, 0), peak(number))
        time.sleep(0.5)
    rows = len(Store(out).keys())
    print(
        f"{rows:,} runs in {time.monotonic() - begun:.0f} s; at most "
        f"{max(most.values()) / 1024:.0f} MB in a process, coordinator {most[process.pid] / 1024:.0f}"
    )
    return rows == runs


def peak(process: int) -> int:
    """The most memory that a process ever held, KiB; 0 if it is gone."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("VmHWM")), 0)


def main(what: str, count: int | None = None) -> int:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        trials: dict[str, Any] = {
            "kills": lambda: kills(place, count or KILLS),
            "cluster": lambda: cluster(place),
            "memory": lambda: memory(place, count or RUNS),
        }
        return 0 if trials[what]() else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], *map(int, sys.argv[2:3])))
