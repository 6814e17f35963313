"""Record scenarios to their end and verify the recordings: all rules kept, every tick equal.

    python tests/proofs/shipped_recordings.py [SCENARIO ...] [--seeds 1 2 3]

Without names all shipped scenarios are recorded, which takes a quarter of an hour. A line for each
recording shows seconds and peak memory of `run` and of `verify`, each of which is a process of its own.
Exits with 1 if a recording is not verified.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from automaton.scenario.text_files import shipped

SEEDS = (1, 2, 3)
HEADLINE = "scenario             seed    ticks  robots     run  verify       run    verify"


class Process(NamedTuple):
    """What a command of automaton printed and took."""

    printed: str
    messages: str
    seconds: float
    memory: int  # MiB at the peak

    @property
    def answer(self) -> dict[str, Any]:
        """The object that it printed; empty if it printed none."""
        return json.loads(self.printed) if self.printed else {}


class Row(NamedTuple):
    """A recording, and what `verify` said of it."""

    scenario: str
    seed: int
    recorded: Process
    verified: Process

    @property
    def flaw(self) -> str:
        """What is wrong, or an empty string."""
        answer = self.verified.answer
        if not answer:
            return (self.recorded.messages + self.verified.messages).strip().split("\n")[-1]
        if answer["verified"] and answer["complete"]:
            return ""
        reasons = [one["sentence"] for one in answer["violations"]]
        if answer["difference"] is not None:
            reasons.append(f"run again: {answer['difference']}")
        return (reasons or ["there is no end"])[0]

    def __str__(self) -> str:
        run, verify = self.recorded, self.verified
        robots = len(run.answer.get("robots", ()))
        ticks = f"{verify.answer.get('ticks', 0):,}"
        times = f"{run.seconds:6.1f} s{verify.seconds:6.1f} s"
        memory = f"{run.memory:6} MiB{verify.memory:6} MiB"
        return (
            f"{self.scenario:<20}{self.seed:>5}{ticks:>9}{robots:>8}{times}{memory}  {self.verdict}"
        )

    @property
    def verdict(self) -> str:
        """Whether it is verified, and whether the run came to the end that its scenario wants."""
        if self.flaw:
            return f"NOT VERIFIED: {self.flaw}"
        return "verified" if self.recorded.answer["finished"] else "verified, run not finished"


def process(folder: Path, *arguments: str) -> Process:
    """Run a command of automaton and measure it."""
    begun = time.monotonic()
    with (folder / "out").open("w+") as out, (folder / "err").open("w+") as err:
        child = subprocess.Popen(
            [sys.executable, "-m", "automaton", *arguments], stdout=out, stderr=err
        )
        _, status, usage = os.wait4(child.pid, 0)  # of this child alone
        child.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.monotonic() - begun
        return Process(text_of(out), text_of(err), seconds, usage.ru_maxrss >> 10)


def text_of(file: IO[str]) -> str:
    """Return all that was written to a file."""
    file.seek(0)
    return file.read()


def rows(scenarios: list[str], seeds: list[int]) -> Iterator[Row]:
    """Record each scenario with each seed, and verify it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for scenario in scenarios:
            for seed in seeds:
                file = str(folder / "run.rec")
                recorded = process(
                    folder, "run", scenario, "--seed", str(seed), "--record", file, "--json"
                )
                yield Row(scenario, seed, recorded, process(folder, "verify", file, "--json"))
                Path(file).unlink(missing_ok=True)


def main(arguments: list[str]) -> int:
    """Print a line for each recording; 1 if one is not verified."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenario", nargs="*", help="shipped ones or files; none: all shipped")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    options = parser.parse_args(arguments)
    print(HEADLINE, flush=True)
    flawed = 0
    for row in rows(options.scenario or list(shipped()), options.seeds):
        print(row, flush=True)
        flawed += bool(row.flaw)
    print(f"{flawed} not verified" if flawed else "all verified")
    return 1 if flawed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
