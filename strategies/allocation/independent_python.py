"""The tutorial: how to write a strategy in plain Python.

It decides exactly as `independent` does (equal digests, tested), in tens of microseconds a
decision. The loop asks it with a batch of robots and goes on with its decisions; whatever is not
decided stays as it was. A compiled strategy has the same shape: replace `decide` by a kernel.
"""

from automaton.engine.state import CMD_PARK, REASON_ORDER_RETURNED, REASON_PERIODIC
from automaton.strategy import orders, paths
from automaton.strategy.layer import Strategy


class IndependentPython(Strategy):
    """Every robot takes the nearest unreserved order and carries it to its destination."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        out = decisions.allocation
        for k in range(batch.count[0]):
            robot, reason = batch.robot[k], batch.reason[k]
            if orders.asks_for_place(reason):
                orders.place_load(view, out, workspace, k, robot)
            elif reason != REASON_PERIODIC:
                order = self.nearest(view, out, workspace, robot, reason == REASON_ORDER_RETURNED)
                if order is None:
                    out.command[k] = CMD_PARK
                else:
                    orders.take(view, out, k, robot, order)

    def nearest(self, view, out, workspace, robot, around):
        found = orders.list_open(view, out, robot)
        highest = max((view.orders.priority[order] for order in found), default=0)
        found = [order for order in found if view.orders.priority[order] == highest]
        cells = [orders.begin_cell(view, robot, order) for order in found]
        first = paths.nearest(view, workspace, robot, cells, around) if around else None
        if first is None:  # or if nothing is reachable around the other robots
            first = paths.nearest(view, workspace, robot, cells)
        return None if first is None else found[first]
