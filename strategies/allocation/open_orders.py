"""Which orders a robot may take."""

from automaton.strategy.kernels import kernel
from automaton.world.state import NIL, WAITING


@kernel
def is_open(view, given, order):
    """Whether an order waits, unreserved, and no earlier answer of this batch took it."""
    return (
        view.orders.state[order] == WAITING
        and view.orders.by[order] == NIL
        and given.order_taken[order] == 0
    )
