"""What lines take at stations, drawn alike on every machine."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import pytest

from automaton.scenario.durations import Distribution, Handling, Lognormal, Uniform
from automaton.world.draws import (
    drawn_durations,
    exponential,
    handling_of_lines,
    logarithm,
    normal_quantile,
)

COUNT = 40_000


@pytest.mark.parametrize(
    ("distribution", "mean", "sd"),
    [
        (Distribution(uniform=Uniform(least=4, most=10)), 7, 6 / math.sqrt(12)),
        (Distribution(lognormal=Lognormal(mean=12, sd=6)), 12, 6),
        (Distribution(empirical=(3.0, 5.0, 10.0)), 6, math.sqrt(26 / 3)),
        (Distribution(exponential=20.0), 20, math.sqrt(20 * 19)),
    ],
)
def test_moments(distribution: Distribution, mean: float, sd: float) -> None:
    drawn = drawn_durations(distribution, COUNT, seed=3)
    assert abs(drawn.mean() - mean) < 4 * sd / math.sqrt(COUNT)
    assert abs(drawn.std() - sd) < 0.1 * sd


def test_functions_agree_with_those_of_the_machine() -> None:
    x = np.linspace(-20, 20, 1001)
    assert np.allclose(exponential(x), np.exp(x), rtol=1e-15, atol=0)
    assert np.allclose(logarithm(np.exp(x)), x, rtol=1e-14, atol=1e-15)
    u = np.array([1e-12, 1e-6, 0.01, 0.3, 0.5, 0.7, 0.99, 1 - 1e-9])
    assert np.allclose(normal_quantile(u), [NormalDist().inv_cdf(v) for v in u], atol=1e-12)


def test_draws_are_pinned() -> None:
    """To the last bit: no library of mathematics has a part in them."""
    drawn = drawn_durations(Distribution(lognormal=Lognormal(mean=12, sd=6)), 3, seed=1)
    assert [value.hex() for value in drawn.tolist()] == PINNED


PINNED = ["0x1.3f395b8a3efd4p+3", "0x1.05f993ea5815cp+3", "0x1.983fed292566bp+4"]


def test_a_line_takes_its_draw_and_its_units() -> None:
    units = np.array([0, 1, 3])
    found = handling_of_lines(Handling(visit=9, line=2.5, unit=0.25), units, seed=1)
    assert found.tolist() == [2_500_000, 2_750_000, 3_250_000], "the visit is the station's"
