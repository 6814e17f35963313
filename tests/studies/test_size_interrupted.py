"""`automaton size` that is ended from outside: what is known is printed, and no process stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from sweep_studies import end_all, of_session, started, wait_until

LONG = ["tabletop-mini", "--target", "makespan<=1372", "--robots", "3", "--indifference", "0.0005"]
QUESTION = [*LONG, "--budget", "1000000", "--workers", "2"]  # undecided for minutes
BEGIN = (
    "import sys; from automaton.studies import process_pool; from automaton.commands import main; "
    "process_pool.POOL_START_DELAY_S = 0.0; sys.exit(main(sys.argv[1:]))"
)


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """The processes that it has spawned to do runs."""
    return [number for number in of_session(process.pid) if "spawn_main" in command_of(number)]


def command_of(number: int) -> str:
    try:
        return Path(f"/proc/{number}/cmdline").read_text()
    except OSError:
        return ""


def computing(process: subprocess.Popen[str]) -> bool:
    """Whether both workers have taken more than a second of processor time: they do runs."""
    workers = workers_of(process)
    return len(workers) == 2 and all(
        sum(map(int, Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[11:13]))
        > os.sysconf("SC_CLK_TCK")
        for number in workers
    )


def ended(command: list[str], end: Callable[[subprocess.Popen[str]], None]) -> tuple[int, str, str]:
    """What a command says that is ended while its workers compute; none of its processes stays."""
    process = started([sys.executable, "-c", BEGIN, *command])
    try:
        wait_until(lambda: computing(process), 60)
        end(process)
        out, err = process.communicate(timeout=20)
        wait_until(lambda: not of_session(process.pid))
    finally:
        end_all([process])
    return process.returncode, out, err


def kill_a_worker(process: subprocess.Popen[str]) -> None:
    os.kill(workers_of(process)[0], signal.SIGKILL)


DIED = "automaton: a worker process died, or was killed; fewer --workers take less memory\n"


def test_no_worker_outlives_a_killed_search() -> None:
    code, _, _ = ended(["size", *QUESTION], lambda process: os.kill(process.pid, signal.SIGKILL))
    assert code == -signal.SIGKILL


def test_a_worker_that_dies_ends_the_search_with_what_is_known() -> None:
    code, out, err = ended(["size", *QUESTION], kill_a_worker)
    assert code == 1 and err.endswith(DIED) and "Traceback" not in err
    assert "Interrupted: results so far" in out


def test_a_worker_that_dies_ends_a_reproduction_with_one_sentence() -> None:
    many = ["reproduce", "tabletop", "--seeds", "100", "--workers", "2"]
    code, out, err = ended(many, kill_a_worker)
    assert (code, out) == (1, "") and err.endswith(DIED) and "Traceback" not in err


@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["parent", "group"])
def test_the_time_limit_of_a_job_prints_what_is_known(send: Callable[[int, int], None]) -> None:
    code, out, err = ended(["size", *QUESTION], lambda process: send(process.pid, signal.SIGTERM))
    assert code == 143 and err.endswith("automaton: terminated\n")
    assert "leaked" not in err and "Traceback" not in err
    assert "Interrupted: results so far" in out
