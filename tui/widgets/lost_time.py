"""How lost time is drawn: every cause has a letter, and what counts as blocked a pattern of its own.

HHHQ....................     all of the time: a letter for each share of it, dots for the rest
H head-on       ⣿⣿⣿⣿⣿⣿⡇      a full bar: another robot is in the way, which counts as blocked
w random wait   ⠶⠆           a thin one, and a small letter: it waits for something else
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from automaton.engine.observation import CAUSES
from tui.widgets.styled_lines import Line, Signs, Span, bar, dim, line

CAUSE_LETTERS: Final = ".QHWDIVLBwFRopriPebszhSdkycgnl"  # by cause; capitals count as blocked
BLOCKED_LOOK: Final = "warn"
OTHER: Final = "plain"


def look_of(cause: int) -> str:
    """Its colour."""
    return BLOCKED_LOOK if CAUSES[cause].blocked else OTHER


def letter(cause: int) -> Span:
    """The letter of a cause, and a blank."""
    return Span(f"{CAUSE_LETTERS[cause]} ", look_of(cause))


def drawn(cause: int, share: float, width: int, signs: Signs) -> Span:
    """Its bar."""
    return Span(bar(share, width, signs, thin=not CAUSES[cause].blocked), look_of(cause))


def split(shares: Sequence[tuple[int, float]], width: int) -> Line:
    """A bar of the whole time: (cause, share of it) in this order; every cause shows."""
    spans, left = [], width
    for cause, share in shares:
        columns = min(left, max(1, round(share * width)))
        spans.append(Span(CAUSE_LETTERS[cause] * columns, look_of(cause)))
        left -= columns
    return (*spans, dim("." * left))


def key(causes: Sequence[int], signs: Signs) -> Line:
    """What the patterns mean, of those that occur."""
    told = {CAUSES[cause].blocked for cause in causes}
    words = {True: f"{signs.full} another robot in the way", False: f"{signs.thin} other causes"}
    return line(dim("   ".join(text for blocked, text in words.items() if blocked in told)))
