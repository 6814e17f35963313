"""What it costs to drive to a cell, once more in plain Python: Dijkstra with a heap, over poses.

Written from the rules, without the kernels: a robot leaves a cell in the direction of its heading (rail:
both ways along its axis; omni: any way) by one of its exits, and turns by 90 degrees where it may.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from typing import NamedTuple

from reference_paths import FAR, HEADINGS, Pose

from automaton.floor.floor_plan import CELL_KINDS, FloorPlan


class CostSet(NamedTuple):
    """A floor as some robots may drive on it, and what they pay."""

    floor_plan: FloorPlan
    kinematics: str
    step: int | Mapping[tuple[int, int], int]  # for all; or from a cell in a direction
    turn: int

    def step_cost(self, cell: int, direction: int) -> int:
        return self.step if isinstance(self.step, int) else self.step[cell, direction]

    def may_turn(self, cell: int) -> bool:
        kind = CELL_KINDS[self.floor_plan.kind.flat[cell]]
        return self.kinematics != "omni" and (self.kinematics != "rail" or kind.turns)

    def ways_in(self, cell: int) -> list[tuple[int, int]]:
        """Cells from which one step leads to a cell, and its direction."""
        steps = enumerate(self.floor_plan.offsets)
        return [
            (cell - offset, direction)
            for direction, offset in steps
            if 0 <= cell - offset < self.floor_plan.kind.size
            and int(self.floor_plan.exits.flat[cell - offset]) >> direction & 1
        ]

    def costs_to(self, goal: int) -> dict[Pose, int]:
        """The least cost from every pose from which there is a way to the goal, in any heading."""
        headings = HEADINGS[self.kinematics]
        costs: dict[Pose, int] = {}
        front = [(0, (goal, heading)) for heading in range(headings)]
        while front:
            cost, pose = heapq.heappop(front)
            if costs.setdefault(pose, cost) != cost:
                continue
            cell, heading = pose
            for before, direction in self.ways_in(cell):
                if direction % headings == heading and (before, heading) not in costs:
                    more = self.step_cost(before, direction)
                    heapq.heappush(front, (cost + more, (before, heading)))
            if self.may_turn(cell):
                for turned in ((heading + 1) % headings, (heading - 1) % headings):
                    if (cell, turned) not in costs:
                        heapq.heappush(front, (cost + self.turn, (cell, turned)))
        return costs

    def cost(self, pose: Pose, goal: int) -> int:
        return self.costs_to(goal).get(pose, FAR)
