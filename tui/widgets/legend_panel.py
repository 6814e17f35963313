"""The legend: the meanings of the map's signs, in the colours of the map.

It lists the signs that can occur on this floor, at this zoom, with this layer. Robots and cells are
drawn as the map draws them at this zoom, but not larger than at 8x4, so that many fit; in a low
panel in one row.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.drawings import looks
from automaton.drawings.looks import DETAIL_SHIFT, KIND_MASK
from automaton.engine.state import BATTERY_FULL, STATUS_DEPLETED, STATUS_FAILED
from automaton.floor.floor_plan import CELL_KINDS, FLOOR, SHELF, STORAGE, TRACK
from automaton.vocabulary import COLOUR_WORDS, CONDITION_WORDS, IN_WAIT_CYCLE
from tui.playback.panel_view import Picture, View
from tui.render import drawn_robots as fleet
from tui.render import styles
from tui.render.camera import (
    ZOOM_ONE_TO_ONE,
    Zoom,
    dots,
    drawn,
    shown_rectangle,
    with_identities,
)
from tui.render.cell_looks import (
    DRIVEN,
    FAR_LOAD,
    FAR_SHELF,
    STORING_KINDS,
    cell_codes,
    colour_of,
    flow_codes,
    framed,
    heat_codes,
    look,
    sign_place,
)
from tui.render.compose import cell_picture, far_sign, paints_pixels, robot_pictures
from tui.render.drawn_robots import BAR_HEIGHT, DrawnRobots, colour_entries, is_possible
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
from tui.render.styles import GLYPH_BITS, GLYPHS, Codes, GlyphSet, code, style
from tui.widgets.panel import Line, Span, TextPanel, cell_link, line, title, wrapped

STROKE = 0x24  # braille dots of a horizontal line
TIMELINE = (0xC0, 0xC7, 0xC0, 0xF8, 0xC0)  # braille dots of a timeline with two deliveries
LOW_ROWS = 24  # below which each entry takes one row

MAX_WORST_CELLS = 5  # listed cells of a layer
SIGN_COLUMNS = 9  # columns for the signs
LARGEST_SAMPLE = drawn(8, 4)  # at which cells are drawn
SMALL_SAMPLE = drawn(4, 2)  # a row of it is enough to recognise a cell
LOW_SAMPLE_OF_ROBOTS = with_identities(1)  # one row
NO_SIGN = 0  # a blank between two signs, and beside pictures
ALL_WAYS = (0, 1, 2, 3)
LOW_SAMPLE = looks.LOW_CHARGE // 2
FAR_STATES = (
    *(looks.DRAW_FAULT, looks.DRAW_WAITING, looks.DRAW_LOW_BATTERY, looks.DRAW_LOADED),
    *(looks.DRAW_EMPTY, looks.DRAW_CHARGING, looks.DRAW_IDLE),
    looks.DRAW_PARKED,
)


class PictureGlyphs(GlyphSet):
    """Signs of cells as in pictures in pixels: letters and blocks of colour."""

    destination, charger, bay, dock, station = (
        ord(looks.CELL_LETTERS[one]) for one in looks.LETTERED_KINDS
    )
    wall = shelf = rack = GlyphSet.full


AS_IN_PICTURES = PictureGlyphs("unicode", styles.UNICODE.characters, shaded=False)


def signs_of(zoom: Zoom, glyphs: GlyphSet, in_pixels: bool) -> tuple[Zoom, GlyphSet]:
    """The zoom and the glyphs of the legend of a map."""
    lettered = in_pixels and zoom.kind == "cells" and zoom.width > 1
    return (ZOOM_ONE_TO_ONE, AS_IN_PICTURES) if lettered else (zoom, glyphs)


class Legend(TextPanel):
    """The panel of the legend."""

    @property
    def is_low(self) -> bool:
        """Whether few entries would fit if they took several rows each."""
        return self.lines_for_rows < LOW_ROWS

    def cache_key(self, view: View) -> tuple[object, ...]:
        return (*super().cache_key(view), self.is_low)

    def panel_lines(self, view: View, width: int) -> list[Line]:
        picture = view.picture
        if picture is None:
            return []
        zoom, glyphs = signs_of(picture.zoom, picture.glyphs, picture.in_pixels)
        entries = legend(picture.scene, zoom, glyphs, self.is_low)
        heat = heat_codes(picture.glyphs)[1:].tolist()
        line_of_time = np.array(picture.glyphs.braille, np.uint32)[list(TIMELINE)]
        plain = style(styles.COLOUR_TEXT, styles.COLOUR_VOID)
        below = [
            LegendLine(
                (tuple(code(plain, line_of_time).tolist()),),
                "timeline: deliveries and events over time",
            ),
            LegendLine((tuple(heat),), "below the timeline: time lost, by rows of the floor"),
        ]
        lines = [_entry(entry, picture, width) for entry in (*entries, *below)]
        first = len(_layer(picture.scene, picture.glyphs))
        lines.insert(first, _worst(picture.scene))
        return [one for entry in lines for one in entry]


def _entry(entry: LegendLine, picture: Picture, width: int) -> list[Line]:
    """The lines of one entry: signs, and their meaning beside them; a blank below a drawing."""
    meaning = wrapped(line(entry.meaning), width - SIGN_COLUMNS)
    lines = []
    for row in range(max(len(entry.rows), len(meaning))):
        codes = entry.rows[row][: SIGN_COLUMNS - 1] if row < len(entry.rows) else ()
        signs = (_span(one, picture) for one in codes)
        words = meaning[row] if row < len(meaning) else ()
        lines.append((*signs, Span(" " * (SIGN_COLUMNS - len(codes))), *words))
    return [*lines, ()] if len(entry.rows) > 1 else lines


def _span(sign: int, picture: Picture) -> Span:
    """A sign in its style."""
    if sign == NO_SIGN:
        return Span(" ")
    return Span(
        picture.glyphs.characters[sign & int(GLYPHS)], picture.look.rich(sign >> GLYPH_BITS)
    )


def _worst(scene: Scene) -> list[Line]:
    """The cells with the layer's greatest numbers, as links."""
    cells = [
        (cell_link(scene.floor.floor_plan, cell), number) for cell, number in worst_cells(scene)
    ]
    if not cells:
        return []
    wide = max(len(link.text) for link, _ in cells)
    rows = [line(link, f"{' ' * (wide - len(link.text))}{n:>9,}") for link, n in cells]
    return [(), line(title(f"most {scene.map_layer.unit}")), *rows, ()]


class LegendLine(NamedTuple):
    """An entry of a legend."""

    rows: tuple[tuple[int, ...], ...]  # codes: of a picture, or of signs with gaps
    meaning: str

    @property
    def signs(self) -> tuple[int, ...]:
        """The codes without gaps."""
        return tuple(one for row in self.rows for one in row if one != NO_SIGN)


def signed(signs: tuple[int, ...], meaning: str) -> LegendLine:
    """An entry of single signs."""
    row = tuple(one for sign in signs for one in (sign, NO_SIGN))
    return LegendLine((row[:-1],) if row else (), meaning)


def pictured(codes: Codes, zoom: Zoom, glyphs: GlyphSet, meaning: str) -> LegendLine:
    """An entry of a cell (rows, columns)."""
    shown = cell_picture(codes, zoom, glyphs)
    return LegendLine(tuple(map(tuple, shown.tolist())), meaning)


def legend(scene: Scene, zoom: Zoom, glyphs: GlyphSet, low: bool = False) -> list[LegendLine]:
    """The entries: layer, robots, overlays, floor; with `low` in one row each."""
    zoom = LARGEST_SAMPLE if zoom.is_drawn and zoom.area > LARGEST_SAMPLE.area else zoom
    near = zoom.kind == "cells"
    if low and near and zoom.height > 1:
        return _in_one_row(scene, zoom, glyphs)
    entries = _robots(scene, zoom, glyphs) if near else _far_robots(scene, zoom, glyphs)
    entries = _layer(scene, glyphs) + _classes(scene, zoom, glyphs) + entries
    entries += _overlays(scene, zoom, glyphs)
    if near:
        return entries + _cells(scene.floor, zoom, glyphs)
    return entries + _far_cells(scene, zoom, glyphs)


def _in_one_row(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    """The entries of cells that are several rows high, by a row that is enough to recognise each."""
    small = SMALL_SAMPLE if zoom.is_drawn else zoom
    entries = [
        *_layer(scene, glyphs),
        *_classes(scene, zoom, glyphs),
        *_robots(scene, LOW_SAMPLE_OF_ROBOTS, glyphs, bar=zoom.text_rows >= BAR_HEIGHT),
        *_overlays(scene, zoom, glyphs, LOW_SAMPLE_OF_ROBOTS),
        *_cells(scene.floor, small, glyphs),
    ]
    return [entry._replace(rows=entry.rows[:1]) for entry in entries]


def _classes(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    """The colours of robots, if not by state."""
    if not _has_classes(scene):
        return []
    sign = glyphs.loaded[0] if zoom.kind == "cells" else glyphs.fleet[255]
    return [signed(*entry) for entry in colour_entries(scene, sign)]


def _has_classes(scene: Scene) -> bool:
    """Whether robots are coloured by something other than their state."""
    return scene.colouring != "state" and is_possible(scene, scene.colouring)


def _layer(scene: Scene, glyphs: GlyphSet) -> list[LegendLine]:
    """The layer's own entries, or heat levels with their numbers."""
    own = scene.map_layer.entries(scene, glyphs)
    if own is not None:
        return [signed(*entry) for entry in own]
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
        signed(codes, f"{scene.map_layer.unit}: {scene.scale.words(levels[0], levels[-1])}")
        for codes, levels in lines.items()
    ]


def worst_cells(scene: Scene) -> list[tuple[int, int]]:
    """The cells with the greatest numbers of a ranked layer, and the numbers."""
    if not scene.map_layer.ranked or scene.values is None:
        return []
    order = np.argsort(-scene.values, kind="stable")[:MAX_WORST_CELLS]
    return [(int(cell), int(scene.values[cell])) for cell in order if scene.values[cell] > 0]


# Robots.


def sample(
    scene: Scene, zoom: Zoom, glyphs: GlyphSet, state: int, shape: int, mark: int = 0
) -> tuple[tuple[int, ...], ...]:
    """The rows of a robot in this state and shape; of one sign, in all directions."""
    ways = ALL_WAYS if zoom.kind == "cells" and zoom.width == 1 and not mark else (0,)
    colour = int(fleet.BODY_COLOURS[state])
    if (_has_classes(scene) or fleet.is_grey(scene)) and state != looks.DRAW_FAULT:
        colour = styles.COLOUR_TEXT
    charge = {looks.SHAPE_VOID: 0, looks.SHAPE_THIN: LOW_SAMPLE, looks.SHAPE_BOXED: LOW_SAMPLE}
    fields = (0, state, 0, shape, colour, shape in looks.WITH_LOAD)
    waits = state in (looks.DRAW_WAITING, looks.DRAW_FAULT)
    one = (*fields, waits, charge.get(shape, BATTERY_FULL))
    types = (np.int32, np.uint8, np.uint8, np.uint8, np.uint32, np.bool_, np.bool_, np.int32)
    arrays: list[Any] = [np.full(len(ways), of, kind) for of, kind in zip(one, types, strict=True)]
    arrays[2][:] = ways
    robots = DrawnRobots(*arrays)
    pictures = robot_pictures(scene, zoom, glyphs, robots, mark)
    if len(ways) > 1:
        return signed(tuple(pictures.reshape(-1).tolist()), "").rows
    if zoom.kind != "cells":  # one character of the map
        return tuple(map(tuple, pictures[0].tolist()))
    return pictured(pictures[0], zoom, glyphs, "").rows


def _robots(
    scene: Scene, zoom: Zoom, glyphs: GlyphSet, bar: bool | None = None
) -> list[LegendLine]:
    """Robots in each state; `bar`: whether the map has bars of charge, by default at this zoom."""
    waits = COLOUR_WORDS["waiting"] + (": flat in front" if zoom.is_drawn else "")
    load = "pod" if (scene.floor.floor_plan.kind == STORAGE).any() else "load"
    samples = [
        (looks.DRAW_EMPTY, looks.SHAPE_HOLLOW, "robot, and the way it faces"),
        (looks.DRAW_LOADED, looks.SHAPE_FILLED, f"robot with a {load}"),
        (looks.DRAW_WAITING, looks.SHAPE_HOLLOW, waits),
        (looks.DRAW_FAULT, looks.SHAPE_HOLLOW, IN_WAIT_CYCLE),
        (looks.DRAW_IDLE, looks.SHAPE_RING, COLOUR_WORDS["idle"]),
        (looks.DRAW_PARKED, looks.SHAPE_SQUARE, COLOUR_WORDS["parked"]),
    ]
    if scene.floor.battery:
        low = COLOUR_WORDS["low battery"]
        samples += [
            (looks.DRAW_CHARGING, looks.SHAPE_PLUG, COLOUR_WORDS["charging"]),
            (looks.DRAW_LOW_BATTERY, looks.SHAPE_THIN, low),
            (looks.DRAW_LOW_BATTERY, looks.SHAPE_BOXED, f"{low}, with a load"),
            (looks.DRAW_FAULT, looks.SHAPE_VOID, CONDITION_WORDS[STATUS_DEPLETED]),
        ]
    if scene.floor.faults:
        samples.append((looks.DRAW_FAULT, looks.SHAPE_CROSS, CONDITION_WORDS[STATUS_FAILED]))
    if _has_classes(scene) or fleet.is_grey(scene):  # then only shapes differ
        samples = [one for one in samples if one[0] != looks.DRAW_WAITING]
    entries = []
    for state, shape, meaning in samples:
        rows = sample(scene, zoom, glyphs, state, shape)
        if zoom.width == 1 and shape in fleet.HEADLESS:
            rows = (rows[0][:1],)
        entries.append(LegendLine(rows, meaning))
    if scene.floor.battery and (zoom.text_rows >= BAR_HEIGHT if bar is None else bar):
        colours = style(styles.COLOUR_DONE, styles.COLOUR_ROBOT)
        sign = int(code(colours, glyphs.lower_half))
        entries.append(signed((sign,), "charge of its battery"))
    return entries + _signs(scene, zoom, glyphs)


def _signs(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    """Loads, doors and others that stand alone in a cell; and robots that share one."""
    entries = []
    if scene.floor.loads_may_lie:
        left = glyphs.left_load, styles.COLOUR_LOADED
        entries.append(_alone(zoom, glyphs, left, "load that a robot had to leave", True))
    entries += _gates(scene.floor, zoom, glyphs)
    if (scene.floor.floor_plan.capacity[scene.floor.floor_plan.drivable] != 1).any():
        several = glyphs.digits[2], styles.COLOUR_FLOOR
        words = "number of robots in one cell"
        entries.append(_alone(zoom, glyphs, several, words, bg=styles.COLOUR_ROBOT))
    held = glyphs.arrow[0], styles.COLOUR_DIM
    return [*entries, _alone(zoom, glyphs, held, "held by a robot that is moving in")]


def _gates(floor: ShownFloor, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    """Doors, lifts and cells that are closed at times."""
    kinds = {name.partition(" ")[0] for name in floor.place_names.values()}
    shut, moved = styles.COLOUR_FAULT, styles.COLOUR_TURNTABLE
    return [
        _alone(zoom, glyphs, (sign, fg), name, in_frame=fg == shut)
        for kind, sign, fg, name in (
            ("closing", glyphs.closed, shut, "closed now"),
            ("closing", glyphs.closing, moved, "closed at times"),
            ("door", glyphs.door, shut, "door that is shut"),
            ("door", glyphs.open_door, moved, "door that is open"),
            ("lift", glyphs.lift, moved, "lift"),
        )
        if kind in kinds
    ]


def _alone(
    zoom: Zoom,
    glyphs: GlyphSet,
    sign: tuple[int, int],
    meaning: str,
    in_frame: bool = False,
    bg: int = styles.COLOUR_FLOOR,
) -> LegendLine:
    """A sign, with its colour, as the only content of a cell."""
    rows, columns = zoom.text_rows, zoom.width
    cell = np.full(rows * columns, code(style(styles.COLOUR_FLOOR, bg), glyphs.blank))
    if in_frame and zoom.is_drawn:
        cell = framed(glyphs, columns, rows, sign[1])
    cell[sign_place(columns, rows)] = code(style(sign[1], bg), sign[0])
    return pictured(cell.reshape(rows, columns), zoom, glyphs, meaning)


def _far_robots(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    words = [COLOUR_WORDS[name] for name in looks.STATE_COLOURS]
    if not scene.floor.loads_may_lie:
        words[looks.DRAW_FAULT] = IN_WAIT_CYCLE
    states: tuple[int, ...] = FAR_STATES
    if _has_classes(scene) or fleet.is_grey(scene):  # small zooms have no shapes
        states = (looks.DRAW_FAULT,)
    return [
        LegendLine(sample(scene, zoom, glyphs, state, looks.SHAPE_HOLLOW), words[state])
        for state in states
        if state not in (looks.DRAW_CHARGING, looks.DRAW_LOW_BATTERY) or scene.floor.battery
    ]


# Overlays and the floor.


def _overlays(
    scene: Scene, zoom: Zoom, glyphs: GlyphSet, of_robots: Zoom | None = None
) -> list[LegendLine]:
    """Marks and lines on the floor; `of_robots`: the zoom of drawn robots, if another."""
    near = zoom.kind == "cells"

    def robot(mark: int, meaning: str) -> LegendLine:
        size = zoom if of_robots is None else of_robots
        rows = sample(scene, size, glyphs, looks.DRAW_EMPTY, looks.SHAPE_HOLLOW, mark)
        return LegendLine(rows, meaning)

    def sign(fg: int, near_sign: int) -> tuple[int, ...]:
        if not near:
            return (far_sign(scene, zoom, glyphs, fg),)
        return (int(code(style(fg, styles.COLOUR_FLOOR), near_sign)),)

    entries = []
    if scene.selected >= 0:
        entries.append(robot(styles.COLOUR_SELECTED, f"robot {scene.selected}, selected"))
        route = glyphs.lines[STROKE] if zoom.is_drawn else glyphs.route
        entries.append(signed(sign(styles.COLOUR_ROUTE, route), "its route"))
        if near:
            end = sign(styles.COLOUR_ROUTE, glyphs.stand)
            entries.append(signed(end, "where the route ends"))
    if scene.trails.size:
        entries.append(signed(sign(styles.COLOUR_TRAIL, glyphs.trail), "where robots came from"))
    if scene.lines:
        whose = "the selected robot" if scene.lines == "selected" else "each robot"
        codes = tuple(one for way in "-/" for one in sign(styles.COLOUR_GOAL_LINE, ord(way)))
        entries.append(signed(codes if near else codes[:1], f"from {whose} straight to its goal"))
    if scene.slow_places:
        mark = style(styles.COLOUR_FLOOR, styles.COLOUR_MARKED)
        signs = tuple(int(code(mark, glyphs.digits[n + 1])) for n in range(len(scene.slow_places)))
        entries.append(signed(signs, "saturated, or where most time was lost"))
    if scene.zone >= 0:
        marked = int(code(style(styles.COLOUR_FLOOR, styles.COLOUR_MARKED), glyphs.blank))
        codes = (marked,) if near else sign(styles.COLOUR_MARKED, 0)
        entries.append(signed(codes, scene.zone_name))
    if len(scene.marked) or len(scene.marked_cells):
        entries.append(robot(styles.COLOUR_MARKED, "found, or differs from the other run"))
    if len(scene.ghosts):
        ghost = sign(styles.COLOUR_DIM, glyphs.ghost)
        entries.append(signed(ghost, "where a robot of the other run is"))
    kinds = {name.partition(" ")[0] for name in scene.floor.place_names.values()}
    if paints_pixels(scene, zoom) and kinds & {"closing", "door"}:
        shut = sign(styles.COLOUR_TURNTABLE, 0)
        entries.append(signed(shut, "closed now, or a door that is shut"))
    return entries


@lru_cache(maxsize=8)
def floor_legend(
    floor: ShownFloor, zoom: Zoom, glyphs: GlyphSet, in_pixels: bool
) -> list[LegendLine]:
    """The cells of a floor for a single line, whose height drawings do not exceed.

    The best known are last.
    """
    zoom, glyphs = signs_of(zoom, glyphs, in_pixels)
    if zoom.kind != "cells":
        scene = Scene(floor)
        robot = sample(scene, zoom, glyphs, looks.DRAW_EMPTY, looks.SHAPE_HOLLOW)
        return [LegendLine(robot, "robot"), *_far_cells(scene, dots(1), glyphs)]
    step = SMALL_SAMPLE if zoom.is_drawn else ZOOM_ONE_TO_ONE
    entries = _gates(floor, step, glyphs) + _cells(floor, step, glyphs)
    return sorted(entries, key=lambda entry: entry.meaning in ("wall", "floor"))


def _cells(floor: ShownFloor, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    """The looks of this floor; looks that differ only in direction share an entry."""
    codes = cell_codes(glyphs, zoom.width, zoom.text_rows)
    lines: dict[str, list[int]] = {}
    numbers = set(np.unique(_visible(floor.looks, floor)).tolist())
    if look(SHELF) in numbers:
        numbers.add(look(SHELF, DETAIL_FULL_SHELF))
    if look(STORAGE) in numbers:
        numbers.add(look(STORAGE, DETAIL_POD))
    for number in sorted(numbers):
        lines.setdefault(_meaning(number), []).append(number)
    entries = []
    for meaning, alike in lines.items():
        if zoom.width == 1:
            signs = dict.fromkeys(int(codes[number, 0]) for number in alike)
            entries.append(signed(tuple(signs), meaning))
        else:
            cell = codes[alike[0]].reshape(zoom.text_rows, zoom.width)
            entries.append(pictured(cell, zoom, glyphs, meaning))
    return entries


def _visible(cells: NDArray[Any], floor: ShownFloor) -> NDArray[Any]:
    """The cells that a map can show: without the walls of the border."""
    shown = shown_rectangle(floor.floor_plan)
    return cells[shown.top : shown.bottom, shown.left : shown.right]


def _far_cells(scene: Scene, zoom: Zoom, glyphs: GlyphSet) -> list[LegendLine]:
    kinds = np.unique(_visible(scene.floor.floor_plan.kind, scene.floor)).tolist()
    entries = []
    for kind in (kind for kind in kinds if kind not in DRIVEN):
        fg = FAR_SHELF if kind in STORING_KINDS else colour_of(look(kind))
        sign = far_sign(scene, zoom, glyphs, fg, stands=True)
        entries.append(signed((sign,), CELL_KINDS[kind].name.replace("-", " ")))
        if zoom.kind == "pixels" and kind in (SHELF, STORAGE):
            sign = far_sign(scene, zoom, glyphs, FAR_LOAD, stands=True)
            number = look(SHELF, DETAIL_FULL_SHELF) if kind == SHELF else look(STORAGE, DETAIL_POD)
            entries.append(signed((sign,), _meaning(number)))
    return entries


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
