"""A floor with its robots as a self-contained SVG, for a page, a slide or a notebook.

A cell is 100 units wide, so that coordinates are whole numbers. A floor of many cells is a small
bitmap with one pixel per cell, under drawn robots.
"""

from __future__ import annotations

import base64
import html
import pathlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.atomic_write import atomic_writer
from automaton.drawings.indexed_png import png
from automaton.drawings.looks import (
    PALETTE,
    STATE_COLOURS,
    WITH_LOAD,
    Theme,
    blended,
    colour_of,
    css,
    rgb,
)
from automaton.drawings.moment import DrawnFloor, Moment
from automaton.drawings.shapes import (
    FADED,
    RADIUS,
    Box,
    Disc,
    Label,
    Path,
    Shape,
    cell_shapes,
    load_shapes,
    name_in_cell,
    place_shapes,
    robot_shapes,
    selection_shapes,
    shut_shapes,
)
from automaton.engine.state import NIL

CELL_UNITS: Final = 100
MAX_DRAWN_CELLS: Final = 10_000  # larger floors are bitmaps
MAX_NUMBERED_DISCS: Final = 300  # larger fleets are discs without numbers
MAX_WIDTH: Final = 960  # pixels
MAX_HEIGHT: Final = 640
MAX_CELL_SIDE: Final = 40
FONT: Final = "system-ui, 'DejaVu Sans', sans-serif"


def floor_svg(
    floor: DrawnFloor, moment: Moment, theme: Theme = "light", selected: int = NIL, title: str = ""
) -> str:
    """The whole floor at a moment. `title` is for screen readers; it is not drawn."""
    left, top, right, bottom = floor.box
    columns, rows = max(right - left, 1), max(bottom - top, 1)
    scale = min(MAX_WIDTH / columns, MAX_HEIGHT / rows, MAX_CELL_SIDE)
    many = columns * rows > MAX_DRAWN_CELLS
    ground = _pixels(floor, moment, theme) if many else _cells(floor, moment, theme, scale)
    size = f'width="{columns * scale:.0f}" height="{rows * scale:.0f}"'
    view = " ".join(str(CELL_UNITS * one) for one in (left, top, columns, rows))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" {size} font-family="{FONT}"'
        ' text-anchor="middle" role="img" style="max-width:100%;height:auto"'
        f' aria-label="{html.escape(title or "a floor with its robots")}">'
        f"{ground}{_robots(moment, theme, selected)}</svg>\n"
    )


class _Sheet:
    """Shapes of one layer, grouped by colour and line."""

    def __init__(self, theme: Theme) -> None:
        self._theme = theme
        self._paths: dict[str, list[str]] = {}
        self._words: dict[str, list[str]] = {}

    def add(self, shapes: Iterable[Shape], x: float, y: float) -> None:
        """Add shapes of the cell with upper left corner (x, y), in cells."""
        for shape in shapes:
            if isinstance(shape, Label):
                self._write(shape, x, y)
            else:
                self._paths.setdefault(self._style(shape), []).append(_outline(shape, x, y))

    def _write(self, word: Label, x: float, y: float) -> None:
        at = f'x="{_units(x + word.x)}" y="{_units(y + word.y + 0.36 * word.size)}"'
        style = f'fill="{self._css(word.colour)}" font-size="{_units(word.size)}"'
        self._words.setdefault(style, []).append(
            f"<text {at}>{html.escape(word.text, quote=False)}</text>"
        )

    def _style(self, shape: Box | Disc | Path) -> str:
        colour = self._css(shape.colour)
        if isinstance(shape, Box) and shape.opacity < 1:
            colour = css(blended(shape.colour, "floor", shape.opacity, self._theme))
        if not shape.line:
            return f'fill="{colour}"'
        dashes = ' stroke-dasharray="20 14"' if isinstance(shape, Path) and shape.dashed else ""
        return f'fill="none" stroke="{colour}" stroke-width="{_units(shape.line)}"{dashes}'

    def _css(self, name: str) -> str:
        return css(rgb(name, self._theme))

    def __str__(self) -> str:
        paths = (f'<path {style} d="{"".join(d)}"/>' for style, d in self._paths.items())
        words = (f"<g {style}>{''.join(texts)}</g>" for style, texts in self._words.items())
        return "".join((*paths, *words))


def _units(cells: float) -> int:
    return round(CELL_UNITS * cells)


def _outline(shape: Box | Disc | Path, x: float, y: float) -> str:
    if isinstance(shape, Box):
        width, height = _units(shape.width), _units(shape.height)
        return f"M{_units(x + shape.x)} {_units(y + shape.y)}h{width}v{height}h-{width}z"
    if isinstance(shape, Disc):
        r = _units(shape.radius)
        arc = f"a{r} {r} 0 1 0"
        left = _units(x + shape.x - r / CELL_UNITS)
        return f"M{left} {_units(y + shape.y)}{arc} {2 * r} 0{arc}-{2 * r} 0z"
    points = (f"{_units(x + px)} {_units(y + py)}" for px, py in shape.points)
    return "M" + "L".join(points)


def _places(cells: NDArray[np.int32], stride: int) -> Iterator[tuple[int, int]]:
    """The (x, y) of flat cell indices."""
    for cell in cells.tolist():
        yield cell % stride - 1, cell // stride - 1


def _cells(floor: DrawnFloor, moment: Moment, theme: Theme, scale: float) -> str:
    """Cells of `scale` pixels with their marks; adjacent grounds of one colour in a row are merged."""
    left, top, right, bottom = floor.box
    looks = floor.looks[top + 1 : bottom + 1, left + 1 : right + 1]
    grounds, marks, loads = _Sheet(theme), _Sheet(theme), _Sheet(theme)
    for y, row in enumerate(looks.tolist(), top):
        begin = 0
        for x in range(1, len(row) + 1):
            before = _ground(row[x - 1])
            if x == len(row) or _ground(row[x]) != before:
                grounds.add([before._replace(width=x - begin)], left + begin, y)
                begin = x
        for x, look in enumerate(row, left):
            marks.add(cell_shapes(look)[1:], x, y)
    stride = floor.floor_plan.stride
    for cell, (kind, names) in floor.places.items():
        y, x = divmod(cell, stride)
        marks.add(place_shapes(kind, name_in_cell(names, scale)), x - 1, y - 1)
    for x, y in _places(moment.full, stride):
        loads.add(load_shapes(), x, y)
    for x, y in _places(moment.shut, stride):
        loads.add(shut_shapes(), x, y)
    return f'<g shape-rendering="crispEdges">{grounds}</g>{marks}{loads}'


def _ground(look: int) -> Box:
    ground = cell_shapes(look)[0]
    assert isinstance(ground, Box)
    return ground


def _pixels(floor: DrawnFloor, moment: Moment, theme: Theme) -> str:
    """The floor as a bitmap with one pixel per cell."""
    left, top, right, bottom = floor.box
    numbers, colours = pixel_colours(floor, moment, theme)
    picture = png(
        np.ascontiguousarray(numbers[top + 1 : bottom + 1, left + 1 : right + 1]), colours
    )
    at = f'x="{CELL_UNITS * left}" y="{CELL_UNITS * top}"'
    size = f'width="{CELL_UNITS * (right - left)}" height="{CELL_UNITS * (bottom - top)}"'
    return (
        f'<image {at} {size} preserveAspectRatio="none" style="image-rendering:pixelated"'
        f' href="data:image/png;base64,{base64.b64encode(picture).decode()}"/>'
    )


def pixel_colours(
    floor: DrawnFloor, moment: Moment, theme: Theme
) -> tuple[NDArray[np.uint8], list[tuple[int, int, int]]]:
    """(height + 2, width + 2) the colour index of each cell with its load; the colours."""
    names = list(PALETTE)
    colours = [rgb(name, theme) for name in names]
    colours += [blended(name, "floor", FADED, theme) for name in names]
    of_look = np.zeros(256, np.uint8)
    for look in np.unique(floor.looks).tolist():
        shapes = cell_shapes(look)
        block = shapes[1] if len(shapes) > 1 else shapes[0]
        fades = isinstance(block, Box) and block.opacity < 1
        bare = colour_of(look) in ("mark", "direction")  # small in their cells
        of_look[look] = names.index("floor" if bare else colour_of(look)) + fades * len(names)
    numbers = of_look[floor.looks]
    numbers.reshape(-1)[moment.full] = names.index("load")
    numbers.reshape(-1)[moment.shut] = names.index("fault")
    return numbers, colours


def _robots(moment: Moment, theme: Theme, selected: int) -> str:
    """Robots; small fleets with numbers and states."""
    on_floor = np.flatnonzero(~np.isnan(moment.x)).tolist()
    few = len(on_floor) <= MAX_NUMBERED_DISCS
    pieces = [] if few else [str(_discs(moment, theme, on_floor))]
    looks = moment.looks
    for robot in on_floor if few else [one for one in on_floor if one == selected]:
        sheet = _Ordered(theme)
        state = int(looks.state[robot])
        shapes = robot_shapes(
            state, int(looks.shape[robot]), int(looks.direction[robot]), str(robot)
        )
        shapes += selection_shapes() if robot == selected else ()
        sheet.add(shapes, float(moment.x[robot]), float(moment.y[robot]))
        pieces.append(f"<g><title>robot {robot}: {moment.word_of(robot)}</title>{sheet}</g>")
    return "".join((_wait(moment, theme, selected), *pieces))


class _Ordered(_Sheet):
    """Overlapping shapes in order."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self._pieces: list[str] = []

    def add(self, shapes: Iterable[Shape], x: float, y: float) -> None:
        for shape in shapes:
            sheet = _Sheet(self._theme)
            sheet.add([shape], x, y)
            self._pieces.append(str(sheet))

    def __str__(self) -> str:
        return "".join(self._pieces)


def _discs(moment: Moment, theme: Theme, robots: list[int]) -> _Sheet:
    """Only bodies and their loads."""
    sheet = _Sheet(theme)
    for robot in robots:
        colour = STATE_COLOURS[moment.looks.state[robot]]
        x, y = float(moment.x[robot]), float(moment.y[robot])
        sheet.add([Disc(0.5, 0.5, RADIUS, colour)], x, y)
        if moment.looks.shape[robot] in WITH_LOAD:
            sheet.add([Box(0.3, 0.3, 0.4, 0.4, "load")], x, y)
    return sheet


def _wait(moment: Moment, theme: Theme, selected: int) -> str:
    """A line from the selected robot to its blocker."""
    if selected == NIL or not moment.cause[selected] or moment.blocker[selected] == NIL:
        return ""
    both = [selected, int(moment.blocker[selected])]
    ends = [(float(moment.x[one]) + 0.5, float(moment.y[one]) + 0.5) for one in both]
    if np.isnan(ends).any():
        return ""
    sheet = _Sheet(theme)
    sheet.add([Path((ends[0], ends[1]), "waiting", 0.08, dashed=True)], 0, 0)
    return str(sheet)


@dataclass(frozen=True, eq=False)
class FloorPicture:
    """A moment of a run, drawn on demand. `caption` names the run and the tick."""

    floor: DrawnFloor
    moment: Moment
    caption: str
    theme: Theme = "light"
    selected: int = NIL  # robot

    @cached_property
    def svg(self) -> str:
        """The drawing as a self-contained SVG."""
        return floor_svg(self.floor, self.moment, self.theme, self.selected, self.caption)

    def save(self, path: str | pathlib.Path) -> None:
        """Write the SVG to a file. Raises InputError."""
        with atomic_writer(pathlib.Path(path)) as file:
            file.write(self.svg.encode())

    def _repr_html_(self) -> str:
        """Show it in a notebook."""
        return f"<div>{self.svg}<p>{html.escape(self.caption)}</p></div>"
