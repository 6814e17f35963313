"""The tutorial: how to write a strategy in plain Python.

It decides exactly as `independent` does (equal digests, tested), in tens of microseconds a
decision. The loop asks it with a batch of robots and goes on with its decisions; whatever is not
decided stays as it was. A compiled strategy has the same shape: replace `decide` by a kernel.
"""

from automaton.engine.state import (
    CMD_DROP_AT,
    CMD_PARK,
    CMD_TAKE_ORDER,
    NIL,
    ORDER_WAITING,
    REASON_ORDER_RETURNED,
    REASON_PERIODIC,
    REASON_PICKED,
    REASON_SERVED,
)
from automaton.strategy import paths
from automaton.strategy.layer import Strategy


class IndependentPython(Strategy):
    """Every robot takes the nearest unreserved order and carries it to its destination."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        out = decisions.allocation
        taken = set()  # orders that earlier robots of this batch took
        for k in range(batch.count[0]):
            robot, reason = batch.robot[k], batch.reason[k]
            if reason in (REASON_PICKED, REASON_SERVED):  # where does the load go?
                slot = view.orders.target[view.robots.load[robot]]
                out.command[k] = CMD_DROP_AT
                out.slot[k] = slot
                out.goal_cell[k] = paths.dropoff_cell(view, robot, slot)
            elif reason != REASON_PERIODIC:
                order = self.nearest(view, workspace, robot, taken, reason == REASON_ORDER_RETURNED)
                if order is None:
                    out.command[k] = CMD_PARK
                    continue
                taken.add(order)
                out.command[k] = CMD_TAKE_ORDER
                out.order[k] = order
                slot = view.orders.current_slot[order]
                out.goal_cell[k] = paths.pickup_cell(view, robot, slot)

    def nearest(self, view, workspace, robot, taken, around):
        orders = [
            order
            for order in range(len(view.orders.state))
            if view.orders.state[order] == ORDER_WAITING
            and view.orders.reserved_by[order] == NIL
            and order not in taken
            and paths.can_do(view, robot, order)
        ]
        highest = max((view.orders.priority[order] for order in orders), default=0)
        orders = [order for order in orders if view.orders.priority[order] == highest]
        access_cells = [
            paths.pickup_cell(view, robot, view.orders.current_slot[order]) for order in orders
        ]
        found = paths.nearest(view, workspace, robot, access_cells, around) if around else None
        if found is None:  # or if nothing is reachable around the other robots
            found = paths.nearest(view, workspace, robot, access_cells)
        return None if found is None else orders[found]
