"""The least time that a task takes: both legs driven on the empty floor."""

from automaton.compiled import kernel
from automaton.kernels.search import FAR, distance
from automaton.world.state import NIL


@kernel
def least_drives(view, space, which, out):
    """out[order] = least ticks of driving for each order in `which`: to its source, to its target.

    The first leg begins in the cell where the order was taken. Of several cells from which a slot
    is served, and of several headings, the best counts; FAR if there is no way.
    """
    access = view.slots.access
    for k in range(which.shape[0]):
        order = which[k]
        source, target = view.orders.source[order], view.orders.target[order]
        best = FAR
        for p in range(4):
            if access[source, p] == NIL:
                continue
            before = least(view, space, view.orders.dispatched_from[order], access[source, p])
            for d in range(4):
                if access[target, d] != NIL:
                    after = least(view, space, access[source, p], access[target, d])
                    best = min(best, before + after)
        out[order] = best


@kernel
def least(view, space, start, end):
    """Least ticks from a cell to another, whatever the heading at the start."""
    best = FAR
    for heading in range(view.grid.headings):
        best = min(best, distance(view, space, start, heading, end))
    return best
