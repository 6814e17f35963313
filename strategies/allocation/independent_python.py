"""The tutorial: how to write a strategy in plain Python.

It decides exactly as `independent` does (equal digests, tested), in tens of microseconds a decision.
The loop asks it with a batch of robots and goes on with its answers; whatever is not answered stays
as it was. A compiled strategy has the same shape: replace `decide` by a kernel.
"""

from automaton.strategy import paths
from automaton.strategy.layer import Strategy
from automaton.world.state import NIL, PARK, PERIODIC, PICKED, RELEASED, SET_DOWN, TAKE, WAITING


class IndependentPython(Strategy):
    """Every robot takes the nearest unreserved order and carries it to its destination."""

    layer = "allocation"

    def decide(self, view, asked, answers, memory, space):
        given = answers.allocation
        taken = set()  # orders that earlier robots of this batch took
        for k in range(asked.count[0]):
            robot, reason = asked.robot[k], asked.reason[k]
            if reason == PICKED:  # the pick has begun: where does the load go?
                slot = view.orders.target[view.robots.load[robot]]
                given.verb[k] = SET_DOWN
                given.slot[k] = slot
                given.stand[k] = self.beside(
                    view, robot, slot, (2, 0, 3, 1)
                )  # the left if possible
            elif reason != PERIODIC:
                order = self.nearest(view, space, robot, taken, reason == RELEASED)
                if order is None:
                    given.verb[k] = PARK
                    continue
                taken.add(order)
                given.verb[k] = TAKE
                given.order[k] = order
                given.stand[k] = self.beside(view, robot, view.orders.place[order], (0, 2, 1, 3))

    def nearest(self, view, space, robot, taken, around):
        orders = [
            order
            for order in range(len(view.orders.state))
            if view.orders.state[order] == WAITING
            and view.orders.by[order] == NIL
            and order not in taken
            and paths.can_do(view, robot, order)
        ]
        stands = [
            self.beside(view, robot, view.orders.place[order], (0, 2, 1, 3)) for order in orders
        ]
        found = paths.nearest(view, space, robot, stands, around) if around else None
        if found is None:  # or if nothing is reachable around the other robots
            found = paths.nearest(view, space, robot, stands)
        return None if found is None else orders[found]

    def beside(self, view, robot, slot, directions):
        """The cell from which a robot serves a slot: the first neighbour where it gets to."""
        access, usable = view.slots.access[slot], paths.stands_of(view, robot, slot)
        return next(access[d] for d in directions if access[d] in usable)
