"""The JSON Schema of study files, derived from the structs that read them."""

from __future__ import annotations

from typing import Any

import msgspec

from automaton.scenario.scenario_schema import REFERENCE
from automaton.studies.sweeps.study import Study


def study_schema() -> dict[str, Any]:
    """A JSON Schema (2020-12) for editors and other programs."""
    (reference,), definitions = msgspec.json.schema_components((Study,), ref_template=REFERENCE)
    mapping = definitions["Study"]["properties"]["factors"]["anyOf"][0]
    mapping["additionalProperties"] = {"type": "array", "minItems": 1}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "automaton study",
        **reference,
        "$defs": definitions,
    }
