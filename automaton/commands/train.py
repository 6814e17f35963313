"""Train a network that predicts which zones a robot will cross, or compare other predictors.

The network is written to --out at the end of training; Ctrl-C writes nothing. Needs the extra `learn`.
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
    "--legs": ("legs", 2, "learn from N legs, half from racks to docks and half back"),
    "--batch": ("batch", 1, "use N legs per step"),
    "--epochs": ("epochs", 1, "train for at most N epochs"),
    "--patience": ("patience", 1, "stop after N epochs without a lower loss"),
    "--seed": ("seed", 0, "draw training legs and first weights from seed N, test legs from N + 1"),
}
# A mode refuses the options that it does not use.
REFUSED_OPTIONS = {
    "tables": ("loss", "weighting", "keep"),
    "depths": ("loss", "weighting", "keep"),
    "classifiers": ("loss", "weighting", "keep", "batch", "epochs", "patience", "rate", "out"),
}
ProgressCallback = Callable[[str], None]  # argument: the current step


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton train`."""
    add, default = parser.add_argument, Settings()
    add("name", metavar="NAME", help=f"the network to train: {alternatives(TRAINED_NAMES)}")
    text = f"use the floor of this scenario (default: {PAPER})"
    add("--scenario", default=PAPER, metavar="SCENARIO", help=text)
    such = "such as world.traffic_zones=directed"
    add_settings_argument(parser, f"change a value of the scenario, {such}; may be repeated")
    text = f"minimize this loss: {alternatives(LOSSES)} (default: {default.loss})"
    add("--loss", metavar="LOSS", help=text)
    text = (
        f"correct the class imbalance by: {alternatives(WEIGHTINGS)} (default: {default.weighting})"
    )
    add("--weighting", metavar="W", help=text)
    for option, (name, _, text) in NUMBER_OPTIONS.items():
        value = f"{getattr(default, name):,}"
        add(option, type=int, metavar="N", help=f"{text} (default: {value})")
    text = f"set the learning rate of Adam (default: {default.rate:g})"
    add("--rate", type=float, metavar="R", help=text)
    add(
        "--keep",
        metavar="A,B",
        help="keep the weights of an epoch only if all named measures improve: "
        f"{alternatives(MEASURES)} (default: if the loss falls)",
    )
    add(
        "--out",
        type=Path,
        metavar="FILE",
        help="write the network (default: SCENARIO.npz), or the tables as JSON, to FILE",
    )
    add_json_argument(parser)
    modes = parser.add_mutually_exclusive_group()
    modes.add_argument(
        "--tables", action="store_true", help="do not train: reproduce Tables 1 to 4 of the paper"
    )
    modes.add_argument(
        "--depths",
        action="store_true",
        help="do not train: compare networks of 3, 6 and 12 hidden layers",
    )
    modes.add_argument(
        "--classifiers",
        action="store_true",
        help="do not train: compare classifiers other than networks",
    )


def run(args: argparse.Namespace) -> int:
    """Train, judge, write, report."""
    if args.name not in TRAINED_NAMES:
        raise InputError(
            f"unknown network '{args.name}'{nearest(args.name, TRAINED_NAMES)}; "
            f"known: {alternatives(TRAINED_NAMES)}"
        )
    modes = ("tables", "depths", "classifiers")
    mode = next((name for name in modes if getattr(args, name)), "network")
    for name in REFUSED_OPTIONS.get(mode, ()):
        if getattr(args, name) is not None:
            raise InputError(f"--{name} cannot be combined with --{mode}")
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
    """The given settings, else the defaults. Raises InputError."""
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
    """The monitored measures; () means the loss. Raises InputError."""
    names = tuple(dict.fromkeys(name.strip() for name in (text or "").split(",") if name.strip()))
    for name in names:
        if name not in MEASURES:
            raise InputError(
                f"--keep takes {alternatives(MEASURES)}, not '{name}'{nearest(name, MEASURES)}"
            )
    return names


def check_place(out: Path) -> None:
    """Raise InputError before the training if the file could not be written after it."""
    if out.is_dir():
        raise InputError(f"--out: {out} is a folder, not a file")
    if not out.parent.is_dir():
        raise InputError(f"--out: there is no folder {out.parent}")
    if not os.access(out.parent, os.W_OK):
        raise InputError(f"--out: the folder {out.parent} is not writable")


def part(library: str) -> None:
    """Raise InputError if a library of the extra `learn` is missing."""
    try:
        importlib.import_module(library)
    except ModuleNotFoundError as error:
        raise InputError(
            f"`automaton train` needs {library}, which is not installed: "
            "pip install 'fleet-automaton[learn]'"
        ) from error


@contextlib.contextmanager
def progress() -> Iterator[ProgressCallback | None]:
    """Show the progress of training on stderr if it is a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    with progress_bar(SpinnerColumn(), text, TimeElapsedColumn()) as bar:
        task = bar.add_task("drawing legs", total=None)
        yield lambda text: bar.update(task, description=text)
