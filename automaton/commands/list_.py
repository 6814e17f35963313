"""List what is there to use: scenarios, studies, floor generators and strategies."""

from __future__ import annotations

import argparse
from typing import Any

from automaton.commands.arguments import add_json_argument, print_json
from automaton.scenario.floor_section import generator_type, generators
from automaton.scenario.reading import read
from automaton.scenario.schema import LAYER_NAMES
from automaton.scenario.text_files import shipped
from automaton.studies.sweeps.study import shipped_studies, study_document

SAID = ("summary", "properties")  # no columns of the inventory


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton list`."""
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Print what there is."""
    found = inventory()
    if args.json:
        print_json(found)
    else:
        print(as_text(found))
    return 0


def inventory() -> dict[str, list[dict[str, Any]]]:
    """Everything that a scenario or the command line can name, with one line each."""
    from automaton.strategy import lookup

    scenarios = [
        {"name": name, "summary": read(path).data.get("summary") or ""}
        for name, path in shipped().items()
    ]
    studies = [
        {"name": name, "summary": study_document(path).data.get("summary") or ""}
        for name, path in shipped_studies().items()
    ]
    floors = [
        {"name": name, "summary": (generator_type(name).__doc__ or "").split("\n")[0]}
        for name in generators()
    ]
    strategies = [
        {
            **{"name": name, "layer": layer, "summary": lookup.summary(layer, name)},
            **({"properties": said} if (said := lookup.properties(layer, name)) else {}),
        }
        for layer in LAYER_NAMES
        for name in lookup.names(layer)
    ]
    return {"scenarios": scenarios, "studies": studies, "floors": floors, "strategies": strategies}


def as_text(found: dict[str, list[dict[str, Any]]]) -> str:
    """The inventory as headed, aligned columns; what is empty is left out."""
    blocks = []
    for heading, entries in found.items():
        columns = [[entry[key] for key in entry if key not in SAID] for entry in entries]
        if not columns:
            continue
        widths = [max(map(len, column)) for column in zip(*columns, strict=True)]
        lines = [
            "  ".join(
                [
                    *(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)),
                    entry["summary"],
                ]
            )
            for row, entry in zip(columns, entries, strict=True)
        ]
        blocks.append("\n".join([heading, *(f"  {line}" for line in lines)]))
    return "\n\n".join([*blocks, _properties(found["strategies"])])


def _properties(strategies: list[dict[str, Any]]) -> str:
    """A table of what the methods of strategies can be used for."""
    rows = [(entry["name"], entry["properties"]) for entry in strategies if "properties" in entry]
    names = list(rows[0][1])
    wide = max(len(name) for name, _ in rows)
    lines = [f"  {'':<{wide}}  {'  '.join(names)}"]
    for name, has in rows:
        cells = (f"{'yes' if has[one] else '-':<{len(one)}}" for one in names)
        lines.append(f"  {name:<{wide}}  {'  '.join(cells)}".rstrip())
    return "\n".join(["what zoning is for (Keith & La, Table 1)", *lines])
