"""Strategies that a search compares, by their names."""

from __future__ import annotations

from collections.abc import Sequence

from automaton.errors import InputError, nearest
from automaton.scenario.schema import LAYER_NAMES
from automaton.strategy import lookup


def strategies_of(given: str | Sequence[str] | None) -> tuple[str, ...]:
    """Strategies as Python gives them: "a,b" or ["a", "b"]; None: the scenario's own alone.

    Raises InputError.
    """
    if given is None:
        return ("",)
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, (tuple, list)) or not all(isinstance(name, str) for name in names):
        raise InputError(f"strategies={given!r}: expected names, such as 'independent,cooperative'")
    return strategies_named(",".join(names))


def strategies_named(text: str) -> tuple[str, ...]:
    """Settings for strategies such as "independent,cooperative" or "routing=astar".

    Raises InputError for unknown names.
    """
    found = []
    for name in (part.strip() for part in text.split(",")):
        layer, equals, choice = name.partition("=")
        if equals:
            found.append(f"strategy.{layer.removeprefix('strategy.').strip()}={choice.strip()}")
            continue
        layers = [layer for layer in LAYER_NAMES if name in lookup.names(layer)]
        if ":" in name:
            layers = ["allocation"]
        if not layers or name == lookup.NO_STRATEGY:
            known = [known for layer in LAYER_NAMES for known in lookup.names(layer)]
            raise InputError(
                f"--strategies: no strategy is called '{name}'{nearest(name, known)}; "
                "or say LAYER=NAME"
            )
        found.append(f"strategy.{layers[0]}={name}")
    if len(set(found)) < len(found):
        raise InputError("--strategies names a strategy twice")
    return tuple(found)
