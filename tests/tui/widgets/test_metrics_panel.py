"""The figures: of one run and of two, and over time."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from panel_harness import (
    NARROW,
    WIDE,
    PanelHarness,
    busy,
    click,
    moment,
    run_in_harness,
    said,
    shown,
)
from textual.pilot import Pilot

from automaton.engine.observation import CAUSE_NO_ORDER, CAUSE_NOT_WAITING, CAUSES
from automaton.history.event_history import Curve
from automaton.runs.bottleneck import bottleneck_in_short, bottleneck_sentences
from automaton.runs.metric_catalogue import METRIC_CATALOGUE, time_shares
from automaton.units import Unit, percent
from tui.playback.panel_view import View
from tui.render.scene import Scene, floor_of
from tui.render.styles import ASCII
from tui.widgets import metrics_panel
from tui.widgets.metrics_panel import Figures
from tui.widgets.status import (
    NAMED_STATES,
    Word,
    _fitting,
    fleet_words,
    state_words,
    time_words,
    word,
)


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_figures_tell_orders_rates_robots_and_causes(width: int) -> None:
    view = busy()
    metrics = view.playback.figures[0].metrics
    said_then = shown(Figures(), view, width, 80)
    for words in (
        "delivered 19 of 50",
        f"throughput {metrics['throughput']:.1f} /1000 ticks",
        "last 500 34.0 /1000 ticks",
        "robots 5 working where the time went",
        "time lost of all robot ticks working ahead",
        "tick 600",
    ):
        assert words in said_then
    for name in metrics:
        assert name in said_then


def test_the_last_periods_that_have_ended_and_the_bottleneck_up_to_the_shown_tick() -> None:
    """The columns on the right are left out where there is no room."""
    view = moment(600, "depots", "units.clock=06:00", "units.tick=20 s")
    run = view.runs[0]
    *ended, begun = view.playback.figures[0].periods
    assert [one.name for one in ended] == ["06:00", "07:00", "08:00"] and begun.end == 600
    told = shown(Figures(), view, WIDE, 80)
    assert " 08:00 " in told and " 09:00 " not in told.partition("last periods")[2]
    done = sum(one.done for one in ended)
    assert "last periods orders/h from orders open work wait charge chargers" in told
    assert 0 < done <= int((run.leading_simulation.world.orders.delivered > 0).sum())
    assert "chargers" not in shown(Figures(), view, NARROW, 80).partition("throughput, ")[0][-200:]
    [bottleneck] = bottleneck_sentences(run.resolved, view.playback.figures[0].periods)
    assert f"bottleneck so far {bottleneck}" in told
    short = bottleneck_in_short(run.resolved, view.playback.figures[0].periods)
    assert f" bottleneck {short} robots " in told and told.index(short) < told.index("where the")
    early = shown(Figures(), moment(100, "depots"), WIDE, 80)
    assert "last periods" not in early and "bottleneck" not in early


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_a_fleet_that_is_stuck_shows_how_long_and_where(width: int) -> None:
    view = moment(700, "tabletop-1", "fleet.robots=5", "strategy.right_of_way=wait")
    told = shown(Figures(), view, width)
    assert "oldest order 700 ticks" in told
    assert "starved 4 robots in a jam 4 robots at (7, 0)" in told
    assert "starved" not in shown(Figures(), busy(), width, 10)


def scene_in(view: View) -> Scene:
    return Scene(floor_of(view.run.resolved), view.snapshot)


def test_the_status_line_says_so_where_there_is_no_room_for_the_panel() -> None:
    """In 80 columns; the words that go first say what the map shows, too."""
    view = moment(700, "tabletop-1", "fleet.robots=5", "strategy.right_of_way=wait")
    playback = replace(view.playback, playing=1, achieved=40.0, asked=40.0, ends=(None,))
    words = time_words(playback, 0, 4.0, Unit(1.0, "cycle"), ASCII)
    words += fleet_words(scene_in(view), playback.figures[0], ASCII, 40, False)
    said_words, _ = _fitting(words[1:], [Word((), rank=5)], 78)
    told = "  ".join(one.text for one in said_words)
    assert "4 starved  jam 4" in told and "0/50 delivered" not in told and "delivered" in told
    assert {one.action for one in said_words if one.text.startswith("jam")} == {"jam"}
    calm = busy()
    assert not any(
        one.text.startswith("jam") or one.text.endswith("starved")
        for one in fleet_words(scene_in(calm), calm.playback.figures[0], ASCII, 40, False)
    )


def test_the_states_in_the_status_line_add_up_to_the_fleet() -> None:
    view = moment(900, "factory")
    words = state_words(scene_in(view), ASCII, NAMED_STATES[0])
    assert [one.text for one in words] == ["▸1 loaded", "▹1 empty", "▹0 waiting", "⊚1 idle"]
    long, short, least = (  # where two signs are alike, a word stays as long as it fits
        " ".join(
            one.text
            for one in fleet_words(scene_in(view), view.playback.figures[0], ASCII, room, False)
        )
        for room in (57, 56, 38)
    )
    assert long == "▸1 loaded ▹1 empty ▹0 waiting ⊚1 idle 7/460 delivered"
    assert short == "▸1 ▹1 ▹0 waiting ⊚1 idle 7/460 delivered"
    assert least == "▸1 ▹1 ▹0 ⊚1 7/460 delivered"
    paused = fleet_words(scene_in(view), view.playback.figures[0], ASCII, 45, True)
    assert " ".join(one.text for one in paused) == "▸1 loaded ▹1 empty ⊚1 idle 7/460 delivered"
    stuck = moment(700, "tabletop-1", "fleet.robots=5", "strategy.right_of_way=wait")
    words = fleet_words(scene_in(stuck), stuck.playback.figures[0], ASCII, 82, False)
    assert [one.text for one in words][2::2][:2] == ["▹3 waiting", "▹2 in a wait cycle"]
    assert " robots 0 working" not in (panel := shown(Figures(), stuck, WIDE, 30))
    assert " 3 waiting, 2 in a wait cycle " in panel


def test_nobody_waits_beside_a_wait_cycle() -> None:
    view = moment(634)
    words = state_words(scene_in(view), ASCII, NAMED_STATES[0])
    told = [one.text for one in words]
    assert "▹2 in a wait cycle" in told and not any("waiting" in one for one in told)
    assert "robots 2 working, 2 in a wait cycle" in shown(Figures(), view, WIDE, 30)


def test_a_short_word_stays_where_a_better_one_does_not_fit() -> None:
    words = [word("first"), word("rather long", rank=2), word("last", rank=3)]
    assert _fitting(words, [word("end", rank=1)], 16) == (
        [words[0], words[2]],
        [word("end", rank=1)],
    )


def test_the_panel_says_where_the_time_went_as_the_report_does() -> None:
    view = busy()
    told = shown(Figures(), view, WIDE, 120)
    shares = time_shares(view.measured.uses)
    assert len(shares) > 3
    lost = sum(ticks for name, ticks in view.measured.uses.items() if name.startswith("lost_"))
    assert f"where the time went {percent(lost / sum(view.measured.uses.values()))} lost" in told
    for name, share, _ in shares:
        assert re.search(rf"{name} +\S* *{percent(share)}", told), name


def lines_of_a_busy_run(width: int, height: int) -> list[str]:
    lines: list[str] = []

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        figures = stage.widget
        assert isinstance(figures, Figures)
        figures.show(busy())
        await pilot.pause()
        lines.extend(said(figures))

    run_in_harness(Figures(), story, width, height)
    return lines


def test_where_the_time_went_stands_beside_the_figures_where_there_is_room() -> None:
    tall, wide = (lines_of_a_busy_run(width, 20) for width in (70, 74))
    assert tall[0].startswith("delivered") and "where the time went" not in tall[0]
    assert re.match(r"delivered +19 of 50 \S* +where the time went 12.6 % lost", wide[0])
    assert re.match(r"utilization +\S+ % +turning ", wide[3])


def test_every_cause_of_lost_time_stands_apart_from_its_bar() -> None:
    view = moment(20, "tabletop-mini")  # of its own: it is changed here
    lost = view.snapshot.robots.lost
    for code, cause in enumerate(CAUSES):
        if code not in (CAUSE_NOT_WAITING, CAUSE_NO_ORDER):
            lost[:] = 0
            lost[0, code] = 1
            assert f" {cause.name} " in shown(Figures(), view, WIDE, 80)


def test_two_runs_stand_side_by_side_with_the_better_one_marked() -> None:
    view = moment(1500, "tabletop-1", "fleet.robots=5", against="strategy.allocation=independent")
    first, second = (figures.metrics for figures in view.playback.figures)
    assert first["delivered"] > second["delivered"]
    lines: list[str] = []

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        figures = stage.widget
        assert isinstance(figures, Figures)
        figures.show(view)
        await pilot.pause()
        lines.extend(said(figures))

    run_in_harness(Figures(), story, 64, 40)
    assert lines[0] == f"A ahead, deliveries now {first['delivered'] - second['delivered']}"
    row = next(words.split() for words in lines if words.startswith("number of delivered orders"))
    difference = int(second["delivered"] - first["delivered"])
    assert row[4:] == [f"{first['delivered']}◂", f"{second['delivered']}", f"{difference}"]
    share = 100 * first["empty_moves_share"]
    assert f"share of moves without a {share:.1f}" in shown(Figures(), view, 64)
    assert "late orders" not in shown(Figures(), view, 64)  # orders have no due times
    assert "delivered orders" in shown(Figures(), view, NARROW)


def test_a_metric_without_room_beside_its_value_has_a_line_of_its_own() -> None:
    view = busy()
    metrics = view.playback.figures[0].metrics
    lines = [
        "".join(span if isinstance(span, str) else span.text for span in made)
        for made in Figures().panel_lines(view, 22)
    ]
    at = lines.index("empty_moves_share")
    assert lines[at + 1] == f"{percent(metrics['empty_moves_share'])}".rjust(22)
    assert f"delivered{metrics['delivered']:>6} orders" in lines


def test_figures_of_different_ticks_are_not_judged() -> None:
    view = moment(1500, "tabletop-1", "fleet.robots=5", against="strategy.allocation=independent")
    first, second = view.playback.figures
    assert "+" in shown(Figures(), view, 64) and "◂" in shown(Figures(), view, 64)
    early = replace(
        view, playback=replace(view.playback, figures=(replace(first, tick=900), second))
    )
    for width in (NARROW, WIDE):
        told = shown(Figures(), early, width, 200)
        assert "900 1,500" in told and "not compared: one run has ended" in told
        assert "◂" not in told and "better" not in told and "B - A" not in told
        assert f"{first.metrics['delivered']} {second.metrics['delivered']} " in told
    whole = tuple(replace(shown, finished=True) for shown in view.playback.snapshots)
    early_end = replace(whole[0], tick=900)
    ended = replace(early, playback=replace(early.playback, snapshots=(early_end, whole[1])))
    assert "◂" in shown(Figures(), ended, WIDE) and "900 1,500" in shown(Figures(), ended, WIDE)


def test_a_click_on_a_curve_leads_to_its_tick() -> None:
    figures = Figures()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        figures.show(busy())
        await pilot.pause()
        row = said(figures).index("waiting robots") + 3
        await pilot.click(figures, offset=(1 + metrics_panel.LABEL_WIDTH, row))
        await pilot.click(figures, offset=(figures.width, row))
        (_, first), (_, last) = stage.wishes()
        assert first == 0 and last == 600

    run_in_harness(figures, story, NARROW, 60)


def test_a_curve_fills_its_rows_up_to_the_label() -> None:
    values = np.array([0.0, 0.0, 10.0, 10.0, 5.0, 5.0])
    filled = metrics_panel.drawn_curve(values, 2, dots=True)
    assert filled == [
        "    10 \u2800⣿\u2800",
        "     0 \u2800⣿⣿",
    ]
    assert metrics_panel.drawn_curve(values, 2, dots=False) == ["    10   ||  ", "     0   ||||"]


def test_a_line_differs_from_a_filled_curve_by_more_than_its_colour_and_has_no_gap() -> None:
    values = np.array([0.0, 0, 4, 8, 8, 8, 4, 0])
    filled = metrics_panel.drawn_curve(values, 2, dots=True)
    assert filled == [
        "     8 \u2800⢸⣿\u2800",
        "     0 \u2800⣿⣿⡇",
    ]
    line = metrics_panel.drawn_curve(values, 2, dots=True, filled=False)
    assert line == ["     8 \u2800⢸⠉\u2800", "     0 \u2800⡇\u2800⠁"]
    rows = metrics_panel.drawn_curve(values, 2, dots=False, filled=False)
    assert rows == ["     8    '''  ", "     0   '   ' "]


def test_throughput_counts_the_deliveries_of_each_stretch() -> None:
    rows = np.zeros((4000, 3), np.int32)
    rows[:, 2] = np.arange(4000) // 100  # a delivery every 100 ticks
    known = Curve(rows, 1, 4000)
    assert np.allclose(metrics_panel.throughput_over_time(known, 4)[1:], 10)
    rows[2000:, 0] = 6
    assert metrics_panel.waiting_over_time(known, 4).tolist() == [0, 0, 6, 6]
    assert metrics_panel.now_throughput(known) == 10


@pytest.mark.parametrize("every", [2, 16, 512])
def test_of_a_thinned_curve_the_rates_stay_right(every: int) -> None:
    ticks = 40_000
    rows = np.zeros((ticks // every, 3), np.int32)
    rows[:, 2] = np.arange(1, len(rows) + 1) * every // 10  # a delivery every 10 ticks
    known = Curve(rows, every, ticks)
    assert np.allclose(metrics_panel.throughput_over_time(known, 40), 100, atol=2)
    assert abs(metrics_panel.now_throughput(known) - 100) < 2
    assert abs(metrics_panel.now_throughput(known.until(20_000)) - 100) < 2


def test_no_unit_is_cut_where_there_is_little_room() -> None:
    lines = lines_of_a_busy_run(24, 80)
    assert "last 500    34.0 /kt" in lines and "orders/1000 ticks" in lines
    lines = lines_of_a_busy_run(32, 80)
    at = lines.index("robots       5 working")
    assert lines[at - 2 : at] == ["bottleneck   robots, saturated", "100 % of the run"]


def test_a_click_explains_a_cause_and_a_share() -> None:
    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        figures = stage.widget
        assert isinstance(figures, Figures)
        figures.show(busy())
        await pilot.pause()
        for term, meaning in (
            ("working ahead", "another robot holds the next cell while it works there"),
            ("utilization", METRIC_CATALOGUE["utilization"][1]),
        ):
            assert meaning not in " ".join(said(figures))
            await click(pilot, figures, term)
            assert meaning in " ".join(" ".join(said(figures)).split())
            await click(pilot, figures, term)
            assert meaning not in " ".join(" ".join(said(figures)).split())

    run_in_harness(Figures(), story, WIDE, 80)
