"""Make a scenario of a problem of another program: its floor, its robots and its tasks.

FILE is a MovingAI map or scenario, a problem of the League of Robot Runners, or a folder with map.txt,
agents_K.csv and tasks_one.csv.

Exit code 0: done; 2: bad input.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from automaton.atomic_write import atomic_writer
from automaton.commands.arguments import whole
from automaton.errors import InputError
from automaton.exchange.imported_scenario import imported_files
from automaton.exchange.problem_files import read_problem
from automaton.units import count

DEFAULT_TICKS = 1000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton import`."""
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="a .map, a .scen, a problem .json, or a folder")
    add("--out", type=Path, required=True, metavar="YAML", help="the scenario; files beside it")
    add(
        "--robots",
        type=whole("a number of robots", 1, 1_000_000),
        metavar="N",
        help="so many: the first ones, those of a folder's file with N starts, or, on a map "
        "alone, random ones",
    )
    add(
        "--ticks",
        type=whole("a number of ticks", 1, 2_000_000_000),
        default=DEFAULT_TICKS,
        metavar="N",
        help=f"a run ends after so many, default {DEFAULT_TICKS:,}",
    )
    add("--force", action="store_true", help="replace files that are there and say something else")


def run(args: argparse.Namespace) -> int:
    """Read the problem, write the scenario with its starts and tasks."""
    out: Path = args.out
    if out.suffix not in (".yaml", ".yml"):
        raise InputError("--out must end in .yaml", str(out))
    problem = read_problem(args.file, args.robots)
    texts = imported_files(problem, out.stem, args.ticks)
    names = [*list(texts)[:-1], out.name]
    files = {
        out.with_name(name): text.encode() for name, text in zip(names, texts.values(), strict=True)
    }
    for path, content in files.items():
        check_replaced(path, content, args.file, args.force)
    for path, content in files.items():
        with atomic_writer(path) as file:
            file.write(content)
    grid = problem.grid
    print(
        f"{out}: {count(problem.robots, 'robot')} on {grid.width} x {grid.height} cells, "
        f"{count(len(problem.tasks), 'task')}"
    )
    print(f"with it: {', '.join(names[:-1])}")
    return 0


def check_replaced(path: Path, content: bytes, source: Path, force: bool) -> None:
    """Raises InputError for a file that `content` must not replace; the same content may."""
    if not os.path.exists(path):
        return
    if not path.is_file() or path.samefile(source):
        raise InputError("is not replaced: give another --out", str(path))
    try:
        same = path.read_bytes() == content
    except OSError:
        same = False
    if not same and not force:
        raise InputError(
            "is there already: give another --out, or --force to replace it", str(path)
        )
