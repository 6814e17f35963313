"""Images in grey are read within bounds, and what is wrong with one is a sentence."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from automaton.errors import InputError
from automaton.exchange.ros_map import MAX_PIXELS, PNG, read_image


def image(folder: Path, content: bytes) -> Path:
    """A file with this content."""
    path = folder / "a.pgm"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("content", "white", "rows"),
    [
        (b"P5\n3 2\n255\n\x00\x01\x02\x09\x0a\xff", 255, [[0, 1, 2], [9, 10, 255]]),
        (
            b"P5 # made by hand\n3\n# two rows\n2 7\n\x00\x01\x02\x03\x04\x07",
            7,
            [[0, 1, 2], [3, 4, 7]],
        ),
        (b"P5 1 2 1000\n\x00\x05\x03\xe8", 1000, [[5], [1000]]),
        (b"P2\n3 2\n15\n0 1 2\n# between\n3 4 15\n", 15, [[0, 1, 2], [3, 4, 15]]),
        (b"P2 2 1 65535 65535 256", 65535, [[65535, 256]]),
    ],
    ids=["bytes", "comments", "two bytes a pixel", "text", "text in one line"],
)
def test_a_pgm_gives_its_greys_and_its_white(
    content: bytes, white: int, rows: list[list[int]], tmp_path: Path
) -> None:
    found = read_image(image(tmp_path, content))
    assert found.white == white and found.values.tolist() == rows and found.clear is None


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (
            b"P5\n40000 25000\n255\nabc",
            "declares 40,000 x 25,000 pixels; allowed are 1 to",
        ),
        (b"P2\n40000 25000\n255\n1 2 3", "declares 40,000 x 25,000 pixels"),
        (b"P5\n0 4\n255\n", "declares 0 x 4 pixels"),
        (b"P5\n2 2\n255\nabc", "is truncated: its header declares 4 pixels, it holds 3"),
        (b"P5\n2 2\n256\nabcdef", "is truncated: its header declares 4 pixels, it holds 3"),
        (b"P2\n2 2\n255\n1 2 3", "is truncated: its header declares 4 pixels, it holds 3"),
        (b"P5\n2 2\n", "the maxval in the header of a PGM must be a whole number, found nothing"),
        (
            b"P5\n2 -2\n255\nabcd",
            "the height in the header of a PGM must be a whole number, found '-2'",
        ),
        (b"P5\n2 2\n0\nabcd", "the maxval of a PGM must be 1 to 65,535, found 0"),
        (b"P5\n2 2\n65536\nabcd", "the maxval of a PGM must be 1 to 65,535, found 65,536"),
        (b"P5\n2 1\n7\n\x07\x08", "has a pixel value of 8, above its maxval of 7"),
        (b"P2\n2 1\n7\n7 8", "has a pixel value of 8, above its maxval of 7"),
        (b"P2\n2 1\n7\n7 x", "a pixel of a PGM must be a whole number from 0 on, found 'x'"),
        (b"P2\n2 1\n7\n7 -1", "a pixel of a PGM must be a whole number from 0 on, found '-'"),
        (b"P2\n2 1\n7\n7 1234567", "a pixel of a PGM is at most 65,535, found a longer number"),
        (b"P2\n1 1\n7\n" + b" 0" * 9000, "holds more text than 1 pixels need"),
        (b"P5\n#" + b"x" * 9000 + b"\n1 1\n255\na", "the width in the head"),
        (b"P6\n2 2\n255\n", "is neither PGM (P2, P5) nor PNG: it begins with 'P6\\\\n2'"),
        (b"", "is neither PGM (P2, P5) nor PNG"),
        (PNG + b"\0\0\0\rIHDR\0\0", "is truncated: the PNG has no header"),
        (
            PNG + b"\0\0\0\rIHDR" + struct.pack(">II", 40000, 25000),
            "declares 40,000 x 25,000",
        ),
    ],
)
def test_what_is_wrong_with_an_image_is_said_in_a_sentence(
    content: bytes, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        read_image(image(tmp_path, content))
    assert sentence in caught.value.message and caught.value.file == str(tmp_path / "a.pgm")


def test_a_file_is_not_read_before_its_size_is_known(tmp_path: Path) -> None:
    path = tmp_path / "large.pgm"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(InputError, match="an image may have 160 MB at most"):
        read_image(path)
    assert MAX_PIXELS <= 160_000_000


def test_a_png_is_averaged_over_its_colours_and_clear_pixels_are_told(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    pixels = np.array([[[0, 0, 0, 255], [255, 255, 255, 255], [30, 60, 90, 0]]], np.uint8)
    path = tmp_path / "a.png"
    path.write_bytes(png_of(pixels))
    found = read_image(path)
    assert np.rint(found.values * (255 / found.white)).tolist() == [[0, 255, 60]]
    assert found.clear is not None and found.clear.tolist() == [[False, False, True]]


def test_a_broken_png_is_a_sentence(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    content = png_of(np.zeros((2, 2, 4), np.uint8))
    with pytest.raises(InputError, match="cannot be read as PNG"):
        read_image(image(tmp_path, content[:40]))


def png_of(pixels: np.ndarray) -> bytes:
    """(height, width, 4) uint8 as a PNG."""

    def chunk(name: bytes, data: bytes) -> bytes:
        sum_ = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + sum_

    height, width = pixels.shape[:2]
    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    return PNG + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
