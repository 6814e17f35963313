"""The visible part of a floor and its size: zooming, panning, conversion of cells and places.

At each step of the zoom ladder, the whole floor is a picture of a certain number of characters. The
camera is a window on this picture. The steps range from cells with drawn robots to dots that hold
many cells.

    8x4 6x3 4x2   columns x rows of characters per cell: robots and cells are drawn
    3x1.5         a row for a sign and a number, and half a row in the same colour
    3x1 2x1 1x1   one row per cell: a sign for each, with a number where there is room
    1.5x0.75      half blocks, one or two for a cell: 2 x 4 cells in 3 x 3 characters
    half          half blocks: 1 x 2 cells per character
    quadrants     2 x 2 quarters of a character: 2 x 3 cells per character
    braille k     2 x 4 dots per character, k x k cells per dot; with k = 1.5 one or two

A character is about twice as high as wide, so that 2n x n characters form a square. Each step has
at least 0.6 times the rows of the one before, so that some step fills the screen. Steps larger
than 8x4 exist if the whole floor fits at them. Where square cells would leave much of the screen
empty, an extra step has cells that are slightly too wide or too high; a floor that is about square
has none and always looks square.
"""

from __future__ import annotations

import copy
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.floor.floor_plan import WALL, FloorPlan

Place = tuple[int, int]  # row, column of the screen

ALWAYS_DRAWN: Final = 4  # steps up to this number of rows per cell exist for floors of any size
ENOUGH: Final = 0.6  # share of the screen that square cells must cover to remain square
MAX_STRETCH: Final = 1.5  # maximum ratio of a cell's sides
SQUARE: Final = 1.25  # ratio of a floor's sides up to which it has to look square
SQUARE_STRETCH: Final = (
    1.34  # maximum ratio of a cell's sides where the whole of such a floor shows
)


class Zoom(NamedTuple):
    """One step: `across` x `down` cells in `width` x `height` characters."""

    name: str
    kind: Literal["cells", "pixels", "quarters", "dots"]
    width: int = 1
    across: int = 1
    down: int = 1
    height: int = 1

    @property
    def scale(self) -> tuple[float, float]:
        """Rows and columns of characters per cell."""
        return self.height / self.down, self.width / self.across

    @property
    def area(self) -> float:
        """Characters per cell."""
        return self.height * self.width / (self.down * self.across)

    @property
    def text_rows(self) -> int:
        """Whole rows of characters in each cell."""
        return self.height // self.down

    @property
    def is_drawn(self) -> bool:
        """Whether a cell is several rows high, so that robots and cells are drawn."""
        return self.text_rows > 1

    @property
    def is_enlarged(self) -> bool:
        """Whether cells are fewer than pixels, and pixels more than characters."""
        return self.kind == "pixels" and self.height > 1

    def first_row(self, y: int) -> int:
        """The row of characters where row y of cells begins; a row shared by two is the upper one's."""
        if self.kind == "cells":
            return -(-y * self.height // self.down)
        return y * self.height // self.down

    def size(self, floor: Place) -> Place:
        """Rows and columns of the picture of a floor of this size in cells."""
        rows, columns = (
            -(-floor[0] * self.height // self.down),
            -(-floor[1] * self.width // self.across),
        )
        return rows, columns


ZOOM_SQUARE: Final = Zoom("2x1", "cells", 2)
ZOOM_ONE_TO_ONE: Final = Zoom("1x1", "cells")
ZOOM_ROW_AND_HALF: Final = Zoom("3x1.5", "cells", 3, 1, 2, 3)
ZOOM_ENLARGED: Final = Zoom("1.5x0.75", "pixels", 3, 2, 4, 3)
ZOOM_HALF: Final = Zoom("half", "pixels", 1, 1, 2)
ZOOM_QUARTERS: Final = Zoom("quadrants", "quarters", 1, 2, 3)
# Dots, quarters and pixels of a character: rows and columns.
CHARACTER_DOTS: Final[dict[str, Place]] = {"pixels": (2, 1), "quarters": (2, 2), "dots": (4, 2)}


def drawn(width: int, height: int) -> Zoom:
    """Cells of several rows."""
    return Zoom(f"{width}x{height}", "cells", width, height=height)


def with_identities(robots: int) -> Zoom:
    """Cells of one row, wide enough for a robot and its number."""
    width = 1 + max(2, len(str(robots - 1)))
    return Zoom(f"{width}x1", "cells", width)


def dots(k: float) -> Zoom:
    """Braille with k x k cells per dot, k a whole number or 1.5."""
    return Zoom(f"braille {k:g}", "dots", 1, round(2 * k), round(4 * k))


def zoom_ladder(floor: Place, screen: Place, robots: int) -> tuple[Zoom, ...]:
    """The steps, nearest first, for a floor in cells and a screen in characters.

    The last one shows the whole floor.
    """
    near = [*_squares(floor, screen), with_identities(robots), ZOOM_ROW_AND_HALF]
    near += [ZOOM_SQUARE, ZOOM_ENLARGED, ZOOM_ONE_TO_ONE]
    filling = None if is_square(floor) else _filling(floor, screen, near)
    if filling is not None:
        near.append(filling)
    near.sort(key=lambda zoom: zoom.area, reverse=True)
    return (*near, ZOOM_HALF, ZOOM_QUARTERS, *_braille(floor, screen))


def is_square(floor: Place) -> bool:
    """Whether a floor has to look square."""
    return max(floor) <= SQUARE * min(floor)


def fits(zoom: Zoom, floor: Place, screen: Place) -> bool:
    """Whether the whole floor fits; a screen has at least one character."""
    rows, columns = zoom.size(floor)
    return rows <= max(screen[0], 1) and columns <= max(screen[1], 1)


def covered(zoom: Zoom, floor: Place, screen: Place) -> float:
    """The share of the screen that the picture of the floor covers, 0 if it does not fit."""
    rows, columns = zoom.size(floor)
    fitting = fits(zoom, floor, screen)
    return fitting * rows * columns / max(screen[0] * screen[1], 1)


def _squares(floor: Place, screen: Place) -> list[Zoom]:
    """4x2, 6x3, 8x4, and larger ones at which the floor fits."""
    steps = [drawn(2 * height, height) for height in range(2, ALWAYS_DRAWN + 1)]
    while fits(larger := drawn(steps[-1].width + 2, steps[-1].height + 1), floor, screen):
        steps.append(larger)
    return steps


def _filling(floor: Place, screen: Place, steps: list[Zoom]) -> Zoom | None:
    """The least stretched cells that cover enough of the screen, else those that cover most.

    None if `steps` already cover enough or as much.
    """
    best = max(covered(step, floor, screen) for step in steps)
    if best >= ENOUGH:
        return None
    candidates = []
    for height in range(2, screen[0] // max(floor[0], 1) + 1):
        low, high = -(-2 * height * 2 // 3), int(2 * height * MAX_STRETCH)
        for width in range(low, min(high, screen[1] // max(floor[1], 1)) + 1):
            zoom = drawn(width, height)
            share = covered(zoom, floor, screen)
            if share > best:
                candidates.append((min(share, ENOUGH), -stretch(zoom), share, zoom))
    return max(candidates)[-1] if candidates else None


def stretch(zoom: Zoom) -> float:
    """The ratio of the longer side of a cell to the shorter: 1 is a square."""
    rows, columns = zoom.scale
    ratio = columns / (2 * rows)
    return max(ratio, 1 / ratio)


def _braille(floor: Place, screen: Place) -> list[Zoom]:
    """k = 1, 1.5, 2, 3, 5, 8, ..., and finally the smallest of 1, 1.5, 2, 3, 4 ... at which it fits."""
    last = next(k for k in (1, 1.5, *range(2, max(floor) + 2)) if fits(dots(k), floor, screen))
    k, after, steps = 2, 3, [1, 1.5]
    while k < last:
        steps.append(k)
        k, after = after, k + after
    return [*(dots(k) for k in steps if k < last), dots(last)]


class CellRectangle(NamedTuple):
    """Cells of the bordered floor: rows [top, bottom), columns [left, right)."""

    top: int
    left: int
    bottom: int
    right: int


def shown_rectangle(floor_plan: FloorPlan) -> CellRectangle:
    """The smallest rectangle around all cells except walls; parking bays may lie in the border."""
    rows, columns = np.nonzero(floor_plan.kind != WALL)
    if not rows.size:
        return CellRectangle(1, 1, floor_plan.height + 1, floor_plan.width + 1)
    return CellRectangle(
        int(rows.min()), int(columns.min()), int(rows.max()) + 1, int(columns.max()) + 1
    )


class Camera:
    """A window of rows x columns characters on the floor."""

    def __init__(self, floor_plan: FloorPlan, rows: int, columns: int, robots: int = 0) -> None:
        self.floor_plan = floor_plan
        self.shown = shown_rectangle(floor_plan)
        self.height = self.shown.bottom - self.shown.top
        self.width = self.shown.right - self.shown.left
        self.rows, self.columns = rows, columns
        self._robots = robots
        self.ladder = self._steps()
        self.zoom = ZOOM_ONE_TO_ONE
        self.top = self.left = 0  # position in the whole picture of the upper left character
        self._y, self._x = self.height / 2, self.width / 2  # the centre of the view, in cells
        self.fit()

    def copy(self) -> Camera:
        return copy.copy(self)

    @property
    def key(self) -> tuple[Zoom, int, int, int, int]:
        """The values on which a picture of the empty floor depends."""
        return self.zoom, self.top, self.left, self.rows, self.columns

    def size(self) -> Place:
        """Rows and columns of the picture of the whole floor."""
        return self.zoom.size((self.height, self.width))

    def exceeds(self) -> bool:
        """Whether some of the floor is off the screen."""
        rows, columns = self.size()
        inside = 0 >= self.top >= rows - self.rows and 0 >= self.left >= columns - self.columns
        return not inside

    # Zooming.

    def fit(self) -> None:
        """Centre the floor at the largest step at which all of it fits, and looks square if it is."""
        limit = SQUARE_STRETCH if is_square((self.height, self.width)) else np.inf
        fitting = [zoom for zoom in self.ladder if self._fits(zoom)]
        square = [zoom for zoom in fitting if stretch(zoom) <= limit]
        self.zoom = (square or fitting)[0]
        self._y, self._x = self.height / 2, self.width / 2
        self._settle(self._range(0), self._range(1))

    def one_to_one(self) -> None:
        """Show one character per cell, around the same centre."""
        self.zoom = ZOOM_ONE_TO_ONE
        self._settle(self._range(0), self._range(1))

    def zoom_in(self, at: Place | None = None) -> None:
        """Zoom in by a step; the cell at `at` stays in place."""
        self._zoom_by(-1, at)

    def zoom_out(self, at: Place | None = None) -> None:
        """Zoom out by a step; the cell at `at` stays in place if the floor stays on the screen."""
        self._zoom_by(1, at)

    def _zoom_by(self, steps: int, at: Place | None) -> None:
        index = self.ladder.index(self.zoom) + steps
        if not 0 <= index < len(self.ladder):
            return
        row, column = at or (self.rows // 2, self.columns // 2)
        on_floor = self.cell_at(row, column) is not None
        y, x = self._floor_at(row, column)
        self.zoom = zoom = self.ladder[index]
        # Whole cells begin at the edges, where cells take whole characters.
        tall = zoom.height if zoom.down == 1 else 1
        wide = zoom.width if zoom.across == 1 else 1
        top = -(-(zoom.first_row(y) - row) // tall) * tall
        left = -(-(x * zoom.width // zoom.across - column) // wide) * wide
        if steps > 0 or not on_floor:
            top, left = _inside(top, *self._range(0)), _inside(left, *self._range(1))
        self.top, self.left = top, left
        self._y, self._x = self._middle()

    # Panning.

    def pan(self, dx: float, dy: float) -> None:
        """Move the view by cells; steps smaller than a character add up."""
        self._y, self._x = self._y + dy, self._x + dx
        # Zooming may have moved the view beyond an edge; it may stay there or come back.
        (low_y, high_y), (low_x, high_x) = self._range(0), self._range(1)
        top, left = min(low_y, self.top), min(low_x, self.left)
        self._settle((top, max(high_y, self.top)), (left, max(high_x, self.left)))

    def pan_characters(self, columns: float, rows: float) -> None:
        """Move the view by characters of the screen."""
        down, across = self.zoom.scale
        self.pan(columns / across, rows / down)

    def centre_on(self, cell: int) -> None:
        """Bring a cell as close to the middle as the edges of the floor allow."""
        y, x = divmod(int(cell), self.floor_plan.stride)
        self._y, self._x = y - self.shown.top + 0.5, x - self.shown.left + 0.5
        self._settle(self._range(0), self._range(1))

    def resize(self, rows: int, columns: int) -> None:
        """Set the size of the screen; the centre stays."""
        self.rows, self.columns = rows, columns
        self.ladder = self._steps()
        if self.zoom not in self.ladder:
            smaller = (zoom for zoom in self.ladder if zoom.area <= self.zoom.area)
            self.zoom = next(smaller, self.ladder[-1])
        self._settle(self._range(0), self._range(1))

    # Conversion between cells and characters.

    def cell_at(self, row: int, column: int) -> int | None:
        """The (middle) cell at a place of the screen; None outside the floor."""
        rows, columns = self.size()
        if not (0 <= row + self.top < rows and 0 <= column + self.left < columns):
            return None
        y, x = self._floor_at(row, column)
        return (y + self.shown.top) * self.floor_plan.stride + x + self.shown.left

    def place_of(self, cell: int) -> Place | None:
        """The place where a cell starts on the screen, or None if it is off the screen."""
        y, x = divmod(int(cell), self.floor_plan.stride)
        y, x = y - self.shown.top, x - self.shown.left
        if not (0 <= y < self.height and 0 <= x < self.width):
            return None
        zoom = self.zoom
        row = zoom.first_row(y) - self.top
        column = x * zoom.width // zoom.across - self.left
        if row < 0 and (y + 1) * zoom.height > self.top * zoom.down:
            row = 0  # the upper edge cuts the cell
        if column < 0 and (x + 1) * zoom.width > self.left * zoom.across:
            column = 0
        inside = 0 <= row < self.rows and 0 <= column < self.columns
        return (row, column) if inside else None

    def rectangle_at(self, row: int, column: int) -> CellRectangle:
        """The cells that the character at a place of the screen represents, also in part."""
        zoom, shown = self.zoom, self.shown
        (y, bottom) = ((row + self.top + n) * zoom.down for n in (0, 1))
        (x, right) = ((column + self.left + n) * zoom.across for n in (0, 1))
        return CellRectangle(
            y // zoom.height + shown.top,
            x // zoom.width + shown.left,
            -(-bottom // zoom.height) + shown.top,
            -(-right // zoom.width) + shown.left,
        )

    def visible(self) -> CellRectangle:
        """The cells of the floor on the screen, including those cut by its edges."""
        last = self.rectangle_at(self.rows - 1, self.columns - 1)
        first, shown = self.rectangle_at(0, 0), self.shown
        top, left = max(first.top, shown.top), max(first.left, shown.left)
        bottom, right = min(last.bottom, shown.bottom), min(last.right, shown.right)
        if self.zoom.kind == "cells":  # the upper cell has a row that two share
            first_unit = (self.top + self.rows - 1) * self.zoom.down
            bottom = min(bottom, first_unit // self.zoom.height + 1 + shown.top)
        return CellRectangle(top, left, max(bottom, top), max(right, left))

    def inside(self, cells: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Mark the cells that are on the screen; NIL is not."""
        seen = self.visible()
        y, x = np.divmod(cells, self.floor_plan.stride)
        inside: NDArray[np.bool_] = (
            (y >= seen.top) & (y < seen.bottom) & (x >= seen.left) & (x < seen.right) & (cells >= 0)
        )
        return inside

    # Position of the window.

    def _steps(self) -> tuple[Zoom, ...]:
        """The ladder for this size of the screen, nearest first."""
        return zoom_ladder((self.height, self.width), (self.rows, self.columns), self._robots)

    def _fits(self, zoom: Zoom) -> bool:
        return fits(zoom, (self.height, self.width), (self.rows, self.columns))

    def _floor_at(self, row: int, column: int) -> tuple[int, int]:
        """Row and column, in the shown rectangle, of the middle cell of a character.

        If the edge of the floor cuts the character, the cell is still on the floor.
        """
        zoom, rectangle = self.zoom, self.rectangle_at(row, column)
        first = rectangle.top - self.shown.top, rectangle.left - self.shown.left
        y = (row + self.top) * zoom.down // zoom.height
        if zoom.kind != "cells":
            y = middle_cell(row + self.top, zoom.down, zoom.height)
        x = middle_cell(column + self.left, zoom.across, zoom.width)
        if first[0] < self.height:
            y = min(y, self.height - 1)
        if first[1] < self.width:
            x = min(x, self.width - 1)
        return y, x

    def _middle(self) -> tuple[float, float]:
        """The centre of the view, in cells."""
        down, across = self.zoom.scale
        return (self.top + self.rows / 2) / down, (self.left + self.columns / 2) / across

    def _corner(self) -> tuple[int, int]:
        """The `top` and `left` that match the centre, rounded to whole cells."""
        down, across = self.zoom.scale
        top = round((self._y * down - self.rows / 2) / self.zoom.height)
        left = round((self._x * across - self.columns / 2) / self.zoom.width)
        return top * self.zoom.height, left * self.zoom.width

    def _range(self, axis: int) -> tuple[int, int]:
        """The range of `top` (axis 0) or `left` (1): without a blank margin, or centred."""
        picture = self.size()[axis]
        screen = (self.rows, self.columns)[axis]
        if picture <= screen:
            return (-((screen - picture) // 2),) * 2
        step = self.zoom.width if axis else self.zoom.height  # whole cells
        return 0, -(-(picture - screen) // step) * step

    def _settle(self, rows: tuple[int, int], columns: tuple[int, int]) -> None:
        """Move the window to the centre, with `top` and `left` clamped to these ranges."""
        top, left = self._corner()
        self.top, self.left = _inside(top, *rows), _inside(left, *columns)
        y, x = self._middle()
        self._y = self._y if self.top == top else y
        self._x = self._x if self.left == left else x


def middle_cell(character: Any, cells: int, characters: int) -> Any:
    """The cell in the middle of a character (or pixel), where `cells` take `characters` of them."""
    return (2 * character + 1) * cells // (2 * characters)


def _inside(value: int, low: int, high: int) -> int:
    return min(max(value, low), high)


# Blocks of cells as characters: the visible ones, and sums over blocks.


class PicturePart(NamedTuple):
    """Characters of the picture of the whole floor: rows [top, bottom), columns [left, right)."""

    top: int
    left: int
    bottom: int
    right: int


def part_of(camera: Camera) -> PicturePart:
    """The characters on the screen."""
    rows, columns = camera.size()
    top, left = max(camera.top, 0), max(camera.left, 0)
    bottom = min(camera.top + camera.rows, rows)
    right = min(camera.left + camera.columns, columns)
    return PicturePart(top, left, max(bottom, top), max(right, left))


def blocks(
    values: NDArray[Any], across: int, down: int | None = None, over: np.ufunc = np.add
) -> NDArray[Any]:
    """The sum (or another reduction) over each block of cells; edge blocks may be smaller."""
    down = across if down is None else down
    return _reduced(
        values, _starts(len(values), down, 1), _starts(values.shape[1], across, 1), over
    )


def dot_blocks(
    values: NDArray[Any], zoom: Zoom, dots: Place | None = None, over: np.ufunc = np.add
) -> NDArray[Any]:
    """The sum (or another reduction) over the cells of each dot, `dots` rows and columns a character."""
    rows, columns = dots or CHARACTER_DOTS[zoom.kind]
    down, across = zoom.down // zoom.height, zoom.across // zoom.width
    return _reduced(
        values, _starts(len(values), down, rows), _starts(values.shape[1], across, columns), over
    )


def _starts(cells: int, per_character: int, dots: int) -> NDArray[np.intp]:
    """The first cell of each dot: cell c is in dot c x dots // per_character."""
    number = np.arange(-(-cells // per_character) * dots)
    starts = number // dots * per_character - (-(number % dots) * per_character // dots)
    return starts[starts < cells]


def _reduced(
    values: NDArray[Any], rows: NDArray[np.intp], columns: NDArray[np.intp], over: np.ufunc
) -> NDArray[Any]:
    if values.dtype == bool or values.dtype == np.uint8:
        values = values.astype(np.int32)
    reduced: NDArray[Any] = over.reduceat(over.reduceat(values, rows, axis=0), columns, axis=1)
    return reduced
