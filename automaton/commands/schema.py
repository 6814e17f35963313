"""Print the JSON Schema of scenario files, with the parameters of generators and strategies."""

from __future__ import annotations

import argparse
import json

from automaton.scenario.json_schema import json_schema


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """`automaton schema` takes no arguments."""


def run(args: argparse.Namespace) -> int:
    """Print the schema."""
    print(json.dumps(json_schema(), indent=2))
    return 0
