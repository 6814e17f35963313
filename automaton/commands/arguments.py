"""What several commands have: arguments, JSON, notes and progress on stderr."""

from __future__ import annotations

import argparse
import contextlib
import json
import re
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from automaton.errors import InputError
from automaton.exchange.imported_floor import ImportOptions
from automaton.scenario.document import Override, parse, read_text
from automaton.scenario.quantities import is_clock_time
from automaton.scenario.schema import MAX_REFINEMENT
from automaton.units import exact_length, exact_time
from automaton.world.resolve import Resolved
from automaton.world.scenario_warnings import scenario_warnings

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn


def add_scenario_arguments(parser: argparse.ArgumentParser) -> None:
    """Which scenario, with what changed: `scenario`, `seed` and `settings`."""
    parser.add_argument("scenario", metavar="SCENARIO", help="a file, or a shipped scenario")
    parser.add_argument("--seed", type=int, metavar="N", help="instead of the scenario's own")
    add_settings_argument(parser)


def add_settings_argument(
    parser: argparse.ArgumentParser,
    text: str = "change a value of the scenario, such as fleet.robots=3; may be repeated",
) -> None:
    """What to change in a scenario: `settings`; `text` says what may change."""
    parser.add_argument(
        "--set",
        action=AppendSettings,
        default=[],
        dest="settings",
        metavar="KEY=VALUE",
        help=f"{text}; @FILE: settings of a file",
    )


class AppendSettings(argparse.Action):
    """Collects KEY=VALUE; of @FILE what the first two levels of its keys give."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Add to what came before."""
        more = settings_in(Path(values[1:])) if values.startswith("@") else [values]
        setattr(namespace, self.dest, [*getattr(namespace, self.dest), *more])


def settings_in(path: Path) -> list[str]:
    """The settings in a file, as they are typed. Raises InputError."""
    if not path.is_file():
        raise InputError("no such file", str(path))
    data, _ = parse(read_text(path), str(path))
    if not isinstance(data, dict):
        raise InputError("a file of settings has keys of a scenario, such as strategy", str(path))
    return [
        f"{key}={json.dumps(value)}"
        for section, part in data.items()
        for key, value in (
            ((f"{section}.{name}", one) for name, one in part.items())
            if isinstance(part, dict)
            else ((section, part),)
        )
    ]


def add_refinement_arguments(parser: argparse.ArgumentParser) -> None:
    """How much finer the tick is, and when strategies decide: both go into `settings`."""
    parser.add_argument(
        "--refine",
        type=whole("a refinement", 1, MAX_REFINEMENT),
        metavar="K",
        help="make the tick K times finer: every number of ticks is multiplied by K",
    )
    parser.add_argument(
        "--decide",
        choices=("coarse", "fine"),
        help="coarse: strategies decide as often as without --refine (default); fine: in every tick",
    )


def settings_of(args: argparse.Namespace) -> tuple[str | Override, ...]:
    """The settings of a scenario, its refinement included. Raises InputError."""
    refined = []
    if args.refine is not None:
        refined.append(Override(f"--refine {args.refine}", ("refine",), args.refine))
    if args.decide is not None:
        if args.refine is None:
            raise InputError("is for refined ticks; set --refine K, too", f"--decide {args.decide}")
        refined.append(Override(f"--decide {args.decide}", ("decide",), args.decide))
    return (*args.settings, *refined)


def add_recording_argument(parser: argparse.ArgumentParser, name: str = "FILE") -> None:
    """Which recording: `file`."""
    parser.add_argument("file", type=Path, metavar=name, help="a recording, whole or cut short")


def add_json_argument(parser: argparse._ActionsContainer) -> None:
    """Whether to print JSON: `json`."""
    parser.add_argument("--json", action="store_true", help="one JSON object instead of text")


def add_workers_argument(parser: argparse.ArgumentParser, most: int | None = None) -> None:
    """How many processes: `workers`."""
    processes, text = (
        whole("a number of processes", 1, most),
        "processes, default one for each core",
    )
    parser.add_argument("--workers", type=processes, metavar="N", help=text)


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
    for warning in scenario_warnings(resolved):
        note(f"{resolved.scenario.name}: warning: {warning}")


def note(text: str) -> None:
    """Print a sentence on stderr."""
    sys.stdout.flush()  # keeps the order where both streams meet
    print(f"automaton: {text}", file=sys.stderr, flush=True)


def print_json(data: Any) -> None:
    """Print an object as JSON."""
    print(json.dumps(data, indent=2, ensure_ascii=False))


@contextlib.contextmanager
def progress_bar(*columns: str | ProgressColumn) -> Iterator[Progress]:
    """A bar on stderr, for terminals alone; it disappears in the end."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        yield bar


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


def tick_or_time(text: str) -> int | str:
    """The type of an argument that is a tick, or a clock time of a run whose units have a clock."""
    return text if is_clock_time(text) else tick(text)


frame_rate = whole("a frame rate", 1, 120)


# The arguments of `automaton import` that count for layouts, and what they say with their units.


DEFAULTS: Final = ImportOptions()
PERCENT_TEXT: Final = re.compile(r"(\d{1,4}(?:\.\d{1,6})?)\s*%")
SPEED_TEXT: Final = re.compile(r"(.+)/\s*(\w+)\s*")


def add_layout_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments that count for layouts alone."""
    add = parser.add_argument_group("of layouts").add_argument
    add("--floor", type=Path, metavar="FILE", help="write the picture of the floor to FILE")
    add(
        "--cell",
        type=measured("a length", "0.5m", exact_length),
        metavar="0.5m",
        help="the side of a cell; default: the largest that fits",
    )
    add(
        "--tick",
        type=measured("a time", "0.5s", exact_time),
        metavar="0.5s",
        help="default: what the fastest robot takes for a cell",
    )
    add(
        "--speed",
        type=measured("a speed", "1.5m/s", exact_speed),
        metavar="1m/s",
        help="where the file gives none",
    )
    add(
        "--robot",
        type=measured("a length", "0.6m", exact_length),
        metavar="0.6m",
        help="of images: the width of a robot; default: that of a cell",
    )
    add(
        "--unknown",
        choices=("wall", "free"),
        default=DEFAULTS.unknown,
        help="of images: what unknown area is, default wall",
    )
    add("--layout", metavar="ID", help="which layout, if the file has several")
    add("--type", metavar="NAME", help="which type of robots, if the file has several")
    add(
        "--accept",
        type=share,
        default=DEFAULTS.accept,
        metavar="5%",
        help="the largest error of an edge",
    )


def options_of(args: argparse.Namespace) -> ImportOptions:
    """Return what the arguments say."""
    return ImportOptions(
        args.cell,
        args.tick,
        args.speed,
        args.layout,
        args.type,
        args.accept,
        robots=args.robots,
        ticks=args.ticks,
        robot=args.robot,
        unknown=args.unknown,
    )


def measured(
    name: str, example: str, read: Callable[[str], Fraction | None]
) -> Callable[[str], Fraction]:
    """The type of an argument above 0 with a unit; `read`: its text in m, s or m/s."""

    def amount(text: str) -> Fraction:
        value = read(text) if len(text) <= 40 else None
        if value is None or not Fraction(1, 10**6) <= value <= 10**6:
            raise argparse.ArgumentTypeError(f"{text!r} is not {name} such as {example}")
        return value

    return amount


def exact_speed(text: str) -> Fraction | None:
    """Metres in a second of a speed such as "4 km/h", exactly; None: it is not one."""
    match = SPEED_TEXT.fullmatch(text)
    metres, time = (exact_length(match[1]), exact_time(f"1 {match[2]}")) if match else (None, None)
    return None if metres is None or time is None else metres / time


def share(text: str) -> float:
    """Return a percentage such as 10% as a share."""
    match = PERCENT_TEXT.fullmatch(text.strip())
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a percentage such as 10%")
    return float(match[1]) / 100
