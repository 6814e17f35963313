"""Why is this robot waiting? The chain of causes, from one robot to the one that ends it."""

from __future__ import annotations

from typing import NamedTuple

from automaton.history.snapshot import Snapshot
from automaton.world.plan import FloorPlan
from automaton.world.state import ACTION_NAMES, NIL
from automaton.world.waiting import CAUSES, NOT_WAITING


class Link(NamedTuple):
    """One robot of the chain."""

    robot: int
    cause: str  # name of the cause; "" for the last one, which does not wait
    cell: tuple[int, int] | None  # the cell it waits for, as a user counts
    blocker: int  # or NIL
    ticks: int  # since when it waits
    text: str
    rule: str  # the rule behind it; "" if there is none


class Explanation(NamedTuple):
    """The chain; with `cycle`, its last robot waits for the one at index `cycle` of the chain."""

    chain: tuple[Link, ...]
    cycle: int  # or NIL

    @property
    def lines(self) -> list[str]:
        """The chain in words, one line for each robot."""
        lines = [link.text for link in self.chain]
        if self.cycle != NIL:
            members = [f"robot {link.robot}" for link in self.chain[self.cycle :]]
            circle = " -> ".join([*members, members[0]])
            lines.append(f"a circle: {circle}; none of them can go first")
        return lines


def explain(snapshot: Snapshot, plan: FloorPlan, robot: int) -> Explanation:
    """Why a robot waits, what keeps the one that keeps it, and so on."""
    chain: list[Link] = []
    seen: dict[int, int] = {}
    while robot != NIL and robot not in seen:
        seen[robot] = len(chain)
        chain.append(_link(snapshot, plan, robot))
        robot = chain[-1].blocker
    return Explanation(tuple(chain), NIL if robot == NIL else seen[robot])


def _link(snapshot: Snapshot, plan: FloorPlan, robot: int) -> Link:
    fleet = snapshot.robots
    code = int(fleet.cause[robot])
    if code == NOT_WAITING:
        return Link(robot, "", None, NIL, 0, f"robot {robot} {doing(snapshot, robot)}", "")
    cause = CAUSES[code]
    blocker, wanted = int(fleet.blocker[robot]), int(fleet.wanted[robot])
    cell = None if wanted == NIL else plan.xy(wanted)
    because = cause.text.format(
        robot=f"robot {robot}",
        blocker="nobody" if blocker == NIL else f"robot {blocker}",
        cell="its next cell" if cell is None else f"({cell[0]}, {cell[1]})",
    )
    ticks = snapshot.tick - int(fleet.since[robot])
    since = f"has waited {ticks:,} tick{'s' if ticks != 1 else ''}"
    return Link(
        robot, cause.name, cell, blocker, ticks, f"robot {robot} {since}: {because}", cause.rule
    )


def doing(snapshot: Snapshot, robot: int) -> str:
    """What a robot that does not wait does, in words."""
    fleet = snapshot.robots
    if fleet.parked[robot]:
        return "is parked"
    action, busy = ACTION_NAMES[fleet.action[robot]], int(fleet.busy[robot])
    texts = {
        "move": "drives",
        "turn": "turns",
        "pick": f"picks up load {fleet.load[robot]}",
        "drop": "sets its load down",
        "try_drop": "tries to set its load down",
        "charge": "charges",
    }
    text = texts.get(action, "is about to go on")
    slowed = fleet.slow_zone[robot] != NIL
    if slowed:
        text += " slowly"
    if busy:
        text += f" for {busy} more tick{'s' if busy != 1 else ''}"
    if slowed:
        held = f"zone {fleet.slow_zone[robot]} held {fleet.crowd[robot]} robots"
        text += f": {held} when this move began"
    return text
