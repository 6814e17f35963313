"""Closed cells and shut doors on the screen."""

from __future__ import annotations

import numpy as np
from render_scenes import composed, drawn, make_scene, text

from tui.render.compose import compose
from tui.render.styles import ASCII


def test_closed_cells_and_shut_doors_have_signs_of_their_own() -> None:
    scene = make_scene(drawn("......"))
    at = scene.floor.floor_plan.cell
    cells = tuple(np.array([at(x, 0)], np.int32) for x in (2, 4))
    scene.__dict__["shut_cells"] = cells
    codes, camera = composed(scene, "1x1")
    assert text(codes)[2] == "⊠" and text(codes)[4] == "⊟"
    signs = text(compose(scene, camera, ASCII), ASCII)
    assert signs[2] == "x" and signs[4] == "D"
