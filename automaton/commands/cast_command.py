"""Make a film of a recording, to be played by asciinema or a browser, or a picture of one tick.

Films for asciinema and pictures are drawn as the viewer draws, but without a terminal; a film for a
browser is one HTML file. Exit code 0: made; 2: bad input.
"""

from __future__ import annotations

import argparse
from fractions import Fraction
from pathlib import Path

from automaton.commands.arguments import add_recording_argument, frame_rate, tick, whole
from automaton.commands.watch import viewer
from automaton.errors import InputError

SPEEDS = (Fraction(1, 100), Fraction(10_000))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton cast`."""
    add = parser.add_argument
    add_recording_argument(parser)
    add("--out", type=Path, metavar="FILE", help="instead of FILE.cast; - is standard output")
    add("--from", type=tick, metavar="TICK", dest="first", help="the first tick shown (0)")
    add("--to", type=tick, metavar="TICK", dest="last", help="the last one")
    add("--speed", type=speed, metavar="F", help="x1 is 10 ticks a second")
    add("--fps", type=frame_rate, metavar="N", help="pictures a second at most (10)")
    add("--size", type=size, metavar="COLSxROWS", help="of the screen; else as the floor needs")
    add(
        "--zoom",
        default="fit",
        metavar="ZOOM",
        help="fit, 6x3, 4x2, 3x1, 1x1, half, braille-1, ...",
    )
    add(
        "--follow",
        type=whole("a robot", 0),
        default=-1,
        metavar="ROBOT",
        help="select it, and its route",
    )
    add(
        "--layer",
        default="",
        metavar="NAME",
        help="service-zones, traffic-zones, visits, flow, explored, ...",
    )
    add("--theme", choices=("dark", "light"), default="dark", help="dark unless given")
    add("--color", choices=("true", "256", "16", "none"), default="true", help="depth")
    add("--ascii", action="store_true", help="no characters beyond ASCII")
    add("--html", type=Path, metavar="FILE", help="make this page instead: it plays in a browser")
    add("--picture", type=Path, metavar="FILE", help="make this picture instead: .svg or .txt")
    add("--at", type=tick, metavar="TICK", help="the tick of the picture; else the last one")


def speed(text: str) -> Fraction:
    """A factor; exact, so that times are."""
    least, most = SPEEDS
    try:
        factor = Fraction(text.removeprefix("x"))
    except (ValueError, ZeroDivisionError):
        factor = Fraction(0)
    if not least <= factor <= most:
        allowed = f"{float(least):g} to {float(most):g}"
        raise argparse.ArgumentTypeError(f"{text!r} is not a speed: allowed are {allowed}")
    return factor


def size(text: str) -> tuple[int, int]:
    """Columns and rows."""
    columns, _, rows = text.partition("x")
    if not (columns.isdecimal() and rows.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 80x24")
    return int(columns), int(rows)


def run(args: argparse.Namespace) -> int:
    """Make the one or the other."""
    _check_together(args)
    if args.html is not None:
        viewer("web_film.film_page").make_page(
            args.file,
            args.html,
            args.first,
            args.last,
            speed=float(args.speed or 1),
            follow=args.follow,
            theme=args.theme,
        )
        return 0
    how = ("size", "zoom", "follow", "layer", "theme", "color", "ascii")
    chosen = {name: getattr(args, name) for name in how}
    when = {name: getattr(args, name) for name in ("first", "last", "speed", "fps")}
    chosen |= {name: value for name, value in when.items() if value is not None}
    request = viewer("cast.film_request").Request(**chosen)
    if args.picture is not None:
        viewer("cast.film_making").make_picture(args.file, request, args.picture, args.at)
    else:
        viewer("cast.film_making").make_film(args.file, request, args.out)
    return 0


def _check_together(args: argparse.Namespace) -> None:
    """A picture has a tick, a film has a stretch of them, and a page draws by itself."""
    if args.html is not None:
        _check_page(args)
    of_films = {"--out": args.out, "--from": args.first, "--to": args.last}
    of_films |= {"--speed": args.speed, "--fps": args.fps}
    given = [name for name, value in of_films.items() if value is not None]
    if args.picture is not None and given:
        raise InputError(f"{given[0]} is for films: it does not go together with --picture")
    if args.picture is None and args.at is not None:
        raise InputError("--at is for pictures: it goes together with --picture")


def _check_page(args: argparse.Namespace) -> None:
    if args.html.suffix not in (".html", ".htm"):
        raise InputError(f"{str(args.html)!r} names no page: allowed is FILE.html")
    others = {"--out": args.out, "--picture": args.picture, "--fps": args.fps, "--size": args.size}
    others |= {"--layer": args.layer or None, "--ascii": args.ascii or None}
    others |= {"--zoom": None if args.zoom == "fit" else args.zoom}
    others |= {"--color": None if args.color == "true" else args.color}
    named = [name for name, value in others.items() if value is not None]
    if named:
        raise InputError(f"{named[0]} does not go together with --html")
