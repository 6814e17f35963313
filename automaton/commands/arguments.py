"""Arguments that several commands have."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

from automaton.build.resolve import Resolved
from automaton.build.scenario_warnings import scenario_warnings


def add_scenario_arguments(parser: argparse.ArgumentParser) -> None:
    """Which scenario, with what changed: `scenario`, `seed` and `settings`."""
    parser.add_argument("scenario", metavar="SCENARIO", help="a file, or a shipped scenario")
    parser.add_argument("--seed", type=int, metavar="N", help="instead of the scenario's own")
    add_settings_argument(parser)


def add_settings_argument(parser: argparse.ArgumentParser) -> None:
    """What to change in a scenario: `settings`."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="settings",
        metavar="KEY=VALUE",
        help="change a value of the scenario, such as fleet.robots=3; may be repeated",
    )


def add_timeout_argument(parser: argparse.ArgumentParser) -> None:
    """How long a strategy may take: `strategy_timeout`."""
    parser.add_argument(
        "--strategy-timeout",
        type=whole("a number of seconds", 1),
        metavar="S",
        help="a run fails when a strategy in Python takes more seconds than these for a decision",
    )


def print_warnings(resolved: Resolved) -> None:
    """Print a warning for settings that are legal but probably mistakes."""
    sys.stdout.flush()  # keeps the order where both streams meet
    for warning in scenario_warnings(resolved):
        print(f"automaton: {resolved.scenario.name}: warning: {warning}", file=sys.stderr)


def whole(name: str, least: int, most: int | None = None) -> Callable[[str], int]:
    """The type of an argument that is a whole number; `name` says what: "a tick"."""

    def read(text: str) -> int:
        number = int(text) if text.isdecimal() and len(text) < 19 else -1
        if not least <= number <= (number if most is None else most):
            raise argparse.ArgumentTypeError(f"{text!r} is not {name}: allowed are {allowed}")
        return number

    allowed = (
        f"{least}, {least + 1}, {least + 2} and so on" if most is None else f"{least} to {most}"
    )
    return read


tick = whole("a tick", 0)
frame_rate = whole("a frame rate", 1, 120)
