"""A strategy can be bad, never unsafe: whatever it answers is a sentence or a counted tick."""

from __future__ import annotations

import ctypes
import signal
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.headless import run_once
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


def opens_flags(view: Any, answers: Any, memory: Any, space: Any) -> None:
    view.robots.cell.flags.writeable = True


def opens_base(view: Any, answers: Any, memory: Any, space: Any) -> None:
    array = view.robots.cell
    while isinstance(array.base, np.ndarray):
        array = array.base
    array.flags.writeable = True


def opens_buffer(view: Any, answers: Any, memory: Any, space: Any) -> None:
    memoryview(view.orders.state).cast("B")[0] = 2


def rewires_table(view: Any, answers: Any, memory: Any, space: Any) -> None:
    view.robots._table[0, 0] = 0


def writes_space(view: Any, answers: Any, memory: Any, space: Any) -> None:
    space.field_of[:] = 10**9


def replaces_answers(view: Any, answers: Any, memory: Any, space: Any) -> None:
    answers.allocation = None


def replaces_array(view: Any, answers: Any, memory: Any, space: Any) -> None:
    answers.allocation.verb = np.zeros(1)


def frees_array(view: Any, answers: Any, memory: Any, space: Any) -> None:
    answers.allocation.verb.resize(10**6, refcheck=False)


def frees_memory(view: Any, answers: Any, memory: Any, space: Any) -> None:
    memory.own.resize(10**6, refcheck=False)


class Does(Strategy):
    """Allocation that does what TRICK says, in the third tick."""

    layer = "allocation"
    every = 1

    def decide(self, view: Any, asked: Any, answers: Any, memory: Any, space: Any) -> None:
        if view.clock[0] == 3:
            TRICK[0](view, answers, memory, space)


TRICK: list[Callable[..., None]] = []


def does(trick: Callable[..., None]) -> Simulation:
    TRICK[:] = [trick]
    simulation = Simulation(resolve("tabletop-mini", [f"strategy.allocation={__name__}:Does"]))
    simulation.run(until=5)
    return simulation


@pytest.mark.parametrize(
    ("trick", "error", "says"),
    [
        (opens_flags, ValueError, "cannot set WRITEABLE flag"),
        (opens_base, ValueError, "cannot set WRITEABLE flag"),
        (opens_buffer, TypeError, "read-only"),
        (rewires_table, ValueError, "read-only"),
        (writes_space, ValueError, "read-only"),
        (replaces_answers, AttributeError, "Answers.allocation cannot be replaced"),
        (replaces_array, AttributeError, "AllocationAnswers.verb cannot be replaced"),
        (frees_array, ValueError, "does not own its data"),
        (frees_memory, ValueError, "does not own its data"),
    ],
)
def test_what_is_lent_to_a_strategy_cannot_be_opened_or_freed(
    trick: Callable[..., None], error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        does(trick)


def test_who_writes_to_bare_addresses_is_named() -> None:
    def moves_everybody(view: Any, answers: Any, memory: Any, space: Any) -> None:
        cells = view.robots.cell
        ctypes.memset(cells.ctypes.data, 1, cells.nbytes)

    TRICK[:] = [moves_everybody]
    with pytest.raises(InputError, match=r"allocation strategy '.*:Does' raised .* robots\.cell"):
        run_once(resolve("tabletop-mini", [f"strategy.allocation={__name__}:Does"]), until=5)


def test_names_that_a_strategy_takes_away_are_its_own_loss() -> None:
    """The engine has its own: a strategy may empty the object that it got."""
    simulation = does(lambda view, answers, memory, space: answers.__dict__.clear())
    assert simulation.tick == 5


@pytest.mark.parametrize(
    "error", [BaseException, KeyboardInterrupt, GeneratorExit, StopIteration, SystemExit]
)
def test_whatever_a_strategy_raises_is_a_sentence_about_it(
    error: type[BaseException], capsys: pytest.CaptureFixture[str]
) -> None:
    def raises(*_: Any) -> None:
        raise error("this\nway \x1b[31m" + "x" * 2000)

    TRICK[:] = [raises]
    code = main(["run", "tabletop-mini", "--set", f"strategy.allocation={__name__}:Does"])
    told = capsys.readouterr().err
    assert code == 2
    assert told.startswith(
        f"automaton: the allocation strategy '{__name__}:Does' raised {error.__name__}: "
    )
    assert told.count("\n") == 1 and "\x1b" not in told and len(told) < 800


def test_ctrl_c_in_a_strategy_is_no_fault_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    def is_interrupted(*_: Any) -> None:
        signal.raise_signal(signal.SIGINT)

    TRICK[:] = [is_interrupted]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # the background ignores it
    try:
        code = main(["run", "tabletop-mini", "--set", f"strategy.allocation={__name__}:Does"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert code == 130
    assert capsys.readouterr().err == "automaton: interrupted\n"


def waits_for_ever(*_: Any) -> None:
    while True:
        try:
            while True:
                pass
        except Exception:
            pass


def test_a_strategy_that_never_answers_ends_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    TRICK[:] = [waits_for_ever]
    setting = f"strategy.allocation={__name__}:Does"
    assert main(["run", "tabletop-mini", "--set", setting, "--strategy-timeout", "1"]) == 2
    told = capsys.readouterr().err
    assert f"'{__name__}:Does' raised NoAnswer: no answer within 1 s" in told
    assert told.count("\n") == 1


def test_patience_changes_no_result() -> None:
    setting = "strategy.allocation=independent-python"
    with_bound = run_once(resolve("tabletop-mini", [setting]), patience=100)
    assert with_bound.digest == run_once(resolve("tabletop-mini", [setting])).digest
