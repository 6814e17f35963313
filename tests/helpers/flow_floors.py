"""Random floors on which no rule of following makes robots stand still, and fleets that drive on them.

Outside dead ends any two neighbouring cells lie on a ring, and the fleet leaves eight places there empty.
Where rings do not rotate it leaves more: a ring that is full would stand still. They do not under the
rules `none` and `handover`, nor where a robot of the ring comes to charge.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.reachability import dead_ends_of
from automaton.scenario.schema import Scenario
from automaton.world.resolve import Resolved, resolve

RULES = ("none", "handover", "convoy")
SHARE = {"none": 0.6, "handover": 0.6, "convoy": 0.95}  # of the places outside dead ends
KINDS = ("open", "streets", "aisles")
LONGEST = 5  # ticks of a move
Draws = np.random.Generator
Rows = list[list[str]]


def drawn_floor(draws: Draws, lanes: bool) -> Rows:
    """Free cells around what is drawn within: obstacles, one-way streets, or aisles between shelves.

    `lanes`: aisles may be for two.
    """
    kind = str(draws.choice(KINDS))
    width, height = (int(draws.integers(low, high)) for low, high in ((6, 17), (5, 13)))
    rows = [["."] * width for _ in range(height)]
    share, way = draws.choice([0.0, 0.1, 0.25]), "=" if lanes and draws.random() < 0.5 else "."
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            if kind == "open":
                rows[y][x] = "#" if draws.random() < share else "."
            elif kind == "aisles" and y % 2 == 0:
                rows[y][x] = "#" if x % 4 else "."
            elif kind == "aisles":
                rows[y][x] = way if x % 4 else "."
            elif x % 3 and y % 3:
                rows[y][x] = "#"
            elif x % 3:
                rows[y][x] = "<" if y // 3 % 2 else ">"
            elif y % 3:
                rows[y][x] = "^" if x // 3 % 2 else "v"
    return rows


def is_open(rows: Rows) -> bool:
    """Whether robots get from everywhere to everywhere, and any two neighbours outside dead ends
    lie on a ring."""
    plan = draw_floor(picture_of(rows))
    exits, offsets = plan.exits.reshape(-1), [int(offset) for offset in plan.offsets]
    free = np.flatnonzero(plan.drivable.reshape(-1)).tolist()
    ways = {c: [c + s for d, s in enumerate(offsets) if exits[c] >> d & 1] for c in free}
    if any(len(reached(ways, cell, NO_CELLS)) < len(free) for cell in free):
        return False
    dead = dead_ends_of(plan).number
    core = [cell for cell in free if dead[cell] < 0]
    return bool(core) and all(
        cell in reached(ways, to, (to, cell)) for cell in core for to in ways[cell] if dead[to] < 0
    )


NO_CELLS = (-1, -1)


def reached(ways: dict[int, list[int]], first: int, barred: tuple[int, int]) -> set[int]:
    """The cells to which robots get from one, not over the edge that is barred."""
    found, waiting = {first}, [first]
    while waiting:
        cell = waiting.pop()
        for to in ways[cell]:
            if to not in found and (cell, to) != barred:
                found.add(to)
                waiting.append(to)
    return found


def picture_of(rows: Rows) -> str:
    return "\n".join("".join(row) for row in rows)


def places(plan: FloorPlan) -> int:
    """Robots for which there is room outside dead ends."""
    outside = plan.drivable.reshape(-1) & (dead_ends_of(plan).number < 0)
    return int(plan.capacity.reshape(-1)[outside].sum())


def drawn_fleet(
    seed: int, right_of_way: str, ticks: int, following: str | None = None
) -> Resolved | None:
    """The scenario of this number, or None: its floor has no room, or a way without a ring.

    `following`: the rule, if it is not to be drawn. Raises InputError for what a scenario may not have.
    """
    draws = np.random.default_rng([seed, len(right_of_way)])
    plans = right_of_way == "epibt"
    rows = drawn_floor(draws, lanes=not plans)
    if not is_open(rows):
        return None
    rule, battery = str(draws.choice(RULES)), draws.random() < 0.3
    following = following or rule
    room = places(draw_floor(picture_of(rows)))
    share = SHARE["none"] if battery else SHARE[following]
    most = min(room - 8, int(share * room))
    if most < 2:
        return None
    robots = int(draws.integers(2, most + 1))
    bays = not battery and robots <= len(rows) and draws.random() < 0.3
    if battery:
        enter_at_rim(draws, rows, "c")
    charges = battery and draws.random() < 0.5
    if charges:
        enter_at_rim(draws, rows, "t")
    scenario: dict[str, Any] = {
        "name": f"flow {seed}",
        "layout": {"picture": "\n".join("b" * bays + "".join(row) for row in rows)},
        "fleet": fleet_of(draws, robots, plans) | {"start": "parking-bays" if bays else "random"},
        "durations": {
            name: int(draws.integers(1, LONGEST + 1)) for name in ("move", "turn", "pick", "drop")
        },
        "orders": {
            "generator": "stations" if charges else "tours",
            "count": robots * max(ticks // 4, 10),
            **({} if charges else {"stops": {"from": 1, "to": 2}}),
            "arrivals": {"closed_loop": {"in_system": robots + int(draws.integers(-1, 5))}},
        },
        "world": {"following": following},
        "faults": faults_of(draws),
        "strategy": {"allocation": str(draws.choice(["first-come", "greedy"]))}
        | {"right_of_way": right_of_way},
        "stop": {"when": "never", "max_duration": ticks},
        "seed": seed,
    }
    if battery:
        scenario["battery"] = {
            "drain": {"move": float(draws.choice([0.1, 0.5])), "turn": 0.1, "wait": 0.01},
            "charge_rate": 5.0,
            "initial_charge": {"from": 5, "to": 100},
            "reserve": 20,
        }
        scenario["faults"]["charge"] = 60
        scenario["strategy"]["charging"] = "threshold" if charges else "none"
    return resolve(msgspec.convert(scenario, Scenario))


def enter_at_rim(draws: Draws, rows: Rows, symbol: str) -> None:
    """Make three free cells of the rim chargers or stations; the corners stay free."""
    free = [(y, x) for y in range(1, len(rows) - 1) for x in (0, -1) if rows[y][x] == "."]
    for y, x in draws.permutation(free)[:3].tolist():
        rows[y][x] = symbol


def fleet_of(draws: Draws, robots: int, plans: bool) -> dict[str, Any]:
    """Robots of one type, or fast and slow ones."""
    kinematics = "differential" if plans else str(draws.choice(["differential", "omni"]))
    out: dict[str, Any] = {"robots": robots, "kinematics": kinematics}
    if draws.random() < 0.4:
        factor = int(draws.integers(2, 4))
        slow = {"name": "slow", "robots": robots // 2, "durations": {"move": factor}}
        fast = {"name": "fast", "robots": robots - robots // 2, "durations": {"move": 1}}
        out["types"] = [slow, fast]
    return out


def faults_of(draws: Draws) -> dict[str, Any]:
    """Robots that stand for a while, or go down and are repaired or towed."""
    out: dict[str, Any] = {"tow_after": 20, "repair_time": 50}
    if draws.random() < 0.4:
        out["failure_probability"] = 0.0005
    if draws.random() < 0.3:
        out["repair_in_place"] = 30
    if draws.random() < 0.4:
        out["delays"] = {"probability": 0.005, "ticks": {"from": 1, "to": 8}}
    return out
