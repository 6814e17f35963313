"""Durations of moves, operations, delays and repairs, recomputed from the header.

Zones are found by walking over the floor cell by cell; random draws use Python integers, quantiles
and exponentials the standard library. None of this code is shared with the world.
"""

from __future__ import annotations

import math
from decimal import Context, Decimal
from statistics import NormalDist
from typing import Any, Final

from automaton.floor.floor_plan import CELL_KINDS, EAST, NORTH, SOUTH, WEST
from automaton.scenario.order_lines import plain_data
from automaton.scenario.refinement import refined_data

MAX_MOVE_TICKS: Final = 65_535  # of a move
EXTRA_TICKS: Final = 6  # random stream that decides whether a move takes an extra tick
ALL_BITS: Final = 2**64 - 1
STEP_OF_STATE: Final = 0x9E3779B97F4A7C15


class MoveTimes:
    """The rules for the duration of a move: its duration, speed limits, slow zones, extra ticks."""

    def __init__(self, floor: dict[str, Any], seed: int, types: Types) -> None:
        self.floor = floor
        self.types = types
        self.seed = seed
        self.zones: list[tuple[int, int]] = []  # by cell: for robots that travel E or S, W or N
        self.crowd: dict[int, int] = {}  # robots by zone when the tick began
        self.ticks_of = CoarseTicks({})
        self.cabin_ticks: dict[tuple[int, int], int] = {}  # in lifts, by cell and direction

    def apply_rules(self, scenario: dict[str, Any]) -> None:
        """Apply the rules of a scenario for the duration of moves."""
        world = scenario["world"]
        self.ticks_of = CoarseTicks(scenario)
        self.slow: bool = world.get("slowdown", "none") == "zones"
        self.limits = least_ticks(self.floor, scenario.get("floor") or {})
        self.extra = round(world.get("extra_tick_probability", 0.0) * 2**32)
        self.usual = not self.slow and not self.extra and not self.limits
        self.zones = zones_by_cell(self.floor, world["traffic_zones"]) if self.slow else []

    def count(self, cell: list[int], travel: list[int]) -> None:
        """Count the robots in each zone; call before anything happens in a tick."""
        self.crowd = {}
        for c, direction in zip(cell, travel, strict=True):
            if c != NIL:
                zone = self.zones[c][direction >> 1]
                self.crowd[zone] = self.crowd.get(zone, 0) + 1

    def usual_of(self, robot: int) -> int:
        """Ticks of a move of a robot without anything that slows it."""
        return self.types.ticks_of(robot, "move")

    def due(
        self, tick: int, robot: int, cell: int, direction: int, came: int | None
    ) -> tuple[int, str]:
        """How many ticks a move that starts now takes, and why.

        `came`: the direction in which the robot entered the cell; None if it has just left its
        parking bay.
        """
        if (cell, direction) in self.cabin_ticks:
            ticks = self.cabin_ticks[cell, direction]
            return ticks, f"its lift takes {ticks}"
        ticks = self.usual_of(robot)
        why = f"a move takes {ticks}"
        least = self.limits.get((cell, direction), 0)
        if least > ticks:
            ticks, why = least, f"a speed limit makes it take {least}"
        zone = self.zones[cell][direction >> 1] if self.slow else NIL
        if zone != NIL:
            counted = came is not None and self.zones[cell][came >> 1] == zone
            robots = self.crowd.get(zone, 0) + (not counted)
            ticks *= robots
            why = f"zone {zone} holds {robots} robot{'s' if robots != 1 else ''} when it starts"
        if self.extra:
            late = self.draw(tick, robot) < self.extra
            ticks += late * self.ticks_of.factor
            why += f" and a random delay adds {'a tick' if late else 'none'}"
        return min(ticks, MAX_MOVE_TICKS), why

    def draw(self, tick: int, robot: int) -> int:
        """The 32 bits that decide whether a robot's move takes an extra tick."""
        return random_bits(self.seed, EXTRA_TICKS, self.ticks_of.of(tick), robot) >> 32


def random_bits(seed: int, stream: int, tick: int, robot: int) -> int:
    """The 64 random bits of an address."""
    state = splitmix64(seed + STEP_OF_STATE * stream)
    state = splitmix64(state ^ (tick + STEP_OF_STATE & ALL_BITS))
    return splitmix64(state ^ (robot * STEP_OF_STATE + 0xBF58476D1CE4E5B9 & ALL_BITS))


def splitmix64(value: int) -> int:
    """The finalizer of SplitMix64 (Steele, Lea & Flood 2014)."""
    value &= ALL_BITS
    value = (value ^ (value >> 30)) * 0xBF58476D1CE4E5B9 & ALL_BITS
    value = (value ^ (value >> 27)) * 0x94D049BB133111EB & ALL_BITS
    return value ^ (value >> 31)


def least_ticks(floor: dict[str, Any], section: dict[str, Any]) -> dict[tuple[int, int], int]:
    """Least ticks of a move by speed limits, by flat cell and direction."""
    stride = floor["width"] + 2
    steps = {EAST: 1, SOUTH: stride, WEST: -1, NORTH: -stride}
    least: dict[tuple[int, int], int] = {}
    for limit in section.get("speed_limits") or ():
        cells = {(y + 1) * stride + x + 1 for x, y in cells_of(limit["cells"])}
        for cell in cells:
            for direction, step in steps.items():
                if cell + step in cells:
                    known = least.get((cell, direction), 0)
                    least[cell, direction] = max(known, limit["max_speed"])
    return least


def cells_of(cells: Any) -> list[tuple[int, int]]:
    """The cells of a rectangle by two corners, or of a path along rows and columns by its corners."""
    if isinstance(cells, dict):
        (x, y), (u, v) = cells["from"], cells["to"]
        columns = range(min(x, u), max(x, u) + 1)
        return [(column, row) for column in columns for row in range(min(y, v), max(y, v) + 1)]
    path = [tuple(cells[0])]
    for u, v in cells:
        x, y = path[-1]
        path += [(k, y) for k in range(min(x, u), max(x, u) + 1)]
        path += [(u, k) for k in range(min(y, v), max(y, v) + 1)]
    return path


def zones_by_cell(floor: dict[str, Any], mode: str) -> list[tuple[int, int]]:
    """The zones of each flat cell, for travel east or south and for travel west or north."""
    stride = floor["width"] + 2
    exits: list[int] = floor["exits"].ravel().tolist()
    drivable = [CELL_KINDS[kind].drivable for kind in floor["kind"].ravel().tolist()]
    steps = {EAST: 1, SOUTH: stride, WEST: -1, NORTH: -stride}

    def neighbours(cell: int, *directions: int) -> list[int]:
        return [
            cell + steps[d]
            for d in directions
            if exits[cell] >> d & 1 or exits[cell + steps[d]] >> (d ^ 2) & 1
        ]

    places = [cell for cell, robots in enumerate(drivable) if robots]
    crossings = [c for c in places if neighbours(c, EAST, WEST) and neighbours(c, SOUTH, NORTH)]
    segment = dict.fromkeys(crossings, NIL)
    segments = 0
    for first in places:
        if first in segment:
            continue
        front = [first]
        while front:
            cell = front.pop()
            if cell not in segment:
                segment[cell] = segments
                front += neighbours(cell, EAST, SOUTH, WEST, NORTH)
        segments += 1
    if mode == "with-intersections":
        segment.update((cell, segments + k) for k, cell in enumerate(crossings))
    pairs = [(NIL, NIL)] * len(exits)
    for cell, zone in segment.items():
        ways = (2 * zone, 2 * zone + 1) if mode == "directed" else (zone, zone)
        pairs[cell] = ways if zone != NIL else (NIL, NIL)
    return pairs


# Properties of robot types: durations of operations without and with a load, payload, and closed
# areas.


NIL: Final = -1
ANY: Final = 1 << 60  # payload without a limit
HEADING_COUNTS: Final = {"omni": 1, "rail": 2, "differential": 4}
TIMED_OPERATIONS: Final = ("move", "turn", "pick", "drop", "try_drop")

Ticks = dict[str, tuple[int, int]]  # by operation: without a load, and with one


class Types:
    """By robot: type, payload, closed areas, and durations of operations."""

    def __init__(self, floor: dict[str, Any], scenario: dict[str, Any]) -> None:
        kinds = kinds_of(scenario)
        areas = scenario.get("areas") or {}
        self.name: list[str] = []
        self.payload: list[int] = []
        self.closed: list[tuple[set[int], set[int]]] = []  # flat cells, without a load and with one
        self.headings: list[int] = []  # number of headings that it distinguishes
        for kind, robots in kinds:
            shut = (
                closed_to(floor, areas, kind["name"], "empty"),
                closed_to(floor, areas, kind["name"], "loaded"),
            )
            self.name += [kind["name"]] * robots
            self.payload += [kind.get("payload") or ANY] * robots
            self.closed += [shut] * robots
            drives = kind.get("kinematics") or scenario["fleet"]["kinematics"]
            self.headings += [HEADING_COUNTS[drives]] * robots
        # the load of each robot, in the list shared with the rules of loads
        self.load = [NIL] * len(self.name)
        self.apply_rules(scenario)

    def apply_rules(self, scenario: dict[str, Any]) -> None:
        """Apply the rules of a scenario for durations."""
        self.ticks: list[Ticks] = []
        for kind, robots in kinds_of(scenario):
            self.ticks += [ticks_of_type(scenario["durations"], kind)] * robots

    def ticks_of(self, robot: int, operation: str) -> int:
        """Ticks of an operation of a robot by the scenario, with its current load."""
        return self.ticks[robot][operation][self.load[robot] != NIL]

    def slowest(self, operation: str) -> int:
        """Ticks of an operation for the slowest robots; 1 for operations without a duration."""
        return max(max(one.get(operation, (1, 1))) for one in self.ticks)

    def is_closed(self, robot: int, cell: int) -> bool:
        """Whether a cell is closed to a robot with its current load."""
        return cell in self.closed[robot][self.load[robot] != NIL]

    def called(self, robot: int) -> str:
        """Robots of this type, with or without a load, in the words of errors."""
        own = f"robots of the type {self.name[robot]}" if self.name[robot] else "robots"
        empty, loaded = self.closed[robot]
        carries = "with" if self.load[robot] != NIL else "without"
        return own if empty == loaded else f"{own} {carries} a load"


def kinds_of(scenario: dict[str, Any]) -> list[tuple[dict[str, Any], int]]:
    """The types of a scenario, each with its number of robots."""
    fleet = scenario["fleet"]
    kinds: list[dict[str, Any]] = list(fleet.get("types") or ({"name": ""},))
    counted = sum(kind.get("robots") or 0 for kind in kinds)
    return [(kind, kind.get("robots") or fleet["robots"] - counted) for kind in kinds]


def ticks_of_type(durations: dict[str, Any], kind: dict[str, Any]) -> Ticks:
    """Durations of the operations of a type; the general ones by default."""
    own = kind.get("durations") or {}
    ticks: Ticks = {}
    for name in TIMED_OPERATIONS:
        value = durations[name] if own.get(name) is None else own[name]
        pair = (value["empty"], value["loaded"]) if isinstance(value, dict) else (value, value)
        times = kind.get("move_time_factor", 1) if name == "move" else 1
        ticks[name] = (pair[0] * times, pair[1] * times)
    return ticks


def closed_to(floor: dict[str, Any], areas: dict[str, Any], *names: str) -> set[int]:
    """The flat cells of the areas closed to all, or to one of these names."""
    stride = floor["width"] + 2
    cells: set[int] = set()
    for area in areas.values():
        if {"all", *names} & set(area["closed_to"]):
            (x, y), (u, v) = area["from"], area["to"]
            for row in range(min(y, v), max(y, v) + 1):
                first = (row + 1) * stride + 1
                cells.update(range(first + min(x, u), first + max(x, u) + 1))
    return cells


# Coarse ticks of a refined run. Strategies decide and robots begin operations in the first of
# `stride` ticks; stops are done in the last one. Random draws use coarse ticks.


class CoarseTicks:
    """The relation between the ticks of a recording and those of its scenario."""

    def __init__(self, scenario: dict[str, Any]) -> None:
        self.factor: int = scenario.get("refine", 1)
        self.stride = self.factor if scenario.get("decide", "coarse") == "coarse" else 1

    def of(self, tick: int) -> int:
        """The coarse tick of a tick."""
        return (tick - 1) // self.factor + 1

    def begin_of(self, tick: int) -> int:
        """The first tick of a coarse tick; 0 is before the first one."""
        return self.factor * (tick - 1) + 1 if tick > 0 else 0

    def decides(self, tick: int) -> bool:
        """Whether decisions, releases and starts of operations happen in a tick."""
        return (tick - 1) % self.stride == 0

    def ends(self, tick: int) -> bool:
        """Whether stops are done in a tick."""
        return tick % self.stride == 0

    def draws(self, tick: int) -> bool:
        """Whether faults and delays are drawn in a tick."""
        return (tick - 1) % self.factor == 0


def in_fine_ticks(scenario: dict[str, Any]) -> dict[str, Any]:
    """A recorded scenario in the ticks of its run, except for closings and probabilities."""
    factor = scenario.get("refine", 1)
    if factor == 1:
        return scenario
    fine: dict[str, Any] = plain_data(refined_data(scenario))
    fine["floor"]["closed"] = scenario["floor"]["closed"]
    faults, as_read = fine["faults"], scenario["faults"]
    if as_read["repair_in_place"] is not None:
        ticks = repairs_of(as_read["repair_in_place"])
        faults["repair_in_place"] = {"empirical": [factor * one for one in ticks]}
    if as_read["delays"] is not None:
        table = [factor * one for one in durations_of(as_read["delays"])]
        faults["delays"] |= {"probability": as_read["delays"]["probability"], "table": table}
    return fine


# Durations of delays and repairs in place, and numbers of delayed robots.


PLACES: Final = 65_536  # number of quantiles from which durations are drawn
DRAWS: Final = 2**32
DIGITS: Final = Context(prec=50)


def drawn_from(table: list[int], bits: int) -> int:
    """A random entry of a table, uniformly distributed."""
    return table[(bits >> 32) * len(table) >> 32]


def durations_of(rules: dict[str, Any]) -> list[int]:
    """Durations of delays, each repeated in proportion to its probability."""
    least, most = rules["ticks"]["from"], rules["ticks"]["to"]
    if rules["distribution"] == "uniform":
        return list(range(least, most + 1))
    bell = rules["distribution"]["gaussian"]
    shares = (
        bell["mean_ratio"] + bell["sd_ratio"] * NormalDist().inv_cdf(u) for u in quantile_places()
    )
    return [half_up(min(max(least + (most - least) * one, least), most)) for one in shares]


def repairs_of(duration: Any) -> list[int]:
    """Durations of repairs in place, each repeated in proportion to its probability."""
    if isinstance(duration, int):
        return [duration]
    if duration.get("empirical"):
        return [max(1, half_up(one)) for one in duration["empirical"]]
    places = quantile_places()
    if duration.get("uniform"):
        least, most = duration["uniform"]["from"], duration["uniform"]["to"]
        return [max(1, half_up(least + (most - least) * u)) for u in places]
    if duration.get("exponential"):
        stays = 1 - 1 / duration["exponential"]
        return [1 + greatest_power(stays, 1 - u) for u in places]
    mean, sd = duration["lognormal"]["mean"], duration["lognormal"]["sd"]
    variance = math.log(1 + (sd / mean) ** 2)
    normal = NormalDist(math.log(mean) - variance / 2, math.sqrt(variance)) if sd else None
    if normal is None:
        return [max(1, half_up(mean))]
    return [max(1, half_up(math.exp(normal.inv_cdf(u)))) for u in places]


def quantile_places() -> list[float]:
    """Numbers between 0 and 1, evenly spread."""
    return [(k + 0.5) / PLACES for k in range(PLACES)]


def half_up(value: float) -> int:
    """The nearest integer, rounding half up."""
    return math.floor(value + 0.5)


def greatest_power(base: float, value: float) -> int:
    """The greatest k with base ** k > value."""
    if base == 0:
        return 0
    k = max(0, math.floor(math.log(value) / math.log(base)) - 1)
    while base ** (k + 1) > value:
        k += 1
    return k


def poisson_number(mean: float, draw: int) -> int:
    """The Poisson number of a draw from 0 to 2**32 - 1."""
    term = total = DIGITS.exp(-Decimal(mean))
    number = 0
    while draw >= round(total * DRAWS):
        number += 1
        term = DIGITS.divide(DIGITS.multiply(term, Decimal(mean)), Decimal(number))
        total = DIGITS.add(total, term)
    return number
