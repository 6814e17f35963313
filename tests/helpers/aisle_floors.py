"""Whether right of way gets fleets through floors of narrow aisles: run by hand.

    nice python tests/helpers/aisle_floors.py [KIND ROBOTS [SEEDS [STRATEGY]]]

Floors of 33 columns: aisles of one cell in two sections of 9 rows, corridors of two rows above, between
and below, 8 stations in the last row. KIND: `two`, two-way aisles; `one`, down and up by turns; `stub`,
each station in a dead end below the last row; `dead`, one section of 18 rows that is closed above. An
order leads from a cell of an aisle to a station. For each fleet, in 3,000 ticks: runs that jammed (no
visit in the second half), runs that left a robot behind (none of its own in the second half), loads
brought in 1,000 ticks on average and in the worst run, and illegal answers. Without arguments the fleets
whose figures docs/how-to/choose-a-right-of-way.md gives, 10 seeds each.
"""

from __future__ import annotations

import random
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from automaton.build.resolve import resolve
from automaton.engine.state import ACTION_DROP, ACTION_PICK
from automaton.runs.simulation import Simulation

COLUMNS, TICKS, SEEDS = 33, 3000, 10
STATIONS = range(2, COLUMNS, 4)
LEGEND = {
    "a": "{kind: station}",
    "e": "{kind: station, exits: [south]}",
    "f": "{kind: station, exits: [north]}",
}
FLEETS = (("two", 60), ("two", 120), ("one", 60), ("one", 120), ("stub", 60), ("dead", 30))


class Result(NamedTuple):
    """What became of one run."""

    loads: int
    jammed: bool
    left_behind: int
    illegal: int


def rows_of(kind: str) -> list[str]:
    """The picture of a floor."""
    aisles = ("#e#f" if kind == "one" else "#a#a") * (COLUMNS // 4) + "#"
    corridor = ["." * COLUMNS] * 2
    if kind == "dead":
        rows = [aisles] * 18 + corridor
    else:
        rows = [*corridor, *[aisles] * 9, *corridor, *[aisles] * 9, *corridor]
    blank = "#" if kind == "stub" else "."
    stations = "".join("t" if x in STATIONS else blank for x in range(COLUMNS))
    return [*rows, stations] if kind == "stub" else [*rows[:-1], stations]


def cells_of(rows: list[str], symbols: str) -> list[list[int]]:
    """Column and row of all cells that are drawn with one of these symbols."""
    return [[x, y] for y, row in enumerate(rows) for x, one in enumerate(row) if one in symbols]


def scenario_of(kind: str, robots: int, seed: int, strategy: str, folder: Path) -> Path:
    """Write a scenario, and its orders."""
    draws, rows = random.Random(seed * 7919 + robots), rows_of(kind)
    aisles, stations = cells_of(rows, "aef"), cells_of(rows, "t")
    orders = [
        "0,{},{},{},{}".format(*draws.choice(aisles), *draws.choice(stations))
        for _ in range(TICKS * 2 // 5 + 2 * robots)
    ]
    free = cells_of(rows, ".aef" if kind == "stub" else ".aeft")
    start = draws.sample(free, robots)
    (folder / "orders.csv").write_text("tick,from_x,from_y,to_x,to_y\n" + "\n".join(orders) + "\n")
    legend = ", ".join(f"{one}: {LEGEND[one]}" for one in LEGEND if one in "".join(rows))
    lines = [
        "name: aisles",
        "layout:",
        "  picture: |",
        *(f"    {row}" for row in rows),
        f"  legend: {{{legend}}}",
        f"fleet: {{robots: {robots}, kinematics: differential, start: {start}}}",
        "durations: {move: 1, turn: 2, pick: 8, drop: 8}",
        "orders: {arrivals: {file: orders.csv}}",
        f"strategy: {{allocation: first-come, right_of_way: {strategy}}}",
        f"stop: {{when: never, max_duration: {TICKS}}}",
        f"seed: {seed}",
    ]
    path = folder / "aisles.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path


def run_once(scenario: Path) -> Result:
    run, visits = Simulation(resolve(scenario)), []
    for until in (TICKS // 2, TICKS):
        run.run(until=until)
        visits.append(run.world.tally.operations[:, [ACTION_PICK, ACTION_DROP]].sum((1, 2)))
    late = visits[1] - visits[0]
    loads = int((run.world.orders.delivered >= 0).sum())
    illegal = int(run.world.tally.illegal.sum())
    return Result(loads, not late.any(), int((late == 0).sum()), illegal)


def report(kind: str, robots: int, seeds: int, strategy: str) -> bool:
    """Run a fleet with several seeds, print what became of it; whether all got through."""
    with tempfile.TemporaryDirectory() as folder:
        results = [
            run_once(scenario_of(kind, robots, seed, strategy, Path(folder)))
            for seed in range(1, seeds + 1)
        ]
    loads = np.array([one.loads for one in results]) * 1000 / TICKS
    jams = sum(one.jammed for one in results)
    left_behind = sum(one.left_behind > 0 for one in results)
    illegal = sum(one.illegal for one in results)
    print(
        f"{kind} {robots} {strategy}: {jams} jams, {left_behind} runs with a robot left behind, "
        f"{loads.mean():.1f} loads in 1,000 ticks (least {loads.min():.1f}), {illegal} illegal",
        flush=True,
    )
    return jams == left_behind == illegal == 0


def main(arguments: list[str]) -> int:
    fleets = [(arguments[0], int(arguments[1]))] if arguments else FLEETS
    seeds = int(arguments[2]) if len(arguments) > 2 else SEEDS
    strategy = arguments[3] if len(arguments) > 3 else "pibt"
    good = [report(kind, robots, seeds, strategy) for kind, robots in fleets]
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
