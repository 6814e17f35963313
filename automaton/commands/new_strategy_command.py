"""Write a project with a strategy of your own that works at once.

Exit code 0: written; 2: bad input, and nothing is written.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from automaton.commands.arguments import note
from automaton.conformance.new_project import LAYERS, write_project


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton new-strategy`."""
    add = parser.add_argument
    text = "the name of the strategy and of its project, such as nearest-first"
    add("name", metavar="NAME", help=text)
    text = "the layer that it decides (default: allocation)"
    add("--layer", choices=tuple(LAYERS), default="allocation", help=text)
    add("--compiled", action="store_true", help="write a compiled strategy, for large fleets")
    text = "write the project into this folder (default: the current one)"
    add("--to", type=Path, default=Path(), metavar="DIR", help=text)


def run(args: argparse.Namespace) -> int:
    """Write the project, and say what comes next."""
    for file in write_project(args.name, args.layer, args.compiled, args.to):
        note(f"wrote {file}")
    folder = args.to / args.name
    print(f"pip install -e '{folder}[test]'")
    print(LAYERS[args.layer].example_run(args.layer, args.name))
    print(f"automaton check-strategy {args.layer}:{args.name} --floors 50")
    return 0
