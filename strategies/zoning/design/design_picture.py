"""A zone design drawn over its floor."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

from automaton.engine.facilities import Design, Roads
from automaton.floor.floor_plan import FloorPlan

# The first six as in the viewer, where a to c are signs.
ZONE_LETTERS: Final = "defghijklmnopqrstuvwxyzabc"
KEY: Final = "small letters: ways of zones; capitals: their stations; *: transfer stations"


def design_picture(floor_plan: FloorPlan, roads: Roads, design: Design) -> str:
    """One character for each cell, and a line on each zone.

    Ways of zones are small letters, other ways dots; a station is the letter of its zone as a
    capital, or * where it is a transfer station.
    """
    driven = floor_plan.drivable[1:-1, 1:-1].tolist()
    rows = [["." if cell else "#" for cell in row] for row in driven]
    for m in range(int(design.segments[0])):
        path = [floor_plan.xy(roads.cell[p]) for p in design.path[m, : design.points[m]]]
        for start, end in pairwise(path):
            _line(rows, start, end, ZONE_LETTERS[int(design.owner[m]) % len(ZONE_LETTERS)])
    shared = design.transfer.max(axis=(0, 1)).tolist()
    for s, zone in enumerate(design.zone.tolist()):
        x, y = floor_plan.xy(roads.cell[roads.point[s]])
        rows[y][x] = (
            "*"
            if shared[s]
            else ZONE_LETTERS[zone % len(ZONE_LETTERS)].upper()
            if zone >= 0
            else "?"
        )
    lines = ["".join(row) for row in rows]
    lines += [KEY, *(_listed(design, zone) for zone in range(len(design.transfer)))]
    return "\n".join(lines) + "\n"


def _line(rows: list[list[str]], start: tuple[int, int], end: tuple[int, int], mark: str) -> None:
    (x, y), (to_x, to_y) = sorted((start, end))
    for column in range(x, to_x + 1):
        for row in range(min(y, to_y), max(y, to_y) + 1):
            rows[row][column] = mark


def _listed(design: Design, zone: int) -> str:
    def marked(s: int) -> str:
        return f"{s + 1}*" if design.transfer[zone, :, s].any() else str(s + 1)

    own = [marked(s) for s in range(len(design.zone)) if design.zone[s] == zone]
    return f"zone {zone + 1} ({ZONE_LETTERS[zone % len(ZONE_LETTERS)]}): {' '.join(own)}"
