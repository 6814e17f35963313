"""Strategies that decide nothing, to measure the cost of asking them."""

from __future__ import annotations

from automaton.engine.decisions import Decisions
from automaton.engine.jit.kernel import kernel
from automaton.engine.state import Batch, Memory, Workspace, World
from automaton.strategy.contract import Strategy


@kernel
def decide_nothing(
    view: World, batch: Batch, decisions: Decisions, memory: Memory, workspace: Workspace
) -> None:
    """Every decision stays KEEP."""


class Idle(Strategy):
    """No robot ever gets an order."""

    layer = "allocation"
    compiled = decide_nothing


class EveryTick(Strategy):
    """Asked every tick inside the loop; changes nothing."""

    layer = "zoning"
    compiled = decide_nothing
    period = 1


class EveryTickInPython(Strategy):
    """Asked every tick outside the loop; changes nothing."""

    layer = "zoning"
    period = 1

    def decide(
        self, view: World, batch: Batch, decisions: Decisions, memory: Memory, workspace: Workspace
    ) -> None:
        """Every decision stays KEEP."""
