"""The legend: the meanings of the map's signs, in the colours of the map.

It lists the signs that can occur on this floor, at this zoom, with this layer.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from automaton.drawings import looks
from automaton.drawings.looks import DETAIL_OUTSIDE, DETAIL_SHIFT, KIND_MASK
from automaton.engine.state import STATUS_DEPLETED, STATUS_FAILED
from automaton.floor.floor_plan import CELL_KINDS, FLOOR, SHELF, STORAGE, TRACK, WALL
from automaton.vocabulary import COLOUR_WORDS, CONDITION_WORDS
from tui.playback.panel_view import Picture, View
from tui.render import drawn_robots as fleet
from tui.render import styles
from tui.render.camera import Zoom, shown_rectangle
from tui.render.cell_looks import (
    DRIVEN,
    FAR_SHELF,
    STORING_KINDS,
    cell_codes,
    colour_of,
    flow_codes,
    heat_codes,
    look,
)
from tui.render.drawn_robots import BAR_HEIGHT, colour_entries, is_possible
from tui.render.layer import nothing_yet
from tui.render.scene import (
    DETAIL_FULL_SHELF,
    DETAIL_PASSING,
    DETAIL_POD,
    DETAIL_UNLIMITED,
    HEAT_LEVELS,
    Scene,
    ShownFloor,
)
from tui.render.styles import GLYPH_BITS, GLYPHS, GlyphSet, code, style
from tui.widgets.panel import Line, Span, TextPanel, cell_link, line, title, wrapped

STROKE = 0x24  # braille dots of a horizontal line

MAX_WORST_CELLS = 10  # listed cells of a layer
SIGN_COLUMNS = 9  # columns for the signs
WAIT_CYCLE = COLOUR_WORDS["fault"].partition(",")[0]
FAR_STATES = (
    *(looks.DRAW_FAULT, looks.DRAW_WAITING, looks.DRAW_LOW_BATTERY, looks.DRAW_LOADED),
    *(looks.DRAW_EMPTY, looks.DRAW_CHARGING, looks.DRAW_IDLE),
    looks.DRAW_PARKED,
)


class Legend(TextPanel):
    """The panel of the legend."""

    def panel_lines(self, view: View, width: int) -> list[Line]:
        picture = view.picture
        if picture is None:
            return []
        entries = legend(picture.scene, picture.zoom, picture.glyphs)
        signs = [made for entry in entries for made in _entry(entry, picture, width)]
        return [*signs, *_worst(picture.scene)]


def _entry(entry: LegendLine, picture: Picture, width: int) -> list[Line]:
    """The lines of one entry: signs, and their meaning beside them."""
    signs: list[Span | str] = []
    for sign in entry.signs[: SIGN_COLUMNS // 2]:
        character = picture.glyphs.characters[sign & int(GLYPHS)]
        signs += [Span(character, picture.look.rich(sign >> GLYPH_BITS)), " "]
    gap = " " * (SIGN_COLUMNS - len(signs))
    meaning = wrapped(line(entry.meaning), width - SIGN_COLUMNS)
    first = (*line(*signs, gap), *meaning[0])
    return [first, *((Span(" " * SIGN_COLUMNS), *rest) for rest in meaning[1:])]


def _worst(scene: Scene) -> list[Line]:
    """The cells with the layer's greatest numbers, as links."""
    cells = [
        (cell_link(scene.floor.floor_plan, cell), number) for cell, number in worst_cells(scene)
    ]
    if not cells:
        return []
    wide = max(len(link.text) for link, _ in cells)
    rows = [line(link, f"{' ' * (wide - len(link.text))}{n:>9,}") for link, n in cells]
    return [(), line(title(f"most {scene.map_layer.unit}")), *rows]


class LegendLine(NamedTuple):
    """An entry of a legend."""

    signs: tuple[int, ...]  # codes
    meaning: str


def legend(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    """The entries: layer, robots, overlays, floor."""
    near = zoom.kind == "cells"
    entries = _robots(scene, zoom, glyphs) if near else _far_robots(scene, zoom, glyphs)
    if scene.colouring != "state" and is_possible(scene, scene.colouring):
        sign = glyphs.loaded[0] if near else glyphs.fleet[255]
        colours = [LegendLine(*entry) for entry in colour_entries(scene, sign)]
        entries = colours + _without_colours(entries, near)
    elif fleet.is_grey(scene):
        entries = _without_colours(entries, near)
    entries = _layer(scene, glyphs) + entries + _overlays(scene, zoom, glyphs)
    return entries + floor_legend(scene.floor, near, glyphs)


@lru_cache(maxsize=8)
def floor_legend(floor: ShownFloor, near: bool, glyphs: GlyphSet) -> list[LegendLine]:
    """The entries of the cells of a floor, `near` or where a character holds many."""
    return _cells(floor, glyphs) if near else _far_cells(floor, glyphs)


def _layer(scene: Scene, glyphs: GlyphSet) -> list[LegendLine]:
    """The layer's own entries, or heat levels with their numbers."""
    own = scene.map_layer.entries(scene, glyphs)
    if own is not None:
        return [LegendLine(*entry) for entry in own]
    if scene.values is None:
        return []
    if not scene.values.any():
        return [LegendLine((), nothing_yet(scene))]
    lines: dict[tuple[int, ...], list[int]] = {}
    for level in range(1, HEAT_LEVELS):
        heat = (int(heat_codes(glyphs)[level]),)
        arrows = tuple(flow_codes(glyphs)[level].tolist())
        lines.setdefault(arrows if scene.map_layer.arrows else heat, []).append(level)
    return [
        LegendLine(codes, f"{scene.map_layer.unit}: {scene.scale.words(levels[0], levels[-1])}")
        for codes, levels in lines.items()
    ]


def worst_cells(scene: Scene) -> list[tuple[int, int]]:
    """The cells with the greatest numbers of a ranked layer, and the numbers."""
    if not scene.map_layer.ranked or scene.values is None:
        return []
    order = np.argsort(-scene.values, kind="stable")[:MAX_WORST_CELLS]
    return [(int(cell), int(scene.values[cell])) for cell in order if scene.values[cell] > 0]


# Robots.


def _robots(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    shapes = fleet.shape_glyphs(glyphs)

    def signs(state: int, shape: int, directions: tuple[int, ...]) -> tuple[int, ...]:
        loaded = zoom.is_drawn and state == looks.DRAW_LOADED
        body = int(fleet.BODY_COLOURS[state])
        written = style(styles.COLOUR_FLOOR, body)
        drawn = tuple(int(code(written, shapes[shape, d])) for d in directions)
        cargo = style(styles.COLOUR_FLOOR, styles.COLOUR_TEXT)
        return (*drawn, int(code(cargo, glyphs.blank))) if loaded else drawn

    ways = (0, 1, 2, 3)
    waits = COLOUR_WORDS["waiting"] + (": flat in front" if zoom.is_drawn else "")
    load = "pod" if (scene.floor.floor_plan.kind == STORAGE).any() else "load"
    entries = [
        LegendLine(
            signs(looks.DRAW_EMPTY, looks.SHAPE_HOLLOW, ways), "robot, and the way it faces"
        ),
        LegendLine(signs(looks.DRAW_LOADED, looks.SHAPE_FILLED, ways), f"robot with a {load}"),
        LegendLine(signs(looks.DRAW_WAITING, looks.SHAPE_HOLLOW, (0,)), waits),
        LegendLine(signs(looks.DRAW_FAULT, looks.SHAPE_HOLLOW, (0,)), WAIT_CYCLE),
        LegendLine(signs(looks.DRAW_IDLE, looks.SHAPE_RING, (0,)), COLOUR_WORDS["idle"]),
        LegendLine(signs(looks.DRAW_PARKED, looks.SHAPE_SQUARE, (0,)), COLOUR_WORDS["parked"]),
    ]
    if scene.floor.battery:
        low = COLOUR_WORDS["low battery"]
        empty = CONDITION_WORDS[STATUS_DEPLETED]
        entries += [
            LegendLine(
                signs(looks.DRAW_CHARGING, looks.SHAPE_PLUG, (0,)), COLOUR_WORDS["charging"]
            ),
            LegendLine(signs(looks.DRAW_LOW_BATTERY, looks.SHAPE_THIN, ways), low),
            LegendLine(
                signs(looks.DRAW_LOW_BATTERY, looks.SHAPE_BOXED, ways), f"{low}, with a load"
            ),
            LegendLine(signs(looks.DRAW_FAULT, looks.SHAPE_VOID, (0,)), empty),
        ]
        if zoom.text_rows >= BAR_HEIGHT:
            bar = style(styles.COLOUR_DONE, styles.COLOUR_ROBOT)
            entries.append(
                LegendLine((int(code(bar, glyphs.lower_half)),), "charge of its battery")
            )
    if scene.floor.faults:
        broken = CONDITION_WORDS[STATUS_FAILED]
        entries.append(LegendLine(signs(looks.DRAW_FAULT, looks.SHAPE_CROSS, (0,)), broken))
    if scene.floor.loads_may_lie:
        left = int(code(style(styles.COLOUR_LOADED, styles.COLOUR_FLOOR), glyphs.left_load))
        entries.append(LegendLine((left,), "load that a robot had to leave"))
    kinds = {name.partition(" ")[0] for name in scene.floor.place_names.values()}
    for kind, sign, fg, name in (
        ("closing", glyphs.closed, styles.COLOUR_FAULT, "closed now"),
        ("closing", glyphs.closing, styles.COLOUR_TURNTABLE, "closed at times"),
        ("door", glyphs.door, styles.COLOUR_FAULT, "door that is shut"),
        ("door", glyphs.open_door, styles.COLOUR_TURNTABLE, "door that is open"),
        ("lift", glyphs.lift, styles.COLOUR_TURNTABLE, "lift"),
    ):
        if kind in kinds:
            entries.append(LegendLine((int(code(style(fg, styles.COLOUR_FLOOR), sign)),), name))
    if (scene.floor.floor_plan.capacity[scene.floor.floor_plan.drivable] != 1).any():
        several = style(styles.COLOUR_FLOOR, styles.COLOUR_ROBOT)
        entries.append(
            LegendLine((int(code(several, glyphs.digits[2])),), "number of robots in one cell")
        )
    claim = int(code(style(styles.COLOUR_DIM, styles.COLOUR_FLOOR), glyphs.arrow[0]))
    return [*entries, LegendLine((claim,), "held by a robot that is moving in")]


def _far_robots(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    words = [COLOUR_WORDS[name] for name in looks.STATE_COLOURS]
    if not scene.floor.loads_may_lie:
        words[looks.DRAW_FAULT] = WAIT_CYCLE
    entries = []
    for state in FAR_STATES:
        if state not in (looks.DRAW_CHARGING, looks.DRAW_LOW_BATTERY) or scene.floor.battery:
            shown = _far_sign(scene, zoom, glyphs, int(fleet.BODY_COLOURS[state]))
            entries.append(LegendLine((shown,), words[state]))
    return entries


def _far_sign(scene: Scene, zoom: Zoom, glyphs: GlyphSet, colour: int) -> int:
    """The sign of a robot at small zooms."""
    floor = shown_rectangle(scene.floor.floor_plan)
    rows, columns = zoom.size((floor.bottom - floor.top, floor.right - floor.left))
    robots = 0 if scene.snapshot is None else len(scene.snapshot.robots.cell)
    on_layer = scene.values is not None or scene.tints is not None
    if zoom.kind == "pixels" and not on_layer:
        return int(code(style(colour, styles.COLOUR_FLOOR), glyphs.upper_half))
    mark = fleet.far_mark(robots, rows * columns, on_layer or zoom.kind == "pixels")
    if mark == fleet.MARK_FULL:
        return int(code(style(styles.COLOUR_FLOOR, colour), glyphs.fleet_full))
    dots = glyphs.fleet_quarters if zoom.kind == "quarters" and not on_layer else glyphs.fleet
    sign = glyphs.fleet_half[0] if mark == fleet.MARK_HALF else dots[255]
    return int(code(style(colour, styles.COLOUR_FLOOR), sign))


def _without_colours(entries: list[LegendLine], near: bool) -> list[LegendLine]:
    """The signs of robots in one colour, for colourings other than by state.

    Small zooms have no shapes: there, only robots in wait cycles or down keep an entry.
    """
    bodies = {style(styles.COLOUR_FLOOR, int(colour)): colour for colour in fleet.BODY_COLOURS}
    plain = style(styles.COLOUR_FLOOR, styles.COLOUR_TEXT)
    shown = []
    for signs, meaning in entries:
        alarms = styles.COLOUR_FAULT in divmod(signs[0] >> GLYPH_BITS, len(styles.COLOUR_TABLE))
        body = bodies.get(signs[0] >> GLYPH_BITS)
        if alarms or (near and body is None):
            shown.append(LegendLine(signs, meaning))
        elif near and body != styles.COLOUR_WAITING:
            shapes = [int(code(plain, one & int(GLYPHS))) for one in signs if one & int(GLYPHS)]
            shown.append(LegendLine(tuple(shapes), meaning))
    return shown


# Overlays and the floor.


def _overlays(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    def bg(fg: int) -> tuple[int, ...]:
        sign = glyphs.robot[0] if zoom.kind == "cells" else glyphs.upper_half
        return (int(code(style(styles.COLOUR_ROBOT, fg), sign)),)

    entries = []
    if scene.selected >= 0:
        entries.append(LegendLine(bg(styles.COLOUR_SELECTED), f"robot {scene.selected}, selected"))
        route = style(styles.COLOUR_ROUTE, styles.COLOUR_FLOOR)
        sign = glyphs.lines[STROKE] if zoom.is_drawn else glyphs.route
        entries.append(LegendLine((int(code(route, sign)),), "its route"))
        if zoom.kind == "cells":
            entries.append(LegendLine((int(code(route, glyphs.stand)),), "where the route ends"))
    entries += path_entries(scene, glyphs)
    if scene.bottlenecks:
        mark = style(styles.COLOUR_FLOOR, styles.COLOUR_MARKED)
        signs = tuple(int(code(mark, glyphs.digits[n + 1])) for n in range(len(scene.bottlenecks)))
        entries.append(LegendLine(signs, "where most time was lost"))
    if scene.zone >= 0:
        entries.append(
            LegendLine(
                (int(code(style(styles.COLOUR_FLOOR, styles.COLOUR_MARKED), glyphs.blank)),),
                scene.zone_name,
            )
        )
    if len(scene.marked) or len(scene.marked_cells):
        entries.append(LegendLine(bg(styles.COLOUR_MARKED), "found, or differs from the other run"))
    if len(scene.ghosts):
        sign = glyphs.ghost if zoom.kind == "cells" else glyphs.braille[255]
        ghost = int(code(style(styles.COLOUR_DIM, styles.COLOUR_FLOOR), sign))
        entries.append(LegendLine((ghost,), "where a robot of the other run is"))
    return entries


def path_entries(scene: Scene, glyphs: GlyphSet) -> list[LegendLine]:
    """Trails of robots and lines to their goals."""
    trail = int(code(style(styles.COLOUR_TRAIL, styles.COLOUR_FLOOR), glyphs.trail))
    line = style(styles.COLOUR_GOAL_LINE, styles.COLOUR_FLOOR)
    signs = tuple(int(code(line, ord(sign))) for sign in "-/")
    whose = "the selected robot" if scene.lines == "selected" else "each robot"
    entries = [LegendLine((trail,), "where robots came from")] if scene.trails.size else []
    return entries + (
        [LegendLine(signs, f"from {whose} straight to its goal")] if scene.lines else []
    )


def _cells(floor: ShownFloor, glyphs: GlyphSet) -> list[LegendLine]:
    """The looks of this floor; looks that differ only in direction share an entry."""
    codes = cell_codes(glyphs, 1)
    lines: dict[str, list[int]] = {}
    numbers = set(np.unique(floor.looks).tolist())
    if look(SHELF) in numbers:
        numbers.add(look(SHELF, DETAIL_FULL_SHELF))
    if look(STORAGE) in numbers:
        numbers.add(look(STORAGE, DETAIL_POD))
    for number in sorted(numbers - {look(WALL, DETAIL_OUTSIDE)}):
        signs = lines.setdefault(_meaning(number), [])
        if int(codes[number, 0]) not in signs:
            signs.append(int(codes[number, 0]))
    return [LegendLine(tuple(signs), meaning) for meaning, signs in lines.items()]


def _far_cells(floor: ShownFloor, glyphs: GlyphSet) -> list[LegendLine]:
    kinds = [kind for kind in np.unique(floor.floor_plan.kind).tolist() if kind not in DRIVEN]

    def sign(kind: int) -> int:
        fg = FAR_SHELF if kind in STORING_KINDS else colour_of(look(kind))
        return int(code(style(fg, styles.COLOUR_FLOOR), glyphs.braille[255]))

    return [LegendLine((sign(kind),), CELL_KINDS[kind].name.replace("-", " ")) for kind in kinds]


def _meaning(number: int) -> str:
    kind, detail = number & KIND_MASK, number >> DETAIL_SHIFT
    if kind == SHELF:
        return "shelf with a load" if detail == DETAIL_FULL_SHELF else "empty shelf"
    if kind == STORAGE:
        return "pod in storage" if detail == DETAIL_POD else "storage without a pod"
    if kind == TRACK:
        return "track, driven along"
    if kind == FLOOR and detail:
        return {
            DETAIL_PASSING: "two robots pass here",
            DETAIL_UNLIMITED: "any number of robots",
        }.get(detail, "one-way floor")
    return {"turntable": "turntable: robots turn here"}.get(
        CELL_KINDS[kind].name, CELL_KINDS[kind].name.replace("-", " ")
    )
