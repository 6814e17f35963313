"""Service zones for display: their cells, a picture, their work, and lines about stations.

zone 1 (d): 3* 6 7 9* 10 15*; robot 0, 4.2 minutes of work          *: a transfer station
station 9, zone 1, to zone 3: part 12, 45 ticks left; queue 14, 17; 8 done
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Any, Final

import numpy as np

from automaton.engine.facilities import Design, Roads, ServiceZones
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    NIL,
    ORDER_CARRIED,
    ORDER_WAITING,
    Array,
    World,
)
from automaton.floor.floor_plan import FloorPlan
from automaton.units import SECONDS_PER_UNIT, count

# The first six are those of the viewer, where a to c have other meanings.
ZONE_LETTERS: Final = "defghijklmnopqrstuvwxyzabc"
PICTURE_KEY: Final = "small letters: paths of zones; capitals: their stations; *: transfer stations"
MAX_NAMED_PARTS: Final = 8  # parts of a line
# Distinguishable with all three kinds of color blindness (Okabe & Ito); letters repeat the information.
ZONE_COLOURS: Final = ("#56b4e9", "#e69f00", "#009e73", "#f0e442", "#cc79a7", "#d55e00")


def partition_picture(world: World, floor_plan: FloorPlan) -> str:
    """The floor with its zones, a line for each zone and each station; "" without zones and stations."""
    lines: list[str] = []
    if len(world.service_zones.roads.cell):
        zones = world.service_zones
        drawn = design_picture(floor_plan, zones.roads, zones.design).splitlines()
        lines += [*drawn[: floor_plan.height], "", *zones_told(world, drawn[floor_plan.height :])]
    if len(world.stations.part_arrivals):
        lines += [""] if lines else []
        lines += [station_line(world, station) for station in range(len(world.stations.slot))]
    return "\n".join(lines)


def design_picture(floor_plan: FloorPlan, roads: Roads, design: Design) -> str:
    """One character for each cell, and a line for each zone.

    Paths of zones are small letters, other roads are dots. A station is the capital letter of its zone,
    or * if it is a transfer station.
    """
    driven = floor_plan.drivable[1:-1, 1:-1].tolist()
    rows = [["." if cell else "#" for cell in row] for row in driven]
    for m in range(int(design.segments)):
        path = [floor_plan.xy(roads.cell[p]) for p in design.path[m, : design.points[m]]]
        for start, end in pairwise(path):
            _line(rows, start, end, ZONE_LETTERS[int(design.owner[m]) % len(ZONE_LETTERS)])
    shared = design.transfer.max(axis=(0, 1)).tolist()
    for s, zone in enumerate(design.zone.tolist()):
        x, y = floor_plan.xy(roads.cell[roads.point[s]])
        sign = ZONE_LETTERS[zone % len(ZONE_LETTERS)].upper() if zone >= 0 else "?"
        rows[y][x] = "*" if shared[s] else sign
    lines = ["".join(row) for row in rows]
    lines += [PICTURE_KEY, *(_listed(design, zone) for zone in range(len(design.transfer)))]
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


def zones_told(world: World, lines: list[str]) -> list[str]:
    """The lines about zones with their robots and work, and the balance of the work."""
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
    return told + ([] if uneven is None else [f"SVp {uneven:.2f}: imbalance of the work, 0 to 1"])


def station_line(world: World, station: int) -> str:
    """The work of a station, its queue, and the number of parts done."""
    stations = world.stations
    name = ", ".join([f"station {station + 1}", *_zones(world, station)])
    works, work = [], int(stations.in_service[station])
    while work != NIL:
        works.append(work)
        work = int(stations.next_in_queue[work])
    said = ["no work"]
    if works:
        left = count(int(stations.job_done_tick[station] - world.clock.tick), "tick")
        said = [f"part {stations.part[works[0]]}, {left} left"]
    if works[1:]:
        named = [str(stations.part[work]) for work in works[1 : 1 + MAX_NAMED_PARTS]]
        left_out = len(works) - 1 - MAX_NAMED_PARTS
        more = f" and {left_out} more" if left_out > 0 else ""
        said.append(f"queue {', '.join(named)}{more}")
    done = (stations.station == station) & (stations.completion_tick != NIL)
    return f"{name}: {'; '.join([*said, f'{np.count_nonzero(done)} done'])}"


def _zones(world: World, station: int) -> list[str]:
    """The zone of a station, and the zones with which it exchanges parts."""
    design = world.service_zones.design
    if not len(design.zone) or design.zone[station] == NIL:
        return []
    zone = int(design.zone[station])
    others = np.flatnonzero(design.transfer[zone, :, station]).tolist()
    return [f"zone {zone + 1}", *(f"to zone {other + 1}" for other in others)]


def coloured(picture: str) -> list[list[tuple[str, str]]]:
    """The lines of such a picture as (text, style): zones and their lines have the colors of zones."""
    letters = {
        letter: ZONE_COLOURS[at % len(ZONE_COLOURS)] for at, letter in enumerate(ZONE_LETTERS)
    }
    letters |= {letter.upper(): f"bold {colour}" for letter, colour in letters.items()}
    letters["*"] = "bold reverse"
    rows = []
    for written in picture.split("\n"):
        if written.startswith("zone "):
            rows.append([(written, letters[written.partition("(")[2][0]])])
        elif written.startswith(("station ", "SVp ", PICTURE_KEY)):
            rows.append([(written, "")])
        else:
            styles = groupby(written, lambda sign: letters.get(sign, ""))
            rows.append([("".join(signs), style) for style, signs in styles])
    return rows


# The cells of zones.


def ways_of(roads: Roads, design: Design, stride: int) -> tuple[Array, Array]:
    """(k,) each: flat cells on the straight lines between the points of segments, and their zones.

    A cell appears once for each segment that crosses it; it is in one zone, like its points.
    """
    used = int(design.segments)
    path, follows = design.path[:used], np.arange(1, design.path.shape[1])
    ways = follows < design.points[:used, None]
    here, there = roads.cell[path[:, :-1][ways]], roads.cell[path[:, 1:][ways]]
    zone = np.broadcast_to(design.owner[:used, None], ways.shape)[ways]
    step = np.where(here // stride == there // stride, 1, stride) * np.sign(there - here)
    count = np.abs((there - here) // np.where(step == 0, 1, step)) + 1
    nth = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.repeat(here, count) + nth * np.repeat(step, count), np.repeat(zone, count)


def stations_of(roads: Roads, design: Design) -> tuple[Array, Array, Array]:
    """(S,) each: the cell of a station, its zone or NIL, and whether it is a transfer station."""
    shared: Array = np.any(design.transfer, axis=(0, 1))
    return roads.cell[roads.point], design.zone, shared


# The current work of zones: minutes of driving and handling for the orders in their queues.


def work_of_each(world: World) -> Array:
    """(Z,) minutes of work of each zone, at the speed of the robot that serves it.

    A tick counts as a second if the scenario does not define it.
    """
    tick_s = world.rules.tick_us / 1e6 if world.rules.tick_us else 1.0
    kinds = world.robots.type[world.robots.at_index[world.service_zones.server]].astype(np.int64)
    if loaded := world.rules.loaded_types:
        kinds = loaded + kinds % loaded  # only carrying loads is work
    return np.array(
        [
            minutes_of_zones(
                world.service_zones, world.orders, [z], tick_s, world.rules.duration[kind]
            )
            for z, kind in enumerate(kinds.tolist())
        ]
    )


def minutes_of_zones(
    service_zones: ServiceZones, orders: Any, zones: Sequence[int], tick_s: float, duration: Array
) -> float:
    """Minutes (eq. 1-4) for orders that wait in the queues of zones, or are fetched or carried.

    tick_s: seconds per tick; duration: ticks by action.
    """
    mine = np.flatnonzero(np.isin(service_zones.queue, zones) & (service_zones.next_slot != NIL))
    mine = mine[mine < len(orders.state)]
    waits, carried = orders.state[mine] == ORDER_WAITING, orders.state[mine] == ORDER_CARRIED
    at = np.where(
        waits, orders.current_slot[mine], np.where(carried, service_zones.picked_from[mine], NIL)
    )
    here = service_zones.station_of[at]
    there = service_zones.station_of[service_zones.next_slot[mine]]
    legs = (at != NIL) & (here != NIL) & (there != NIL) & (here != there)
    flow = np.zeros(service_zones.roads.between.shape)
    np.add.at(flow, (here[legs], there[legs]), 1.0)
    work_ticks = float(duration[ACTION_PICK] + duration[ACTION_DROP])
    handling = tick_s * work_ticks / SECONDS_PER_UNIT["min"]
    speed = SECONDS_PER_UNIT["min"] / (tick_s * float(duration[ACTION_MOVE]))
    return work_minutes(flow, service_zones.roads.between, speed, handling)


def work_minutes(flow: Array, between: Array, speed: float, handling: float) -> float:
    """Minutes of work of a flow between any stations, equal to the kernel `load_of` without a base.

    In NumPy, so that a viewer does not wait for a kernel to compile. speed: cells per minute; handling:
    minutes to load and to unload.
    """
    total = float(flow.sum())
    if total == 0.0:
        return 0.0
    empty = np.outer(flow.sum(axis=0), flow.sum(axis=1)) / total
    return float(((flow + empty) * between).sum()) / speed + total * handling


def unevenness(work: Array) -> float | None:
    """SVp, from 0 (all zones have equal work) to 1 (one zone has all); None without any work."""
    total = float(work.sum())
    if total == 0.0 or len(work) < 2:
        return None
    apart = float(np.abs(work[:, None] - work[None, :]).sum()) / 2
    return apart / ((len(work) - 1) * total)
