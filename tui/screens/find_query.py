"""Robots, cells, zones by what a user types.

17, load 7, pod 12, 12,4, station 11, station P1, zone 9, waiting > 20, jam, starved, and what the
scenario names: see tui.screens.find_names
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from automaton.engine.state import NIL
from automaton.errors import InputError, nearest
from automaton.floor.cells import KIND_BY_NAME, WALL
from automaton.history.breakpoints import robots_where
from automaton.units import count
from tui.playback.jam_place import middle_robot
from tui.playback.panel_view import View
from tui.screens.find_names import named_places, places_of_pods
from tui.widgets.pod_facts import has_pods, makes_trips
from tui.widgets.service_zone_facts import checked_station
from tui.widgets.traffic_zone_facts import checked_zone


class Found(NamedTuple):
    """Robots, or else cells or zones, to step through from the one at index `first` on."""

    text: str
    robots: tuple[int, ...] = ()
    cells: tuple[int, ...] = ()
    first: int = 0
    zones: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.places)

    @property
    def places(self) -> tuple[int, ...]:
        """Those of them that there are."""
        return self.robots or self.cells or self.zones

    @property
    def many(self) -> str:
        """How many of what."""
        kind = "robot" if self.robots else "cell" if self.cells else "zone"
        return count(len(self.places), kind)


def find(text: str, view: View) -> Found:
    """What matches the text now. Raises InputError with what can be written."""
    words = " ".join(text.lower().split())
    if number := re.fullmatch(r"(?:robot )?(\d{1,9})", words):
        return Found(words, robots=(_robot(int(number[1]), view),))
    if (named := named_places(words, view)) is not None:
        return Found(words, *named)
    if has_pods(view) and (places := _with_pods(words, view)):
        return places
    if number := re.fullmatch(r"(?:load|order) (\d{1,9})", words):
        return _order(words, int(number[1]), view)
    if number := re.fullmatch(r"zone (\d{1,9})", words):
        return Found(words, zones=(checked_zone(view, int(number[1])),))
    if number := re.fullmatch(r"station (\d{1,9})", words):
        return Found(words, cells=(checked_station(view, int(number[1])),))
    if pair := re.fullmatch(r"\(?(-?\d{1,9}) ?, ?(-?\d{1,9})\)?", words):
        return Found(words, cells=(_cell(int(pair[1]), int(pair[2]), view),))
    if words in ("jam", "starved"):
        return _without_progress(words, view)
    kind = KIND_BY_NAME.get(words, KIND_BY_NAME.get(words.removesuffix("s")))
    if words == "shelves":
        kind = KIND_BY_NAME["shelf"]
    if kind is not None and kind.code != WALL:
        cells = np.flatnonzero(view.floor_plan.kind.reshape(-1) == kind.code)
        return Found(words, cells=tuple(cells.tolist()))
    robots = robots_where(" ".join(text.split()), view.snapshot, view.floor_plan)
    return Found(words, robots=tuple(robots.tolist()))


def _robot(number: int, view: View) -> int:
    n = len(view.snapshot.robots)
    if number >= n:
        raise InputError(f"there is no robot {number}; robots are numbered from 0 to {n - 1}")
    return number


def _without_progress(words: str, view: View) -> Found:
    """Robots that have finished nothing for long: all of them, or those of the largest jam."""
    figures = view.playback.figures[view.side]
    if words == "starved":
        return Found(words, robots=tuple(figures.starved.tolist()))
    if figures.jam is None:
        return Found(words)
    first = middle_robot(figures.jam, view.snapshot, view.floor_plan)
    return Found(words, robots=figures.jam.robots, first=first)


def _with_pods(words: str, view: View) -> Found | None:
    """A pod or a station by its name or number, or a trip, where pods are carried."""
    snapshot = view.snapshot
    if words.startswith("pod ") and snapshot.pod_names:
        return _pod(words, view)
    if (number := re.fullmatch(r"trip (\d{1,9})", words)) and makes_trips(view):
        return _order(words, int(number[1]), view)
    names = [name.lower() for name in snapshot.station_names]
    name = words.removeprefix("station ")
    if name in names and (name != words or not name.isdigit()):
        return Found(words, cells=(int(snapshot.pod_stations.cell[names.index(name)]),))
    if name != words:
        raise InputError(
            f"there is no station {name}; stations are {', '.join(snapshot.station_names)}"
        )
    return None


def _pod(words: str, view: View) -> Found:
    """Where a pod stands, or who carries it."""
    snapshot = view.snapshot
    name = words.removeprefix("pod ")
    names = [one.lower() for one in snapshot.pod_names]
    if name not in names and not (name.isdecimal() and 1 <= int(name) <= len(names)):
        there = f"pods are numbered from 1 to {len(names)}"
        raise InputError(
            f"there is no pod {name}{nearest(name, snapshot.pod_names) or f'; {there}'}"
        )
    pod = names.index(name) if name in names else int(name) - 1
    return Found(words, *places_of_pods([pod], view))


def _order(words: str, number: int, view: View) -> Found:
    """Who carries the load or is to fetch it; else where it lies."""
    orders, slots = view.snapshot.orders, view.snapshot.slots
    if number >= len(orders.state):
        raise InputError(
            f"there is no order {number}; orders are numbered from 0 to {len(orders.state) - 1}"
        )
    if orders.reserved_by[number] != NIL:
        return Found(words, robots=(int(orders.reserved_by[number]),))
    place = (
        orders.current_slot[number] if orders.current_slot[number] != NIL else orders.target[number]
    )
    return Found(words, cells=() if place == NIL else (int(slots.cell[place]),))


def _cell(x: int, y: int, view: View) -> int:
    floor_plan = view.floor_plan
    if not floor_plan.holds(x, y) and floor_plan.cell(x, y) not in floor_plan.bays[:, 0]:
        raise InputError(
            f"there is no cell ({x}, {y}); the floor goes from (0, 0) "
            f"to ({floor_plan.width - 1}, {floor_plan.height - 1})"
        )
    return floor_plan.cell(x, y)
