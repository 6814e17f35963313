"""The rules of motion, checked on committed actions, independent of the kernels.

A *resource* is a cell of capacity 1, or one lane of a cell of capacity 2 (east and south share lane
0, west and north lane 1). A resource has one holder; a cell without limit has no resources. A robot
on its way out holds its resource up to the last tick of its move; under convoy, only until the move
begins: then the follower holds it, and arrives no sooner than the robot ahead has left. Phases of a
tick: parking bays open, operations begin, all moves happen at once, robots at home park. Robots
that leave the floor when idle are at home wherever they stand. The last parts of this module check
the rows of changes, and due times.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_DELAYED,
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_LOAD_LEFT,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_SLOT_RESERVED,
    CHANGE_STATUS,
    CHANGE_VISITED,
    CHANGE_ZONE,
    DROPPED_ON_ARRIVAL,
    ENTERED_PARKING_BAY,
    EXECUTED_BAY_BLOCKED,
    EXECUTED_DROP,
    EXECUTED_ILLEGAL,
    EXECUTED_PICK,
    EXECUTED_TRY_DROP,
    LEFT_PARKING_BAY,
    MOVE_NORTH,
    PICKED_ON_ARRIVAL,
    TURN_LEFT,
    TURN_RIGHT,
)
from automaton.floor.floor_plan import CELL_KINDS, EAST, NORTH, SOUTH, WEST
from automaton.verification.move_time_rules import NIL, MoveTimes, Types

HANDLING: Final = {
    EXECUTED_PICK: "pick",
    EXECUTED_DROP: "drop",
    EXECUTED_TRY_DROP: "try_drop",
}  # usual duration by code of recorded action

Acts = list[tuple[int, int]]  # (robot, recorded action), robots ascending
Complaint = Callable[..., None]  # (rule, robots, cell, text)
Mover = tuple[int, int, int, int]  # robot, from, to, direction


class ReplayedMotion:
    """Positions of all robots, replayed from the header and the committed actions."""

    def __init__(self, header: dict[str, Any], report_violation: Complaint) -> None:
        floor, scenario, robots = header["floor"], header["scenario"], header["robots"]
        stride = floor["width"] + 2
        self.report_violation = report_violation
        self.step = (1, stride, -1, -stride)
        self.exits: list[int] = floor["exits"].ravel().tolist()
        self.capacity: list[int] = floor["capacity"].ravel().tolist()
        self.kind: list[int] = floor["kind"].ravel().tolist()
        self.types = Types(floor, scenario)
        self.headings = self.types.headings
        self.pace = MoveTimes(floor, header["seed"], self.types)
        self.holder: dict[int, int] = {}  # resource -> robot
        self.leaver: dict[int, int] = {}  # resource -> robot with a long move out of it
        self.apply_rules(scenario)
        self.leave: bool = scenario["fleet"].get("when_idle") == "leave"
        self.home: list[int] = robots["home"].tolist()
        self.bay: list[int] = robots["bay"].tolist()
        self.cell: list[int] = robots["cell"].tolist()  # NIL in its parking bay
        self.heading: list[int] = robots["heading"].tolist()
        self.travel = list(self.heading)  # direction in which it entered its cell
        self.free = [1] * len(self.home)  # first tick in which it may begin an operation
        self.begun = [0] * len(self.home)  # last recorded action of each robot
        self.parked = [True] * len(self.home)
        # parked on the floor, or about to leave: actions do not tell
        self.unsure: set[int] = set()
        self.claim: dict[int, tuple[int, int]] = {}  # long moves: robot -> (to, direction)
        # (from, to) -> the robot that last drove there, and the tick of its arrival
        self._drive: dict[tuple[int, int], tuple[int, int]] = {}
        self._arrivals: dict[int, list[int]] = {}  # tick -> robots whose long move ends in it
        self._turned: dict[int, list[int]] = {}  # tick -> robots that release their second lane
        self.arrived: set[int] = set()  # robots whose move ended in this tick
        self._check_start(floor["bays"].tolist())

    def apply_rules(self, scenario: dict[str, Any]) -> None:
        """Apply the rules of a scenario for motion."""
        self.following: str = scenario["world"]["following"]
        self.given: dict[str, Any] = scenario["durations"]
        self.types.apply_rules(scenario)
        self.pace.apply_rules(scenario)
        for resource, r in self.leaver.items():  # robots on their way out, by the current rule
            if self.following != "convoy":
                self.holder.setdefault(resource, r)
            elif self.holder.get(resource) == r:
                del self.holder[resource]

    def _check_start(self, bays: list[list[int]]) -> None:
        used = [bay for bay in self.bay if bay != NIL]
        known = {(bay, home) for bay, home in bays}
        if len(set(used)) != len(used):
            self.report_violation("bay", [], NIL, "two robots have the same parking bay")
        for r, cell in enumerate(self.cell):
            if self.heading[r] >= self.headings[r]:
                self.report_violation(
                    "heading", [r], cell, "it starts in a heading that its type lacks"
                )
            if self.bay[r] != NIL and (self.bay[r], self.home[r]) not in known:
                self.report_violation(
                    "bay", [r], self.bay[r], "its parking bay does not open on its home cell"
                )
            if cell == NIL:
                continue
            if not CELL_KINDS[self.kind[cell]].drivable:
                self.report_violation(
                    "exits", [r], cell, "it starts in a cell that is not drivable"
                )
            self.check_area(r, cell)
            self._take(r, cell, self.heading[r])

    # Resources

    def resource(self, cell: int, direction: int) -> int:
        """The resource that a robot travelling in `direction` holds in a cell; NIL: no limit."""
        capacity = self.capacity[cell]
        if capacity == 1:
            return 2 * cell
        return 2 * cell + (direction >> 1) if capacity == 2 else NIL

    def _take(self, r: int, cell: int, direction: int) -> None:
        resource = self.resource(cell, direction)
        if resource == NIL:
            return
        other = self.holder.get(resource, r)
        if other != r:
            self.report_violation(
                "capacity", [other, r], cell, "two robots where only one has room"
            )
        self.holder[resource] = r

    def _give(self, r: int, cell: int, direction: int) -> None:
        resource = self.resource(cell, direction)
        if self.holder.get(resource) == r:
            del self.holder[resource]

    def _first_in(self, resource: int) -> int:
        """Return a robot in a resource, or on its way into or out of it; NIL: none."""
        return self.holder.get(resource, self.leaver.get(resource, NIL))

    def is_under_way(self, r: int) -> bool:
        """Return whether robot r is between two cells."""
        return r in self.claim and self.claim[r][0] != self.cell[r]

    # One tick

    def look(self, acts: Acts) -> None:
        """Record the state on which the durations of moves depend, before anything happens."""
        if self.pace.slow and any(0 < did & ACTION_MASK <= MOVE_NORTH for _, did in acts):
            self.pace.count(self.cell, self.travel)

    def open_bays(self, tick: int, acts: Acts) -> set[int]:
        """Place robots that leave their parking bays; returns these robots."""
        placed: set[int] = set()
        for r, did in acts:
            if not did & LEFT_PARKING_BAY:
                continue
            if self.cell[r] != NIL or self.free[r] > tick:
                self.report_violation(
                    "bay", [r], self.cell[r], "leaves a parking bay in which it is not parked"
                )
                continue
            home = self.home[r]
            heading = self.entry_heading(r, home)
            other = self._first_in(self.resource(home, heading))
            if other != NIL:
                text = "leaves its parking bay although its home cell is held"
                self.report_violation("bay", [r, other], home, text)
            self.check_area(r, home)
            self.cell[r], self.heading[r], self.travel[r] = home, heading, heading
            self.parked[r] = False
            self.holder[self.resource(home, heading)] = r
            self.holder.pop(NIL, None)
            placed.add(r)
        return placed

    def entry_heading(self, r: int, cell: int) -> int:
        """Heading of robot r when it leaves its bay: vertical if the cell has a vertical exit."""
        for direction in (SOUTH, NORTH, EAST, WEST):
            if self.exits[cell] >> direction & 1:
                return direction & (self.headings[r] - 1)
        return 0

    def execute(self, tick: int, acts: Acts, lengths: dict[int, int], placed: set[int]) -> None:
        """Begin the operations of this tick, execute the moves, park robots at home."""
        movers: list[Mover] = []
        parking = False
        for r, did in acts:
            parking |= did & ENTERED_PARKING_BAY != 0
            code = did & ACTION_MASK
            if not code or not self._may_act(tick, r, code):
                continue
            self.begun[r] = code
            if code <= MOVE_NORTH:
                self._begin_move(r, code - 1, movers)
                self.free[r] = tick + lengths.get(r, self.pace.usual_of(r))
            elif code <= TURN_RIGHT:
                self._turn(tick, r, code)
                self.free[r] = tick + self.types.ticks_of(r, "turn")
            else:
                self.free[r] = tick + lengths.get(r, self.handling(r, code))
        if movers:
            self._check_lengths(tick, movers, lengths, placed)
            self._check_moves(tick, movers, placed)
        self._carry_out(tick, movers)
        if parking:
            for r, did in acts:
                if did & ENTERED_PARKING_BAY:
                    self._park(tick, r)

    def _may_act(self, tick: int, r: int, code: int) -> bool:
        if self.free[r] > tick:
            text = f"begins an operation although it is busy until tick {self.free[r] - 1}"
            self.report_violation("busy", [r], self.cell[r], text)
            return False
        if self.cell[r] == NIL:
            if code not in (EXECUTED_BAY_BLOCKED, EXECUTED_ILLEGAL):
                self.report_violation(
                    "bay", [r], self.home[r], "acts although it is in its parking bay"
                )
            return False
        if code == EXECUTED_BAY_BLOCKED:
            self.report_violation(
                "bay", [r], self.cell[r], "waits to leave a parking bay in which it is not"
            )
        if code != EXECUTED_ILLEGAL:
            self.parked[r] = False
            self.unsure.discard(r)
        elif self.parked[r]:
            self.unsure.add(r)  # it may also have decided to leave, and lost the tick
        return True

    def _begin_move(self, r: int, direction: int, movers: list[Mover]) -> None:
        cell = self.cell[r]
        if not self.exits[cell] >> direction & 1:
            self.report_violation("exits", [r], cell, "moves where its cell has no exit")
        elif direction & (self.headings[r] - 1) != self.heading[r]:
            self.report_violation("heading", [r], cell, "moves across its heading")
        else:
            self.check_area(r, cell + self.step[direction])
            movers.append((r, cell, cell + self.step[direction], direction))

    def handling(self, r: int, code: int) -> int:
        """Ticks of an operation other than driving, by the scenario; 1 by default.

        A pick or drop of 0 ticks takes 1 tick if no move precedes it.
        """
        name = HANDLING.get(code)
        return 1 if name is None else max(1, self.types.ticks_of(r, name))

    def check_area(self, r: int, cell: int) -> None:
        """Check that a robot may be in a cell, with its current load."""
        if self.types.is_closed(r, cell):
            text = f"is in an area closed to {self.types.called(r)}"
            self.report_violation("area", [r], cell, text)

    def own_ticks(self, tick: int, r: int, direction: int, is_new: bool) -> int:
        """Return the ticks of a move that begins now without a robot ahead.

        `is_new`: the robot left its parking bay in this tick.
        """
        if self.pace.usual and not self.pace.cabin_ticks:
            return self.pace.usual_of(r)
        came = None if is_new else self.travel[r]
        return self.pace.due(tick, r, self.cell[r], direction, came)[0]

    def _check_lengths(
        self, tick: int, movers: list[Mover], lengths: dict[int, int], placed: set[int]
    ) -> None:
        """Check the durations of moves; `lengths`: recorded ones, if not the usual ones."""
        own = {r: self.own_ticks(tick, r, way, r in placed) for r, _, _, way in movers}
        due = dict(own)
        if self.following == "convoy":
            self._wait_for_those_ahead(tick, movers, due)
        for r, start, _, way in movers:
            ticks = lengths.get(r, self.pace.usual_of(r))
            if ticks != due[r]:
                _, why = self.pace.due(tick, r, start, way, None if r in placed else self.travel[r])
                if due[r] != own[r]:
                    why += f", and the robot ahead still takes {due[r]}"
                text = f"its move is recorded with {ticks} ticks but must take {due[r]}: {why}"
                self.report_violation("move time", [r], start, text)

    def _wait_for_those_ahead(self, tick: int, movers: list[Mover], due: dict[int, int]) -> None:
        """Extend moves that begin now to the remaining ticks of the moves ahead.

        `due`: the ticks of each move, modified from the heads of queues to their ends; in a ring
        the most.
        """
        starts = {self.resource(start, self.travel[r]): r for r, start, _, _ in movers}
        ahead: dict[int, int] = {}
        for r, _, to, direction in movers:
            resource = self.resource(to, direction)
            if resource in self.leaver:
                due[r] = max(due[r], self.free[self.leaver[resource]] - tick)
            elif resource in starts and resource != NIL:
                ahead[r] = starts[resource]
        while ahead:
            file = [next(iter(ahead))]
            while file[-1] in ahead and ahead[file[-1]] not in file:
                file.append(ahead[file[-1]])
            head = ahead.get(file[-1])
            ring = [] if head is None else file[file.index(head) :]
            due.update(dict.fromkeys(ring, max((due[r] for r in ring), default=0)))
            for r in reversed(file):
                if r in ahead:
                    due[r] = max(due[r], due[ahead.pop(r)])

    def _turn(self, tick: int, r: int, code: int) -> None:
        cell, headings = self.cell[r], self.headings[r]
        if headings == 1:
            self.report_violation("turn", [r], cell, "an omnidirectional robot does not turn")
            return
        if headings == 2 and not CELL_KINDS[self.kind[cell]].turns:
            self.report_violation("turn", [r], cell, "turns on rails in a cell without a turntable")
        if headings == 2 and code == TURN_LEFT:
            self.report_violation("turn", [r], cell, "a turn on rails is neither left nor right")
        quarter = 3 if code == TURN_LEFT else 1
        self.heading[r] = (self.heading[r] + quarter) & (headings - 1)
        if self.capacity[cell] == 2:
            other = self.leaver.get(self.resource(cell, self.travel[r] ^ 2), NIL)
            if other != NIL and self.following == "convoy":
                text = "turns although another robot has not yet left the other lane"
                self.report_violation("capacity", [r, other], cell, text)
            self._take(r, cell, self.travel[r] ^ 2)
            self.claim[r] = (cell, self.travel[r])
            self._turned.setdefault(tick + self.types.ticks_of(r, "turn") - 1, []).append(r)

    def _check_moves(self, tick: int, movers: list[Mover], placed: set[int]) -> None:
        for r, start, to, direction in movers:
            self._check_edge(tick, r, start, to)
            resource = self.resource(to, direction)
            holder = self.holder.get(resource)
            if holder is None:
                continue
            if self.following == "none":
                text = "enters a cell that was held when the tick began"
                self.report_violation("following", [r, holder], to, text)
            elif holder in placed and self.resource(to, self.travel[holder]) == resource:
                text = "follows a robot that left its parking bay in this tick"
                self.report_violation("bay", [r, holder], to, text)

    def _check_edge(self, tick: int, r: int, start: int, to: int) -> None:
        """A robot now between two cells must not meet a robot there in the opposite direction."""
        other, arrival = self._drive.get((to, start), (NIL, NIL))
        limited = self.capacity[start] == 1 or self.capacity[to] == 1
        if arrival >= tick and limited:
            self.report_violation("swap", [other, r], start, "two robots pass through each other")
        self._drive[start, to] = r, self.free[r] - 1

    def _carry_out(self, tick: int, movers: list[Mover]) -> None:
        """All releases, then all claims: moves of one tick are simultaneous."""
        self.arrived.clear()
        for r in self._arrivals.pop(tick, ()):
            self.arrived.add(r)
            self._give(r, self.cell[r], self.travel[r])
            self.leaver.pop(self.resource(self.cell[r], self.travel[r]), None)
            self.cell[r], self.travel[r] = self.claim.pop(r)
        for r in self._turned.pop(tick, ()):
            self._give(r, self.cell[r], self.travel[r] ^ 2)
            del self.claim[r]
        for r, start, _, _ in movers:
            if self.free[r] == tick + 1 or self.following == "convoy":
                self._give(r, start, self.travel[r])
        for r, start, to, direction in movers:
            self._take(r, to, direction)
            if self.free[r] == tick + 1:
                self.cell[r], self.travel[r] = to, direction
                self.arrived.add(r)
            else:
                self.leaver[self.resource(start, self.travel[r])] = r
                self.claim[r] = (to, direction)
                self._arrivals.setdefault(self.free[r] - 1, []).append(r)
        self.leaver.pop(NIL, None)
        for r in self.arrived:
            other = self.leaver.get(self.resource(self.cell[r], self.travel[r]), r)
            if other != r and self.following == "convoy":
                text = "arrives in a cell that another robot has not yet left"
                self.report_violation("capacity", [other, r], self.cell[r], text)

    def lengthen(self, r: int, ticks: int) -> None:
        """Extend the current move or turn of robot r."""
        last = self.free[r] - 1
        self.free[r] += ticks
        for ends in (self._arrivals, self._turned):
            if r in ends.get(last, ()):
                ends[last].remove(r)
                ends.setdefault(last + ticks, []).append(r)
        if self.begun[r] <= MOVE_NORTH and r in self.claim:
            self._drive[self.cell[r], self.claim[r][0]] = r, self.free[r] - 1

    def hand_on(self, delayed: list[int]) -> list[tuple[int, int]]:
        """Let no move end before that of the robot ahead, from delayed robots to the ends of their
        queues.

        Returns the extensions of moves: (robot, ticks).
        """
        behind = {self.resource(*self.claim[r]): r for r in self.claim if self.is_under_way(r)}
        longer: list[tuple[int, int]] = []
        front = [r for r in delayed if self.is_under_way(r)]
        while front:
            r = front.pop()
            resource = self.resource(self.cell[r], self.travel[r])
            other = behind.get(resource, r) if resource != NIL else r
            late = self.free[r] - self.free[other]
            if late > 0:
                self.lengthen(other, late)
                longer.append((other, late))
                front.append(other)
        return longer

    def _park(self, tick: int, r: int) -> None:
        cell = self.cell[r]
        if self.leave and cell != NIL:
            self.home[r] = cell
        if cell != self.home[r] or self.free[r] > tick + 1:
            self.report_violation("bay", [r], cell, "parks although it is not at home")
            return
        self.parked[r] = True
        self.unsure.discard(r)
        if self.bay[r] != NIL or self.leave:
            self._give(r, cell, self.travel[r])
            self.cell[r] = NIL
            self.heading[r] = self.entry_heading(r, cell)

    def tow(self, r: int) -> None:
        """Robot r is off the floor, at home."""
        if self.cell[r] != NIL:
            self._give(r, self.cell[r], self.travel[r])
            self.home[r] = self.cell[r] if self.leave else self.home[r]
            self.heading[r] = self.travel[r] = self.entry_heading(r, self.home[r])
        self.cell[r], self.parked[r] = NIL, True
        self.unsure.discard(r)

    def know(self, parked: list[int]) -> None:
        """Take from a recorded state which robots are parked, if actions do not tell."""
        for r in self.unsure:
            self.parked[r] = bool(parked[r])
        self.unsure.clear()

    def all_parked(self) -> set[bool]:
        """Whether all robots are parked: all answers possible by the actions."""
        sure = all(parked or r in self.unsure for r, parked in enumerate(self.parked))
        return {sure, sure and not self.unsure}

    def stand_on(self, cells: list[int]) -> bool:
        """Whether each robot stands in its cell of a list."""
        return self.cell == cells and not any(map(self.is_under_way, self.claim))

    def busy(self, tick: int) -> list[int]:
        """Remaining busy ticks of each robot after this tick."""
        return [max(0, free - tick - 1) for free in self.free]


# Rows of changes: their groups, and whether the things that they name exist.


Rows = list[list[int]]  # (tick, code, subject, value)

STATUS_REMOVED = 6  # the highest status of a robot


def parted(rows: Rows, acts: Acts) -> tuple[Rows, Rows]:
    """The changes before the moves of a tick have ended, and those of robots that arrive."""
    arriving = {r for r, did in acts if did & (PICKED_ON_ARRIVAL | DROPPED_ON_ARRIVAL)}
    for at, (_, code, subject, _) in enumerate(rows if arriving else ()):
        if code in (CHANGE_PICKED, CHANGE_DROPPED) and subject in arriving:
            # Durations of moves and waits are in between.
            lengths = [row for row in rows[at:] if row[1] == CHANGE_DURATION]
            return rows[:at] + lengths, [row for row in rows[at:] if row[1] != CHANGE_DURATION]
    return rows, []


def parted_delays(rows: Rows) -> tuple[Rows, Rows]:
    """The delays that begin in a tick, which come first, and the other changes."""
    delays = [row for row in rows if row[1] == CHANGE_DELAYED]
    return delays, rows[len(delays) :] if rows[: len(delays)] == delays else rows


def parted_visits(rows: Rows) -> tuple[Rows, Rows]:
    """The changes of a tick before stops are done at its end, and those from then on."""
    for at, row in enumerate(rows):
        if row[1] == CHANGE_VISITED:
            return rows[:at], rows[at:]
    return rows, []


def names_what_is_there(
    code: int, subject: int, value: int, robots: int, orders: int, slots: int
) -> bool:
    """Whether a change names existing robots, orders and slots, given their numbers."""
    limits = {
        CHANGE_ORDER_RESERVED: (orders, robots),
        CHANGE_SLOT_RESERVED: (slots, robots),
        CHANGE_DURATION: (robots, 1 << 31),
        CHANGE_PICKED: (robots, orders),
        CHANGE_DROPPED: (robots, slots),
        CHANGE_LOAD_LEFT: (robots, slots),
        CHANGE_STATUS: (robots, STATUS_REMOVED + 1),
        CHANGE_ZONE: (robots, 1 << 31),
        CHANGE_VISITED: (robots, orders),
        CHANGE_DELAYED: (robots, 1 << 31),
    }
    subjects, values = limits.get(code, (0, 0))
    least = NIL if code in (CHANGE_ORDER_RESERVED, CHANGE_SLOT_RESERVED, CHANGE_ZONE) else 0
    return 0 <= subject < subjects and least <= value < values


# Due times: each order is due when its scenario says, under all rules of the run.


NEVER: Final = 2**31 - 1  # no due time


def check_due_times(
    header: dict[str, Any], scenario: dict[str, Any], report_violation: Complaint
) -> None:
    """Report the first order whose recorded due time is not that of a scenario."""
    count = len(header["orders"]["source"])
    recorded = header["orders"].get("due")
    known = [NEVER] * count if recorded is None else recorded.tolist()
    listed = scenario["orders"].get("list")
    said = [NEVER] * count if listed is None else [due_tick(line) for line in listed]
    for order, (tick, expected) in enumerate(zip(known, said, strict=False)):
        if tick != expected:
            here, there = ("never" if one == NEVER else str(one) for one in (tick, expected))
            text = f"order {order} is due in tick {here}, by its scenario {there}"
            report_violation("due", [], -1, text)
            return


def due_tick(line: dict[str, Any]) -> int:
    """The tick in which an order of a list is due, NEVER if it has no due time."""
    due = line.get("due")
    if due is None:
        return NEVER
    at: int = due["at"] if isinstance(due, dict) else line.get("release", 0) + due
    return min(at, NEVER - 1)
