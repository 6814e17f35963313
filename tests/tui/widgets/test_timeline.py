"""The timeline: where ticks lie, what a part of the run shows, and marks that share a column."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from automaton.engine.observation import CURVE_COLUMNS
from automaton.history.event_history import Curve
from tui.render import styles
from tui.render.encode import as_text
from tui.render.styles import ASCII, UNICODE, Depth, GlyphSet, Look
from tui.widgets.timeline import (
    MIN_TICKS_SHOWN,
    Mark,
    Past,
    TickRange,
    picture,
    span,
    strip,
    track_of,
)

NOTHING_HAPPENS = Curve(np.zeros((50_000, CURVE_COLUMNS), np.int32), 1, 50_000)
ENDS = st.integers(1, 10**6)
WIDTHS = st.integers(30, 240)


@st.composite
def parts(draw: st.DrawFn) -> tuple[TickRange, int]:
    """A part of a run, and the end of the run."""
    end = draw(ENDS)
    ticks = draw(st.integers(min(MIN_TICKS_SHOWN, end), end))
    first = draw(st.integers(0, end - ticks))
    return TickRange(first, first + ticks), end


@given(parts(), WIDTHS)
def test_places_and_ticks_belong_together(part_and_end, width) -> None:
    part, end = part_and_end
    track = track_of(part, end, width)
    for column in range(track.left, track.left + track.columns):
        tick = track.tick_at(column)
        assert part.first <= tick <= part.last
        if part.ticks >= track.columns:
            assert track.column_of(tick) == column
    assert track.column_of(part.first) == track.left
    assert track.column_of(part.last) == track.left + track.columns - 1
    assert (track.more_before, track.more_after) == (part.first > 0, part.last < end)


@given(parts(), st.integers(-3, 3), st.data())
def test_zooming_keeps_its_tick_in_sight_and_stays_in_the_run(part_and_end, steps, data) -> None:
    part, end = part_and_end
    at = data.draw(st.integers(*part))
    zoomed = part.zoomed(steps, at, end)
    assert 0 <= zoomed.first <= at <= zoomed.last <= end
    assert zoomed.ticks <= part.ticks if steps > 0 else zoomed.ticks >= part.ticks
    assert zoomed.ticks >= min(MIN_TICKS_SHOWN, end)


@given(parts(), st.data())
def test_a_part_follows_the_present(part_and_end, data) -> None:
    part, end = part_and_end
    tick = data.draw(st.integers(0, end))
    following = part.following(tick, end)
    assert following.first <= tick <= following.last and following.ticks == part.ticks
    assert following == part or tick not in part


def test_the_present_stands_out_where_it_is_in_the_part_that_is_shown() -> None:
    for tick, columns in ((100, 1), (45_000, 0), (9_999, 0)):
        past = nothing_delivered(tick=tick)
        codes = picture(past, track_of(TickRange(100, 9_000), 50_000, 80), UNICODE, False)
        backgrounds = (codes >> 16) % len(styles.COLOUR_TABLE)
        assert np.count_nonzero(backgrounds == styles.COLOUR_SELECTED) == columns


@given(st.integers(0, 10**7))
def test_a_run_of_unknown_length_ends_at_a_round_number_beyond_what_is_known(head) -> None:
    end = span(Past(0, head, None, NOTHING_HAPPENS))
    assert max(head, 50) <= end <= max(50, 2 * head)
    assert str(end).rstrip("0") in ("1", "15", "2", "3", "5", "75")


def row(past: Past, part: TickRange | None, width: int, glyphs: GlyphSet = UNICODE) -> str:
    assert past.end is not None
    return as_text(picture(past, track_of(part, past.end, width), glyphs, False), glyphs).rstrip()


def nothing_delivered(*marks: Mark, tick: int = 50_000) -> Past:
    return Past(tick, 50_000, 50_000, NOTHING_HAPPENS, marks)


def test_the_row_says_which_ticks_it_shows() -> None:
    past = nothing_delivered()
    assert row(past, None, 40).startswith("0 ") and row(past, None, 40).endswith(" 50,000")
    near = row(past, TickRange(12_500, 25_000), 40)
    assert near.startswith("\u203912,500 ")
    assert near.endswith(" 25,000\u203a")
    assert row(past, TickRange(12_500, 25_000), 40, ASCII).isascii()


def test_marks_that_share_a_column_are_counted_and_parted_by_zooming() -> None:
    marks = [Mark(20_000 + 40 * n, "deadlock") for n in range(3)] + [Mark(40_000, "stop")]
    past = nothing_delivered(*marks, Mark(20_000, "deadlock"))  # the same one twice is one
    assert row(past, None, 80).count("3") == 1 and row(past, None, 80).count("✗") == 0
    assert row(past, None, 80).count("⊗") == 1
    near = row(past, TickRange(19_990, 20_090), 80)
    assert near.count("✗") == 3 and "⊗" not in near
    many = nothing_delivered(*(Mark(30_000 + n, "deadlock") for n in range(12)))
    assert row(many, None, 80).count("+") == 1


@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=["unicode", "ascii"])
def test_a_number_of_marks_stands_out_at_every_depth(glyphs: GlyphSet) -> None:
    past = nothing_delivered(Mark(20_000, "branch"), Mark(20_001, "deadlock"), tick=9)
    codes = picture(past, track_of(None, 50_000, 80), glyphs, False)[0]
    (column,) = np.flatnonzero((codes & 0xFFFF) == ord("2"))
    number = int(codes[column] >> 16)
    assert number % len(styles.COLOUR_TABLE) == styles.COLOUR_FAULT  # the gravest kind
    for depth in set(Depth) - {Depth.NONE}:
        fg, bg = Look(depth).pair(number)
        assert fg != bg
    assert Look(Depth.NONE).attributes(number).reverse


def lost_in(upper: float, lower: float) -> np.ndarray:
    """Two bands that lose this much in each tick from 25,000 on."""
    ticks = np.arange(0, 50_001, 500)
    late = np.maximum(ticks - 25_000, 0)
    return np.stack([ticks, upper * late, lower * late], axis=1).astype(np.int32)


def test_the_strip_is_hot_where_and_when_time_was_lost() -> None:
    past = nothing_delivered()._replace(lost=lost_in(2, 1))
    track = track_of(None, 50_000, 80)
    codes = strip(past, track, UNICODE, 1)
    assert codes.shape == (1, 80)
    inner = (codes[0, track.left : track.left + track.columns] >> 16).astype(np.int64)
    upper, lower = np.divmod(inner, len(styles.COLOUR_TABLE))
    assert {*upper[:30], *lower[:30]} == {styles.COLOUR_HEAT_0}
    assert (upper[-30:] == styles.COLOUR_HEAT_8).all()
    assert (lower[-30:] == styles.COLOUR_HEAT_4).all()


def test_the_strip_has_shades_without_colours_and_nothing_after_what_is_known() -> None:
    past = nothing_delivered()._replace(lost=lost_in(1, 0), head=40_000, end=None)
    track = track_of(None, 50_000, 80)
    row = as_text(strip(past, track, ASCII, 1), ASCII)
    assert row.isascii() and set(row.strip()[1:]) == {"@"}  # the first column saw the beginning
    assert abs(len(row.strip()) - 0.3 * track.columns) < 3
    assert as_text(strip(nothing_delivered(), track, UNICODE, 2), UNICODE).strip() == ""
