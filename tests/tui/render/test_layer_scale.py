"""Each layer says its scale in one line, and says so while it has nothing to show."""

from __future__ import annotations

import numpy as np
import pytest
from render_scenes import camera_at, fg, make_scene, open_floor
from zone_pictures import two_zones

from automaton.floor.traffic_zones import traffic_zones_of
from tui.registration import layers
from tui.render import styles
from tui.render.layer import scale_line
from tui.render.scene import Scene
from tui.render.styles import ASCII, UNICODE
from tui.widgets.legend_panel import legend
from tui.widgets.status import scale_words

FLOOR = open_floor(5, 5)
HEATS = list(range(styles.COLOUR_HEAT_1, styles.COLOUR_HEAT_8 + 1))


def with_numbers(layer: str, *numbers: int, **more: object) -> Scene:
    values = np.zeros(FLOOR.kind.size, np.int32)
    values[[FLOOR.cell(x, 1) for x in range(len(numbers))]] = numbers
    flow = np.stack([values, values * 0, values * 0, values * 0], axis=1)
    return make_scene(
        FLOOR, {"cell": FLOOR.cell(0, 0)}, heat=values, flow=flow, layer=layer, **more
    )


def said(scene: Scene) -> str:
    """The line as a person reads it, without colours."""
    return "".join(
        ASCII.characters[glyph] for word in scale_words(scene, ASCII) for glyph in word.glyphs
    )


@pytest.mark.parametrize(
    ("layer", "unit"),
    [("visits", "visits"), ("waiting", "ticks lost"), ("congestion", "ticks lost recently")],
)
def test_a_layer_of_numbers_says_the_least_and_the_greatest_the_unit_and_the_colours(
    layer: str, unit: str
) -> None:
    scene = with_numbers(layer, 3, 1250)
    words, signs, most = scale_line(scene, UNICODE)
    assert (words, most) == (f"{unit} 3", "1,250")
    assert [fg(sign) for sign in signs] == HEATS
    assert said(scene) == f"{unit} 3 .:-=+*#@ 1,250"


def test_arrows_have_their_own_signs() -> None:
    words, signs, most = scale_line(with_numbers("flow", 3, 9), UNICODE)
    assert (words, most) == ("moves 3", "9")
    assert {UNICODE.characters[sign & 0xFFFF] for sign in signs} == {"⇢"}


@pytest.mark.parametrize(
    ("layer", "words"),
    [
        ("visits", "no visits yet"),
        ("waiting", "no ticks lost so far"),
        ("congestion", "no ticks lost recently"),
        ("flow", "no moves yet"),
    ],
)
def test_an_empty_layer_says_so_in_the_line_and_in_the_legend(layer: str, words: str) -> None:
    scene = with_numbers(layer)
    assert said(scene) == words
    assert legend(scene, camera_at(FLOOR, "1x1").zoom, UNICODE)[0] == ((), words)


def test_predicted_paths_begin_with_the_number_that_was_asked_for() -> None:
    assert said(with_numbers("predicted", 3, 4)) == "robots to come: 2 -+*#@ 6 or more"
    assert said(with_numbers("predicted", 1)) == "no cell through which 2 or more will drive"


def test_explored_says_whether_the_scenario_searches_so() -> None:
    scene = with_numbers("explored", 1, 1, 2, selected=0)
    assert said(scene).split() == ["=", "explored", "3", "cells", "#", "path", "1"]
    vars(scene.floor)["routing"] = "astar"
    assert "hypothetical" not in said(scene)
    vars(scene.floor)["routing"] = "shortest"
    assert said(scene).startswith("A*, hypothetical (shortest routes)")
    words = [entry.meaning for entry in legend(scene, camera_at(FLOOR, "1x1").zoom, UNICODE)]
    assert words[0] == "hypothetical: this scenario routes by shortest, not by A*"
    assert said(scene.with_(selected=-1)) == "explored: select a robot"


def test_zones_show_their_tints() -> None:
    assert said(two_zones()) == "zone 1 fg 2"
    floor = traffic_zones_of(FLOOR, "with-intersections")
    scene = make_scene(FLOOR, zones=floor, layer="traffic-zones")
    words, signs, differ = scale_line(scene, UNICODE)
    assert words.endswith("zones") and differ == "touching ones differ" and len(signs) >= 1
    assert said(make_scene(FLOOR, layer="service-zones")).startswith("zones: robots serve none")


def test_the_plain_floor_has_no_scale_and_no_layer_is_without_one() -> None:
    assert scale_words(with_numbers(""), UNICODE) == []
    for name in layers().by_name:
        assert said(with_numbers(name, selected=0)), name
