"""Load the panels and map layers that installed packages register as entry points, ours included.

    [project.entry-points."automaton.layers"]
    dust = "my_package.dust:Dust"

An entry that fails to load is left out and reported in one sentence. A panel or layer of another
distribution is switched off when it raises while shown or returns numbers of the wrong shape. Ours
are registered first; whoever registers a name, action or key first keeps it.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping
from copy import copy
from functools import cache, partial
from importlib.metadata import Distribution, EntryPoint, entry_points
from queue import Empty, SimpleQueue
from types import MappingProxyType
from typing import Any, Final, NamedTuple

LAYER_GROUP: Final = "automaton.layers"
PANEL_GROUP: Final = "automaton.panels"
# Named, not imported, like entry points: these modules import this one.
LAYER_CLASS: Final = "tui.render.layer:Layer"
LAYER_CHECKS: Final = "tui.render.layer:CHECKS"
SWITCHED_OFF: Final = "tui.render.layer:SwitchedOff"
NO_LAYER_PLACE: Final = "tui.render.layer:NO_LAYER"
PANEL_CLASS: Final = "tui.widgets.panel:Panel"
OUR_DISTRIBUTION: Final = "fleet-automaton"  # the distribution of this module
RESERVED: Final = ("layer_none", "layer_route")  # actions of the viewer itself
WIDGET_ID: Final = re.compile(r"[a-zA-Z_-][a-zA-Z0-9_-]*")  # widget ids that Textual accepts

NO_CHECKS: Final[Mapping[str, Callable[..., None]]] = MappingProxyType({})


class Registered(NamedTuple):
    """The entries of one group in screen order, and a sentence for each one that failed to load."""

    by_name: dict[str, Any]
    problems: tuple[str, ...]
    own: frozenset[str]  # names of our own entries


@cache
def layers() -> Registered:
    """The layers of the map (tui.render.layer.Layer) by name."""
    return _registered(LAYER_GROUP, "layer", load(LAYER_CLASS))


@cache
def panels() -> Registered:
    """The panels (tui.widgets.panel.Panel) by name; their widgets are not imported yet."""
    return _registered(PANEL_GROUP, "panel", load(PANEL_CLASS))


def layer_named(name: str) -> Any:
    """The layer with this name, or the layer that shows nothing."""
    return (name and layers().by_name.get(name)) or load(NO_LAYER_PLACE)


_failures: Final[SimpleQueue[str]] = SimpleQueue()


def failure() -> str:
    """The next report of a panel or layer that was switched off because it raised, or ""."""
    try:
        return _failures.get_nowait()
    except Empty:
        return ""


def guard(
    thing: Any,
    what: str,
    name: str,
    without: type[Any],
    off: Callable[[str], None],
    checks: Mapping[str, Callable[..., None]] = NO_CHECKS,
) -> None:
    """Wrap the public methods that `thing` inherits from `without`, so that they raise no errors.

    The first error switches the thing off: `failure` returns the report, `off` receives it too, and
    from then on the methods behave like those of `without`. The check of a method receives the
    thing, the returned value and the arguments; it raises an error if the value is unusable.
    """
    failed: list[str] = []

    def called(
        method: Callable[..., Any],
        instead: Callable[..., Any],
        check: Callable[..., None] | None,
        *args: Any,
    ) -> Any:
        if not failed:
            try:
                returned = method(*args)
                if check is not None:
                    check(thing, returned, *args)
                return returned
            except Exception as error:  # a user's module may raise anything
                failed.append(left_out(what, name, error))
                _failures.put(failed[0])
                off(failed[0])
        return instead(thing, *args)

    for each in dir(without):
        instead = getattr(without, each)
        if callable(instead) and not each.startswith("_"):
            setattr(thing, each, partial(called, getattr(thing, each), instead, checks.get(each)))


def load(place: str) -> Any:
    """Import the object at "module:name". Raises whatever its module raises."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def left_out(what: str, name: str, error: Exception) -> str:
    """The report of an entry that failed to load."""
    return f"{what} {name!r} is left out: {type(error).__name__}: {error}"


def _registered(group: str, what: str, kind: type[Any]) -> Registered:
    entries: dict[str, Any] = {}
    problems: list[str] = []
    points = sorted(entry_points(group=group), key=lambda one: (not _is_ours(one.dist), one.name))
    own = frozenset(point.name for point in points if _is_ours(point.dist))
    if not points:
        problems.append(f"no {what}s are registered: install the project again (pip install -e .)")
    for point in points:
        ours = _is_ours(point.dist)
        try:
            if point.name in entries or (point.name in own and not ours):
                raise ValueError("the name is taken")
            loaded = _loaded(point, kind)
            _take_action(loaded, what == "layer", ours, entries)
            if what == "layer" and not ours:
                without, off = load(SWITCHED_OFF), partial(setattr, loaded, "absent")
                guard(loaded, what, point.name, without, off, load(LAYER_CHECKS))
            entries[point.name] = loaded
        except Exception as error:  # an import may raise anything
            problems.append(left_out(what, point.name, error))
    in_order = sorted(entries.items(), key=lambda item: item[1].position)
    return Registered(dict(in_order), tuple(problems), own)


@cache
def _is_ours(distribution: Distribution | None) -> bool:
    return distribution is not None and distribution.name == OUR_DISTRIBUTION


def _loaded(point: EntryPoint, kind: type[Any]) -> Any:
    """A layer or panel under its name. Raises if an attribute differs in type from `kind`'s."""
    loaded = point.load()
    loaded = loaded() if isinstance(loaded, type) else copy(loaded)
    if not isinstance(loaded, kind):
        raise TypeError(f"{point.value} is not a {kind.__module__}.{kind.__name__}")
    for name, default in vars(kind).items():
        value = getattr(loaded, name)
        if (
            type(default) in (str, int, bool)
            and type(value) is not type(default)
            and name[0] != "_"
        ):
            raise TypeError(f"{name} is {value!r}, not of type {type(default).__name__}")
    if not WIDGET_ID.fullmatch(point.name):
        raise ValueError("a name has letters, digits, - and _ only, and begins with no digit")
    loaded.name = point.name
    return loaded


def _take_action(one: Any, is_layer: bool, ours: bool, others: dict[str, Any]) -> None:
    """Set its action in the table of bindings. Raises ValueError if the action is taken."""
    turns = is_layer and bool(one.action)  # layers may share an action
    if is_layer:
        one.action = one.action or f"layer_{one.name}"
    elif ours:
        one.action = one.action or one.name
    else:
        one.action = f"panel_{one.name}"
    if is_layer and not one.action.startswith("layer_"):
        raise ValueError(f"its action {one.action!r} does not begin with 'layer_'")
    taken = {other.action for other in others.values()}
    if one.action in RESERVED or (one.action in taken and not turns):
        raise ValueError(f"the action {one.action!r} is taken")
