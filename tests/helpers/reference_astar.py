"""A* once more in plain Python: one heap over everything, with the tie rules written out."""

from __future__ import annotations

import heapq
from collections.abc import Collection

from reference_paths import FAR, Pose, Ways

from automaton.floor.floor_plan import EAST, NORTH, SOUTH, WEST

ORDER = (NORTH, SOUTH, EAST, WEST)


def path(
    ways: Ways, start: Pose, target: int, ties: str, closed: Collection[tuple[int, int]] = ()
) -> tuple[int, list[int]] | None:
    """(ticks, directions) of the path that A* finds first, None if there is none.

    `closed`: (cell, direction) pairs that may not be entered so.
    """
    goal_x, goal_y = ways.floor_plan.xy(target)

    def estimate(pose: Pose) -> int:
        x, y = ways.floor_plan.xy(pose[0])
        return ways.move * (abs(x - goal_x) + abs(y - goal_y))

    best: dict[Pose, int] = {start: 0}
    came: dict[Pose, tuple[Pose, int | None]] = {}
    found = 0

    def key(pose: Pose) -> tuple[int, ...]:
        h = estimate(pose)
        return (best[pose] + h, h, found) if ties == "larger_g" else (best[pose] + h, found)

    heap = [(key(start), start, 0)]
    while heap:
        _, pose, g = heapq.heappop(heap)
        if g > best[pose]:
            continue
        if pose[0] == target:
            return g, directions(came, start, pose)
        for way, after, ticks in neighbours(ways, pose):
            if way is not None and (after[0], way) in closed:
                continue
            if g + ticks < best.get(after, FAR):
                found += 1
                best[after] = g + ticks
                came[after] = (pose, way)
                heapq.heappush(heap, (key(after), after, g + ticks))
    return None


def neighbours(ways: Ways, pose: Pose) -> list[tuple[int | None, Pose, int]]:
    """(direction or None for a turn, pose, ticks), in the order in which A* finds them."""
    steps = list(ways.steps(pose))
    moves: list[tuple[int | None, Pose, int]] = []
    for way in ORDER:
        after = ways.floor_plan.neighbours(pose[0])[way]
        moves += [
            (way, to, ticks)
            for to, ticks in steps
            if to[0] == after and way % ways.headings == to[1]
        ]
    ahead = (pose[1] + 1) % ways.headings
    turns = [(to, ticks) for to, ticks in steps if to[0] == pose[0]]
    turns.sort(key=lambda turn: turn[0][1] != ahead)
    return moves + [(None, to, ticks) for to, ticks in turns]


def directions(came: dict[Pose, tuple[Pose, int | None]], start: Pose, pose: Pose) -> list[int]:
    """The moves of the path to a pose."""
    route = []
    while pose != start:
        pose, way = came[pose]
        if way is not None:
            route.append(way)
    return route[::-1]
