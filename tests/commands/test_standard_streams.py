"""Commands whose standard output or errors are closed, full, or a pipe that nobody reads."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

COMMANDS = ("list", "check goods-mini", "schema", "run goods-mini --until 20", "--help")


def ended(command: str, streams: str) -> tuple[int, str]:
    """The exit code of a command in a shell, and what is written to standard errors."""
    line = f"{sys.executable} -m automaton {command} {streams}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_needs_no_standard_streams(command: str) -> None:
    assert ended(command, ">&- 2>&- <&-") == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no full device")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_full_disk_is_said_in_a_sentence(command: str) -> None:
    said = "automaton: standard output cannot be written: no space left on device\n"
    code, errors = ended(command, ">/dev/full")
    assert code == 2
    assert errors.endswith(said)  # what is compiled for the first time is said before it


def test_a_reader_that_goes_away_ends_a_command() -> None:
    """The schema is longer than what a pipe holds."""
    assert ended("schema", "| true; exit ${PIPESTATUS[0]}") == (141, "")


def test_a_full_disk_for_errors_stops_nothing() -> None:
    assert ended("run goods-mini --until 20 --record", "2>/dev/full")[0] == 2  # no file is named
    assert ended("run goods-mini --until 20", "2>/dev/full")[0] == 0


def test_bad_input_has_its_exit_code_without_a_place_for_the_sentence() -> None:
    assert ended("check nosuch.yaml", "2>&-")[0] == 2
