"""List the available scenarios, studies, floor generators and strategies."""

from __future__ import annotations

import argparse
from typing import Any

from automaton.commands.arguments import add_json_argument, print_document, print_json
from automaton.documents.report_document import Heading, ReportDocument, Table
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
    """Print the inventory."""
    found = inventory()
    if args.json:
        print_json(found)
    else:
        print_document(inventory_document(found))
    return 0


def inventory() -> dict[str, list[dict[str, Any]]]:
    """Everything that a scenario or a command can name, with one line each."""
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


def inventory_document(found: dict[str, list[dict[str, Any]]]) -> ReportDocument:
    """The inventory as tables; empty ones are left out."""
    document = ReportDocument("available")
    for heading, entries in found.items():
        rows = [
            [*(entry[key] for key in entry if key not in SAID), entry["summary"]]
            for entry in entries
        ]
        if rows:
            document.add(Heading(heading, 3), Table([""] * len(rows[0]), rows, left=len(rows[0])))
    document.add(*properties_table(found["strategies"]))
    return document


def properties_table(strategies: list[dict[str, Any]]) -> tuple[Heading, Table]:
    """A table of the uses of each zoning method."""
    properties = {one["name"]: one["properties"] for one in strategies if "properties" in one}
    names = list(next(iter(properties.values())))
    rows = [
        [method, *("yes" if has[name] else "no" for name in names)]
        for method, has in properties.items()
    ]
    title = Heading("uses of zoning methods (Keith & La, Table 1)", 3)
    return title, Table(["", *names], rows, left=1 + len(names))
