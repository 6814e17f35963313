"""The scale of the layer that is shown, for the line under the map."""

from __future__ import annotations

from tui.render import styles
from tui.render.glyphs import GLYPH_BITS, GLYPHS, GlyphSet, code, text
from tui.render.layer_scale import scale_line
from tui.render.scene import Scene
from tui.render.styles import style
from tui.widgets.word_row import Word

SCALE_RANK = 1  # where there is not room for all, hints go before it, and it before messages


def scale_words(scene: Scene, glyphs: GlyphSet) -> list[Word]:
    """One word, so that it is there as a whole or not at all; [] without a scale."""
    codes: list[int] = []
    plain = style(styles.COLOUR_DIM, styles.COLOUR_VOID)
    for part in scale_line(scene, glyphs):
        blank = [int(code(plain, glyphs.blank))] if codes else []
        signs = [int(code(plain, glyph)) for glyph in text(part)] if isinstance(part, str) else part
        after_sign = isinstance(part, tuple) and codes and _is_sign(codes[-1], plain)
        codes += [*([] if after_sign else blank), *signs]
    if not codes:
        return []
    shown = tuple(one & int(GLYPHS) for one in codes)
    return [Word(shown, styles.COLOUR_DIM, rank=SCALE_RANK, codes=tuple(codes))]


def _is_sign(one: int, plain: int) -> bool:
    """Whether a code is a sign: those follow each other without a blank."""
    return one >> GLYPH_BITS != plain
