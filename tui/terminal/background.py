"""Whether the terminal is dark or light: it is asked for the colour of its background.

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
from typing import Final

from tui.render.styles import Theme

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
