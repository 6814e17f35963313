"""View a recording forwards and backwards, or two recordings side by side.

Exit code 0: quit with q; 2: bad input; 130: Ctrl-C.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from automaton.commands.arguments import add_recording_argument
from automaton.commands.watch import add_display_arguments, viewer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton replay`."""
    add_recording_argument(parser)
    text = "a second recording to compare with the first"
    parser.add_argument("other", type=Path, metavar="FILE2", nargs="?", help=text)
    add_display_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Show the recordings until the user quits."""
    files = [args.file] + ([] if args.other is None else [args.other])
    opening = viewer("playback.run_source").recorded(*files)
    return int(viewer("viewer.launch").show(opening, viewer("terminal.options").Options.of(args)))
