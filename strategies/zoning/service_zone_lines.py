"""The cells along the segments of a zone design."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.facilities import Design, Roads
from automaton.engine.state import CLOCK_TICK, NIL, World
from automaton.floor.floor_plan import FloorPlan
from automaton.units import count
from strategies.zoning.zone_load import unevenness, work_of_each

if TYPE_CHECKING:
    from rich.text import Text


Cells = NDArray[Any]


def ways_of(roads: Roads, design: Design, stride: int) -> tuple[Cells, Cells]:
    """(k,) each: flat cells on the straight ways between the points of segments, and their zones.

    A cell comes as often as segments lead through it; it is in one zone, as points are.
    """
    used = int(design.segments[0])
    path, follows = design.path[:used], np.arange(1, design.path.shape[1])
    ways = follows < design.points[:used, None]
    here, there = roads.cell[path[:, :-1][ways]], roads.cell[path[:, 1:][ways]]
    zone = np.broadcast_to(design.owner[:used, None], ways.shape)[ways]
    step = np.where(here // stride == there // stride, 1, stride) * np.sign(there - here)
    count = np.abs((there - here) // np.where(step == 0, 1, step)) + 1
    nth = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.repeat(here, count) + nth * np.repeat(step, count), np.repeat(zone, count)


def stations_of(roads: Roads, design: Design) -> tuple[Cells, Cells, Cells]:
    """(S,) each: the cell of a station, its zone or NIL, and whether it is a transfer station."""
    shared: Cells = np.any(design.transfer, axis=(0, 1))
    return roads.cell[roads.point], design.zone, shared


# A zone design drawn over its floor.


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


# The zones that robots serve and the work at stations, as text below the picture of a world.
#
# zone 1 (d): 3* 6 7 9* 10 15*; robot 0, 4.2 minutes of work * a transfer station station 9, zone 1,
# to zone 3: part 12, 45 ticks left; queue 14, 17; 8 done


MAX_NAMED_PARTS: Final = 8  # parts of a line
# Told apart with all three kinds of colour blindness (Okabe & Ito); the letters say the same.
COLOURS: Final = ("#56b4e9", "#e69f00", "#009e73", "#f0e442", "#cc79a7", "#d55e00")


def partition_picture(world: World, floor_plan: FloorPlan) -> str:
    """The zones over their floor and a line on each, a line on each station; "" without either."""
    lines: list[str] = []
    if len(world.service_zones.roads.cell):
        drawn = design_picture(
            floor_plan, world.service_zones.roads, world.service_zones.design
        ).splitlines()
        lines += [*drawn[: floor_plan.height], "", *zones_told(world, drawn[floor_plan.height :])]
    if len(world.stations.part_arrivals):
        lines += [""] if lines else []
        lines += [station_line(world, station) for station in range(len(world.stations.slot))]
    return "\n".join(lines)


def zones_told(world: World, lines: list[str]) -> list[str]:
    """The lines on zones with who serves each and how much there is to do, and how uneven that is."""
    work = work_of_each(world)
    told = []
    for line in lines:
        if line.startswith("zone "):
            zone = int(line.split()[1]) - 1
            server = int(world.service_zones.server[zone])
            who = "no robot" if server == NIL else f"robot {server}"
            line += f"; {who}, {work[zone]:.1f} minutes of work"
        told.append(line)
    uneven = unevenness(work)
    return told + ([] if uneven is None else [f"SVp {uneven:.2f}: how uneven that is, 0 to 1"])


def station_line(world: World, station: int) -> str:
    """What a station works on, who waits there, and how much it has done."""
    stations = world.stations
    name = ", ".join([f"station {station + 1}", *_zones(world, station)])
    works, work = [], int(stations.in_service[station])
    while work != NIL:
        works.append(work)
        work = int(stations.next_in_queue[work])
    said = ["no work"]
    if works:
        left = count(int(stations.job_done_tick[station] - world.clock[CLOCK_TICK]), "tick")
        said = [f"part {stations.part[works[0]]}, {left} left"]
    if works[1:]:
        named = [str(stations.part[work]) for work in works[1 : 1 + MAX_NAMED_PARTS]]
        more = (
            f" and {len(works) - 1 - MAX_NAMED_PARTS} more"
            if len(works) - 1 > MAX_NAMED_PARTS
            else ""
        )
        said.append(f"queue {', '.join(named)}{more}")
    done = (stations.station == station) & (stations.completion_tick != NIL)
    return f"{name}: {'; '.join([*said, f'{np.count_nonzero(done)} done'])}"


def _zones(world: World, station: int) -> list[str]:
    """Its zone, and those with which it changes parts."""
    design = world.service_zones.design
    if not len(design.zone) or design.zone[station] == NIL:
        return []
    zone = int(design.zone[station])
    others = np.flatnonzero(design.transfer[zone, :, station]).tolist()
    return [f"zone {zone + 1}", *(f"to zone {other + 1}" for other in others)]


def coloured(picture: str) -> list[Text]:
    """The lines of such a picture; the letters of zones, and the lines on them, in their colours."""
    from rich.text import Text

    letters = {letter: COLOURS[at % len(COLOURS)] for at, letter in enumerate(ZONE_LETTERS)}
    letters |= {letter.upper(): f"bold {colour}" for letter, colour in letters.items()}
    lines = []
    for written in picture.split("\n"):
        text = Text(written)
        if written.startswith("zone "):
            text.stylize(letters[written.partition("(")[2][0]])
        elif not written.startswith(("station ", "SVp ", KEY)):
            for at, sign in enumerate(written):
                if sign in letters or sign == "*":
                    text.stylize(letters.get(sign, "bold reverse"), at, at + 1)
        lines.append(text)
    return lines
