"""The command line: find the command, run it, and report an error in one sentence.

A command's module is imported only when needed, so that `automaton --help` answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import io
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from automaton.commands.status_line import STATUS_LINE, print_next
from automaton.engine.jit.compile_progress import COMPILING, UnfitNumbaError
from automaton.errors import InputError, WorkerDiedError, nearest
from automaton.printable import OutputError, PrintedText, one_line
from automaton.runs.interruption import TerminatedError, signals_raise

COMMANDS_BY_SUBJECT = {  # {name: (module with add_arguments(parser) and run(args) -> int, summary)}
    "scenarios": {
        "list": ("automaton.commands.list_", "list scenarios, studies, floors and strategies"),
        "check": ("automaton.commands.check", "check scenario and study files"),
        "schema": (
            "automaton.commands.schema_command",
            "print the JSON Schema of scenarios or studies",
        ),
        "import": (
            "automaton.commands.import_command",
            "import a layout or benchmark from another tool",
        ),
        "export": (
            "automaton.commands.export_command",
            "export a recording or a floor for another tool",
        ),
    },
    "one run": {
        "run": ("automaton.commands.run", "run a scenario and print its metrics"),
        "watch": ("automaton.commands.watch", "watch a scenario in the terminal"),
        "log": (
            "automaton.commands.log_command",
            "make a recording from a log of real robots",
        ),
        "replay": ("automaton.commands.replay", "view a recording, or compare two"),
        "explain": ("automaton.commands.explain", "explain why a robot waits at a tick"),
        "branch": (
            "automaton.commands.branch",
            "continue a recording from a tick with other settings",
        ),
        "cast": ("automaton.commands.cast_command", "make a film or a picture of a recording"),
        "serve": ("automaton.commands.serve", "serve the viewer to browsers"),
        "verify": (
            "automaton.commands.verify",
            "run a recording again and report the first difference",
        ),
    },
    "decisions": {
        "size": ("automaton.commands.size_command", "find the smallest fleet that meets a target"),
        "what-if": (
            "automaton.commands.what_if_command",
            "compare changes of a scenario with the unchanged scenario",
        ),
        "compare": (
            "automaton.commands.compare_command",
            "judge whether a model matches days of a site",
        ),
        "calibrate": (
            "automaton.commands.calibrate_command",
            "fit a scenario to a log of real robots, or demand to orders",
        ),
        "bottlenecks": (
            "automaton.commands.bottlenecks_command",
            "rank single changes of a scenario by their effect",
        ),
        "streets": (
            "automaton.commands.streets_command",
            "search weights of streets that guide the traffic",
        ),
        "tune": ("automaton.commands.tune", "find the best strategies for a scenario"),
    },
    "studies": {
        "sweep": ("automaton.commands.sweep_command", "run or resume a study of many runs"),
        "report": ("automaton.commands.report_command", "report on the results of a sweep"),
        "reproduce": ("automaton.commands.reproduce", "reproduce a published table"),
        "train": (
            "automaton.commands.train",
            "train a predictor of traffic (needs fleet-automaton[learn])",
        ),
    },
    "strategies": {
        "check-strategy": (
            "automaton.commands.check_strategy_command",
            "check a strategy on random floors",
        ),
        "new-strategy": (
            "automaton.commands.new_strategy_command",
            "write a project with a strategy of your own",
        ),
    },
    "this machine": {
        "compile": (
            "automaton.commands.compile_command",
            "compile everything for a batch in advance",
        ),
        "bench": ("automaton.commands.bench_command", "measure the speed of this machine"),
    },
}
COMMANDS = {
    name: command for group in COMMANDS_BY_SUBJECT.values() for name, command in group.items()
}

FULL_SCREEN = ("watch", "replay", "serve")  # commands that draw on the terminal themselves
LONGEST_ERROR = 300  # characters of an internal error; compilers write pages
DONE, FAILED, BAD_INPUT, INTERRUPTED, BROKEN_PIPE, TERMINATED = 0, 1, 2, 130, 141, 143


def broken(text: str, width: int) -> list[str]:
    """The lines of a text that breaks at blanks alone."""
    text = " ".join(text.split())
    return textwrap.wrap(text, max(width, 8), break_long_words=False, break_on_hyphens=False) or [
        ""
    ]


class HelpLines(argparse.HelpFormatter):
    """The usual form of --help, with lines that break at blanks and at line breaks of a text alone."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        return [line for part in text.split("\n") for line in broken(part, width)]

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(indent + line for line in broken(text, width - len(indent)))

    def _format_usage(self, *args: Any) -> str:
        """The usage; if one of its parts is wider than the terminal, it breaks at any blank."""
        text = super()._format_usage(*args)
        if max(map(len, text.splitlines())) <= self._width:
            return text
        return "\n       ".join(broken(text, self._width - 7)) + "\n\n"


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
    output = PrintedText(sys.stdout, True, STATUS_LINE.clear)
    sys.stdout, sys.stderr = output, PrintedText(sys.stderr, False, STATUS_LINE.clear)
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
        # CPython exits by the signal if the exception has passed through an `exec` of text, as when
        # a dataclass is created. Another `exec` clears that flag.
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
    if not arguments and sys.stdin.isatty() and sys.stdout.isatty():
        chosen = importlib.import_module("tui.viewer.launch").pick_command(Path.cwd())
        return DONE if chosen is None else _dispatch(chosen, debug)
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
    if os.getcwd() not in sys.path:
        # "module:Class" in a scenario may name a file in this folder. Last: it must hide no module.
        sys.path.append(os.getcwd())
    COMPILING.on_terminal = sys.stderr.isatty()
    line = sys.stderr if name not in FULL_SCREEN else None
    with STATUS_LINE.shown(getattr(line, "stream", None), name):
        args = arguments_of(name, rest)
        if args is None:  # --help
            return DONE
        args.debug = debug
        code = int(sys.modules[COMMANDS[name][0]].run(args))
    if code == DONE:
        print_next(name, vars(args))
    return code


def arguments_of(name: str, rest: Sequence[str]) -> argparse.Namespace | None:
    """Import a command and read its arguments; None if its help was printed. Raises InputError."""
    module_name, summary = COMMANDS[name]
    module = importlib.import_module(module_name)
    parser = Parser(
        prog=f"automaton {name}",
        description=(module.__doc__ or summary).split("\n\n")[0],
        formatter_class=HelpLines,
        allow_abbrev=False,
    )
    # --debug may stand anywhere, so `main` has removed it; here it only appears in --help.
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    module.add_arguments(parser)
    try:
        args, unknown = parser.parse_known_args(rest)
    except SystemExit:
        return None
    if unknown:
        known = [option for action in parser._actions for option in action.option_strings]
        hint = nearest(unknown[0].partition("=")[0], known)
        parser.error(f"unknown argument '{unknown[0]}'{hint}")
    return args


def usage() -> str:
    """The text of `automaton --help`."""
    columns, names = shutil.get_terminal_size().columns, max(map(len, COMMANDS)) + 4

    def line(name: str, text: str) -> str:
        return f"  {name:<{names - 2}}" + f"\n{'':{names}}".join(broken(text, columns - names))

    about = "Simulate fleets of mobile robots in warehouses as a cellular automaton."
    groups = {
        subject: {name: text for name, (_, text) in group.items()}
        for subject, group in COMMANDS_BY_SUBJECT.items()
    }
    groups["options"] = {
        "--help": "show this text; after COMMAND, the help of that command",
        "--version": "show the version; with --verbose, also Python and the machine",
        "--debug": "show the traceback of an error",
    }
    parts = [
        "\n".join([f"{subject}:", *(line(*one) for one in group.items())])
        for subject, group in groups.items()
    ]
    usage_line = "usage: automaton COMMAND [--help] [--debug] ..."
    return "\n\n".join([usage_line, "\n".join(broken(about, columns)), *parts])


def surroundings() -> str:
    """The text of `automaton --version --verbose`: versions and folders for a bug report."""
    import platform

    import numba
    import numpy

    from automaton.engine.jit.kernel_cache import cache_root
    from automaton.engine.jit.numba_parts import LINKS_OTHERWISE
    from automaton.runs.first_compilation import cores

    way = "the fast way: functions that only kernels call are compiled once, inside their callers"
    if LINKS_OTHERWISE:
        way = f"one by one, which is slower: in this Numba, {LINKS_OTHERWISE}"
    text = (
        f"Python {platform.python_version()}, Numba {numba.__version__}, NumPy {numpy.__version__}\n"
        f"{platform.system()} {platform.machine()}, {cores()} cores\n"
        f"compiled code in {cache_root()}\n"
        f"kernels are compiled {way}"
    )
    columns = shutil.get_terminal_size((80, 24)).columns
    return "\n".join(line for part in text.splitlines() for line in broken(part, columns))


def commit_of(root: Path) -> str:
    """Return ", commit 1a2b3c4d" in a clone, else ""; read from Git's files, as git may be absent."""
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
