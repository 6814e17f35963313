"""Warn about stations and pods that are legal but keep robots waiting."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from automaton.floor.cells import CHARGER, STORAGE
from automaton.floor.floor_plan import FloorPlan
from automaton.floor.loaded_ways import to_and_from
from automaton.floor.reachability import Mask
from automaton.scenario.pods import PodStation
from automaton.units import count
from automaton.world.queues import queue_path
from automaton.world.resolve import Resolved
from automaton.world.station_numbers import station_names


def pod_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence for each warning; none where orders are not lines."""
    if resolved.scenario.orders.lines is None:
        return []
    return [*too_many_trips(resolved), *crossed_queues(resolved), *robots_that_wait(resolved)]


def places_of(floor_plan: FloorPlan, station: PodStation) -> int | None:
    """How many trips a station lets come; None: any number."""
    if station.max_trips == "queue":
        return len(queue_path(floor_plan, station.at, station.queue)) + 1
    return station.max_trips


def too_many_trips(resolved: Resolved) -> Iterator[str]:
    """Warn about stations that let more trips come than their queues have room for."""
    for name, station in resolved.scenario.stations.items():
        room = len(queue_path(resolved.floor_plan, station.at, station.queue)) + 1
        most = places_of(resolved.floor_plan, station)
        if most is not None and most > room:
            yield (
                f"station {name} lets {most:,} trips come (max_trips) and has room for "
                f"{count(room, 'robot')}, its queue and itself: the others wait on the ways of all"
            )


def crossed_queues(resolved: Resolved) -> Iterator[str]:
    """Warn about queues through which robots with pods must drive that go to another station."""
    floor_plan, fleet = resolved.floor_plan, resolved.fleet
    kinds = floor_plan.kind.reshape(-1)
    used: Mask = (kinds == STORAGE) & (floor_plan.loads.reshape(-1) != 0) | (kinds == CHARGER)
    used[floor_plan.stations] = True
    names = station_names(resolved)
    for name, station in resolved.scenario.stations.items():
        own = [floor_plan.cell(*station.at)]
        own += queue_path(floor_plan, station.at, station.queue)
        others = [cell for cell in floor_plan.stations.tolist() if cell not in own]
        if len(own) == 1 or not others:
            continue
        around, lost = without(floor_plan, own), np.zeros_like(used)
        for rail in {one.rail for one in fleet.types}:
            before = to_and_from(floor_plan, others[0], rail)
            lost |= used & before & ~to_and_from(around, others[0], rail)
        lost[own] = False
        if lost.any():
            x, y = floor_plan.xy(int(np.argmax(lost)))
            other = names[floor_plan.stations.tolist().index(others[0])]
            yield (
                f"the queue of station {name} is on the only way between [{x}, {y}] and station {other}: "
                "robots that go there stand in it"
            )


def without(floor_plan: FloorPlan, cells: list[int]) -> FloorPlan:
    """The floor without ways into some cells and out of them."""
    exits = floor_plan.exits.reshape(-1).copy()
    closed = np.zeros(exits.size, np.bool_)
    closed[cells] = True
    exits[closed] = 0
    for direction, offset in enumerate(floor_plan.offsets):
        exits[np.roll(closed, -offset)] &= np.uint8(15 ^ (1 << direction))
    return floor_plan.with_exits(exits.reshape(floor_plan.exits.shape))


def robots_that_wait(resolved: Resolved) -> Iterator[str]:
    """Warn about robots that have nothing to do, or stand where no other robot may be."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    named = [places_of(floor_plan, station) for station in scenario.stations.values()]
    places = [1] * (len(floor_plan.stations) - len(named)) + [one or 0 for one in named]
    robots = scenario.fleet.robots
    if None not in named and robots > sum(places):
        yield (
            f"{count(robots, 'robot')}, but stations let {count(sum(places), 'trip')} come at a time: "
            "the others have nothing to do"
        )
    stays = resolved.may_stay
    if stays and scenario.pods.under == "none" and robots > 1:
        yield (
            "robots without a trip stay under the pods that they have stored (idle: stay), where no "
            "other robot may come to lift them (pods.under: none); set idle: park"
        )
