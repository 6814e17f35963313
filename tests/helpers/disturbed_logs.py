"""Exported VDA 5050 messages, disturbed as a site disturbs them.

    python tests/helpers/disturbed_logs.py IN.jsonl OUT.jsonl [SEED]

Each robot has a clock of its own, stamps jitter, positions are noisy, and some messages are lost: their
numbers are missing.
"""

from __future__ import annotations

import datetime
import random
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import msgspec


class Disturbance(NamedTuple):
    """What is done to messages."""

    jitter_s: float = 0.2  # greatest error of a stamp
    noise_m: float = 0.02  # standard deviation of x and y
    lost: float = 0.01  # share of messages
    clock_s: float = 1.0  # greatest offset of a robot's clock


USUAL = Disturbance()


def disturbed(
    lines: Iterable[bytes], seed: int, disturbance: Disturbance = USUAL
) -> Iterator[bytes]:
    """Yield the messages that arrive, each with its line end."""
    draws = random.Random(seed)
    clocks: dict[str, float] = {}
    for line in lines:
        message: dict[str, Any] = msgspec.json.decode(line)
        robot = message["serialNumber"]
        clock = clocks.setdefault(robot, draws.uniform(0, disturbance.clock_s))
        seconds = clock + draws.uniform(-1, 1) * disturbance.jitter_s
        x, y = (draws.gauss(0, disturbance.noise_m) for _ in range(2))
        if draws.random() < disturbance.lost:
            continue
        stamp = datetime.datetime.fromisoformat(message["timestamp"])
        moment = stamp + datetime.timedelta(seconds=seconds)
        message["timestamp"] = moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
        for place in ("agvPosition", "mobileRobotPosition"):
            if place in message:
                message[place]["x"] += x
                message[place]["y"] += y
        yield msgspec.json.encode(message) + b"\n"


def disturb(source: Path, target: Path, seed: int, disturbance: Disturbance = USUAL) -> None:
    """Write the disturbed messages of a file to another."""
    with source.open("rb") as lines, target.open("wb") as out:
        out.writelines(disturbed(lines, seed, disturbance))


if __name__ == "__main__":
    disturb(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 1)
