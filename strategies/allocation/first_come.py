"""First come, first served: a free robot takes the order that has waited longest.

Orders are numbered in the order in which they come, so the oldest is the one of the lowest number.
The robot carries it to its own target.
"""

import numpy as np

from automaton.strategy.kernels import kernel
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.state import NIL, PARK, PERIODIC, PICKED
from strategies.allocation.independent import deliver, take_order
from strategies.allocation.open_orders import is_open


@kernel
def oldest_order(view, given):
    """The open order of the lowest number, NIL if there is none."""
    for order in range(view.orders.state.shape[0]):
        if is_open(view, given, order):
            return order
    return NIL


@kernel
def decide(view, asked, answers, memory, space):
    given = answers.allocation
    for k in range(asked.count[0]):
        i = np.int64(asked.robot[k])
        if asked.reason[k] == PICKED:
            deliver(view, given, k, i)
        elif asked.reason[k] != PERIODIC:
            order = oldest_order(view, given)
            if order == NIL:
                given.verb[k] = PARK
            else:
                take_order(view, given, k, order)


class FirstCome(Strategy):
    """Every robot takes the oldest unreserved order and carries it to its destination."""

    layer = "allocation"
    compiled = decide

    def reset(self, view):
        return memory_of(view)
