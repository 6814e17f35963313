"""The length of trajectories that are NURBS, beside lengths that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from automaton.exchange.graphs.lif import arc_length, is_nurbs

BEZIER = np.array([0.0, 0, 0, 1, 1, 1])


def test_a_quarter_of_a_circle_is_a_rational_curve_of_degree_2() -> None:
    points = np.array([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    weights = np.array([1.0, math.sqrt(0.5), 1.0])
    assert arc_length(2, BEZIER, points, weights) == pytest.approx(math.pi / 2, rel=1e-8)


def test_a_curve_of_degree_1_is_as_long_as_its_chords() -> None:
    points = np.array([(0.0, 0.0), (3.0, 4.0), (3.0, 5.0), (0.0, 5.0)])
    knots = np.array([0.0, 0.0, 0.2, 0.9, 1.0, 1.0])
    assert arc_length(1, knots, points, np.ones(4)) == pytest.approx(5 + 1 + 3)


def test_a_parabola_has_the_length_of_its_integral() -> None:
    """y = x^2 from 0 to 1: sqrt(5) / 2 + asinh(2) / 4."""
    points = np.array([(0.0, 0.0), (0.5, 0.0), (1.0, 1.0)])
    expected = math.sqrt(5) / 2 + math.asinh(2) / 4
    assert arc_length(2, BEZIER, points, np.ones(3)) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("degree", "knots", "weights"),
    [
        (2, [0, 0, 1, 1, 1], [1, 1, 1]),  # one knot too few
        (2, [0, 0, 0, 1, 1, 0.5], [1, 1, 1]),  # falling knots
        (2, [0, 0, 0, 0, 0, 0], [1, 1, 1]),  # of no extent
        (2, [0, 0, 0, 1, 1, math.nan], [1, 1, 1]),
        (2, [0, 0, 0, 1, 1, 1], [1, 0, 1]),
        (0, [0, 0, 1, 1], [1, 1, 1]),
        (3, [0, 0, 0, 0, 1, 1, 1], [1, 1, 1]),  # a degree that three points do not have
    ],
)
def test_what_is_not_a_nurbs_is_known(
    degree: int, knots: list[float], weights: list[float]
) -> None:
    points = np.array([(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
    assert is_nurbs(2, BEZIER, points, np.ones(3))
    assert not is_nurbs(degree, np.array(knots, float), points, np.array(weights, float))
