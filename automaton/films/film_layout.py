"""Where things stand in a picture of pixels: the title above, the floor, and below it the words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from automaton.errors import InputError

Box = tuple[int, int, int, int]  # left, top, right, bottom in cells; the last two excluded

MIN_SIZE: Final = (160, 120)  # pixels
MAX_SIZE: Final = (3840, 2160)
DEFAULT_MAP: Final = (960, 600)  # the floor is at most so large
DEFAULT_CELL: Final = 40  # and a cell
MIN_DEFAULT_WIDTH: Final = 480  # the words need some room
FOLLOWED_CELL: Final = 24  # pixels at least, where a robot is followed
MARGIN: Final = 10
TITLE_HEIGHT: Final = 30
STATUS_HEIGHT: Final = 36
TEXT_SIZE: Final = 15


@dataclass(frozen=True)
class Layout:
    """The size of a picture, and how much of the floor it shows."""

    width: int  # pixels; even, as MP4 has it
    height: int
    scale: float  # pixels of a cell; whole from 2 on
    box: Box

    @property
    def map_size(self) -> tuple[int, int]:
        """Width and height of the part that shows the floor, in pixels."""
        return self.width - 2 * MARGIN, self.height - TITLE_HEIGHT - STATUS_HEIGHT

    def corner(self, place: tuple[float, float] | None) -> tuple[float, float]:
        """The cell at the upper left of the map, with a fraction: the floor is in its middle.

        `place`: of a followed robot, which is in the middle instead where the floor is larger.
        """
        left, top, right, bottom = self.box
        width, height = (pixels / self.scale for pixels in self.map_size)
        at = ((left + right) / 2, (top + bottom) / 2) if place is None else place
        x = _within(at[0], width, left, right)
        y = _within(at[1], height, top, bottom)
        # Whole pixels: the cells of two frames lie over each other.
        return round(x * self.scale) / self.scale, round(y * self.scale) / self.scale


def layout_of(box: Box, size: tuple[int, int] | None, follows: bool) -> Layout:
    """As large as is asked for, or as the floor needs."""
    columns, rows = max(box[2] - box[0], 1), max(box[3] - box[1], 1)
    if size is None:
        scale = _whole(min(DEFAULT_MAP[0] / columns, DEFAULT_MAP[1] / rows, DEFAULT_CELL))
        scale = max(scale, FOLLOWED_CELL) if follows else scale
        inner = [
            min(math.ceil(n * scale), m) for n, m in zip((columns, rows), DEFAULT_MAP, strict=True)
        ]
        width, height = max(inner[0] + 2 * MARGIN, MIN_DEFAULT_WIDTH), inner[1]
        size = width, height + TITLE_HEIGHT + STATUS_HEIGHT
    else:
        inner = [size[0] - 2 * MARGIN, size[1] - TITLE_HEIGHT - STATUS_HEIGHT]
        scale = _whole(min(inner[0] / columns, inner[1] / rows))
        scale = max(scale, FOLLOWED_CELL) if follows else scale
    return Layout(size[0] + size[0] % 2, size[1] + size[1] % 2, scale, box)


def check_size(size: tuple[int, int]) -> None:
    """Raises InputError for a size that no picture has."""
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
    """Where a view begins that shows no more beyond the floor than it must."""
    if shown >= high - low:
        return (low + high - shown) / 2
    return max(low, min(high - shown, middle - shown / 2))
