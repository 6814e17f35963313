"""Orders in the queues of a row of four stations: zones {1, 2} and {3, 4}, or one zone each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from automaton.engine.state import NIL, ORDER_WAITING
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.world.resolve import resolve
from strategies.zoning.zone_queues import reassign_orders, share

PAIRS = ((1, 2), (3, 4))
SINGLES = ((1,), (2,), (3,), (4,))


class Queues:
    """Orders that wait at stations `at` in the queues of zones `queue`, bound for stations `to`.

    Stations count from 1, zones from 0; a robot stands at the first station of each zone. `age`:
    ticks that each order has waited. `types`: those of the fleet; `weights` of the orders.
    """

    def __init__(
        self,
        queue: Sequence[int],
        at: Sequence[int],
        to: Sequence[int],
        *,
        age: Sequence[int] = (),
        zones: Sequence[Sequence[int]] = PAIRS,
        types: Sequence[dict[str, Any]] = (),
        weights: Sequence[float] = (),
    ) -> None:
        self.run = Simulation(resolve(row_of_stations(len(queue), zones, types)))
        self.run.run(until=1)  # the zones of the scenario are made
        self.service_zones, orders = self.run.world.service_zones, self.run.world.orders
        slot = [self.service_zones.station_of.tolist().index(k) for k in range(4)]
        orders.state[:], orders.reserved_by[:] = ORDER_WAITING, NIL
        orders.current_slot[:] = [slot[station - 1] for station in at]
        orders.target[:] = self.service_zones.next_slot[:] = [slot[station - 1] for station in to]
        orders.weight[:] = weights or 0
        now = int(self.run.world.clock.tick)
        orders.release_tick[:] = [now - ticks for ticks in age or [0] * len(queue)]
        self.service_zones.queue[:] = queue
        self.out = self.run.decisions.zoning
        self.out.queued = 0

    def shared(self, age: int = 1, job: int = 0) -> tuple[list[int], list[int], int]:
        """Queue and direct flag of each order after a round by these weights, and how many it shared."""
        count = share(self.run.view, self.run.workspace, self.out, age, job)
        return *self._after(), count

    def reassigned(self) -> list[int]:
        """The queue of each order after a reassignment."""
        reassign_orders(self.run.view, self.out, NIL)
        return self._after()[0]

    def _after(self) -> tuple[list[int], list[int]]:
        """Queues and direct flags as the decisions make them."""
        queue = self.service_zones.queue.tolist()
        direct = self.service_zones.skips_transfer.tolist()
        for k in range(int(self.out.queued)):
            order = int(self.out.order[k])
            queue[order], direct[order] = int(self.out.queue[k]), int(self.out.skips_transfer[k])
        return queue, direct


def row_of_stations(
    orders: int, zones: Sequence[Sequence[int]], types: Sequence[dict[str, Any]]
) -> Scenario:
    """A scenario with so many orders, which a test puts where it wants them."""
    return msgspec.convert(
        {
            "name": "row",
            "layout": {"picture": "t=t=t=t"},
            "fleet": {
                "robots": len(zones),
                "kinematics": "omni",
                "start": [[2 * (zone[0] - 1), 0] for zone in zones],
                "types": list(types),
            },
            "orders": {"parts": [{"route": [1, 4], "count": orders}], "processing_time": 1},
            "strategy": {
                "zoning": {
                    "name": "static",
                    "design": {"zones": [{"stations": list(zone)} for zone in zones]},
                },
                "allocation": "shortest-job",
                "right_of_way": "wait",
            },
            "stop": {"when": "never", "max_duration": 100},
        },
        Scenario,
    )
