"""The arguments of `automaton import` that count for layouts, and what they say with their units."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Final

from automaton.exchange.imported_floor import ImportOptions
from automaton.units import exact_length, exact_time

DEFAULTS: Final = ImportOptions()
PERCENT: Final = re.compile(r"(\d{1,4}(?:\.\d{1,6})?)\s*%")
SPEED: Final = re.compile(r"(.+)/\s*(\w+)\s*")


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
    match = SPEED.fullmatch(text)
    metres, time = (exact_length(match[1]), exact_time(f"1 {match[2]}")) if match else (None, None)
    return None if metres is None or time is None else metres / time


def share(text: str) -> float:
    """Return a percentage such as 10% as a share."""
    match = PERCENT.fullmatch(text.strip())
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a percentage such as 10%")
    return float(match[1]) / 100
