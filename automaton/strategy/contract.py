"""What a strategy hands to compiled code is checked here, once: kernels do not check indices."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from automaton.engine.holders import PER_ROBOT
from automaton.engine.jit.structs import Struct
from automaton.engine.state import World
from automaton.errors import InputError, nearest
from automaton.strategy.layer import Strategy

MAX_WAIT_TICKS = 10_000  # ticks of a wait


def check_decides(strategy: Strategy) -> None:
    """Raises InputError for a class that decides nothing: a misspelt `decide`, mostly."""
    kind = type(strategy)
    if kind.compiled is None and kind.decide is Strategy.decide:
        names = [name for name in vars(kind) if not name.startswith("_")]
        raise _fault(strategy, f"it has no method decide{nearest('decide', names)}")


def checked_state(strategy: Strategy, state: Any, view: World) -> Struct:
    """What `reset` returns. Raises InputError if it is not a state for this fleet."""
    robots = len(view.robots.cell)
    if not isinstance(state, Struct):
        raise _fault(strategy, f"reset() must return a state, which is a Struct; found {state!r}")
    if not state.is_open:
        raise _fault(strategy, "reset() must return a state of its own, found one of the world")
    counted = []
    for name, declared, array in state.arrays():
        if declared.extents[0] == PER_ROBOT:
            if len(array) != robots:
                rows = f"found {len(array)} rows for {robots} robots"
                raise _fault(strategy, f"{name} must have a row for each robot, {rows}")
            counted += [name] * (len(declared.extents) == 1)
        elif view.rules.radius > 0 and declared.is_kept and array.any():
            raise _fault(
                strategy,
                f"{name} has values, but no row for each robot: with information.radius it would be "
                "zero in every call; declare it with role=CONSTANT",
            )
    for name, field in strategy.counters.items():
        if field not in counted:
            fields = f"these are {', '.join(counted) or 'none'}; found {field!r}"
            kind = type(state).__name__
            raise _fault(
                strategy,
                f"counter {name!r} must name a field of {kind} with a number for each robot: {fields}",
            )
    return state


def check_counters(strategy: Strategy, reserved: Collection[str]) -> None:
    """Raises InputError for a counter with a name that every run counts under."""
    for name in strategy.counters:
        if name in reserved:
            raise _fault(strategy, f"counter {name!r}: every run counts this itself; rename it")


def checked_wait_ranges(strategy: Strategy) -> tuple[int, ...]:
    """What `wait_ranges` returns. Raises InputError if a range is empty or a number out of bounds."""
    waits = strategy.wait_ranges()
    whole = isinstance(waits, tuple) and len(waits) == 5 and all(isinstance(w, int) for w in waits)
    if (
        not whole
        or not all(1 <= low <= high <= MAX_WAIT_TICKS for low, high in (waits[:2], waits[2:4]))
        or not 1 <= waits[4] <= 256
    ):
        raise _fault(
            strategy,
            "wait_ranges() must give (empty from, to, loaded from, to, retries) with "
            f"1 <= from <= to <= {MAX_WAIT_TICKS:,} and 1 <= retries <= 256, found {waits!r}",
        )
    return waits


def checked_period(strategy: Strategy) -> int:
    """How often the strategy asks to be called. Raises InputError for anything but ticks."""
    period = strategy.period
    if not isinstance(period, int) or not 0 <= period < 2**31:
        raise _fault(strategy, f"period must be a number of ticks, 0 for never; found {period!r}")
    return period


def _fault(strategy: Strategy, text: str) -> InputError:
    return InputError(f"{strategy.layer} strategy {type(strategy).__name__}: {text}")
