"""What fleets deliver whose moves take several ticks, beside what they did before there was `convoy`.

    python tests/proofs/flow_before_and_after.py [WORDS ...]

WORDS choose the rows that contain them, such as `ring`. What was measured before is written here, of the
same scenarios under the rule that is `handover` now; each row says under which rule it runs today.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from automaton.runs.headless import run_once
from automaton.world.resolve import resolve

RING = """
name: ring
layout:
  picture: |
    >>v
    ^<<
fleet: {robots: 6, kinematics: omni}
orders: {generator: tours, count: 100000}
strategy: {allocation: first-come, right_of_way: pibt}
stop: {when: never, max_duration: 2000}
"""
IDLE = (
    *("fleet.start=random", "battery=null", "faults={}", "strategy.charging=none"),
    *("orders.lines.mean_interarrival_time=4000/h", "orders.lines.count=30000"),
    *(
        "strategy.right_of_way=pibt",
        "orders.lines.due=null",
        "stop.max_duration=2h",
        "fleet.robots=120",
    ),
)


class Row(NamedTuple):
    """A run, and what it delivered before: orders, or visits an hour."""

    name: str
    scenario: str
    settings: tuple[str, ...]
    before: int
    seed: int | None = None
    visits: bool = False


def rows(ring: str) -> Iterator[Row]:
    """All rows; `ring`: the file of the ring."""
    for move, before in ((1, 3526), (2, 0), (3, 0)):
        for following in ("handover", "convoy"):
            settings = (f"durations.move={move}", f"world.following={following}")
            yield Row(f"ring of 6, moves of {move}, {following}", ring, settings, before)
    for name, before in (("pibt", 251), ("epibt", 2619)):
        for following in ("handover", "convoy"):
            settings = ("durations.move=2", "fleet.robots=100", "stop.max_duration=2000")
            settings += (f"strategy.right_of_way={name}", f"world.following={following}")
            yield Row(f"random-400, {name}, {following}", "random-400", settings, before)
    for name, figures in (("pibt", (3705, 501, 422)), ("epibt", (4082, 3860, 3696))):
        for factor, before in zip((1, 2, 3), figures, strict=True):
            times = {"move": 1, "turn": 1, "pick": 2, "drop": 2}
            settings = tuple(f"durations.{key}={factor * ticks}" for key, ticks in times.items())
            settings += ("fleet.robots=600", f"stop.max_duration={1000 * factor}")
            settings += ("strategy.allocation=greedy", f"strategy.right_of_way={name}")
            yield Row(f"sorting, ticks {factor} times finer, {name}", "sorting", settings, before)
    for seed, before in zip((1, 2, 3, 4), (131, 41, 57, 815), strict=True):
        name = f"goods-60x40, visits an hour, seed {seed}"
        yield Row(name, "goods-60x40", IDLE, before, seed, visits=True)
    crowd = ("fleet.robots=800", "orders.arrivals.closed_loop.in_system=1200")
    yield Row("random-400 with 800 robots: dead ends", "random-400", crowd, 789)


def measured(row: Row) -> tuple[float, int]:
    """What a run delivers now, and how many robots starve."""
    outcome = run_once(resolve(row.scenario, row.settings, row.seed))
    metrics = outcome.metrics
    done = metrics["visits"] / 2 if row.visits else metrics["delivered"]
    return float(done), int(metrics["starved_robots"])


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        ring = Path(folder) / "ring.yaml"
        ring.write_text(RING)
        for row in rows(str(ring)):
            if all(word in row.name for word in sys.argv[1:]):
                done, starved = measured(row)
                print(f"{row.name:48}{row.before:8,}{done:10,.0f}  {starved} starved", flush=True)


if __name__ == "__main__":
    main()
