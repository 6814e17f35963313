"""What the type of a robot asks of it, read from the recorded scenario a second time.

How long its operations take without a load and with one, what it carries, and where it may not go.
"""

from __future__ import annotations

from typing import Any, Final

NIL: Final = -1
ANY: Final = 1 << 60  # payload of a robot that carries everything
HEADING_COUNTS: Final = {"omni": 1, "rail": 2, "differential": 4}
OPERATIONS: Final = ("move", "turn", "pick", "drop", "try_drop")

Ticks = dict[str, tuple[int, int]]  # by operation: without a load, and with one


class Types:
    """By robot: its type, what it carries, where it may not go, and how long its operations take."""

    def __init__(self, floor: dict[str, Any], scenario: dict[str, Any]) -> None:
        kinds = kinds_of(scenario)
        areas = scenario.get("areas") or {}
        self.name: list[str] = []
        self.payload: list[int] = []
        self.closed: list[tuple[set[int], set[int]]] = []  # flat cells, without a load and with one
        self.headings: list[int] = []  # that it distinguishes
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
        # What each robot carries: the list that loads are kept in.
        self.load = [NIL] * len(self.name)
        self.apply_rules(scenario)

    def apply_rules(self, scenario: dict[str, Any]) -> None:
        """Take over what a scenario says of durations."""
        self.ticks: list[Ticks] = []
        for kind, robots in kinds_of(scenario):
            self.ticks += [ticks_of_type(scenario["durations"], kind)] * robots

    def ticks_of(self, robot: int, operation: str) -> int:
        """What an operation of a robot takes by its scenario, with what the robot carries now."""
        return self.ticks[robot][operation][self.load[robot] != NIL]

    def slowest(self, operation: str) -> int:
        """What an operation takes the robots that are slowest in it; 1 of those without a duration."""
        return max(max(one.get(operation, (1, 1))) for one in self.ticks)

    def is_closed(self, robot: int, cell: int) -> bool:
        """Whether a robot may not be in a cell, with what it carries now."""
        return cell in self.closed[robot][self.load[robot] != NIL]

    def called(self, robot: int) -> str:
        """A robot of this type, with or without a load, as errors say it."""
        own = f"robots of the type {self.name[robot]}" if self.name[robot] else "robots"
        empty, loaded = self.closed[robot]
        carries = "with" if self.load[robot] != NIL else "without"
        return own if empty == loaded else f"{own} {carries} a load"


def kinds_of(scenario: dict[str, Any]) -> list[tuple[dict[str, Any], int]]:
    """The types of a scenario, each with how many robots are of it."""
    fleet = scenario["fleet"]
    kinds: list[dict[str, Any]] = list(fleet.get("types") or ({"name": ""},))
    counted = sum(kind.get("robots") or 0 for kind in kinds)
    return [(kind, kind.get("robots") or fleet["robots"] - counted) for kind in kinds]


def ticks_of_type(durations: dict[str, Any], kind: dict[str, Any]) -> Ticks:
    """What the operations of a type take; what it does not say is as for all."""
    own = kind.get("durations") or {}
    ticks: Ticks = {}
    for name in OPERATIONS:
        value = durations[name] if own.get(name) is None else own[name]
        pair = (value["empty"], value["loaded"]) if isinstance(value, dict) else (value, value)
        times = kind.get("move_time_factor", 1) if name == "move" else 1
        ticks[name] = (pair[0] * times, pair[1] * times)
    return ticks


def closed_to(floor: dict[str, Any], areas: dict[str, Any], *names: str) -> set[int]:
    """The flat cells of the areas that are closed to all, or to one of these names."""
    stride = floor["width"] + 2
    cells: set[int] = set()
    for area in areas.values():
        if {"all", *names} & set(area["closed_to"]):
            (x, y), (u, v) = area["from"], area["to"]
            for row in range(min(y, v), max(y, v) + 1):
                first = (row + 1) * stride + 1
                cells.update(range(first + min(x, u), first + max(x, u) + 1))
    return cells
