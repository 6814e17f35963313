"""Moments of a run as pixel images, painted by Pillow (an extra, imported only here).

Layout, from top to bottom:

    title
    floor and robots
    progress bar, time and fleet
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from automaton.drawings.floor_svg import pixel_colours
from automaton.drawings.looks import WITH_LOAD, Theme, blended, rgb
from automaton.drawings.moment import DrawnFloor, Moment
from automaton.drawings.shapes import (
    MIN_DETAILED_CELL,
    RADIUS,
    Box,
    Disc,
    Label,
    Path,
    Shape,
    cell_shapes,
    is_legible,
    load_shapes,
    name_in_cell,
    place_shapes,
    robot_shapes,
    selection_shapes,
    shut_shapes,
)
from automaton.engine.state import NIL
from automaton.errors import InputError

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageFont import FreeTypeFont

Extent = tuple[int, int, int, int]  # left, top, right, bottom in cells; right, bottom excluded

MIN_SIZE: Final = (160, 120)  # pixels
MAX_SIZE: Final = (3840, 2160)
DEFAULT_MAP: Final = (960, 600)  # maximum size of the floor
DEFAULT_CELL: Final = 40  # maximum size of a cell
MIN_DEFAULT_WIDTH: Final = 480  # room for the words
FOLLOWED_CELL: Final = 24  # minimum in pixels, if a robot is followed
MAP_MARGIN: Final = 10
TITLE_HEIGHT: Final = 30
STATUS_HEIGHT: Final = 36
TEXT_SIZE: Final = 15


@dataclass(frozen=True)
class Layout:
    """The size of a picture, and its scale."""

    width: int  # pixels; even, as MP4 requires
    height: int
    scale: float  # pixels per cell; an integer from 2 on
    box: Extent
    stretch: float = 1.0  # the height of a cell in widths of a cell

    @property
    def scale_down(self) -> float:
        """The height of a cell in pixels."""
        return self.scale * self.stretch

    @property
    def side(self) -> float:
        """The shorter side of a cell in pixels."""
        return min(self.scale, self.scale_down)

    @property
    def is_small(self) -> bool:
        """Whether a cell is only one colour."""
        return self.side < MIN_DRAWN_CELL

    @property
    def map_size(self) -> tuple[int, int]:
        """Width and height of the part that shows the floor, in pixels."""
        return self.width - 2 * MAP_MARGIN, self.height - TITLE_HEIGHT - STATUS_HEIGHT

    def corner(self, place: tuple[float, float] | None) -> tuple[float, float]:
        """The upper left corner of the map in cells, a fraction; the floor is centred.

        `place`: of a followed robot, on which the map is centred if the floor is larger.
        """
        left, top, right, bottom = self.box
        width, height = (pixels / self.scale for pixels in self.map_size)
        at = ((left + right) / 2, (top + bottom) / 2) if place is None else place
        x = _within(at[0], width, left, right)
        y = _within(at[1], height, top, bottom)
        # Whole pixels, so that the cells of all frames coincide.
        return round(x * self.scale) / self.scale, round(y * self.scale) / self.scale


def layout_of(box: Extent, size: tuple[int, int] | None, follows: bool) -> Layout:
    """The layout of this size or, if None, of a size that suits the floor."""
    columns, rows = max(box[2] - box[0], 1), max(box[3] - box[1], 1)
    if size is None:
        scale = _whole(min(DEFAULT_MAP[0] / columns, DEFAULT_MAP[1] / rows, DEFAULT_CELL))
        scale = max(scale, FOLLOWED_CELL) if follows else scale
        inner = [
            min(math.ceil(n * scale), m) for n, m in zip((columns, rows), DEFAULT_MAP, strict=True)
        ]
        width, height = max(inner[0] + 2 * MAP_MARGIN, MIN_DEFAULT_WIDTH), inner[1]
        size = width, height + TITLE_HEIGHT + STATUS_HEIGHT
    else:
        inner = [size[0] - 2 * MAP_MARGIN, size[1] - TITLE_HEIGHT - STATUS_HEIGHT]
        scale = _whole(min(inner[0] / columns, inner[1] / rows))
        scale = max(scale, FOLLOWED_CELL) if follows else scale
    return Layout(size[0] + size[0] % 2, size[1] + size[1] % 2, scale, box)


def check_size(size: tuple[int, int]) -> None:
    """Raises InputError for a size outside MIN_SIZE to MAX_SIZE."""
    inside = all(
        least <= one <= most for least, one, most in zip(MIN_SIZE, size, MAX_SIZE, strict=True)
    )
    if not inside:
        least, most = (f"{width}x{height}" for width, height in (MIN_SIZE, MAX_SIZE))
        raise InputError(
            f"{size[0]}x{size[1]} is not a size in pixels: allowed are {least} to {most}"
        )


def _whole(scale: float) -> float:
    return math.floor(scale) if scale >= 2 else scale


def _within(middle: float, shown: float, low: int, high: int) -> float:
    """The start of a view around `middle` that shows as little as possible beyond the floor."""
    if shown >= high - low:
        return (low + high - shown) / 2
    return max(low, min(high - shown, middle - shown / 2))


# Painting with Pillow.


FINER: Final = 4  # signs are painted enlarged and scaled down, for smooth edges
MIN_DRAWN_CELL: Final = 6  # pixels; a smaller cell is one colour
MIN_DISC: Final = 5  # minimum diameter of a robot in pixels
# Side of a robot's sign in cells: the sign of a selected robot exceeds its cell.
SURROUNDING: Final = 1.5
TRACK_HEIGHT: Final = 4  # pixels, height of the progress bar


def pillow() -> Any:
    """The package PIL. Raises InputError if it is not installed."""
    try:
        import PIL.Image
        import PIL.ImageDraw
        import PIL.ImageFont
    except ImportError as error:
        raise InputError(
            f"pictures of pixels are painted by Pillow, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[films]'"
        ) from None
    return PIL


class Painter:
    """Paints moments of one floor. Raises InputError without Pillow."""

    def __init__(
        self, floor: DrawnFloor, layout: Layout, theme: Theme, selected: int = NIL
    ) -> None:
        self._pil = pillow()
        self._floor, self.layout, self._theme, self._selected = floor, layout, theme, selected
        self._signs: dict[tuple[Any, ...], Image] = {}
        self._fonts: dict[int, FreeTypeFont] = {}
        self._kept: tuple[Any, Image] | None = None  # a view and its empty floor

    def frame(self, moment: Moment, title: str, words: tuple[str, str], share: float) -> Image:
        """The picture of a moment; `share`: progress of the film, 0 to 1."""
        layout = self.layout
        image = self._pil.Image.new("RGB", (layout.width, layout.height), self._rgb("void"))
        image.paste(self._map(moment), (MAP_MARGIN, TITLE_HEIGHT))
        self._write(image, title, words, share)
        return image

    def _map(self, moment: Moment) -> Image:
        corner = self.layout.corner(self._place(moment))
        image = self.floor_with_loads(moment, corner)
        if (ends := self.wait_line(moment, self._selected, corner)) is not None:
            self.draw_wait(image, ends)
        self._draw_robots(image, moment, corner)
        return image

    def floor_with_loads(self, moment: Moment, corner: tuple[float, float]) -> Image:
        """The floor at a moment, without robots."""
        if self.layout.is_small:
            return self._small_floor(moment, corner)
        image = self._ground(corner).copy()
        for cells, shapes in ((moment.full, load_shapes()), (moment.shut, shut_shapes())):
            self._paste_all(image, cells, shapes, corner)
        return image

    def _place(self, moment: Moment) -> tuple[float, float] | None:
        """The centre of the followed robot."""
        if self._selected == NIL or np.isnan(moment.x[self._selected]):
            return None
        return float(moment.x[self._selected]) + 0.5, float(moment.y[self._selected]) + 0.5

    def _ground(self, corner: tuple[float, float]) -> Image:
        """The floor without loads, cached while the view stays."""
        if self._kept is not None and self._kept[0] == corner:
            return self._kept[1]
        size, (left, top, right, bottom) = self.layout.map_size, self._floor.box
        image = self._pil.Image.new("RGB", size, self._rgb("void"))
        last_x = int(corner[0] + size[0] / self.layout.scale)
        last_y = int(corner[1] + size[1] / self.layout.scale_down)
        columns = range(max(left, int(corner[0])), min(right, last_x + 1))
        rows = range(max(top, int(corner[1])), min(bottom, last_y + 1))
        for y in rows:
            for x in columns:
                look = int(self._floor.looks[y + 1, x + 1])
                tile = self.sign(("look", look), self._cell_shapes(look))
                self.paste(image, tile, x, y, corner)
        self._add_places(image, corner)
        self._kept = corner, image
        return image

    def _add_places(self, image: Image, corner: tuple[float, float]) -> None:
        """Paint signs and names of places, and above them those of levels."""
        layout, stride = self.layout, self._floor.floor_plan.stride
        for cell, (kind, names) in self._floor.places.items():
            if shapes := place_shapes(kind, name_in_cell(names, layout.side)):
                sign, (y, x) = self.sign((shapes,), shapes), divmod(cell, stride)
                self.paste(image, sign, x - 1, y - 1, corner)
        font, pen = self.font(TEXT_SIZE), self.draw_on(image)
        for name, cell in self._floor.levels:
            left = (cell % stride - 1 - corner[0]) * layout.scale
            top = (cell // stride - 1 - corner[1]) * layout.scale_down
            if left >= 0 and top >= TEXT_SIZE:
                pen.text((left, top - 2), _ascii(name), self._rgb("dim"), font, "ls")

    def _cell_shapes(self, look: int) -> tuple[Shape, ...]:
        shapes = cell_shapes(look)
        if self.layout.side >= MIN_DETAILED_CELL:
            return shapes
        return tuple(shape for shape in shapes if not isinstance(shape, Label))

    def _small_floor(self, moment: Moment, corner: tuple[float, float]) -> Image:
        """The floor with one colour per cell."""
        numbers, colours = pixel_colours(self._floor, moment, self._theme)
        left, top, right, bottom = self._floor.box
        pixels = np.array(colours, np.uint8)[numbers[top + 1 : bottom + 1, left + 1 : right + 1]]
        scale, down, size = self.layout.scale, self.layout.scale_down, self.layout.map_size
        box = (round((right - left) * scale), round((bottom - top) * down))
        method = (
            self._pil.Image.Resampling.NEAREST if scale >= 1 else self._pil.Image.Resampling.BOX
        )
        cells = self._pil.Image.fromarray(pixels).resize(box, method)
        image = self._pil.Image.new("RGB", size, self._rgb("void"))
        image.paste(cells, (round((left - corner[0]) * scale), round((top - corner[1]) * down)))
        return image

    def _paste_all(
        self, image: Image, cells: Any, shapes: tuple[Shape, ...], corner: tuple[float, float]
    ) -> None:
        stride = self._floor.floor_plan.stride
        sign = self.sign((shapes,), shapes)
        for cell in cells.tolist():
            self.paste(image, sign, cell % stride - 1, cell // stride - 1, corner)

    def _draw_robots(self, image: Image, moment: Moment, corner: tuple[float, float]) -> None:
        for robot in np.flatnonzero(~np.isnan(moment.x)).tolist():
            sign = self.robot_sign(moment, robot, self._selected)
            self.paste(image, sign, float(moment.x[robot]), float(moment.y[robot]), corner)

    def robot_sign(self, moment: Moment, robot: int, selected: int) -> Image:
        """The sign of a robot at a moment, painted once for each look; `selected`: a robot, or NIL."""
        looks, scale = moment.looks, self.layout.side
        name = str(robot) if is_legible(str(robot), scale) else ""
        look = (int(looks.state[robot]), int(looks.shape[robot]), int(looks.direction[robot]))
        key = ("robot", *look, name, robot == selected)
        if key not in self._signs:
            shapes = robot_shapes(*look, name)
            if scale < MIN_DETAILED_CELL:
                shapes = _small_robot(shapes, look[1], scale)
            shapes += selection_shapes() if robot == selected else ()
            return self.sign(key, shapes)
        return self._signs[key]

    def wait_line(
        self, moment: Moment, robot: int, corner: tuple[float, float]
    ) -> list[tuple[float, float]] | None:
        """The pixels at which the line from a robot to its blocker ends, or None."""
        if robot == NIL or not moment.cause[robot] or moment.blocker[robot] == NIL:
            return None
        layout = self.layout
        ends = [
            (
                float(moment.x[one] + 0.5 - corner[0]) * layout.scale,
                float(moment.y[one] + 0.5 - corner[1]) * layout.scale_down,
            )
            for one in (robot, int(moment.blocker[robot]))
        ]
        return None if np.isnan(ends).any() else ends

    def draw_wait(self, image: Image, ends: Sequence[tuple[float, float]]) -> None:
        """Draw the line of a wait."""
        width = max(2, round(0.08 * self.layout.scale))
        self.draw_on(image).line(list(ends), self._rgb("waiting"), width)

    def paste(
        self, image: Image, sign: Image, x: float, y: float, corner: tuple[float, float]
    ) -> None:
        """Paint a sign around the middle of a cell."""
        image.paste(sign, self.position(sign, x, y, corner), None if sign.mode == "RGB" else sign)

    def position(
        self, sign: Image, x: float, y: float, corner: tuple[float, float]
    ) -> tuple[int, int]:
        """The left and upper pixel of a sign around the middle of a cell."""
        scales = self.layout.scale, self.layout.scale_down
        left, top = (
            round((at + 0.5 - begin) * scale - length / 2)
            for at, begin, scale, length in zip((x, y), corner, scales, sign.size, strict=True)
        )
        return left, top

    def sign(self, key: tuple[Any, ...], shapes: tuple[Shape, ...]) -> Image:
        """The sign of a cell or robot, painted once."""
        if key not in self._signs:
            is_cell = key[0] == "look"
            self._signs[key] = self._painted(shapes, 1.0 if is_cell else SURROUNDING, is_cell)
        return self._signs[key]

    def _painted(self, shapes: tuple[Shape, ...], cells: float, opaque: bool) -> Image:
        """Shapes on a square of `cells` cells, transparent around them unless opaque."""
        scale, stretch = self.layout.scale, self.layout.stretch
        side = math.ceil(scale) if opaque else round(cells * scale)  # without gaps between cells
        side += 0 if opaque else (side - round(scale)) % 2  # symmetric around the cell
        mode, ground = ("RGB", self._rgb("floor")) if opaque else ("RGBA", (*self._rgb("floor"), 0))
        image = self._pil.Image.new(mode, (side * FINER, side * FINER), ground)
        pen = _Pen(self, image, scale * FINER, (side / scale - 1) / 2)
        for shape in shapes:
            pen.draw(shape)
        height = side if stretch == 1 else math.ceil(side * stretch)
        return image.resize((side, height), self._pil.Image.Resampling.BOX)

    def _rgb(self, name: str) -> tuple[int, int, int]:
        return rgb(name, self._theme)

    def colour_of(self, shape: Shape) -> tuple[int, int, int]:
        """The colour of a shape on the floor."""
        if isinstance(shape, Box) and shape.opacity < 1:
            return blended(shape.colour, "floor", shape.opacity, self._theme)
        return self._rgb(shape.colour)

    def font(self, size: int) -> FreeTypeFont:
        """Pillow's built-in font: the same everywhere, with ASCII characters."""
        if size not in self._fonts:
            self._fonts[size] = self._pil.ImageFont.load_default(size)
        return self._fonts[size]

    def draw_on(self, image: Image) -> Any:
        """Pillow's drawing context of an image."""
        return self._pil.ImageDraw.Draw(image)

    def _write(self, image: Image, title: str, words: tuple[str, str], share: float) -> None:
        """Write the title above, and the progress bar, time and fleet below."""
        draw, (width, height) = self.draw_on(image), image.size
        room = width - 2 * MAP_MARGIN
        font = self.font(TEXT_SIZE)
        draw.text(
            (MAP_MARGIN, TITLE_HEIGHT / 2),
            _fitting(title, font, room),
            self._rgb("text"),
            font,
            "lm",
        )
        line, track = height - STATUS_HEIGHT / 2 + 2, height - STATUS_HEIGHT + 4
        for from_x, length, name in ((0, room, "mark"), (0, round(room * share), "cursor")):
            box = (MAP_MARGIN + from_x, track, MAP_MARGIN + length, track + TRACK_HEIGHT - 1)
            draw.rectangle(box, self._rgb(name))
        time, fleet = words
        draw.text((MAP_MARGIN, line + 2), _fitting(time, font, room), self._rgb("text"), font, "lm")
        left = room - font.getlength(_ascii(time)) - 2 * TEXT_SIZE
        if font.getlength(_ascii(fleet)) <= left:
            draw.text((width - MAP_MARGIN, line + 2), _ascii(fleet), self._rgb("dim"), font, "rm")


class _Pen:
    """Draws enlarged shapes on an image."""

    def __init__(self, painter: Painter, image: Image, unit: float, margin: float) -> None:
        self._painter, self._unit, self._margin = painter, unit, margin
        self._draw = painter.draw_on(image)

    def draw(self, shape: Shape) -> None:
        """Draw one shape."""
        colour, draw = self._painter.colour_of(shape), self._draw
        if isinstance(shape, Label):
            font = self._painter.font(max(1, round(shape.size * 1.1 * self._unit)))
            draw.text(
                (self._at(shape.x), self._at(shape.y)), _ascii(shape.text), colour, font, "mm"
            )
            return
        line = round(shape.line * self._unit)
        if isinstance(shape, Path):
            draw.line([(self._at(x), self._at(y)) for x, y in shape.points], colour, line, "curve")
        elif isinstance(shape, Disc):
            outer = shape.radius + shape.line / 2
            if line:
                middle = (self._at(shape.x), self._at(shape.y))
                draw.circle(middle, outer * self._unit, None, colour, line)
            else:
                draw.circle((self._at(shape.x), self._at(shape.y)), outer * self._unit, colour)
        else:
            box = (shape.x, shape.y, shape.x + shape.width, shape.y + shape.height)
            left, top, right, bottom = (self._at(one) for one in box)
            corners = (left, top, right - 1, bottom - 1)
            if line:
                draw.rectangle(corners, None, colour, line)
            else:
                draw.rectangle(corners, colour)

    def _at(self, cells: float) -> float:
        return (cells + self._margin) * self._unit


def _small_robot(shapes: tuple[Shape, ...], shape: int, scale: float) -> tuple[Shape, ...]:
    """A disc, at least MIN_DISC pixels wide, with a spot for a load."""
    radius = max(RADIUS + 0.04, MIN_DISC / 2 / scale)
    spot = (Disc(0.5, 0.5, radius / 2, "load"),) if shape in WITH_LOAD else ()
    return Disc(0.5, 0.5, radius, shapes[0].colour), *spot


def _ascii(text: str) -> str:
    """The text in ASCII, since the font has no other characters."""
    return text.encode("ascii", "replace").decode()


def _fitting(text: str, font: FreeTypeFont, room: float) -> str:
    """The part of a text that fits."""
    text = _ascii(text)
    while text and font.getlength(text) > room:
        text = text[:-4].rstrip(" ,.") + "..." if len(text) > 4 else ""
    return text
