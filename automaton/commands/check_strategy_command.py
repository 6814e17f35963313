"""Check a strategy on random floors.

Exit code 0: it conforms; 1: it does not; 2: bad input.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import yaml

from automaton.commands.arguments import add_json_argument, note, print_json, show_line, whole
from automaton.conformance import CONFORMANCE_CHECKS, FAILS, CheckRequest, Verdict, checked
from automaton.errors import InputError
from automaton.scenario.document import parse
from automaton.scenario.reading import document_of

SCENARIO_SEEDS = 10  # runs of a scenario that replaces the random floors
MAX_FLOORS = 100_000


def seconds(text: str) -> float:
    """The type of a time limit."""
    try:
        limit = float(text)
    except ValueError:
        limit = 0.0
    if not 0 < limit <= 86_400:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds above 0")
    return limit


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton check-strategy`."""
    add = parser.add_argument
    text = "the class of a strategy, MODULE:CLASS, or LAYER:NAME of `automaton list`"
    add("strategy", metavar="STRATEGY", help=text)
    text = f"check N random floors (default: 200; with --scenario {SCENARIO_SEEDS} seeds)"
    add("--floors", type=whole("a number of floors", 1, MAX_FLOORS), metavar="N", help=text)
    text = "draw other floors (default: 1)"
    add("--seed", type=whole("a seed", 0, 2**63 - 1), default=1, metavar="N", help=text)
    add("--only", metavar="CHECK", help=f"make only this check: {', '.join(CONFORMANCE_CHECKS)}")
    text = "check only the floor of this number, such as one that has failed"
    add("--case", type=whole("a case", 0, MAX_FLOORS), metavar="K", help=text)
    text = "check with a scenario instead of random floors"
    add("--scenario", metavar="NAME", help=text)
    text = "parameters of the strategy, such as '{choice: 5}'"
    add("--parameters", metavar="YAML", help=text)
    text = "write the first floor on which each check fails into this folder, as a scenario"
    add("--keep", type=Path, metavar="DIR", help=text)
    text = "fail a strategy that takes longer for a decision, in seconds (default: 60)"
    add("--strategy-timeout", type=seconds, default=60.0, metavar="S", help=text)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Check and print the verdict."""
    document = None if args.scenario is None else document_of(args.scenario).data
    default = 200 if document is None else SCENARIO_SEEDS
    request = CheckRequest(
        strategy=args.strategy,
        floors=args.floors or default,
        seed=args.seed,
        only=args.only,
        case=args.case,
        scenario=args.scenario,
        document=document,
        parameters=parameters_of(args.parameters),
        timeout=args.strategy_timeout,
    )
    verdict = checked(request, show_progress)
    if args.keep is not None:
        keep(args.keep, request, verdict)
    if args.json:
        print_json(verdict.as_json())
    else:
        print("\n".join(verdict.lines(width=None)))
    return 0 if verdict.conforms else 1


def show_progress(done: str, begun: str) -> None:
    """Say how far the check is; not on a terminal, what begins."""
    if sys.stderr.isatty():
        show_line(done)
    elif begun:
        note(begun)


def parameters_of(text: str | None) -> dict[str, Any] | None:
    """The parameters as YAML. Raises InputError."""
    if text is None:
        return None
    values, _ = parse(text, "--parameters")
    if not isinstance(values, dict):
        raise InputError("must be a mapping such as {choice: 5}", f"--parameters {text}")
    return values


class PictureDumper(yaml.SafeDumper):
    """Writes texts of several lines, such as pictures of floors, as they are."""


PictureDumper.add_representer(
    str,
    lambda dumper, text: dumper.represent_scalar(
        "tag:yaml.org,2002:str", text, style="|" if "\n" in text else None
    ),
)


def failing_floors(request: CheckRequest, verdict: Verdict) -> dict[str, Any]:
    """The first floor of each failing check, by the name of its file."""
    from automaton.conformance.random_cases import delivery_floor, odd_case, random_case

    floors: dict[str, Any] = {}
    for one in verdict.checks:
        if one.verdict != FAILS or one.case is None:
            continue
        if one.name == "delivery":
            floors[f"delivery-{one.case}"] = delivery_floor(verdict.layer, one.case)
            continue
        if request.document is not None:
            case = {**request.document, "seed": request.seed + one.case}
        else:
            case = random_case(request.seed, one.case, verdict.layer)
        floors[f"case-{one.case}"] = case
        if one.name == "survival":  # which also takes odd forms of the cases
            floors[f"odd-case-{one.case}"] = odd_case(case, one.case)
    return floors


def keep(folder: Path, request: CheckRequest, verdict: Verdict) -> None:
    """Write the first floor of each failing check as a scenario. Raises InputError."""
    from automaton.conformance.random_cases import fitting_case

    _, _, name = request.strategy.rpartition(f"{verdict.layer}:")
    choice: Any = {"name": name, **request.parameters} if request.parameters else name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for case, floor in failing_floors(request, verdict).items():
            file = folder / f"{case}.yaml"
            try:
                content = fitting_case(floor, verdict.layer, choice) | {"name": case}
            except InputError as refusal:
                note(f"{case}: not written, as the strategy refuses it: {refusal.message}")
                continue
            file.write_text(yaml.dump(content, Dumper=PictureDumper, sort_keys=False))
            note(f"wrote {file}")
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", str(folder)) from error
