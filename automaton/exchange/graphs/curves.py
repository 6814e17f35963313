"""The length of a curve that is a NURBS, as LIF describes trajectories.

    C(u) = sum of N_i,p(u) w_i P_i / sum of N_i,p(u) w_i      for knots u_p <= u <= u_n

Source: L. Piegl and W. Tiller, The NURBS Book, 1997, chapters 2 and 4; algorithm A2.2.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

MAX_DEGREE: Final = 20
MAX_POINTS: Final = 200
POINTS: Final = 64  # chords in which each span of the knots is measured

Floats = npt.NDArray[np.float64]


def is_nurbs(degree: int, knots: Floats, points: Floats, weights: Floats) -> bool:
    """Whether knots (m,), points (n, 2) and weights (n,) make a curve of a degree: m = n + degree + 1."""
    n = len(points)
    if not 1 <= degree <= MAX_DEGREE or not degree < n <= MAX_POINTS:
        return False
    return bool(
        len(knots) == n + degree + 1
        and np.isfinite(knots).all()
        and np.isfinite(points).all()
        and np.isfinite(weights).all()
        and (np.diff(knots) >= 0).all()
        and knots[degree] < knots[n]
        and (weights > 0).all()
    )


def arc_length(degree: int, knots: Floats, points: Floats, weights: Floats) -> float:
    """Return the length of a NURBS, in the unit of its points, by chords with extrapolation.

    The error of chords falls with the square of their number, so that of twice as many as of half
    as many is a quarter: (4 L(2k) - L(k)) / 3 lacks it.
    """
    ends = np.unique(knots[degree : len(points) + 1])
    share = np.arange(2 * POINTS) / (2 * POINTS)
    u = np.append((ends[:-1, None] + np.diff(ends)[:, None] * share).reshape(-1), ends[-1])
    basis = _basis(degree, knots, len(points), u) * weights
    curve = basis @ points / basis.sum(axis=1, keepdims=True)
    fine = float(np.hypot(*np.diff(curve, axis=0).T).sum())
    coarse = float(np.hypot(*np.diff(curve[::2], axis=0).T).sum())
    return (4 * fine - coarse) / 3


def _basis(degree: int, knots: Floats, n: int, u: Floats) -> Floats:
    """(len(u), n) the B-spline basis functions, by the recursion of Cox and de Boor."""
    last = np.flatnonzero(np.diff(knots) > 0)[-1]
    span = np.minimum(np.searchsorted(knots, u, side="right") - 1, last)
    basis = np.zeros((len(u), len(knots) - 1))
    basis[np.arange(len(u)), span] = 1.0
    for p in range(1, degree + 1):
        width = knots[p:-1] - knots[: -p - 1], knots[p + 1 :] - knots[1:-p]
        rising, falling = (np.divide(1.0, w, out=np.zeros_like(w), where=w > 0) for w in width)
        left = (u[:, None] - knots[: -p - 1]) * rising * basis[:, :-1]
        basis = left + (knots[p + 1 :] - u[:, None]) * falling * basis[:, 1:]
    return basis[:, :n]
