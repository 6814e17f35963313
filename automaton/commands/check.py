"""Check scenario files: everything that can be known without running them."""

from __future__ import annotations

import argparse
import sys

import numpy as np

from automaton.errors import InputError
from automaton.scenario.resolve import Resolved, resolve
from automaton.world.cells import DESTINATION, SHELF


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton check`."""
    parser.add_argument("file", nargs="+", metavar="FILE", help="a file, or a shipped scenario")


def run(args: argparse.Namespace) -> int:
    """Print a line for each good file and a sentence for each bad one; 2 if any is bad."""
    bad = 0
    for file in args.file:
        try:
            print(described(resolve(file)))
        except InputError as error:
            if args.debug:
                raise
            bad += 1
            sys.stdout.flush()  # keeps the order where both streams meet
            print(f"automaton: {error}", file=sys.stderr)
    return 2 if bad else 0


def described(resolved: Resolved) -> str:
    """A good scenario in one line."""
    kinds = resolved.plan.kind
    counts = (
        (int(np.count_nonzero(kinds == SHELF)), "shelf", "shelves"),
        (int(np.count_nonzero(kinds == DESTINATION)), "destination", "destinations"),
        (resolved.scenario.fleet.robots, "robot", "robots"),
    )
    parts = ", ".join(f"{number} {one if number == 1 else many}" for number, one, many in counts)
    return f"{resolved.scenario.name}: {parts}, ok"
