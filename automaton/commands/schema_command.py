"""Print the JSON Schema of scenario or study files, for editors and other tools."""

from __future__ import annotations

import argparse
import json

from automaton.scenario.floor_section import json_schema
from automaton.studies.sweeps.study import study_schema

SCHEMAS = {"scenario": json_schema, "study": study_schema}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton schema`."""
    parser.add_argument(
        "what",
        nargs="?",
        default="scenario",
        choices=SCHEMAS,
        help="the schema of scenarios, with parameters of generators and strategies (default), or of "
        "studies",
    )


def run(args: argparse.Namespace) -> int:
    """Print the schema."""
    print(json.dumps(SCHEMAS[args.what](), indent=2))
    return 0
