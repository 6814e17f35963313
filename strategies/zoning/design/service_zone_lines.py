"""The zones that robots serve and the work at stations, as text below the picture of a world.

zone 1 (d): 3* 6 7 9* 10 15*; robot 0, 4.2 minutes of work       * a transfer station
station 9, zone 1, to zone 3: part 12, 45 ticks left; queue 14, 17; 8 done
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from automaton.engine.state import CLOCK_TICK, NIL, World
from automaton.floor.floor_plan import FloorPlan
from automaton.units import count
from strategies.zoning.design.design_picture import KEY, ZONE_LETTERS, design_picture
from strategies.zoning.design.zone_work import unevenness, work_of_each

if TYPE_CHECKING:  # reports alone need it
    from rich.text import Text

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
