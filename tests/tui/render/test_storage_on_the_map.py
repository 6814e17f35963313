"""Storage cells on the screen: with a pod and without, near and far."""

from __future__ import annotations

import numpy as np
import pytest
from render_scenes import composed, drawn, fg, make_scene, text

from tui.render import styles
from tui.render.cell_looks import FAR_LOAD, FAR_SHELF
from tui.render.compose import compose
from tui.render.styles import ASCII, UNICODE
from tui.widgets.legend_panel import legend

AISLE = ">>>>>v\n^pqpqv\n^<<<<<"


def test_pods_have_a_sign_and_so_has_storage_without() -> None:
    scene = make_scene(drawn(AISLE))
    codes, camera = composed(scene, "1x1")
    assert text(codes).split("\n")[1] == "⌃⊓▫⊓▫⌄"
    assert text(compose(scene, camera, ASCII), ASCII).split("\n")[1] == "npqpqu"


def test_an_aisle_beside_storage_keeps_its_arrow() -> None:
    scene = make_scene(drawn(AISLE))
    _, camera = composed(scene, "1x1")
    rows = text(compose(scene, camera, ASCII), ASCII).split("\n")
    assert (rows[0], rows[2]) == (")))))u", "n(((((")


def test_a_pod_that_is_lifted_is_gone() -> None:
    scene = make_scene(drawn(AISLE))
    assert scene.snapshot is not None
    scene.snapshot.slots.content[0] = -1
    codes, _ = composed(scene, "1x1")
    assert text(codes).split("\n")[1] == "⌃▫▫⊓▫⌄"


@pytest.mark.parametrize("zoom", ["half", "braille 1", "braille 2"])
def test_from_afar_storage_is_faint(zoom: str) -> None:
    rows = [">" * 39 + "v", *["^" + "pq" * 19 + "v"] * 10, "^" + "<" * 39]
    codes, _ = composed(make_scene(drawn("\n".join(rows))), zoom)
    shown = {fg(code) for code in codes.reshape(-1)}
    assert shown & {FAR_SHELF, FAR_LOAD}
    assert shown <= {FAR_SHELF, FAR_LOAD, styles.COLOUR_FLOOR, styles.COLOUR_WALL}


def test_from_afar_storage_has_the_hue_of_loads_and_walls_are_grey() -> None:
    """Storage lacks blue, which people blind for red or green see."""
    for theme in ("dark", "light"):
        look = styles.Look(styles.Depth.TRUE, theme)
        inks = (look.pair(styles.style(fg, styles.COLOUR_FLOOR))[0] for fg in (FAR_SHELF, FAR_LOAD))
        assert all(red - blue >= 48 for red, _, blue in map(styles.channels, inks))
        wall = look.pair(styles.style(styles.COLOUR_WALL, styles.COLOUR_FLOOR))[0]
        assert len({*styles.channels(wall)}) == 1


@pytest.mark.parametrize("zoom", ["half", "quadrants", "braille 1"])
@pytest.mark.parametrize("layer", ["", "visits"])
def test_from_afar_walls_differ_from_storage(zoom: str, layer: str) -> None:
    floor_plan = drawn("\n".join(["....####....pppp....qqqq...."] * 24))
    heat = np.zeros((floor_plan.kind.size,), np.int32)
    codes, camera = composed(make_scene(floor_plan, heat=heat, layer=layer), zoom)
    shown = []
    for column in (5, 13, 21):
        place = camera.place_of(floor_plan.cell(column, 12))
        assert place is not None
        shown.append(fg(codes[place]))
    assert shown[0] == styles.COLOUR_WALL
    assert {*shown[1:]} <= {FAR_SHELF, FAR_LOAD}


def test_the_legend_names_pods_and_robots_that_carry_them() -> None:
    scene = make_scene(drawn(AISLE))
    _, camera = composed(scene, "1x1")
    meanings = [entry.meaning for entry in legend(scene, camera.zoom, UNICODE)]
    assert {"pod in storage", "storage without a pod", "robot with a pod"} <= set(meanings)
    assert "robot with a load" not in meanings
