"""Make a film of a recording, for a slide, a chat, a browser or asciinema, or a picture of one tick.

GIF, MP4, PNG and pages for a browser are drawn; films for asciinema, SVG and text show what the viewer
shows, but without a terminal. Exit code 0: made; 2: bad input.
"""

from __future__ import annotations

import argparse
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from automaton.commands.arguments import add_recording_argument, frame_rate, tick, whole
from automaton.commands.watch import viewer
from automaton.errors import InputError

if TYPE_CHECKING:  # it needs Numba
    from automaton.films.pixel_film import PixelRequest

FILM_SUFFIXES: Final = (".gif", ".mp4", ".png")  # of drawn films
FILM_SPEEDS = (Fraction(1, 100), Fraction(10_000))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton cast`."""
    add = parser.add_argument
    add_recording_argument(parser)
    add(
        "--out",
        type=Path,
        metavar="FILE",
        help="make this film: .gif, .mp4, .png (animated) or .cast; - is a .cast to standard output",
    )
    add("--from", type=tick, metavar="TICK", dest="first", help="the first tick shown (0)")
    add("--to", type=tick, metavar="TICK", dest="last", help="the last one")
    add("--speed", type=speed, metavar="F", help="x1 is 10 ticks a second")
    add("--fps", type=frame_rate, metavar="N", help="pictures a second at most (.cast 10, else 20)")
    add(
        "--size",
        type=size,
        metavar="WxH",
        help="columns and rows, or pixels of .gif, .mp4 and .png; else as the floor needs",
    )
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
    add("--picture", type=Path, metavar="FILE", help="make this picture instead: .png, .svg, .txt")
    add("--at", type=tick, metavar="TICK", help="the tick of the picture; else the last one")


def speed(text: str) -> Fraction:
    """A factor; exact, so that times are."""
    least, most = FILM_SPEEDS
    try:
        factor = Fraction(text.removeprefix("x"))
    except (ValueError, ZeroDivisionError):
        factor = Fraction(0)
    if not least <= factor <= most:
        allowed = f"{float(least):g} to {float(most):g}"
        raise argparse.ArgumentTypeError(f"{text!r} is not a speed: allowed are {allowed}")
    return factor


def size(text: str) -> tuple[int, int]:
    """Columns and rows, or pixels."""
    columns, _, rows = text.partition("x")
    if not (columns.isdecimal() and rows.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 80x24")
    return int(columns), int(rows)


def run(args: argparse.Namespace) -> int:
    """Make the one or the other."""
    _check_together(args)
    if args.html is not None:
        print(f"{args.html}: {_make_page(args)}")
    elif args.picture is not None:
        print(f"{args.picture}: {_make_picture(args)}")
    elif args.out is not None and args.out.suffix.lower() in FILM_SUFFIXES:
        print(f"{args.out}: {_make_pixel_film(args)}")
    else:
        viewer("playback.film").make_film(args.file, _screen_request(args), args.out)
    return 0


def _make_page(args: argparse.Namespace) -> str:
    from automaton.films.film_page import make_page

    speed, follow, theme = float(args.speed or 1), args.follow, args.theme
    return make_page(
        args.file, args.html, args.first, args.last, speed=speed, follow=follow, theme=theme
    )


def _make_picture(args: argparse.Namespace) -> str:
    if args.picture.suffix.lower() == ".png":
        from automaton.films.pixel_film import make_pixel_picture

        _check_drawn(args, args.picture)
        return make_pixel_picture(args.file, _pixel_request(args), args.picture, args.at)
    make_picture = viewer("playback.film").make_picture
    return str(make_picture(args.file, _screen_request(args), args.picture, args.at))


def _make_pixel_film(args: argparse.Namespace) -> str:
    from automaton.films.pixel_film import make_pixel_film

    _check_drawn(args, args.out)
    return make_pixel_film(args.file, _pixel_request(args), args.out)


def _pixel_request(args: argparse.Namespace) -> PixelRequest:
    from automaton.films.pixel_film import PixelRequest

    return PixelRequest(
        **_given(args, ("first", "last", "speed", "fps", "size", "follow", "theme"))
    )


def _screen_request(args: argparse.Namespace) -> Any:
    how = ("size", "zoom", "follow", "layer", "theme", "color", "ascii")
    when = ("first", "last", "speed", "fps")
    return viewer("playback.film").Request(**_given(args, (*how, *when)))


def _given(args: argparse.Namespace, names: tuple[str, ...]) -> dict[str, Any]:
    """Those that were said; the others have their own defaults."""
    return {name: getattr(args, name) for name in names if getattr(args, name) is not None}


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
    _refuse(others | _of_screens(args), "--html")


def _check_drawn(args: argparse.Namespace, path: Path) -> None:
    others = "; screens are FILE.cast and pictures FILE.svg and FILE.txt"
    _refuse(_of_screens(args), f"FILE{path.suffix.lower()}{others}")


def _of_screens(args: argparse.Namespace) -> dict[str, Any]:
    """Options for what looks like the viewer's screen; None where they are not given."""
    return {
        "--layer": args.layer or None,
        "--ascii": args.ascii or None,
        "--zoom": None if args.zoom == "fit" else args.zoom,
        "--color": None if args.color == "true" else args.color,
    }


def _refuse(options: dict[str, Any], beside: str) -> None:
    """Raises InputError for the first option that is given."""
    named = [name for name, value in options.items() if value is not None]
    if named:
        raise InputError(f"{named[0]} does not go together with {beside}")
