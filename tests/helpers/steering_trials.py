"""Whether fleets that are steered ever break a rule, on random floors of every kind: run by hand.

    nice python tests/helpers/steering_trials.py [ROBOT_TICKS [SEED [STRATEGY ...]]]

Floors, kinematics, capacities, paces, bays, chargers, faults, slow zones, service zones, what robots
know and how they are asked for are drawn; robots are steered by each STRATEGY (default: pibt and epibt)
for so many robot ticks (default 1,000,000). Each run is recorded and judged by the independent
validator. Exits with 1 if a rule is broken, an answer is illegal, a trip waits behind an idle robot or
anything is raised; a run is named by its seed, and `steering_trials.py 1 SEED STRATEGY` repeats it. The
tests run a sample.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
from idle_waits import run_to_end

from automaton.engine.state import LAYER_NAMES, NIL
from automaton.errors import InputError
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.reachability import to_and_from
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve

STRATEGIES = ("pibt", "epibt")
ROBOT_TICKS = 1_000_000
MAX_TICKS = 600  # of a run
KINEMATICS = ("rail", "differential", "omni")
WAYS = "......"  # symbols of a cell without anything special, drawn as often as they stand here
SPECIAL = "=~><v^"
Draws = np.random.Generator
Options = dict[str, Any]


def scenario_of(strategy: str, seed: int) -> Scenario:
    """Draw a scenario; it may be refused. The same seed draws the same one."""
    draws = np.random.default_rng([seed, len(strategy)])
    plans = strategy == "epibt"  # it refuses what does not take a tick, and cells for more robots
    kinematics = "differential" if plans else str(draws.choice(KINEMATICS))
    rows = picture(draws, kinematics, plans)
    starts = places(draws, rows, kinematics == "rail")
    zoned, battery = chance(draws, 0.2), chance(draws, 0.3)
    charging = battery and chance(draws, 0.7)
    most = "".join(rows).count("t") if zoned else len(starts) * 3 // 4  # each has a zone
    if bays := sum(row[0] == "b" for row in rows):
        most = min(bays, most)
    robots = int(draws.integers(1, most + 1))
    data: Options = {
        "name": "trial",
        "layout": {"picture": "\n".join(rows)},
        "fleet": fleet(draws, kinematics, "parking-bays" if bays else starts[:robots], robots)
        | ({} if plans else types(draws, robots)),
        "durations": durations(draws, plans),
        "orders": demand(draws, robots, zoned or charging),
        "world": world(draws),
        "faults": faults(draws, robots),
        "information": "everything" if plans or zoned else sight(draws),
        "strategy": {
            "zoning": str(draws.choice(["static", "annealing"])) if zoned else "none",
            "charging": "threshold" if charging else "none",
            "allocation": "shortest-job" if zoned else str(draws.choice(["first-come", "greedy"])),
            "right_of_way": right_of_way(draws, strategy),
        },
        "stop": {"when": "never", "max_duration": int(draws.integers(100, MAX_TICKS))},
        "seed": seed,
    }
    if "types" in data["fleet"] and chance(draws, 0.5):  # the ring around it stays open
        data["areas"] = {"within": closed_area(draws, rows, bool(bays))}
    if battery:
        rates = draws.choice([0.0, 0.1, 1.0], 4).tolist()
        drain = dict(zip(("move", "turn", "pick", "wait"), rates, strict=True))
        data["battery"] = {"drain": drain, "charge_rate": 5.0}
    return msgspec.convert(data, Scenario)


def chance(draws: Draws, share: float) -> bool:
    return bool(draws.random() < share)


def picture(draws: Draws, kinematics: str, plans: bool) -> list[str]:
    """A floor with free cells around it, on which stations and chargers lie, and whatever within."""
    width, height = (int(draws.integers(low, high)) for low, high in ((5, 15), (4, 11)))
    way = "+" if kinematics == "rail" else "."
    inner = WAYS.replace(".", way) + ("" if plans else SPECIAL) + "#" * int(draws.integers(0, 4))
    if kinematics == "rail":
        inner = inner.replace("<", "-").replace(">", "-").replace("v", "|").replace("^", "|")
    rows = [[str(draws.choice(list(inner))) for _ in range(width)] for _ in range(height)]
    ring = [(x, y) for y in range(height) for x in range(width)]
    ring = [(x, y) for x, y in ring if x in (0, width - 1) or y in (0, height - 1)]
    for x, y in ring:
        rows[y][x] = way
    for place, (x, y) in enumerate(draws.permutation(ring)[: max(4, len(ring) // 3)].tolist()):
        rows[y][x] = "c" if place == 0 or chance(draws, 0.2) else "t"
    if chance(draws, 0.3):
        return ["b" + "".join(row) for row in rows]
    return ["".join(row) for row in rows]


def places(draws: Draws, rows: list[str], rail: bool) -> list[list[int]]:
    """The cells from which a robot gets to a corner and back, in random order."""
    floor_plan = draw_floor("\n".join(rows))
    within = np.flatnonzero(to_and_from(floor_plan, floor_plan.cell(0, 0), rail))
    return [list(floor_plan.xy(int(cell))) for cell in draws.permutation(within)]


def fleet(draws: Draws, kinematics: str, start: Any, robots: int) -> Options:
    out: Options = {"robots": robots, "kinematics": kinematics, "start": start}
    if start != "parking-bays" and chance(draws, 0.2):
        out["when_idle"] = "leave"
    return out


def types(draws: Draws, robots: int) -> Options:
    if robots < 2 or chance(draws, 0.6):
        return {}
    slow = {"name": "slow", "robots": robots // 2, "move_time_factor": int(draws.integers(1, 4))}
    other = {"name": "other"}
    for one in (slow, other):
        if chance(
            draws, 0.5
        ):  # rail robots beside others are refused where nothing is laid for them
            one["kinematics"] = str(draws.choice(KINEMATICS))
    return {"types": [slow, other]}


def closed_area(draws: Draws, rows: list[str], bays: bool) -> Options:
    """Some rows and columns within the floor, closed to slow robots."""
    width, height = len(rows[0]) - bays, len(rows)
    columns = sorted(draws.integers(1, width - 1, 2).tolist())
    lines = sorted(draws.integers(1, height - 1, 2).tolist())
    return {
        "from": [columns[0], lines[0]],
        "to": [columns[1], lines[1]],
        "closed_to": ["slow"],
    }


def durations(draws: Draws, plans: bool) -> Options:
    move, turn = (1, 1) if plans else (int(draws.integers(1, 4)) for _ in range(2))
    pick, drop = (int(draws.integers(0, 5)) for _ in range(2))
    jitter = int(draws.integers(0, 3)) if pick and drop else 0
    return {"move": move, "turn": turn, "pick": pick, "drop": drop, "handling_jitter": jitter}


def demand(draws: Draws, robots: int, loads: bool) -> Options:
    """Orders; `loads`: those alone that begin and end at stations."""
    kinds = ["stations", "visits"] if loads else ["stations", "visits", "tours", "tours"]
    out: Options = {"generator": str(draws.choice(kinds)), "count": 40 * robots}
    if out["generator"] == "tours":
        out["stops"] = {"from": 1, "to": int(draws.integers(1, 6))}
    if chance(draws, 0.7):
        out["arrivals"] = {"closed_loop": {"in_system": int(draws.integers(1, 2 * robots + 1))}}
    return out


def world(draws: Draws) -> Options:
    return {
        "following": str(draws.choice(["convoy", "convoy", "handover", "none"])),
        "slowdown": str(draws.choice(["none", "none", "zones"])),
        "traffic_zones": str(draws.choice(["undirected", "directed", "with-intersections"])),
        "extra_tick_probability": float(draws.choice([0.0, 0.0, 0.3])),
    }


def faults(draws: Draws, robots: int) -> Options:
    if chance(draws, 0.6):
        return {}
    listed = [
        {"robot": int(draws.integers(robots)), "at": int(draws.integers(1, MAX_TICKS))}
        for _ in range(int(draws.integers(0, 4)))
    ]
    return {
        "list": listed,
        "failure_probability": float(draws.choice([0.0, 0.001, 0.01])),
        "tow_after": draws.choice([1, 20, None]),  # type: ignore[list-item]
        "repair_time": draws.choice([1, 20, None]),  # type: ignore[list-item]
    }


def sight(draws: Draws) -> Any:
    return draws.choice(["everything", "everything", {"radius": 2}, {"radius": 5}])


def right_of_way(draws: Draws, strategy: str) -> Options:
    if strategy != "epibt":
        return {"name": strategy}
    return {
        "name": strategy,
        "depth": int(draws.choice([3, 3, 4, 5])),
        "first": str(draws.choice(["nearest", "oldest", "shortest"])),
        "starved_after": draws.choice([20, None]),  # type: ignore[list-item]
        "drivers": draws.choice([3, None]),  # type: ignore[list-item]
        "guidance": str(draws.choice(["none", "lattice"])),
        "repair_tries": int(draws.choice([0, 0, 2])),
    }


class Findings:
    """What trials of one strategy came to."""

    def __init__(self) -> None:
        self.robot_ticks = self.runs = 0
        self.refused: Counter[str] = Counter()
        self.wrong: list[str] = []

    def add(self, resolved: Resolved, name: str) -> None:
        """Run a scenario, and judge it."""
        recorder = MemoryRecorder(resolved)
        run = Simulation(
            resolved, on_record=recorder, on_observe=lambda run: run.empty_observation()
        )
        waits = run_to_end(run)
        rules = run.world.rules
        if (
            not rules.may_fail and rules.radius == NIL
        ):  # robots that are down, or see too little, may jam
            self.wrong += [f"{name}: {one}" for one in waits]
        self.runs += 1
        self.robot_ticks += run.tick * resolved.scenario.fleet.robots
        illegal = run.world.tally.illegal
        if illegal.sum():
            layers = dict(zip(LAYER_NAMES, illegal.tolist(), strict=True))
            self.wrong.append(f"{name}: illegal answers {layers}")
        report = validate_stored(recorder.recording())
        self.wrong += [f"{name}: {report.violations[0]}"] if report.violations else []


def trials(strategy: str, robot_ticks: int, first: int = 1) -> Iterator[Findings]:
    """Run random scenarios until so many robot ticks are done; yields what was found after each."""
    findings, seed = Findings(), first
    while findings.robot_ticks < robot_ticks:
        name = f"{strategy}, seed {seed}"
        try:
            findings.add(resolve(scenario_of(strategy, seed)), name)
        except InputError as error:
            findings.refused[str(error)[:60]] += 1
        except Exception as error:
            findings.wrong.append(f"{name}: {type(error).__name__}: {error}")
        seed += 1
        yield findings


def main(arguments: list[str]) -> int:
    """Run the trials of each strategy."""
    robot_ticks, seed = (*map(int, arguments[:2]), *(ROBOT_TICKS, 1)[len(arguments[:2]) :])
    wrong = 0
    for strategy in arguments[2:] or STRATEGIES:
        begun, printed = time.monotonic(), 0
        for found in trials(strategy, robot_ticks, seed):
            for text in found.wrong[printed:]:
                print(text, flush=True)
            printed = len(found.wrong)
        seconds = time.monotonic() - begun
        refused = sum(found.refused.values())
        print(
            f"{strategy}: {found.robot_ticks:,} robot ticks in {found.runs:,} runs, {refused:,} "
            f"scenarios refused, {len(found.wrong)} findings, {seconds:.0f} s",
            flush=True,
        )
        wrong += len(found.wrong)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
