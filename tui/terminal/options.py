"""The viewer's options: of the command line, of the user's file of settings, and of the terminal.

The file is `viewer.toml` in the user's folder for settings. The viewer writes it when it ends:

    theme = "light"     # as chosen with T
    speed = 4           # or "max"
    panels = "side"     # off, side or full
    panel = "events"    # the open one
    pixels = "auto"     # or off, kitty, sixel; the viewer never writes this one
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, Literal

import platformdirs

from automaton.errors import InputError, nearest
from tui.render.styles import ASCII, DEPTHS, SHADED, UNICODE, Depth, GlyphSet, Theme

Renderer = Literal["auto", "direct", "textual"]  # how maps reach the terminal
Pixels = Literal["auto", "off", "kitty", "sixel"]  # how maps are images
PIXELS: Final = ("auto", "off", "kitty", "sixel")

SPEEDS: Final = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, math.inf)  # faster, slower

COLOR_SYSTEMS: Final = {
    Depth.NONE: "standard",
    Depth.SIXTEEN: "standard",
    Depth.INDEXED: "256",
    Depth.TRUE: "truecolor",
}
GLYPH_SETS: Final = {"unicode": UNICODE, "ascii": ASCII}
# Terminals with true colour that do not say so in COLORTERM.
TRUE_COLOUR_TERMS: Final = ("kitty", "alacritty", "ghostty", "wezterm", "foot", "contour")
# The Linux console has a font of 256 or 512 characters; "dumb" promises nothing.
PLAIN_TERMS: Final = ("linux", "dumb")


@dataclass(frozen=True)
class Options:
    """How to show a run, live or recorded."""

    read_only: bool = False  # no branches, no files in the current folder
    speed: float | None = None  # None: as the user left it
    at: int | None = None  # start at this tick, paused
    paused: bool = False
    fps: int = 30
    renderer: Renderer = "auto"
    ascii: bool = False
    color: str = "auto"  # or a key of tui.render.styles.DEPTHS
    theme: Theme | Literal["auto"] = "dark"  # auto: as the background of the terminal
    max_kbit: float | None = None
    pixels: Pixels | None = None  # None: as in the settings, else auto
    plain: bool = False
    panels: str = "side"  # at the start: off, side or full,
    panel: str = ""  # and which one is open; "": the first
    describe: bool = False  # sentences instead of a screen,
    only: Sequence[str] = ()  # of these kinds; (): of all,
    sentences: int | None = None  # at most this number per stretch

    @classmethod
    def of(cls, args: argparse.Namespace) -> Options:
        """The options of a parsed command line."""
        known = vars(args)
        return cls(**{one.name: known[one.name] for one in fields(cls) if one.name in known})

    @property
    def first_speed(self) -> float:
        """The speed at the start."""
        return 1.0 if self.speed is None else self.speed

    @property
    def shown_theme(self) -> Theme:
        """The theme, dark if the terminal has not been asked."""
        return "light" if self.theme == "light" else "dark"

    def depth(self, environ: Mapping[str, str]) -> Depth:
        """The colours to use."""
        return depth_of(environ, self.color)

    def glyphs(self, environ: Mapping[str, str]) -> GlyphSet:
        """The characters to use."""
        glyphs = glyphs_of(environ, "ascii" if self.ascii else "auto")
        bare = glyphs is UNICODE and self.depth(environ) == Depth.NONE
        return SHADED if bare else glyphs

    def shown_pixels(self, environ: Mapping[str, str]) -> Pixels:
        """How maps are images; "off" where that cannot be. Raises InputError without Pillow.

        Multiplexers show no images, and Apple's terminal prints the question for them.
        """
        wanted = self.pixels or "auto"
        if wanted == "off" or environ.get("TEXTUAL_DRIVER"):  # in a browser
            return "off"
        if importlib.util.find_spec("PIL") is None:
            if wanted != "auto":
                raise InputError(
                    f"--pixels {wanted} needs Pillow: leave the option out, or "
                    "pip install 'fleet-automaton[films]'"
                )
            return "off"
        term = environ.get("TERM", "").startswith(("screen", "tmux"))
        multiplexed = environ.get("TMUX") or environ.get("STY") or term
        apple = environ.get("TERM_PROGRAM") == "Apple_Terminal"
        plain = self.glyphs(environ) is ASCII or self.depth(environ) == Depth.NONE
        return "off" if wanted == "auto" and (multiplexed or apple or plain) else wanted

    def for_textual(self, environ: Mapping[str, str]) -> dict[str, str]:
        """Variables that Textual reads on import, so that its colours match those of the map.

        With smooth scrolling, terminals would report every pixel of mouse movement, also over SSH.
        """
        depth = self.depth(environ)
        chosen = {"TEXTUAL_SMOOTH_SCROLL": "0", "TEXTUAL_COLOR_SYSTEM": COLOR_SYSTEMS[depth]}
        return {**chosen, "NO_COLOR": "1"} if depth == Depth.NONE else chosen


# The file of settings.

SETTINGS: Final[
    dict[str, tuple[str, Callable[[Any], bool]]]
] = {  # what a key may be, in words and as a test
    "theme": ("dark or light", lambda value: value in ("dark", "light")),
    "speed": ('a speed such as 2, or "max"', lambda value: value == "max" or value in SPEEDS),
    "panels": ("off, side or full", lambda value: value in ("off", "side", "full")),
    "panel": ("the name of a panel", lambda value: isinstance(value, str)),
    "pixels": ("auto, off, kitty or sixel", lambda value: value in PIXELS),
}


def settings_path() -> Path:
    """The file of the user's settings."""
    return Path(platformdirs.user_config_dir("automaton")) / "viewer.toml"


def read_settings(path: Path) -> dict[str, Any]:
    """The user's settings; {} without a file. Raises InputError."""
    try:
        settings = tomllib.loads(path.read_text("utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return {}
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read: {error}; correct it or delete it", str(path)) from None
    for key, value in settings.items():
        if key not in SETTINGS:
            raise InputError(f"unknown key '{key}'{nearest(key, SETTINGS)}", str(path))
        words, fits = SETTINGS[key]
        if not fits(value):
            raise InputError(f"{key} must be {words}, not {value!r}", str(path))
    return settings


def with_settings(options: Options, settings: Mapping[str, Any]) -> Options:
    """The options; what the command line leaves open is as in the settings."""
    chosen = dict(settings)
    if options.theme != "auto":
        chosen.pop("theme", None)
    if options.pixels is not None:
        chosen.pop("pixels", None)
    if options.speed is not None:
        chosen.pop("speed", None)
    elif chosen.get("speed") == "max":
        chosen["speed"] = math.inf
    return replace(options, **chosen)


def write_settings(path: Path, settings: Mapping[str, Any]) -> None:
    """Write the user's settings; what cannot be written is forgotten."""
    lines = ["# Written by the viewer of automaton when it ends; edit or delete it freely."]
    for key, value in settings.items():
        text = f"{value:g}" if isinstance(value, int | float) and math.isfinite(value) else value
        lines.append(f"{key} = {text}" if text != value else f"{key} = {json.dumps(_named(value))}")
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n", "utf-8")


def _named(value: Any) -> str:
    return "max" if value == math.inf else str(value)


def depth_of(environ: Mapping[str, str], option: str = "auto") -> Depth:
    """The colours to use; `option`, a key of DEPTHS, overrides `environ` unless "auto"."""
    if option != "auto":
        return DEPTHS[option]
    term = environ.get("TERM", "")
    if environ.get("NO_COLOR") or term == "dumb":
        return Depth.NONE
    if environ.get("COLORTERM", "").lower() in ("truecolor", "24bit"):
        return Depth.TRUE
    if term.endswith("-direct") or any(name in term for name in TRUE_COLOUR_TERMS):
        return Depth.TRUE
    return Depth.INDEXED if "256color" in term else Depth.SIXTEEN


def glyphs_of(environ: Mapping[str, str], option: str = "auto") -> GlyphSet:
    """The characters to use; `option`, a key of GLYPH_SETS, overrides `environ` unless "auto"."""
    if option != "auto":
        return GLYPH_SETS[option]
    if environ.get("TERM") in PLAIN_TERMS:
        return ASCII
    locale = _locale(environ).lower().replace("-", "")
    return UNICODE if not locale or "utf8" in locale else ASCII


def _locale(environ: Mapping[str, str]) -> str:
    """The locale for characters: LC_ALL, else LC_CTYPE, else LANG.

    In the C locale, Python itself sets LC_CTYPE to C.UTF-8 (PEP 538); that value is ignored.
    """
    of_type = environ.get("LC_CTYPE", "")
    if of_type == "C.UTF-8" and environ.get("LANG"):
        of_type = ""
    return environ.get("LC_ALL") or of_type or environ.get("LANG", "")
