"""What a strategy remembers: a struct of its own, typed in its kernel, seen row by row under a radius."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from automaton.engine.jit.struct_types import StructClassType
from automaton.engine.state import LAYER_RIGHT_OF_WAY, LAYER_ROUTING
from automaton.runs.simulation import Simulation
from automaton.strategy.api import CONSTANT, SCRATCH, STOP, Array, Strategy, Struct, field, kernel
from automaton.world.resolve import resolve


class Totals(Struct):
    """A part of a state."""

    calls: Array = field("(1,) int64")
    largest: Array = field("(1,) float64")


class Summed(Struct):
    """A part that a state inherits."""

    totals: Totals


class Trial(Struct, role=SCRATCH):
    """A part that is scratch, with a part that would be kept elsewhere."""

    tried: Totals
    stop: Array = field("(1,) int64", role=STOP)


class WatchState(Summed):
    """One field of each kind."""

    step: int = field("int64", "what a call adds")
    share: float = field("float64", "a number that is not whole")
    trial: Trial
    weights: Array = field("(2,) float64", role=CONSTANT)
    asked: Array = field("(n,) int64", "how often a robot was asked about")
    pair: Array = field("(n, 2) int32")
    work: Array = field("(w,) int64", default=7, role=SCRATCH)
    foreign: Array = field("(n,) int64", "what was seen of others, in a robot's own row")


@kernel
def watch(view, batch, decisions, memory, workspace):
    state = WatchState.of(memory)
    state.totals.calls[0] += 1
    state.totals.largest[0] = state.weights[1] + state.share
    state.trial.tried.calls[0] += 1
    state.work[0] = 0
    for k in range(batch.count):
        state.work[0] += 1
        i = batch.robot[k]
        for j in range(state.asked.shape[0]):
            if j != i:
                state.foreign[i] += state.asked[j] + state.pair[j, 1]
        state.foreign[i] += state.totals.calls[0] - 1
        state.asked[i] += state.step
        state.pair[i, 1] = i


class Watch(Strategy):
    """Right of way that lets everybody wait, and remembers whom it was asked about."""

    layer = "right_of_way"
    compiled = watch
    period = 1
    counters: ClassVar = {"asked": "asked"}

    def reset(self, view: Any) -> WatchState:
        return WatchState.sized(
            {"n": len(view.robots.cell), "w": 3},
            totals=Totals.sized(),
            step=2,
            share=-0.25,
            trial=Trial.sized(tried=Totals.sized()),
            weights=(0.5, 1.5),
        )


class WatchInPython(Watch):
    """The same, outside of the loop."""

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        getattr(watch, "py_func", watch)(view, batch, decisions, memory, workspace)


def run(name: str, *settings: str, until: int = 30) -> Simulation:
    strategy = f"strategy.right_of_way={__name__}:{name}"
    simulation = Simulation(resolve("tabletop-1", [strategy, *settings]))
    simulation.run(until=until)
    return simulation


def state_of(simulation: Simulation) -> WatchState:
    state: WatchState = simulation.states[LAYER_RIGHT_OF_WAY]
    return state


@pytest.mark.parametrize("name", ["Watch", "WatchInPython"])
def test_a_state_is_typed_in_kernels_and_in_python(name: str) -> None:
    simulation = run(name)
    state, robots = state_of(simulation), len(simulation.world.robots.cell)
    assert state.asked.all() and state.asked.max() == 2 * 30
    assert state.totals.calls[0] == 30 and state.totals.largest[0] == 1.25
    assert 1 <= state.work[0] <= robots and state.work[1:].tolist() == [7, 7]
    assert simulation.counted == {"asked": state.asked.sum()}


@pytest.mark.parametrize("name", ["Watch", "WatchInPython"])
def test_under_a_radius_a_robot_finds_its_own_rows_and_nothing_else(name: str) -> None:
    simulation = run(name, "information={radius: 2}")
    state, robots = state_of(simulation), len(simulation.world.robots.cell)
    assert state.asked.all() and state.asked.max() == 2 * 30
    assert state.pair[:, 1].tolist() == list(range(robots))
    assert not state.foreign.any()
    assert not state.totals.calls.any(), "what is no robot's is not kept"
    assert state.work[0] == 1


def test_a_copy_has_a_state_and_scratch_of_its_own() -> None:
    state = state_of(run("Watch"))
    copy = state.copied()
    assert copy.totals.calls[0] == 30 and copy.asked.tolist() == state.asked.tolist()
    assert copy.work.tolist() == [7, 7, 7] and copy.share == -0.25
    assert state.trial.tried.calls[0] == 30 and copy.trial.tried.calls[0] == 0
    state.totals.calls[0] = 0
    assert copy.totals.calls[0] == 30


def test_a_run_that_goes_on_with_other_rules_keeps_the_state() -> None:
    simulation = run("Watch")
    again = simulation.continue_with(simulation.resolved)
    again.run(until=40)
    assert state_of(again).totals.calls[0] == 40


@pytest.mark.parametrize("name", ["Watch", "WatchInPython"])
def test_what_stops_a_run_stops_the_searches_of_its_strategies(name: str) -> None:
    simulation = run(name)
    assert state_of(simulation).trial.stop is simulation.workspace.stop
    again = simulation.continue_with(simulation.resolved)
    assert state_of(again).trial.stop is again.workspace.stop is not simulation.workspace.stop
    astar = Simulation(resolve("tabletop-1", ["strategy.routing=astar"]))
    assert astar.states[LAYER_ROUTING].routes.stop is astar.workspace.stop


PLANT = """name: plant
layout:
  picture: |
    t=~~=t
    =####=
    =####~
    t=~==t
fleet: {robots: 6, kinematics: omni}
orders: {generator: stations, count: 30}
strategy:
  allocation: shortest-job
  right_of_way: {name: retreat, idle_give_way: true}
stop: {when: delivered, max_duration: 600}
"""


CASES = [
    *(
        (floor, (f"information={information}",), 300)
        for floor in ("tabletop-1", "plant")
        for information in ("everything", "{radius: 3}")
    ),
    ("tabletop-1", ("strategy.routing={name: congestion, forecast: plans}",), 300),
    ("tabletop-1", ("strategy.routing={name: congestion, forecast: tasks}",), 300),
    ("depots", ("strategy.allocation={name: auction, local_search: true}",), 10),
    ("depots", ("strategy.allocation={name: auction, mechanism: genetic}",), 10),
    ("depots-full", ("strategy.allocation=first-come", "strategy.charging=fill-up"), 10),
]


@pytest.mark.parametrize(("floor", "settings", "operations"), CASES)
def test_scratch_decides_nothing(
    floor: str, settings: tuple[str, ...], operations: int, tmp_path: Path
) -> None:
    """Whatever lies in the scratch of strategies between two calls, the run is the same."""
    (tmp_path / "plant.yaml").write_text(PLANT)
    scenario: Any = tmp_path / "plant.yaml" if floor == "plant" else floor
    resolved = resolve(scenario, settings)
    clean, poisoned = Simulation(resolved), Simulation(resolved)
    draws = np.random.default_rng(1)
    for tick in range(1, 400):
        for state in poisoned.states:
            for name, declared, array in state.arrays():
                if declared.role == SCRATCH and not name.startswith("routes."):  # it has stamps
                    words = np.atleast_1d(array).view(np.uint8)
                    words[...] = draws.integers(0, 256, words.shape)
        poisoned.run(until=tick)
    clean.run(until=399)
    assert clean.world.tally.operations.sum() > operations
    assert poisoned.tick == clean.tick and poisoned.digest == clean.digest


def class_in_a_notebook(kind: str) -> type[Struct]:
    """A class as a cell makes it, each time that it is executed with other fields."""

    class Again(Struct):
        first: Any = field(kind, "a field")

    return Again


def test_a_class_that_is_defined_again_has_its_own_type() -> None:
    one, other = (
        StructClassType(class_in_a_notebook(kind)) for kind in ("(n,) int8", "(n,) int64")
    )
    assert one != other and one.cls is not other.cls
