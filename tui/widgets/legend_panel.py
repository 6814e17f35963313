"""The legend: what the signs of the map mean, in the colours of the map."""

from __future__ import annotations

from tui.playback.panel_view import Picture, View
from tui.render.glyphs import GLYPH_BITS, GLYPHS
from tui.render.map_legend import Entry, legend, worst_cells
from tui.render.scene import Scene
from tui.widgets.styled_lines import Line, Span, cell_link, line, title, wrapped
from tui.widgets.text_panel import TextPanel

SIGN_COLUMNS = 9  # columns for the signs


class Legend(TextPanel):
    """Those signs that can occur on this floor, at this zoom, with this layer."""

    def panel_lines(self, view: View, width: int) -> list[Line]:
        picture = view.picture
        if picture is None:
            return []
        entries = legend(picture.scene, picture.zoom, picture.glyphs)
        signs = [made for entry in entries for made in _entry(entry, picture, width)]
        return [*signs, *_worst(picture.scene)]


def _entry(entry: Entry, picture: Picture, width: int) -> list[Line]:
    """The signs, and the meaning beside them."""
    signs: list[Span | str] = []
    for code in entry.signs[: SIGN_COLUMNS // 2]:
        style, glyph = code >> GLYPH_BITS, code & int(GLYPHS)
        signs += [Span(picture.glyphs.characters[glyph], picture.look.rich(style)), " "]
    gap = " " * (SIGN_COLUMNS - len(signs))
    meaning = wrapped(line(entry.meaning), width - SIGN_COLUMNS)
    first = (*line(*signs, gap), *meaning[0])
    return [first, *((Span(" " * SIGN_COLUMNS), *rest) for rest in meaning[1:])]


def _worst(scene: Scene) -> list[Line]:
    """The cells with the greatest numbers of the layer; a click leads there."""
    cells = [
        (cell_link(scene.floor.floor_plan, cell), number) for cell, number in worst_cells(scene)
    ]
    if not cells:
        return []
    wide = max(len(link.text) for link, _ in cells)
    rows = [line(link, f"{' ' * (wide - len(link.text))}{n:>9,}") for link, n in cells]
    return [(), line(title(f"most {scene.map_layer.unit}")), *rows]
