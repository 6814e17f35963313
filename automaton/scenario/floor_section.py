"""The floor of a scenario (generated, drawn in it, or in a separate file), and the JSON Schema."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Hashable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol, cast

import msgspec

from automaton.errors import InputError, InvalidValueError, Keys, alternatives, nearest
from automaton.floor.drawn_floors import (
    Legend,
    MatrixError,
    PictureError,
    check_new_symbol,
    draw_floor,
    read_matrix,
    symbol_of,
)
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.quantities import with_texts
from automaton.scenario.schema import (
    LAYER_NAMES,
    FileLayout,
    LegendEntry,
    MatrixLayout,
    PictureLayout,
    Scenario,
)
from automaton.scenario.text_files import read_text
from automaton.scenario.validation import shown, validated

LAYOUT: Keys = ("layout",)

RowError = Callable[[str, int], InputError]  # from a message and its row y
Schema = dict[str, Any]
SCHEMA_REFERENCE = "#/$defs/{name}"
PLUG_IN = {"type": "string", "pattern": "^[^:]+:[^:]+$", "description": "module:Class"}


class Generator(Hashable, Protocol):
    """A floor generator: a msgspec struct of parameters."""

    def build(self) -> FloorPlan:
        """The floor with these parameters."""


class Floor(NamedTuple):
    """A floor, and where its rows stand."""

    floor_plan: FloorPlan
    rows: Keys = ()  # keys of the rows of its picture; (): it was generated
    file: str = ""  # source of the rows

    def row_keys(self, y: int) -> Keys:
        """The keys of the row y of the picture, or of a layout without a picture."""
        return (*self.rows, y) if self.rows else LAYOUT


def floor_of(layout: dict[str, Any], folder: Path) -> Floor:
    """The floor that the layout of a scenario describes; `folder`: of its file. Raises InputError."""
    forms = {
        "generator": _generated,
        "picture": _drawn,
        "file": _from_file,
        "matrix": _from_matrix,
    }
    found = [form for form in forms if form in layout]
    if len(found) != 1:
        hint = next((nearest(key, forms) for key in layout if not found), "")
        raise InvalidValueError(
            LAYOUT, f"layout must have exactly one of {alternatives(forms)}{hint}"
        )
    return forms[found[0]](layout, folder)


def generators() -> dict[str, str]:
    """The floor generators by name, each as "module:Class"."""
    return cast("dict[str, str]", importlib.import_module("layouts").GENERATORS)


def is_shipped(layout: dict[str, Any]) -> bool:
    """Whether a layout names a generator that comes with the program."""
    name = layout.get("generator")
    return isinstance(name, str) and name in generators()


def generator_type(name: Any) -> type[msgspec.Struct]:
    """The struct of parameters of a generator, by name or "module:Class". Raises InputError."""
    known = generators()
    if not isinstance(name, str):
        raise InputError(f"layout.generator must be a name, found {shown(name)}")
    target = known.get(name, name)
    module, colon, attribute = target.partition(":")
    if not colon:
        raise InputError(
            f"unknown generator '{name}'{nearest(name, known)}; "
            f"there are {', '.join(known)}, or write module:Class"
        )
    try:
        found = getattr(importlib.import_module(module), attribute)
    except Exception as error:  # a user's module may raise anything on import
        raise InputError(f"generator '{name}' cannot be loaded: {error}") from error
    struct = isinstance(found, type) and issubclass(found, msgspec.Struct)
    if not struct or not hasattr(found, "build"):
        raise InputError(f"generator '{name}' is not a msgspec struct with a method build()")
    return cast("type[msgspec.Struct]", found)


def point_names(layout: dict[str, Any]) -> dict[str, tuple[int, int]]:
    """The names of cells that a generator defines for zone designs; mostly none.

    Raises InputError for parameters that the generator does not take.
    """
    if "generator" not in layout:
        return {}
    wanted = generator_type(layout["generator"])
    parameters = {key: value for key, value in layout.items() if key != "generator"}
    points = getattr(validated(parameters, wanted, LAYOUT), "points", None)
    return dict(points()) if points else {}


def _generated(layout: dict[str, Any], folder: Path) -> Floor:
    try:
        wanted = generator_type(layout["generator"])
    except InputError as error:
        raise InvalidValueError(("layout", "generator"), error.message) from None
    parameters = {key: value for key, value in layout.items() if key != "generator"}
    generator = cast(Generator, validated(parameters, wanted, LAYOUT))
    try:
        floor_plan = _built(generator)
    except InputError as error:
        raise InvalidValueError(LAYOUT, error.message) from None
    except Exception as error:  # the generator is a user's code
        text = f"generator {layout['generator']!r} failed: {type(error).__name__}: {error}"
        raise InvalidValueError(LAYOUT, text) from error
    if not isinstance(floor_plan, FloorPlan):
        text = (
            f"generator {layout['generator']!r} built {type(floor_plan).__name__}, not a FloorPlan"
        )
        raise InvalidValueError(LAYOUT, text)
    return Floor(floor_plan)


@lru_cache(maxsize=64)
def _built(generator: Generator) -> FloorPlan:
    return generator.build()


def _drawn(layout: dict[str, Any], folder: Path) -> Floor:
    drawn = validated(layout, PictureLayout, LAYOUT)
    keys: Keys = ("layout", "picture")

    def error_at(message: str, row: int) -> InputError:
        return InvalidValueError((*keys, row), message)

    return Floor(_picture(drawn.picture, _legend(drawn.legend), error_at), keys)


def _from_file(layout: dict[str, Any], folder: Path) -> Floor:
    wanted = validated(layout, FileLayout, LAYOUT)
    path = _floor_file(folder, "file", wanted.file)
    picture = _picture(read_text(path), _legend(wanted.legend), _error_in(path))
    return Floor(picture, ("layout", "file"), str(path))


def _from_matrix(layout: dict[str, Any], folder: Path) -> Floor:
    wanted = validated(layout, MatrixLayout, LAYOUT)
    path = _floor_file(folder, "matrix", wanted.matrix)
    text = read_text(path)
    try:
        return Floor(read_matrix(text, wanted.capacity), ("layout", "matrix"), str(path))
    except MatrixError as error:
        raise InputError(error.message, str(path), error.row + 1) from None


def _floor_file(folder: Path, key: str, name: str) -> Path:
    """A file beside the scenario. Raises InvalidValueError."""
    path = folder / name
    if not os.path.isfile(path):
        raise InvalidValueError(("layout", key), f"there is no floor file '{name}'")
    return path


def _error_in(path: Path) -> RowError:
    return lambda message, row: InputError(message, str(path), row + 1)


def _picture(picture: str, legend: Legend, error_at: RowError) -> FloorPlan:
    tab = picture.find("\t")
    if tab >= 0:
        raise error_at("the picture holds a tab; use blanks or '#'", picture.count("\n", 0, tab))
    try:
        return draw_floor(picture, legend)
    except PictureError as error:
        raise error_at(error.message, error.row) from None


def _legend(legend: dict[str, Any]) -> Legend:
    symbols = []
    for character, value in legend.items():
        keys: Keys = ("layout", "legend", character)
        try:
            check_new_symbol(character)
            entry = validated(value, LegendEntry, keys)
            symbol = symbol_of(entry.kind, entry.capacity, entry.exits, entry.loaded, entry.opens)
        except InvalidValueError:
            raise
        except InputError as error:
            raise InvalidValueError(keys, error.message) from None
        symbols.append((character, symbol))
    return tuple(symbols)


# The JSON Schema, derived from the structs that read scenario files.


def json_schema() -> Schema:
    """A JSON Schema (2020-12) for editors and other programs."""
    (reference,), definitions = msgspec.json.schema_components(
        (Scenario,), ref_template=SCHEMA_REFERENCE
    )
    definitions["Scenario"]["properties"]["layout"] = {
        "description": "The floor: generated, drawn here, or in a separate file.",
        "oneOf": _layouts(definitions),
    }
    layers = definitions["Strategies"]["properties"]
    for layer in LAYER_NAMES:
        choices = _choices(layer, definitions)
        if layers[layer]["default"] is None:
            choices = [*choices, {"type": "null"}]
        layers[layer] = {**_kept(layers[layer]), "anyOf": choices}
    own = definitions["TypeStrategy"]["properties"]
    choices = [*_choices("allocation", definitions), {"type": "null"}]
    own["allocation"] = {**_kept(own["allocation"]), "anyOf": choices}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "automaton scenario",
        **reference,
        "$defs": with_texts(definitions),
    }


def _layouts(definitions: dict[str, Any]) -> list[Schema]:
    built_in = [
        _named("generator", name, generator_type(name), definitions) for name in generators()
    ]
    foreign = {
        "type": "object",
        "title": "generator of a plug-in",
        "properties": {"generator": PLUG_IN},
        "required": ["generator"],
    }
    legend = {
        "type": "object",
        "propertyNames": {"minLength": 1, "maxLength": 1, "pattern": "^[^A-Z]$"},
        "additionalProperties": _component(LegendEntry, definitions),
        "description": "Symbols beyond the built-in ones.",
    }
    forms = (PictureLayout, FileLayout, MatrixLayout)
    drawn = [_component(form, definitions) for form in forms]
    for form in (PictureLayout, FileLayout):
        definitions[form.__name__]["properties"]["legend"] = legend
    return [*built_in, foreign, *drawn]


def _choices(layer: str, definitions: dict[str, Any]) -> list[Schema]:
    from automaton.strategy import lookup

    names = lookup.names(layer)
    built_in = [
        _named("name", name, lookup.parameters_type(layer, name), definitions, layer)
        for name in names
    ]
    foreign = {"type": "object", "properties": {"name": PLUG_IN}, "required": ["name"]}
    return [{"enum": names}, PLUG_IN, *built_in, foreign]


def _named(
    key: str,
    name: str,
    parameters: type[msgspec.Struct],
    definitions: dict[str, Any],
    prefix: str = "layout",
) -> Schema:
    """A mapping of `key: name` and the parameters, as a separate definition."""
    (reference,), parts = msgspec.json.schema_components(
        (parameters,), ref_template=SCHEMA_REFERENCE
    )
    own = parts.pop(reference["$ref"].rpartition("/")[2])
    for part_name, part in parts.items():
        definitions.setdefault(part_name, part)
    title = f"{prefix}-{name}"
    definitions[title] = {
        "title": title,
        "description": own.get("description", ""),
        "type": "object",
        "properties": {key: {"const": name}, **own.get("properties", {})},
        "required": [key, *own.get("required", [])],
        "additionalProperties": False,
    }
    return {"$ref": SCHEMA_REFERENCE.format(name=title)}


def _component(struct: type[msgspec.Struct], definitions: dict[str, Any]) -> Schema:
    """A reference to a struct; it and its parts are added to the definitions."""
    (reference,), parts = msgspec.json.schema_components((struct,), ref_template=SCHEMA_REFERENCE)
    for name, part in parts.items():
        definitions.setdefault(name, part)
    return reference


def _kept(schema: Schema) -> Schema:
    return {key: value for key, value in schema.items() if key in ("description", "default")}
