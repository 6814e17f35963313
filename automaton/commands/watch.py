"""Watch a scenario while it is computed: play, step, go back, ask why, branch off.

Exit code 0: left with q; 2: bad input; 130 after Ctrl-C. Without a terminal: as `automaton run`.
"""

from __future__ import annotations

import argparse
import importlib
import os
from pathlib import Path
from typing import Any

from automaton.commands.arguments import add_scenario_arguments, frame_rate, tick, whole
from automaton.errors import InputError
from automaton.world.resolve import Resolved, resolve


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton watch`."""
    add_scenario_arguments(parser)
    recording = parser.add_mutually_exclusive_group()
    recording.add_argument(
        "--record", type=Path, metavar="FILE", help="record here, not in the state folder"
    )
    recording.add_argument("--no-record", action="store_true", help="record nothing")
    recording.add_argument(
        "--reload",
        action="store_true",
        help="begin again whenever a file of the scenario is written; record nothing",
    )
    parser.add_argument(
        "--against",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a second run beside the first, with this setting; may be repeated",
    )
    add_display_arguments(parser)


def add_display_arguments(parser: argparse.ArgumentParser) -> None:
    """How a run is shown; `replay` has them too."""
    group = parser.add_argument_group("display")
    add = group.add_argument
    add("--read-only", action="store_true", help="no branches, no files in this folder")
    add("--speed", type=speed, default=1.0, metavar="F", help="x1 is 10 ticks a second; or max")
    add("--at", type=tick, metavar="TICK", help="begin at this tick, paused")
    add("--paused", action="store_true", help="do not begin to play")
    add("--fps", type=frame_rate, default=30, metavar="N", help="pictures a second at most (30)")
    add("--max-kbit", type=whole("a rate", 8), metavar="N", help="send at most so many kbit/s")
    add("--renderer", choices=("auto", "direct", "textual"), default="auto", help="of the map")
    add("--ascii", action="store_true", help="no characters beyond ASCII in the map")
    add("--color", choices=("auto", "true", "256", "16", "none"), default="auto", help="depth")
    add("--theme", choices=("dark", "light"), default="dark", help="dark unless given")
    add("--plain", action="store_true", help="metrics as text, no screen")
    text = parser.add_argument_group("sentences, for logs and screen readers")
    add = text.add_argument
    add(
        "--describe",
        action="store_true",
        help="describe what happens, one sentence a line; no screen",
    )
    add(
        "--only",
        action="append",
        default=[],
        metavar="KIND",
        help="of this kind, such as faults or waits; may be repeated",
    )
    number = whole("a number of sentences", 1)
    add("--sentences", type=number, metavar="N", help="most sentences in 100 ticks (20)")


def speed(text: str) -> float:
    """A factor, or "max"."""
    try:
        factor = float("inf") if text == "max" else float(text.removeprefix("x"))
    except ValueError:
        factor = float("nan")
    least, *_, most, _ = viewer("terminal.options").SPEEDS
    if text != "max" and not least <= factor <= most:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a speed: allowed are {least:g} to {most:g}, and max"
        )
    return factor


def run(args: argparse.Namespace) -> int:
    """Show it until the user leaves."""
    if args.reload:
        return _reloading(args)
    resolved = resolve(args.scenario, args.settings, args.seed)
    other = _other(args) if args.against else None
    sources = viewer("playback.run_source")
    path, paths = None, []
    if args.record is not None:
        path = sources.checked_target(args.record)
    elif not args.no_record:
        path = sources.new_recording(resolved.scenario.name, os.environ)
        paths = [path]
    try:
        opening = sources.live(resolved, path)
        if other is not None:
            opening = sources.live_pair(resolved, other, path)
        paths = opening.paths
        return int(
            viewer("viewer.launch").show(opening, viewer("terminal.options").Options.of(args))
        )
    finally:
        for reserved in paths:
            sources.give_up_unused(reserved)


def _reloading(args: argparse.Namespace) -> int:
    """The same while files of the scenario are being written."""
    if args.against:
        raise InputError("--reload shows one run: leave out --against")
    opening = viewer("playback.run_source").reloading(
        args.scenario, lambda: resolve(args.scenario, args.settings, args.seed)
    )
    return int(viewer("viewer.launch").show(opening, viewer("terminal.options").Options.of(args)))


def _other(args: argparse.Namespace) -> Resolved:
    """The scenario of the run beside the first."""
    seeded = any(setting.startswith("seed=") for setting in args.against)
    settings = [*args.settings, *args.against]
    try:
        return resolve(args.scenario, settings, None if seeded else args.seed)
    except InputError as error:
        setting = (error.file or "").removeprefix("--set ")
        if setting in args.against:
            raise InputError(error.message, f"--against {setting}") from None
        raise


def viewer(name: str) -> Any:
    """A module of the viewer, by name: what runs headless does not import it."""
    return importlib.import_module(f"tui.{name}")
