"""Whether an aisle for two between pods jams under `pibt` where one for a single robot does not: by hand.

    nice python tests/helpers/lane_trials.py [FLOORS [FIRST]]

Racks of pods one or two deep, aisles, stations, fleets, durations and the rule of following are drawn;
one aisle gets a lane for each direction. For each of so many floors (default 500) a run of 3,000 ticks
with and without: prints those where robots starve only with lanes for two, and lines done in all. Exits
with 1 if there are any. The tests run a sample.
"""

from __future__ import annotations

import random
import sys
from typing import Any, Final

import automaton

FLOORS: Final = 500
TICKS: Final = 3000


def drawn(seed: int, ticks: int = TICKS) -> tuple[dict[str, Any], int]:
    """Draw a scenario, and the row of an aisle."""
    draws = random.Random(seed)
    width, depth = draws.randint(6, 14), draws.choice([1, 1, 2])
    gaps = {0, width - 1, *draws.sample(range(1, width - 1), draws.choice([0, 1, 2]))}
    rack = "".join("." if x in gaps else "p" for x in range(width))
    rows, aisles = ["." * width], [0]
    for _ in range(draws.randint(1, 3)):
        rows += [rack] * depth
        aisles.append(len(rows))
        rows.append("." * width)
    at = sorted(draws.sample(range(1, width - 1), draws.randint(1, 3)))
    rows += ["." * width, "".join("t" if x in at else "." for x in range(width)), "." * width]
    free, pods = (sum(row.count(symbol) for row in rows) for symbol in ".p")
    spans = {"move": (1, 1, 1, 2, 3), "turn": (1, 2, 2, 4), "pick": (1, 2, 3), "drop": (1, 2, 3)}
    data: dict[str, Any] = {
        "name": f"lanes-{seed}",
        "layout": {"picture": "\n".join(rows)},
        "fleet": {
            "robots": draws.randint(2, max(2, min(free // 4, pods // 2))),
            "kinematics": "differential",
        },
        "durations": {name: draws.choice(span) for name, span in spans.items()},
        "stations": {f"P{x}": {"at": [x, len(rows) - 2], "max_trips": None} for x in at},
        "orders": {"lines": {"count": 2000, "mean_interarrival_time": draws.choice([2, 5, 10])}},
        "strategy": {
            "allocation": {"name": "shortest-job", "idle": draws.choice(["park", "stay"])},
            "right_of_way": "pibt",
        },
        "stop": {"when": "never", "max_duration": ticks},
        "seed": seed,
    }
    data["durations"]["handling"] = {"line": draws.randint(1, 8)}
    data["world"] = {"following": draws.choice(["convoy"] * 4 + ["handover", "none"])}
    return data, draws.choice(aisles)


def starved(seed: int, ticks: int = TICKS) -> tuple[list[int], list[float]]:
    """Robots that starve at the end and lines done, with a lane and with two."""
    data, row = drawn(seed, ticks)
    robots, lines = [], []
    for streets in (None, [{"row": row, "capacity": 2}]):
        metrics = automaton.simulate(data | {"streets": streets}).metrics
        robots.append(int(metrics["starved_robots"]))
        lines.append(float(metrics["lines_done"]))
    return robots, lines


def main(arguments: list[str]) -> int:
    """Run the floors; print those that jam, and lines done with one lane and with two."""
    floors = int(arguments[0]) if arguments else FLOORS
    first = int(arguments[1]) if arguments[1:] else 1
    jammed, done = [], [0.0, 0.0]
    for seed in range(first, first + floors):
        robots, lines = starved(seed)
        done = [total + one for total, one in zip(done, lines, strict=True)]
        if robots[1] > robots[0]:
            jammed.append(seed)
            print(
                f"floor {seed}: {robots[1]} robots starve with lanes for two, {robots[0]} without"
            )
    print(f"{floors} floors, {len(jammed)} jam with lanes for two; lines done: "
          f"{done[0]:,.0f} with one lane, {done[1]:,.0f} with two")  # fmt: skip
    return int(bool(jammed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
