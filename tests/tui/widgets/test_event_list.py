"""The log of events: what is asked for, where the present is, and where a row leads."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from panel_harness import (
    NARROW,
    WIDE,
    PanelHarness,
    busy,
    click,
    of_robot,
    run_in_harness,
    said,
    text,
)
from textual.pilot import Pilot

from automaton.engine.observation import (
    EVENT_DELIVERED,
    EVENT_NAMES,
    EVENT_ORDER_TAKEN,
    EVENT_RETREATED,
)
from automaton.engine.state import NIL
from automaton.history.event_history import (
    EVENT_GROUPS,
    AppendLog,
    Event,
    EventHistory,
    event_words,
)
from tui.playback.panel_view import View
from tui.widgets.event_list import EventFilter, Events, Filter


def earlier(tick: int) -> View:
    """The same run, rewound."""
    view = busy()
    snapshot = replace(view.snapshot, tick=tick)
    return replace(view, playback=replace(view.playback, snapshots=(snapshot,)))


@pytest.mark.parametrize("code", range(1, len(EVENT_NAMES)))
def test_every_event_has_words(code: int) -> None:
    words = event_words(Event(5, code, 3, 2, 1))
    assert words and "1 steps" not in words and "1 ticks" not in words
    assert any(code in codes for codes in EVENT_GROUPS.values())


def found(events: Events, view: View) -> Any:
    """(M, 5) the events that are asked for."""
    return view.run.event_history.events[events.listed_events(view)]


@pytest.mark.parametrize(("width", "name", "gap"), [(NARROW, "#", 1), (WIDE, "robot", 5)])
def test_the_newest_events_up_to_the_present_are_in_sight(width: int, name: str, gap: int) -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        await pilot.pause()
        many = len(busy().run.event_history.events)
        assert f"{many} events" in text(events.list)
        assert f"tick {name} {many} events" in text(events.list)
        assert said(events.list)[-1] == f"▸  594{' ' * gap}4 picks up load 13"

    run_in_harness(events, story, width, 30)


def test_an_event_that_is_too_long_shows_that_it_is_cut_and_no_other_number() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        await pilot.pause()
        shown = [" ".join(row.strip("▸ ").split()[2:]) for row in said(events.list)[1:]]
        assert "takes order 24" in shown and any(row.endswith("...") for row in shown)
        whole = {event_words(Event(*row)) for row in busy().run.event_history.events.tolist()}
        known = tuple(f"{one} " for one in whole)
        assert all(row in whole or any(one.startswith(row[:-3]) for one in known) for row in shown)

    run_in_harness(events, story, 26, 60)


def test_the_present_moves_and_what_is_to_come_is_dim() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(earlier(300))
        await pilot.pause()
        marked = next(row for row in said(events.list) if row.startswith("▸"))
        tick = busy().run.event_history.events[busy().run.event_history.index_at(300) - 1, 0]
        assert marked.split()[1] == str(tick)
        at = events.list._present
        assert {span.look for span in events.list.row(at)[1:]} == {"dim"}
        assert "dim" not in {span.look for span in events.list.row(at - 1)[3:]}

    run_in_harness(events, story, NARROW, 30)


def test_a_list_that_was_scrolled_away_stays_where_it_is() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(earlier(300))
        await pilot.pause()
        events.list.scroll_to(y=0, animate=False)
        await pilot.pause()
        events.show(busy())
        await pilot.pause()
        assert events.list.scroll_offset.y == 0
        events.list.scroll_end(animate=False)
        await pilot.pause()
        events.show(earlier(590))
        events.show(busy())
        await pilot.pause()
        assert said(events.list)[-1].startswith("▸")

    run_in_harness(events, story, NARROW, 30)


def test_kinds_are_a_checklist() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        await pilot.pause()
        await click(pilot, events.boxes, "deliveries")
        assert EVENT_DELIVERED not in found(events, busy())[:, 1]
        assert "⋅deliveries" in text(events.boxes) and "✓picks" in text(events.boxes)
        await click(pilot, events.boxes, "deliveries")
        assert len(found(events, busy())) == len(busy().run.event_history.events)

    run_in_harness(events, story, NARROW, 30)


def test_keys_go_through_the_kinds_one_by_one() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        events.list.focus()
        await pilot.press("c")
        assert set(found(events, busy())[:, 1]) == {EVENT_DELIVERED}
        assert "19 events of " in text(events.list)
        await pilot.press("c", "c")
        assert set(found(events, busy())[:, 1]) == {EVENT_RETREATED}
        await pilot.press("C", "C", "C")
        assert len(found(events, busy())) == len(busy().run.event_history.events)

    run_in_harness(events, story, NARROW, 30)


def test_only_the_selected_robot() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(of_robot(busy(), 3))
        await pilot.pause()
        await click(pilot, events.boxes, "only robot 3")
        assert set(found(events, of_robot(busy(), 3))[:, 2]) == {3}
        assert set(found(events, of_robot(busy(), 1))[:, 2]) == {1}
        events.list.focus()
        await pilot.press("v")
        assert set(found(events, of_robot(busy(), 3))[:, 2]) == {0, 1, 2, 3, 4}

    run_in_harness(events, story, NARROW, 30)


def test_words_filter_while_they_are_typed() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        events.query_one(Filter).focus()
        await pilot.press(*"robot 0 deliv")
        rows = found(events, busy())
        assert len(rows) and set(rows[:, 1]) == {EVENT_DELIVERED} and set(rows[:, 2]) == {0}
        await pilot.press("enter")
        assert stage.focused is events.list
        events.query_one(Filter).focus()
        await pilot.press("escape")
        assert stage.focused is events.list

    run_in_harness(events, story, NARROW, 30)


def test_words_name_loads_and_numbers() -> None:
    rows = busy().run.event_history.events
    of_load = rows[EventFilter(words="load 6").mask(rows)]
    assert len(of_load) and set(of_load[:, 3]) == {6} and not set(of_load[:, 1]) & {EVENT_RETREATED}
    assert set(rows[EventFilter(words="2").mask(rows)][:, 2]) == {2}
    assert set(rows[EventFilter(words="takes").mask(rows)][:, 1]) == {EVENT_ORDER_TAKEN}
    assert not EventFilter(words="nonsense").mask(rows).any()
    assert not EventFilter(words="²").mask(rows).any()  # a digit, but no number
    illegal = np.array([[5, EVENT_NAMES.index("illegal decision"), 1, NIL, NIL]])
    assert EventFilter(words="illegal").mask(illegal).all()
    assert set(rows[EventFilter(kinds=frozenset({"picks"}), words="robot 4").mask(rows)][:, 1]) == {
        2,
        3,
    }


def test_every_kind_of_event_belongs_to_one_box() -> None:
    codes = [code for several in EVENT_GROUPS.values() for code in several]
    assert sorted(codes) == list(range(1, len(EVENT_NAMES)))


def test_a_click_leads_to_tick_and_robot() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        await pilot.pause()
        await click(pilot, events.list, "picks up load 13")
        assert stage.wishes() == [("tick", 594), ("robot", 4)]
        await click(pilot, events.list, "592")
        wishes = stage.wishes()
        assert wishes[0] == ("tick", 592) and len(wishes) == 2

    run_in_harness(events, story, NARROW, 30)


def test_the_keyboard_goes_through_the_list() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        await pilot.pause()
        events.list.focus()
        many = len(busy().run.event_history.events)
        await pilot.press("pageup", "down", "enter")
        index = events.list.cursor
        assert index == many - 1 - events.list.lines_for_rows + 1
        assert stage.wishes()[0] == ("tick", int(busy().run.event_history.events[index, 0]))

    run_in_harness(events, story, NARROW, 30)


def test_the_cursor_begins_at_the_present_and_goes_with_it_until_it_is_moved() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(earlier(300))
        events.list.focus()
        await pilot.pause()
        present = busy().run.event_history.index_at(300) - 1
        await pilot.press("up", "enter")
        tick = int(busy().run.event_history.events[present - 1, 0])
        assert stage.wishes()[0] == ("tick", tick)
        events.show(earlier(400))
        assert events.list.cursor == present - 1
        while events.list.cursor != events.list._present - 1:
            await pilot.press("down")
        events.show(earlier(500))
        assert events.list.cursor == busy().run.event_history.index_at(500) - 1

    run_in_harness(events, story, NARROW, 30)


def test_tab_and_a_key_lead_from_the_list_to_the_filter_and_its_boxes() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        events.list.focus()
        await pilot.press("tab", *"robot 4", "tab")
        assert set(found(events, busy())[:, 2]) == {4}
        assert stage.focused is events.boxes
        await pilot.press("space", "right", "right", "enter")
        assert "⋅deliveries ✓deadlocks" in text(events.boxes)
        assert not set(found(events, busy())[:, 1]) & {EVENT_DELIVERED, EVENT_RETREATED}
        await pilot.press(*["right"] * 9, "space")
        assert events.list.only_selected
        events.list.focus()
        await pilot.press("F")
        assert stage.focused is events.query_one(Filter)
        assert events.query_one(Filter).value == "robot 4"

    run_in_harness(events, story, NARROW, 30)


def test_the_panel_names_the_key_of_its_filter() -> None:
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(busy())
        await pilot.pause()
        assert "F filters, e.g. robot 3, parked" in said(events.query_one(Filter))[0]

    run_in_harness(events, story, NARROW, 30)


def test_a_long_log_is_looked_at_once_and_written_in_sight_only() -> None:
    event_history = EventHistory()
    many = 300_000
    rows = np.zeros((many, 5), np.int32)
    rows[:, 0], rows[:, 1], rows[:, 2] = np.arange(many), EVENT_ORDER_TAKEN, np.arange(many) % 1000
    event_history._events.append(rows)
    view = busy()
    run = SimpleNamespace(event_history=event_history, floor_plan=view.floor_plan)
    view = replace(view, runs=[run], playback=earlier(many).playback)  # type: ignore[list-item]
    events = Events()
    written: list[int] = []
    row = events.list.row
    events.list.row = lambda index: written.append(index) or row(index)  # type: ignore[method-assign, func-returns-value]

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        events.show(view)
        await pilot.pause()
        assert said(events.list)[-1].startswith("▸ 299,999")
        assert len(set(written)) < 200
        event_history._events.append(rows[:1] + np.array([many, 0, 0, 0, 0]))
        assert len(events.listed_events(view)) == many + 1

    run_in_harness(events, story, NARROW, 30)


def test_events_that_are_not_kept_are_counted_and_the_list_goes_on() -> None:
    event_history = EventHistory()
    event_history._events = AppendLog(5, 2000)
    rows = np.zeros((1000, 5), np.int32)
    rows[:, 0], rows[:, 1] = np.arange(1000), EVENT_ORDER_TAKEN
    view = busy()
    run = SimpleNamespace(event_history=event_history, floor_plan=view.floor_plan)
    view = replace(view, runs=[run], playback=earlier(9000).playback)  # type: ignore[list-item]
    events = Events()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        for first in range(0, 2000, 1000):
            event_history._events.append(rows + np.array([first, 0, 0, 0, 0]))
        events.show(view)
        assert len(events.listed_events(view)) == 2000
        event_history._events.append(rows + np.array([2000, 0, 0, 0, 0]))  # half of them go
        shown = "".join(span.text for span in events.list.row(1999))
        assert "1,999" in shown, "what is shown stays until it is told again"
        events.show(view)
        await pilot.pause()
        assert "1,000 events 2,000 older events dropped" in text(events.list)
        assert len(events.listed_events(view)) == 1000
        assert said(events.list)[-1].startswith("▸ 2,999")

    run_in_harness(events, story, NARROW, 30)
