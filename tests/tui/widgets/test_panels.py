"""The panels together, the legend, and the lines that panels are made of."""

from __future__ import annotations

from dataclasses import replace

import pytest
from panel_harness import (
    NARROW,
    WIDE,
    PanelHarness,
    busy,
    click,
    deadlocked,
    moment,
    of_robot,
    run_in_harness,
    said,
    text,
)
from textual.pilot import Pilot

from tui.playback.panel_view import Picture, View
from tui.registration import panels
from tui.render.camera import Camera
from tui.render.scene import Scene, ShownFloor
from tui.render.styles import ASCII, UNICODE, Depth, GlyphSet, Look
from tui.widgets.inspector import Inspector
from tui.widgets.legend_panel import Legend
from tui.widgets.metrics_panel import Figures
from tui.widgets.panel import UNICODE_SIGNS as SIGNS
from tui.widgets.panel import Line, bar, broken, cut, line, linked, robot_link, signs_of, wrapped
from tui.widgets.panel_column import PanelColumn, panel_widgets

LOOK = Look(Depth.TRUE)


def _scene(view: View) -> tuple[Scene, Camera]:
    slots = view.snapshot.slots
    scene = Scene(ShownFloor(view.floor_plan, slots.cell), view.snapshot)
    return scene, Camera(view.floor_plan, 40, 120)


@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=["unicode", "ascii"])
def test_the_legend_shows_the_signs_of_the_map_in_its_colours(glyphs: object) -> None:
    assert isinstance(glyphs, GlyphSet)
    legend = Legend(signs_of(glyphs))

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        scene, camera = _scene(busy())
        camera.one_to_one()
        legend.show(replace(busy(), picture=Picture(scene, camera.zoom, LOOK, glyphs)))
        await pilot.pause()
        words = text(legend)
        assert "turntable: robots turn here" in words and "robot with a load" in words
        sign = glyphs.characters[glyphs.turntable]
        assert any(row.startswith(sign) for row in said(legend))
        row = next(row for row in said(legend) if "timeline: deliveries" in row)
        assert not row.startswith("timeline"), "it has a sign"
        foregrounds = {segment.style.color for segment in legend.render_line(0) if segment.style}
        assert len(foregrounds) > 1

    run_in_harness(legend, story)


def test_the_legend_leads_to_the_worst_cells_of_a_layer() -> None:
    view = moment(600, "tabletop-1", "fleet.robots=5", layer="visits")
    legend = Legend()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        scene, camera = _scene(view)
        picture = Picture(scene.with_(layer="visits"), camera.zoom, LOOK, UNICODE)
        legend.show(replace(view, picture=picture))
        await pilot.pause()
        assert view.snapshot.heat is not None
        cell = int(view.snapshot.heat.argmax())
        x, y = view.floor_plan.xy(cell)
        await click(pilot, legend, f"({x}, {y})")
        assert stage.wishes() == [("cell", cell)]

    run_in_harness(legend, story)


def test_tabs_open_by_click_and_only_the_open_panel_works() -> None:
    column = PanelColumn(UNICODE, panel_widgets())

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column.show(of_robot(deadlocked(), 1))
        await pilot.pause()
        assert column.name_open == "inspector" and "head-on, in a wait cycle" in text(
            column.panels["inspector"]
        )
        assert column.panels["why"].view is None and column.panels["robots"].view is None
        await click(pilot, column.tabs, "why")
        assert column.name_open == "why" and "two robots cannot swap" in text(column.panels["why"])
        assert not column.panels["inspector"].display
        column.tabs.focus()
        await pilot.press("right")
        assert column.name_open == "events"

    run_in_harness(column, story, NARROW, 60)


@pytest.mark.parametrize("name", panels().by_name)
def test_every_panel_can_be_opened_by_name_and_focused(name: str) -> None:
    column = PanelColumn(UNICODE, panel_widgets())

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column.show(busy())
        column.open(name, focus=True)
        await pilot.pause()
        assert column.name_open == name
        assert stage.focused is not None
        assert name in [node.id for node in stage.focused.ancestors_with_self]

    run_in_harness(column, story, WIDE, 40)


def test_an_order_that_is_clicked_opens_the_inspector() -> None:
    column = PanelColumn(UNICODE, panel_widgets())

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column.show(of_robot(busy(), 1))
        await pilot.pause()
        await click(pilot, column.panels["inspector"], "order 6")
        assert "order 6 carried" in text(column.panels["inspector"])

    run_in_harness(column, story, NARROW, 60)


def test_full_screen_has_the_figures_beside_the_tabs() -> None:
    column = PanelColumn(UNICODE, panel_widgets())
    column.add_class("full")

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column.show(busy())
        await pilot.pause()
        assert column.figures.region.y == column.tabs.region.y == 0
        assert column.figures.region.right <= column.tabs.region.x
        assert "delivered 19 of 50" in text(column.figures)

    run_in_harness(column, story, 80, 22)


def test_nothing_is_done_again_when_nothing_changed() -> None:
    column = PanelColumn(UNICODE, panel_widgets())

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column.show(of_robot(busy(), 1))
        await pilot.pause()
        shown_of: list[int] = []
        column.panels["inspector"].show = lambda view: shown_of.append(view.robot)  # type: ignore[method-assign]
        column.show(of_robot(busy(), 1))
        column.show(of_robot(busy(), 2))
        column.show(of_robot(busy(), 2))
        assert shown_of == [2]

    run_in_harness(column, story, NARROW, 60)


def test_a_robot_that_a_run_does_not_have_is_not_selected_in_it() -> None:
    column = PanelColumn(UNICODE, panel_widgets())

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column.show(of_robot(busy(), 5))
        await pilot.pause()
        assert "nothing is selected" in text(column.panels["inspector"])

    run_in_harness(column, story, NARROW, 60)


def test_only_lines_that_say_something_else_are_painted_again() -> None:
    inspector = Inspector()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        inspector.show(of_robot(busy(), 1))
        await pilot.pause()
        painted: list[int] = []
        inspector.refresh = lambda *regions, **_: painted.extend(r.y for r in regions)  # type: ignore[method-assign, return-value, assignment]
        inspector.write([*inspector.lines[:3], line("heading  another"), *inspector.lines[4:]])
        assert painted == [3]

    run_in_harness(inspector, story)


# Lines.


def test_lines_break_between_words_and_never_within_a_link() -> None:
    made = wrapped(line("because ", robot_link(12), " waits, it stays"), 16, indent=2)
    texts = ["".join(span.text for span in spans) for spans in made]
    assert texts == ["because robot 12", "  waits, it", "  stays"]


def plain(spans: Line) -> str:
    return "".join(span.text for span in spans)


def test_a_line_that_is_too_long_says_so_and_never_cuts_a_number() -> None:
    trip = line("  12 picks up the pod of trip 99")
    assert cut(trip, 32) == trip
    assert plain(cut(trip, 31)) == "  12 picks up the pod of..."
    assert plain(cut(trip, 20)) == "  12 picks up the..."
    assert plain(cut(line("53 of 4,000, ", robot_link(34)), 12)) == "53 of..."
    assert plain(cut(line("1,234,567"), 6)) == "..."
    assert plain(cut(line("unconditional"), 10)) == "uncondi..."
    assert cut(line("12  "), 2) == line("12  "), "blanks are no loss"


def test_a_long_line_of_a_panel_goes_on_below_its_last_column() -> None:
    made = broken(line("lines done   53 of 4,000, 34 trips"), 32)
    assert [plain(one) for one in made] == ["lines done   53 of 4,000, 34 ", " " * 13 + "trips"]
    made = broken(line("  waits for ", robot_link(12), " and more"), 17)
    assert [plain(one) for one in made] == ["  waits for ", "  robot 12 and", "  more"]
    assert broken(line("fits"), 4) == [line("fits")]


def test_no_line_of_the_figures_is_cut_and_whole_parts_end_the_same() -> None:
    figures = Figures()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        view = moment(40, "goods-mini")
        figures.show(view)
        await pilot.pause()
        words = " ".join(" ".join(plain(one) for one in figures.panel_lines(view, 24)).split())
        assert " ".join(" ".join(map(plain, figures.lines)).split()) == words
        assert max(len(plain(one).rstrip()) for one in figures.lines) <= 24
        figures.show(replace(view, layer="visits"))
        lines = len(figures.panel_lines(view, 24))
        assert len(figures.lines) > lines == figures.ends[-1]
        figures.write(figures.panel_lines(view, 24))
        assert figures.ends[-1] == len(figures.lines)

    run_in_harness(figures, story, 26)


def test_robots_and_cells_of_a_sentence_become_links() -> None:
    floor_plan = busy().floor_plan
    spans = linked("robot 3 holds (8, 0), robot 4 waits", floor_plan)
    assert [span.link for span in spans if span.link] == [
        ("robot", 3),
        ("cell", floor_plan.cell(8, 0)),
        ("robot", 4),
    ]
    assert "".join(span.text for span in spans) == "robot 3 holds (8, 0), robot 4 waits"


def test_a_bar_shows_what_is_not_nothing() -> None:
    assert bar(0.001, 4, SIGNS) == "⡇   "
    assert bar(0, 4, SIGNS) == "    "
    assert bar(0.5, 4, SIGNS) == "⣿⣿  "
    assert bar(1.0, 4, SIGNS) == "⣿⣿⣿⣿"


def test_above_another_panel_the_figures_end_with_a_whole_part() -> None:
    alone, two = busy(), moment(300, "tabletop-1", against="strategy.right_of_way=wait")
    figures = Figures()
    for view, width, begins in (
        (alone, NARROW, "title"),
        (alone, WIDE, "title"),
        (two, 34, "plain"),
    ):
        lines = figures.panel_lines(view, width)
        for most in range(9, 30):
            rows = figures.rows_within(most)
            assert most - 12 < rows <= most
            assert lines[rows][0].look == begins and lines[rows][0].text[0] != " "


def test_what_the_figures_show_above_another_panel_is_whole() -> None:
    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column = stage.widget
        assert isinstance(column, PanelColumn)
        column.show(busy())
        await pilot.pause()
        figures = column.figures
        assert figures.size.height == figures.rows_within(17) < 17
        column.set_class(True, "full")
        await pilot.pause()
        column.show(busy())
        await pilot.pause()
        assert figures.size.height == 34

    run_in_harness(PanelColumn(UNICODE, panel_widgets()), story, NARROW, 34)


@pytest.mark.parametrize("width", [34, 41, 48])  # of the side beside 100, 120 and 140 columns
def test_the_tabs_leave_a_column_free_at_the_edge(width: int) -> None:
    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column = stage.widget
        assert isinstance(column, PanelColumn)
        column.styles.width = width
        await pilot.pause()
        lines = said(column.tabs)
        assert len(lines) == (1 if width > 40 else 2)
        assert all(len(words) < column.tabs.width for words in lines)
        words = "  ".join(lines)
        assert all(f"{one.tab} {one.key}" in words for one in panels().by_name.values())

    run_in_harness(PanelColumn(UNICODE, panel_widgets()), story, width, 24)


def test_the_tabs_follow_a_width_that_came_without_an_event() -> None:
    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column = stage.widget
        assert isinstance(column, PanelColumn)
        column.styles.width = 48
        await pilot.pause()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(type(column.tabs), "width", 20)
            column.tabs.set_content()
        assert said(column.tabs)[0].endswith("legend K")

    run_in_harness(PanelColumn(UNICODE, panel_widgets()), story, 48, 24)


def test_where_there_is_no_room_for_both_the_metrics_are_one_of_the_panels() -> None:
    column = PanelColumn(UNICODE, panel_widgets())

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        column.show_one(True)
        column.open("why")
        column.show(of_robot(deadlocked(), 1))
        await pilot.pause()
        assert not column.figures.display and column.figures.view is None
        assert said(column.tabs) == ["metrics p   info i   why w", "events e   robots t   legend K"]
        assert "robot 1 has been waiting" in text(column.panels["why"])
        await click(pilot, column.tabs, "metrics")
        assert column.name_open == "metrics" and not column.panels["why"].is_on_screen
        assert column.figures.region.y == 2 and column.figures.size.height == 18
        assert "where the time went" in text(column.figures)
        column.tabs.focus()
        await pilot.press("right")
        assert column.name_open == "inspector" and not column.figures.display
        assert "robot 1" in text(column.panels["inspector"])

    run_in_harness(column, story, 35, 20)
