"""The inspector's facts about service zones, stations and traffic zones.

Service zones are counted from 1, traffic zones from 0. If a run has both, a zone number means a
service zone.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.facilities import ServiceZones
from automaton.engine.state import NIL, ORDER_CARRIED, ORDER_WAITING
from automaton.errors import InputError
from automaton.floor.floor_plan import DIRECTIONS, DRIVABLE
from automaton.floor.traffic_zones import TrafficZones, traffic_zones_of
from automaton.scenario.robot_types import RobotType
from automaton.units import count
from automaton.world.rules import duration_table, tick_length
from strategies.zoning.service_zone_lines import minutes_of_zones
from tui.playback.panel_view import View
from tui.widgets.panel import (
    Facts,
    Line,
    Parts,
    Span,
    cell_link,
    dim,
    fact_lines,
    line,
    order_link,
    robot_link,
    several,
    title,
)

MOST_PARTS: Final = 12  # parts named in a line
MAX_ROBOTS_LISTED = 24  # robots named in a list
MAX_SLOW_ZONES_LISTED: Final = 5


def partition_of(view: View) -> ServiceZones | None:
    """The zones that robots serve, if there are any."""
    service_zones = view.snapshot.service_zones
    return service_zones if len(service_zones.roads.cell) else None


def zone_lines(view: View, zone: int, width: int) -> list[Line]:
    """All facts about a zone: a service zone if there are any, else a traffic zone."""
    service_zones = partition_of(view)
    if service_zones is not None:
        return served_zone_lines(view, service_zones, zone, width)
    traffic_zones = zones_in(view)
    if zone >= traffic_zones.count:  # selected in the other run
        return [line(title(f"zone {zone} "), "is not on this floor")]
    cells = np.flatnonzero((traffic_zones.of == zone).any(axis=1))
    robots = robots_in(view, zone)
    ends: Parts = [cell_link(view.floor_plan, int(cells[0]))]
    ends += [" to ", cell_link(view.floor_plan, int(cells[-1]))] if len(cells) > 1 else []
    named: Parts = []
    for robot in robots[:MAX_ROBOTS_LISTED].tolist():
        named += [", "] * bool(named) + [robot_link(robot)]
    if len(robots) > MAX_ROBOTS_LISTED:
        named.append(f" and {len(robots) - MAX_ROBOTS_LISTED:,} more")
    lines = [line(title(f"zone {zone} "), dim(f"of {traffic_zones.count:,}, {traffic_zones.mode}"))]
    crossing = bool(traffic_zones.intersection[cells[0]])
    facts: Facts = [
        ("is", ["an intersection" if crossing else "a stretch between intersections"]),
        ("cells", [f"{len(cells):,}, ", *ends]),
        ("driven", _ways(view, traffic_zones, int(cells[0]), zone)),
        ("a move", _pace(view, zone)),
        ("so far", _cost(view, zone)),
        ("robots", [f"{len(robots):,}"]),
        ("here", named),
    ]
    return [*lines, *fact_lines(facts, width)]


def checked_zone(view: View, zone: int) -> int:
    """The index of a zone by its number. Raises InputError."""
    service_zones = partition_of(view)
    if service_zones is not None:
        return checked_served(service_zones, zone)
    many = zones_in(view).count
    if zone >= many:
        numbers = f"zones are numbered from 0 to {many - 1}" if many else "this floor has none"
        raise InputError(f"there is no zone {zone}; {numbers}")
    return zone


# Zones that robots serve.


def served_zone_lines(view: View, service_zones: ServiceZones, zone: int, width: int) -> list[Line]:
    """All facts about a service zone."""
    if zone >= len(service_zones.server):  # selected in the other run
        return [line(title(f"zone {zone + 1} "), "is not in this run")]
    design, server = service_zones.design, int(service_zones.server[zone])
    waiting = queued(view, [zone])
    lines = [
        line(title(f"zone {zone + 1} "), dim(f"of {len(service_zones.server)} that robots serve"))
    ]
    facts: Facts = [
        ("served by", ["no robot" if server == NIL else robot_link(server)]),
        ("stations", several(_stations(view, design.zone == zone))),
    ]
    for other in range(len(service_zones.server)):
        shared = design.transfer[zone, other].astype(bool)
        if shared.any():
            links = several(_stations(view, shared))
            facts.append((f"to zone {other + 1}", ["through ", *links]))
    facts += [
        ("waiting", [count(len(waiting), "order")]),
        ("the oldest", several([order_link(order) for order in waiting])),
        ("being done", [f"{_under_way(view, zone)}"]),
        ("work", [work_words(view, [zone])]),
    ]
    return [*lines, *fact_lines(facts, width)]


def served_link(zone: int) -> Span:
    """A link to a service zone, under its number from 1."""
    return Span(f"zone {zone + 1}", "link", ("zone", zone))


def _stations(view: View, mask: NDArray[np.bool_]) -> list[Span]:
    return [station_link(view, station) for station in np.flatnonzero(mask).tolist()]


def _under_way(view: View, zone: int) -> str:
    """Numbers of the zone's orders that robots carry or will fetch."""
    orders, mine = view.snapshot.orders, view.snapshot.service_zones.queue == zone
    fetched = mine & (orders.state == ORDER_WAITING) & (orders.reserved_by != NIL)
    carried = mine & (orders.state == ORDER_CARRIED)
    return f"{np.count_nonzero(carried)} carried, {np.count_nonzero(fetched)} to be fetched"


def checked_served(service_zones: ServiceZones, number: int) -> int:
    """The index of a service zone by its number. Raises InputError."""
    if not 1 <= number <= len(service_zones.server):
        numbers = f"zones are numbered from 1 to {len(service_zones.server)}"
        raise InputError(f"there is no zone {number}; {numbers}")
    return number - 1


def robot_zone(view: View, robot: int) -> Facts:
    """The zone of a robot, the zones it serves, their queue, and its halt, if any."""
    service_zones = partition_of(view)
    own = int(view.snapshot.robots.service_zone[robot])
    if service_zones is None:
        return [("zone", [] if own == NIL else [str(own + 1)])]
    served = np.flatnonzero(service_zones.server == robot).tolist()
    parts = several([served_link(zone) for zone in served]) or ["no zone"]
    if own != NIL and own not in served:
        parts += ["; another robot serves its own, ", served_link(own)]
    waiting = queued(view, served)
    left = int(service_zones.halt[robot]) - view.snapshot.tick
    halted = f"zones are redesigned: it stands still for {count(left, 'tick')}"
    return [
        ("serves", parts),
        ("queue", [f"{count(len(waiting), 'order')} waiting"]),
        ("its work", [work_words(view, served)] if served else []),
        ("halted", [Span(halted, "warn")] if left > 0 else []),
    ]


def queued(view: View, zones: list[int]) -> list[int]:
    """The orders in the queues of zones that no robot has taken, oldest first."""
    orders, service_zones = view.snapshot.orders, view.snapshot.service_zones
    there = (
        np.isin(service_zones.queue, zones)
        & (orders.state == ORDER_WAITING)
        & (orders.reserved_by == NIL)
    )
    found = np.flatnonzero(there)
    oldest: list[int] = found[np.argsort(orders.release_tick[found], kind="stable")].tolist()
    return oldest


def work_words(view: View, zones: list[int]) -> str:
    """The workload of zones in minutes: queued, fetched and carried orders (eq. 1-4)."""
    scenario, shown = view.run.resolved.scenario, view.snapshot
    tick_s = (tick_length(scenario.units.tick) or 1_000_000) / 1e6
    duration = duration_table(RobotType(durations=scenario.durations), loaded=True)
    minutes = minutes_of_zones(shown.service_zones, shown.orders, zones, tick_s, duration)
    return f"{minutes:.1f} minutes of driving and handling"


def order_zone(view: View, order: int) -> Facts:
    """The queue of an order, its next stop, and whether it skips transfer stations."""
    service_zones, orders = partition_of(view), view.snapshot.orders
    if service_zones is None or orders.state[order] not in (ORDER_WAITING, ORDER_CARRIED):
        return []
    queue, next_slot = int(service_zones.queue[order]), int(service_zones.next_slot[order])
    facts: Facts = [("queue", ["of ", served_link(queue)] if queue >= 0 else [])]
    if next_slot != NIL:
        station = int(service_zones.station_of[next_slot])
        last = next_slot == orders.target[order]
        where: Parts = ["station ", station_link(view, station)] if station != NIL else ["a shelf"]
        where.append(", its target" if last else ", a transfer station")
        where.append(
            "; skips transfer stations, to share work"
            if service_zones.skips_transfer[order]
            else ""
        )
        facts.append(("next stop", where))
    return facts


# Stations.


def station_facts(view: View, cell: int) -> Facts:
    """The station in a cell: its zone, the zones between which it transfers, and its work."""
    station = station_at(view, cell)
    if station == NIL:
        return []
    service_zones = partition_of(view)
    of = f"{station + 1} of {len(station_cells(view))}"
    facts: Facts = [("station", [of])]
    if service_zones is not None:
        zone = int(service_zones.design.zone[station])
        facts[0][1].extend([] if zone == NIL else [", in ", served_link(zone)])
        told: Parts = []
        pairs = np.argwhere(np.triu(service_zones.design.transfer[:, :, station], 1)).tolist()
        for a, b in pairs:
            told += [" and " if told else "between ", served_link(a), " - ", served_link(b)]
        facts.append(("transfers", told))
    if len(view.snapshot.stations.slot):
        facts += _work(view, station)
    return facts


def station_at(view: View, cell: int) -> int:
    """The station in a cell, or the one to which its slot belongs, or NIL."""
    points = np.flatnonzero(station_cells(view) == cell)
    if len(points):
        return int(points[0])
    service_zones = partition_of(view)
    slots = np.flatnonzero(view.snapshot.slots.cell == cell)
    return (
        NIL if service_zones is None or not len(slots) else int(service_zones.station_of[slots[0]])
    )


def station_cells(view: View) -> NDArray[np.int32]:
    """(S,) the cell of each station that works on parts or belongs to service zones."""
    service_zones, stations, slots = partition_of(view), view.snapshot.stations, view.snapshot.slots
    cells: NDArray[np.int32] = slots.cell[stations.slot]
    return (
        service_zones.roads.cell[service_zones.roads.point] if service_zones is not None else cells
    )


def station_link(view: View, station: int) -> Span:
    """A station's number, counted from 1, as a link to its cell."""
    return Span(str(station + 1), "link", ("cell", int(station_cells(view)[station])))


def checked_station(view: View, number: int) -> int:
    """The cell of a station by its number. Raises InputError."""
    cells = station_cells(view)
    if not 1 <= number <= len(cells):
        numbers = f"stations are numbered from 1 to {len(cells)}" if len(cells) else "there is none"
        raise InputError(f"there is no station {number}; {numbers}")
    return int(cells[number - 1])


def line_at(view: View, station: int) -> list[int]:
    """The open jobs of a station, the one in service first."""
    stations, works = view.snapshot.stations, []
    work = int(stations.in_service[station])
    while work != NIL:
        works.append(work)
        work = int(stations.next_in_queue[work])
    return works


def _work(view: View, station: int) -> Facts:
    stations, tick = view.snapshot.stations, view.snapshot.tick
    works = line_at(view, station)
    mine = stations.station == station
    done = int(np.count_nonzero(mine & (stations.completion_tick != NIL)))
    now = "nothing"
    if works:
        left = int(stations.job_done_tick[station]) - tick
        now = f"part {stations.part[works[0]]}, {count(left, 'tick')} left"
    waiting = [str(stations.part[work]) for work in works[1:]]
    named = ", ".join(waiting[:MOST_PARTS]) + (", ..." if len(waiting) > MOST_PARTS else "")
    busy = int(stations.processing_time[mine & (stations.completion_tick != NIL)].sum())
    return [
        ("works on", [now]),
        ("queue", [f"{count(len(waiting), 'part')}: {named}"] if waiting else ["no part"]),
        ("so far", [f"{count(done, 'part')} in {count(busy, 'tick')} of work"]),
    ]


def part_of_order(view: View, order: int) -> Facts:
    """The part that an order moves, if stations work on parts."""
    stations = view.snapshot.stations
    if not len(stations.job_of_order) or stations.job_of_order[order] == NIL:
        return []
    work = int(stations.job_of_order[order])
    return [
        (
            "moves",
            [f"part {stations.part[work]} to its next job, {stations.processing_time[work]} ticks"],
        )
    ]


def parts_finished(view: View) -> tuple[int, int] | None:
    """Numbers of finished and of all parts; None if stations work on no parts."""
    stations = view.snapshot.stations
    last = stations.releases_order == NIL
    if not len(stations.part_arrivals):
        return None
    return int(np.count_nonzero(stations.completion_tick[last] != NIL)), int(np.count_nonzero(last))


# Traffic zones: their robots, and the duration of moves.


def zones_in(view: View) -> TrafficZones:
    """The traffic zones under the present rules."""
    return traffic_zones_of(view.floor_plan, view.run.resolved.scenario.world.traffic_zones)


def zone_link(zone: int) -> Span:
    """A zone's number as a link to the inspector."""
    return Span(str(zone), "link", ("zone", zone))


def slow_zones(view: View) -> list[Line]:
    """The zones that slowed moves most so far, with lost ticks."""
    lost = view.snapshot.lost_in_zone
    worst = [
        zone
        for zone in np.argsort(-lost, kind="stable")[:MAX_SLOW_ZONES_LISTED].tolist()
        if lost[zone]
    ]
    if not worst:
        return []
    wide, served = len(str(max(worst))), partition_of(view) is not None
    names = [str(zone) if served else zone_link(zone) for zone in worst]
    rows = [
        line("zone ", name, " " * (wide - len(str(zone))), f"{int(lost[zone]):>9,}")
        for zone, name in zip(worst, names, strict=True)
    ]
    return [line(title("slowest zones"), dim(" by ticks lost in them")), *rows]


def robots_in(view: View, zone: int) -> NDArray[np.intp]:
    """The robots that count as in a zone, by their cell and the direction in which they came."""
    fleet, of = view.snapshot.robots, zones_in(view).of
    there = of[fleet.cell, fleet.travel >> 1] == zone
    return np.flatnonzero(there & (fleet.cell != NIL))


def zone_facts(view: View, cell: int) -> Facts:
    """The traffic zones of a cell, their numbers of robots, and the duration of a move.

    Where robots serve zones, traffic zones are mentioned only if they slow robots down.
    """
    if partition_of(view) is not None and not _slow(view):
        return []
    if not DRIVABLE[view.floor_plan.kind.reshape(-1)[cell]]:
        return []
    traffic_zones = zones_in(view)
    numbers = sorted({int(zone) for zone in traffic_zones.of[cell] if zone != NIL})
    if not numbers:
        crossing = "none: an intersection" if traffic_zones.intersection[cell] else "none"
        return [("zone", [crossing, *_free(view)])]
    facts: Facts = []
    for zone in numbers:
        ways = [f" ({way})" for way in _ways(view, traffic_zones, cell, zone)]
        now = f" with {count(len(robots_in(view, zone)), 'robot')} now"
        served = partition_of(view) is not None
        parts: Parts = [str(zone) if served else zone_link(zone), *ways, now]
        facts += [("stretch" if served else "zone", parts), ("a move", _pace(view, zone))]
    return facts


def _ways(view: View, traffic_zones: TrafficZones, cell: int, zone: int) -> Parts:
    """The directions of a zone, if the opposite directions have another zone."""
    if traffic_zones.of[cell, 0] == traffic_zones.of[cell, 1]:
        return []
    exits, column = (
        int(view.floor_plan.exits.reshape(-1)[cell]),
        int(traffic_zones.of[cell, 1] == zone),
    )
    pair = (2 * column, 2 * column + 1)
    ways = [DIRECTIONS[d] for d in pair if exits >> d & 1 or exits >> (d ^ 2) & 1]
    return [" and ".join(ways)]


def _slow(view: View) -> bool:
    return view.run.resolved.scenario.world.slowdown == "zones"


def pace_words(many: int, move: int) -> str:
    """The duration of a move in a zone: number of robots times ticks."""
    return f"{many} x {move} = {many * move} ticks" if move != 1 else count(many, "tick")


def _free(view: View) -> Parts:
    return [", which slows no robot down"] if _slow(view) else []


def _pace(view: View, zone: int) -> Parts:
    """The duration of a move that starts now in a zone; [] if zones do not slow robots."""
    if not _slow(view):
        return []
    moves = view.run.resolved.scenario.durations.moves
    many = max(1, len(robots_in(view, zone)))
    ticks = pace_words(many, moves.empty)
    if moves.differ:
        ticks += f", with a load {pace_words(many, moves.loaded)}"
    types = view.run.resolved.scenario.fleet.types
    slower = (
        ", times the move_time_factor of its type"
        if any(kind.move_time_factor > 1 for kind in types)
        else ""
    )
    return [f"from here takes {ticks}{slower}"]


def _cost(view: View, zone: int) -> Parts:
    """The ticks that a zone has cost; [] if zones have never slowed robots."""
    lost = int(view.snapshot.lost_in_zone[zone])
    return [f"moves from here took {count(lost, 'tick')} longer"] if lost or _slow(view) else []
