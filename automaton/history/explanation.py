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
    CAUSE_STANDING,
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
    Array,
)
from automaton.floor.floor_plan import FloorPlan
from automaton.history.snapshot import FleetSnapshot, Snapshot
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
    down: tuple[int, ...] = ()  # robots of the cycle that went down in it
    obstacles: tuple[str, ...] = ()  # robots that are down on a way out of the cycle, in words

    @property
    def cycle_line(self) -> str:
        """The wait cycle in words; "" without one."""
        if self.cycle == NIL:
            return ""
        members = [f"robot {link.robot}" for link in self.chain[self.cycle :]]
        text = (
            f"a wait cycle: {' -> '.join([*members, members[0]])}; none moves until one makes way"
        )
        if not self.down:
            return text
        names = " and ".join(f"robot {robot}" for robot in self.down)
        return f"{text}; {names} went down later, which keeps the cycle closed"

    @property
    def lines(self) -> list[str]:
        """The chain in words, one line for each robot; a cycle of which a robot is down comes first."""
        lines = [link.text for link in self.chain]
        if self.cycle == NIL:
            return lines
        lines = [self.cycle_line, *lines] if self.down else [*lines, self.cycle_line]
        return [*lines, *self.obstacles]


def explain(snapshot: Snapshot, floor_plan: FloorPlan, robot: int) -> Explanation:
    """Explain why a robot waits, why its blocker waits, and so on."""
    fleet = snapshot.robots
    blocker = np.where(fleet.cause == CAUSE_NOT_WAITING, NIL, fleet.blocker).astype(np.int32)
    before = np.where(held_when_down(fleet), fleet.blocker_before, blocker).astype(np.int32)
    names, cycle = walk(before, robot)
    if cycle == NIL:
        names, cycle = walk(blocker, robot)
    chain = [link_of(snapshot, floor_plan, name) for name in names]
    down = [] if cycle == NIL else [name for name in names[cycle:] if before[name] != blocker[name]]
    for place, link in enumerate(chain):
        if link.robot in down:
            other = int(before[link.robot])
            text = f"{link.text}; before, it waited for robot {other}"
            chain[place] = link._replace(blocker=other, text=text)
    members = [] if cycle == NIL else names[cycle:]
    obstacles = obstacles_of(snapshot, floor_plan, members)
    return Explanation(tuple(chain), cycle, tuple(sorted(down)), obstacles)


def obstacles_of(snapshot: Snapshot, floor_plan: FloorPlan, members: list[int]) -> tuple[str, ...]:
    """Robots that are down beside a wait cycle, on a cell that a robot of the cycle could enter."""
    fleet, exits = snapshot.robots, floor_plan.exits.ravel()
    is_down = np.isin(fleet.status, (STATUS_FAILED, STATUS_DEPLETED)) & (fleet.cell != NIL)
    is_down[members] = False
    by_cell = {int(fleet.cell[robot]): int(robot) for robot in np.flatnonzero(is_down)}
    texts: dict[int, str] = {}
    for member in members:
        cell = int(fleet.cell[member])
        for direction, beside in enumerate(floor_plan.neighbours(cell)):
            if beside in by_cell and exits[cell] >> direction & 1:
                x, y = floor_plan.xy(beside)
                text = (
                    f"{out_of_order(snapshot, by_cell[beside])}; at ({x}, {y}) it blocks a way out"
                )
                texts[by_cell[beside]] = f"{text} of the wait cycle"
    return tuple(texts[robot] for robot in sorted(texts))


def held_when_down(fleet: FleetSnapshot) -> Array:
    """(n,) bool: robots that are down, and whose blocker of before still holds the wanted cell."""
    is_down = np.isin(fleet.cause, (CAUSE_FAULT, CAUSE_NO_ENERGY)) & (fleet.blocker_before != NIL)
    other, wanted = fleet.blocker_before, fleet.wanted_before
    holds = (fleet.cell[other] == wanted) | (fleet.claim[other] == wanted)
    held: Array = is_down & (wanted != NIL) & holds
    return held


def walk(blocker: Array, robot: int) -> tuple[list[int], int]:
    """The robots from `robot` along its blockers, and the index of the first of a cycle or NIL."""
    color, index = np.zeros(len(blocker), np.int32), np.arange(len(blocker), dtype=np.int32)
    member = int(walk_to_cycle(blocker, index, color, robot))
    names = [robot]
    for _ in range(np.count_nonzero(color) - (member != NIL)):  # the last may not wait
        names.append(int(blocker[names[-1]]))
    return names, NIL if member == NIL else names.index(member)


def link_of(snapshot: Snapshot, floor_plan: FloorPlan, robot: int) -> WaitingRobot:
    fleet = snapshot.robots
    code = int(fleet.cause[robot])
    if code == CAUSE_NOT_WAITING:
        return WaitingRobot(robot, "", None, NIL, 0, f"robot {robot} {doing(snapshot, robot)}", "")
    cause, rule = CAUSES[code], CAUSES[code].rule
    if snapshot.observed and code != CAUSE_STANDING:
        rule = ""  # real robots have rules of their own
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
