"""The card over the map when a run has ended: what was achieved, where the time went, what to do next."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Final

import numpy as np

from automaton.history.fleet_summary import summarize
from automaton.runs.bottleneck import bottleneck_sentences
from automaton.units import count, number, percent, unit
from tui.render import styles
from tui.render.styles import Codes, code, style, text

if TYPE_CHECKING:
    from tui.playback.panel_view import View

CARD_WIDTH: Final = 76  # columns of the text
CARD_ROWS: Final = 12  # rows of the map from which the card has room
MARGIN: Final = 2  # columns beside the text, and beside the card
BRANCHES: Final = "B other settings from here   "
DOES: Final = "s picture   r backwards   Esc closes this"


def end_lines(view: View, width: int, complete: bool, branches: bool) -> list[tuple[str, int]]:
    """The lines of the card with their colours, at most `width` columns wide.

    `complete`: this is the end of the run, not of a recording that was cut short; `branches`: the run
    can be branched here.
    """
    snapshot, measured = view.snapshot, view.measured
    now, resolved = summarize(snapshot), view.run.resolved
    tick = unit(resolved.scenario.units.tick)
    time = "" if tick.size == 1 else f", {number(tick.of(snapshot.tick))} {tick.plural}"
    ended = "The run ended" if complete else "The recording was cut short"
    paragraphs = [(f"{ended} at tick {snapshot.tick:,}{time}.", styles.COLOUR_TEXT)]
    stuck = int(np.count_nonzero(snapshot.robots.wait_cycle_ticks))
    if stuck:
        since = snapshot.tick - int(snapshot.robots.wait_cycle_ticks.max())
        robots = count(stuck, "robot")
        words = f"Deadlock: {robots} in a wait cycle since tick {since:,} (g {since} goes there)."
        paragraphs.append((words, styles.COLOUR_FAULT))
    done = f"{now.delivered:,} of {count(now.orders, 'order')} delivered"
    share = f"{percent(measured.metrics['utilization'])} of robot time spent on orders"
    paragraphs.append((f"{done}; {share}.", styles.COLOUR_DONE))
    sentences = bottleneck_sentences(resolved, measured.periods)
    paragraphs += [(sentence, styles.COLOUR_TEXT) for sentence in sentences[:1]]
    paragraphs.append((BRANCHES + DOES if branches else DOES, styles.COLOUR_DIM))
    return [
        (row, colour) for words, colour in paragraphs for row in textwrap.wrap(words, width) or [""]
    ]


def draw_end_card(codes: Codes, view: View, complete: bool, branches: bool) -> None:
    """Draw the card at the bottom of a map, where there is room; see `end_lines`."""
    rows, columns = codes.shape
    width = min(columns - 4 * MARGIN, CARD_WIDTH)
    lines = end_lines(view, width, complete, branches) if rows >= CARD_ROWS and width > 0 else []
    if not lines or len(lines) + 2 > rows // 2:
        return
    top, left = rows - len(lines) - 2, (columns - width) // 2
    plain = code(style(styles.COLOUR_TEXT, styles.COLOUR_VOID), 0)
    codes[top:rows, left - MARGIN : left + width + MARGIN] = plain
    for row, (words, colour) in enumerate(lines):
        glyphs = np.array(text(words), np.uint32)
        codes[top + 1 + row, left : left + len(glyphs)] = code(
            style(colour, styles.COLOUR_VOID), glyphs
        )
