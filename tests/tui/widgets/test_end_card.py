"""The card at the end of a run."""

from __future__ import annotations

import numpy as np
from panel_harness import moment
from render_scenes import text

from automaton.runs.bottleneck import bottleneck_sentences
from automaton.runs.headless import run_once
from automaton.world.resolve import resolve
from tui.render import styles
from tui.render.styles import GLYPH_BITS, code, style
from tui.widgets.end_card import draw_end_card

BLANK = code(style(styles.COLOUR_FLOOR, styles.COLOUR_FLOOR), ord("."))


def card(
    tick: int,
    *settings: str,
    size: tuple[int, int] = (24, 80),
    complete: bool = True,
    branches: bool = True,
) -> tuple[list[str], set[int]]:
    """The lines of the card on an empty map, and their colours."""
    codes = np.full(size, BLANK, np.uint32)
    draw_end_card(codes, moment(tick, "tabletop-1", *settings), complete, branches)
    colours = np.unique(codes >> GLYPH_BITS) // len(styles.COLOUR_TABLE)
    lines = [line.strip(". ") for line in text(codes).split("\n")]
    return [line for line in lines if line], {*colours.tolist()}


def test_it_says_what_was_achieved_and_where_the_time_went() -> None:
    lines, colours = card(1959)
    assert lines[:2] == [
        "The run ended at tick 1,959",
        "50 of 50 orders delivered; 75.5 % of robot time spent on orders",
    ]
    assert lines[2].startswith("Robots were the bottleneck") and "Esc closes" in lines[-1]
    assert styles.COLOUR_FAULT not in colours


def test_it_names_the_bottleneck_that_the_report_names() -> None:
    """The last period of a run is shorter than the others, and counts in both."""
    resolved = resolve("tabletop-1")
    outcome = run_once(resolved)
    reported = " ".join(bottleneck_sentences(resolved, outcome.periods))
    lines, _ = card(outcome.ticks, size=(40, 80))
    named = " ".join(lines[2:-1])
    assert outcome.ticks == 1959 and len(named) > 100 and named.rstrip(".") == reported.rstrip(".")


def test_a_deadlock_at_the_end_is_named_in_red() -> None:
    lines, colours = card(700, "fleet.robots=5", "strategy.right_of_way=wait")
    assert lines[1] == "Deadlock: 2 robots in a wait cycle since tick 157 (g 157 goes there)"
    assert styles.COLOUR_FAULT in colours


def test_a_small_map_stays_free() -> None:
    assert card(700, size=(11, 80))[0] == []


def test_a_recording_that_was_cut_short_is_no_end_and_two_runs_have_no_branches() -> None:
    lines, _ = card(700, complete=False, branches=False)
    assert lines[0] == "The recording was cut short at tick 700" and "B other" not in lines[-1]
