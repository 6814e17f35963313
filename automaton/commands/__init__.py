"""The command line: finds the command, runs it, and turns what goes wrong into one sentence.

Commands are imported when they are asked for, so that `automaton --help` answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import io
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from automaton.engine.jit.compile_progress import COMPILING, UnfitNumbaError
from automaton.errors import InputError, WorkerDiedError, nearest
from automaton.printable import OutputError, PrintedText, one_line
from automaton.runs.interruption import TerminatedError, signals_raise

COMMANDS = {  # name: (module with add_arguments(parser) and run(args) -> int, what it does)
    "run": ("automaton.commands.run", "run a scenario and print its metrics"),
    "sweep": (
        "automaton.commands.sweep_command",
        "run or resume a study of many runs",
    ),
    "watch": ("automaton.commands.watch", "watch a scenario in the terminal"),
    "replay": ("automaton.commands.replay", "look at a recording, or compare two"),
    "explain": ("automaton.commands.explain", "say why a robot waits in a tick of a recording"),
    "branch": ("automaton.commands.branch", "continue a recording from a tick with other settings"),
    "cast": ("automaton.commands.cast_command", "make a film or a picture of a recording"),
    "serve": ("automaton.commands.serve", "show the viewer in a browser"),
    "report": ("automaton.commands.report_command", "report on the results of a sweep"),
    "size": ("automaton.commands.size_command", "find the smallest fleet that meets a target"),
    "tune": ("automaton.commands.tune", "find the strategies that do best in a scenario"),
    "reproduce": ("automaton.commands.reproduce", "print a published table beside ours"),
    "train": ("automaton.commands.train", "train a predictor of traffic (extra learn)"),
    "verify": ("automaton.commands.verify", "re-run a recording and name the first difference"),
    "import": (
        "automaton.commands.import_command",
        "make a scenario of a problem of another program",
    ),
    "export": (
        "automaton.commands.export_command",
        "write a recording in the format of another program",
    ),
    "check": ("automaton.commands.check", "check scenario and study files"),
    "schema": (
        "automaton.commands.schema_command",
        "print the JSON Schema of scenarios or studies",
    ),
    "list": ("automaton.commands.list_", "list scenarios, studies, floors and strategies"),
    "compile": ("automaton.commands.compile_command", "compile before a batch what its runs need"),
    "bench": ("automaton.commands.bench_command", "measure the speed of this machine"),
}

LONGEST_ERROR = 300  # characters of an internal error; compilers write pages
DONE, FAILED, BAD_INPUT, INTERRUPTED, BROKEN_PIPE, TERMINATED = 0, 1, 2, 130, 141, 143


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are InputErrors."""

    def error(self, message: str) -> NoReturn:
        message = re.sub(r"invalid int value: ('.*')", r"\1 is not a whole number", message)
        raise InputError(f"{message}; see `{self.prog} --help`")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line `argv` (default: this process's) and return the exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in arguments
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without "ń" shows "?"
    before = sys.stdout, sys.stderr
    output = PrintedText(sys.stdout, is_output=True)
    sys.stdout, sys.stderr = output, PrintedText(sys.stderr, is_output=False)
    try:
        with signals_raise():
            code = _dispatch([argument for argument in arguments if argument != "--debug"], debug)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        output.give_up()  # the reader of a pipe went away
        return BROKEN_PIPE
    except TerminatedError:
        print("automaton: terminated", file=sys.stderr)
        return TERMINATED
    except KeyboardInterrupt:
        # Python ends by the signal if the exception has passed through an `exec` of text, such as a
        # dataclass that is made; the next one that passes makes it forget that.
        exec("")
        print("automaton: interrupted", file=sys.stderr)
        return INTERRUPTED
    except (InputError, OutputError, UnfitNumbaError) as error:
        _show_traceback(debug)
        print(f"automaton: {error}", file=sys.stderr)
        return BAD_INPUT
    except WorkerDiedError as error:
        print(f"automaton: {error}", file=sys.stderr)
        return FAILED
    except Exception as error:
        _show_traceback(debug)
        if getattr(sys.stdout, "closed", False):
            print("automaton: a strategy or plug-in has closed standard output", file=sys.stderr)
            return BAD_INPUT
        what = one_line(" ".join(f"{type(error).__name__}: {error}".split()), LONGEST_ERROR)
        print(f"automaton: internal error, {what} (--debug shows where)", file=sys.stderr)
        return FAILED
    finally:
        sys.stdout, sys.stderr = before


def _show_traceback(debug: bool) -> None:
    if debug:
        import traceback

        traceback.print_exc()


def _dispatch(arguments: list[str], debug: bool) -> int:
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(usage())
        return DONE
    name, *rest = arguments
    if name == "--version":
        print(f"automaton {version()}{commit_of(Path(__file__).parents[2])}")
        if "--verbose" in rest:
            print(surroundings())
        return DONE
    if name not in COMMANDS:
        what = "option" if name.startswith("-") else "command"
        raise InputError(
            f"unknown {what} '{name}'{nearest(name, COMMANDS)}; see `automaton --help`"
        )
    module_name, summary = COMMANDS[name]
    if os.getcwd() not in sys.path:
        # So that "module:Class" in a scenario finds a file beside it; last, lest it hide another.
        sys.path.append(os.getcwd())
    COMPILING.on_terminal = sys.stderr.isatty()
    module = importlib.import_module(module_name)
    parser = Parser(
        prog=f"automaton {name}",
        description=(module.__doc__ or summary).split("\n\n")[0],
        allow_abbrev=False,
    )
    # Taken out of the arguments before, since it may stand anywhere; named here for --help.
    parser.add_argument("--debug", action="store_true", help="show tracebacks of errors")
    module.add_arguments(parser)
    try:
        args, unknown = parser.parse_known_args(rest)
    except SystemExit as done:  # --help
        return int(done.code or 0)
    if unknown:
        known = [option for action in parser._actions for option in action.option_strings]
        hint = nearest(unknown[0].partition("=")[0], known)
        parser.error(f"unknown argument '{unknown[0]}'{hint}")
    args.debug = debug
    return int(module.run(args))


def usage() -> str:
    """The text of `automaton --help`."""
    width = max(map(len, COMMANDS)) + 2
    commands = "\n".join(f"  {name:<{width}}{summary}" for name, (_, summary) in COMMANDS.items())
    return (
        "usage: automaton COMMAND [--help] [--debug] ...\n\n"
        "Simulate fleets of mobile robots in warehouses as a cellular automaton.\n\n"
        f"commands:\n{commands}\n\n"
        f"options:\n"
        f"  {'--help':<{width}}this text, or a command's own\n"
        f"  {'--version':<{width}}the version; with --verbose, what it runs on\n"
        f"  {'--debug':<{width}}show tracebacks of errors\n"
    ).rstrip()


def surroundings() -> str:
    """What `automaton --version --verbose` says: versions and folders that a report of a fault needs."""
    import platform

    import numba
    import numpy

    from automaton.engine.jit.kernel_cache import cache_root
    from automaton.engine.jit.numba_parts import LINKS_OTHERWISE
    from automaton.runs.cores import cores

    way = "in the fast way: what only kernels call is compiled once, inside its callers"
    if LINKS_OTHERWISE:
        way = f"one by one, which takes longer: in this Numba, {LINKS_OTHERWISE}"
    return (
        f"Python {platform.python_version()}, Numba {numba.__version__}, NumPy {numpy.__version__}\n"
        f"{platform.system()} {platform.machine()}, {cores()} cores\n"
        f"compiled code in {cache_root()}\n"
        f"kernels are compiled {way}"
    )


def commit_of(root: Path) -> str:
    """ ", commit 1a2b3c4d" in a clone, "" elsewhere; from the files of Git, which may be absent."""
    folder = root / ".git"
    try:
        head = (folder / "HEAD").read_text("utf-8").strip()
        name = head.removeprefix("ref: ")
        if name == head:  # no branch
            commit = head
        elif (folder / name).exists():
            commit = (folder / name).read_text("utf-8").strip()
        else:
            packed = (folder / "packed-refs").read_text("utf-8").splitlines()
            commit = next((line.split()[0] for line in packed if line.endswith(f" {name}")), "")
    except OSError:
        return ""
    return f", commit {commit[:8]}" if commit else ""


def version() -> str:
    """The version of the installed distribution, or "unknown" in a bare checkout."""
    from importlib import metadata

    try:
        return metadata.version("fleet-automaton")
    except metadata.PackageNotFoundError:
        return "unknown"
