"""Which orders a robot may take."""

from automaton.engine.state import NIL, ORDER_WAITING
from automaton.strategy.kernels import kernel


@kernel
def is_open(view, out, order):
    """Whether an order waits, unreserved, and no earlier decision of this batch took it."""
    return (
        view.orders.state[order] == ORDER_WAITING
        and view.orders.reserved_by[order] == NIL
        and out.order_taken[order] == 0
    )
