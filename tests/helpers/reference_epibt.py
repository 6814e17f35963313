"""EPIBT a second time, as it is written down, in plain Python and without speed.

A strategy that a scenario can name: `reference_epibt:Reference`. It knows turning robots, goals, idle
robots and fixed ones, but no repairs and no parking bays. Paths are compared pair by pair, plans are
texts of letters, and distances are counted by Bellman and Ford. Shares no code with the kernels.
"""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

from automaton.strategy.api import CMD_GO, CMD_HOLD, GOAL_NONE, NIL, Strategy

STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
WEIGHT = {"F": 10, "R": -2, "L": -2, "W": -3}
NEVER = 10**6


def poses_of(
    operation: str, x: int = 0, y: int = 0, heading: int = 0
) -> list[tuple[int, int, int]]:
    """Where a robot is before the first action and after each."""
    poses = [(x, y, heading)]
    for letter in operation:
        if letter == "F":
            x, y = x + STEPS[heading][0], y + STEPS[heading][1]
        heading = (heading + {"R": 1, "L": 3}.get(letter, 0)) % 4
        poses.append((x, y, heading))
    return poses


def signature(operation: str) -> tuple[Any, ...]:
    """What tells classes apart: the cells, and the last heading."""
    poses = poses_of(operation)
    return tuple(pose[:2] for pose in poses), poses[-1][2]


@cache
def classes(depth: int) -> list[str]:
    """One operation of each class: the full wait, then by weight, R before L before W."""
    wait = "W" * depth
    ordered = sorted(
        ("".join(letters) for letters in itertools.product("FRLW", repeat=depth)),
        key=lambda text: sum(WEIGHT[a] * (depth - k) for k, a in enumerate(text)),
    )
    first: dict[Any, str] = {}
    for text in [wait, *(text for text in ordered if text != wait)]:
        first.setdefault(signature(text), text)
    return list(first.values())


@cache
def same_class(operation: str) -> str:
    """The operation that stands for the class of another one."""
    return next(one for one in classes(len(operation)) if signature(one) == signature(operation))


def ends_in_turn(operation: str) -> bool:
    """Whether the robot has turned since its last move, or since the start."""
    headings = [pose[2] for pose in poses_of(operation)]
    last = operation.rfind("F")
    return headings[-1] != headings[last + 1]


def cells_of(operation: str, pose: tuple[int, int, int]) -> list[tuple[int, int]]:
    return [(x, y) for x, y, _ in poses_of(operation, *pose)]


def meet(one: list[tuple[int, int]], other: list[tuple[int, int]]) -> bool:
    """Whether two paths are in one cell at one time, or exchange two cells."""
    for k in range(1, len(one)):
        if one[k] == other[k]:
            return True
        if one[k - 1] == other[k] and one[k] == other[k - 1] and one[k] != one[k - 1]:
            return True
    return False


class Reference(Strategy):
    """The plans of all robots, by identity."""

    layer = "right_of_way"
    steers = True
    period = 1
    depth, visits, oldest, shortest = 3, 10, False, False
    starved_after, drivers = NEVER, NEVER

    def reset(self, view: Any) -> Any:
        self.plan: dict[int, str] = {}
        self.expected: dict[int, tuple[int, int, int]] = {}
        self.last_goal: dict[int, int] = {}
        self.since: dict[int, int] = {}
        return super().reset(view)

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        self.view = view
        robots = view.robots
        width = int(view.grid.width)
        self.pose, self.goal = {}, {}
        for i in range(len(robots.cell)):
            y, x = divmod(int(robots.cell[i]), width)
            self.pose[int(robots.identity[i])] = (x, y, int(robots.heading[i]))
        chosen = {}
        for k in range(int(batch.count)):
            i = int(batch.robot[k])
            r, cell, goal = (int(a[i]) for a in (robots.identity, robots.cell, robots.goal_cell))
            self.note(r, goal, cell, int(view.clock.tick))
            has_goal = robots.goal_type[i] != GOAL_NONE
            if has_goal and goal == cell:
                continue
            chosen[r] = k
            if has_goal:
                self.goal[r] = divmod(goal, width)[::-1]
        self.movable = chosen
        self.inherit()
        self.choose()
        self.expected = {}
        for r, k in chosen.items():
            self.answer(r, k, decisions.right_of_way)

    def note(self, r: int, goal: int, cell: int, tick: int) -> None:
        """When it last finished a goal."""
        before = self.last_goal.get(r, NIL)
        if goal != before:
            if before in (NIL, cell):
                self.since[r] = tick
            self.last_goal[r] = goal

    def inherit(self) -> None:
        """Go on with plans; who does not makes all wait that would meet it, until none is left."""
        wait = "W" * self.depth
        plan = {}
        for r, pose in self.pose.items():
            goes_on = r in self.movable and self.expected.get(r) == pose
            plan[r] = same_class(self.plan[r][1:] + "W") if goes_on else wait
        changed = True
        while changed:
            paths = {r: cells_of(plan[r], self.pose[r]) for r in plan}
            met = [
                r
                for r in plan
                if plan[r] != wait
                and any(plan[u] == wait and meet(paths[r], paths[u]) for u in plan if u != r)
            ]
            for r in met:
                plan[r] = wait
            changed = bool(met)
        self.plan = plan

    def distance(self, r: int, pose: tuple[int, int, int]) -> int:
        """Ticks to the goal on the empty floor."""
        goal = self.goal[r]
        key = (goal, self.kind(r))
        tables = self.__dict__.setdefault("tables", {})
        if key not in tables:
            cost = {(*goal, heading): 0 for heading in range(4)}
            front = list(cost)
            while front:
                after = []
                for x, y, heading in front:
                    dx, dy = STEPS[heading]
                    before = [(x, y, (heading + 1) % 4), (x, y, (heading - 1) % 4)]
                    if self.is_open(key[1], x - dx, y - dy, heading):
                        before.append((x - dx, y - dy, heading))
                    for one in before:
                        if cost[x, y, heading] + 1 < cost.get(one, NEVER):
                            cost[one] = cost[x, y, heading] + 1
                            after.append(one)
                front = after
            tables[key] = cost
        return int(tables[key].get(pose, NEVER))

    def kind(self, r: int) -> int:
        return int(self.view.robots.type[self.view.robots.at_index[r]])

    def is_open(self, kind: int, x: int, y: int, direction: int) -> bool:
        cell = y * int(self.view.grid.width) + x
        flags = self.view.grid.type_cell_flags[kind]
        return 0 <= cell < len(flags) and bool(int(flags[cell]) >> direction & 1)

    def candidates(self, r: int) -> list[str]:
        """The operations that the exits allow, best first."""
        costs = {}
        known = classes(self.depth)
        for text in known[1:]:
            if ends_in_turn(text):
                continue
            poses = poses_of(text, *self.pose[r])
            moves = [pose for pose, letter in zip(poses, text, strict=False) if letter == "F"]
            if all(self.is_open(self.kind(r), *pose) for pose in moves):
                costs[text] = self.cost(r, text, poses, known)
        return sorted(costs, key=lambda text: costs[text])

    def cost(
        self, r: int, text: str, poses: list[tuple[int, int, int]], known: list[str]
    ) -> tuple[int, int]:
        if r not in self.goal or self.distance(r, self.pose[r]) >= NEVER:
            return 0, known.index(text)
        cells = [pose[:2] for pose in poses[1:]]
        if self.goal[r] in cells:
            return cells.index(self.goal[r]) - self.depth, -known.index(text)
        return self.distance(r, poses[-1]), -known.index(text)

    def turn_of(self, r: int) -> int:
        """Whose turn is first: the lower number."""
        if r not in self.goal or self.distance(r, self.pose[r]) >= NEVER:
            return NEVER
        if self.oldest:
            return self.since[r]
        if int(self.view.clock.tick) - self.since[r] >= self.starved_after:
            return self.since[r] - NEVER
        return self.distance(r, self.pose[r]) + self.way_after_goal(r)

    def way_after_goal(self, r: int) -> int:
        """Ticks from stop to stop of its order after its goal."""
        orders, goal = self.view.orders, self.goal[r]
        order = int(self.view.robots.order[self.view.robots.at_index[r]])
        if not self.shortest or order == NIL:
            return 0
        first = orders.first_stop[order] + orders.stops_done[order]
        cells = self.view.stops.cell[first : orders.first_stop[order + 1]]
        stops = [divmod(int(cell), int(self.view.grid.width))[::-1] for cell in cells]
        way = 0
        for here, there in itertools.pairwise(stops):
            self.goal[r] = there
            way += min(self.distance(r, (*here, heading)) for heading in range(4))
        self.goal[r] = goal
        return way

    def choose(self) -> None:
        self.visited = dict.fromkeys(self.movable, 0)
        self.settled: set[int] = set()
        self.turn = {r: self.turn_of(r) for r in self.movable}
        in_turn = sorted(self.turn, key=lambda r: (self.turn[r], r))
        if self.oldest or self.starved_after < NEVER:
            places = {r: place for place, r in enumerate(in_turn)}
            self.turn |= {r: places[r] for r in in_turn if self.turn[r] < NEVER}
        self.turn |= dict.fromkeys(in_turn[self.drivers :], NEVER)
        self.wishes = {r: self.candidates(r) for r in self.movable}
        for r in sorted(self.movable, key=lambda r: (self.turn[r], r)):
            if not self.visited[r] and self.turn[r] < NEVER:
                self.build(r, r, {u for u in self.plan if u != r})

    def build(self, root: int, r: int, on_floor: set[int]) -> bool:
        """One link of a chain: `on_floor` are those whose paths are entered now."""
        old = self.plan[r]
        self.visited[r] += 1
        self.settled.add(r)
        for text in self.wishes[r]:
            path = cells_of(text, self.pose[r])
            met = [u for u in on_floor if meet(path, cells_of(self.plan[u], self.pose[u]))]
            if len(met) > 1:
                continue
            self.plan[r] = text
            if not met:
                return True
            if self.may_push(root, met[0]) and self.build(root, met[0], on_floor - {met[0]} | {r}):
                return True
        self.plan[r] = old
        self.settled.discard(r)
        return False

    def may_push(self, root: int, u: int) -> bool:
        if u not in self.movable or u in self.settled or self.visited[u] >= self.visits:
            return False
        return self.turn[u] > self.turn[root]

    def answer(self, r: int, k: int, out: Any) -> None:
        """The first action; a turn is towards the direction of the first move."""
        poses = poses_of(self.plan[r], *self.pose[r])
        self.expected[r] = poses[1]
        wish = self.plan[r]
        if wish[0] == "W" and self.wishes[r]:
            wish = self.wishes[r][0]
        moves = [
            pose[2]
            for pose, a in zip(poses_of(wish, *self.pose[r]), wish, strict=False)
            if a == "F"
        ]
        out.value[k] = moves[0] if moves else NIL
        if self.plan[r][0] != "W":
            out.command[k] = CMD_GO
        elif self.view.robots.goal_type[self.view.robots.at_index[r]] != GOAL_NONE:
            out.command[k] = CMD_HOLD


class Deeper(Reference):
    """Plans of four actions; the oldest come first."""

    depth, oldest = 4, True


class Crowded(Reference):
    """Five robots drive: starved ones, then those with the shortest way to the end of their orders."""

    shortest, starved_after, drivers = True, 20, 5
