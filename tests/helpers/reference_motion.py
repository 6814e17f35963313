"""The occupancy rules a second time, as they are written down, in plain Python and without speed.

Executed is the greatest set of intents in which every claimant finds room: begin with all of them,
refuse the lowest-ranked excess of any cell, until nothing changes. An edge has room for robots one
way, unless both its cells let robots pass. What a robot gives up depends on the rule of following:

    none      its cell when its move is over, for the tick after
    handover  its cell in the last tick of its move
    convoy    its cell when its move begins; whoever follows arrives no sooner than it has left

Shares no code with the kernels.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
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


Place = tuple[int, int]  # a cell, and the direction in which a robot came or comes into it


@dataclass
class Robot:
    """One robot; a long move leads from `cell` to `claim` until `busy` ticks are over.

    One that turns in an aisle for two claims the other lane of its cell.
    """

    identity: int
    cell: int
    travel: int = 0  # direction in which it came into its cell
    priority: int = 0
    claim: int | None = None
    claim_travel: int = 0
    busy: int = 0
    lost: int = 0  # ticks that its moves took longer than its own, behind other robots

    @property
    def is_under_way(self) -> bool:
        """Whether it is between two cells."""
        return self.claim not in (None, self.cell)


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

    def holds(self, robot: Robot) -> list[Place]:
        """The places that are not open because of a robot."""
        if robot.claim is None:
            return [(robot.cell, robot.travel)]
        ahead = (robot.claim, robot.claim_travel)
        if self.following == "convoy" and robot.is_under_way:
            return [ahead]
        return [(robot.cell, robot.travel), ahead]

    def is_empty(self, cell: int, direction: int) -> bool:
        """Whether nobody is in a place, on its way into it, or on its way out of it."""
        taken = {
            self.resource(*place)
            for r in self.robots.values()
            for place in [*self.holds(r), (r.cell, r.travel)]
        }
        return self.resource(cell, direction) not in taken - {None}

    def come_out(self, robot: Robot) -> bool:
        """Put a robot that leaves its parking bay into its cell if nobody is there."""
        is_empty = self.is_empty(robot.cell, robot.travel)
        if is_empty:
            self.robots[robot.identity] = robot
        return is_empty

    def turn(self, identity: int, ticks: int) -> bool:
        """Let a robot turn for so many ticks: in an aisle for two if nobody is in the other lane.

        Call before the `tick` in which the turn begins.
        """
        robot = self.robots[identity]
        if self.capacity[robot.cell] == 2:
            if not self.is_empty(robot.cell, robot.travel ^ 2):
                return False
            robot.claim, robot.claim_travel = robot.cell, robot.travel ^ 2
        robot.busy = ticks
        return True

    def delay(self, delays: Mapping[int, int]) -> None:
        """Put off the ends of moves and turns by so many ticks, then those of the moves behind.

        Call before the `tick` in which the delays begin. A robot that stands is not concerned.
        """
        for identity, ticks in delays.items():
            if self.robots[identity].busy:
                self.robots[identity].busy += ticks
        moving = [robot for robot in self.robots.values() if robot.is_under_way]
        ends = {robot.identity: robot.busy for robot in moving}
        leaves = {r.identity: self.resource(r.cell, r.travel) for r in moving}
        enters = {r.identity: self.resource(r.claim or 0, r.claim_travel) for r in moving}
        hand_on(ends, leaves, enters)
        for robot in moving:
            robot.lost += ends[robot.identity] - robot.busy
            robot.busy = ends[robot.identity]

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
        lengths = self._lengths(executed)
        for robot in self.robots.values():
            robot.busy = max(0, robot.busy - 1)
        for robot in arriving:
            if robot.claim is not None and robot.is_under_way:
                robot.cell, robot.travel = robot.claim, robot.claim_travel
            robot.claim = None
        for intent in executed:
            self._carry_out(intent, lengths[intent.robot.identity])
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
        held = [self.resource(*place) for r in self.robots.values() for place in self.holds(r)]
        given_up = [place for robot in arriving for place in self._gives_up(robot)]
        given_up += [(i.start, i.robot.travel) for i in remaining if self._follows_at_once(i)]
        left = [self.resource(*place) for place in given_up]
        rivals = [r for r in remaining if self.resource(r.to, r.direction) == wanted]
        better = len(rivals) - 1 - rivals.index(intent)  # `remaining` is sorted, the worst first
        return better < 1 - held.count(wanted) + left.count(wanted)

    def _gives_up(self, arriving: Robot) -> list[Place]:
        """What a robot gives up in its last tick: under convoy a move has given it up before."""
        if self.following == "none" or arriving.claim is None:
            return []
        if not arriving.is_under_way:
            return [(arriving.cell, arriving.travel ^ 2)]
        return [(arriving.cell, arriving.travel)] if self.following == "handover" else []

    def _follows_at_once(self, ahead: Intent) -> bool:
        """Whether a robot may follow one in the tick in which that one begins to move."""
        if ahead.entered or self.following == "none":
            return False
        return self.following == "convoy" or ahead.span == 1

    def _lengths(self, executed: list[Intent]) -> dict[int, int]:
        """The ticks of moves that begin: their own, or those that the one ahead still takes."""
        moving = [robot for robot in self.robots.values() if robot.is_under_way]
        ends = {robot.identity: robot.busy for robot in moving}
        leaves = {r.identity: self.resource(r.cell, r.travel) for r in moving}
        enters: dict[int, Hashable] = {}
        for intent in executed:
            ends[intent.robot.identity] = intent.span
            leaves[intent.robot.identity] = self.resource(intent.start, intent.robot.travel)
            enters[intent.robot.identity] = self.resource(intent.to, intent.direction)
        hand_on(ends, leaves, enters)
        return ends

    def _carry_out(self, intent: Intent, ticks: int) -> None:
        robot = intent.robot
        robot.lost += ticks - intent.span
        if ticks == 1:
            robot.cell, robot.travel = intent.to, intent.direction
        else:
            robot.claim, robot.claim_travel = intent.to, intent.direction
            robot.busy = ticks - 1


def hand_on(
    ends: dict[int, int], leaves: Mapping[int, Hashable], enters: Mapping[int, Hashable]
) -> None:
    """Let nobody arrive sooner than the robot that leaves its place, along files and round rings.

    `ends`: ticks that moves still take, by identity; modified. What has no limit is None.
    """
    ahead = {
        robot: other
        for robot, place in enters.items()
        for other, left in leaves.items()
        if place is not None and place == left
    }
    while late := [robot for robot, other in ahead.items() if ends[robot] < ends[other]]:
        for robot in late:
            ends[robot] = max(ends[robot], ends[ahead[robot]])
