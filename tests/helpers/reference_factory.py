"""The factory as events, without cells: what a run with fixed zones should come to.

Robots drive the distances of the graph, meet nobody, and take 2.5 s to load or unload and up to 5 s
until they notice; whole seconds. Parts are routed by the kernel of the strategies, and shared by
`reference_load_sharing`, which has no code in common with theirs.
"""

from __future__ import annotations

import heapq
from math import ceil
from random import Random
from typing import Any

import numpy as np
from reference_load_sharing import share
from zoning_scenes import FEET_PER_MINUTE, factory

from automaton.engine.facilities import Design
from strategies.zoning.loads_and_transfers import route
from strategies.zoning.zone_workspace import space_for

MINUTES = (6, 4, 3, 5, 6, 3, 4, 3, 4, 5, 1, 1, 1, 1, 6, 1, 5, 5)  # processing at WS1 to WS18
ROUTES = (  # the paper's Table 3
    *[(4, 2, 1, 3, 14)] * 30,
    *[(5, 6, 7, 13, 17)] * 30,
    *[(11, 8, 9, 10, 18)] * 20,
    *[(14, 11, 13, 11, 8, 10, 14, 15)] * 20,
)
STARTS = (11, 1, 18)
AGE, DISTANCE = 0.5, 10.0  # C_A and C_D of the score
SHARING = 60  # seconds between two rounds


class Run:
    """One run of the test set; `hours` and `feet` (3,) are what it came to."""

    def __init__(self, design: Design, rule: int, seed: int, sharing: bool = False) -> None:
        _, _, self.roads = factory()
        self.feet_between = self.roads.between * 2.5
        self.design, self.rule, self.random = design, rule, Random(seed)
        self.workspace = space_for(self.roads, len(design.transfer))
        parts = len(ROUTES)
        self.at = np.array([stations[0] - 1 for stations in ROUTES], np.int32)
        self.to, self.stop, self.queue = np.zeros((3, parts), np.int32)
        self.waiting, self.direct = np.zeros((2, parts), np.uint8)
        self.since, self.done = np.zeros(parts), [0] * parts
        self.lines: list[list[int]] = [[] for _ in MINUTES]
        self.working = [False] * len(MINUTES)
        self.place, self.idle = [number - 1 for number in STARTS], [True] * len(STARTS)
        self.feet, self.trips = np.zeros(len(STARTS)), [0] * len(STARTS)
        self.events: list[tuple[float, int, Any]] = []
        self.count, self.hours, self.left = 0, 0.0, parts
        for part in range(parts):
            self._arrive(0, part)
        if sharing:
            self._at(30, (self._share,))
        while self.left:
            now, _, (act, *what) = heapq.heappop(self.events)
            act(now, *what)
            for robot in np.flatnonzero(self.idle).tolist():
                self._choose(now, robot)

    def _at(self, time: float, event: Any) -> None:
        self.count += 1
        heapq.heappush(self.events, (time, self.count, event))

    def _arrive(self, now: float, part: int) -> None:
        station = int(self.at[part])
        self.lines[station].append(part)
        self._work(now, station)

    def _work(self, now: float, station: int) -> None:
        if self.lines[station] and not self.working[station]:
            self.working[station] = True
            end = now + 60 * MINUTES[station]
            self._at(end, (self._worked, station, self.lines[station].pop(0)))

    def _worked(self, now: float, station: int, part: int) -> None:
        self.working[station] = False
        self.done[part] += 1
        if self.done[part] == len(ROUTES[part]):
            self.left -= 1
            self.hours = now / 3600
        else:
            self.to[part] = ROUTES[part][self.done[part]] - 1
            self.since[part], self.direct[part] = now, 0
            self._enqueue(part, int(self.design.zone[station]))
        self._work(now, station)

    def _enqueue(self, part: int, zone: int) -> None:
        at, to = int(self.at[part]), int(self.to[part])
        known = (self.roads, self.design, self.workspace, self.rule)
        self.queue[part], self.stop[part], _ = route(*known, zone, at, to)
        self.waiting[part] = 1

    def _score(self, now: float, part: int, robot: int) -> float:
        feet = self.feet_between[self.place[robot], self.at[part]]
        feet += self.feet_between[self.at[part], self.stop[part]]
        return float(AGE * (now - self.since[part]) - DISTANCE * feet / FEET_PER_MINUTE * 60)

    def _choose(self, now: float, robot: int) -> None:
        queued = np.flatnonzero((self.waiting == 1) & (self.queue == robot)).tolist()
        if not queued:
            return
        part = max(queued, key=lambda k: (self._score(now, k, robot), -k))
        self.waiting[part], self.idle[robot] = 0, False
        empty = self.feet_between[self.place[robot], self.at[part]]
        loaded = self.feet_between[self.at[part], self.stop[part]]
        self.feet[robot] += loaded + (empty if self.trips[robot] else 0)
        self.trips[robot] += 1
        self._at(now + self._leg(empty) + self._leg(loaded), (self._set_down, robot, part))

    def _leg(self, feet: float) -> int:
        return ceil(feet / FEET_PER_MINUTE * 60 + 2.5 + self.random.uniform(0, 5))

    def _set_down(self, now: float, robot: int, part: int) -> None:
        self.place[robot] = int(self.stop[part])
        self.at[part], self.idle[robot] = self.stop[part], True
        if self.at[part] == self.to[part]:
            self.queue[part] = -1
            self._arrive(now, part)
        else:
            self._enqueue(part, robot)

    def _share(self, now: float) -> None:
        scores = np.array(
            [
                self._score(now, k, self.queue[k]) if self.waiting[k] else 0.0
                for k in range(len(ROUTES))
            ]
        )
        length = np.zeros(len(self.design.transfer), np.int32)
        share(self.design, self.queue, self.to, self.waiting, scores, self.direct, length)
        past = (self.waiting == 1) & (self.direct == 1)
        self.stop[past] = self.to[past]
        self._at(now + SHARING, (self._share,))
