"""Pixels become cells: drawn stories, and random images against a slow count in other words."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from automaton.exchange.image_floor import PixelCells, cells_of, centres, pieces_of, reach_of


def mask(*rows: str) -> np.ndarray:
    """Pixels: '.' may be driven on."""
    return np.array([[symbol == "." for symbol in row] for row in rows])


def drawn(cells: PixelCells) -> list[str]:
    """The cells, with their exits to the east as '-' between them and to the south as '|' below."""
    lines = []
    for free, east, south in zip(cells.free, cells.east, cells.south, strict=True):
        lines.append("".join(".#"[not f] + " -"[int(e)] for f, e in zip(free, east, strict=True)))
        lines.append("".join(" |"[int(s)] + " " for s in south))
    return [line.rstrip() for line in lines[:-1]]


@pytest.mark.parametrize(
    ("width", "pixel", "reach"),
    [
        ("0.5", "0.25", 1),
        ("0.6", "0.25", 1),
        ("0.76", "0.25", 2),
        ("0.05", "0.05", 0),
        ("0.6", "0.05", 6),
    ],
)
def test_a_robot_keeps_half_its_width_away(width: str, pixel: str, reach: int) -> None:
    assert reach_of(Fraction(width), Fraction(pixel)) == reach


def test_centres_keep_away_from_walls_and_from_the_edge_of_the_image() -> None:
    floor = mask(
        ".......",
        ".......",
        ".......",
        ".....#.",
        ".......",
    )
    assert (centres(floor, 1) == mask("#######", "#.....#", "#...###", "#...###", "#######")).all()
    assert not centres(floor, 3).any(), "it is wider than the image"
    assert (centres(floor, 0) == floor).all()


def test_the_offset_with_most_cells_is_taken_then_the_upper_then_the_left_one() -> None:
    cells = cells_of(mask("####", "#..#", "#..#", "####"), 2)
    assert cells is not None
    assert cells.offset == (0, 0) and cells.free.sum() == 4, "the four corners, one pixel in each"
    cells = cells_of(mask("....", "....", "....", "...."), 2)
    assert cells is not None and cells.offset == (1, 1), "nine cells, those at the edge cut off"
    assert cells.first == (-1, -1) and cells.free.shape == (3, 3)


def test_an_exit_needs_pixels_that_touch() -> None:
    cells = cells_of(
        mask(
            ".#..",
            ".#..",
            "....",
            ".#..",
        ),
        2,
    )
    assert cells is not None and cells.offset == (1, 1)
    assert drawn(cells) == [
        ". .-.",
        "| | |",
        ".-.-.",
        "| | |",
        ". .-.",
    ]


def test_nothing_is_left_of_walls() -> None:
    assert cells_of(mask("###", "###"), 2) is None


@pytest.mark.parametrize("seed", range(40))
def test_random_images_against_a_slow_count(seed: int) -> None:
    random = np.random.default_rng(seed)
    height, width = random.integers(1, 14, 2)
    centre = random.random((height, width)) < random.uniform(0.2, 0.95)
    k = int(random.integers(1, 6))
    cells, slow = cells_of(centre, k), Slowly(centre, k)
    if cells is None:
        assert not centre.any()
        return
    assert cells.offset == slow.offset
    (left, top), (rows, columns) = cells.first, cells.free.shape
    places = {(top + k * y, left + k * x): (y, x) for y in range(rows) for x in range(columns)}
    assert {place for place, cell in places.items() if cells.free[cell]} == set(slow.kept)
    for place, cell in places.items():
        assert cells.east[cell] == slow.touch(place, (place[0], place[1] + k), (0, 1))
        assert cells.south[cell] == slow.touch(place, (place[0] + k, place[1]), (1, 0))
    assert cells.free[0].any() and cells.free[-1].any(), "cropped"
    assert cells.free[:, 0].any() and cells.free[:, -1].any()
    assert cells.pixels_kept == sum(map(len, slow.kept.values())) and cells.reached == centre.sum()
    crossed = sum(map(len, slow.borders(slow.all)))
    assert cells.passages_lost == crossed - int(cells.east.sum()) - int(cells.south.sum())
    assert cells.pieces[0] == len(pieces(set(map(tuple, np.argwhere(centre).tolist()))))
    found = pieces_of(cells.free, cells.east, cells.south)
    assert ((found > 0) == cells.free).all() and cells.pieces[1] == found.max()


Pixel = tuple[int, int]


class Slowly:
    """The cells of an image by sets of pixels: row, column of a cell's first pixel: kept pixels."""

    def __init__(self, centre: np.ndarray, k: int) -> None:
        self.k = k
        self.all = {(int(y), int(x)) for y, x in np.argwhere(centre)}
        offsets = [(dy, dx) for dy in range(k) for dx in range(k)]
        counted = [len({self.cell(pixel, *offset) for pixel in self.all}) for offset in offsets]
        dy, dx = offsets[counted.index(max(counted))]
        self.offset = dx, dy
        by_cell: dict[Pixel, set[Pixel]] = {}
        for pixel in self.all:
            by_cell.setdefault(self.cell(pixel, dy, dx), set()).add(pixel)
        self.offset_rows = dy, dx
        self.kept = {
            cell: min(pieces(pixels), key=lambda piece: (-len(piece), min(piece)))
            for cell, pixels in by_cell.items()
        }

    def cell(self, pixel: Pixel, dy: int, dx: int) -> Pixel:
        """The first pixel of the cell that a pixel is in."""
        y, x = pixel
        return y - (y - dy) % self.k, x - (x - dx) % self.k

    def touch(self, one: Pixel, other: Pixel, step: Pixel) -> bool:
        """Whether kept pixels of two cells touch."""
        there = self.kept.get(other, set())
        return any((y + step[0], x + step[1]) in there for y, x in self.kept.get(one, ()))

    def borders(self, pixels: set[Pixel]) -> list[set[tuple[Pixel, Pixel]]]:
        """Borders that pixels cross to the east, and to the south."""
        found = []
        for step in ((0, 1), (1, 0)):
            pairs = [(pixel, (pixel[0] + step[0], pixel[1] + step[1])) for pixel in pixels]
            cells = [
                (self.cell(one, *self.offset_rows), self.cell(other, *self.offset_rows))
                for one, other in pairs
                if other in pixels
            ]
            found.append({pair for pair in cells if pair[0] != pair[1]})
        return found


def pieces(pixels: set[Pixel]) -> list[set[Pixel]]:
    """The pieces of a set of pixels."""
    left, found = set(pixels), []
    while left:
        piece, front = set(), [left.pop()]
        while front:
            y, x = front.pop()
            piece.add((y, x))
            near = {(y + 1, x), (y - 1, x), (y, x + 1), (y, x - 1)} & left
            left -= near
            front += near
        found.append(piece)
    return found
