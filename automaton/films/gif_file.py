"""The file format GIF: one table of colours, then what changes from frame to frame.

Graphics Interchange Format, version 89a (CompuServe, 1990). Pillow compresses the pixels; the frames
are put together here one after another, so that a long film needs no more memory than a short one.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from automaton.drawings.indexed_png import Colour, Patch
from automaton.films.painter import pillow
from automaton.films.shades import UNCHANGED, Pixels

TABLE_OF_256: Final = 0xF7  # a global table of 256 colours, 8 bits for each channel
REPEAT_FOREVER: Final = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
KEEP_WITH_CLEAR: Final = 0x05  # a frame stays after its time; one number is clear
END: Final = b"\x3b"
HEAD: Final = 13  # bytes before the table of colours of a file
DESCRIPTOR: Final = 10  # bytes before the pixels of an image, behind 0x2C


def gif(patches: Iterable[Patch], colours: Sequence[Colour]) -> Iterator[bytes]:
    """The parts of the file; the first patch is the whole picture."""
    table = bytes(channel for colour in colours for channel in colour).ljust(768, b"\0")
    for number, (x, y, pixels, hundredths) in enumerate(patches):
        rows, columns = pixels.shape
        if not number:
            yield b"GIF89a" + struct.pack("<HHBBB", columns, rows, TABLE_OF_256, 0, 0)
            yield table + REPEAT_FOREVER
        yield struct.pack("<BBBBHBB", 0x21, 0xF9, 4, KEEP_WITH_CLEAR, hundredths, UNCHANGED, 0)
        yield struct.pack("<BHHHHB", 0x2C, x, y, columns, rows, 0) + _compressed(pixels)
    yield END


def _compressed(pixels: Pixels) -> bytes:
    """The pixels of an image as GIF packs them, cut out of a file of that image alone."""
    file = io.BytesIO()
    image = pillow().Image.fromarray(pixels)
    image.putpalette(bytes(768))
    image.save(file, "GIF", optimize=False, interlace=False)
    content = file.getvalue()
    at = HEAD + 3 * (2 << (content[10] & 7)) if content[10] & 0x80 else HEAD
    while content[at] == 0x21:  # extensions: their blocks are counted, the last one is empty
        at += 2
        while content[at]:
            at += 1 + content[at]
        at += 1
    local = content[at + DESCRIPTOR - 1]
    at += DESCRIPTOR + (3 * (2 << (local & 7)) if local & 0x80 else 0)
    return content[at:-1]
