"""Look at a recording again, in any direction; two of them side by side.

Exit code 0: left with q; 2: bad input; 130 after Ctrl-C.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from automaton.commands.arguments import add_recording_argument
from automaton.commands.watch import add_display_arguments, viewer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton replay`."""
    add_recording_argument(parser)
    parser.add_argument("other", type=Path, metavar="FILE2", nargs="?", help="to compare it with")
    add_display_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Show it until the user leaves."""
    files = [args.file] + ([] if args.other is None else [args.other])
    opening = viewer("playback.run_source").recorded(*files)
    return int(viewer("viewer.launch").show(opening, viewer("terminal.options").Options.of(args)))
