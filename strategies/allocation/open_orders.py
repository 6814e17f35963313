"""Which orders a robot may take."""

from automaton.strategy.kernels import kernel
from automaton.world.state import NIL, ORDER_WAITING


@kernel
def is_open(view, out, order):
    """Whether an order waits, unreserved, and no earlier decision of this batch took it."""
    return (
        view.orders.state[order] == ORDER_WAITING
        and view.orders.reserved_by[order] == NIL
        and out.order_taken[order] == 0
    )
