"""Storage cells on the screen: with a pod and without, near and far."""

from __future__ import annotations

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


def test_the_legend_names_pods_and_robots_that_carry_them() -> None:
    scene = make_scene(drawn(AISLE))
    _, camera = composed(scene, "1x1")
    meanings = [entry.meaning for entry in legend(scene, camera.zoom, UNICODE)]
    assert {"pod in storage", "storage without a pod", "robot with a pod"} <= set(meanings)
    assert "robot with a load" not in meanings
