"""Whether drawn floors with gates ever break a rule: run by hand.

    nice python tests/helpers/gate_trials.py [FLOORS] [FIRST]

Each floor has closed cells, doors, blocks or lifts, and robots that drive tours under one of the shipped
rights of way. It is run twice, the second time with its robots stored in another sequence: digests must
be equal, the recording valid and no answer illegal. Exits with 1 if anything is found.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable
from random import Random
from typing import Any

import msgspec
import numpy as np

from automaton.engine.state import ACTION_GATE
from automaton.errors import InputError
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve

TICKS = 150
RIGHTS_OF_WAY = ("wait", "retreat", "pibt", "epibt")
ROUTINGS = ("shortest", "astar", "congestion")


def drawn_floor(random: Random) -> list[str]:
    """The rows of two to four halls that walls part, with a gap in each wall or two."""
    width, height = random.randrange(6, 12), random.randrange(3, 7)
    rows = [["."] * width for _ in range(height)]
    for x in range(2, width - 2, 3):
        gaps = random.sample(range(height), random.choice((1, 2)))
        for y in range(height):
            rows[y][x] = "." if y in gaps else "#"
    return ["".join(row) for row in rows]


def gates_on(random: Random, rows: list[str]) -> dict[str, Any]:
    """A few gates of all kinds."""
    width, height = len(rows[0]), len(rows)
    free = [[x, y] for y in range(height) for x in range(width) if rows[y][x] == "."]

    def cell() -> list[int]:
        return random.choice(free)

    def path() -> list[list[int]]:
        x, y = random.choice([[x, y] for x, y in free if [x + 1, y] in free])
        far = x + 1
        while [far + 1, y] in free and random.randrange(3):
            far += 1
        return [[x, y], [far, y]]

    def rectangle() -> dict[str, list[int]]:
        (x, y), (u, v) = cell(), (random.randrange(3), random.randrange(2))
        return {"from": [x, y], "to": [min(x + u, width - 1), min(y + v, height - 1)]}

    by_schedule = {"from": random.randrange(20), "for": random.randrange(1, 25), "every": 30}
    length = {"uniform": {"from": 1, "to": 9}}
    closed = [
        {"cells": rectangle(), **by_schedule},
        {"cells": [cell()], "every": {"mean": random.randrange(3, 30)}, "for": length},
    ]
    doors = [
        {"at": cell(), "opening_time": random.randrange(1, 6), "hold_open": random.randrange(4)}
        for _ in range(random.randrange(3))
    ]
    blocks = [
        {"cells": rectangle(), "max_robots": random.randrange(1, 4), "direction": "any"},
        {"cells": path(), "max_robots": random.randrange(1, 4), "direction": "same"},
    ]
    lift = {
        "shaft": path(),
        "travel_time": random.randrange(3, 9),
        "door_time": random.randrange(3),
    }
    return {
        "closed": random.sample(closed, random.randrange(3)),
        "replan_after": random.choice((None, 5)),
        "doors": doors,
        "blocks": random.sample(blocks, random.randrange(3)),
        "lifts": [lift] if random.randrange(2) else [],
    }


def drawn_gates(number: int) -> Resolved:
    """The scenario of this number. Raises InputError where its gates do not fit its floor."""
    random = Random(number)
    rows = drawn_floor(random)
    right_of_way = RIGHTS_OF_WAY[number % len(RIGHTS_OF_WAY)]
    omni = right_of_way != "epibt" and random.randrange(2)
    scenario = {
        "name": f"gates {number}",
        "layout": {"picture": "\n".join(rows)},
        "fleet": {
            "robots": random.randrange(1, 6),
            "kinematics": "omni" if omni else "differential",
            "start": "random",
        },
        "durations": {"move": 1 if right_of_way == "epibt" else random.randrange(1, 3)},
        "floor": gates_on(random, rows),
        "orders": {"generator": "tours", "count": 20, "stops": {"from": 1, "to": 2}},
        "strategy": {
            "allocation": "first-come",
            "routing": "shortest" if number % 4 > 1 else random.choice(ROUTINGS),
            "right_of_way": right_of_way,
        },
        "world": {"following": "convoy" if random.randrange(4) else "none"},
        "stop": {"when": "delivered", "max_duration": TICKS},
        "seed": number,
    }
    return resolve(msgspec.convert(scenario, Scenario))


def trial(resolved: Resolved, number: int) -> tuple[list[str], Counter[str]]:
    """Run a floor twice: what is wrong, and what happened."""
    recorder = MemoryRecorder(resolved)
    run = Simulation(resolved, on_record=recorder)
    run.run()
    storage = list(range(resolved.scenario.fleet.robots))
    Random(number).shuffle(storage)
    other = Simulation(resolved, storage=np.array(storage))
    other.run()
    wrong = [] if other.digest == run.digest else ["digests differ"]
    wrong += [str(one) for one in validate_stored(recorder.recording()).violations]
    wrong += ["an answer is illegal"] if run.world.tally.illegal.any() else []
    kinds = np.bincount(run.world.gates.kind, minlength=4).tolist()
    figures = Counter(
        finished=int(run.finished),
        delivered=int((run.world.orders.delivered >= 0).sum()),
        lost=int(run.world.tally.ticks[:, ACTION_GATE].sum()),
    )
    return wrong, figures + Counter(
        dict(zip(("closings", "doors", "blocks", "lifts"), kinds, strict=True))
    )


def trials(numbers: Iterable[int]) -> tuple[list[str], Counter[str]]:
    """All floors of these numbers whose gates fit: what is wrong, and the sums of what happened."""
    wrong: list[str] = []
    figures: Counter[str] = Counter()
    for number in numbers:
        try:
            resolved = drawn_gates(number)
            found, more = trial(resolved, number)
        except InputError as error:
            if "begin in" not in error.message:  # more robots than a block holds
                raise
            figures["unfit"] += 1
            continue
        wrong += [f"floor {number}: {one}" for one in found]
        figures += more
        figures["floors"] += 1
    return wrong, figures


if __name__ == "__main__":
    count, first = map(int, [*sys.argv[1:], *("1000", "0")[len(sys.argv) - 1 :]])
    wrong, figures = trials(range(first, first + count))
    print(*wrong[:20], dict(figures), sep="\n")
    sys.exit(1 if wrong else 0)
