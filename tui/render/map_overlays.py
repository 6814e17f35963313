"""Zones as tints and letters; what A* explores and where others will drive, as levels of heat.

Where there are no colours, or the same ones, a letter tells touching zones apart: ddd+ee
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from automaton.floor.cells import FLOOR, TRACK
from tui.render import styles
from tui.render.canvas import Canvas
from tui.render.field import EXPLORED, ON_PATH, PREDICTED
from tui.render.glyphs import GLYPH_BITS, GLYPHS, Codes, GlyphSet, code
from tui.render.scene import Floor, Scene
from tui.render.service_zone_overlay import (
    TRANSFER_COLOUR,
    design_entries,
    draw_stations,
    station_words,
)
from tui.render.styles import style
from tui.render.traffic_zone_tints import TINT_CODES, TINTS

TINT_COLOURS: Final = np.array(TINTS, np.uint32)
TINT_LETTERS: Final = np.array(TINT_CODES, np.uint32)


def overlay_meanings(scene: Scene) -> list[tuple[int, str]]:
    """What the levels mean on this floor now, with how many cells there are; level 0 has no sign."""
    values = scene.values
    if scene.layer == "explored":
        if scene.selected == NIL:
            return [(0, "explored: select a robot, and its search is shown")]
        if values is None or not values.any():
            return [(0, f"explored: robot {scene.selected} is on no way")]
        found, path = np.count_nonzero(values), np.count_nonzero(values == 2)
        who = f"robot {scene.selected}"
        return [
            (EXPLORED, f"explored by the search of A* for {who}: {found:,} cells"),
            (ON_PATH, f"the path that it finds: {path:,} cells"),
        ]
    if values is None:
        return []
    others = "robots" if scene.selected == NIL else "other robots"
    said = []
    for at, level in enumerate(PREDICTED):
        many = scene.least + at
        more = at == len(PREDICTED) - 1
        cells = np.count_nonzero(values >= many if more else values == many)
        words = f"{many}{' or more' if more else ''} {others} will drive here: {cells:,} cells"
        said.append((level, words))
    return said


def value_words(scene: Scene, value: int) -> list[str]:
    """What the number of a cell means."""
    if scene.layer != "explored":
        return [f"{scene.layer} {value}"]
    return [["not explored"], ["explored"], ["explored", "on the path of A*"]][value]


def zone_entries(scene: Scene, glyphs: GlyphSet) -> list[tuple[tuple[int, ...], str]]:
    """Signs and meanings of the layer "traffic-zones"."""
    if scene.layer == "service-zones":
        return design_entries(scene, glyphs)
    traffic_zones = scene.floor.traffic_zones
    if traffic_zones is None or not traffic_zones.count:
        return [((), "zones: this floor has none, all of it is intersections")]
    used = np.unique(scene.floor.tints[scene.floor.tints != NIL])
    foregrounds = TINT_COLOURS[used]
    signs = code(style(foregrounds, foregrounds), TINT_LETTERS[used]).tolist()
    said = f"{traffic_zones.count:,} zones, {traffic_zones.mode}; those that touch differ"
    entries = [(tuple(signs[:4]), said)]
    entries += [(tuple(signs[4:]), "more of them")] if signs[4:] else []
    if traffic_zones.mode != "with-intersections" and traffic_zones.intersection.any():
        entries.append(((crossing_sign(glyphs),), "intersection, in no zone"))
    return entries


def zone_key(floor: Floor, glyphs: GlyphSet) -> list[str]:
    """What a picture of zones without a legend beside it has to say, in a few words each."""
    traffic_zones = floor.traffic_zones
    if traffic_zones is None or not traffic_zones.count:
        return ["this floor has no zones"]
    letters = " ".join(
        chr(code) for code in TINT_LETTERS[np.unique(floor.tints[floor.tints != NIL])]
    )
    said = [f"a tint or letter ({letters}) for each zone", "touching ones differ"]
    signed = (
        floor.floor_plan.kind.reshape(-1)[traffic_zones.intersection] == FLOOR
    )  # others keep their signs
    if traffic_zones.mode != "with-intersections" and signed.any():
        said.append(f"{glyphs.characters[glyphs.crossing]} intersection")
    return said


def crossing_sign(glyphs: GlyphSet) -> int:
    """An intersection while zones are shown."""
    return int(code(style(styles.COLOUR_DIM, styles.COLOUR_FLOOR), glyphs.crossing))


def zone_words(scene: Scene, cell: int) -> list[str]:
    """The zone of a cell; two where directions have their own; that of its robot, if they serve zones."""
    if scene.service_zones is not None:
        return station_words(scene, cell)
    traffic_zones = scene.floor.traffic_zones
    if traffic_zones is None or not scene.floor.drivable[cell]:
        return []
    numbers = sorted({int(zone) for zone in traffic_zones.of[cell] if zone != NIL})
    if not numbers:
        return ["intersection"]
    return [f"zone{'s' * (len(numbers) > 1)} {' and '.join(map(str, numbers))}"]


def draw_zone_signs(canvas: Canvas) -> None:
    """Cells tinted by zone. Free floor bears a letter that is seen without colours only.

    A straight track bears it in its own colour; other cells keep their signs and bear it beside.
    """
    scene = canvas.scene
    tints = canvas.cells(scene.tints).reshape(-1)
    looks = canvas.cells(canvas.scene.floor.looks.reshape(-1)).reshape(-1)
    index = np.flatnonzero(tints != NIL)
    tint = tints[index]
    canvas.set_background(index, TINT_COLOURS[tint][:, None])
    letters, foregrounds = TINT_LETTERS[tint], TINT_COLOURS[tint]
    plain = (looks[index] if scene.served is None else looks[index] & 15) == FLOOR
    rails = looks[index] & 15 == TRACK
    canvas.flat[index[plain], 0] = code(style(foregrounds, foregrounds), letters)[plain]
    tracks = style(np.full(len(index), styles.COLOUR_TRACK), foregrounds)
    canvas.flat[index[rails], 0] = code(tracks, letters)[rails]
    if canvas.width > 1:
        beside = canvas.flat[index, 1] & GLYPHS == canvas.glyphs.blank
        signed = beside & ~plain & ~rails
        canvas.flat[index[signed], 1] = code(style(foregrounds, foregrounds), letters)[signed]
    if scene.served is not None:
        draw_stations(canvas, scene.served)
        return
    traffic_zones = scene.traffic_zones
    if traffic_zones is None:
        return
    crossings = np.flatnonzero(
        canvas.cells(traffic_zones.intersection).reshape(-1) & (tints == NIL)
    )
    crossings = crossings[looks[crossings] == FLOOR]
    canvas.flat[crossings, 0] = crossing_sign(canvas.glyphs)


def paint_tints(pixels: NDArray[np.uint8], tints: NDArray[np.int8]) -> None:
    """Pixels in the tints of their zones."""
    inside = tints != NIL
    pixels[inside] = TINT_COLOURS[tints[inside]]


def sign_tints(codes: Codes, pixels: NDArray[np.uint8], thin: bool = False) -> Codes:
    """A character whose halves have one tint bears its letter, unseen where there are colours.

    thin: ways are no wider than half a character, and there are no colours: one half is enough, and
    stations bear their signs.
    """
    top = pixels[0::2]
    whole = (top == pixels[1::2]) & np.isin(top, TINT_COLOURS)
    if thin:
        bottom = pixels[1::2]
        whole = np.isin(top, TINT_COLOURS) | np.isin(bottom, TINT_COLOURS)
        top = np.where(np.isin(top, TINT_COLOURS), top, bottom)
    letter_of: NDArray[Any] = np.zeros(len(styles.COLOURS), np.uint32)
    letter_of[TINT_COLOURS] = TINT_LETTERS
    fg = top[whole].astype(np.uint32)
    signed = codes.copy()
    signed[whole] = (style(fg, fg) << np.uint32(GLYPH_BITS)) | letter_of[fg]
    if thin:
        for sign, its_fg in (
            (GlyphSet.station, styles.COLOUR_DIM),
            (GlyphSet.transfer, TRANSFER_COLOUR),
        ):
            here = (pixels[0::2] == its_fg) | (pixels[1::2] == its_fg)
            signed[here] = code(style(its_fg, styles.COLOUR_FLOOR), sign)
    return signed
