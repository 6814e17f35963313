"""What a robot's type asks of it, read from a recorded scenario a second time: move time, payload,
areas."""

from __future__ import annotations

from typing import Any, Final

ANY: Final = 1 << 60  # payload of a robot that carries everything


class Types:
    """By robot: its type, how many times as long its moves take, what it carries, where it may not go."""

    def __init__(self, floor: dict[str, Any], scenario: dict[str, Any]) -> None:
        fleet = scenario["fleet"]
        kinds: list[dict[str, Any]] = list(fleet.get("types") or ({"name": ""},))
        counted = sum(kind.get("robots") or 0 for kind in kinds)
        shut = {
            kind["name"]: closed_to(floor, scenario.get("areas") or {}, kind["name"])
            for kind in kinds
        }
        self.name: list[str] = []
        self.move_time_factor: list[int] = []
        self.payload: list[int] = []
        self.closed: list[set[int]] = []  # flat cells
        for kind in kinds:
            robots = kind.get("robots") or fleet["robots"] - counted
            self.name += [kind["name"]] * robots
            self.move_time_factor += [kind.get("move_time_factor", 1)] * robots
            self.payload += [kind.get("payload") or ANY] * robots
            self.closed += [shut[kind["name"]]] * robots


def closed_to(floor: dict[str, Any], areas: dict[str, Any], name: str) -> set[int]:
    """The flat cells of the areas that are closed to a type."""
    stride = floor["width"] + 2
    cells: set[int] = set()
    for area in areas.values():
        if name in area["closed_to"]:
            (x, y), (u, v) = area["from"], area["to"]
            for row in range(min(y, v), max(y, v) + 1):
                first = (row + 1) * stride + 1
                cells.update(range(first + min(x, u), first + max(x, u) + 1))
    return cells
