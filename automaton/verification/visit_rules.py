"""The rules of stops: a robot does the next stop of its order if it stands there at the end of a
tick.

At a stop that takes time, the robot does SERVE for its duration, and the stop is done in the last
tick of it. A robot does at most one stop per tick; with a load, between pick and drop. The
recording must contain exactly these stops. Positions are those of the validator's own replay.
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
STATUS_DEPLETED: Final = 3  # of a robot: this status and all higher ones mean that it is down


class Holders(Protocol):
    """The orders of robots, whose stops may be done."""

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
    """The stops of all orders, and the completed ones."""

    def __init__(self, header: dict[str, Any], loads: Holders, trips: ReplayedTrips) -> None:
        self.loads, self.trips = loads, trips
        self.motion = loads.motion
        self.report_violation = loads.report_violation
        stops = header.get("stops")
        self.cell: list[int] = [] if stops is None else stops["cell"].tolist()
        self.ticks: list[int] = [] if stops is None else stops["ticks"].tolist()
        self._places = {*self.cell, *trips.cell}  # no stop is done outside these ticks
        source = header["orders"]["source"].tolist()
        self.has_load: list[bool] = [slot != NIL or trips.of_lines for slot in source]
        self.touring: set[int] = set()  # robots with an order that has stops
        self.served: dict[int, int] = {}  # robots in SERVE: the last tick
        orders = len(source)
        first = header["orders"].get("first_stop")
        self.first: list[int] = [0] * (orders + 1) if first is None else first.tolist()
        self.next: list[int] = self.first[:-1]  # the next stop of each order
        self.done = [NIL] * len(self.cell)  # duration of each stop in ticks
        scenario_orders = header["scenario"]["orders"]
        self.dealt_out: bool = scenario_orders.get("assign") == "round-robin"
        self.skips: bool = scenario_orders.get("skip_reached", False)
        self.announced: list[int] = []  # orders released in the next tick
        self.count = 0

    def belong_to(self, order: int) -> bool:
        """Whether an order has stops."""
        return self.first[order] < self.first[order + 1]

    def lasts(self, order: int) -> int:
        """Ticks of the next stop of an order; NIL: no stop is left."""
        if self.trips.of_lines and not self.is_over(order):
            return self.trips.ticks(order, self.next[order] - self.first[order])
        return NIL if self.is_over(order) else self.ticks[self.next[order]]

    def is_over(self, order: int) -> bool:
        """Whether all stops of an order are done."""
        if self.trips.of_lines:
            return self.trips.next_station(order) == NIL
        return self.next[order] >= self.first[order + 1]

    def is_at_stop(self, r: int, order: int) -> bool:
        """Whether a robot stands in the cell of the next stop of an order; a robot in a long move
        does not."""
        if order == NIL or not self.belong_to(order) or self.is_over(order):
            return False
        cell = self.motion.cell[r]
        entering = self.motion.claim.get(r, (cell, 0))[0]
        if self.trips.of_lines:
            return self.trips.cell[self.trips.next_station(order)] == cell == entering
        return self.cell[self.next[order]] == cell == entering

    def is_done_by(self, tick: int, r: int, order: int, picks: bool) -> bool:
        """Whether a robot, at the end of a tick, has been at the next stop of an order for its
        duration.

        `picks`: it picks up its load in this tick and the next ones.
        """
        if not self.is_at_stop(r, order):
            return False
        if self.lasts(order):
            return self.served.get(r) == tick
        if self.trips.there and self.trips.has_break(tick, self.motion.cell[r]):
            return False
        return not picks

    def is_for(self, r: int, order: int) -> bool:
        """Whether a robot may have an order; orders assigned in advance belong to one robot."""
        return not self.dealt_out or order % len(self.motion.home) == r

    def announce_next(self, r: int, order: int) -> None:
        """A robot has done its order; orders at whose first stop it stands are skipped."""
        robots = len(self.motion.home)
        for following in range(order + robots, len(self.next), robots):
            first = self.cell[self.first[following]]
            if not (self.skips and first == self.motion.cell[r]):
                self.announced.append(following)
                return

    def _complete(self, tick: int, r: int, order: int, done: bool) -> None:
        """A stop of an order is recorded as done; `done`: whether it is."""
        if not done:
            text = f"does a stop of order {order} without having been there long enough"
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
        """A robot begins SERVE at the next stop of its order."""
        order = self.loads.order[r]
        if not self._is_at_stop(r) or ticks < 1 or ticks != self.lasts(order):
            text = f"is recorded as served for {ticks} ticks, which is not the duration of its stop"
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
            return False  # a robot that is down does nothing
        picks = self.loads.picking.get(r, NIL) > tick
        return self._is_at_stop(r) and self.is_done_by(tick, r, self.loads.order[r], picks)

    def visit(self, tick: int, rows: Rows) -> None:
        """Apply the stops done at the end of a tick; the recording must have all of them."""
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
                text = f"an invalid change among stops: {code} {subject} {value}"
                self.report_violation("record", [], NIL, text)
        for r in sorted(standing - visiting):
            text = f"stands at a stop of order {self.loads.order[r]}, which is not recorded as done"
            self.report_violation("visit", [r], self.motion.cell[r], text)

    def _do_stop(self, tick: int, r: int, order: int) -> None:
        if self.loads.by[order] != r or self.loads.order[r] != order:
            text = f"does a stop of order {order}, which it does not have"
            self.report_violation("visit", [r], self.motion.cell[r], text)
        self._complete(tick, r, order, self._has_done_stop(tick, r))
        self.served.pop(r, None)
        self.motion.parked[r] = False  # it may have stood there without doing anything else
        if self.has_load[order]:
            return
        self.loads.state[order] = ORDER_STARTED
        if self.is_over(order):
            self.loads.state[order] = ORDER_DELIVERED
            self.loads.undelivered -= 1
            if self.dealt_out:
                self.announce_next(r, order)
