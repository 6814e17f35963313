"""Small studies for the tests, and strategies that make trouble while they run."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from signal_process import signal_process

from automaton import sweep
from automaton.strategy.api import CMD_PARK, Strategy
from automaton.studies.sweeps import pools
from automaton.studies.sweeps.study import Study

TESTS = Path(__file__).parent
TIMES = ("wall_s", "cpu_s")
TROUBLE = "AUTOMATON_TEST_TROUBLE"  # a folder: what happens in there is written down

STUDY = """name: small
scenario: tabletop-mini
factors:
  fleet.robots: [1, 2]
  strategy.allocation: [independent, cooperative]
replications: {replications}
seed: {seed}
"""

TROUBLED = """name: troubled
scenario: tabletop-mini
factors:
  fleet.robots: [1, 2]
  strategy.allocation: ["sweep_studies:{strategy}"]
  stop.max_duration: [50]
replications: 3
"""


def small_study(folder: Path, replications: int = 6, seed: int = 1, **changes: str) -> Path:
    """A study of 4 points; `changes`: what stands instead of what."""
    text = STUDY.format(replications=replications, seed=seed)
    for before, after in changes.items():
        text = text.replace(before, after)
    path = folder / "small.yaml"
    path.write_text(text)
    return path


def troubled(folder: Path, strategy: str) -> Path:
    """A study of 3 runs with one robot and 3 with two, by a strategy of this module."""
    path = folder / "troubled.yaml"
    path.write_text(TROUBLED.format(strategy=strategy))
    return path


def plain(table: Any) -> list[dict[str, Any]]:
    """The rows without the times that they took."""
    rows: list[dict[str, Any]] = table.drop_columns(list(TIMES)).to_pylist()
    return rows


def swept_here(study: Path | Study, out: Path | None = None, **options: Any) -> Any:
    """The rows of a study, its runs being done in this process."""
    with ThreadPoolExecutor(1) as executor:
        return sweep(study, out, executor, **options)


class OwnThread(pools.ExternalExecutor):
    """What does the runs of commands instead of a LocalPool, where it does not matter who does them."""

    def __init__(self, workers: int | None = None) -> None:
        super().__init__(ThreadPoolExecutor(1))

    def close(self, now: bool) -> None:
        super().close(now)
        self.executor.shutdown()


def interrupting(rows: Callable[..., None], after: int) -> Callable[..., None]:
    """What counts finished runs, and is interrupted as by Ctrl-C once so many are done."""

    def count_rows(listener: Any, done: list[Any]) -> None:
        rows(listener, done)
        if listener.done >= after:
            raise KeyboardInterrupt

    return count_rows


def sweep_command(study: Path, out: Path, *options: str) -> list[str]:
    return [sys.executable, "-m", "automaton", "sweep", str(study), "--out", str(out), *options]


def hasty_command(study: Path, out: Path, *options: str) -> list[str]:
    """The same, but the row of each run is written as soon as it is done: there are some after less."""
    begin = (
        "import sys; from automaton.studies.sweeps import result_store, sweep_session; "
        "from automaton.commands import main; "
        "sweep_session.CHUNK_S = result_store.BATCH_S = 0.0; sys.exit(main(sys.argv[1:]))"
    )
    return [sys.executable, "-c", begin, *sweep_command(study, out, *options)[3:]]


def environment(**more: str) -> dict[str, str]:
    """That of a command that finds the strategies of this module."""
    paths = os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": paths, **more}


def started(command: Sequence[str], **more: str) -> subprocess.Popen[str]:
    """A command in a session of its own, so that it can be ended with all it has begun.

    It hears Ctrl-C, also where these tests run in the background and ignore it.
    """
    return subprocess.Popen(
        signal_process(signal.SIGINT, command),
        env=environment(**more),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def of_session(session: int) -> list[int]:
    """The processes of a session that have not ended."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == session and fields[0] != "Z":
                found.append(int(entry.name))
    return found


def wait_until(condition: Any, seconds: float = 60) -> None:
    """Wait for something to hold."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.05)


def started_cluster(file: Path) -> list[subprocess.Popen[str]]:
    """A scheduler that writes where it is to a file, and its two workers, begun by command lines."""
    dask, local = [sys.executable, "-m", "dask"], ["--host", "127.0.0.1", "--no-dashboard"]
    place = ["--scheduler-file", str(file)]
    worker = [*dask, "worker", *local, "--nthreads", "1", "--no-nanny", *place]
    processes = [started([*dask, "scheduler", *local, "--port", "0", *place])]
    processes += [started(worker), started(worker)]
    wait_until(lambda: file.exists() and file.read_text().endswith("}"))
    return processes


def row_files(out: Path) -> list[Path]:
    return sorted((out / "rows").glob("*.parquet"))


def end_all(processes: Sequence[subprocess.Popen[str]]) -> None:
    """Kill what is left of processes and of their sessions."""
    for process in processes:
        for number in of_session(process.pid):
            os.kill(number, signal.SIGKILL)
        process.communicate()


def mark(name: str) -> bool:
    """Note that something happened; whether it is the first time."""
    path = Path(os.environ[TROUBLE]) / name
    if path.exists():
        return False
    path.touch()
    return True


class DiesOnce(Strategy):
    """Allocation: kills its process the first time that it is asked at all."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        if mark("died once"):
            os.kill(os.getpid(), signal.SIGKILL)
        decisions.allocation.command[: batch.count] = CMD_PARK


class DiesUntilMended(Strategy):
    """Allocation: kills its process whenever two robots run, until somebody has noted "mended"."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        if len(view.robots.cell) == 2 and not (Path(os.environ[TROUBLE]) / "mended").exists():
            os.kill(os.getpid(), signal.SIGKILL)
        decisions.allocation.command[: batch.count] = CMD_PARK


class Raises(Strategy):
    """Allocation: raises whenever two robots run."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        if len(view.robots.cell) == 2:
            raise ValueError("two are too many")
        decisions.allocation.command[: batch.count] = CMD_PARK


class NeverAnswers(Raises):
    """Allocation: goes on for ever whenever two robots run."""

    def decide(self, view, batch, decisions, memory, workspace):
        while len(view.robots.cell) == 2:
            time.sleep(0.01)  # which takes none of the time of others
        decisions.allocation.command[: batch.count] = CMD_PARK


class Quits(Raises):
    """Allocation: leaves Python whenever two robots run."""

    def decide(self, view, batch, decisions, memory, workspace):
        if len(view.robots.cell) == 2:
            sys.exit(0)
        super().decide(view, batch, decisions, memory, workspace)


class Interrupts(Raises):
    """Allocation: raises by itself what Ctrl-C raises whenever two robots run."""

    def decide(self, view, batch, decisions, memory, workspace):
        if len(view.robots.cell) == 2:
            raise KeyboardInterrupt
        super().decide(view, batch, decisions, memory, workspace)


class IsInterrupted(Raises):
    """Allocation: decides while somebody presses Ctrl-C whenever two robots run."""

    def decide(self, view, batch, decisions, memory, workspace):
        if len(view.robots.cell) == 2:
            signal.raise_signal(signal.SIGINT)
        super().decide(view, batch, decisions, memory, workspace)


class SaysSomethingOdd(Raises):
    """Allocation: raises with a name of a file that is not a UTF-8, whenever two robots run."""

    def decide(self, view, batch, decisions, memory, workspace):
        if len(view.robots.cell) == 2:
            raise ValueError(os.fsdecode(b"no caf\xe9.csv"))
        super().decide(view, batch, decisions, memory, workspace)


class NeedsAllMemory(Raises):
    """Allocation: there is room for one such run at a time; another one's process is killed."""

    def reset(self, view):
        with (Path(os.environ[TROUBLE]) / "room").open("a") as room:
            try:
                fcntl.flock(room, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.kill(os.getpid(), signal.SIGKILL)
            time.sleep(0.5)
        return super().reset(view)
