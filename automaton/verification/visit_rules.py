"""The rules of stops: a robot does the next one of its order when a tick leaves it standing there.

Where a stop takes time, the robot does SERVE there for so long, and the stop is done in its last tick.
One stop by a robot in a tick; of an order with a load, between pick and drop. What is recorded must be
all of them, and no others. Positions are those of the validator's own replay.
"""

from __future__ import annotations

from typing import Any, Final, Protocol

from automaton.engine.record_codes import CHANGE_ORDER_RESERVED, CHANGE_VISITED
from automaton.verification.motion_rules import Complaint, ReplayedMotion, Rows
from automaton.verification.pod_rules import ReplayedTrips

NIL: Final = -1
ORDER_WAITING: Final = 0  # states of an order
ORDER_CARRIED: Final = 1
ORDER_DELIVERED: Final = 2
ORDER_UNRELEASED: Final = 3
ORDER_STARTED: Final = 4
STATUS_DEPLETED: Final = 3  # of a robot: down, as all above it


class Holders(Protocol):
    """Who has which order, which stops may end."""

    motion: ReplayedMotion
    report_violation: Complaint
    order: list[int]
    load: list[int]
    by: list[int]
    state: list[int]
    picking: dict[int, int]
    status: list[int]
    undelivered: int

    def exists(self, code: int, subject: int, value: int) -> bool: ...

    def reserve_order(self, order: int, r: int) -> None: ...


class ReplayedVisits:
    """The stops of all orders, and which of them are done."""

    def __init__(self, header: dict[str, Any], loads: Holders, trips: ReplayedTrips) -> None:
        self.loads, self.trips = loads, trips
        self.motion = loads.motion
        self.report_violation = loads.report_violation
        stops = header.get("stops")
        self.cell: list[int] = [] if stops is None else stops["cell"].tolist()
        self.ticks: list[int] = [] if stops is None else stops["ticks"].tolist()
        self._places = {*self.cell, *trips.cell}  # outside no stop is done
        source = header["orders"]["source"].tolist()
        self.has_load: list[bool] = [slot != NIL or trips.of_lines for slot in source]
        self.touring: set[int] = set()  # robots with an order that has stops
        self.served: dict[int, int] = {}  # robots in SERVE: its last tick
        orders = len(source)
        first = header["orders"].get("first_stop")
        self.first: list[int] = [0] * (orders + 1) if first is None else first.tolist()
        self.next: list[int] = self.first[:-1]  # stop that each order needs next
        self.done = [NIL] * len(self.cell)  # tick of each stop
        scenario_orders = header["scenario"]["orders"]
        self.dealt_out: bool = scenario_orders.get("assign") == "round-robin"
        self.skips: bool = scenario_orders.get("skip_reached", False)
        self.announced: list[int] = []  # orders that are known from the next tick on
        self.count = 0

    def belong_to(self, order: int) -> bool:
        """Whether an order has stops."""
        return self.first[order] < self.first[order + 1]

    def lasts(self, order: int) -> int:
        """Ticks of the next stop of an order; NIL: none is left."""
        if self.trips.of_lines and not self.is_over(order):
            return self.trips.ticks(order, self.next[order] - self.first[order])
        return NIL if self.is_over(order) else self.ticks[self.next[order]]

    def is_over(self, order: int) -> bool:
        """Whether all stops of an order are done."""
        if self.trips.of_lines:
            return self.trips.next_station(order) == NIL
        return self.next[order] >= self.first[order + 1]

    def is_at_stop(self, r: int, order: int) -> bool:
        """Whether a robot stands in the next stop of an order; one in a long move does not."""
        if order == NIL or not self.belong_to(order) or self.is_over(order):
            return False
        cell = self.motion.cell[r]
        entering = self.motion.claim.get(r, (cell, 0))[0]
        if self.trips.of_lines:
            return self.trips.cell[self.trips.next_station(order)] == cell == entering
        return self.cell[self.next[order]] == cell == entering

    def is_done_by(self, tick: int, r: int, order: int, picks: bool) -> bool:
        """Whether a tick leaves a robot at the next stop of an order for as long as that takes.

        `picks`: it picks its load up in this tick and the next ones.
        """
        if not self.is_at_stop(r, order):
            return False
        if self.lasts(order):
            return self.served.get(r) == tick
        if self.trips.there and self.trips.has_break(tick, self.motion.cell[r]):
            return False
        return not picks

    def is_for(self, r: int, order: int) -> bool:
        """Whether a robot may have an order; where orders are dealt out, each has its robot."""
        return not self.dealt_out or order % len(self.motion.home) == r

    def announce_next(self, r: int, order: int) -> None:
        """A robot has done its order; its next one is not one at whose first stop it stands."""
        robots = len(self.motion.home)
        for following in range(order + robots, len(self.next), robots):
            first = self.cell[self.first[following]]
            if not (self.skips and first == self.motion.cell[r]):
                self.announced.append(following)
                return

    def _complete(self, tick: int, r: int, order: int, done: bool) -> None:
        """A stop of an order is said to be done; `done`: whether it is."""
        if not done:
            text = f"does a stop of order {order} without standing there, or not for long enough"
            self.report_violation("visit", [r], self.motion.cell[r], text)
            if not self.belong_to(order) or self.is_over(order):
                return
        self.done[self.next[order]] = tick
        self.next[order] += 1
        self.count += 1
        if self.trips.of_lines:
            self.loads.undelivered -= self.trips.finish_stop(tick, r, order)
        elif self.trips.there:
            self.trips.over[order] += 1

    def serve(self, tick: int, r: int, ticks: int) -> None:
        """A robot begins what it does at the next stop of its order."""
        order = self.loads.order[r]
        if not self._is_at_stop(r) or ticks < 1 or ticks != self.lasts(order):
            text = f"is said to be served for {ticks} ticks at a stop where it is not for so long"
            self.report_violation("visit", [r], self.motion.cell[r], text)
            return
        self.served[r] = tick + ticks - 1
        if self.trips.there:
            self.trips.serve(tick, r, order, ticks, self.next[order] - self.first[order])
        if not self.has_load[order]:
            self.loads.state[order] = ORDER_STARTED

    def _is_at_stop(self, r: int) -> bool:
        """Whether a robot stands at the next stop of its order, with the load if there is one."""
        order = self.loads.order[r]
        if not self.is_at_stop(r, order):
            return False
        return not self.has_load[order] or self.loads.load[r] == order

    def _has_done_stop(self, tick: int, r: int) -> bool:
        if self.loads.status[r] >= STATUS_DEPLETED:
            return False  # one that is down does nothing
        picks = self.loads.picking.get(r, NIL) > tick
        return self._is_at_stop(r) and self.is_done_by(tick, r, self.loads.order[r], picks)

    def visit(self, tick: int, rows: Rows) -> None:
        """Carry out the stops that are done at the end of a tick; the recording has all of them."""
        at = self.motion.cell
        standing = {
            r for r in self.touring if at[r] in self._places and self._has_done_stop(tick, r)
        }
        visiting: set[int] = set()
        for _, code, subject, value in rows:
            if code == CHANGE_VISITED and self.loads.exists(code, subject, value):
                if subject in visiting:
                    text = "does two stops in one tick"
                    self.report_violation("visit", [subject], self.motion.cell[subject], text)
                self._do_stop(tick, subject, value)
                visiting.add(subject)
            elif (
                code == CHANGE_ORDER_RESERVED
                and value == NIL
                and self.loads.exists(code, subject, value)
            ):
                self.loads.reserve_order(subject, value)
            else:
                text = f"a change among stops: {code} {subject} {value}"
                self.report_violation("record", [], NIL, text)
        for r in sorted(standing - visiting):
            text = f"stands at a stop of order {self.loads.order[r]}, which is not recorded as done"
            self.report_violation("visit", [r], self.motion.cell[r], text)

    def _do_stop(self, tick: int, r: int, order: int) -> None:
        if self.loads.by[order] != r or self.loads.order[r] != order:
            text = f"does a stop of order {order} that it has not"
            self.report_violation("visit", [r], self.motion.cell[r], text)
        self._complete(tick, r, order, self._has_done_stop(tick, r))
        self.served.pop(r, None)
        self.motion.parked[r] = False  # it may have stood there, and did nothing else
        if self.has_load[order]:
            return
        self.loads.state[order] = ORDER_STARTED
        if self.is_over(order):
            self.loads.state[order] = ORDER_DELIVERED
            self.loads.undelivered -= 1
            if self.dealt_out:
                self.announce_next(r, order)
