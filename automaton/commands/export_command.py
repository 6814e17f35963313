"""Export a recorded run, or the floor of a scenario, to the format of another tool.

A recording becomes a PlanViz file or a trace of VDA 5050 messages. The floor of a scenario becomes a
VDMA LIF layout.

Exit code 0: done; 2: bad input, such as a run that the format cannot represent.
"""

from __future__ import annotations

import argparse
import datetime
import os
from collections.abc import Collection
from fractions import Fraction
from pathlib import Path

from automaton.atomic_write import atomic_writer, cannot_write_error
from automaton.commands.arguments import add_settings_argument, measured, say
from automaton.errors import InputError, alternatives, nearest
from automaton.exchange.lif_export import LATEST_LIF as LATEST_LIF
from automaton.exchange.lif_export import LIF_VERSIONS as LIF_VERSIONS
from automaton.exchange.lif_export import lif_file
from automaton.recording.recording_reader import read_recording
from automaton.scenario.text_files import find
from automaton.units import count, exact_time
from automaton.world.floor_parts import all_station_names
from automaton.world.resolve import resolve


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton export`."""
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="a recording; with --lif, a scenario"
    )
    formats = parser.add_mutually_exclusive_group(required=True)
    formats.add_argument(
        "--planviz",
        type=Path,
        metavar="JSON",
        help="write a League of Robot Runners output, for PlanViz and `verify --problem`",
    )
    formats.add_argument(
        "--vda5050",
        type=Path,
        metavar="JSONL",
        help="write VDA 5050 `state` messages: one line for each robot and period, or, with --on-events, "
        "for each change of a robot's state",
    )
    formats.add_argument(
        "--lif", type=Path, metavar="LIF", help="write the floor of a scenario as VDMA LIF"
    )
    parser.add_argument(
        "--every",
        type=measured("a time", "1s", exact_time),
        metavar="1s",
        help="set the period of --vda5050 (default: 1 s, or one tick if a tick is longer); with "
        "--on-events, the longest pause between two messages of a robot (default: 30 s)",
    )
    parser.add_argument(
        "--on-events",
        action="store_true",
        help="with --vda5050: a robot sends a message when its state changes, as the standard demands",
    )
    parser.add_argument(
        "--version",
        metavar="V",
        help="use this version of the standard: VDA 5050 3.0.0 (default) or 2.1.0, LIF 2.0.0 "
        "(default) or 1.0.0",
    )
    add_settings_argument(
        parser, "with --lif, change a value of the scenario, such as units.cell=1m; may be repeated"
    )


def run(args: argparse.Namespace) -> int:
    """Read the source and write the exported file."""
    if args.vda5050 is None and args.every is not None:
        raise InputError("--every needs --vda5050")
    if args.vda5050 is None and args.on_events:
        raise InputError("--on-events needs --vda5050")
    if args.lif is None and args.settings:
        raise InputError("--set needs --lif")
    if args.vda5050 is not None:
        return export_trace(args.file, args.vda5050, args.every, args.version, args.on_events)
    if args.lif is not None:
        return export_layout(args.file, args.lif, args.version, args.settings)
    if args.version is not None:
        raise InputError("--version needs --vda5050 or --lif")
    return export_output(args.file, args.planviz)


def export_output(file: Path, out: Path) -> int:
    """Export a recording for PlanViz."""
    import msgspec

    recording = read_recording(file)
    recording.check_simulated("an export", file)
    from automaton.exports.planviz_export import planviz_output

    check_writable(file, out)
    try:
        output = planviz_output(recording)
    except InputError as error:
        raise error.at(str(file)) from None
    with atomic_writer(out) as stream:
        stream.write(msgspec.json.encode(output))
    say(
        f"{out}: {count(output['teamSize'], 'robot')}, {count(output['makespan'], 'tick')}, "
        f"{count(output['numTaskFinished'], 'task')} finished"
    )
    return 0


def export_trace(
    file: Path, out: Path, every: Fraction | None, version: str | None, on_events: bool
) -> int:
    """Export a recording as VDA 5050 messages."""
    from automaton.exports.vda5050_export import LATEST, VERSIONS, write_trace

    version = known_version(version or LATEST, VERSIONS)
    recording = read_recording(file)
    recording.check_simulated("an export", file)
    check_writable(file, out)
    try:
        with atomic_writer(out) as stream:
            size = write_trace(recording, stream, every, version, on_events)
    except InputError as error:
        raise error.at(str(file)) from None
    say(
        f"{out}: {count(size.robots, 'robot')}, {count(size.messages, 'message')} of VDA 5050 {version}"
    )
    return 0


def export_layout(file: Path, out: Path, version: str | None, settings: list[str]) -> int:
    """Export the floor of a scenario as a LIF layout."""
    import msgspec

    version = known_version(version or LATEST_LIF, LIF_VERSIONS)
    resolved = resolve(str(file), settings)
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    check_writable(find(file), out)
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
    names = all_station_names(scenario, floor_plan)
    try:
        lif = lif_file(scenario, floor_plan, names, version, now.replace("+00:00", "Z"))
    except InputError as error:
        raise error.at(str(file)) from None
    with atomic_writer(out) as stream:
        stream.write(msgspec.json.format(msgspec.json.encode(lif.data), indent=1))
    size = f"{count(lif.nodes, 'node')}, {count(lif.edges, 'edge')}"
    say(f"{out}: VDMA LIF {version}, {size}, cells of {scenario.units.cell}")
    if lif.lost:
        say("left out: " + ", ".join(f"{name} {n:,}" for name, n in lif.lost.items()))
    return 0


def known_version(version: str, known: Collection[str]) -> str:
    """Return the version if it is supported. Raises InputError."""
    if version not in known:
        text = f"--version {version} is not supported{nearest(version, known)}"
        raise InputError(f"{text}; use {alternatives(known)}")
    return version


def check_writable(source: Path, out: Path) -> None:
    """Raise InputError for a file that must not be replaced."""
    if os.path.exists(out) and (not out.is_file() or out.samefile(source)):
        raise cannot_write_error("this is the input file, or not a regular file", out)
