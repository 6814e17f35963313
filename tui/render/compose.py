"""A scene and a camera made a picture: one code for each character of the screen."""

from __future__ import annotations

import numpy as np

from tui.render import styles
from tui.render.braille_view import far_picture
from tui.render.camera import Camera
from tui.render.cell_view import near_picture
from tui.render.glyphs import Codes, GlyphSet, code
from tui.render.pixels import pixel_picture
from tui.render.scene import Scene
from tui.render.styles import style


def compose(scene: Scene, camera: Camera, glyphs: GlyphSet, out: Codes | None = None) -> Codes:
    """(camera.rows, camera.columns) codes; `out` is overwritten and returned if it is given."""
    if out is None or out.shape != (camera.rows, camera.columns):
        out = np.empty((camera.rows, camera.columns), np.uint32)
    kind, top, left = camera.zoom.kind, max(-camera.top, 0), max(-camera.left, 0)
    if kind == "cells":
        part = near_picture(scene, camera, glyphs)
        zoom = camera.zoom
        above = camera.top % zoom.height if camera.top > 0 else 0  # rows cut off
        before = camera.left % zoom.width if camera.left > 0 else 0  # and columns
        part = part[above : above + camera.rows, before : before + camera.columns]
    elif kind == "pixels" or scene.shaded:
        part = pixel_picture(scene, camera, glyphs)
    else:
        part = far_picture(scene, camera, glyphs)
    rows = min(part.shape[0], camera.rows - top)
    columns = min(part.shape[1], camera.columns - left)
    if (rows, columns) != out.shape:
        out[:] = code(style(styles.COLOUR_VOID, styles.COLOUR_VOID), glyphs.blank)
    out[top : top + rows, left : left + columns] = part[:rows, :columns]
    return out
