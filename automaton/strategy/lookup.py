"""How a name in a scenario finds a strategy: the table, "module:Class", or an installed plug-in.

Built-ins have no privileges: the table is only the shortest way in. Importing this needs no Numba, and a
strategy is imported only when it is loaded.
"""

from __future__ import annotations

import importlib
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import msgspec
from msgspec import Meta

from automaton.errors import InputError, nearest


class NoParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A strategy without parameters."""


class AsRecorded(msgspec.Struct, frozen=True):
    """The parameters of a strategy that is not loaded: what a recording says of them."""

    values: dict[str, Any]

    def __getattr__(self, name: str) -> Any:
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None


def resolve_paths(parameters: Any, folder: Path) -> Any:
    """Parameters with the files that they name found from a folder, as absolute paths.

    Parameters that name files have a method `resolve_paths(folder)`, and `files` that lists them;
    they may have `check_files(driving)`, which reads them and raises InputError; `driving()` gives the
    floor's grid, and the ticks of each action of robots of the first type.
    """
    return parameters.resolve_paths(folder) if hasattr(parameters, "resolve_paths") else parameters


def files_of(parameters: Any) -> tuple[Path, ...]:
    """The files that parameters name."""
    return tuple(getattr(parameters, "files", ()))


# What a method of scheduling can be: the columns of Table 1 of Keith & La.
MULTIPLE: Final = "multiple AMRs"
DYNAMIC: Final = "dynamic environment"
MANUFACTURING: Final = "manufacturing"
WAREHOUSE: Final = "warehouse"
DECENTRALIZED: Final = "decentralized"
METHOD_PROPERTIES: Final = (MULTIPLE, DYNAMIC, MANUFACTURING, WAREHOUSE, DECENTRALIZED)


# Of which robots a right of way is the default: CatalogueEntry.default_for.
ROUTED: Final = "robots that follow routes"
STEERED: Final = "robots that are steered"
SLOW_STEERED: Final = (
    "robots that are steered, turn or move for several ticks, and mostly both ways"
)
IMPORTED: Final = "robots on floors of other programs"


class CatalogueEntry(NamedTuple):
    """One row of the table: where a strategy is, what parameters it takes, and one line for `list`.

    `properties`: those of METHOD_PROPERTIES that its method has; None where nobody has said.
    `default_for`: the robots whose default it is, "" for none.
    """

    implementation: str  # "module:Class"
    parameters: type[msgspec.Struct]
    summary: str
    properties: tuple[str, ...] | None = None
    default_for: str = ""


PLUGINS = "automaton.strategies"  # entry-point group; each entry is named "layer.name"
NO_STRATEGY = "none"  # zoning and charging may be absent
OPTIONAL_LAYERS = ("zoning", "charging")


@cache
def _catalogue() -> dict[str, dict[str, CatalogueEntry]]:
    catalogue: dict[str, dict[str, CatalogueEntry]] = importlib.import_module(
        "strategies.catalogue"
    ).CATALOGUE
    return catalogue


def zone_design_reader() -> Any:
    """What reads the zone design of a scenario (strategies.catalogue), whatever its zoning strategy.

    A replay needs it where the strategy is not installed, too.
    """
    module, _, name = importlib.import_module("strategies.catalogue").ZONE_DESIGNS.partition(":")
    return getattr(importlib.import_module(module), name)


@cache
def _plugins(layer: str) -> dict[str, str]:
    from importlib.metadata import entry_points  # with all that reads mails

    found = {}
    for point in entry_points(group=PLUGINS):
        kind, _, name = point.name.partition(".")
        if kind == layer and name:
            found[name] = point.value
    return found


def names(layer: str) -> list[str]:
    """The names that a scenario may use for a layer, "module:Class" aside."""
    optional = [NO_STRATEGY] if layer in OPTIONAL_LAYERS else []
    return optional + list(_catalogue()[layer]) + list(_plugins(layer))


def is_built_in(layer: str, name: str) -> bool:
    """Whether a name needs no plug-in."""
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
    """Where a strategy is implemented, "module:Class"; "" for none."""
    if name == NO_STRATEGY:
        return ""
    entry = _catalogue()[layer].get(name)
    return entry.implementation if entry else _plugins(layer).get(name, name)


def properties(layer: str, name: str) -> dict[str, bool]:
    """Which METHOD_PROPERTIES a strategy has, as its table says; empty where that says nothing."""
    entry = _catalogue()[layer].get(name)
    if entry is None or entry.properties is None:
        return {}
    return {one: one in entry.properties for one in METHOD_PROPERTIES}


# What a strategy may declare of itself, as an attribute of its class or of its Parameters.
STEERS: Final = "steers"  # right of way: robots go where it says, without routes
AVOIDS_TRAFFIC: Final = "avoids_traffic"  # routing: routes go around other robots
SEARCHES_BY_ASTAR: Final = "searches_by_astar"  # routing: a route is the path of an A* search
KEEPS_WAY_BACK: Final = "keeps_way_back"  # charging: a charger stays within reach
# Routing: where robots are steered instead, nothing is missing.
TAKES_SHORTEST_ROUTES: Final = "takes_shortest_routes"
DECLARATIONS: Final = (
    STEERS,
    AVOIDS_TRAFFIC,
    SEARCHES_BY_ASTAR,
    TAKES_SHORTEST_ROUTES,
    KEEPS_WAY_BACK,
)


def declares(layer: str, name: str, what: str) -> bool:
    """Whether a strategy declares one of DECLARATIONS; False for one that cannot be loaded here."""
    if is_built_in(layer, name):  # its parameters say so, which are read without Numba
        return bool(getattr(parameters_type(layer, name), what, False))
    try:
        kind = load(layer, name)
    except InputError:  # a recording is read without its strategies
        return False
    return bool(getattr(kind, what, False) or getattr(kind.Parameters, what, False))


def default_for(layer: str, robots: str) -> str:
    """The name of the strategy that declares itself the default for such robots."""
    entries = _catalogue()[layer].items()
    return next(name for name, entry in entries if entry.default_for == robots)


# Classes that a Python program has given, by "module:Class".
_GIVEN: dict[str, type] = {}


def name_of_class(kind: type) -> str:
    """The name by which a scenario finds a class from here on, in this process alone if it is local."""
    name = f"{kind.__module__}:{kind.__qualname__}"
    _GIVEN[name] = kind
    return name


def load(layer: str, name: str) -> Any:
    """The class of a strategy. Raises InputError for an unknown name or a class of another layer."""
    if name in _GIVEN:
        return _of_layer(_GIVEN[name], layer, name)
    where = place(layer, name)
    if ":" not in where:
        raise InputError(
            f"{layer} strategy {name!r} is unknown; known are {', '.join(names(layer))}"
            f"{nearest(name, names(layer))}; your own is named as 'module:Class'"
        )
    module_name, _, class_name = where.partition(":")
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise InputError(
            f"{layer} strategy {name!r}: cannot import {module_name!r}: {error}"
        ) from error
    except Exception as error:  # whatever a user's module does wrong while it is imported
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
    """A class if it is a strategy of a layer. Raises InputError for another one."""
    theirs = getattr(kind, "layer", None)
    if theirs != layer:
        what = "not a strategy" if theirs is None else f"a strategy for layer {theirs!r}"
        raise InputError(f"{layer} strategy {name!r}: {name.rpartition(':')[2]} is {what}")
    return kind


# The parameters of zoning from which a world is built, whatever the strategy.


class ZoningParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Where zones begin; the parameters of each zoning strategy that has any of these extend it."""

    design: Annotated[
        str | dict[str, Any] | None,
        Meta(
            description="The initial zones: the name of a shipped design, a file, or {zones: [...]}; "
            "left out: simulated annealing on the flow between all stations."
        ),
    ] = None
    groups: Annotated[
        int,
        Meta(
            ge=2,
            le=500,
            description="Number of groups of slots that count as stations, on a floor without "
            "stations.",
        ),
    ] = 18
    priority: Annotated[
        dict[str, tuple[int, ...]],
        Meta(
            description="{TYPE: [stations]}: stations that belong to robots of one type; no exchange "
            "gives such a station to another type."
        ),
    ] = {}


def zoning_parameters_of(parameters: msgspec.Struct) -> ZoningParameters:
    """What the parameters of a zoning strategy say of the world, or the defaults.

    Raises InputError where a struct has such a parameter of its own: it would be ignored.
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
