"""A strategy can be bad, never unsafe: whatever it answers is a sentence or a counted tick."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from automaton.commands import main
from automaton.engine.jit.kernel import jit_is_on
from automaton.runs.headless import run_once
from automaton.runs.simulation import ALWAYS_CHECKED, CHECKED_EVERY, Simulation
from automaton.strategy import lookup, paths
from automaton.strategy.api import Array, InputError, NoState, Strategy, Struct, field, kernel
from automaton.world.resolve import resolve
from strategies.allocation.independent import Independent
from strategies.right_of_way.retreat import RetreatState


class Silent(Strategy):
    layer = "allocation"

    def decied(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        """Misspelt."""


class Tampers(Strategy):
    layer = "allocation"

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        batch.robot[0] = 500_000_000


class Faraway(Strategy):
    layer = "allocation"

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        paths.distance(view, workspace, 0, 2_000_000_000)


class Base(Strategy):
    layer = "allocation"
    memory: Any = None

    def reset(self, view: Any) -> Any:
        return self.memory

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        pass


class Asked(Struct):
    """How often each robot was asked."""

    times: Array = field("(n,) int64")
    tables: Array = field("(n, 2) int64")


class OneRow(Base):
    def reset(self, view: Any) -> Any:
        return Asked.sized({"n": 1})


class Floats(Base):
    def reset(self, view: Any) -> Any:
        return Asked.sized(times=np.zeros(3, np.float32))


class WorldAsState(Base):
    def reset(self, view: Any) -> Any:
        return view.robots


class Weights(Struct):
    """Values for all robots, which nobody has called constant."""

    weight: Array = field("(4,) int64", default=1)


class OneForAll(Base):
    def reset(self, view: Any) -> Any:
        return Weights.sized()


class Total(Struct):
    """A number, which kernels cannot write."""

    total: int = field("int64")


@kernel
def count_up(view, batch, decisions, memory, workspace):
    state = Total.of(memory)
    state.total = state.total + 1


class WritesNumber(Strategy):
    layer = "allocation"
    compiled = count_up

    def reset(self, view: Any) -> Any:
        return Total.sized()


class CountsNothing(Base):
    counters: ClassVar = {"asked": "asked"}

    def reset(self, view: Any) -> Any:
        return Asked.sized({"n": len(view.robots.cell)})


class CountsMoves(CountsNothing):
    counters: ClassVar = {"moves": "times"}


class NoWait(Strategy):
    layer = "right_of_way"

    def wait_ranges(self) -> Any:
        return (0, 0, 0, 0, 1)

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        pass


class Often(Base):
    period = -3

    def reset(self, view: Any) -> Any:
        return NoState()


class Mine(Independent):
    """A Python decide in a subclass of a compiled strategy takes its place."""

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        raise ArithmeticError("mine was asked")


def run(name: str, layer: str = "allocation", scenario: str = "tabletop-mini") -> Simulation:
    simulation = Simulation(resolve(scenario, [f"strategy.{layer}=test_bad_strategies:{name}"]))
    simulation.run()
    return simulation


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_kernel_that_writes_a_number_of_its_state_is_told_what_to_declare() -> None:
    with pytest.raises(InputError, match=r"py:\d+: the .* Total.total can only be read in kernels"):
        run("WritesNumber")


def test_values_that_a_radius_would_hide_are_called_constant() -> None:
    run("OneForAll")
    limited = ["strategy.allocation=test_bad_strategies:OneForAll", "information={radius: 3}"]
    with pytest.raises(
        InputError, match=r"weight has values, but not one row .* with role=CONSTANT"
    ):
        Simulation(resolve("tabletop-mini", limited))


@pytest.mark.parametrize(
    ("name", "layer", "sentence"),
    [
        ("Silent", "allocation", r"Silent: it has no method decide \(did you mean 'decied'"),
        (
            "Base",
            "allocation",
            r"reset\(\) must return a state, which is a Struct; it returned None",
        ),
        ("OneRow", "allocation", "times must have one row per robot; it has 1 rows for 3 robots"),
        ("WorldAsState", "allocation", "a state of its own; it returned one of the world"),
        ("NoWait", "right_of_way", "1 <= from <= to <= 10,000"),
        (
            "CountsNothing",
            "allocation",
            "counter 'asked' must name a field of Asked .*: these are times; ",
        ),
        (
            "CountsMoves",
            "allocation",
            "counter 'moves': a built-in metric has this name; rename it",
        ),
        ("Often", "allocation", "period must be a number of ticks"),
    ],
)
def test_what_does_not_fit_the_contract_is_refused(name: str, layer: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        run(name, layer)


def test_a_state_of_another_type_than_declared_is_refused() -> None:
    with pytest.raises(TypeError, match=r"Asked\.times is \(3,\) float32; it is declared as"):
        run("Floats", "allocation")


def test_the_batch_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        run("Tampers")


def test_a_cell_outside_the_grid_is_an_error_not_a_crash() -> None:
    with pytest.raises(IndexError, match="outside the grid"):
        run("Faraway")


def test_a_decide_written_below_a_compiled_one_counts() -> None:
    with pytest.raises(ArithmeticError, match="mine was asked"):
        run("Mine")


def opens_flags(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    view.robots.cell.flags.writeable = True


def opens_base(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    array = view.robots.cell
    while isinstance(array.base, np.ndarray):
        array = array.base
    array.flags.writeable = True


def opens_buffer(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    memoryview(view.orders.state).cast("B")[0] = 2


def rewires_table(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    view.robots._table[0, 0] = 0


def writes_space(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    workspace.tables.row_of[:] = 10**9


def replaces_answers(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    decisions.allocation = None


def replaces_array(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    decisions.allocation.command = np.zeros(1)


def frees_array(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    decisions.allocation.command.resize(10**6, refcheck=False)


def frees_memory(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    Asked.of(memory).times.resize(10**6, refcheck=False)


def takes_another_state(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
    RetreatState.of(memory)


class Does(Strategy):
    """Allocation that does what TRICK says, in the third tick."""

    layer = "allocation"
    period = 1

    def reset(self, view: Any) -> Any:
        return Asked.sized({"n": len(view.robots.cell)})

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        if view.clock.tick == 3:
            TRICK[0](view, decisions, memory, workspace)


class StandsStill(Strategy):
    """Routing that sends nobody anywhere."""

    layer = "routing"

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        pass


TWO = (("allocation", "Does"), ("routing", "StandsStill"))
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
        (replaces_answers, AttributeError, "Decisions.allocation cannot be replaced"),
        (replaces_array, AttributeError, "AllocationDecisions.command cannot be replaced"),
        (frees_array, ValueError, "does not own its data"),
        (frees_memory, ValueError, "does not own its data"),
        (takes_another_state, TypeError, "the state is Asked, not RetreatState"),
    ],
)
def test_what_is_lent_to_a_strategy_cannot_be_opened_or_freed(
    trick: Callable[..., None], error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        does(trick)


def test_who_writes_to_bare_addresses_is_named() -> None:
    def moves_everybody(view: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        cells = view.robots.cell
        ctypes.memset(cells.ctypes.data, 1, cells.nbytes)

    TRICK[:] = [moves_everybody]
    with pytest.raises(InputError, match=r"allocation strategy '.*:Does' raised .* robots\.cell"):
        run_once(resolve("tabletop-mini", [f"strategy.allocation={__name__}:Does"]), until=5)


class WritesLater(Strategy):
    """Allocation that moves everybody by bare addresses, but not in its first decisions."""

    layer = "allocation"
    period = 1
    decisions = 0

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        self.decisions += 1
        if self.decisions > ALWAYS_CHECKED + 1:
            priority = view.robots.priority
            ctypes.memset(priority.ctypes.data, self.decisions % 100, priority.nbytes)


def test_who_writes_to_bare_addresses_later_is_named_soon() -> None:
    strategy = WritesLater()
    resolved = resolve("tabletop-mini")
    picks = {layer: resolved.strategies[layer] for layer in ("routing", "right_of_way")}
    others = [lookup.load(layer, choice.name)(choice.parameters) for layer, choice in picks.items()]
    run = Simulation(resolved, strategies=[None, None, strategy, *others])
    with pytest.raises(PermissionError, match=r"it has written to robots\.priority of the world"):
        run.run()
    assert strategy.decisions == CHECKED_EVERY


class Open:
    """The memory of an array, whatever its flags say."""

    def __init__(self, array: Any) -> None:
        interface = array.__array_interface__
        self.__array_interface__ = interface | {"data": (interface["data"][0], False)}


def opens_ways(view: Any, *_: Any) -> None:
    np.asarray(Open(view.grid.type_cell_flags))[...] = 15


def opens_durations(view: Any, *_: Any) -> None:
    np.asarray(Open(view.rules.duration))[...] = 1


@pytest.mark.parametrize(
    ("trick", "name"), [(opens_ways, "grid.type_cell_flags"), (opens_durations, "rules.duration")]
)
def test_who_writes_to_constants_by_address_is_named_and_spoils_no_other_run(
    trick: Callable[..., None], name: str
) -> None:
    before = run_once(resolve("tabletop-mini")).digest
    TRICK[:] = [trick]
    with pytest.raises(InputError) as told:
        run_once(resolve("tabletop-mini", [f"strategy.allocation={__name__}:Does"]), until=5)
    says = f"the allocation strategy '{__name__}:Does' has written to {name} of the world"
    assert str(told.value) == says
    assert run_once(resolve("tabletop-mini")).digest == before  # the floor is shared


class WritesInReset(Base):
    def reset(self, view: Any) -> Any:
        opens_ways(view)
        return NoState()


def test_who_writes_to_constants_in_reset_is_named() -> None:
    with pytest.raises(
        InputError, match=r"strategy '.*:WritesInReset' has written to grid\.type_cell_flags"
    ):
        run_once(resolve("tabletop-mini", [f"strategy.allocation={__name__}:WritesInReset"]))


def test_of_several_who_may_have_written_all_are_named() -> None:
    TRICK[:] = [opens_ways]
    settings = [f"strategy.{layer}={__name__}:{name}" for layer, name in TWO]
    with pytest.raises(InputError, match=r"allocation strategy '.*:Does' or the routing strategy"):
        run_once(resolve("tabletop-mini", settings), until=5)


def test_who_writes_to_the_clock_is_named() -> None:
    def stops_the_clock(view: Any, *_: Any) -> None:
        np.asarray(Open(view.clock))[-1] += 1

    TRICK[:] = [stops_the_clock]
    with pytest.raises(InputError, match=r"allocation strategy '.*:Does' raised .* the clock"):
        run_once(resolve("tabletop-mini", [f"strategy.allocation={__name__}:Does"]), until=5)


def test_names_that_a_strategy_takes_away_are_its_own_loss() -> None:
    """The engine has its own: a strategy may empty the object that it got."""
    simulation = does(lambda view, decisions, memory, workspace: decisions.__dict__.clear())
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


class Waits(Base):
    period = 1

    def reset(self, view: Any) -> Any:
        return NoState()


class WhileMade(Waits):
    def __init__(self, parameters: Any) -> None:
        super().__init__(parameters)
        time.sleep(1000)


class InReset(Waits):
    def reset(self, view: Any) -> Any:
        time.sleep(1000)


class InDecide(Waits):
    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        time.sleep(1000)


class CatchesOnce(Waits):
    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        try:
            time.sleep(1000)
        except BaseException:
            time.sleep(1000)


class Locked(Waits):
    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        lock = threading.Lock()
        with lock, lock:
            pass


@pytest.mark.parametrize("name", ["WhileMade", "InReset", "InDecide", "CatchesOnce", "Locked"])
def test_a_strategy_that_waits_ends_the_run(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    setting = f"strategy.allocation={__name__}:{name}"
    assert main(["run", "tabletop-mini", "--set", setting, "--strategy-timeout", "1"]) == 2
    told = capsys.readouterr().err
    assert f"'{__name__}:{name}' raised NoAnswer: no answer within 1 s" in told
    assert told.count("\n") == 1


def test_outside_the_main_thread_it_is_bounded_where_it_computes() -> None:
    TRICK[:] = [waits_for_ever]
    resolved = resolve("tabletop-mini", [f"strategy.allocation={__name__}:Does"])
    with ThreadPoolExecutor(1) as elsewhere:
        error = elsewhere.submit(run_once, resolved, patience=1).exception()
    assert "no answer within 1 s" in str(error)


@pytest.mark.parametrize(
    ("stream", "says"),
    [
        ("stdout", "Does' raised PermissionError: it tried to close a standard stream"),
        ("__stdout__", "automaton: a strategy or plug-in has closed standard output"),
    ],
)
def test_a_strategy_that_closes_standard_output_is_a_sentence(
    stream: str, says: str, tmp_path: Path
) -> None:
    setting = "strategy.allocation=closes:Does"
    (tmp_path / "closes.py").write_text(
        "import sys\nfrom strategies.allocation.independent import IndependentPython\n"
        "class Does(IndependentPython):\n"
        "    def decide(self, *given):\n"
        f"        sys.{stream}.close()\n"
        "        super().decide(*given)\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "automaton", "run", "tabletop-mini", "--set", setting],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 2
    assert says in done.stderr and done.stderr.count("\n") == 1


def test_patience_changes_no_result() -> None:
    setting = "strategy.allocation=independent-python"
    with_bound = run_once(resolve("tabletop-mini", [setting]), patience=100)
    assert with_bound.digest == run_once(resolve("tabletop-mini", [setting])).digest


LATE = """
import sys, threading, time
from automaton.strategy.patience import NoAnswer, Watchdog
def late():
    dog = Watchdog(0.02)
    for number in range(20):
        try:
            with dog.watching():
                end = time.monotonic() + 0.02 + 0.004 * (number % 3)
                while time.monotonic() < end:
                    pass
        except NoAnswer:
            pass
thread = threading.Thread(target=late)
thread.start()
thread.join()
sys.setprofile(lambda *given: None)
for _ in range(100):
    (lambda: 1)()
sys.setprofile(None)
print("on")
"""


def test_what_is_profiled_goes_on_after_a_late_strategy_in_another_thread() -> None:
    """CPython 3.11 looked for the cancelled error for ever."""
    done = subprocess.run(
        [sys.executable, "-c", LATE], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout == "on\n"
