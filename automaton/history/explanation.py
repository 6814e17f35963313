"""Why a robot waits: its blocker, the reason, and the chain of blockers to the root cause."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from automaton.engine.blockers import walk_to_cycle
from automaton.engine.observation import (
    CAUSE_CHARGER_QUEUE,
    CAUSE_DELAYED,
    CAUSE_DRIVING_AHEAD,
    CAUSE_FAULT,
    CAUSE_ILLEGAL_DECISION,
    CAUSE_NO_ENERGY,
    CAUSE_NO_ORDER,
    CAUSE_NOT_WAITING,
    CAUSE_STATION_BREAK,
    CAUSE_STATION_QUEUE,
    CAUSES,
    waited_ticks,
)
from automaton.engine.state import (
    BATTERY_FULL,
    NIL,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_REMOVED,
    STATUS_TOWED,
)
from automaton.floor.floor_plan import FloorPlan
from automaton.history.snapshot import Snapshot
from automaton.history.state_words import (
    break_words,
    carries_pods,
    gate_words,
    is_kept_by_gate,
    load_words,
    no_place_words,
    queue_words,
    queueing_words,
    station_name,
    station_of,
    up_to,
)
from automaton.units import count, percent
from automaton.vocabulary import RobotState, phrase_of, robot_state

FOLLOWING_RULE: Final = "following: no robot arrives before the one ahead has left"


class WaitingRobot(NamedTuple):
    """One robot of the chain."""

    robot: int
    cause: str  # name of the cause; "" for the last robot, which does not wait
    cell: tuple[int, int] | None  # (x, y) of the cell it waits for
    blocker: int  # or NIL
    ticks: int  # length of the wait so far
    text: str
    rule: str  # the rule that causes the wait; "" if none does


class Explanation(NamedTuple):
    """A chain of waiting robots; if `cycle` is set, the last robot waits for the one at this index."""

    chain: tuple[WaitingRobot, ...]
    cycle: int  # or NIL

    @property
    def lines(self) -> list[str]:
        """The chain in words, one line for each robot."""
        lines = [link.text for link in self.chain]
        if self.cycle != NIL:
            members = [f"robot {link.robot}" for link in self.chain[self.cycle :]]
            cycle = " -> ".join([*members, members[0]])
            lines.append(f"a wait cycle: {cycle}; none of them can go first")
        return lines


def explain(snapshot: Snapshot, floor_plan: FloorPlan, robot: int) -> Explanation:
    """Explain why a robot waits, why its blocker waits, and so on."""
    fleet = snapshot.robots
    blocker = np.where(fleet.cause == CAUSE_NOT_WAITING, NIL, fleet.blocker).astype(np.int32)
    color, index = np.zeros(len(blocker), np.int32), np.arange(len(blocker), dtype=np.int32)
    member = int(walk_to_cycle(blocker, index, color, robot))
    chain: list[WaitingRobot] = []
    for _ in range(np.count_nonzero(color) + (member == NIL)):  # the last may not wait
        chain.append(link_of(snapshot, floor_plan, robot))
        robot = chain[-1].blocker
    names = [link.robot for link in chain]
    return Explanation(tuple(chain), NIL if member == NIL else names.index(member))


def link_of(snapshot: Snapshot, floor_plan: FloorPlan, robot: int) -> WaitingRobot:
    fleet = snapshot.robots
    code = int(fleet.cause[robot])
    if code == CAUSE_NOT_WAITING:
        return WaitingRobot(robot, "", None, NIL, 0, f"robot {robot} {doing(snapshot, robot)}", "")
    cause, rule = CAUSES[code], CAUSES[code].rule
    blocker, wanted = int(fleet.blocker[robot]), int(fleet.wanted[robot])
    cell = None if wanted == NIL else floor_plan.xy(wanted)
    because = cause.text.format(
        robot=f"robot {robot}",
        blocker="no robot" if blocker == NIL else f"robot {blocker}",
        cell="its next cell" if cell is None else f"({cell[0]}, {cell[1]})",
    )
    if code == CAUSE_DRIVING_AHEAD and wanted == fleet.claim[robot] and cell is not None:
        because = (
            f"it drives on behind robot {blocker}, which is still leaving ({cell[0]}, {cell[1]})"
        )
        rule = FOLLOWING_RULE
    elif code == CAUSE_CHARGER_QUEUE and cell is not None:
        because = queueing_words(snapshot, robot, f"({cell[0]}, {cell[1]})")
    elif code == CAUSE_DELAYED:
        last = int(snapshot.delayed_until[robot]) if len(snapshot.delayed_until) else NIL
        because += f" up to tick {last:,}" if last > snapshot.tick else ""
    elif code in (CAUSE_NO_ENERGY, CAUSE_FAULT):
        because = out_of_order(snapshot, robot)
    elif code == CAUSE_ILLEGAL_DECISION and robot in snapshot.illegal:
        because = f"illegal decision of {snapshot.illegal[robot]}"
    elif is_kept_by_gate(code):
        because = gate_words(snapshot, robot) or because
    elif code == CAUSE_STATION_QUEUE and station_of(snapshot, robot) != NIL:
        because = queue_words(snapshot, robot)
    elif code == CAUSE_STATION_BREAK and station_of(snapshot, robot) != NIL:
        because = break_words(snapshot, robot)
    elif code == CAUSE_NO_ORDER and (full := no_place_words(snapshot, robot)):
        because = f"{because}: {full}"
    ticks = int(waited_ticks(fleet.cause[robot], fleet.since[robot], snapshot.tick))
    since = f"has been {phrase_of(robot_state(fleet, robot))} for {count(ticks, 'tick')}"
    return WaitingRobot(
        robot, cause.name, cell, blocker, ticks, f"robot {robot} {since}: {because}", rule
    )


def out_of_order(snapshot: Snapshot, robot: int) -> str:
    """The condition of a robot that is down, and what happens next; "" for other robots."""
    fleet = snapshot.robots
    status = int(fleet.status[robot])
    status_until = int(fleet.status_until[robot])
    left = count(status_until - snapshot.tick, "tick")
    towing = "it is not towed" if status_until == NIL else f"it is towed in {left}"
    if status == STATUS_DEPLETED:
        charge = percent(float(fleet.charge[robot]) / BATTERY_FULL)
        takes = "less than its next operation needs"
        return f"the battery of robot {robot} holds {charge}, {takes}; {towing}"
    if status == STATUS_FAILED and snapshot.repairs_in_place:
        return f"robot {robot} has broken down; it continues in {left}"
    if status == STATUS_FAILED:
        return f"robot {robot} has broken down; {towing}"
    if status == STATUS_TOWED:
        return f"robot {robot} was towed; it is back in {left}"
    return f"robot {robot} is gone: it was towed for good" if status == STATUS_REMOVED else ""


def doing(snapshot: Snapshot, robot: int) -> str:
    """What a robot that does not wait is doing, in words."""
    fleet = snapshot.robots
    if fleet.status[robot] in (STATUS_TOWED, STATUS_REMOVED):
        return out_of_order(snapshot, robot).removeprefix(f"robot {robot} ")
    state = robot_state(fleet, robot)
    if state == RobotState.PARKED:
        full = "" if fleet.order[robot] != NIL else no_place_words(snapshot, robot)
        return f"is parked: {full}" if full else "is parked"
    text, busy = f"is {_at_work(snapshot, robot, state)}", int(fleet.busy[robot])
    slowed = fleet.slow_zone[robot] != NIL
    if slowed:
        text += " slowly"
    if busy and state != RobotState.CHARGING:
        text += f" for {count(busy, 'more tick')}"
    if slowed:
        held = f"zone {fleet.slow_zone[robot]} held {fleet.slow_zone_occupancy[robot]} robots"
        text += f": {held} when this move began"
    return text


def _at_work(snapshot: Snapshot, robot: int, state: RobotState) -> str:
    """The phrase of a robot's state, with its load or station."""
    phrase, load = phrase_of(state), int(snapshot.robots.load[robot])
    if state == RobotState.CHARGING:
        return f"{phrase} {up_to(snapshot, robot)}"
    if state == RobotState.PICKING and load != NIL:
        return f"{phrase} {load_words(snapshot, load)}"
    if state in (RobotState.DROPPING, RobotState.TRYING):
        return f"{phrase} its {'pod' if carries_pods(snapshot) else 'load'}"
    if state == RobotState.AT_STOP and (station := station_of(snapshot, robot)) != NIL:
        return f"{phrase} at {station_name(snapshot, station)}"
    return phrase
