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
        # The same for loads alone, by headings and by the cells that are closed.
        self._ends_of_loads: dict[tuple[int, frozenset[int]], set[int]] = {}

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

    def starts(self, r: int, target: int, loaded: bool = True) -> set[int]:
        """The cells from which robot r gets to one, if it may begin in any heading."""
        motion = self.motion
        apart, kind = motion.headings[r], motion.kind
        closed = motion.types.closed[r][loaded]
        poses = {(target, heading) for heading in range(apart)}
        left = list(poses)
        while left:
            cell, heading = left.pop()
            before: list[tuple[int, int]] = []
            if self._turns(r, cell):
                before += [(cell, (heading + 1) % apart), (cell, (heading - 1) % apart)]
            for direction in range(heading, 4, apart) if cell not in closed else ():
                at = cell - motion.step[direction]
                if motion.exits[at] >> direction & 1:
                    before.append((at, heading))
            for pose in before:
                if pose not in poses:
                    poses.add(pose)
                    if kind[pose[0]] != STORAGE or pose[0] == target:
                        left.append(pose)
        return {cell for cell, _ in poses}

    def useful(self, r: int) -> set[int]:
        """The storage cells to which robot r gets with a load from every station, and back.

        And without one from where it begins, and back, if areas are closed to robots without a load.
        """
        if r not in self._ends:
            ends = self._stored_by(r)
            empty, full = self.motion.types.closed[r]
            if empty - full:
                every, home = range(self.motion.headings[r]), self._homes[r]
                ends = ends & self.ticks(r, home, every, False).keys() & self.starts(r, home, False)
            self._ends[r] = ends
        return self._ends[r]

    def _stored_by(self, r: int) -> set[int]:
        """Where robots that drive as robot r does put their loads, whatever their homes are."""
        way = self.motion.headings[r], frozenset(self.motion.types.closed[r][True])
        if way not in self._ends_of_loads:
            ends = {cell for cell, kind in enumerate(self.motion.kind) if kind == STORAGE}
            every = range(self.motion.headings[r])
            for station in self._stations:
                ends &= self.ticks(r, station, every).keys() & self.starts(r, station)
            self._ends_of_loads[way] = ends
        return self._ends_of_loads[way]

    def nearest(self, r: int, free: dict[int, int]) -> int:
        """The free slot that robot r gets to soonest, ties the lowest; NIL: none. `free`: by cell."""
        ticks = self.ticks(r, self.motion.cell[r], (self.motion.heading[r],))
        useful = self.useful(r)
        ranks = [(ticks.get(cell, FAR), slot) for cell, slot in free.items() if cell in useful]
        return min(ranks)[1] if ranks else NIL
