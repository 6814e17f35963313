"""The occupancy rules a second time, as they are written down, in plain Python and without speed.

Executed is the greatest set of intents in which every claimant finds room: begin with all of them,
refuse the lowest-ranked excess of any cell, until nothing changes. An edge has room for robots one
way, unless both its cells let robots pass. Shares no code with the kernels.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field

MASK = 2**64 - 1


def splitmix64(value: int) -> int:
    """SplitMix64's finalizer, a bijection of the 64-bit integers."""
    value = (value ^ (value >> 30)) * 0xBF58476D1CE4E5B9 & MASK
    value = (value ^ (value >> 27)) * 0x94D049BB133111EB & MASK
    return value ^ (value >> 31)


def tie_break_hash(tick: int, identity: int) -> int:
    """What decides between robots of equal priority: the greater goes first."""
    return splitmix64(tick << 32 | identity)


@dataclass
class Robot:
    """One robot; a long move holds `cell` and `claim` until `busy` ticks are over."""

    identity: int
    cell: int
    travel: int = 0  # direction in which it came into its cell
    priority: int = 0
    claim: int | None = None
    claim_travel: int = 0
    busy: int = 0

    def holds(self) -> list[tuple[int, int]]:
        """Cells that it holds, with the direction of its lane in each."""
        held = [(self.cell, self.travel)]
        return held if self.claim is None else [*held, (self.claim, self.claim_travel)]


@dataclass(frozen=True)
class Intent:
    """A robot wants to move; `entered`: it came out of its parking bay in this tick."""

    robot: Robot
    start: int
    to: int
    direction: int
    span: int
    entered: bool = False

    def rank(self, tick: int) -> tuple[int, int]:
        return self.robot.priority, tie_break_hash(tick, self.robot.identity)


@dataclass
class Floor:
    """Exits (bit d = direction d) and capacity of each cell, and the flat offsets of directions."""

    exits: list[int]
    capacity: list[int]
    offset: tuple[int, int, int, int]
    following: str = "convoy"
    robots: dict[int, Robot] = field(default_factory=dict)
    met: int = 0  # intents refused so far for a robot that was under way on their edge

    def resource(self, cell: int, direction: int) -> Hashable:
        """What has room for one robot: a cell, a lane of it, or None where there is no limit."""
        capacity = self.capacity[cell]
        return {0: None, 1: cell, 2: (cell, direction // 2)}[capacity]

    def tick(
        self, tick: int, wants: dict[int, tuple[int, int]], entered: Iterable[int] = ()
    ) -> tuple[set[int], set[int]]:
        """Move the robots; `wants`: (direction, ticks) by identity. Returns who moved, who did not.

        Wants of busy robots, and wants against the exits of a cell, are no intents.
        """
        arriving = [robot for robot in self.robots.values() if robot.busy == 1]
        live = [
            Intent(r, r.cell, r.cell + self.offset[d], d, span, r.identity in set(entered))
            for r, (d, span) in ((self.robots[i], want) for i, want in wants.items())
            if r.busy == 0 and self.exits[r.cell] >> d & 1
        ]
        executed = self._greatest(self._without_swaps(live), arriving, tick)
        for robot in self.robots.values():
            robot.busy = max(0, robot.busy - 1)
        for robot in arriving:
            if robot.claim is not None:
                robot.cell, robot.travel, robot.claim = robot.claim, robot.claim_travel, None
        for intent in executed:
            self._carry_out(intent)
        moved = {intent.robot.identity for intent in executed}
        return moved, {intent.robot.identity for intent in live} - moved

    def _without_swaps(self, live: list[Intent]) -> list[Intent]:
        """Intents that meet nobody on their edge: nobody under way, nobody else who starts now."""
        under_way = {(robot.cell, robot.claim) for robot in self.robots.values()}
        starting = {(intent.start, intent.to) for intent in live}
        single = [i for i in live if 1 in (self.capacity[i.start], self.capacity[i.to])]
        met = [i for i in single if (i.to, i.start) in under_way]
        self.met += len(met)
        swaps = [i for i in single if (i.to, i.start) in starting]
        return [intent for intent in live if intent not in met and intent not in swaps]

    def _greatest(self, intents: list[Intent], arriving: list[Robot], tick: int) -> list[Intent]:
        remaining = sorted(intents, key=lambda intent: intent.rank(tick))
        while True:
            excess = next((i for i in remaining if not self._fits(i, remaining, arriving)), None)
            if excess is None:
                return remaining
            remaining.remove(excess)

    def _fits(self, intent: Intent, remaining: list[Intent], arriving: list[Robot]) -> bool:
        """Whether the claimants that rank at least as high find room with this one."""
        wanted = self.resource(intent.to, intent.direction)
        if wanted is None:
            return True
        held = [self.resource(*place) for r in self.robots.values() for place in r.holds()]
        room = 1 - held.count(wanted)
        if self.following != "none":
            left = [
                self.resource(robot.cell, robot.travel)
                for robot in arriving
                if robot.claim is not None
            ]
            left += [
                self.resource(other.start, other.robot.travel)
                for other in remaining
                if other.span == 1 and not other.entered
            ]
            room += left.count(wanted)
        rivals = [r for r in remaining if self.resource(r.to, r.direction) == wanted]
        better = len(rivals) - 1 - rivals.index(intent)  # `remaining` is sorted, the worst first
        return better < room

    def _carry_out(self, intent: Intent) -> None:
        robot = intent.robot
        if intent.span == 1:
            robot.cell, robot.travel = intent.to, intent.direction
        else:
            robot.claim, robot.claim_travel = intent.to, intent.direction
            robot.busy = intent.span - 1
