"""Watch a scenario while it runs: play, step, go back, ask why a robot waits, or try other settings
from any tick.

Exit code 0: quit with q; 2: bad input; 130: Ctrl-C. Without a terminal: as `automaton run`.
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
        "--record", type=Path, metavar="FILE", help="record in FILE, not in the state folder"
    )
    recording.add_argument("--no-record", action="store_true", help="record nothing")
    recording.add_argument(
        "--reload",
        action="store_true",
        help="restart whenever a file of the scenario changes; record nothing",
    )
    parser.add_argument(
        "--against",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="show a second run with this setting beside the first; repeat it for further settings of "
        "the second run",
    )
    add_display_arguments(parser)


def add_display_arguments(parser: argparse.ArgumentParser) -> None:
    """The display options, which `replay` shares."""
    group = parser.add_argument_group("display")
    add = group.add_argument
    text = "allow no branches, and write no files to the current folder"
    add("--read-only", action="store_true", help=text)
    text = "play F times as fast as 10 ticks per second (default: as last time, else 1), or max"
    add("--speed", type=speed, metavar="F", help=text)
    add("--at", type=tick, metavar="TICK", help="start at this tick, paused")
    add("--paused", action="store_true", help="start paused")
    text = "draw at most N frames per second (default: 30)"
    add("--fps", type=frame_rate, default=30, metavar="N", help=text)
    text = "send at most N kbit/s to the terminal"
    add("--max-kbit", type=whole("a rate", 8), metavar="N", help=text)
    text = "choose how the map is drawn (default: auto)"
    add("--renderer", choices=("auto", "direct", "textual"), default="auto", help=text)
    add("--ascii", action="store_true", help="draw the map with ASCII characters only")
    text = "set the color depth (default: auto)"
    add("--color", choices=("auto", "true", "256", "16", "none"), default="auto", help=text)
    text = "set the colors (default: auto, as last chosen or as the background of the terminal)"
    add("--theme", choices=("auto", "dark", "light"), default="auto", help=text)
    text = "show maps as images; auto: if the terminal can (default: as in the settings, else auto)"
    add("--pixels", choices=("auto", "off", "kitty", "sixel"), help=text)
    add("--plain", action="store_true", help="print metrics as text, without a screen")
    group = parser.add_argument_group("sentences, for logs and screen readers")
    add = group.add_argument
    add(
        "--describe",
        action="store_true",
        help="describe events in words, one sentence per line, without a screen",
    )
    add(
        "--only",
        action="append",
        default=[],
        metavar="KIND",
        help="describe only events of this kind, such as faults or waits; may be repeated",
    )
    number = whole("a number of sentences", 1)
    text = "print at most N sentences per 100 ticks (default: 20)"
    add("--sentences", type=number, metavar="N", help=text)


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
    """Show the run until the user quits."""
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
    """Show the run, and restart it whenever a file of the scenario changes."""
    if args.against:
        raise InputError("--reload shows only one run: leave out --against")
    opening = viewer("playback.run_source").reloading(
        args.scenario, lambda: resolve(args.scenario, args.settings, args.seed)
    )
    return int(viewer("viewer.launch").show(opening, viewer("terminal.options").Options.of(args)))


def _other(args: argparse.Namespace) -> Resolved:
    """The scenario of the second run."""
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
    """A module of the viewer, by name: headless code must not import it."""
    return importlib.import_module(f"tui.{name}")
