"""Whether anything breaks on random floors with everything on at once: run by hand.

    nice python tests/proofs/everything_on.py --ticks 1e6 --seed 1

Floors, fleets, gates, pods, batteries, faults and strategies are random (helpers/whole_floors.py). What
`check` accepts is run to its end and recorded; the recording is verified, played back, counted again
without the validator (helpers/counted_recordings.py), and run with its robots stored in another sequence;
the report of `run` is printed to nowhere. Now and then a scenario goes through the command line as a
file, tables included. A finding is named by its seed: `--only SEED` repeats it, `--yaml SEED` prints its
scenario. Exits with 1 if anything is found.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import msgspec
import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from counted_recordings import flaws_of
from whole_floors import contents_of, drawn_whole, resolved_whole

from automaton.commands import main as command_line
from automaton.commands.check import described
from automaton.commands.run import as_json
from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_GATE,
    ACTION_MOVE,
    ACTION_STATION_QUEUE,
)
from automaton.errors import InputError, refuse
from automaton.history.playback import Playback
from automaton.recording.frames import Recording
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.headless import run_once
from automaton.runs.run_diagnosis import JamWatch
from automaton.runs.run_report import print_report
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify_recording
from automaton.world.bounds import bounds_in_words
from automaton.world.conversion_table import conversion_lines
from automaton.world.resolved import Resolved
from automaton.world.scenario_warnings import misfits, scenario_warnings

LENGTHS = (200, 400, 400, 1000, 2000)  # ticks of runs
AS_FILE = 25  # every so many-th scenario goes through the command line
AT_ONCE = 100  # runs between two lines of counts
REFUSALS = (InputError, msgspec.ValidationError)


class Outcome(NamedTuple):
    """What a trial led to."""

    flaws: list[str]
    counts: Counter[str]


def length_of(number: int) -> int:
    """Ticks after which the run of a number stops."""
    return Random(f"length {number}").choice(LENGTHS)


def scenario_of(number: int, ticks: int | None = None) -> dict[str, Any]:
    """Return the scenario of a number as plain data."""
    return drawn_whole(number, ticks or length_of(number))


def trial(number: int, folder: Path, ticks: int | None = None) -> Outcome:
    """Draw a scenario, check it, and do all that its run must withstand."""
    scenario = scenario_of(number, ticks)
    try:
        resolved = resolved_whole(scenario)
        refuse(misfits(resolved))
    except REFUSALS as error:
        reason = "".join(" " if letter.isdigit() else letter for letter in str(error))[:60]
        return Outcome([], Counter({"refused": 1, f"refused: {reason}": 1}))
    except Exception:
        return Outcome([f"check: {last_line()}"], Counter())
    flaws: list[str] = []
    counts = Counter(runs=1, **{f"with {name}": 1 for name in contents_of(scenario)})
    try:
        described(resolved), conversion_lines(resolved.unrefined), bounds_in_words(resolved)
        scenario_warnings(resolved)
        flaws += flaws_of_run(resolved, number, counts)
        if number % AS_FILE == 0:
            flaws += flaws_of_commands(scenario, folder)
    except Exception:
        flaws.append(last_line())
    return Outcome(flaws, counts)


def last_line() -> str:
    """The error that is handled, and where it was raised."""
    lines = traceback.format_exc().strip().splitlines()
    places = [line.strip() for line in lines if line.strip().startswith("File ")]
    return f"{lines[-1]} ({places[-1].split('/')[-1]})"


def flaws_of_run(resolved: Resolved, number: int, counts: Counter[str]) -> list[str]:
    """Run a scenario four times: recorded, verified, stored otherwise, and as `run` does it."""
    run, recording = recorded(resolved, Random(number))
    verification = verify_recording(recording)
    flaws = [str(one) for one in verification.report.violations[:5]]
    if verification.difference is not None:
        flaws.append(f"run again: {verification.difference}")
    flaws += [f"counted again: {flaw}" for flaw in flaws_of(recording)[:5]]
    playback = Playback(recording.header, recording.stored())
    playback.go_to(run.tick)
    if playback.simulation.digest != run.digest:
        flaws.append("played back: the digest differs")
    if stored_otherwise(resolved, number) != run.digest:
        flaws.append("stored otherwise: the digest differs")
    outcome = run_once(resolved, watch=JamWatch(lambda *jam: None))
    if outcome.digest != run.digest:
        flaws.append("without a recording: the digest differs")
    with contextlib.redirect_stdout(io.StringIO()) as out:
        print_report(resolved, outcome)
    json.loads(msgspec.json.encode(as_json(resolved, outcome)))
    if not out.getvalue():
        flaws.append("nothing is reported")
    if run.world.tally.illegal.any():
        flaws.append("an answer of a strategy is illegal")
    counts.update(happened(run))
    return flaws


def recorded(resolved: Resolved, chance: Random) -> tuple[Simulation, Recording]:
    """Run a scenario to its end and record it, with more states than a file may have."""
    end = resolved.scenario.stop.max_duration
    recorder = MemoryRecorder(resolved)
    run = Simulation(resolved, on_record=recorder)
    while not run.finished and run.tick < end:
        run.run(until=min(end, run.tick + chance.randint(5, 120)))
        recorder(run)
        recorder.flush()
        if run.tick > recorder._keyframe_at:
            recorder._keyframe(run.world)
    return run, recorder.recording()


def stored_otherwise(resolved: Resolved, number: int) -> str:
    """The digest of the run with its robots stored in another sequence."""
    storage = list(range(resolved.scenario.fleet.robots))
    Random(number).shuffle(storage)
    run = Simulation(resolved, storage=np.array(storage, np.int32))
    run.run()
    return run.digest


def happened(run: Simulation) -> Counter[str]:
    """What a run came to."""
    world, tally = run.world, run.world.tally
    robots = run.resolved.scenario.fleet.robots
    operations = tally.operations.sum((0, 2))
    return Counter(
        ticks=run.tick,
        robot_ticks=run.tick * robots,
        finished=int(run.finished),
        moves=int(operations[ACTION_MOVE]),
        visits=int(tally.visits.sum()),
        delivered=int((world.orders.delivered >= 0).sum()),
        lines=int((world.lines.done >= 0).sum()),
        failures=int(tally.failures[:, :2].sum()),
        tows=int(tally.failures[:, 2].sum()),
        at_gates=int(tally.ticks[:, ACTION_GATE].sum()),
        in_queues=int(tally.ticks[:, ACTION_STATION_QUEUE].sum()),
        charging=int(tally.ticks[:, ACTION_CHARGE].sum()),
    )


def flaws_of_commands(scenario: dict[str, Any], folder: Path) -> list[str]:
    """Check, run with tables, and verify a scenario as a file."""
    file, path, tables = folder / "whole.yaml", folder / "file.rec", folder / "tables"
    file.write_text(as_yaml(scenario), encoding="utf-8")
    flaws = []
    for arguments, good in (
        (["check", str(file)], (0,)),
        (["run", str(file), "--record", str(path), "--csv", str(tables), "--events"], (0, 1)),
        (["verify", str(path), "--json"], (0,)),
    ):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = command_line(arguments)
        if code not in good:
            flaws.append(
                f"automaton {arguments[0]}: {code}: {(err.getvalue() or out.getvalue())[-300:]}"
            )
    for table in tables.glob("*"):
        table.unlink()
    return flaws


def as_yaml(scenario: dict[str, Any]) -> str:
    """The scenario as a file."""
    plain = json.loads(json.dumps(scenario))
    return yaml.safe_dump(plain, sort_keys=False, default_flow_style=None, width=100)


def trials(numbers: range, ticks: float = float("inf"), length: int | None = None) -> Outcome:
    """Try the scenarios of these numbers, until so many ticks are run."""
    findings: list[str] = []
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            if counts["ticks"] >= ticks:
                break
            flaws, more = trial(number, Path(folder), length)
            counts.update(more)
            findings += [f"seed {number}: {flaw}" for flaw in flaws]
            for flaw in flaws:
                print(f"seed {number}: {flaw}", flush=True)
            if (number - numbers.start + 1) % AT_ONCE == 0:
                print(summary(counts, findings), flush=True)
    return Outcome(findings, counts)


def summary(counts: Counter[str], findings: list[str]) -> str:
    """Counts on a line."""
    names = ("runs", "refused", "ticks", "robot_ticks", "moves", "delivered", "lines", "failures")
    return ", ".join(f"{counts[name]:,} {name}" for name in names) + f", {len(findings)} found"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--ticks", type=float, default=1e6)
    parser.add_argument("--seed", type=int, default=1, help="the first one")
    parser.add_argument("--only", type=int, metavar="SEED")
    parser.add_argument("--yaml", type=int, metavar="SEED")
    options = parser.parse_args()
    if options.yaml is not None:
        print(as_yaml(scenario_of(options.yaml)), end="")
        return 0
    begun, first = time.monotonic(), options.seed
    numbers = range(first, 1 << 40)
    if options.only is not None:
        numbers = range(options.only, options.only + 1)
    findings, counts = trials(numbers, options.ticks)
    for name, count in sorted(counts.items(), key=lambda pair: -pair[1]):
        print(f"{count:12,} {name}")
    print(f"{len(findings)} found; {time.monotonic() - begun:.0f} s")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
