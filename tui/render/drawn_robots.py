"""The characters of robots that are drawn, from their sprites, colours, numbers and charge."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings import looks as looks
from automaton.engine.robot_states import BATTERY_FULL
from automaton.engine.state import NIL
from tui.render import robot_marks as fleet
from tui.render import styles
from tui.render.glyphs import Codes, code
from tui.render.robot_sprites import BAR, BODY, FLAT, LOAD, POINTED, ROUND, sprites
from tui.render.styles import style

if TYPE_CHECKING:
    from tui.render.canvas import Canvas

Colours = NDArray[np.uint32]
HEADLESS: Final = (looks.SHAPE_SQUARE, looks.SHAPE_PLUG, looks.SHAPE_VOID, looks.SHAPE_CROSS)
GAP: Final = styles.COLOUR_VOID  # foreground of blanks, which are never underlined as signs are


def drawn_robots(
    canvas: Canvas, robots: fleet.Robots, which: NDArray[np.intp], body: Colours, ink: Colours
) -> Codes:
    """(k, characters of a cell) codes of the robots `which`, (k,), in these colours, (k,) each."""
    snapshot = canvas.scene.snapshot
    assert snapshot is not None
    drawings = sprites(canvas.width, canvas.height, canvas.scene.floor.battery)
    shape, direction = robots.shape[which], robots.direction[which].astype(np.intp)
    waits = snapshot.robots.cause[which] != 0
    outline = np.where(np.isin(shape, HEADLESS), ROUND, np.where(waits, FLAT, POINTED))
    load = (snapshot.robots.load[which] != NIL).astype(np.intp)
    colours = pixel_colours(canvas, which, body, drawings.bar[outline, direction])
    robot = np.arange(len(which))[:, None]
    above = drawings.upper[outline, load, direction]
    below = drawings.lower[outline, load, direction]
    upper, lower = colours[robot, above], colours[robot, below]
    codes = paired(canvas, upper, lower)
    if canvas.glyphs.shaded:  # without colours signs show the load
        cargo = (above == LOAD) & (below == LOAD)
        codes[cargo] = code(style(styles.COLOUR_FLOOR, lower[cargo]), canvas.glyphs.cargo)
    sign = drawings.sign[outline, direction]
    glyph = fleet.shapes(canvas.glyphs)[shape, direction]
    row = np.arange(len(which))
    codes[row, sign] = code(style(ink, ground(upper[row, sign], lower[row, sign])), glyph)
    starts, room = drawings.number[outline, direction], drawings.room[outline, direction]
    draw_numbers(canvas, codes, len(robots.cell), which, (starts, room), (upper, lower, ink))
    return codes


def pixel_colours(
    canvas: Canvas, which: NDArray[np.intp], body: Colours, bar: NDArray[np.intp]
) -> Colours:
    """(k, BAR + width) the colour of each robot's pixels, by what they show.

    bar: (k,) the pixels of the bar of a full battery.
    """
    colours = np.full((len(body), BAR + canvas.width), styles.COLOUR_FLOOR, np.uint32)
    colours[:, BODY] = body
    on_load = body == styles.COLOUR_LOADED
    colours[:, LOAD] = np.where(on_load, styles.COLOUR_TEXT, styles.COLOUR_LOADED)
    if canvas.scene.floor.battery:
        assert canvas.scene.snapshot is not None
        charge = canvas.scene.snapshot.robots.charge[which]
        pixels = -(-charge.astype(np.int64) * bar // BATTERY_FULL)
        full = np.where(charge < looks.LOW_CHARGE, styles.COLOUR_LOW_BATTERY, styles.COLOUR_DONE)
        lit = np.arange(canvas.width) < pixels[:, None]
        colours[:, BAR:] = np.where(lit, full[:, None], styles.COLOUR_FLOOR)
    return colours


def paired(canvas: Canvas, upper: Colours, lower: Colours) -> Codes:
    """The characters of pairs of pixels. One of one colour is a background, also in ASCII."""
    glyphs, floor = canvas.glyphs, styles.COLOUR_FLOOR
    codes = code(style(upper, lower), glyphs.upper_half)
    codes = np.where(upper == floor, code(style(lower, floor), glyphs.lower_half), codes)
    plain = np.where(upper == floor, floor, GAP)
    codes = np.where(upper == lower, code(style(plain, lower), glyphs.blank), codes)
    return np.asarray(codes, np.uint32)


def ground(upper: Colours, lower: Colours) -> Colours:
    """The background for what is written on pairs of pixels."""
    return np.where(lower == styles.COLOUR_FLOOR, upper, lower)


def draw_numbers(
    canvas: Canvas,
    codes: Codes,
    fleet_size: int,
    which: NDArray[np.intp],
    places: tuple[NDArray[np.intp], NDArray[np.intp]],
    colours: tuple[Colours, Colours, Colours],
) -> None:
    """Write the numbers of robots where they have room, in the middle of it."""
    digits = len(str(max(fleet_size - 1, 0)))
    (starts, room), (upper, lower, ink) = places, colours
    names = fleet.names(canvas.glyphs, fleet_size, digits)[which]
    first = starts + (room - digits + 1) // 2
    for column in range(digits):
        here = np.flatnonzero((room >= digits) & (names[:, column] != canvas.glyphs.blank))
        place = first[here] + column
        bg = ground(upper[here, place], lower[here, place])
        codes[here, place] = code(style(ink[here], bg), names[here, column])
