"""Numbers without a unit, in a scenario whose ticks are times: what `check` says they were read as.

read in ticks of 0.5 s: durations.pick 30 (15 s), orders.mean_interarrival_time 60 (30 s)
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from automaton.errors import InputError
from automaton.scenario.document import Document, Keys
from automaton.scenario.quantities import Scale
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import Plan, plan_of
from automaton.units import duration, number

MAX_SHOWN: Final = 12  # keys


def plain_number_line(document: Document, scale: Scale) -> str:
    """The keys whose numbers are ticks other than seconds, each with its first; or ""."""
    try:
        if scale.tick_seconds == 1:
            return ""
    except InputError:  # a tick is not a time
        return ""
    first: dict[str, float] = {}
    for keys, value in _ticks_in(document.data, plan_of(Scenario), ()):
        first.setdefault(".".join(key for key in keys if isinstance(key, str)), value)
    shown = []
    for key, ticks in list(first.items())[:MAX_SHOWN]:
        time, unit = duration(ticks, scale.unit)
        shown.append(f"{key} {number(ticks)} ({number(time)} {unit})")
    if not shown:
        return ""
    more = f" and {len(first) - MAX_SHOWN} more keys" if len(first) > MAX_SHOWN else ""
    return f"read in ticks of {scale.tick}: {', '.join(shown)}{more}"


def _ticks_in(value: Any, plan: Plan, keys: Keys) -> Iterator[tuple[Keys, float]]:
    """The plain numbers above 1 that count ticks, with their keys."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        if plan.place is not None and plan.place.quantity.counted == "tick" and value > 1:
            yield keys, value
    elif isinstance(value, dict):
        for name, inner in value.items():
            following = plan.fields.get(name, plan.values)
            if following is not None:
                yield from _ticks_in(inner, following, (*keys, name))
    elif isinstance(value, list | tuple) and plan.items:
        for index, inner in enumerate(value):
            following = plan.items[min(index, len(plan.items) - 1)]
            yield from _ticks_in(inner, following, (*keys, index))
