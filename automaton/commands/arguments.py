"""Arguments that several commands have."""

from __future__ import annotations

import argparse
from collections.abc import Callable


def add_scenario_arguments(parser: argparse.ArgumentParser) -> None:
    """Which scenario, with what changed: `scenario`, `seed` and `settings`."""
    parser.add_argument("scenario", metavar="SCENARIO", help="a file, or a shipped scenario")
    parser.add_argument("--seed", type=int, metavar="N", help="instead of the scenario's own")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="settings",
        metavar="KEY=VALUE",
        help="change a value of the scenario, such as fleet.robots=3; may be repeated",
    )


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
