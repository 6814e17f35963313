"""Write a recorded run in the format of another program: PlanViz shows it, others check it.

Exit code 0: done; 2: bad input, such as a run that the format has no place for.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from automaton.atomic_write import atomic_writer, cannot_write_error
from automaton.commands.arguments import add_recording_argument
from automaton.errors import InputError
from automaton.evidence.recording.recording_reader import read_recording
from automaton.units import count


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton export`."""
    add_recording_argument(parser, "RECORDING")
    parser.add_argument(
        "--planviz",
        type=Path,
        required=True,
        metavar="JSON",
        help="write an output of the League of Robot Runners, for PlanViz and `verify --problem`",
    )


def run(args: argparse.Namespace) -> int:
    """Read the recording, write the output."""
    import msgspec

    recording = read_recording(args.file)
    from automaton.evidence.planviz_export import planviz_output

    out: Path = args.planviz
    if os.path.exists(out) and (not out.is_file() or out.samefile(args.file)):
        raise cannot_write_error("this is the recording, or not a regular file", out)
    try:
        output = planviz_output(recording)
    except InputError as error:
        raise error.at(str(args.file)) from None
    with atomic_writer(out) as file:
        file.write(msgspec.json.encode(output))
    print(
        f"{out}: {count(output['teamSize'], 'robot')}, {count(output['makespan'], 'tick')}, "
        f"{count(output['numTaskFinished'], 'task')} finished"
    )
    return 0
