"""The rules of stations: parts are worked on one at a time, in arrival order.

When the job on a part is done, the order to its next station is released; the next part in the
queue is worked on from the same tick on.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from automaton.evidence.verification.type_rules import NIL
from automaton.floor.cells import STATION


class Work:
    """What lies in the lines of all stations, replayed from deliveries."""

    def __init__(self, header: dict[str, Any]) -> None:
        floor, orders = header["floor"], header["scenario"]["orders"]
        cells = [
            cell for cell, kind in enumerate(floor["kind"].ravel().tolist()) if kind == STATION
        ]
        self.cells: list[int] = list(floor["numbered"]) or cells
        self.lines: list[deque[int]] = [deque() for _ in self.cells]
        self.until = [0] * len(self.cells)  # tick in which the first of its line is done
        self.station: list[int] = []  # of each work
        self.ticks: list[int] = []
        self.frees: list[int] = []  # the order that a work frees, or NIL
        self.done: list[int] = []
        self.came: list[int] = []  # tick from which it may be worked on
        self.begins_with: dict[int, int] = {}  # order -> work that begins with its delivery
        self.ends: dict[int, tuple[int, int]] = {}  # order -> cells where it begins and ends
        self._entering: list[tuple[int, int]] = []  # (tick, work), by tick
        # What is drawn stands in the header; older ones have nothing that is.
        drawn = header.get("jobs", {})
        self._drawn: list[int] = (
            drawn["processing_time"].tolist() if "processing_time" in drawn else []
        )
        came: list[int] = drawn["arrival_tick"].tolist() if "arrival_tick" in drawn else []
        for kind in orders.get("parts") or ():
            for _ in range(kind["count"]):
                tick = came[len(self.station)] if came else kind["first_release"]
                self._enter(tick, kind["route"], orders["processing_time"])
        self._entering.sort(reverse=True)

    def _enter(self, tick: int, route: list[int], times: Any) -> None:
        for place, number in enumerate(route):
            if place:
                order = len(self.ends)
                self.frees[-1] = order
                self.begins_with[order] = len(self.station)
                self.ends[order] = self.cells[route[place - 1] - 1], self.cells[number - 1]
            else:
                self._entering.append((tick, len(self.station)))
            self.station.append(number - 1)
            given = times[number - 1] if isinstance(times, list | tuple) else times
            drawn = isinstance(given, dict)
            self.ticks.append(self._drawn[len(self.ticks)] if drawn else given)
            self.frees.append(NIL)
            self.done.append(NIL)
            self.came.append(NIL)

    @property
    def undone(self) -> int:
        """Works that are still to do."""
        return self.done.count(NIL)

    def begin(self, tick: int) -> list[int]:
        """Parts come, work ends; returns the orders that are released."""
        while self._entering and self._entering[-1][0] <= tick:
            self._come(tick, self._entering.pop()[1])
        freed = []
        for station, line in enumerate(self.lines):
            if line and self.until[station] <= tick:
                work = line.popleft()
                self.done[work] = tick
                if self.frees[work] != NIL:
                    freed.append(self.frees[work])
                if line:
                    self.until[station] = max(tick, self.came[line[0]]) + self.ticks[line[0]]
        return freed

    def deliver(self, tick: int, order: int) -> None:
        """An order is where it has to go from this tick on."""
        if order in self.begins_with:
            self._come(tick, self.begins_with[order])

    def _come(self, tick: int, work: int) -> None:
        """Queues are in arrival order; within one tick, in the order of their numbers."""
        line = self.lines[self.station[work]]
        self.came[work] = tick
        place = len(line)
        while place and (self.came[line[place - 1]], line[place - 1]) > (tick, work):
            place -= 1
        line.insert(place, work)
        if place == 0:
            self.until[self.station[work]] = tick + self.ticks[work]

    def first(self) -> list[int]:
        """The work under way at each station, or NIL."""
        return [line[0] if line else NIL for line in self.lines]
