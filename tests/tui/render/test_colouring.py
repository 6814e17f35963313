"""Robots coloured by something else than their state."""

from __future__ import annotations

import numpy as np
import pytest
from render_scenes import at, bg, camera_at, fg, make_scene, open_floor
from zone_pictures import two_zones

from automaton.drawings.looks import DRAW_FAULT
from automaton.engine.observation import CAUSE_NO_ORDER
from automaton.engine.state import BATTERY_FULL
from tui.render import styles
from tui.render.drawn_robots import (
    BODY_COLOURS,
    COLOURINGS,
    DRAW_CLASS,
    DRAW_LEVEL,
    is_possible,
    robots_of,
)
from tui.render.scene import Scene
from tui.render.styles import UNICODE
from tui.widgets.legend_panel import legend

FLOOR = open_floor(6, 3)


def colours(scene: Scene) -> list[int]:
    """The colour of each robot."""
    return robots_of(scene).colour.tolist()


def scene_of(*robots: dict[str, int], **more: object) -> Scene:
    placed = [{"cell": FLOOR.cell(n, 1), **robot} for n, robot in enumerate(robots)]
    return make_scene(FLOOR, *placed, **more)


def test_robots_with_one_order_have_one_colour_and_those_without_that_of_parked_ones() -> None:
    scene = scene_of({"order": 3}, {"order": 11}, {"order": 4}, {}, colouring="order")
    expected = [
        styles.CLASS_COLOURS[3],
        styles.CLASS_COLOURS[3],
        styles.CLASS_COLOURS[4],
        styles.COLOUR_PARKED,
    ]
    assert colours(scene) == expected


def test_a_robot_with_a_load_keeps_the_colour_of_its_type() -> None:
    scene = scene_of({"type": 1}, {"type": 3, "load": 0}, {"type": 0}, colouring="type")
    assert not is_possible(scene, "type") and styles.CLASS_COLOURS[1] not in colours(scene)
    vars(scene.floor)["type_names"] = ("tug", "lifter")
    assert colours(scene) == [
        styles.CLASS_COLOURS[1],
        styles.CLASS_COLOURS[1],
        styles.CLASS_COLOURS[0],
    ]


def test_a_fuller_battery_has_a_higher_level() -> None:
    shares = (0, 0.19, 0.2, 0.5, 0.99, 1)
    robots = [{"charge": int(share * BATTERY_FULL)} for share in shares]
    scene = scene_of(*robots, colouring="battery", battery=True)
    levels = [styles.LEVEL_COLOURS.index(colour) for colour in colours(scene)]
    assert levels == [0, 0, 1, 2, 4, 4]


def test_a_longer_wait_has_a_higher_level_and_a_robot_without_order_does_not_wait() -> None:
    waits = [{"cause": 3, "since": 1000 - ticks} for ticks in (1, 9, 10, 50, 200)]
    scene = scene_of(*waits, {"cause": CAUSE_NO_ORDER}, colouring="waiting")
    vars(scene.snapshot)["tick"] = 1000
    levels = [styles.LEVEL_COLOURS.index(colour) for colour in colours(scene)]
    assert levels == [1, 1, 2, 3, 4, 0]


def test_robots_have_the_hues_of_their_service_zones() -> None:
    zoning = two_zones().snapshot.service_zones
    scene = scene_of({"service_zone": 1}, {"service_zone": 0}, {}, zoning=zoning, colouring="zone")
    assert colours(scene) == [
        styles.CLASS_COLOURS[1],
        styles.CLASS_COLOURS[0],
        styles.COLOUR_PARKED,
    ]


@pytest.mark.parametrize("colouring", COLOURINGS)
def test_a_robot_in_a_wait_cycle_or_down_keeps_its_colour_and_all_keep_their_shapes(
    colouring: str,
) -> None:
    robots = ({"wait_cycle_ticks": 70, "order": 1}, {"load": 2, "order": 2}, {"parked": 1})
    plain = scene_of(*robots, battery=True)
    scene = plain.with_(colouring=colouring)
    assert colours(scene)[0] == styles.COLOUR_FAULT
    assert robots_of(scene).shape.tolist() == robots_of(plain).shape.tolist()


def test_where_robots_share_a_character_one_in_a_wait_cycle_gives_it_its_colour() -> None:
    there = {"cell": FLOOR.cell(2, 1)}
    robots = ({**there, "order": 7}, {**there, "wait_cycle_ticks": 70, "order": 1})
    scene = make_scene(FLOOR, *robots, colouring="order")
    assert fg(at(scene, "braille 1", FLOOR.cell(2, 1))) == styles.COLOUR_FAULT


def test_the_table_of_colours_begins_with_those_of_states() -> None:
    assert BODY_COLOURS[DRAW_FAULT] == styles.COLOUR_FAULT and DRAW_FAULT + 1 == DRAW_CLASS
    assert BODY_COLOURS[DRAW_CLASS:DRAW_LEVEL].tolist() == list(styles.CLASS_COLOURS)


@pytest.mark.parametrize("zoom", ["1x1", "braille 1"])
def test_the_legend_says_what_the_colours_mean_and_which_signs_tell_the_state(zoom: str) -> None:
    scene = scene_of({"order": 3}, battery=True)
    steps = camera_at(FLOOR, zoom).zoom
    for colouring in ("order", "battery", "waiting"):
        entries = legend(scene.with_(colouring=colouring), steps, UNICODE)
        signs = [sign for entry in entries for sign in entry.signs]
        used = {fg(sign) for sign in signs} | {bg(sign) for sign in signs}
        wanted = styles.CLASS_COLOURS if colouring == "order" else styles.LEVEL_COLOURS
        assert set(wanted) <= used and styles.COLOUR_FAULT in used
        assert not {styles.COLOUR_ROBOT, styles.COLOUR_WAITING} & used
        words = " ".join(entry.meaning for entry in entries)
        assert ("robot with a load" in words) == (zoom == "1x1")
    said = [entry.meaning for entry in legend(scene.with_(colouring="waiting"), steps, UNICODE)]
    assert said[0] == "does not wait" and "has waited 10 to 49 ticks" in said


def test_colours_of_kinds_and_of_amounts_differ_in_every_theme_at_every_depth() -> None:
    for group in (styles.CLASS_COLOURS, styles.LEVEL_COLOURS):
        for theme in ("dark", "light"):
            rows = [getattr(styles.COLOUR_TABLE[one], theme) for one in group]
            for depth in range(3):
                assert len({row[depth] for row in rows}) == len(group), (theme, depth)


def test_no_layer_of_colours_is_offered_where_robots_do_not_differ_in_it() -> None:
    scene = scene_of({})
    assert [name for name in COLOURINGS if is_possible(scene, name)] == [
        *("state", "order", "waiting")
    ]
    assert np.array_equal(colours(scene.with_(colouring="battery")), colours(scene))
