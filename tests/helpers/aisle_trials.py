"""Whether fleets get through narrow aisles where turns, picks and drops take time: run by hand.

    nice python tests/helpers/aisle_trials.py [SEEDS [RIGHT_OF_WAY [FLOOR ROBOTS]]]

Floors of 33 columns with aisles of one cell's width at x = 1, 3, ... 31 and corridors of two rows:
`two` has two sections of 9 rows with two-way aisles, `one` the same with aisles that lead down and up
by turns, `stub` its 8 stations in pockets of one cell, `dead` one section of 18 rows whose aisles end
blind. Moves take a tick, turns 2, picks and drops 8; an order leads from a random cell of an aisle to
a random station, and there are orders for all robots all the time. For each seed (1 to SEEDS, default
100) a run of 3,000 ticks; without FLOOR and ROBOTS, the fleets that the documentation tells of.

Prints in how many runs the fleet jammed (no pick or drop in the last half), in how many a robot
starved (none of its own in the last half), orders done in 1,000 ticks, and illegal answers. The tests
run a sample.
"""

from __future__ import annotations

import sys
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.engine.state import ACTION_DROP, ACTION_PICK, Array
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.world.resolve import resolve

COLUMNS: Final = 33
CORRIDOR: Final = ["." * COLUMNS] * 2
STATIONS: Final = tuple(range(2, COLUMNS, 4))
STATION: Final = "t"
AISLES: Final = {"two": "aa", "one": "ef", "stub": "aa", "dead": "aa"}  # of even and odd number
LEGEND: Final = {
    "a": {"kind": "station"},
    "e": {"kind": "station", "exits": ["south"]},
    "f": {"kind": "station", "exits": ["north"]},
}
FLEETS: Final = (
    ("two", 30),
    ("two", 60),
    ("two", 120),
    ("one", 60),
    ("one", 120),
    ("stub", 60),
    ("stub", 120),
    ("dead", 30),
    ("dead", 60),
)
TICKS: Final = 3000
SEEDS: Final = 100
ORDERS_PER_TICK: Final = 0.4  # more than any of these fleets does


class Outcome(NamedTuple):
    """What a run came to."""

    delivered: int
    jammed: bool
    starved: int  # robots
    illegal: int  # answers


def picture(floor: str) -> list[str]:
    """The rows of a floor."""
    row = "#" + "#".join(AISLES[floor][k % 2] for k in range(COLUMNS // 2)) + "#"
    rows = [row] * 18 + CORRIDOR
    if floor != "dead":
        rows = CORRIDOR + [row] * 9 + CORRIDOR + [row] * 9 + CORRIDOR
    beside = rows.pop() if floor != "stub" else "#" * COLUMNS
    last = [STATION if x in STATIONS else symbol for x, symbol in enumerate(beside)]
    return [*rows, "".join(last)]


def scenario_of(
    floor: str, robots: int, seed: int, right_of_way: str = "pibt", ticks: int = TICKS
) -> Scenario:
    """A fleet on a floor, its starts and orders drawn by the seed."""
    draws, rows = np.random.default_rng([seed, robots]), picture(floor)
    cells = [(x, y, symbol) for y, row in enumerate(rows) for x, symbol in enumerate(row)]
    aisles = [[x, y] for x, y, symbol in cells if symbol in LEGEND]
    stations = [[x, y] for x, y, symbol in cells if symbol == STATION]
    free = [[x, y] for x, y, symbol in cells if symbol not in "#" + STATION]
    orders = [
        {"from": aisles[draws.integers(len(aisles))], "to": stations[draws.integers(len(stations))]}
        for _ in range(int(ORDERS_PER_TICK * ticks) + 2 * robots)
    ]
    used = {symbol: LEGEND[symbol] for symbol in AISLES[floor]}
    data: dict[str, Any] = {
        "name": f"{floor}-{robots}",
        "layout": {"picture": "\n".join(rows), "legend": used},
        "fleet": {
            "robots": robots,
            "kinematics": "differential",
            "start": draws.permutation(free)[:robots].tolist(),
        },
        "durations": {"move": 1, "turn": 2, "pick": 8, "drop": 8},
        "orders": {"list": orders},
        "strategy": {"allocation": "first-come", "right_of_way": right_of_way},
        "stop": {"when": "never", "max_duration": ticks},
        "seed": seed,
    }
    return msgspec.convert(data, Scenario)


def outcome(scenario: Scenario) -> Outcome:
    """Run a scenario to its end."""
    run, ticks = Simulation(resolve(scenario)), scenario.stop.max_duration
    run.run(until=ticks // 2)
    before = handlings(run)
    run.run(until=ticks)
    done = handlings(run) - before
    return Outcome(
        delivered=int((run.world.orders.delivered >= 0).sum()),
        jammed=not done.any(),
        starved=int((done == 0).sum()),
        illegal=int(run.world.tally.illegal.sum()),
    )


def handlings(run: Simulation) -> Array:
    """(n,) picks and drops of each robot."""
    ticks = run.world.tally.operations[:, [ACTION_PICK, ACTION_DROP]].sum((1, 2))
    by_identity: Array = ticks[run.world.robots.at_index]
    return by_identity


def main(arguments: list[str]) -> int:
    """Run the fleets, and print a line for each."""
    seeds = int(arguments[0]) if arguments else SEEDS
    right_of_way = arguments[1] if len(arguments) > 1 else "pibt"
    fleets = [(arguments[2], int(arguments[3]))] if len(arguments) > 3 else FLEETS
    print(
        f"{right_of_way}, {seeds} seeds: runs with a jam, with a starved robot, orders/1000 ticks"
    )
    for floor, robots in fleets:
        found = [
            outcome(scenario_of(floor, robots, seed, right_of_way)) for seed in range(1, seeds + 1)
        ]
        rates = [1000 * one.delivered / TICKS for one in found]
        print(
            f"{floor:5} {robots:4}: {sum(one.jammed for one in found):4} jams, "
            f"{sum(one.starved > 0 for one in found):4} starved, "
            f"{np.mean(rates):6.1f} (least {min(rates):.1f}), "
            f"{sum(one.illegal for one in found)} illegal answers",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
