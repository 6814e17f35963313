"""What changes from frame to frame: the smallest rectangle, and how long it is shown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from automaton.drawings.indexed_png import Patch
from automaton.films.shades import UNCHANGED, Pixels


def changed_patches(frames: Iterable[tuple[int, Pixels]], last_pause: int) -> Iterator[Patch]:
    """The patches of frames, each with its time in hundredths of a second; equal ones are one.

    `last_pause`: hundredths of a second for which the last picture is seen. Pixels in a patch that
    stay as they were have the number UNCHANGED, but for the first patch, which is the whole picture.
    """
    shown: Pixels | None = None
    waiting: tuple[int, int, int, Pixels] | None = None  # time, x, y and pixels of a patch
    for time, pixels in frames:
        if shown is None:
            patch = (0, 0, pixels)
        else:
            different = pixels != shown
            if not different.any():
                continue
            patch = _cut(pixels, different)
        if waiting is not None:
            begun, x, y, cut = waiting
            yield Patch(x, y, cut, time - begun)
        waiting, shown = (time, *patch), pixels
    if waiting is not None:
        yield Patch(*waiting[1:], last_pause)


def _cut(pixels: Pixels, different: np.ndarray) -> tuple[int, int, Pixels]:
    rows, columns = (np.flatnonzero(different.any(axis=axis)) for axis in (1, 0))
    place = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    cut = np.where(different[place], pixels[place], np.uint8(UNCHANGED)).astype(np.uint8)
    return int(columns[0]), int(rows[0]), cut
