"""A strategy can be bad, never unsafe: whatever it answers is a sentence or a counted tick."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

from automaton.errors import InputError
from automaton.scenario.resolve import resolve
from automaton.simulation import Simulation
from automaton.strategy import paths
from automaton.strategy.layer import Strategy, memory_of
from automaton.world.state import Memory
from strategies.allocation.independent import Independent


class Silent(Strategy):
    layer = "allocation"

    def decied(self, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
        """Misspelt."""


class Tampers(Strategy):
    layer = "allocation"

    def decide(self, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
        asked.robot[0] = 500_000_000


class Faraway(Strategy):
    layer = "allocation"

    def decide(self, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
        paths.distance(view, space, 0, 2_000_000_000)


class Base(Strategy):
    layer = "allocation"
    memory: Any = None

    def reset(self, view: Any) -> Any:
        return self.memory

    def decide(self, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
        pass


class OneRow(Base):
    def reset(self, view: Any) -> Any:
        good = memory_of(view, own=1)
        return Memory(own=good.own[:1].copy(), shared=good.shared, parameters=good.parameters)


class Floats(Base):
    def reset(self, view: Any) -> Any:
        good = memory_of(view)
        return Memory(own=good.own, shared=np.zeros(3, np.float32), parameters=good.parameters)


class CountsNothing(Base):
    counters: ClassVar = {"asked": 1}

    def reset(self, view: Any) -> Any:
        return memory_of(view, own=1)


class CountsMoves(Base):
    counters: ClassVar = {"moves": 0}

    def reset(self, view: Any) -> Any:
        return memory_of(view, own=1)


class NoWait(Strategy):
    layer = "right_of_way"

    def waits(self) -> Any:
        return (0, 0, 0, 0, 1)

    def decide(self, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
        pass


class Often(Base):
    every = -3

    def reset(self, view: Any) -> Any:
        return memory_of(view)


class Mine(Independent):
    """A Python decide in a subclass of a compiled strategy takes its place."""

    def decide(self, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
        raise ArithmeticError("mine was asked")


def run(name: str, layer: str = "allocation", scenario: str = "tabletop-mini") -> Simulation:
    simulation = Simulation(resolve(scenario, [f"strategy.{layer}=test_bad_strategies:{name}"]))
    simulation.run()
    return simulation


@pytest.mark.parametrize(
    ("name", "layer", "sentence"),
    [
        ("Silent", "allocation", r"Silent: it has no method decide \(did you mean 'decied'"),
        ("Base", "allocation", "reset\\(\\) must return memory_of"),
        ("OneRow", "allocation", "memory.own as int64 of shape"),
        ("Floats", "allocation", "memory.shared as int64 of shape"),
        ("NoWait", "right_of_way", "1 <= from <= to <= 10,000"),
        ("CountsNothing", "allocation", "counter 'asked' must name a column of memory.own"),
        ("CountsMoves", "allocation", "counter 'moves': every run counts this itself; rename it"),
        ("Often", "allocation", "every must be a number of ticks"),
    ],
)
def test_what_does_not_fit_the_contract_is_refused(name: str, layer: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        run(name, layer)


def test_the_batch_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        run("Tampers")


def test_a_cell_outside_the_grid_is_an_error_not_a_crash() -> None:
    with pytest.raises(IndexError, match="outside the grid"):
        run("Faraway")


def test_a_decide_written_below_a_compiled_one_counts() -> None:
    with pytest.raises(ArithmeticError, match="mine was asked"):
        run("Mine")
