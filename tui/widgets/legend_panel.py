"""The legend: what the signs of the map mean, in the colours of the map."""

from __future__ import annotations

from tui.playback.panel_view import View
from tui.render.camera import Zoom
from tui.render.glyphs import GLYPH_BITS, GLYPHS, GlyphSet
from tui.render.map_legend import UNITS, Entry, legend, worst_cells
from tui.render.scene import Scene
from tui.render.styles import Look
from tui.widgets.signs import UNICODE, Signs
from tui.widgets.styled_lines import Line, Span, cell_link, line, title, wrapped
from tui.widgets.text_panel import TextPanel

SIGN_COLUMNS = 9  # columns for the signs


class Legend(TextPanel):
    """Those signs that can occur on this floor, at this zoom, with this layer."""

    def __init__(
        self, look: Look, glyphs: GlyphSet, signs: Signs = UNICODE, *, id: str | None = None
    ) -> None:
        super().__init__(signs, id=id)
        self.look, self.glyphs = look, glyphs
        self._of: tuple[Scene, Zoom] | None = None

    def panel_lines(self, view: View, width: int) -> list[Line]:
        return self._entries()

    def cache_key(self, view: View) -> tuple[object, ...]:
        return (self._of, id(self.look))

    def show_floor(self, scene: Scene, zoom: Zoom) -> None:
        """Explain a picture of this scene at this zoom."""
        self._of = (scene, zoom)
        self.write(self._entries())

    def set_appearance(self, look: Look, glyphs: GlyphSet) -> None:
        """Other colours or characters."""
        self.look, self.glyphs = look, glyphs
        self.write(self._entries())

    def _entries(self) -> list[Line]:
        if self._of is None:
            return []
        scene, zoom = self._of
        signs = [
            made
            for entry in legend(scene, zoom, self.glyphs)
            for made in self._entry(entry, self.width)
        ]
        return [*signs, *_worst(scene)]

    def _entry(self, entry: Entry, width: int) -> list[Line]:
        """The signs, and the meaning beside them."""
        signs: list[Span | str] = []
        for code in entry.signs[: SIGN_COLUMNS // 2]:
            style, glyph = code >> GLYPH_BITS, code & int(GLYPHS)
            signs += [Span(self.glyphs.characters[glyph], self.look.rich(style)), " "]
        gap = " " * (SIGN_COLUMNS - len(signs))
        meaning = wrapped(line(entry.meaning), width - SIGN_COLUMNS)
        first = (*line(*signs, gap), *meaning[0])
        return [first, *((Span(" " * SIGN_COLUMNS), *rest) for rest in meaning[1:])]

    def on_resize(self) -> None:
        super().on_resize()
        self.write(self._entries())


def _worst(scene: Scene) -> list[Line]:
    """The cells with the greatest numbers of the layer; a click leads there."""
    cells = [
        (cell_link(scene.floor.floor_plan, cell), number) for cell, number in worst_cells(scene)
    ]
    if not cells:
        return []
    wide = max(len(link.text) for link, _ in cells)
    rows = [line(link, f"{' ' * (wide - len(link.text))}{n:>9,}") for link, n in cells]
    return [(), line(title(f"most {UNITS[scene.layer]}")), *rows]
