"""When an order is due and how late it is, in words."""

from __future__ import annotations

from automaton.engine.state import NEVER, ORDER_DELIVERED, Orders
from automaton.scenario.quantities import Scale, clock_text
from automaton.units import duration, number, ticks_and_time


def has_due_time(orders: Orders, order: int) -> bool:
    """Whether an order has a due time."""
    return int(orders.due[order]) != NEVER


def ticks_late(orders: Orders, order: int, now: int) -> int:
    """Ticks from when an order was due until it was delivered, or now; below 0: it is due later."""
    done = int(orders.state[order]) == ORDER_DELIVERED
    return (int(orders.delivered[order]) if done else now) - int(orders.due[order])


def tick_in_words(tick: int, scale: Scale) -> str:
    """What follows a tick: " (10 min, 06:10)" where a tick is a time and there is a clock, or nothing."""
    unit = scale.unit
    if unit.seconds is None:
        return ""
    value, name = duration(tick, unit)
    times = [f"{number(value)} {name}"]
    if scale.clock is not None:
        times.append(clock_text(scale.clock, tick * scale.tick_seconds))
    return f" ({', '.join(times)})"


def lateness_words(orders: Orders, order: int, now: int, scale: Scale) -> str:
    """Say "late by 20 ticks (10 s)", "in 5 ticks (2.5 s)", or "done in time"."""
    late = ticks_late(orders, order, now)
    if late > 0:
        return f"late by {ticks_and_time(late, scale.unit)}"
    if int(orders.state[order]) == ORDER_DELIVERED:
        return "done in time"
    return f"in {ticks_and_time(-late, scale.unit)}" if late else "now"


def due_words(orders: Orders, order: int, now: int, scale: Scale, what: str = "order") -> str:
    """Say when an order, or a trip, is due, and how late it is: "order 3 is due in tick 40: now"."""
    due = int(orders.due[order])
    late = lateness_words(orders, order, now, scale)
    return f"{what} {order} is due in tick {due:,}{tick_in_words(due, scale)}: {late}"
