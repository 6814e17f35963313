"""The dark and the light theme; a terminal is asked which one fits the colour of its background.

The question is OSC 11. Terminals answer in order, and all of them answer the question for their kind
(DA1), which follows: a terminal that does not know its background needs no waiting time.
"""

from __future__ import annotations

import os
import re
import select
import sys
import termios
import time
import tty
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from tui.render import styles
from tui.render.styles import COLOUR_TABLE, Theme

if TYPE_CHECKING:
    from textual.theme import Theme as TextualTheme

QUESTION: Final = b"\x1b]11;?\x1b\\\x1b[c"
KIND: Final = re.compile(rb"\x1b\[\?[\d;]*c")  # the answer to DA1
BACKGROUND: Final = re.compile(rb"\x1b\]11;rgba?:([\da-f]+)/([\da-f]+)/([\da-f]+)", re.IGNORECASE)
PATIENCE_S: Final = 0.5
LUMINANCE: Final = (0.2126, 0.7152, 0.0722)  # of red, green and blue in luminance (BT.709)
LIGHT_NUMBERS: Final = ("7", "15")  # of 16 colours, as the background in COLORFGBG


def theme_of(environ: Mapping[str, str], answer: bytes) -> Theme:
    """The theme for a terminal that gave this answer; without one, COLORFGBG decides, else dark."""
    if shade := BACKGROUND.search(answer):
        parts = [int(part, 16) / (16 ** len(part) - 1) for part in shade.groups()]
        bright = sum(weight * part for weight, part in zip(LUMINANCE, parts, strict=True)) > 0.5
    else:
        bright = environ.get("COLORFGBG", "").rpartition(";")[2] in LIGHT_NUMBERS
    return "light" if bright else "dark"


def asked_background() -> bytes:
    """The answer of the terminal on stdin and stdout, b"" if it gives none."""
    keyboard = sys.stdin.fileno()
    before = termios.tcgetattr(keyboard)
    try:
        tty.setcbreak(keyboard)
        os.write(sys.stdout.fileno(), QUESTION)
        answer, end = b"", time.monotonic() + PATIENCE_S
        while not KIND.search(answer) and (left := end - time.monotonic()) > 0:
            if not select.select([keyboard], [], [], left)[0]:
                break
            piece = os.read(keyboard, 1024)
            answer += piece
            if not piece:
                break
        return answer
    finally:
        termios.tcsetattr(keyboard, termios.TCSADRAIN, before)


def themes() -> list[TextualTheme]:
    """The dark and the light theme."""
    return [_theme("dark"), _theme("light")]


def _theme(theme: Theme) -> TextualTheme:
    from textual.theme import Theme as TextualTheme  # not before its variables are set

    def colour(row: int) -> str:
        shades = COLOUR_TABLE[row].dark if theme == "dark" else COLOUR_TABLE[row].light
        return f"#{shades.true:06x}"

    return TextualTheme(
        name=f"automaton-{theme}",
        dark=theme == "dark",
        primary=colour(styles.COLOUR_DESTINATION),
        secondary=colour(styles.COLOUR_ROBOT),
        accent=colour(styles.COLOUR_LOADED),
        warning=colour(styles.COLOUR_LOADED),
        error=colour(styles.COLOUR_FAULT),
        success=colour(styles.COLOUR_DONE),
        foreground=colour(styles.COLOUR_TEXT),
        background=colour(styles.COLOUR_VOID),
        surface=colour(styles.COLOUR_FLOOR),
        panel="#262626" if theme == "dark" else "#dadada",
        variables={
            "footer-background": colour(styles.COLOUR_VOID),
            "footer-key-foreground": colour(styles.COLOUR_LOADED),
            "footer-description-foreground": colour(styles.COLOUR_DIM),
            "text-disabled": colour(styles.COLOUR_DIM),  # of placeholders
            "block-cursor-blurred-background": "#303030" if theme == "dark" else "#dadada",
            "border": colour(styles.COLOUR_WALL),
            "border-blurred": colour(styles.COLOUR_WALL),
        },
    )
