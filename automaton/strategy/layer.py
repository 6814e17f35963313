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
after another; `batch.strategy[0]` is its number, `view.rules.allocation` that of each type. A charging
strategy with `watches_chargers` is also asked about idle robots as soon as a place at a charger is free.

A right of way that steers (`steers` = True) is asked in every tick (`period` = 1) about all robots
that are free. It answers CMD_GO with a direction, CMD_HOLD, or KEEP for what a robot came for at its
goal cell. Then robots keep no routes, and routing is not asked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import msgspec

from automaton.engine.jit.structs import Struct
from automaton.engine.state import Batch, Decisions, Memory, Workspace, World
from automaton.strategy.entry import NoParameters

WaitRanges = tuple[int, int, int, int, int]


class NoState(Struct):
    """The state of a strategy that remembers nothing."""


class Strategy:
    """What every strategy is; a subclass names its layer and gives `compiled` or `decide`."""

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
