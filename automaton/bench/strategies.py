"""Strategies that decide nothing: what is left is the cost of asking them."""

from __future__ import annotations

from automaton.compiled import kernel
from automaton.strategy.layer import Strategy
from automaton.world.state import Answers, Asked, Memory, Workspace, World


@kernel
def decide_nothing(
    view: World, asked: Asked, answers: Answers, memory: Memory, space: Workspace
) -> None:
    """Every answer stays KEEP."""


class Idle(Strategy):
    """No robot ever gets an order."""

    layer = "allocation"
    compiled = decide_nothing


class EveryTick(Strategy):
    """Asked every tick inside the loop, and keeps everything as it is."""

    layer = "zoning"
    compiled = decide_nothing
    every = 1


class EveryTickInPython(Strategy):
    """Asked every tick outside the loop, and keeps everything as it is."""

    layer = "zoning"
    every = 1

    def decide(
        self, view: World, asked: Asked, answers: Answers, memory: Memory, space: Workspace
    ) -> None:
        """Every answer stays KEEP."""
