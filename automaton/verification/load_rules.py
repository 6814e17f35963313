"""The rules of loads, checked on committed actions: conservation, and single reservations.

Every order is in exactly one place: in a slot, or on a robot. Only the robot that reserved it may
pick it up, from an adjacent slot. It may be dropped only on an empty shelf that the robot reserved,
or at its target. Racks are served only from above and below. Stations work on the parts delivered
to them.
"""

from __future__ import annotations

from collections import deque
from typing import Any, Final

from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_SLOT_RESERVED,
    DROPPED_ON_ARRIVAL,
    ENTERED_PARKING_BAY,
    EXECUTED_DROP,
    EXECUTED_PICK,
    EXECUTED_SERVE,
    EXECUTED_TRY_DROP,
    EXECUTED_WAIT,
    MOVE_NORTH,
    PICKED_ON_ARRIVAL,
)
from automaton.floor.floor_plan import (
    ABOVE_OR_BELOW,
    ANY_LOADS,
    BESIDE,
    CELL_KINDS,
    ON_IT,
    STATION,
    STORAGE,
)
from automaton.verification.motion_rules import (
    Acts,
    Complaint,
    ReplayedMotion,
    Rows,
    names_what_is_there,
)
from automaton.verification.move_time_rules import NIL
from automaton.verification.pod_rules import ReplayedTrips
from automaton.verification.visit_rules import (
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_STARTED,
    ORDER_UNRELEASED,
    ORDER_WAITING,
    STATUS_DEPLETED,
    ReplayedVisits,
)

LASTING: Final = (EXECUTED_WAIT, EXECUTED_SERVE)  # their durations are recorded with them

# Handling on arrival: the flag, the equivalent action, and the duration that must be 0.
ON_ARRIVAL: Final = (
    (PICKED_ON_ARRIVAL, EXECUTED_PICK, "pick"),
    (DROPPED_ON_ARRIVAL, EXECUTED_DROP, "drop"),
)


class Loads:
    """Where all orders are and what is reserved, replayed from the committed changes."""

    def __init__(
        self, header: dict[str, Any], motion: ReplayedMotion, report_violation: Complaint
    ) -> None:
        self.motion = motion
        self.report_violation = report_violation
        self.slot_cell: list[int] = header["slots"]["cell"].tolist()
        self.spare: int = header["slots"]["first_spare"]  # the first slot for loads left by robots
        spares = len(self.slot_cell) - self.spare
        kinds = [CELL_KINDS[motion.kind[cell]] for cell in self.slot_cell[: self.spare]]
        none = [False] * spares
        self.stand = [kind.stand for kind in kinds] + [BESIDE] * spares
        self.kind_name = [kind.name for kind in kinds] + ["load"] * spares
        self.dock = [kind.gives and not kind.takes for kind in kinds] + none
        self.station = [kind.code == STATION for kind in kinds] + none
        self.endless = [kind.holds == ANY_LOADS for kind in kinds] + [True] * spares
        self.target: list[int] = header["orders"]["target"].tolist()
        weights = header["orders"].get("weight")
        self.weight = [1] * len(self.target) if weights is None else weights.tolist()
        self.place: list[int] = header["orders"]["source"].tolist()
        released = header["orders"]["release_tick"].tolist()
        self.state = [ORDER_UNRELEASED if tick else ORDER_WAITING for tick in released]
        self.work = Work(header)
        self.trips = ReplayedTrips(header, motion, report_violation)
        self.visits = ReplayedVisits(header, self, self.trips)
        self.picking: dict[int, int] = {}  # robots that picked up: the last tick of the pick
        self.status = [0] * len(motion.home)  # of each robot, from the rules of energy
        coming = sorted(range(len(released)), key=lambda k: (released[k], k), reverse=True)
        if self.trips.there:  # all are released in tick 1 or later
            self.state = [ORDER_UNRELEASED] * len(released)
        timed = [
            order
            for order in coming
            if self.state[order] == ORDER_UNRELEASED and order not in self.work.ends
        ]
        self._coming = [(released[order], order) for order in timed]
        arrivals = header["scenario"]["orders"].get("arrivals") or {}
        self._in_system: int = (arrivals.get("closed_loop") or {}).get("in_system", 0)
        if revealed := header["scenario"]["orders"].get("revealed"):
            self._in_system = max(1, int(revealed * len(motion.home) + 1e-9))
        if self._in_system:
            later = header["orders"]["release_sequence"].tolist()[self._in_system :]
            self._coming = [(0, order) for order in reversed(later)]
            for order in later:
                self.state[order] = ORDER_UNRELEASED
        self.by = [NIL] * len(self.place)
        self.content = [NIL] * len(self.slot_cell)
        self.reserved = [NIL] * len(self.slot_cell)
        self.load = [NIL] * len(motion.home)
        self.order = [NIL] * len(motion.home)  # reserved or carried by each robot
        self.slot = [NIL] * len(motion.home)  # shelf reserved by each robot
        self.undelivered = len(self.place)
        self.put_aside: set[int] = set()  # towed robots whose pods are in storage
        self._lengths: dict[int, int] = {}  # recorded durations of this tick
        self._arriving = False
        for order, (start, end) in self.work.ends.items():
            ends = self.slot_cell[self.place[order]], self.slot_cell[self.target[order]]
            if ends != (start, end):
                report_violation(
                    "part", [], start, f"order {order} does not match the route of its part"
                )
        for pod, slot in enumerate(self.trips.slot):
            self.content[slot] = pod
        for order, slot in enumerate(self.place):
            if slot == NIL or self.dock[slot] or self.station[slot] or self.trips.there:
                continue
            if not kinds[slot].is_slot or self.endless[slot]:
                report_violation(
                    "load", [], self.slot_cell[slot], f"order {order} starts on no shelf"
                )
            if self.content[slot] != NIL:
                report_violation("load", [], self.slot_cell[slot], "two loads start on one shelf")
            self.content[slot] = order

    def release(self, tick: int) -> None:
        """Release orders: in their ticks, or one for each order delivered before this tick."""
        released: list[int] = []
        while self._coming and self._coming[-1][0] <= tick:
            # Open orders are the undelivered ones minus those not yet released.
            if self._in_system and self.undelivered - len(self._coming) >= self._in_system:
                break
            released.append(self._coming.pop()[1])
            self.state[released[-1]] = ORDER_WAITING
        for order in (*self.work.begin(tick), *self.visits.announced):
            self.state[order] = ORDER_WAITING
        self.visits.announced.clear()
        if self.trips.of_lines:
            for trip, slot in self.trips.plan(tick, self._is_free):
                self.place[trip], self.state[trip] = slot, ORDER_WAITING
                self.weight[trip] = self.trips.weight[self.trips.pod_of[trip]]
                self.undelivered += 1
        elif self.trips.there:
            self._release_pods(released)

    def _release_pods(self, released: list[int]) -> None:
        """Listed orders that carry pods open when their pod has no earlier order."""
        carrying = [order for order in released if self.trips.pod_of[order] != NIL]
        for order in carrying:
            self.state[order] = ORDER_UNRELEASED
        for order, slot in self.trips.line_up(carrying, self._is_free):
            self.place[order], self.state[order] = slot, ORDER_WAITING

    def _is_free(self, r: int, trip: int) -> bool:
        """Whether the trip of the pod above a robot may be reserved for it."""
        idle = self.order[r] == NIL and self.load[r] == NIL and self.status[r] == 0
        weight = self.weight[trip]
        if self.trips.of_lines:
            weight = self.trips.weight[self.trips.pod_of[trip]]
        return idle and weight <= self.motion.types.payload[r]

    def leave(self, r: int, slot: int) -> None:
        """A robot that goes down leaves its load in a spare slot in its cell; a pod goes into
        storage."""
        if self.trips.there:
            self._put_aside(r, slot)
            return
        order, cell = self.load[r], self.motion.cell[r]
        if order == NIL or slot < self.spare or self.slot_cell[slot] != NIL:
            self.report_violation("load", [r], cell, "leaves no load, or not in a spare slot")
            return
        self.visits.served.pop(r, None)
        self.load[r], self.place[order], self.state[order] = NIL, slot, ORDER_WAITING
        self.slot_cell[slot], self.content[slot], self.endless[slot] = cell, order, False

    def _put_aside(self, r: int, slot: int) -> None:
        """The pod of a robot about to be towed is put into a slot."""
        order = self.load[r]
        if order == NIL or self.status[r] < STATUS_DEPLETED:
            text = "its pod is put into storage, but it has no pod or is not down"
            self.report_violation("pod", [r], self.motion.cell[r], text)
            return
        free = {
            cell: number
            for number, cell in enumerate(self.slot_cell[: self.spare])
            if self.motion.kind[cell] == STORAGE
            and self.content[number] == self.reserved[number] == NIL
        }
        over = self.visits.is_over(order) and self.target[order] in (slot, NIL)
        self.trips.put_aside(r, slot, over, self.load, free, self._is_free)
        self.visits.served.pop(r, None)
        self.content[slot] = self.trips.pod_of[order]
        self.load[r], self.place[order] = NIL, slot
        self.state[order] = ORDER_DELIVERED if over else ORDER_WAITING
        self.undelivered -= over
        self.put_aside.add(r)

    def apply(self, tick: int, rows: Rows, acts: Acts) -> dict[int, int]:
        """Apply the changes of a tick in order; returns the durations of waits and charging."""
        lengths: dict[int, int] = {}
        self._lengths, self._arriving = lengths, False
        if not rows and not any(did & ACTION_MASK >= EXECUTED_PICK for _, did in acts):
            return lengths
        did = {r: code & ACTION_MASK for r, code in acts}
        handled: set[int] = set()
        for _, code, subject, value in rows:
            if not self.exists(code, subject, value):
                self.report_violation(
                    "record", [], NIL, f"invalid change: {code} {subject} {value}"
                )
            elif code == CHANGE_DURATION:
                lengths[subject] = value
                self._check_length(subject, value, did.get(subject, 0))
            else:
                self._change(tick, code, subject, value, did)
                handled |= {subject} if code in (CHANGE_PICKED, CHANGE_DROPPED) else set()
        self._check_acts(did, lengths, handled)
        for r, code in did.items():
            if code == EXECUTED_SERVE:
                self.visits.serve(tick, r, lengths.get(r, 0))
        return lengths

    def arrive(self, tick: int, rows: Rows, acts: Acts) -> None:
        """Apply the handling of loads on arrival, at the end of a tick."""
        did: dict[int, int] = {}
        self._arriving = True
        for r, code in acts:
            for flag, action, name in ON_ARRIVAL:
                if code & flag:
                    did[r] = action
                    self._check_arrival(r, name)
        handled: set[int] = set()
        for _, code, subject, value in rows:
            if self.exists(code, subject, value):
                self._change(tick, code, subject, value, did)
                handled |= {subject} if code in (CHANGE_PICKED, CHANGE_DROPPED) else set()
            else:
                self.report_violation(
                    "record", [], NIL, f"invalid change: {code} {subject} {value}"
                )
        self._check_acts(did, {}, handled)

    def _change(self, tick: int, code: int, subject: int, value: int, did: dict[int, int]) -> None:
        if code == CHANGE_ORDER_RESERVED:
            self.reserve_order(subject, value)
        elif code == CHANGE_SLOT_RESERVED:
            self._reserve_slot(subject, value)
        elif code == CHANGE_PICKED:
            self._pick(tick, subject, value, did.get(subject, 0))
        elif code == CHANGE_DROPPED:
            self._drop(tick, subject, value, did.get(subject, 0))

    def _check_arrival(self, r: int, name: str) -> None:
        cell = self.motion.cell[r]
        if ticks := self.motion.types.ticks_of(r, name):
            text = f"handles its load on arrival, but a {name} takes {ticks} ticks"
            self.report_violation("arrival", [r], cell, text)
        elif r not in self.motion.arrived:
            text = "handles its load on arrival, but none of its moves ends in this tick"
            self.report_violation("arrival", [r], cell, text)

    def exists(self, code: int, subject: int, value: int) -> bool:
        """Whether a change names existing things."""
        return names_what_is_there(
            code, subject, value, len(self.load), len(self.place), len(self.slot_cell)
        )

    def _check_length(self, r: int, ticks: int, code: int) -> None:
        if code in (EXECUTED_PICK, EXECUTED_DROP):
            least = self.motion.handling(r, code)
            if not least <= ticks <= least + self.motion.given["handling_jitter"]:
                text = f"handles its load for {ticks} ticks, which no rule allows"
                self.report_violation("duration", [r], self.motion.cell[r], text)
        elif ticks < 1 or not (code in LASTING or 1 <= code <= MOVE_NORTH):
            text = f"a duration of {ticks} belongs to none of its actions"
            self.report_violation("duration", [r], self.motion.cell[r], text)

    def _check_acts(self, did: dict[int, int], lengths: dict[int, int], handled: set[int]) -> None:
        for r, code in did.items():
            cell = self.motion.cell[r]
            if code in (EXECUTED_PICK, EXECUTED_DROP) and r not in handled:
                self.report_violation("load", [r], cell, "handles a load without a recorded change")
            elif (
                code in LASTING
                or (code in (EXECUTED_PICK, EXECUTED_DROP) and self.motion.given["handling_jitter"])
            ) and (r not in lengths):
                self.report_violation(
                    "duration", [r], cell, "has an operation without a recorded duration"
                )
            elif code == EXECUTED_TRY_DROP and self.load[r] == NIL:
                self.report_violation("load", [r], cell, "tries to drop without a load")

    def reserve_order(self, order: int, r: int) -> None:
        """An order is assigned to a robot, reserved for the robot beneath its pod, or returned
        (NIL)."""
        had = self.by[order]
        if r != NIL and self.trips.offers.get(order) == r:
            self.trips.offered[r] = order
            del self.trips.offers[order]
        elif r == NIL and had != NIL and self.trips.offered[had] == order != self.order[had]:
            self.trips.withdraw(had)
        elif r == NIL:
            self._give_back(order, had)
        else:
            self._give_out(order, had, r)
        self.by[order] = r

    def _give_back(self, order: int, had: int) -> None:
        if had == NIL or self.state[order] in (ORDER_CARRIED, ORDER_UNRELEASED):
            text = f"order {order} is returned, but is carried or was not reserved"
            self.report_violation("order", [had] if had != NIL else [], NIL, text)
        if self.state[order] == ORDER_STARTED:
            if had != NIL and self.status[had] < STATUS_DEPLETED:
                text = f"order {order} is returned, but one of its stops is done"
                self.report_violation("order", [had], NIL, text)
            self.state[order] = ORDER_WAITING
        if had != NIL and self.order[had] == order:
            self.order[had] = NIL
            self.trips.give_back(had)
            self.visits.touring.discard(had)
            self.visits.served.pop(had, None)

    def _give_out(self, order: int, had: int, r: int) -> None:
        is_offered = had == r and self.trips.offered[r] == order
        if (had != NIL and not is_offered) or self.state[order] != ORDER_WAITING:
            robots = [r] if had == NIL else [r, had]
            text = f"order {order} is assigned although it is not free"
            self.report_violation("order", robots, NIL, text)
        elif not self.visits.is_for(r, order):
            self.report_violation(
                "order", [r], NIL, f"gets order {order}, which belongs to another robot"
            )
        elif self.order[r] != NIL or self.load[r] != NIL:
            self.report_violation("order", [r], NIL, f"gets order {order} while it has another one")
        elif not self.visits.has_load[order] and self.weight[order] > self.motion.types.payload[r]:
            text = f"gets order {order} of weight {self.weight[order]}, which it cannot carry"
            self.report_violation("payload", [r], NIL, text)
        self.order[r] = order
        if self.trips.there:
            self.trips.take(r, order)
        if self.visits.belong_to(order):
            self.visits.touring.add(r)

    def _reserve_slot(self, slot: int, r: int) -> None:
        had, cell = self.reserved[slot], self.slot_cell[slot]
        if r == NIL:
            if had == NIL:
                self.report_violation("slot", [], cell, "a shelf is released that was not reserved")
            elif self.slot[had] == slot:
                self.slot[had] = NIL
        else:
            if had != NIL or self.content[slot] != NIL or self.endless[slot]:
                robots = [r] if had == NIL else [r, had]
                text = "a slot is reserved that is not an empty, unreserved shelf"
                self.report_violation("slot", robots, cell, text)
            elif self.slot[r] != NIL or self.load[r] == NIL:
                self.report_violation(
                    "slot", [r], cell, "reserves a second shelf, or a shelf without having a load"
                )
            self.slot[r] = slot
        self.reserved[slot] = r

    def _beside(self, r: int, slot: int) -> None:
        offset = self.slot_cell[slot] - self.motion.cell[r]
        if self.stand[slot] == ON_IT:
            if offset:
                text = f"handles a load at a {self.kind_name[slot]} without standing on it"
                self.report_violation("load", [r], self.slot_cell[slot], text)
        elif self.motion.cell[r] == NIL or offset not in self.motion.step:
            self.report_violation(
                "load", [r], self.slot_cell[slot], "handles a slot that is not adjacent"
            )
        elif self.stand[slot] == ABOVE_OR_BELOW and abs(offset) == 1:
            text = f"handles a {self.kind_name[slot]} from the side"
            self.report_violation("load", [r], self.slot_cell[slot], text)

    def _pick(self, tick: int, r: int, order: int, code: int) -> None:
        slot = self.place[order]
        cell = self.motion.cell[r]
        if code != EXECUTED_PICK:
            self.report_violation("load", [r], cell, "gets a load without picking it up")
        if self.load[r] != NIL:
            self.report_violation("load", [r], cell, "picks up a second load")
        most = self.motion.types.payload[r]
        if self.weight[order] > most:
            text = (
                f"picks up order {order} of weight {self.weight[order]} but carries at most {most}"
            )
            self.report_violation("payload", [r], cell, text)
        if self.by[order] != r:
            self.report_violation(
                "order", [r], cell, f"picks up order {order}, which it does not have"
            )
        if slot == NIL or self.state[order] != ORDER_WAITING:
            text = f"picks up order {order}, which waits in no slot"
            self.report_violation("load", [r], cell, text)
        else:
            self._beside(r, slot)
            self.content[slot] = NIL
            if self.trips.there:
                self.trips.lift(r, order)
        if slot != NIL and slot == self.target[order] and not self.trips.there:
            self.state[order] = ORDER_DELIVERED  # the pick completed the order
            self.undelivered -= 1
            self.work.deliver(tick + self._handling(r, EXECUTED_PICK), order)
            return
        self.place[order], self.state[order], self.load[r] = NIL, ORDER_CARRIED, order
        self.motion.check_area(r, self.motion.cell[r])
        self.picking[r] = tick + self._handling(r, EXECUTED_PICK) - 1
        if slot >= self.spare:
            self.slot_cell[slot], self.endless[slot] = NIL, True

    def _drop(self, tick: int, r: int, slot: int, code: int) -> None:
        order, cell = self.load[r], self.slot_cell[slot]
        if code != EXECUTED_DROP:
            self.report_violation("load", [r], cell, "loses a load without dropping it")
        if order == NIL:
            self.report_violation("load", [r], cell, "drops without a load")
            return
        self._beside(r, slot)
        if not self.visits.is_over(order):
            self.report_violation(
                "visit", [r], cell, f"drops order {order}, which has remaining stops"
            )
        if self.endless[slot]:
            on_its_way = self.station[slot]
            if (self.target[order] != slot and not on_its_way) or self.dock[slot]:
                self.report_violation(
                    "load", [r], cell, "drops its load in a slot that is not its target"
                )
        else:
            if self.content[slot] != NIL:
                self.report_violation("load", [r], cell, "drops on a full shelf")
            if self.reserved[slot] != r:
                self.report_violation(
                    "slot", [r], cell, "drops on a shelf that it has not reserved"
                )
            self.content[slot] = self.trips.pod_of[order] if self.trips.there else order
        delivered = self.target[order] in (slot, NIL)
        if self.trips.there:
            self.trips.store(r, order, slot, delivered)
        self.load[r], self.place[order] = NIL, slot
        self.motion.check_area(r, self.motion.cell[r])
        self.state[order] = ORDER_DELIVERED if delivered else ORDER_WAITING
        self.undelivered -= delivered
        if delivered:
            self.work.deliver(tick + self._handling(r, EXECUTED_DROP), order)

    def _handling(self, r: int, code: int) -> int:
        """Ticks for which a robot handles its load; 0 on arrival."""
        if self._arriving:
            return 0
        return self._lengths.get(r, self.motion.handling(r, code))

    def check_parked(self, acts: Acts) -> None:
        """A robot may park only without an order."""
        for r, did in acts:
            if did & ENTERED_PARKING_BAY and (self.load[r] != NIL or self.order[r] != NIL):
                self.report_violation("bay", [r], self.motion.home[r], "parks with an order")


# The rules of stations: parts are processed one at a time, in arrival order. When the job on a part
# is done, the order to its next station is released, and the next job begins in the same tick.


class Work:
    """The queues of parts at all stations, replayed from deliveries."""

    def __init__(self, header: dict[str, Any]) -> None:
        floor, orders = header["floor"], header["scenario"]["orders"]
        cells = [
            cell for cell, kind in enumerate(floor["kind"].ravel().tolist()) if kind == STATION
        ]
        self.cells: list[int] = list(floor["numbered"]) or cells
        self.lines: list[deque[int]] = [deque() for _ in self.cells]
        self.until = [0] * len(self.cells)  # tick in which the first job of its queue is done
        self.station: list[int] = []  # of each job
        self.ticks: list[int] = []
        self.frees: list[int] = []  # the order that a job releases, or NIL
        self.done: list[int] = []
        self.came: list[int] = []  # tick from which it can be processed
        self.begins_with: dict[int, int] = {}  # order -> job that begins with its delivery
        self.ends: dict[int, tuple[int, int]] = {}  # order -> cells of its source and target
        self._entering: list[tuple[int, int]] = []  # (tick, job), by tick
        # Random values are in the header; older headers have none.
        drawn = header.get("jobs", {})
        self._drawn: list[int] = (
            drawn["processing_time"].tolist() if "processing_time" in drawn else []
        )
        came: list[int] = drawn["arrival_tick"].tolist() if "arrival_tick" in drawn else []
        for kind in orders.get("parts") or ():
            for _ in range(kind["count"]):
                tick = came[len(self.station)] if came else kind["first_release"]
                self._enter(tick, kind["route"], orders["processing_time"])
        self._entering.sort(reverse=True)

    def _enter(self, tick: int, route: list[int], times: Any) -> None:
        for place, number in enumerate(route):
            if place:
                order = len(self.ends)
                self.frees[-1] = order
                self.begins_with[order] = len(self.station)
                self.ends[order] = self.cells[route[place - 1] - 1], self.cells[number - 1]
            else:
                self._entering.append((tick, len(self.station)))
            self.station.append(number - 1)
            given = times[number - 1] if isinstance(times, list | tuple) else times
            drawn = isinstance(given, dict)
            self.ticks.append(self._drawn[len(self.ticks)] if drawn else given)
            self.frees.append(NIL)
            self.done.append(NIL)
            self.came.append(NIL)

    @property
    def undone(self) -> int:
        """Number of unfinished jobs."""
        return self.done.count(NIL)

    def begin(self, tick: int) -> list[int]:
        """Parts arrive and jobs end; returns the released orders."""
        while self._entering and self._entering[-1][0] <= tick:
            self._come(tick, self._entering.pop()[1])
        freed = []
        for station, line in enumerate(self.lines):
            if line and self.until[station] <= tick:
                work = line.popleft()
                self.done[work] = tick
                if self.frees[work] != NIL:
                    freed.append(self.frees[work])
                if line:
                    self.until[station] = max(tick, self.came[line[0]]) + self.ticks[line[0]]
        return freed

    def deliver(self, tick: int, order: int) -> None:
        """An order is delivered; its part can be processed from this tick on."""
        if order in self.begins_with:
            self._come(tick, self.begins_with[order])

    def _come(self, tick: int, work: int) -> None:
        """Queues are in arrival order; within one tick, in the order of their numbers."""
        line = self.lines[self.station[work]]
        self.came[work] = tick
        place = len(line)
        while place and (self.came[line[place - 1]], line[place - 1]) > (tick, work):
            place -= 1
        line.insert(place, work)
        if place == 0:
            self.until[self.station[work]] = tick + self.ticks[work]

    def first(self) -> list[int]:
        """The current job of each station, or NIL."""
        return [line[0] if line else NIL for line in self.lines]
