"""How long moves take, worked out a second time from a floor and from where the robots are.

Zones are found by walking over the floor cell by cell; random draws are computed with integers of
Python. None of this is shared with what the world uses.
"""

from __future__ import annotations

from typing import Any, Final

from automaton.evidence.verification.coarse_ticks import CoarseTicks
from automaton.evidence.verification.type_rules import NIL, Types
from automaton.floor.cells import CELL_KINDS, EAST, NORTH, SOUTH, WEST

MAX_MOVE_TICKS: Final = 65_535  # of a move
EXTRA_TICKS: Final = 6  # the stream of draws that say whether a move takes a tick more
ALL_BITS: Final = 2**64 - 1
STEP_OF_STATE: Final = 0x9E3779B97F4A7C15


class MoveTimes:
    """The rules about the length of a move: its duration, speed limits, slow zones, extra ticks."""

    def __init__(self, floor: dict[str, Any], seed: int, types: Types) -> None:
        self.floor = floor
        self.types = types
        self.seed = seed
        self.zones: list[tuple[int, int]] = []  # by cell: of robots that travel E or S, W or N
        self.crowd: dict[int, int] = {}  # robots by zone as the tick began
        self.ticks_of = CoarseTicks({})
        self.cabin_ticks: dict[tuple[int, int], int] = {}  # in lifts, by cell and direction

    def apply_rules(self, scenario: dict[str, Any]) -> None:
        """Take over what a scenario says of the length of moves."""
        world = scenario["world"]
        self.ticks_of = CoarseTicks(scenario)
        self.slow: bool = world.get("slowdown", "none") == "zones"
        self.limits = least_ticks(self.floor, scenario.get("floor") or {})
        self.extra = round(world.get("extra_tick_probability", 0.0) * 2**32)
        self.usual = not self.slow and not self.extra and not self.limits
        self.zones = zones_by_cell(self.floor, world["traffic_zones"]) if self.slow else []

    def count(self, cell: list[int], travel: list[int]) -> None:
        """Count the robots of each zone; call before anything happens in a tick."""
        self.crowd = {}
        for c, direction in zip(cell, travel, strict=True):
            if c != NIL:
                zone = self.zones[c][direction >> 1]
                self.crowd[zone] = self.crowd.get(zone, 0) + 1

    def usual_of(self, robot: int) -> int:
        """What a move of a robot takes where nothing slows it down."""
        return self.types.ticks_of(robot, "move")

    def due(
        self, tick: int, robot: int, cell: int, direction: int, came: int | None
    ) -> tuple[int, str]:
        """How many ticks a move that starts now takes, and why.

        `came`: the direction in which the robot entered the cell, None if from its parking bay just
        now.
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
            why += f" and chance adds {'a tick' if late else 'none'}"
        return min(ticks, MAX_MOVE_TICKS), why

    def draw(self, tick: int, robot: int) -> int:
        """The 32 bits that decide on the extra tick of a robot's move."""
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
    """Ticks that a move takes at least by a speed limit, by flat cell and direction."""
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
    """The cells of a rectangle with two corners, or of a path along rows and columns with some."""
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
