"""Trails behind robots and lines to their goals, under the robots and over the floor."""

from __future__ import annotations

import numpy as np
import pytest
from render_scenes import ALL, NEAR, at, bg, camera_at, composed, drawn, fg, make_scene, text

from automaton.engine.state import NIL
from tui.render import styles
from tui.render.cell_view import MAX_LINE_CELLS, goal_lines
from tui.render.scene import Scene
from tui.render.styles import ASCII, UNICODE
from tui.widgets.legend_panel import legend

FLOOR = drawn("........\n" * 4)


def scene_of(*ends: tuple[tuple[int, int], tuple[int, int] | None], **more: object) -> Scene:
    """Robots, each in a cell, on the way to another."""
    robots = [
        {"cell": FLOOR.cell(*start), "goal_cell": NIL if goal is None else FLOOR.cell(*goal)}
        for start, goal in ends
    ]
    return make_scene(FLOOR, *robots, **more)


def rows(scene: Scene) -> list[str]:
    from tui.render.compose import compose

    return text(compose(scene, camera_at(FLOOR, "1x1"), ASCII), ASCII).split("\n")


def test_a_line_leads_straight_from_a_robot_to_its_goal() -> None:
    scene = scene_of(((0, 0), (7, 0)), ((0, 3), (3, 0)), ((7, 3), None), lines="all")
    assert rows(scene) == [
        ">------.",
        "../.....",
        "./......",
        ">......>",
    ]


def test_one_that_falls_and_one_along_y() -> None:
    scene = scene_of(((0, 0), (3, 3)), ((7, 0), (7, 3)), lines="all")
    assert rows(scene) == [
        ">......>",
        ".\\.....|",
        "..\\....|",
        "........",
    ]


def test_the_selected_robot_alone_or_none_has_a_line() -> None:
    ends = ((0, 0), (7, 0)), ((0, 3), (7, 3))
    scene = scene_of(*ends, selected=1, lines="selected")
    assert rows(scene)[0] == ">......." and rows(scene)[3] == ">------."
    assert goal_lines(scene.with_(selected=NIL))[0].size == 0
    assert goal_lines(scene.with_(lines=""))[0].size == 0


def test_lines_of_a_large_fleet_have_a_bound() -> None:
    ends = [((0, 0), (7, 3))] * (MAX_LINE_CELLS // 7 + 500)
    cells, ways = goal_lines(scene_of(*ends, lines="all"))
    assert MAX_LINE_CELLS * 0.8 < len(cells) == len(ways) <= MAX_LINE_CELLS


@pytest.mark.parametrize("zoom", ALL)
def test_a_trail_is_dim_and_beneath_robots(zoom: str) -> None:
    cells = [FLOOR.cell(3, 2), FLOOR.cell(2, 2), FLOOR.cell(6, 0), NIL]
    before = scene_of(((3, 2), None), ((6, 0), None))
    after = before.with_(trails=np.array([cells[:2], cells[2:]], np.int32))
    assert fg(at(after, zoom, cells[1])) == styles.COLOUR_TRAIL or zoom in (
        "braille 1",
        "quadrants",
    )
    assert at(after, zoom, cells[0]) == at(before, zoom, cells[0])
    changed = np.argwhere(composed(before, zoom)[0] != composed(after, zoom)[0])
    assert len(changed) <= 1


def test_a_trail_on_a_hot_cell_stands_on_its_heat() -> None:
    heat = np.zeros(FLOOR.kind.size, np.int32)
    heat[FLOOR.cell(2, 2)] = 50
    trail = np.array([[FLOOR.cell(2, 2)]], np.int32)
    scene = scene_of(((3, 2), None), heat=heat, layer="visits", trails=trail)
    for zoom in NEAR:
        shown = at(scene, zoom, FLOOR.cell(2, 2))
        assert (fg(shown), bg(shown)) == (styles.COLOUR_TRAIL, styles.COLOUR_HEAT_8)


def test_the_legend_explains_both() -> None:
    zoom = camera_at(FLOOR, "1x1").zoom
    plain = scene_of(((0, 0), (7, 0)))
    shown = plain.with_(trails=np.array([[NIL]], np.int32), lines="all")
    before, after = ([entry.meaning for entry in legend(s, zoom, UNICODE)] for s in (plain, shown))
    assert set(after) - set(before) == {
        "where robots came from",
        "from each robot straight to its goal",
    }
