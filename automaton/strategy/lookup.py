"""How a name in a scenario finds a strategy: the table, "module:Class", or an installed plug-in.

Built-ins have no privileges: the table only gives them short names. This module does not import
Numba, and imports a strategy only when it is loaded.
"""

from __future__ import annotations

import copy
import importlib
import sys
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import msgspec
from msgspec import Meta

from automaton.errors import InputError, nearest


class NoParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A strategy without parameters."""


class AsRecorded(msgspec.Struct, frozen=True):
    """The recorded parameters of a strategy that is not loaded."""

    values: dict[str, Any]

    def __getattr__(self, name: str) -> Any:
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None


def resolve_paths(parameters: Any, folder: Path) -> Any:
    """Parameters with file names resolved against a folder, as absolute paths.

    Parameters that name files have a method `resolve_paths(folder)`, and `files`, which lists them.
    They may have `check_files(driving)`, which reads them and raises InputError; `driving()`
    returns the floor's grid, and the ticks of each action for the first robot type.
    """
    return parameters.resolve_paths(folder) if hasattr(parameters, "resolve_paths") else parameters


def files_of(parameters: Any) -> tuple[Path, ...]:
    """The files that parameters name."""
    return tuple(getattr(parameters, "files", ()))


# Properties of scheduling methods: the columns of Table 1 of Keith & La.
MULTIPLE: Final = "multiple AMRs"
DYNAMIC: Final = "dynamic environment"
MANUFACTURING: Final = "manufacturing"
WAREHOUSE: Final = "warehouse"
DECENTRALIZED: Final = "decentralized"
METHOD_PROPERTIES: Final = (MULTIPLE, DYNAMIC, MANUFACTURING, WAREHOUSE, DECENTRALIZED)


# The robots for which a right of way is the default: CatalogueEntry.default_for.
ROUTED: Final = "robots that follow routes"
STEERED: Final = "robots that are steered"
SLOW_STEERED: Final = (
    "steered robots with turns or moves of several ticks, mostly on two-way floors"
)
IMPORTED: Final = "robots on imported floors"


class CatalogueEntry(NamedTuple):
    """One row of the table: the class of a strategy, its parameters, and one line for `list`.

    `properties`: the METHOD_PROPERTIES of its method; None if unknown. `default_for`: the robots
    for which it is the default, "" for none. `in_random_cases`: whether the random cases of
    `check-strategy` use it in the layers beside the checked one; it should compile quickly.
    """

    implementation: str  # "module:Class"
    parameters: type[msgspec.Struct]
    summary: str
    properties: tuple[str, ...] | None = None
    default_for: str = ""
    in_random_cases: bool = False


PLUGINS = "automaton.strategies"  # entry-point group; each entry is named "layer.name"
NO_STRATEGY = "none"  # zoning and charging are optional
OPTIONAL_LAYERS = ("zoning", "charging")


@cache
def _catalogue() -> dict[str, dict[str, CatalogueEntry]]:
    catalogue: dict[str, dict[str, CatalogueEntry]] = importlib.import_module(
        "strategies.catalogue"
    ).CATALOGUE
    return catalogue


def zone_design_reader() -> Any:
    """The function that reads the zone design of a scenario (strategies.catalogue), for any
    strategy.

    A replay also needs it if the strategy is not installed.
    """
    module, _, name = importlib.import_module("strategies.catalogue").ZONE_DESIGNS.partition(":")
    return getattr(importlib.import_module(module), name)


@cache
def _plugins(layer: str) -> dict[str, Any]:
    """The entry points of installed strategies, by name."""
    from importlib.metadata import entry_points  # slow: imports the parser of e-mails

    found = {}
    for point in entry_points(group=PLUGINS):
        kind, _, name = point.name.partition(".")
        if kind == layer and name:
            found[name] = point
    return found


def look_in(folder: str) -> None:
    """Find modules and plug-ins in one more folder, after all others."""
    if folder not in sys.path:
        sys.path.append(folder)
        _plugins.cache_clear()


def entry_point(layer: str, name: str) -> Any:
    """The entry point of a plug-in's name; None for other names."""
    return None if is_built_in(layer, name) else _plugins(layer).get(name)


def names(layer: str) -> list[str]:
    """The names that a scenario may use for a layer, besides "module:Class"."""
    optional = [NO_STRATEGY] if layer in OPTIONAL_LAYERS else []
    return optional + list(_catalogue()[layer]) + list(_plugins(layer))


def is_built_in(layer: str, name: str) -> bool:
    """Whether a name belongs to a built-in strategy."""
    return name in _catalogue()[layer] or (name == NO_STRATEGY and layer in OPTIONAL_LAYERS)


def parameters_type(layer: str, name: str) -> type[msgspec.Struct]:
    """The struct of a strategy's parameters. Raises InputError for an unknown name."""
    entry = _catalogue()[layer].get(name)
    if entry is not None:
        return entry.parameters
    if name == NO_STRATEGY and layer in OPTIONAL_LAYERS:
        return NoParameters
    found: type[msgspec.Struct] = getattr(load(layer, name), "Parameters", NoParameters)
    return found


def summary(layer: str, name: str) -> str:
    """One line about a strategy."""
    entry = _catalogue()[layer].get(name)
    if entry is not None:
        return entry.summary
    if name == NO_STRATEGY:
        return f"no {layer}"
    return (load(layer, name).__doc__ or "").strip().split("\n")[0]


def place(layer: str, name: str) -> str:
    """The implementation of a strategy, "module:Class"; "" if unknown."""
    if name == NO_STRATEGY:
        return ""
    entry = _catalogue()[layer].get(name)
    if entry:
        return entry.implementation
    point = _plugins(layer).get(name)
    return name if point is None else str(point.value)


def properties(layer: str, name: str) -> dict[str, bool]:
    """Which METHOD_PROPERTIES a strategy has, by the table; empty if unknown."""
    entry = _catalogue()[layer].get(name)
    if entry is None or entry.properties is None:
        return {}
    return {one: one in entry.properties for one in METHOD_PROPERTIES}


# Properties that a strategy may declare, as an attribute of its class or of its Parameters.
STEERS: Final = "steers"  # right of way: decides each move of robots, which have no routes
ADMITS_ONE: Final = "admits_one"  # right of way: a dead end admits one robot at a time
AVOIDS_TRAFFIC: Final = "avoids_traffic"  # routing: routes go around other robots
SEARCHES_BY_ASTAR: Final = "searches_by_astar"  # routing: a route is the path of an A* search
KEEPS_WAY_BACK: Final = "keeps_way_back"  # charging: robots always keep a charger in reach
# Routing: if robots are steered instead, nothing is lost.
TAKES_SHORTEST_ROUTES: Final = "takes_shortest_routes"
DECLARATIONS: Final = (
    STEERS,
    ADMITS_ONE,
    AVOIDS_TRAFFIC,
    SEARCHES_BY_ASTAR,
    TAKES_SHORTEST_ROUTES,
    KEEPS_WAY_BACK,
)


def declares(layer: str, name: str, what: str) -> bool:
    """Whether a strategy declares one of DECLARATIONS; False if it cannot be loaded here."""
    if is_built_in(layer, name):  # its parameters declare it, which are read without Numba
        return bool(getattr(parameters_type(layer, name), what, False))
    try:
        kind = load(layer, name)
    except InputError:  # recordings can be read without their strategies
        return False
    return bool(getattr(kind, what, False) or getattr(kind.Parameters, what, False))


def default_for(layer: str, robots: str) -> str:
    """The name of the strategy that is the default for such robots."""
    entries = _catalogue()[layer].items()
    return next(name for name, entry in entries if entry.default_for == robots)


def names_in_random_cases(layer: str) -> list[str]:
    """The strategies that random cases use in a layer that is not checked."""
    return [name for name, entry in _catalogue()[layer].items() if entry.in_random_cases]


# Classes given by a Python program, by "module:Class".
_GIVEN: dict[str, type] = {}


def name_of_class(kind: type) -> str:
    """The name by which a scenario now finds a class; a local class only in this process."""
    name = f"{kind.__module__}:{kind.__qualname__}"
    _GIVEN[name] = kind
    return name


def spec_of(choice: Any) -> Any:
    """The data of a strategy that a program passes as a name, data, a class or an instance.

    Each run gets a copy of an instance, with its parameters and its other attributes.
    """
    if isinstance(choice, type):
        return name_of_class(choice)
    kind = type(choice)
    if not hasattr(kind, "layer"):
        return choice
    if vars(choice).keys() != {"parameters"}:
        kind = _class_of_copies(choice)
    parameters: dict[str, Any] = msgspec.to_builtins(choice.parameters)
    return {"name": name_of_class(kind), **parameters}


def _class_of_copies(choice: Any) -> type:
    """A class whose instances are copies of a strategy."""
    kind = type(choice)

    def make(self: Any, parameters: Any = None) -> None:
        self.__dict__.update(copy.deepcopy(vars(choice)))
        self.parameters = choice.parameters if parameters is None else parameters

    name = f"{kind.__qualname__}-{len(_GIVEN)}"
    body = {"__init__": make, "__module__": kind.__module__, "__qualname__": name}
    return type(kind.__name__, (kind,), body | {"__doc__": kind.__doc__})


def load(layer: str, name: str) -> Any:
    """The class of a strategy. Raises InputError for an unknown name or a class of another layer."""
    if name in _GIVEN:
        return _of_layer(_GIVEN[name], layer, name)
    where = place(layer, name)
    if ":" not in where:
        raise InputError(
            f"{layer} strategy {name!r} is unknown; choose from {', '.join(names(layer))}"
            f"{nearest(name, names(layer))}; name your own as 'module:Class'"
        )
    module_name, _, class_name = where.partition(":")
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise InputError(
            f"{layer} strategy {name!r}: cannot import {module_name!r}: {error}"
        ) from error
    except Exception as error:  # any error of a user's module during its import
        raised = f"{type(error).__name__}: {error}"
        text = f"{layer} strategy {name!r}: importing {module_name!r} raised {raised}"
        raise InputError(text) from error
    found = getattr(module, class_name, None)
    if found is None:
        classes = [key for key, value in vars(module).items() if isinstance(value, type)]
        hint = nearest(class_name, classes)
        raise InputError(
            f"{layer} strategy {name!r}: no class {class_name!r} in {module_name}{hint}"
        )
    return _of_layer(found, layer, name)


def _of_layer(kind: Any, layer: str, name: str) -> Any:
    """Return a class that is a strategy of a layer. Raises InputError for another one."""
    theirs = getattr(kind, "layer", None)
    if theirs != layer:
        what = "not a strategy" if theirs is None else f"a strategy for layer {theirs!r}"
        raise InputError(f"{layer} strategy {name!r}: {name.rpartition(':')[2]} is {what}")
    return kind


# The zoning parameters from which a world is built, for any strategy.


class ZoningParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The initial zones; parameters of zoning strategies that have any of these extend this class."""

    design: Annotated[
        str | dict[str, Any] | None,
        Meta(
            description="The initial zones: the name of a shipped design, a file, or {zones: [...]}; "
            "default: simulated annealing on the flow between all stations."
        ),
    ] = None
    groups: Annotated[
        int,
        Meta(
            ge=2,
            le=500,
            description="Number of groups into which slots are divided on a floor without "
            "stations; each group counts as a station.",
        ),
    ] = 18
    priority: Annotated[
        dict[str, tuple[int, ...]],
        Meta(
            description="{TYPE: [stations]}: stations reserved for robots of one type; "
            "exchanges never assign them to another type."
        ),
    ] = {}


def zoning_parameters_of(parameters: msgspec.Struct) -> ZoningParameters:
    """The parameters of a zoning strategy that define the world, or the defaults.

    Raises InputError if a struct has its own parameter of such a name: it would be ignored.
    """
    if isinstance(parameters, ZoningParameters):
        return parameters
    names = ZoningParameters.__struct_fields__
    if isinstance(parameters, AsRecorded):
        said = {name: parameters.values[name] for name in names if name in parameters.values}
        return msgspec.convert(said, ZoningParameters)
    for name in names:
        if hasattr(parameters, name):
            raise InputError(
                f"strategy.zoning: {type(parameters).__name__} has the parameter {name}, so it must "
                "extend automaton.strategy.lookup.ZoningParameters"
            )
    return ZoningParameters()
