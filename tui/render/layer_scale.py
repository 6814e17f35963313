"""The scale of a layer in one line: from which number to which, of what, in which colours.

visits 1 ▪▪▪▪▪▪▪▪ 120      or, while there is nothing to be seen: no visits yet
"""

from __future__ import annotations

import numpy as np

from tui.render.cell_view import flow_codes, heat_codes
from tui.render.field import HEAT_LEVELS
from tui.render.glyphs import GlyphSet
from tui.render.layer import ScaleLine
from tui.render.scene import Scene


def scale_line(scene: Scene, glyphs: GlyphSet) -> ScaleLine:
    """Words and signs, from the left; [] where no layer is shown, or its numbers are not there yet."""
    layer = scene.map_layer
    own: ScaleLine | None = layer.scale(scene, glyphs)
    if own is not None:
        return own
    if scene.values is None:
        return []
    if not scene.values.any():
        return [nothing_yet(scene)]
    codes = flow_codes(glyphs)[:, 0] if layer.arrows else heat_codes(glyphs)
    signs = tuple(codes[1:HEAT_LEVELS].tolist())
    least = int(scene.values[scene.values > 0].min(initial=scene.scale.end))
    return [f"{layer.unit or layer.name} {least:,}", signs, f"{int(np.max(scene.values)):,}"]


def nothing_yet(scene: Scene) -> str:
    """What is said of a layer all of whose numbers are 0."""
    layer = scene.map_layer
    return str(layer.empty or f"no {layer.unit or layer.name} yet")
