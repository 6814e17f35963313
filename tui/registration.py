"""Panels and layers of the map that installed packages register as entry points; ours are, too.

    [project.entry-points."automaton.layers"]
    dust = "my_package.dust:Dust"

What cannot be loaded is left out, and one sentence says so.
"""

from __future__ import annotations

import importlib
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, Generic, NamedTuple, TypeVar

from tui.render.layer import NO_LAYER, Layer
from tui.widgets.panel import Panel

LAYERS: Final = "automaton.layers"
PANELS: Final = "automaton.panels"
T = TypeVar("T")


class Registered(NamedTuple, Generic[T]):
    """What a group of entry points brings, in the order of the screen, and what it should have."""

    by_name: dict[str, T]
    problems: tuple[str, ...]


@cache
def layers() -> Registered[Layer]:
    """The layers of the map by name."""
    return _registered(LAYERS, "layer", Layer)


@cache
def panels() -> Registered[Panel]:
    """The panels by name; their widgets are not imported yet."""
    return _registered(PANELS, "panel", Panel)


def layer_named(name: str) -> Layer:
    """A layer, or the one that shows nothing."""
    return layers().by_name.get(name, NO_LAYER) if name else NO_LAYER


def load(place: str) -> Any:
    """What "module:name" stands for. Raises whatever its module does."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def left_out(what: str, name: str, error: Exception) -> str:
    """The sentence about something that cannot be loaded."""
    return f"{what} {name!r} is left out: {type(error).__name__}: {error}"


def _registered(group: str, what: str, kind: type[T]) -> Registered[T]:
    entries: dict[str, T] = {}
    problems: list[str] = []
    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        try:
            entries[point.name] = _loaded(point, kind)
        except Exception as error:  # whatever a user's module does wrong while it is imported
            problems.append(left_out(what, point.name, error))
    in_order = sorted(entries.items(), key=lambda item: item[1].position)  # type: ignore[attr-defined]
    return Registered(dict(in_order), tuple(problems))


def _loaded(point: EntryPoint, kind: type[T]) -> T:
    loaded = point.load()
    loaded = loaded() if isinstance(loaded, type) else loaded
    if not isinstance(loaded, kind):
        raise TypeError(f"{point.value} is not a {kind.__module__}.{kind.__name__}")
    loaded.name = point.name  # type: ignore[attr-defined]
    return loaded
