"""Make a film of a recording (for slides, chat, browsers or asciinema), or a picture of one tick.

GIF, MP4, PNG and HTML files are drawn; .cast films, SVG and text reproduce the screen of the viewer and
need no terminal. Exit code 0: made; 2: bad input.
"""

from __future__ import annotations

import argparse
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from automaton.commands.arguments import add_recording_argument, frame_rate, say, tick, whole
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
    text = "show a second recording beside the first, tick by tick; not with --html"
    add("--beside", type=Path, metavar="FILE2", help=text)
    add(
        "--out",
        type=Path,
        metavar="FILE",
        help="write a film to FILE.gif, .mp4, .png (animated) or .cast; - writes a .cast to standard "
        "output",
    )
    text = "start at this tick (default: 0)"
    add("--from", type=tick, metavar="TICK", dest="first", help=text)
    text = "end at this tick (default: the last)"
    add("--to", type=tick, metavar="TICK", dest="last", help=text)
    text = "play F times as fast as 10 ticks per second (default: 1)"
    add("--speed", type=speed, metavar="F", help=text)
    text = "slow down at the first delivery, the first wait cycle, the longest wait and the end, hurry "
    text += "between them, and say so in captions (.gif, .mp4, .png)"
    add("--story", action="store_true", help=text)
    text = "show at most N frames per second (default: 10 in a .cast, else 20)"
    add("--fps", type=frame_rate, metavar="N", help=text)
    add(
        "--size",
        type=size,
        metavar="WxH",
        help="set the size: columns x rows, or pixels for .gif, .mp4 and .png (default: fit the floor)",
    )
    add(
        "--zoom",
        default="fit",
        metavar="ZOOM",
        help="set the zoom: fit (default), 6x3, 4x2, 3x1, 1x1, half, braille-1, ...",
    )
    add(
        "--follow",
        type=whole("a robot", 0),
        default=-1,
        metavar="ROBOT",
        help="follow this robot and show its route",
    )
    add(
        "--layer",
        default="",
        metavar="NAME",
        help="show a layer: service-zones, traffic-zones, visits, flow, explored, ...",
    )
    text = "set the colors (default: dark)"
    add("--theme", choices=("dark", "light"), default="dark", help=text)
    text = "set the color depth (default: true)"
    add("--color", choices=("true", "256", "16", "none"), default="true", help=text)
    add("--ascii", action="store_true", help="use ASCII characters only")
    text = "write a page that plays in a browser, not a film"
    add("--html", type=Path, metavar="FILE", help=text)
    text = "write a picture of one tick, not a film: .png, .svg or .txt"
    add("--picture", type=Path, metavar="FILE", help=text)
    text = "draw the picture at this tick (default: the last)"
    add("--at", type=tick, metavar="TICK", help=text)


def speed(text: str) -> Fraction:
    """A factor; a fraction, so that frame times are exact."""
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
    columns, _, rows = text.partition("x")
    if not (columns.isdecimal() and rows.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 80x24")
    return int(columns), int(rows)


def run(args: argparse.Namespace) -> int:
    """Make the film, page or picture."""
    _check_together(args)
    if args.html is not None:
        say(f"{args.html}: {_make_page(args)}")
    elif args.picture is not None:
        say(f"{args.picture}: {_make_picture(args)}")
    elif args.out is not None and args.out.suffix.lower() in FILM_SUFFIXES:
        say(f"{args.out}: {_make_pixel_film(args)}")
    else:
        _refuse({"--story": args.story or None}, "a .cast; use FILE.gif, FILE.mp4 or FILE.png")
        viewer("playback.film").make_film(_recordings(args), _screen_request(args), args.out)
    return 0


def _recordings(args: argparse.Namespace) -> tuple[Path, ...]:
    """The recording, and the one beside it."""
    return (args.file,) if args.beside is None else (args.file, args.beside)


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
        return make_pixel_picture(_recordings(args), _pixel_request(args), args.picture, args.at)
    make_picture = viewer("playback.film").make_picture
    return str(make_picture(_recordings(args), _screen_request(args), args.picture, args.at))


def _make_pixel_film(args: argparse.Namespace) -> str:
    from automaton.films.pixel_film import make_pixel_film

    _check_drawn(args, args.out)
    return make_pixel_film(_recordings(args), _pixel_request(args), args.out)


def _pixel_request(args: argparse.Namespace) -> PixelRequest:
    from automaton.films.pixel_film import PixelRequest

    return PixelRequest(
        **_given(args, ("first", "last", "speed", "fps", "size", "follow", "theme", "story"))
    )


def _screen_request(args: argparse.Namespace) -> Any:
    how = ("size", "zoom", "follow", "layer", "theme", "color", "ascii")
    when = ("first", "last", "speed", "fps")
    return viewer("playback.film").Request(**_given(args, (*how, *when)))


def _given(args: argparse.Namespace, names: tuple[str, ...]) -> dict[str, Any]:
    """The given options; the others keep the defaults of the request."""
    return {name: getattr(args, name) for name in names if getattr(args, name) is not None}


def _check_together(args: argparse.Namespace) -> None:
    """Refuse options of films for a picture, of pictures for a film, and of both for a page."""
    if args.html is not None:
        _check_page(args)
    of_films = {"--out": args.out, "--from": args.first, "--to": args.last}
    of_films |= {"--story": args.story or None, "--speed": args.speed, "--fps": args.fps}
    given = [name for name, value in of_films.items() if value is not None]
    if args.picture is not None and given:
        raise InputError(f"{given[0]} is for films: it cannot be combined with --picture")
    if args.picture is None and args.at is not None:
        raise InputError("--at needs --picture")


def _check_page(args: argparse.Namespace) -> None:
    if args.html.suffix not in (".html", ".htm"):
        raise InputError(f"{str(args.html)!r} is not a page: the name must end in .html")
    others = {
        "--story": args.story or None,
        "--beside": args.beside,
        "--out": args.out,
        "--picture": args.picture,
        "--fps": args.fps,
        "--size": args.size,
    }
    _refuse(others | _of_screens(args), "--html")


def _check_drawn(args: argparse.Namespace, path: Path) -> None:
    if args.story:
        _refuse({"--beside": args.beside}, "--story")
    others = "; use FILE.cast, or a picture FILE.svg or FILE.txt"
    _refuse(_of_screens(args), f"FILE{path.suffix.lower()}{others}")


def _of_screens(args: argparse.Namespace) -> dict[str, Any]:
    """Options of formats that show the viewer's screen; None if not given."""
    return {
        "--layer": args.layer or None,
        "--ascii": args.ascii or None,
        "--zoom": None if args.zoom == "fit" else args.zoom,
        "--color": None if args.color == "true" else args.color,
    }


def _refuse(options: dict[str, Any], beside: str) -> None:
    """Raise InputError for the first given option."""
    named = [name for name, value in options.items() if value is not None]
    if named:
        raise InputError(f"{named[0]} cannot be combined with {beside}")
