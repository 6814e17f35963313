"""The contract of a strategy: a layer, parameters, `reset`, and `decide` in one of two forms.

compiled     a kernel (module-level, decorated with `kernel`) that the loop calls directly
decide       a Python method that the loop leaves for, and comes back from

Both get the same arguments: the view (read-only), the batch, the decisions (which start as KEEP),
the strategy's own memory, and the workspace of the searches. What a strategy remembers it declares
as a struct, and `reset` makes it; `State.of(memory)` is this state in both forms. Fields whose first
extent is n have a row for each robot: under a radius a robot sees its own row, and zeros elsewhere.

With `period` = k a layer is also asked in every k-th tick, about robots that nothing concerns; their
reason is REASON_PERIODIC, and KEEP lets them go on. These are: all robots (zoning, charging, allocation);
robots that are free to act (right of way); robots on their way (routing), that is, with a goal cell
that their drive does not end in now, no route being asked for, and no retreat or TRY_DROP to do
first. They may turn, wait or be in the middle of a long move: a new route replaces the rest of the
old one when that is over. It begins in `position(view, robot)`, in a long move the cell that it
enters.

Where types of robots have allocations of their own, each of these is asked about its robots alone, one
after another; `batch.strategy` is its number, `view.rules.allocation` that of each type. A charging
strategy with `watches_chargers` is also asked about idle robots as soon as a place at a charger is free.

What others ask of a strategy that they do not know, it declares, as an attribute of its class or of its
Parameters: `steers` (right of way), `avoids_traffic`, `searches_by_astar`, `takes_shortest_routes`
(routing), `keeps_way_back` (charging); see automaton.strategy.lookup. Warnings, metrics and defaults
follow from these, for plug-ins as for what is shipped.

A right of way that steers (`steers` = True) is asked in every tick (`period` = 1) about all robots
that are free. It answers CMD_GO with a direction, CMD_HOLD, or KEEP for what a robot came for at its
goal cell. Then robots keep no routes, and routing is not asked.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping
from typing import Any, ClassVar

import msgspec

from automaton.engine.jit.compile_progress import COMPILING
from automaton.engine.jit.kernel import first_class, jit_is_on
from automaton.engine.jit.structs import Struct
from automaton.engine.state import Batch, Decisions, Memory, Workspace, World
from automaton.errors import InputError, nearest
from automaton.strategy.lookup import NoParameters

WaitRanges = tuple[int, int, int, int, int]


class NoState(Struct):
    """The state of a strategy that remembers nothing."""


class Strategy:
    """What every strategy is; a subclass names its layer and gives `compiled` or `decide`.

        class Keep(automaton.Strategy):
            layer = "allocation"

            def decide(self, view, batch, decisions, memory, workspace):
                print(view.clock.tick, batch.robot[: batch.count])


        automaton.Simulation("tabletop-mini", strategies={"allocation": Keep}).step(5)

    What these arguments hold and what may be decided: [the contract](strategy-contract.md).
    """

    layer: ClassVar[str]
    Parameters: ClassVar[type[msgspec.Struct]] = NoParameters
    compiled: ClassVar[Callable[..., None] | None] = None
    # metric -> field of the state with a number for each robot, summed over robots
    counters: ClassVar[Mapping[str, str]] = {}
    period: int = 0  # it is also asked every `period` ticks (above); 0 = only when concerned
    holders: bool = (
        False  # it looks robots up by cell: while it is asked, traffic.holder is entered
    )

    def __init_subclass__(cls) -> None:
        # A decide written in a subclass of a compiled strategy replaces its kernel.
        if "decide" in cls.__dict__ and "compiled" not in cls.__dict__:
            cls.compiled = None

    # charging: it is also asked about idle robots when a place at a charger is free
    watches_chargers: bool = False
    steers: bool = False  # right of way: robots go where it says in each tick, without routes

    other_layers: Mapping[str, Strategy] = {}  # of the run, by layer; known before reset

    def __init__(self, parameters: Any = None) -> None:
        self.parameters = self.Parameters() if parameters is None else parameters

    def reset(self, view: World) -> Struct:
        """Make the state for a run: a struct of its own class, which `State.of(memory)` finds."""
        return NoState()

    def decide(
        self, view: World, batch: Batch, decisions: Decisions, memory: Memory, workspace: Workspace
    ) -> None:
        """Decide for a batch; unless overridden, everything stays KEEP."""

    def wait_ranges(self) -> WaitRanges:
        """Right of way only: wait range empty, wait range loaded, retries before it is asked."""
        return (1, 1, 1, 1, 1)


# What a strategy hands to compiled code is checked here, once: kernels do not check indices.


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
        if declared.is_per_robot:
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


# A strategy's kernel becomes a function of the one signature that the loop calls.


ARGUMENTS = ("view", "batch", "decisions", "memory", "workspace")
_COMPILED: dict[Any, Any] = {}


def compiled_decide(function: Callable[..., None], signature: Any) -> Any:
    """Compile `function` alone for the loop's signature, once per process.

    Raises InputError, one sentence with the place, when it does not fit or does not compile.
    """
    if not jit_is_on():
        return function
    if function not in _COMPILED:
        _COMPILED[function] = _compile(function, signature)
        COMPILING.finish(function)
    return _COMPILED[function]


def _compile(function: Any, signature: Any) -> Any:
    from numba.core.errors import NumbaError

    plain = getattr(function, "py_func", None)
    if plain is None:
        raise InputError(
            f"strategy kernel {function!r} is not decorated with automaton.strategy.api.kernel"
        )
    place = f"{inspect.getsourcefile(plain)}:{plain.__code__.co_firstlineno}"
    if len(inspect.signature(plain).parameters) != len(ARGUMENTS):
        raise InputError(f"{place}: a compiled decide takes ({', '.join(ARGUMENTS)})")
    try:
        return first_class(function, signature)
    except NumbaError as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        told = next(
            (line for line in lines if "Error" not in line and "pipeline" not in line), lines[0]
        )
        where = next((line for line in lines if line.startswith("File ")), "")
        raise InputError(
            f"{place}: the strategy does not compile: {told} {where}".strip()
        ) from error
