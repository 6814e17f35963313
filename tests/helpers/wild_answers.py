"""Strategies that answer with any number anywhere: what a broken or hostile plug-in may do.

Each writes into every field of its layer's answers, about robots that were asked and others, numbers
that are usual for the field, numbers just outside, and any number at all.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import msgspec
import numpy as np

from automaton.strategy.api import KEEP, Strategy, Struct

ANSWERS: Counter[str] = Counter()  # given in this process, by layer
EDGES = (0, 1, -1, 2, 3, -2, 4, 255, 256, -32769, 32768, 65536, 10**8, -(10**8), KEEP, 2**31 - 1)


class Wildness(msgspec.Struct, frozen=True):
    """How wild: shares of all fields, the seed of the draws, and how often all robots are asked."""

    seed: int = 1
    share: float = 0.5  # of the fields that are written in a call
    every: int = 1


class Wild(Strategy):
    """Writes anything anywhere."""

    Parameters = Wildness

    def __init__(self, parameters: Wildness | None = None) -> None:
        super().__init__(parameters)
        self.period = self.parameters.every

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        ANSWERS[self.layer] += int(batch.count)
        tick, phase = int(view.clock.tick), int(batch.robot[0])
        draws = np.random.default_rng([self.parameters.seed, tick, phase, len(self.layer)])
        small = [len(view.robots.cell), len(view.orders.state), len(view.grid.cell_flags)]
        self.fill(getattr(decisions, self.layer), draws, small)

    def fill(self, out: Struct, draws: Any, small: list[int]) -> None:
        for name in out._fields:
            field = out.array(name)
            if isinstance(field, Struct):
                self.fill(field, draws, small)
                continue
            field = np.atleast_1d(field)  # the same memory
            if field.size and draws.random() < self.parameters.share:
                field[...] = self.numbers(field, draws, small)

    def numbers(self, field: Any, draws: Any, small: list[int]) -> Any:
        """As many numbers as the field has, of one kind."""
        kind = draws.integers(5)
        if kind == 0:
            found = draws.integers(-(2**31), 2**31, field.shape)
        elif kind == 1:
            found = draws.choice(EDGES, field.shape)
        elif kind == 2:
            found = np.full(field.shape, draws.choice(EDGES))
        elif kind == 3:  # lengths of arrays, and one beyond
            found = draws.choice([*small, *field.shape], field.shape) + draws.integers(-1, 2)
        else:
            found = draws.integers(-1, max(2, draws.choice([4, *small])), field.shape)
        return found.astype(field.dtype)


class WildZoning(Wild):
    layer = "zoning"


class WildCharging(Wild):
    layer = "charging"


class WildAllocation(Wild):
    layer = "allocation"


class WildRouting(Wild):
    layer = "routing"


class WildRightOfWay(Wild):
    layer = "right_of_way"


class WildSteering(Wild):
    layer = "right_of_way"
    steers = True
