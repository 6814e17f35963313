"""A plug-in has the same rights: a copy of a shipped strategy under another name is taken as it is."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from automaton.errors import InputError
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.unavailable_metrics import not_measured
from automaton.strategy.lookup import DECLARATIONS, STEERS, declares, load, parameters_type, place
from automaton.world.capabilities import default_right_of_way
from automaton.world.resolve import resolve
from automaton.world.scenario_warnings import scenario_warnings
from strategies.catalogue import CATALOGUE

TICKS = 120  # of a run
SHIPPED = [(layer, name) for layer, entries in CATALOGUE.items() for name in entries]
# With pods, batteries, gates, tracks without a ring, crowds that no robot slows, zones.
SCENARIOS = {
    "tabletop-mini": ["fleet.robots=40", "fleet.start=random"],
    "goods-mini": ["fleet.robots=30"],
    "depots": ["battery.capacity=2", "strategy.right_of_way=wait"],
    "warehouse-100": ["world.slowdown=none"],
    "factory": ["units.tick=1 tick"],
    "sorting": [],
}


def copy_name(layer: str, name: str) -> str:
    return f"copies_of_shipped:{layer}_{name.replace('-', '_')}"


@pytest.fixture(scope="module", autouse=True)
def copies(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A module with a subclass of each shipped strategy."""
    lines = []
    for layer, name in SHIPPED:
        module, _, original = place(layer, name).partition(":")
        copy = copy_name(layer, name).partition(":")[2]
        lines += [f"from {module} import {original}", f"class {copy}({original}): pass"]
    folder = tmp_path_factory.mktemp("copies")
    (folder / "copies_of_shipped.py").write_text("\n".join(lines), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        importlib.invalidate_caches()
        yield


def said(scenario: str, layer: str, name: str) -> list[str]:
    """All that is said of a scenario with this strategy; its name is left out."""
    try:
        resolved = resolve(scenario, [*SCENARIOS[scenario], f"strategy.{layer}={name}"])
    except InputError as error:
        sentences = [error.message]
    else:
        default = default_right_of_way(resolved.scenario, resolved.fleet)
        sentences = [*scenario_warnings(resolved), str(not_measured(resolved.scenario))]
        return [*(one.replace(name, "NAME") for one in sentences), default.name]
    return [one.replace(name, "NAME") for one in sentences]


@pytest.mark.parametrize(("layer", "name"), SHIPPED)
def test_a_copy_is_warned_of_measured_and_defaulted_as_the_original(layer: str, name: str) -> None:
    for scenario in SCENARIOS:
        assert said(scenario, layer, copy_name(layer, name)) == said(scenario, layer, name)


@pytest.mark.parametrize(("layer", "name"), SHIPPED)
def test_a_copy_does_the_same(layer: str, name: str) -> None:
    """On the first of some scenarios that it goes with."""
    ends = []
    for scenario in ("tabletop-mini", "depots", "factory", "sorting"):
        for one in (name, copy_name(layer, name)):
            try:
                run = Simulation(resolve(scenario, [f"strategy.{layer}={one}"]))
            except InputError:
                continue
            run.run(until=TICKS)
            ends.append((run.digest, repr(metrics_of(run))))
        if ends:
            break
    assert len(ends) == 2 and ends[0] == ends[1]


@pytest.mark.parametrize(("layer", "name"), SHIPPED)
def test_what_is_declared_is_read_without_the_class_and_is_what_that_says(
    layer: str, name: str
) -> None:
    kind = load(layer, name)
    assert kind.Parameters is parameters_type(layer, name)
    for what in DECLARATIONS:
        assert declares(layer, name, what) == declares(layer, copy_name(layer, name), what)
    assert declares(layer, name, STEERS) == kind.steers


def test_declarations_tell_strategies_apart() -> None:
    for what in DECLARATIONS:
        layers = {layer for layer, name in SHIPPED if declares(layer, name, what)}
        assert len(layers) == 1, what
        [layer] = layers
        assert {declares(layer, name, what) for name in CATALOGUE[layer]} == {False, True}, what


def test_a_strategy_that_is_not_installed_declares_nothing(tmp_path: Path) -> None:
    assert not declares("right_of_way", "not_installed_here:Rule", STEERS)
