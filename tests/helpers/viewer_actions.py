"""What each action of the viewer does, as a check by its name, and how it is carried out."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import map_cases  # its checks are entered into the table
import numpy as np
import pytest
from action_cases import CHECKS, check, press, said
from viewer_harness import PATIENCE_S, Watched, compared, mini, viewing

from automaton.engine.state import NIL
from tui.registration import layers
from tui.render import styles
from tui.render.styles import GLYPH_BITS
from tui.viewer.app import Viewer
from tui.widgets.bindings import COMPARING, HelpScreen
from tui.widgets.panel import Rows

__all__ = ["map_cases"]


def moves(name: str, start: int, end: int) -> None:
    """An action that goes from one tick to another."""

    async def action(user: Watched) -> None:
        await user.at(start)
        await press(user, name)
        await user.until(lambda: user.tick == end, f"tick {end}, not {user.tick}")

    CHECKS[name] = action


moves("step_forward", 150, 151)
moves("step_back", 150, 149)
moves("forward_10", 150, 160)
moves("back_10", 150, 140)
moves("forward_100", 150, 250)
moves("back_100", 150, 50)
moves("go_start", 150, 0)


@check
async def play_pause(user: Watched) -> None:
    await press(user, "play_pause")
    await user.until(lambda: user.session.playback.playing == 1 and user.tick > 0)
    await press(user, "play_pause")
    await user.until(lambda: user.session.playback.playing == 0)


@check
async def reverse(user: Watched) -> None:
    await user.at(150)
    await press(user, "reverse")
    await user.until(lambda: user.session.playback.playing == -1 and user.tick < 150)


def speeds(name: str, before: float, after: float) -> None:
    async def action(user: Watched) -> None:
        user.app.clock.set_speed(before)
        await user.until(lambda: user.session.playback.asked == 10 * before)
        await press(user, name)
        await user.until(lambda: user.session.playback.asked == 10 * after)

    CHECKS[name] = action


speeds("faster", 4.0, 8.0)
speeds("slower", 4.0, 2.0)
speeds("normal_speed", 4.0, 1.0)
speeds("full_speed", 4.0, math.inf)


@check
async def go_end(user: Watched) -> None:
    await user.at(150)
    await user.at(20)
    await press(user, "go_end")
    await user.until(lambda: user.tick == 150)


@check
async def go_to(user: Watched) -> None:
    await press(user, "go_to")
    await user.until(lambda: len(user.app.screen_stack) == 2)
    await user.press("1", "2", "3", "enter")
    await user.until(lambda: user.tick == 123)


async def with_events(user: Watched) -> list[int]:
    await user.at(300)
    return sorted(set(user.session.runs[0].event_history.events[:, 0].tolist()))


@check
async def next_event(user: Watched) -> None:
    ticks = await with_events(user)
    await user.at(ticks[3])
    await press(user, "next_event")
    await user.until(lambda: user.tick == ticks[4])


@check
async def previous_event(user: Watched) -> None:
    ticks = await with_events(user)
    await user.at(ticks[3])
    await press(user, "previous_event")
    await user.until(lambda: user.tick == ticks[2])


@check
async def follow(user: Watched) -> None:
    await user.at(120)
    user.session.choose(1)
    await press(user, "follow")
    assert user.session.choice.following
    camera = user.session.pictures.camera
    camera.resize(4, 12)
    await user.at(500)
    cell = int(user.session.playback.snapshots[0].robots.cell[1])
    assert camera.place_of(cell) is not None


@check
async def maximise(user: Watched) -> None:
    before = user.display.maps[0].size.height
    await press(user, "maximise")
    await user.until(lambda: user.display.maps[0].size.height > before)
    assert not user.app.query_one("#side").display


@check
async def minimap(user: Watched) -> None:
    user.session.pictures.camera.resize(4, 12)
    user.session.pictures.camera.one_to_one()
    before = user.session.pictures.corner(user.session.choice)
    await press(user, "minimap")
    after = user.session.pictures.corner(user.session.choice)
    assert (before is None) != (after is None)


@check
async def find(user: Watched) -> None:
    await press(user, "find")
    await user.until(lambda: len(user.app.screen_stack) == 2)
    await user.press(*"robot", "space", "2", "enter")
    await user.until(lambda: user.session.choice.robot == 2)


@check
async def jam(user: Watched) -> None:
    await press(user, "jam")
    await user.until(lambda: "no jam" in said(user.display.info))


@check
async def deadlock(user: Watched) -> None:
    await press(user, "deadlock")
    await user.until(lambda: "no deadlock" in said(user.display.info))


@check
async def bottleneck(user: Watched) -> None:
    await user.at(500)
    (worst, *_) = user.session.playback.figures[0].slow_places
    await press(user, "bottleneck")
    await user.until(lambda: f"1 {worst.place}: " in said(user.display.info))
    assert user.session.choice.cell == worst.cell == user.session.scene().slow_places[0]


@check
async def next_robot(user: Watched) -> None:
    user.session.choose(2)
    await press(user, "next_robot")
    await user.until(lambda: user.session.choice.robot == 0)


@check
async def previous_robot(user: Watched) -> None:
    user.session.choose(0)
    await press(user, "previous_robot")
    await user.until(lambda: user.session.choice.robot == 2)


@check
async def clear(user: Watched) -> None:
    user.session.choose(1)
    user.session.choice.matches = np.array([0, 1], np.int32)
    user.session.choice.following = True
    await press(user, "clear")
    choice = user.session.choice
    assert choice.robot == NIL and not len(choice.matches) and not choice.following


def opens(name: str, panel: str) -> None:
    async def action(user: Watched) -> None:
        user.display.column.open("figures")
        user.display.column.open("events" if panel != "events" else "inspector")
        user.session.choose(1)
        await press(user, name)
        await user.until(lambda: user.display.column.name_open == panel)

    CHECKS[name] = action


opens("why", "why")
opens("inspect", "inspector")
opens("events", "events")
opens("robots", "robots")
opens("legend", "legend")


@check
async def breakpoints(user: Watched) -> None:
    await press(user, "breakpoints")
    await user.until(lambda: len(user.app.screen_stack) == 2)
    await user.press(*"delivered", "enter", "escape")
    await user.until(lambda: user.app.branches.stops)
    user.session.player.play()
    await user.until(lambda: "delivered" in user.session.playback.stopped)


@check
async def branch(user: Watched) -> None:
    await user.at(200)
    await user.at(150)
    await press(user, "branch")
    await user.until(lambda: len(user.app.screen_stack) == 2)
    await user.press(*"durations.pick", "equals_sign", "3", "0", "ctrl+s")
    await user.until(lambda: user.session.runs[0].resolved.scenario.durations.pick == 30)
    await user.until(lambda: any(mark.kind == "branch" for mark in user.session.marks))
    assert user.tick == 150


def lays(name: str, before: str, after: str) -> None:
    async def action(user: Watched) -> None:
        await user.at(100)
        user.app.layers.show(before)
        await press(user, name)
        assert user.session.choice.layer == after

    CHECKS[name] = action


lays("layer_none", "visits", "")
lays("layer_visits", "", "visits")
lays("layer_waiting", "", "waiting")
lays("layer_congestion", "", "congestion")
lays("layer_flow", "", "flow")
lays("next_layer", "visits", "waiting")
lays("layer_zones", "", "traffic-zones")


@check
async def layer_streets(user: Watched) -> None:
    await press(user, "layer_streets")
    assert "no streets here, or none with weights of waiting" in user.toasts()


@check
async def layer_difference(user: Watched) -> None:
    await press(user, "layer_difference")
    text = "this layer compares two recordings: automaton replay REAL.rec SIMULATED.rec"
    assert text in user.toasts()


@check
async def layer_explored(user: Watched) -> None:
    await press(user, "layer_explored")
    assert "select a robot, and the search for its way is shown" in user.toasts()
    await user.at(120)
    user.session.choose(int(np.argmax(user.session.playback.snapshots[0].robots.route_length)))
    await user.until(lambda: np.any(user.session.playback.snapshots[0].heat))


@check
async def layer_predicted(user: Watched) -> None:
    await user.at(120)
    for least in (2, 3, 4, 5, 1):
        await press(user, "layer_predicted")
        assert user.session.choice.laid == f"predicted {least}+"
    await user.until(lambda: np.any(user.session.playback.snapshots[0].heat))
    assert (
        user.session.pictures.scene(user.session.playback, user.session.choice, 0).values
        is not None
    )
    for layer in (*layers().by_name, ""):  # the snapshot still brings what the layer before counts
        chosen = replace(user.session.choice, layer=layer)
        scene = user.session.pictures.scene(user.session.playback, chosen, 0)
        assert (scene.values is not None) == (layer == "predicted")
        user.session.pictures.picture(scene, chosen, 20, 60)


@check
async def next_colouring(user: Watched) -> None:
    choice, seen = user.session.choice, []
    for _ in range(3):
        await press(user, "next_colouring")
        seen.append(choice.colouring)
    assert seen == ["order", "waiting", "state"]  # all that robots differ in here
    offered = {one.title: one.callback for one in user.app.get_system_commands(user.app.screen)}
    assert "Colours: battery" not in offered
    offered["Colours: order"]()
    assert user.session.scene().colouring == "order"


@check
async def trails(user: Watched) -> None:
    await user.at(100)
    await press(user, "trails")
    await user.until(lambda: (user.session.scene().trails != NIL).any())
    await press(user, "trails")
    await user.until(lambda: not user.session.scene().trails.size)


@check
async def goal_lines(user: Watched) -> None:
    seen = []
    for _ in range(3):
        await press(user, "goal_lines")
        seen.append(user.session.scene().lines)
    assert seen == ["selected", "all", ""]


@check
async def layer_route(user: Watched) -> None:
    await user.at(120)
    user.session.choose(int(np.argmax(user.session.playback.snapshots[0].robots.route_length)))
    await user.until(lambda: len(user.session.playback.snapshots[0].route))
    await press(user, "layer_route")
    assert not len(user.session.pictures.scene(user.session.playback, user.session.choice, 0).route)


@check
async def panels(user: Watched) -> None:
    side, maps = user.app.query_one("#side"), user.app.query_one("#maps")
    assert side.display and maps.display
    await press(user, "panels")
    await user.until(lambda: side.display and not maps.display)
    await press(user, "panels")
    await user.until(lambda: not side.display and maps.display)


async def open_legend(user: Watched) -> Rows:
    """The legend beside the map, which has the focus and the keys."""
    user.app.panels.open("legend")
    legend: Rows = user.display.column.panels["legend"]
    await user.until(lambda: legend.max_scroll_y > 0)
    assert user.app.focused is user.display.maps[0]
    return legend


@check
async def scroll_down(user: Watched) -> None:
    legend = await open_legend(user)
    await press(user, "scroll_down")
    await user.until(
        lambda: legend.scroll_offset.y == min(legend.lines_for_rows, legend.max_scroll_y) > 0
    )


@check
async def scroll_up(user: Watched) -> None:
    legend = await open_legend(user)

    def at_end() -> bool:
        legend.scroll_end(animate=False)  # again when its height has changed
        return legend.scroll_offset.y == legend.max_scroll_y

    await user.until(at_end)
    await press(user, "scroll_up")
    await user.until(lambda: legend.scroll_offset.y < legend.max_scroll_y)


@check
async def compare_side(user: Watched) -> None:
    await press(user, "compare_side")
    assert user.session.view().side == 1


@check
async def next_difference(user: Watched) -> None:
    await user.until(lambda: user.session.divergence is not None)
    assert user.session.divergence.tick > 1
    await user.until(lambda: "the runs differ first" in said(user.display.info))
    foregrounds = user.display.info.shown[0, :9] // ((1 << GLYPH_BITS) * len(styles.COLOUR_TABLE))
    # blue, as found robots are, is not legible
    assert set(foregrounds.tolist()) == {styles.COLOUR_TEXT}
    await press(user, "next_difference")
    await user.until(lambda: user.tick == user.session.divergence.tick)


@check
async def screenshot(user: Watched) -> None:
    await user.at(120)
    await press(user, "screenshot")
    await user.until(lambda: list(Path.cwd().glob("tabletop-mini-120-*.svg")))
    assert "⊔" in next(Path.cwd().glob("*.svg")).read_text(encoding="utf-8")


@check
async def copy_text(user: Watched) -> None:
    await press(user, "copy_text")
    await user.until(lambda: list(Path.cwd().glob("tabletop-mini-0-*.txt")))
    assert "⊔" in next(Path.cwd().glob("*.txt")).read_text(encoding="utf-8")
    assert "⊔" in user.app.clipboard


@check
async def help(user: Watched) -> None:
    await press(user, "help")
    await user.until(lambda: isinstance(user.app.screen, HelpScreen))


@check
async def theme(user: Watched) -> None:
    await press(user, "theme")
    assert user.display.maps[0].look.theme == "light" and not user.app.current_theme.dark


@check
async def link_figures(user: Watched) -> None:
    await press(user, "link_figures")
    await user.until(lambda: "rtt" in said(user.display.info))


@check
async def quit(user: Watched) -> None:
    await press(user, "quit")
    await user.until(lambda: user.app.return_code == 0)


# Actions that leave nothing behind that another one of their row would take for its own doing.
TOGETHER = [
    row.split()
    for row in (
        "timeline_in timeline_out timeline_whole step_forward step_back forward_10 back_10 forward_100 "
        "back_100 go_start next_event previous_event faster slower normal_speed full_speed",
        "pan_left pan_right pan_up pan_down page_left page_right page_up page_down",
        "layer_none layer_visits layer_waiting layer_congestion layer_flow next_layer layer_zones "
        "layer_streets layer_difference",
        "why inspect events robots legend next_robot previous_robot clear",
    )
]


def rows_of_actions() -> list[list[str]]:
    """All actions, each with those that are checked in the same viewer."""
    shared = {name for row in TOGETHER for name in row}
    return [*TOGETHER, *([name] for name in CHECKS if name not in shared)]


async def carry_out(names: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check actions in one viewer."""
    opening = compared(folder) if COMPARING & set(names) else mini()
    async with viewing(opening) as user:
        for name in names:
            await check_action(name, user, monkeypatch)


async def check_action(name: str, user: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check an action that does nothing, which must be noticed, and then as it is."""
    does, called = Viewer.action_do, []

    async def do(app: Viewer, id: str) -> None:
        if id != name:
            await does(app, id)
            return
        called.append(id)
        user.patience = 0.1  # nothing comes of it: do not wait for long

    with monkeypatch.context() as patch:
        patch.setattr(Viewer, "action_do", do)
        with pytest.raises(AssertionError):
            await CHECKS[name](user)
    assert called, f"the key of {name} did not even reach the action"
    user.patience = PATIENCE_S
    await CHECKS[name](user)
