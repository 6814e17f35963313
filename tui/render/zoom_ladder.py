"""The steps of zooming, from cells in which robots are drawn to dots that hold many cells.

    8x4 6x3 4x2   columns x rows of characters for a cell: robots are drawn, and so are cells
    3x1 2x1 1x1   one row for a cell: a sign for each, with a number where there is room
    half          half blocks, 1 x 2 cells each
    braille k     2 x 4 dots each, k x k cells in a dot

A character is about twice as high as wide, so that 2n x n characters are a square. Steps larger than
8x4 are there as long as the whole floor fits. Where squares would leave much of the screen empty, a
step with cells that are a little too wide or too high fills it.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

Place = tuple[int, int]  # row, column of the screen


class Zoom(NamedTuple):
    """One step: a character holds `across` x `down` cells, or a cell `width` x `height` characters."""

    name: str
    kind: Literal["cells", "pixels", "dots"]
    width: int = 1
    across: int = 1
    down: int = 1
    height: int = 1

    @property
    def scale(self) -> tuple[float, float]:
        """Characters for one cell: rows, columns."""
        return self.height / self.down, self.width / self.across

    @property
    def area(self) -> float:
        """Characters for one cell."""
        return self.height * self.width / (self.down * self.across)

    @property
    def is_drawn(self) -> bool:
        """Whether a cell is several rows high, so that robots and cells are drawn."""
        return self.height > 1

    def size(self, floor: Place) -> Place:
        """Rows and columns of the picture of a floor of so many rows and columns of cells."""
        rows, columns = -(-floor[0] // self.down), -(-floor[1] // self.across)
        return rows * self.height, columns * self.width


ZOOM_SQUARE: Final = Zoom("2x1", "cells", 2)
ZOOM_ONE_TO_ONE: Final = Zoom("1x1", "cells")
ZOOM_HALF: Final = Zoom("half", "pixels", 1, 1, 2)

ALWAYS_DRAWN: Final = 4  # rows of a cell up to which steps exist for floors of any size
ENOUGH: Final = 0.6  # of the screen: square cells that cover so much are not stretched
MAX_STRETCH: Final = 1.5  # how many times as wide as high a cell may be, or as high as wide


def drawn(width: int, height: int) -> Zoom:
    """Cells of several rows."""
    return Zoom(f"{width}x{height}", "cells", width, height=height)


def with_identities(robots: int) -> Zoom:
    """Cells of one row, wide enough for a robot and its number."""
    width = 1 + max(2, len(str(robots - 1)))
    return Zoom(f"{width}x1", "cells", width)


def dots(k: int) -> Zoom:
    """Braille with k x k cells in a dot."""
    return Zoom(f"braille {k}", "dots", 1, 2 * k, 4 * k)


def zoom_ladder(floor: Place, screen: Place, robots: int) -> tuple[Zoom, ...]:
    """The steps for a floor of so many rows and columns of cells on this screen, nearest first.

    The last one shows the whole floor.
    """
    near = [*_squares(floor, screen), with_identities(robots), ZOOM_SQUARE, ZOOM_ONE_TO_ONE]
    if (filling := _filling(floor, screen, near)) is not None:
        near.append(filling)
    near.sort(key=lambda zoom: zoom.area, reverse=True)
    return (*near, ZOOM_HALF, *_braille(floor, screen))


def fits(zoom: Zoom, floor: Place, screen: Place) -> bool:
    """Whether the whole floor is seen; a screen has at least one character."""
    rows, columns = zoom.size(floor)
    return rows <= max(screen[0], 1) and columns <= max(screen[1], 1)


def covered(zoom: Zoom, floor: Place, screen: Place) -> float:
    """The share of the screen that the picture of the floor takes, 0 if it does not fit."""
    rows, columns = zoom.size(floor)
    fitting = fits(zoom, floor, screen)
    return fitting * rows * columns / max(screen[0] * screen[1], 1)


def _squares(floor: Place, screen: Place) -> list[Zoom]:
    """4x2, 6x3, 8x4, and on for as long as the floor fits."""
    steps = [drawn(2 * height, height) for height in range(2, ALWAYS_DRAWN + 1)]
    while fits(larger := drawn(steps[-1].width + 2, steps[-1].height + 1), floor, screen):
        steps.append(larger)
    return steps


def _filling(floor: Place, screen: Place, steps: list[Zoom]) -> Zoom | None:
    """The least stretched cells that cover enough, or else those that cover most; None if the steps
    do as well.
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
    """How many times a cell is as wide as high, or as high as wide: 1 is a square."""
    ratio = zoom.width / (2 * zoom.height)
    return max(ratio, 1 / ratio)


def _braille(floor: Place, screen: Place) -> list[Zoom]:
    """k = 1, 2, 3, 5, 8, ..., and last the smallest at which the floor fits."""
    last = 1
    while not fits(dots(last), floor, screen):
        last += 1
    k, after, steps = 1, 2, []
    while k < last:
        steps.append(dots(k))
        k, after = after, k + after
    return [*steps, dots(last)]
