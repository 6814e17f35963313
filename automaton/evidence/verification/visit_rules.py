"""The rules of stops: a robot does the next one of its order when a tick leaves it standing there.

Where a stop takes time, the robot does SERVE there for so long, and the stop is done in its last tick.
One stop by a robot in a tick; of an order with a load, between pick and drop. What is recorded must be
all of them, and no others. Positions are those of the validator's own replay.
"""

from __future__ import annotations

from typing import Any, Final

from automaton.evidence.verification.motion_rules import Complaint, Motion

NIL: Final = -1


class Visits:
    """The stops of all orders, and which of them are done."""

    def __init__(self, header: dict[str, Any], motion: Motion, report_violation: Complaint) -> None:
        self.motion = motion
        self.report_violation = report_violation
        stops = header.get("stops")
        self.cell: list[int] = [] if stops is None else stops["cell"].tolist()
        self.ticks: list[int] = [] if stops is None else stops["ticks"].tolist()
        source = header["orders"]["source"].tolist()
        self.has_load: list[bool] = [slot != NIL for slot in source]
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
        return NIL if self.is_over(order) else self.ticks[self.next[order]]

    def is_over(self, order: int) -> bool:
        """Whether all stops of an order are done."""
        return self.next[order] >= self.first[order + 1]

    def is_at_stop(self, r: int, order: int) -> bool:
        """Whether a robot stands in the next stop of an order; one in a long move does not."""
        if order == NIL or not self.belong_to(order) or self.is_over(order):
            return False
        cell = self.motion.cell[r]
        entering = self.motion.claim.get(r, (cell, 0))[0]
        return self.cell[self.next[order]] == cell == entering

    def is_done_by(self, tick: int, r: int, order: int, picks: bool) -> bool:
        """Whether a tick leaves a robot at the next stop of an order for as long as that takes.

        `picks`: it picks its load up in this tick and the next ones.
        """
        if not self.is_at_stop(r, order):
            return False
        if self.lasts(order):
            return self.served.get(r) == tick
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

    def visit(self, tick: int, r: int, order: int, done: bool) -> None:
        """A stop of an order is said to be done; `done`: whether it is."""
        if not done:
            text = f"does a stop of order {order} without standing there, or not for long enough"
            self.report_violation("visit", [r], self.motion.cell[r], text)
            if not self.belong_to(order) or self.is_over(order):
                return
        self.done[self.next[order]] = tick
        self.next[order] += 1
        self.count += 1
