"""Warn about due times that are legal but probably mistakes."""

from __future__ import annotations

import numpy as np

from automaton.scenario.orders import has_due_times, line_column, listed_lines
from automaton.units import count
from automaton.world.resolve import Resolved


def due_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence for each warning."""
    return [text for text in (due_too_early(resolved), nothing_due(resolved)) if text]


def due_too_early(resolved: Resolved) -> str:
    """Warn about orders that are due before they are released, which real files have."""
    if resolved.orders_of_file:
        return ""  # its rows are warned of by their lines
    orders = resolved.scenario.orders
    lines = listed_lines(orders)
    key, what = ("orders.lines", "line") if lines else ("orders.list", "order")
    times = [(one.due_tick, one.release) for one in orders.listed or ()]
    early = [
        number for number, (due, release) in enumerate(times) if due is not None and due < release
    ]
    early += np.flatnonzero(line_column(lines, "due") < line_column(lines, "release")).tolist()
    if not early:
        return ""
    if len(early) == 1:
        return f"{key}[{early[0]}] is due before it is released, and so late at once"
    return (
        f"{count(len(early), what)} are due before they are released, and so late at once; the first "
        f"of them is {key}[{early[0]}]"
    )


def nothing_due(resolved: Resolved) -> str:
    """Warn about an allocation that goes by due times where no order has one."""
    ways = {getattr(choice.parameters, "by", None) for choice in resolved.allocations}
    if "due" not in ways or has_due_times(resolved.scenario.orders):
        return ""
    return (
        "strategy.allocation goes by due times (by: due), and no order has one, so the order that was "
        "released first comes first; give orders of orders.list, or of a file, a due time"
    )
