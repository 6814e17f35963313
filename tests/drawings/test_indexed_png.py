"""PNG files as another library reads them."""

from __future__ import annotations

import io

import numpy as np
import pytest

from automaton.drawings.indexed_png import Patch, animated_png, png

COLOURS = [(10, 20, 30), (200, 0, 0), (0, 200, 0)]


def test_a_still_has_its_pixels() -> None:
    image = pytest.importorskip("PIL.Image")
    pixels = np.array([[0, 1, 2], [2, 1, 0]], np.uint8)
    shown = np.asarray(image.open(io.BytesIO(png(pixels, COLOURS))).convert("RGB"))
    assert (shown == np.array(COLOURS)[pixels]).all()


def test_a_film_paints_changes_over_what_is_there() -> None:
    image = pytest.importorskip("PIL.Image")
    whole = np.zeros((3, 4), np.uint8)
    change = np.array([[1, 255], [255, 2]], np.uint8)
    patches = [Patch(0, 0, whole, 10), Patch(1, 1, change, 250)]
    film = image.open(io.BytesIO(animated_png(patches, COLOURS)))
    assert (film.n_frames, film.info["loop"]) == (2, 0)
    film.seek(1)
    after = whole.copy()
    after[1, 1], after[2, 2] = 1, 2
    assert (np.asarray(film.convert("RGB")) == np.array(COLOURS)[after]).all()
    assert film.info["duration"] == 2500
