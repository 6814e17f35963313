"""The contract of a strategy: a layer, parameters, `reset`, and `decide` in one of two forms.

compiled     a kernel (module-level, decorated with `kernel`) that the loop calls directly
decide       a Python method for which the compiled loop returns to Python

Both get the same arguments: the view (read-only), the batch, the decisions (which start as KEEP),
the strategy's own memory, and the workspace of the searches. A strategy declares its state as a
struct, and `reset` makes it; `State.of(memory)` is this state in both forms. Fields whose first
extent is n have a row per robot: with a radius a robot sees its own row, and zeros elsewhere.

With `period` = k a layer is also asked in every k-th tick about robots without an event; their
reason is REASON_PERIODIC, and KEEP means that they continue. For zoning, charging and allocation
these are all robots; for right of way, robots that are free to act; for routing, robots on their
way: they have a goal cell where they do not arrive now, no pending route request, and no retreat or
TRY_DROP to do first. They may turn, wait or be in the middle of a long move: a new route replaces
the rest of the old one when that ends. It begins in `position(view, robot)`, in a long move the
cell that the robot enters.

If robot types have allocations of their own, each allocation is asked only about its robots, one
after another; `batch.strategy` is its number, and `view.rules.allocation` has the number for each
type. A charging strategy with `watches_chargers` is also asked about idle robots as soon as a place
at a charger is free.

A strategy declares its properties as attributes of its class or of its Parameters: `steers` (right
of way), `avoids_traffic`, `searches_by_astar`, `takes_shortest_routes` (routing), `keeps_way_back`
(charging); see automaton.strategy.lookup. Warnings, metrics and defaults depend on these, for
plug-ins as for shipped strategies.

A right of way that steers (`steers` = True) is asked in every tick (`period` = 1) about all robots
that are free. It answers CMD_GO with a direction, CMD_TURN, CMD_HOLD, or KEEP for a robot that is to
begin its task at its goal cell. Then robots have no routes, and routing is not asked.
"""

from __future__ import annotations

import inspect
import linecache
import re
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, ClassVar

import msgspec

from automaton.engine.decisions import Decisions
from automaton.engine.jit.compile_progress import COMPILING
from automaton.engine.jit.kernel import first_class, jit_is_on
from automaton.engine.jit.structs import Struct
from automaton.engine.state import Batch, Memory, Workspace, World
from automaton.errors import InputError, nearest
from automaton.strategy.lookup import NoParameters

WaitRanges = tuple[int, int, int, int, int]


class NoState(Struct):
    """The empty state of a strategy without memory."""


class Strategy:
    """The base of all strategies; a subclass names its layer and defines `compiled` or `decide`.

        class Keep(automaton.Strategy):
            layer = "allocation"

            def decide(self, view, batch, decisions, memory, workspace):
                print(view.clock.tick, batch.robot[: batch.count])


        automaton.Simulation("tabletop-mini", strategies={"allocation": Keep}).step(5)

    The arguments and the possible decisions: [the contract](strategy-contract.md).
    """

    layer: ClassVar[str]
    Parameters: ClassVar[type[msgspec.Struct]] = NoParameters
    compiled: ClassVar[Callable[..., None] | None] = None
    # metric -> field of the state with one number per robot; the metric is their sum
    counters: ClassVar[Mapping[str, str]] = {}
    period: int = 0  # it is also asked every `period` ticks (above); 0 = only on events
    holders: bool = False  # it looks up robots by cell: traffic.holder is filled while it is asked

    def __init_subclass__(cls) -> None:
        # A `decide` in a subclass of a compiled strategy replaces the kernel.
        if "decide" in cls.__dict__ and "compiled" not in cls.__dict__:
            cls.compiled = None

    # charging: it is also asked about idle robots when a place at a charger is free
    watches_chargers: bool = False
    steers: bool = False  # right of way: decides each move of robots, which have no routes

    # the other strategies of the run, by layer; set before reset
    other_layers: Mapping[str, Strategy] = {}

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


# Input of strategies to compiled code is checked here, once: kernels do not check indices.


MAX_WAIT_TICKS = 10_000  # the longest wait, in ticks


def check_decides(strategy: Strategy) -> None:
    """Raises InputError for a class without decisions: usually `decide` is misspelt."""
    kind = type(strategy)
    if kind.compiled is None and kind.decide is Strategy.decide:
        names = [name for name in vars(kind) if not name.startswith("_")]
        raise _fault(strategy, f"it has no method decide{nearest('decide', names)}")


def checked_state(strategy: Strategy, state: Any, view: World) -> Struct:
    """The state that `reset` returned. Raises InputError if it does not fit this fleet."""
    robots = len(view.robots.cell)
    if not isinstance(state, Struct):
        raise _fault(
            strategy, f"reset() must return a state, which is a Struct; it returned {state!r}"
        )
    if not state.is_open:
        raise _fault(
            strategy, "reset() must return a state of its own; it returned one of the world"
        )
    counted = []
    for name, declared, array in state.arrays():
        if declared.is_per_robot:
            if len(array) != robots:
                rows = f"it has {len(array)} rows for {robots} robots"
                raise _fault(strategy, f"{name} must have one row per robot; {rows}")
            counted += [name] * (len(declared.extents) == 1)
        elif view.rules.radius > 0 and declared.is_kept and array.any():
            raise _fault(
                strategy,
                f"{name} has values, but not one row per robot: with information.radius it "
                f"would be zero in every call; declare it with role=CONSTANT",
            )
    for name, field in strategy.counters.items():
        if field not in counted:
            fields = f"these are {', '.join(counted) or 'none'}; found {field!r}"
            kind = type(state).__name__
            raise _fault(
                strategy,
                f"counter {name!r} must name a field of {kind} with one number per robot: {fields}",
            )
    return state


def check_counters(strategy: Strategy, reserved: Collection[str]) -> None:
    """Raises InputError for a counter with the name of a built-in metric."""
    for name in strategy.counters:
        if name in reserved:
            raise _fault(strategy, f"counter {name!r}: a built-in metric has this name; rename it")


def checked_wait_ranges(strategy: Strategy) -> tuple[int, ...]:
    """The result of `wait_ranges`. Raises InputError if a range is empty or a number out of bounds."""
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
            f"1 <= from <= to <= {MAX_WAIT_TICKS:,} and 1 <= retries <= 256; it gave {waits!r}",
        )
    return waits


def checked_period(strategy: Strategy) -> int:
    """The period of the strategy. Raises InputError if it is not a number of ticks."""
    period = strategy.period
    if not isinstance(period, int) or not 0 <= period < 2**31:
        raise _fault(strategy, f"period must be a number of ticks, 0 for never; found {period!r}")
    return period


def _fault(strategy: Strategy, text: str) -> InputError:
    return InputError(f"{strategy.layer} strategy {type(strategy).__name__}: {text}")


# Compile a strategy's kernel to a function with the signature that the loop calls.


ARGUMENTS = ("view", "batch", "decisions", "memory", "workspace")
_COMPILED: dict[Any, Any] = {}


def compiled_decide(function: Callable[..., None], signature: Any) -> Any:
    """Compile `function` for the loop's signature, once per process.

    Raises InputError, one sentence with file and line, if it does not fit or does not compile.
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
        if allocation := _allocation_in(str(error)):
            raise InputError(allocation) from error
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        told = next(
            (line for line in lines if "Error" not in line and "pipeline" not in line), lines[0]
        )
        where = next((line for line in lines if line.startswith("File ")), "")
        raise InputError(
            f"{place}: the strategy does not compile: {told} {where}".strip()
        ) from error


# What Numba says, as kernels have no allocator; the second one about arrays that NumPy returns.
NO_ALLOCATOR = re.compile(
    "NRT required but not enabled|(?s:Overload in function.*)Only accept returning of array"
)
PLACE_IN_MESSAGE = re.compile(r" at (\S.*?) \((\d+)\)$", re.MULTILINE)


def _allocation_in(message: str) -> str:
    """Return the sentence about a kernel that allocates, from Numba's message; "" if none does.

    The message names the places from the innermost call outwards, those inside Numba included.
    """
    import numba

    inside = str(Path(numba.__file__).parent)
    places = PLACE_IN_MESSAGE.findall(message) if NO_ALLOCATOR.search(message) else []
    for file, line in places:
        if not file.startswith(inside):
            what = _expression_of(file, int(line))
            text = f"{file}:{line}: kernels may not allocate; line {line}: {what}"
            return f"{text}; keep arrays in the state of the strategy"
    return ""


def _expression_of(file: str, line: int) -> str:
    """Return what allocates in a line of source: the function that it calls, or the line itself."""
    text = linecache.getline(file, line).strip()
    called = re.search(r"\bnp(\.\w+)+(?=\()", text)
    return called[0] if called else text
