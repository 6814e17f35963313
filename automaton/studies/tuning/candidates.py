"""What is tried: for right of way and allocation every strategy that declares values worth trying.

The parameters of a strategy declare them in a method: `tuned_values(scenario, floor_plan)` gives for each
parameter the values to be tried, {} for the strategy as it is; one without the method is not tried. A
candidate is a combination; the scenario as it is is the first one.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.scenario.document import Override
from automaton.strategy import lookup
from automaton.world.resolve import Resolved, resolve

TUNED_LAYERS: Final = ("right_of_way", "allocation")
Choice = dict[str, Any]  # a strategy as scenarios write it: {name: NAME, ...parameters}


class TunedScenario(NamedTuple):
    """A scenario with a strategy for each of the layers."""

    choices: tuple[Choice, ...]  # by TUNED_LAYERS
    resolved: Resolved

    @property
    def settings(self) -> list[str]:
        """What --set makes it of the scenario."""
        pairs = zip(TUNED_LAYERS, self.choices, strict=True)
        return [f"strategy.{layer}={json.dumps(choice)}" for layer, choice in pairs]


class TunedScenarios(NamedTuple):
    """All candidates of a scenario, and what it refuses."""

    candidates: tuple[TunedScenario, ...]  # first the scenario as it is
    left_out: tuple[str, ...]  # a sentence for each reason


def candidates_of(
    scenario: str | Path, settings: Sequence[str | Override], seed: int | None = None
) -> TunedScenarios:
    """The candidates of a scenario. Raises InputError for one that cannot be run as it is."""
    own = resolve(scenario, settings, seed)
    candidates = [TunedScenario(tuple(own_choice(own, layer) for layer in TUNED_LAYERS), own)]
    known, reasons = [played(own)], dict[str, None]()
    for choices in itertools.product(*(list(options(own, layer)) for layer in TUNED_LAYERS)):
        changes = [
            Override(f"strategy.{layer}", ("strategy", layer), choice)
            for layer, choice in zip(TUNED_LAYERS, choices, strict=True)
        ]
        try:
            resolved = resolve(scenario, (*settings, *changes), seed)
        except InputError as error:
            reasons[error.message] = None
            continue
        if played(resolved) not in known:
            known.append(played(resolved))
            candidates.append(TunedScenario(choices, resolved))
    return TunedScenarios(tuple(candidates), tuple(reasons))


def options(own: Resolved, layer: str) -> Iterator[Choice]:
    """Every strategy of a layer that declares values worth trying, with each combination of them."""
    for name in lookup.names(layer):
        kind: Any = lookup.parameters_type(layer, name)
        if not hasattr(kind, "tuned_values"):
            continue
        usual = kind()
        values = usual.tuned_values(own.scenario, own.floor_plan)
        for combination in itertools.product(*values.values()):
            pairs = zip(values, combination, strict=True)
            yield {"name": name} | {key: one for key, one in pairs if one != getattr(usual, key)}


def own_choice(resolved: Resolved, layer: str) -> Choice:
    """The strategy of a layer that a scenario has itself, as scenarios write it."""
    spec = msgspec.to_builtins(getattr(resolved.scenario.strategy, layer))
    return dict(spec) if isinstance(spec, dict) else {"name": spec}


def played(resolved: Resolved) -> list[tuple[str, Any]]:
    """What two candidates differ in."""
    chosen = (resolved.strategies[layer] for layer in TUNED_LAYERS)
    return [(one.name, one.parameters) for one in chosen]


def in_words(choice: Choice) -> str:
    """A strategy as a table shows it: "epibt, guidance lattice"."""
    parameters = (f"{key} {value}" for key, value in choice.items() if key != "name")
    return ", ".join((str(choice["name"]), *parameters))
