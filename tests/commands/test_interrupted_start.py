"""Ctrl-C while a command is only being imported: a sentence and an exit code, as later."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
from signal_process import signal_process

# Sends the signal of Ctrl-C when a module is looked for; `importing` is what the program then does.
INTERRUPTED_AT = """
import os, runpy, signal, sys

class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == {name!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Finder)
sys.argv = ["automaton", "check", "crossing"]
runpy.run_module("automaton", run_name="__main__")
"""
# The exception passes through an `exec` of text on its way, as in the making of a dataclass.
INTERRUPTED_IN_EXEC = """
import sys
from automaton import commands

commands._dispatch = lambda *_: exec("raise KeyboardInterrupt")
sys.exit(commands.main(["list"]))
"""
# What is imported first, in the middle, last, and by the command itself.
MODULES = ("automaton.commands", "argparse", "automaton.printable", "automaton.runs.interruption")
LATER = ("automaton.commands.check", "numpy")


def ended(program: str) -> tuple[int, str]:
    command = signal_process(signal.SIGINT, [sys.executable, "-c", program])
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


@pytest.mark.parametrize("name", [*MODULES, *LATER])
def test_a_command_that_is_interrupted_within_an_import_ends_in_a_sentence(name: str) -> None:
    assert ended(INTERRUPTED_AT.format(name=name)) == (130, "automaton: interrupted\n")


def test_python_does_not_end_by_the_signal_after_the_sentence() -> None:
    assert ended(INTERRUPTED_IN_EXEC) == (130, "automaton: interrupted\n")


def test_where_interrupts_are_ignored_they_are_ignored_from_the_start() -> None:
    ignoring = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    assert ended(ignoring + INTERRUPTED_AT.format(name="automaton.commands")) == (0, "")
