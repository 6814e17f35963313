"""Train a network that predicts which zones robots drive through, or what was tried beside it.

A network is written to --out when training is over; Ctrl-C leaves nothing. Needs the extra `learn`.
Exit code 0: done; 2: bad input.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from automaton.commands.arguments import (
    add_json_argument,
    add_settings_argument,
    print_json,
    progress_bar,
)
from automaton.errors import InputError, alternatives, nearest
from automaton.papers.training_settings import LOSSES, MEASURES, WEIGHTINGS, Settings

TRAINED_NAMES = ("traffic",)
PAPER = "warehouse-100"
NUMBER_OPTIONS = {  # option: (field of Settings, least value, help)
    "--legs": ("legs", 2, "legs to learn from, half from racks to docks, half back"),
    "--batch": ("batch", 1, "legs in a step"),
    "--epochs": ("epochs", 1, "at most"),
    "--patience": ("patience", 1, "epochs without lower loss after which training ends"),
    "--seed": ("seed", 0, "of the legs and the first weights; seed + 1 draws those to judge by"),
}
# What a mode does not use, it refuses.
REFUSED_OPTIONS = {
    "tables": ("loss", "weighting", "keep"),
    "depths": ("loss", "weighting", "keep"),
    "classifiers": ("loss", "weighting", "keep", "batch", "epochs", "patience", "rate", "out"),
}
ProgressCallback = Callable[[str], None]  # what is done now


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton train`."""
    add, default = parser.add_argument, Settings()
    add("name", metavar="NAME", help=f"what to train: {alternatives(TRAINED_NAMES)}")
    add("--scenario", default=PAPER, metavar="SCENARIO", help=f"whose floor ({PAPER})")
    such = "such as world.traffic_zones=directed"
    add_settings_argument(parser, f"change a value of the scenario, {such}; may be repeated")
    add("--loss", metavar="LOSS", help=f"{alternatives(LOSSES)} ({default.loss})")
    add("--weighting", metavar="W", help=f"{alternatives(WEIGHTINGS)} ({default.weighting})")
    for option, (name, _, text) in NUMBER_OPTIONS.items():
        value = f"{getattr(default, name):,}"
        add(option, type=int, metavar="N", help=f"{text} ({value})")
    add("--rate", type=float, metavar="R", help=f"of Adam ({default.rate:g})")
    add(
        "--keep",
        metavar="A,B",
        help="keep weights when all of these improve: "
        f"{alternatives(MEASURES)}; else when the loss falls",
    )
    add(
        "--out", type=Path, metavar="FILE", help="the network (SCENARIO.npz), or the tables as JSON"
    )
    add_json_argument(parser)
    modes = parser.add_mutually_exclusive_group()
    modes.add_argument(
        "--tables", action="store_true", help="train for Tables 1 to 4 of the paper instead"
    )
    modes.add_argument(
        "--depths", action="store_true", help="train networks of 3, 6 and 12 hidden layers instead"
    )
    modes.add_argument(
        "--classifiers", action="store_true", help="try other classifiers instead of a network"
    )


def run(args: argparse.Namespace) -> int:
    """Train, judge, write, report."""
    if args.name not in TRAINED_NAMES:
        raise InputError(
            f"nothing called '{args.name}' to train{nearest(args.name, TRAINED_NAMES)}; "
            f"there is {alternatives(TRAINED_NAMES)}"
        )
    modes = ("tables", "depths", "classifiers")
    mode = next((name for name in modes if getattr(args, name)), "network")
    for name in REFUSED_OPTIONS.get(mode, ()):
        if getattr(args, name) is not None:
            raise InputError(f"--{name} does not go together with --{mode}")
    settings, keep = settings_of(args), keep_of(args.keep)
    if args.out is not None:
        check_place(args.out)
    part("sklearn" if mode == "classifiers" else "torch")
    training = importlib.import_module("automaton.papers.training_sessions")
    session = training.TrainingSession.of(args.scenario, args.settings, settings)
    with progress() as told:
        if mode == "network":
            outcome = session.train_network(keep, args.out or Path(f"{session.name}.npz"), told)
        elif mode == "tables":
            outcome = session.train_tables(args.out, told)
        elif mode == "depths":
            outcome = session.train_depths(args.out, told)
        else:
            outcome = session.try_classifiers(told)
    if args.json:
        print_json(outcome)
    else:
        importlib.import_module("automaton.papers.training_report").print_outcome(mode, outcome)
    return 0


def settings_of(args: argparse.Namespace) -> Settings:
    """The settings that were given, else the defaults. Raises InputError."""
    given: dict[str, Any] = {}
    for option, (name, least, _) in NUMBER_OPTIONS.items():
        value = getattr(args, name)
        if value is not None and value < least:
            raise InputError(f"{option} must be at least {least}, not {value}")
        given[name] = value
    if args.rate is not None and not 0 < args.rate <= 1:
        raise InputError(f"--rate must be above 0 and at most 1, not {args.rate:g}")
    given["rate"] = args.rate
    for name, known in (("loss", tuple(LOSSES)), ("weighting", WEIGHTINGS)):
        value = given[name] = getattr(args, name)
        if value is not None and value not in known:
            raise InputError(
                f"--{name} must be {alternatives(known)}, not '{value}'{nearest(value, known)}"
            )
    return Settings(**{name: value for name, value in given.items() if value is not None})


def keep_of(text: str | None) -> tuple[str, ...]:
    """The metrics that are monitored; none means the loss. Raises InputError."""
    names = tuple(dict.fromkeys(name.strip() for name in (text or "").split(",") if name.strip()))
    for name in names:
        if name not in MEASURES:
            raise InputError(
                f"--keep takes {alternatives(MEASURES)}, not '{name}'{nearest(name, MEASURES)}"
            )
    return names


def check_place(out: Path) -> None:
    """Raises InputError now rather than after the training if a file cannot be written there."""
    if out.is_dir():
        raise InputError(f"--out names the folder {out}, not a file")
    if not out.parent.is_dir():
        raise InputError(f"--out: there is no folder {out.parent}")
    if not os.access(out.parent, os.W_OK):
        raise InputError(f"--out: nothing may be written into {out.parent}")


def part(library: str) -> None:
    """Raises InputError if a library of the extra `learn` is missing."""
    try:
        importlib.import_module(library)
    except ModuleNotFoundError as error:
        raise InputError(
            f"`automaton train` needs {library}, which is not installed: "
            "pip install 'fleet-automaton[learn]'"
        ) from error


@contextlib.contextmanager
def progress() -> Iterator[ProgressCallback | None]:
    """A line on a terminal's stderr that says what is trained and how far; nothing in a pipe."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    with progress_bar(SpinnerColumn(), text, TimeElapsedColumn()) as bar:
        task = bar.add_task("drawing legs", total=None)
        yield lambda text: bar.update(task, description=text)
