"""The JSON Schema of scenario files, derived from the structs that read them."""

from __future__ import annotations

from typing import Any

import msgspec

from automaton.scenario.floor_section import generator_type, generators
from automaton.scenario.quantities import with_texts
from automaton.scenario.schema import (
    LAYER_NAMES,
    FileLayout,
    LegendEntry,
    MatrixLayout,
    PictureLayout,
    Scenario,
)

Schema = dict[str, Any]

REFERENCE = "#/$defs/{name}"
PLUG_IN = {"type": "string", "pattern": "^[^:]+:[^:]+$", "description": "module:Class"}


def json_schema() -> Schema:
    """A JSON Schema (2020-12) for editors and other programs."""
    (reference,), definitions = msgspec.json.schema_components((Scenario,), ref_template=REFERENCE)
    definitions["Scenario"]["properties"]["layout"] = {
        "description": "The floor: generated, drawn here, or in a file of its own.",
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
    """A mapping that holds `key: name` and the parameters, kept under a definition of its own."""
    (reference,), parts = msgspec.json.schema_components((parameters,), ref_template=REFERENCE)
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
    return {"$ref": REFERENCE.format(name=title)}


def _component(struct: type[msgspec.Struct], definitions: dict[str, Any]) -> Schema:
    """A reference to a struct, which is added to the definitions with what it is made of."""
    (reference,), parts = msgspec.json.schema_components((struct,), ref_template=REFERENCE)
    for name, part in parts.items():
        definitions.setdefault(name, part)
    return reference


def _kept(schema: Schema) -> Schema:
    return {key: value for key, value in schema.items() if key in ("description", "default")}
