"""What the inspector says about the due time of an order."""

from __future__ import annotations

from automaton.engine.state import NIL
from automaton.history.explanation import (
    has_due_time,
    lateness_words,
    tick_in_words,
    ticks_late,
)
from tui.playback.panel_view import View
from tui.widgets.styled_lines import Span, tick_link


def due_facts(view: View, order: int) -> list[str | Span]:
    """When an order is due, in ticks and in time, and how late it is; nothing without a due time."""
    orders, now = view.snapshot.orders, view.snapshot.tick
    if order == NIL or not has_due_time(orders, order):
        return []
    scale, due = view.run.resolved.scenario.units.scale, int(orders.due[order])
    look = "warn" if ticks_late(orders, order, now) > 0 else "plain"
    return [
        tick_link(due),
        f"{tick_in_words(due, scale)}: ",
        Span(lateness_words(orders, order, now, scale), look),
    ]
