"""Shortest paths once more in plain Python: Bellman-Ford over poses (cell, heading) of a floor.

Written from the rules, without the kernels: a robot moves along its heading (rail: both ways along
its axis; omni: any way) through the exits of its cell, and turns by 90 degrees where it may.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

from automaton.floor.floor_plan import CELL_KINDS, FloorPlan

HEADINGS = {"omni": 1, "rail": 2, "differential": 4}
FAR = 1 << 30

Pose = tuple[int, int]


class Ways(NamedTuple):
    """A floor as robots of some kinematics drive it, with the ticks of a move and of a turn."""

    floor_plan: FloorPlan
    kinematics: str
    move: int
    turn: int

    @property
    def headings(self) -> int:
        return HEADINGS[self.kinematics]

    def cells(self) -> list[int]:
        kinds = self.floor_plan.kind.ravel().tolist()
        return [cell for cell, kind in enumerate(kinds) if CELL_KINDS[kind].drivable]

    def steps(self, pose: Pose, closed: Collection[int] = ()) -> Iterator[tuple[Pose, int]]:
        """The poses next to a pose, with what each costs; cells in `closed` are not entered."""
        cell, heading = pose
        exits, n = int(self.floor_plan.exits.flat[cell]), self.headings
        for direction, after in enumerate(self.floor_plan.neighbours(cell)):
            if exits >> direction & 1 and direction % n == heading and after not in closed:
                yield (after, heading), self.move
        rail = self.kinematics == "rail"
        if n > 1 and (not rail or CELL_KINDS[self.floor_plan.kind.flat[cell]].turns):
            for turned in {(heading + 1) % n, (heading - 1) % n}:
                yield (cell, turned), self.turn

    def costs(self, start: Pose, closed: Collection[int] = ()) -> dict[Pose, int]:
        """Least ticks from a pose to every pose that can be reached, by Bellman and Ford."""
        cost = {start: 0}
        front = [start]
        while front:
            changed = []
            for pose in front:
                for after, ticks in self.steps(pose, closed):
                    if cost[pose] + ticks < cost.get(after, FAR):
                        cost[after] = cost[pose] + ticks
                        changed.append(after)
            front = changed
        return cost

    def cost_to(self, start: Pose, target: int, closed: Collection[int] = ()) -> int:
        """Least ticks from a pose to a cell in any heading, or FAR."""
        cost = self.costs(start, closed)
        return min(cost.get((target, heading), FAR) for heading in range(self.headings))

    def driven(
        self, start: Pose, route: list[int], closed: Collection[int] = ()
    ) -> tuple[int, int]:
        """(ticks, last cell) of driving these directions, turning as seldom as possible.

        Raises AssertionError for a step that no robot can make.
        """
        (cell, heading), ticks = start, 0
        for direction in route:
            wanted = direction % self.headings
            quarters = min((wanted - heading) % self.headings, (heading - wanted) % self.headings)
            if quarters:
                assert (
                    self.kinematics != "rail" or CELL_KINDS[self.floor_plan.kind.flat[cell]].turns
                )
            assert int(self.floor_plan.exits.flat[cell]) >> direction & 1
            cell, heading = self.floor_plan.neighbours(cell)[direction], wanted
            assert cell not in closed
            ticks += quarters * self.turn + self.move
        return ticks, cell
