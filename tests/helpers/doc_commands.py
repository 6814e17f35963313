"""Commands of the documentation, carried out in this process and in an empty folder.

Runs are shared: a command that leaves no file behind is carried out once for all pages. Sweeps and
sizes use no further processes, studies have two replications, and sizes a small budget.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import pytest
from docs_pages import ROOT, Block, Page
from remembered_runs import remembered_runs

from automaton.commands import COMMANDS, main
from automaton.studies.sweeps import pools
from automaton.studies.sweeps.study import shipped_studies

WIDTH: Final = "80"
# Commands of which only the arguments are read: they serve for ever, need an extra that tests do not
# install, or take minutes. Others of their tests run them.
ONLY_READ: Final = {
    "serve": "test_serve_command",
    "train": "test_training",
    "tune": "test_tuning",
    "streets": "test_street_search",
    "bench": "test_bench",
    "compile": "test_compile_command",
    "check-strategy": "test_conformance",
    "report --plots": "test_report",
    "watch --reload": "test_app_reload",
    "reproduce tabletop": "test_reproduce_tabletop",
    "reproduce traffic": "test_reproduce_traffic",
    "reproduce traffic-fleet": "test_reproduce_fleet",
    "reproduce auctions": "test_reproduce_auctions",
    "reproduce auctions-floor": "test_reproduce_auctions_floor",
    "reproduce zoning": "test_reproduce_zoning",
    "reproduce fleets": "test_reproduce_fleets",
    "reproduce guidance": "test_reproduce_guidance",
    "reproduce queues": "test_reproduce_queues",
}
LEAVES: Final = (
    "--out",
    "--record",
    "--picture",
    "--plots",
    "--csv",
    "--parquet",
    "--archive",
    "--summary",
    "--comparisons",
    "--matrix",
    "--planviz",
    "--vda5050",
    "--lif",
    "cast",
)
UNFINISHED: Final = ("run", "branch", "watch", "replay", "size", "compare")
REPLICATIONS: Final = "replications: 2"
BUDGET: Final = ("--budget", "110")  # of a size whose output no page shows
EXTRAS: Final = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
    "optional-dependencies"
]
NEEDS_TORCH: Final = "import torch"  # in scripts that tests do not run: they take a minute
WEIGHTS: Final = ROOT / "docs/tutorials/learned-1.npz"  # what such a script leaves
OUTPUTS: dict[str, str] = {}  # of commands that leave no file behind


def commands_of(block: Block) -> list[tuple[str, list[str]]]:
    """Return the commands of a block, each with the lines that the page shows as its output."""
    if block.language == "sh":
        joined = re.sub(r"\\\n\s*", "", block.text)
        return [(line, []) for line in joined.splitlines() if line and not line.startswith("#")]
    commands: list[tuple[str, list[str]]] = []
    for line in block.text.splitlines():
        if line.startswith("$ "):
            commands.append((line[2:], []))
        else:
            commands[-1][1].append(line)
    return commands


def write_files(page: Page, folder: Path) -> None:
    """Write the files that a page gives; studies get few replications."""
    for block in page.blocks:
        if block.title:
            text = re.sub(r"^replications: \d+", REPLICATIONS, block.text, flags=re.MULTILINE)
            (folder / block.title).write_text(text, encoding="utf-8")


@contextlib.contextmanager
def in_this_process(folder: Path) -> Iterator[None]:
    """Work in a folder, with sweeps and sizes in this process, equal runs once, screens of one width.

    Afterwards modules of the folder are forgotten, and nothing is left elsewhere.
    """
    with (
        remembered_runs(),
        pytest.MonkeyPatch.context() as patch,
        ThreadPoolExecutor(1) as executor,
    ):
        patch.setattr(pools, "LocalPool", lambda workers=None: pools.ExternalExecutor(executor))
        patch.setenv("COLUMNS", WIDTH)
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        patch.setattr(sys, "path", [*sys.path])
        patch.chdir(folder)
        yield
    for name in [path.stem for path in folder.glob("*.py")]:
        sys.modules.pop(name, None)


def carry_out(line: str, folder: Path, shown: bool = False) -> str:
    """Carry out one line of a shell in the current folder; return what it prints.

    `shown`: the page shows the output, so that a command runs however long it takes.
    """
    words = shlex.split(line, comments=True)
    program = Path(words[0]).name
    if program == "automaton":
        return run_automaton(words[1:], folder, shown)
    if program == "pip":
        check_extras(words)
    elif program in ("python", "bash"):
        check_script(words[1:], folder)
    elif program not in ("dask", "python3", "zensical"):
        raise AssertionError(f"no test knows how to run {line!r}")
    return ""


def check_extras(words: list[str]) -> None:
    """Check that the extras exist that are to be installed."""
    named = re.findall(r"fleet-automaton\[([\w,]+)\]", " ".join(words))
    assert {extra for names in named for extra in names.split(",")} <= set(EXTRAS)


def check_script(words: list[str], folder: Path) -> None:
    """Run a script that the page gives; check that one of the project exists."""
    [script] = [word for word in words if word.endswith(".py") or "/run" in word]
    path = folder / script
    if path.exists() and NEEDS_TORCH in path.read_text(encoding="utf-8"):
        shutil.copy(WEIGHTS, folder)  # test_learning_tutorial learns a little
    elif path.exists():
        subprocess.run([sys.executable, *words], cwd=folder, check=True, timeout=120)
    else:
        assert (ROOT / script).exists(), script


def run_automaton(words: list[str], folder: Path, shown: bool) -> str:
    """Run a command of automaton, or read its arguments alone."""
    parse(words)
    if is_only_read(words) and not shown:
        return ""
    if words[0] == "sweep" and words[1] in shipped_studies():
        words = [words[0], small_study(words[1], folder), *words[2:]]
    if words[0] == "size" and not shown and BUDGET[0] not in words:
        words = [*words, *BUDGET]
    key = " ".join(words)
    leaves_files = any(option in words for option in LEAVES)
    if key in OUTPUTS and not leaves_files and not any((folder / word).exists() for word in words):
        return OUTPUTS[key]
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        code = main(words)
    # A run that was to stop early did not finish, nor did its branch; a small budget decides nothing.
    # A model may differ from its site.
    assert code == 0 or (code == 1 and words[0] in UNFINISHED), key
    OUTPUTS[key] = output.getvalue()
    return OUTPUTS[key]


def is_only_read(words: list[str]) -> bool:
    """Whether only the arguments of a command are read."""
    names = [words[0], " ".join(words[:2])]
    names += [f"{words[0]} {word}" for word in words if word in ("--plots", "--reload")]
    return "--scheduler" in words or any(name in ONLY_READ for name in names)


def small_study(name: str, folder: Path) -> str:
    """Write a shipped study with few replications; return its file."""
    text = shipped_studies()[name].read_text(encoding="utf-8")
    text = re.sub(r"^replications: \d+", REPLICATIONS, text, flags=re.MULTILINE)
    path = folder / f"{name}.yaml"
    path.write_text(text, encoding="utf-8")
    return path.name


def parser_of(command: str) -> argparse.ArgumentParser:
    """Return the arguments of a command."""
    parser = argparse.ArgumentParser(prog=command, allow_abbrev=False, exit_on_error=False)
    importlib.import_module(COMMANDS[command][0]).add_arguments(parser)
    return parser


def parse(words: list[str]) -> Any:
    """Read the arguments of a command. Raises AssertionError for one that it does not take."""
    assert words and words[0] in COMMANDS, f"no command: {words}"
    parser = parser_of(words[0])
    try:
        args, unknown = parser.parse_known_args(words[1:])
    except (argparse.ArgumentError, SystemExit) as error:
        raise AssertionError(f"{words}: {error}") from None
    assert not unknown, f"{words}: {unknown}"
    return args


def compare(shown: list[str], printed: str) -> None:
    """Check that a page shows what a command prints; a line of "..." stands for any lines."""
    lines = [steady(line) for line in printed.splitlines()]
    at, skipped = 0, False
    for line in map(steady, shown):
        if line == "...":
            skipped = True
            continue
        if skipped:
            assert line in lines[at:], f"not printed: {line!r}"
            at = lines.index(line, at)
        assert at < len(lines) and lines[at] == line, (
            f"shown {line!r}, printed {lines[at : at + 1]}"
        )
        at, skipped = at + 1, False
    assert skipped or not any(lines[at:]), f"printed, and not shown: {lines[at:]}"


def steady(line: str) -> str:
    """Return a line without what differs from run to run."""
    return re.sub(r"computed in [\d.,]+ m?s", "computed in", line).rstrip()
