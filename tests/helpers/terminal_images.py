"""What a terminal that shows images makes of a stream of bytes, decoded by nothing of the viewer.

images = ImagesOfTerminal(character=(8, 16))
images.feed(data)
images.picture()      (height, width, 3) the images at their places; black where there is none
"""

from __future__ import annotations

import base64
import re
import zlib

import numpy as np
from numpy.typing import NDArray

SEQUENCE = re.compile(
    rb"\x1b\[(?P<row>\d+);(?P<column>\d+)H"
    rb"|\x1b_G(?P<keys>[^;\x1b]*)(?:;(?P<data>[^\x1b]*))?\x1b\\"
    rb'|\x1bP0;1;0q"1;1;(?P<width>\d+);(?P<height>\d+)(?P<sixels>[^\x1b]*)\x1b\\'
)
SIXEL = re.compile(rb"#(\d+);2;(\d+);(\d+);(\d+)|#(\d+)|!(\d+)([?-~])|([?-~])|([$-])")

Pixels = NDArray[np.uint8]


class ImagesOfTerminal:
    """The images on a screen of rows x columns characters."""

    def __init__(self, rows: int, columns: int, character: tuple[int, int]) -> None:
        self._size = rows * character[1], columns * character[0]
        self._wide, self._high = character
        self._place = (0, 0)  # pixels from above and from the left
        self._keys: dict[bytes, bytes] = {}
        self._data = b""
        self.placed: dict[int, tuple[tuple[int, int], Pixels]] = {}  # by number, those of kitty
        self.painted = np.zeros((*self._size, 3), np.uint8)  # by sixels
        self.count = 0

    def feed(self, data: bytes) -> None:
        """Decode all of a stream."""
        for one in SEQUENCE.finditer(data):
            if one["row"]:
                down, right = int(one["row"]) - 1, int(one["column"]) - 1
                self._place = down * self._high, right * self._wide
            elif one["sixels"] is not None:
                self._paint(int(one["width"]), int(one["height"]), one["sixels"])
            else:
                self._kitty(one["keys"], one["data"] or b"")

    def picture(self) -> Pixels:
        """All images at their places."""
        picture = self.painted.copy()
        for (top, left), pixels in self.placed.values():
            picture[top : top + len(pixels), left : left + pixels.shape[1]] = pixels
        return picture

    def _kitty(self, keys: bytes, data: bytes) -> None:
        said = dict(part.split(b"=") for part in keys.split(b","))
        if said.get(b"a") == b"q":
            return
        if said.get(b"a") == b"d":
            assert said[b"d"] == b"A"
            self.placed = {}
            return
        if b"a" in said:
            self._keys, self._data = said, b""
        self._data += data
        assert len(data) <= 4096
        if said.get(b"m", b"0") == b"0":
            keys_ = self._keys
            assert (keys_[b"a"], keys_[b"f"], keys_[b"C"], keys_[b"q"]) == (b"T", b"24", b"1", b"2")
            width, height = int(keys_[b"s"]), int(keys_[b"v"])
            assert (
                width == int(keys_[b"c"]) * self._wide and height == int(keys_[b"r"]) * self._high
            )
            pixels = np.frombuffer(zlib.decompress(base64.b64decode(self._data)), np.uint8)
            self.placed[int(keys_[b"i"])] = self._place, pixels.reshape(height, width, 3)
            self.count += 1

    def _paint(self, width: int, height: int, sixels: bytes) -> None:
        """Paint the bits that are set; the others stay as they are."""
        colours: dict[int, tuple[int, ...]] = {}
        x = y = 0
        colour: tuple[int, ...] = ()
        area = self.painted[self._place[0] :, self._place[1] :]
        for number, r, g, b, use, times, repeated, single, end in SIXEL.findall(sixels):
            if number:
                colours[int(number)] = tuple(round(int(one) * 255 / 100) for one in (r, g, b))
            elif use:
                colour = colours[int(use)]
            elif end:
                x, y = 0, y + 6 * (end == b"-")
            else:
                bits, run = (repeated or single)[0] - 63, int(times or 1)
                for row in range(6):
                    if bits >> row & 1:
                        assert x + run <= width and y + row < height
                        area[y + row, x : x + run] = colour
                x += run
        self.count += 1
