"""Parts of a floor that a scenario names: open places, chargers, speed limits, stations with queues."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import msgspec
import numpy as np
import numpy.typing as npt

from automaton.errors import Finding, InputError, InvalidValueError, Keys, refuse
from automaton.floor.floor_plan import (
    CHARGER,
    DIRECTIONS,
    DRIVABLE,
    FLOOR,
    STATION,
    UNLIMITED,
    FloorPlan,
)
from automaton.floor.reachability import closed_step, reached, slot_access
from automaton.scenario.changing_floor import (
    Block,
    Cell,
    SpeedLimit,
    cells_of_set,
)
from automaton.scenario.durations import Handling
from automaton.scenario.schema import Scenario
from automaton.scenario.streets import StreetWeights, streets_on
from automaton.scenario.validation import dotted
from automaton.units import count

# Stations and chargers that are closed in the whole run: cells on which robots drive, without a function.


def with_open_places(scenario: Scenario, floor_plan: FloorPlan) -> tuple[Scenario, FloorPlan]:
    """The scenario and the floor without closed stations and chargers. Raises InvalidValueError.

    Open are the first ones of `stations`, then the stations without a name by their numbers, and the
    first chargers in reading order.
    """
    stations = floor_plan.stations.tolist()
    named = {name: floor_plan.cell(*station.at) for name, station in scenario.stations.items()}
    by_rank = dict.fromkeys([*(cell for cell in named.values() if cell in stations), *stations])
    chargers = np.flatnonzero(floor_plan.kind == CHARGER).tolist()
    closed = {
        *closed_places("stations", list(by_rank), scenario.floor.open_stations),
        *closed_places("chargers", chargers, scenario.floor.open_chargers),
    }
    if not closed:
        return scenario, floor_plan
    kind = floor_plan.kind.copy()
    kind.flat[list(closed)] = FLOOR
    kind.setflags(write=False)
    numbered = tuple(cell for cell in floor_plan.numbered if cell not in closed)
    open_stations = {
        name: station for name, station in scenario.stations.items() if named[name] not in closed
    }
    return (
        msgspec.structs.replace(scenario, stations=open_stations),
        replace(floor_plan, kind=kind, numbered=numbered),
    )


def closed_places(what: str, cells: list[int], number: int | None) -> list[int]:
    """The cells after the first ones; none without a number. Raises InvalidValueError."""
    if number is None:
        return []
    if number > len(cells):
        keys: Keys = ("floor", f"open_{what}")
        there = count(len(cells), what.removesuffix("s"))
        raise InvalidValueError(keys, f"{dotted(keys)} is {number}, but the floor has {there}")
    return cells[number:]


# Chargers: their capacity is the number of robots that charge at once.
#
# Elsewhere two robots share a cell only in opposite directions; at a charger of capacity 2 they stand
# side by side, from any direction. So its cell has no limit of its own, but is a block for two robots.


def with_shared_chargers(floor_plan: FloorPlan) -> FloorPlan:
    """The floor without capacity limits at chargers for two robots; unchanged if it has none."""
    shared = shared_chargers(floor_plan)
    if not len(shared):
        return floor_plan
    capacity = floor_plan.capacity.copy()
    capacity.flat[shared] = UNLIMITED
    capacity.setflags(write=False)
    return replace(floor_plan, capacity=capacity)


def shared_chargers(floor_plan: FloorPlan) -> npt.NDArray[np.int64]:
    """The flat cells of chargers for two robots."""
    return np.flatnonzero((floor_plan.kind == CHARGER) & (floor_plan.capacity == 2))


def with_charger_blocks(scenario: Scenario, floor_plan: FloorPlan) -> Scenario:
    """The scenario with a block that limits each charger for two robots."""
    blocks = list(scenario.floor.blocks)
    for cell in shared_chargers(floor_plan).tolist():
        block = msgspec.convert({"cells": [floor_plan.xy(cell)], "max_robots": 2}, Block)
        if block not in blocks:
            blocks.append(block)
    floor = msgspec.structs.replace(scenario.floor, blocks=tuple(blocks))
    return msgspec.structs.replace(scenario, floor=floor)


def places_of_chargers(scenario: Scenario, floor_plan: FloorPlan) -> dict[int, int]:
    """The number of robots that charge at once, by flat cell of the charger; all, without a limit."""
    places = {
        cell: 1 if floor_plan.capacity.flat[cell] != UNLIMITED else scenario.fleet.robots
        for cell in np.flatnonzero(floor_plan.kind == CHARGER).tolist()
    }
    for block in scenario.floor.blocks:
        cells = cells_of_set("", block.cells, floor_plan)
        if len(cells) == 1 and cells[0] in places:
            places[cells[0]] = min(places[cells[0]], block.max_robots)
    return places


# Speed limits: the least ticks of moves between some cells of the floor.


def check_speed_limits(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """Speed limits must be on cells that robots drive on."""
    for number, limit in enumerate(scenario.floor.speed_limits):
        name = f"speed limit {number + 1}"
        try:
            cells = cells_of_set(name, limit.cells, floor_plan)
            if not DRIVABLE[floor_plan.kind.flat[cells]].any():
                raise InputError(f"{name} has no cell on which robots drive")
        except InputError as error:
            yield Finding(("floor", "speed_limits", number, "cells"), error.message)


def with_speed_limits(floor_plan: FloorPlan, limits: tuple[SpeedLimit, ...]) -> FloorPlan:
    """The floor with the least ticks of moves; unchanged without limits."""
    if not limits:
        return floor_plan
    ticks = np.zeros((floor_plan.kind.size, 4), np.uint16)
    for limit in limits:
        inside = np.zeros(floor_plan.kind.size, np.bool_)
        inside[cells_of_set("", limit.cells, floor_plan)] = True
        for direction, offset in enumerate(floor_plan.offsets):
            # np.roll wraps around only through the border, where no robot drives.
            both = inside & np.roll(inside, -offset)
            ticks[both, direction] = np.maximum(ticks[both, direction], limit.max_speed)
    ticks.setflags(write=False)
    return replace(floor_plan, min_move_ticks=ticks)


# Streets: moves that are closed must leave a way between all places that robots need.


def with_limits_and_streets(
    scenario: Scenario, floor_plan: FloorPlan, is_closed: bool = False
) -> FloorPlan:
    """The floor with the speed limits and the streets of a scenario whose files were read.

    `is_closed`: it is without its closed moves already, as that of a recording.
    """
    limited = with_speed_limits(floor_plan, scenario.floor.speed_limits)
    return streets_on(limited, scenario.streets, is_closed).floor()


def with_streets(scenario: Scenario, streets: StreetWeights) -> FloorPlan:
    """The floor with weights, without closed moves. Raises InvalidValueError if one cuts off a place."""
    closed = streets.floor()
    if streets.closed.any():
        refuse(check_closings(scenario, streets, closed))
    return closed


def check_closings(
    scenario: Scenario, streets: StreetWeights, closed: FloorPlan
) -> Iterator[Finding]:
    """Places with ways to each other still have them."""
    floor_plan, places = streets.floor_plan, places_of(scenario, streets.floor_plan)
    for first in places[:1]:
        for backwards in (False, True):
            before = reached(floor_plan, [first], False, backwards)
            after = reached(closed, [first], False, backwards)
            for lost in (cell for cell in places if before[cell] and not after[cell]):
                begin, end = (lost, first) if backwards else (first, lost)
                step = closed_step(closed, [begin], [end])
                keys: Keys = ("streets",)
                text = ""
                if step is not None:
                    cell, _, direction = step
                    keys = streets.closed_by.get((cell, direction), keys)
                    x, y = floor_plan.xy(cell)
                    text = f": the move {DIRECTIONS[direction]} from [{x}, {y}] is closed"
                (x, y), (u, v) = floor_plan.xy(begin), floor_plan.xy(end)
                yield Finding(keys, f"streets leave no way from [{x}, {y}] to [{u}, {v}]{text}")


def streets_in_words(before: FloorPlan, after: FloorPlan) -> str:
    """What streets change on a floor: "streets: 6 moves closed"; "" if nothing but weights."""
    exits, now = before.exits, after.exits
    is_other = before.capacity != after.capacity
    numbers = (
        (np.bitwise_count(exits & ~now), "move", "closed"),
        (np.bitwise_count(now & ~exits), "move", "opened"),
        (is_other & (after.capacity == 1), "cell", "for 1 robot"),
        (is_other & (after.capacity == 2), "cell", "for 2 robots"),
    )
    parts = [f"{count(int(some.sum()), what)} {rule}" for some, what, rule in numbers if some.any()]
    return f"streets: {', '.join(parts)}" if parts else ""


def places_of(scenario: Scenario, floor_plan: FloorPlan) -> list[int]:
    """The cells that robots need: starts, homes, stations, chargers, and where slots are served.

    All cells, if robots start at random.
    """
    start = scenario.fleet.start
    drawn = bool(floor_plan.starts or len(floor_plan.bays))
    if start == "random" or (start is None and not drawn):
        return [int(cell) for cell in np.flatnonzero(floor_plan.drivable)]
    access = slot_access(floor_plan)
    named = [floor_plan.cell(*at) for at in start] if isinstance(start, tuple) else []
    cells = (
        floor_plan.starts,
        floor_plan.bays[:, 1],
        floor_plan.stations,
        np.flatnonzero(floor_plan.kind == CHARGER),
        access[access >= 0],
        named,
    )
    needed = {int(cell) for some in cells for cell in some}
    return sorted(cell for cell in needed if floor_plan.drivable.flat[cell])


# Stations: names, queues, and all cells that serve robots.


def station_numbers(scenario: Scenario, floor_plan: FloorPlan) -> dict[str, int]:
    """The number of each station, from 0, by its name and by its number from 1 as text."""
    cells = floor_plan.stations.tolist()
    numbers = {str(k + 1): k for k in range(len(cells))}
    named = {
        name: cells.index(floor_plan.cell(*station.at))
        for name, station in scenario.stations.items()
    }
    return numbers | named


def all_station_names(scenario: Scenario, floor_plan: FloorPlan) -> tuple[str, ...]:
    """The name of each station, or its number from 1 if it has no name; also without pods."""
    names = [str(k + 1) for k in range(len(floor_plan.stations))]
    for name, number in station_numbers(scenario, floor_plan).items():
        if name in scenario.stations:
            names[number] = name
    return tuple(names)


def handling_rules(scenario: Scenario, floor_plan: FloorPlan) -> list[Handling]:
    """The handling times of a visit, by station: its own, or durations.handling."""
    usual = scenario.durations.handling
    rules = [usual] * len(floor_plan.stations)
    numbers = station_numbers(scenario, floor_plan)
    for name, station in scenario.stations.items():
        rules[numbers[name]] = station.handling or usual
    return rules


def queue_path(floor_plan: FloorPlan, at: Cell, corners: Sequence[Cell]) -> list[int]:
    """Flat cells of a queue, the one next to the station first, by the corners of its path."""
    path: list[int] = []
    x, y = at
    for u, v in corners:
        while (x, y) != (u, v):
            x, y = (x + (u > x) - (u < x), y) if x != u else (x, y + (v > y) - (v < y))
            path.append(floor_plan.cell(x, y))
    return path


def service_cells(scenario: Scenario, floor_plan: FloorPlan) -> npt.NDArray[np.bool_]:
    """(C,) bool: stations, their queues and chargers, unless they hold any number of robots."""
    serving = np.isin(floor_plan.kind, (STATION, CHARGER)).reshape(-1)
    for station in scenario.stations.values():
        serving[queue_path(floor_plan, station.at, station.queue)] = True
    limited: npt.NDArray[np.bool_] = serving & (floor_plan.capacity.reshape(-1) != UNLIMITED)
    return limited
