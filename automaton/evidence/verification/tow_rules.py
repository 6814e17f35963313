"""Where the pod of a robot goes that is towed: its ways, worked out a second time."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence

from automaton.evidence.verification.motion_rules import Motion
from automaton.evidence.verification.type_rules import NIL
from automaton.floor.cells import CELL_KINDS, STORAGE

FAR = 1 << 60  # ticks to a cell to which no way leads


class LoadedWays:
    """Ways of robots on a floor: through storage none leads but at its ends."""

    def __init__(self, motion: Motion, stations: Sequence[int]) -> None:
        self.motion = motion
        self._stations = stations
        self._homes = list(motion.home)
        self._ends: dict[int, set[int]] = {}  # by robot: storage from which it gets everywhere

    def ticks(
        self, r: int, start: int, headings: Iterable[int], loaded: bool = True
    ) -> dict[int, int]:
        """Least ticks from a cell to all others that robot r reaches; `headings`: it begins in one."""
        motion = self.motion
        apart = motion.headings[r]
        move, turn = (motion.types.ticks[r][name][loaded] for name in ("move", "turn"))
        closed, limits = motion.types.closed[r][loaded], motion.pace.limits
        best = {(start, heading): 0 for heading in headings}
        queue = [(0, *pose) for pose in best]
        while queue:
            ticks, cell, heading = heapq.heappop(queue)
            if best[cell, heading] < ticks:
                continue
            after: list[tuple[int, int, int]] = []
            if self._turns(r, cell):
                turned = {(heading + 1) % apart, (heading - 1) % apart}
                after += [(ticks + turn, cell, to) for to in turned]
            if cell == start or motion.kind[cell] != STORAGE:
                for direction in range(heading, 4, apart):
                    to = cell + motion.step[direction]
                    if motion.exits[cell] >> direction & 1 and to not in closed:
                        least_move = max(move, limits.get((cell, direction), 0))
                        after.append((ticks + least_move, to, heading))
            for later, to, now in after:
                if later < best.get((to, now), FAR):
                    best[to, now] = later
                    heapq.heappush(queue, (later, to, now))
        least: dict[int, int] = {}
        for (cell, _), ticks in best.items():
            least[cell] = min(ticks, least.get(cell, FAR))
        return least

    def _turns(self, r: int, cell: int) -> bool:
        headings = self.motion.headings[r]
        return headings == 4 or (headings == 2 and CELL_KINDS[self.motion.kind[cell]].turns)

    def useful(self, r: int) -> set[int]:
        """The storage cells to which robot r gets with a load from every station, and back.

        And without one from where it begins, and back, if areas are closed to robots without a load.
        """
        if r not in self._ends:
            storage = {cell for cell, kind in enumerate(self.motion.kind) if kind == STORAGE}
            every = range(self.motion.headings[r])
            for station in self._stations:
                storage &= self.ticks(r, station, every).keys()
            stations = set(self._stations)
            self._ends[r] = {
                cell for cell in storage if stations <= self.ticks(r, cell, every).keys()
            }
            empty, full = self.motion.types.closed[r]
            if empty - full:
                home = self._homes[r]
                self._ends[r] &= self.ticks(r, home, every, False).keys()
                self._ends[r] = {
                    cell for cell in self._ends[r] if home in self.ticks(r, cell, every, False)
                }
        return self._ends[r]

    def nearest(self, r: int, free: dict[int, int]) -> int:
        """The free slot that robot r gets to soonest, ties the lowest; NIL: none. `free`: by cell."""
        ticks = self.ticks(r, self.motion.cell[r], (self.motion.heading[r],))
        useful = self.useful(r)
        ranks = [(ticks.get(cell, FAR), slot) for cell, slot in free.items() if cell in useful]
        return min(ranks)[1] if ranks else NIL
