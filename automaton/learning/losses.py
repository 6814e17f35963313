"""The losses that networks are trained with, in NumPy: values, and slopes by the logit.

    a  logit, one for each zone        z = 1 / (1 + exp(-a))  the network's output
    y  1 where the leg touches the zone, else 0

hinge          max(0, 1 - y z), as printed (Bhattathiri, Li & Kuhl, equation 1). Where y = 0 it is 1
               whatever z is: no slope, so nothing ever lowers an output, and all end at 1.
signed-hinge   max(0, 1 - s z) with s = 1 or -1: what a hinge loss is defined on
cross-entropy  -y log z - (1 - y) log(1 - z)

Training uses the same formulas on PyTorch's tensors; a test compares its slopes with these.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[np.float64]


def sigmoid(logit: Numbers) -> Numbers:
    """1 / (1 + exp(-a)) without overflow."""
    small = np.exp(-np.abs(logit))
    return np.where(logit >= 0, 1.0, small) / (1.0 + small)


class Loss(NamedTuple):
    """A loss for each zone: its value and its derivative by the logit, from (logit, y)."""

    value: Callable[[Numbers, Numbers], Numbers]
    slope: Callable[[Numbers, Numbers], Numbers]


def hinge(logit: Numbers, y: Numbers) -> Numbers:
    """max(0, 1 - y z)."""
    return np.maximum(0.0, 1.0 - y * sigmoid(logit))


def hinge_slope(logit: Numbers, y: Numbers) -> Numbers:
    """-y z (1 - z): 0 for every zone that is not touched."""
    return -y * _rise(logit)


def signed_hinge(logit: Numbers, y: Numbers) -> Numbers:
    """max(0, 1 - s z), s = 2 y - 1."""
    return np.maximum(0.0, 1.0 - (2.0 * y - 1.0) * sigmoid(logit))


def signed_hinge_slope(logit: Numbers, y: Numbers) -> Numbers:
    """-s z (1 - z)."""
    return -(2.0 * y - 1.0) * _rise(logit)


def cross_entropy(logit: Numbers, y: Numbers) -> Numbers:
    """-y log z - (1 - y) log(1 - z), from the logit without overflow."""
    return np.maximum(logit, 0.0) - y * logit + np.log1p(np.exp(-np.abs(logit)))


def cross_entropy_slope(logit: Numbers, y: Numbers) -> Numbers:
    """z - y."""
    return sigmoid(logit) - y


def _rise(logit: Numbers) -> Numbers:
    z = sigmoid(logit)
    return z * (1.0 - z)


LOSSES: Final[dict[str, Loss]] = {
    "cross-entropy": Loss(cross_entropy, cross_entropy_slope),
    "hinge": Loss(hinge, hinge_slope),
    "signed-hinge": Loss(signed_hinge, signed_hinge_slope),
}

WEIGHTINGS: Final = ("none", "bias", "samples")


def first_bias(touched: npt.NDArray[np.bool_]) -> float:
    """log(N1 / N0), N1 touched zones of all legs and N0 others (equation 3); below 0 here.

    A network that starts there predicts "empty", although the text wants the opposite of it.
    """
    ones = int(np.count_nonzero(touched))
    return float(np.log(ones / (touched.size - ones)))


def sample_weights(touched: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """(weight of a zone that is not touched, weight of one that is): N / N_i (equation 2)."""
    ones = int(np.count_nonzero(touched))
    return touched.size / (touched.size - ones), touched.size / ones
