"""A table of at most 255 colours for the frames of a film, and the number of each pixel's colour."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.palette import COLOURS, Theme, rgb

Pixels = NDArray[np.uint8]

MAX_COLOURS: Final = 255  # one more number means: as in the frame before
UNCHANGED: Final = 255
UNKNOWN: Final = 256


class Shades:
    """The colours of a theme, and the blends that are most frequent in some pictures."""

    def __init__(self, pictures: Iterable[NDArray[np.uint8]], theme: Theme) -> None:
        """`pictures`: (rows, columns, 3) each."""
        base = [_packed(np.array(rgb(name, theme), np.uint8)) for name in COLOURS]
        chosen = list(dict.fromkeys(int(one) for one in base))
        pixels = np.concatenate([_packed(picture).reshape(-1) for picture in pictures])
        colours, times = np.unique(pixels, return_counts=True)
        by_frequency = colours[np.lexsort((colours, -times))].tolist()
        known = set(chosen)
        chosen += [one for one in by_frequency if one not in known][: MAX_COLOURS - len(chosen)]
        self._colours = np.array(chosen, np.int64)
        self._number = np.full(1 << 24, UNKNOWN, np.uint16)  # by colour
        self._number[self._colours] = np.arange(len(chosen))

    @property
    def colours(self) -> list[tuple[int, int, int]]:
        """Red, green and blue of each number."""
        return [(one >> 16, one >> 8 & 255, one & 255) for one in self._colours.tolist()]

    def numbers(self, picture: NDArray[np.uint8]) -> Pixels:
        """(rows, columns) the number of the nearest colour of each pixel."""
        packed = _packed(picture)
        numbers = self._number[packed]
        unknown = numbers == UNKNOWN
        if unknown.any():
            for one in np.unique(packed[unknown]).tolist():
                self._number[one] = self._nearest(one)
            numbers = self._number[packed]
        return numbers.astype(np.uint8)

    def _nearest(self, colour: int) -> int:
        mine = np.array([colour >> 16, colour >> 8 & 255, colour & 255])
        away = ((np.array(self.colours) - mine) ** 2).sum(axis=1)
        return int(np.argmin(away))


def _packed(picture: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Red, green and blue in one number."""
    wide: Any = picture.astype(np.int64)
    packed: NDArray[np.int64] = wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2]
    return packed
