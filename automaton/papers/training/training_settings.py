"""How a network is trained; the defaults are those of Bhattathiri, Li & Kuhl where they print them.

Losses, by the logit:

    a  logit, one for each zone        z = 1 / (1 + exp(-a))  the network's output
    y  1 where the leg touches the zone, else 0

hinge          max(0, 1 - y z), as printed (Bhattathiri, Li & Kuhl, equation 1). Where y = 0 it is 1
               whatever z is: no slope, so nothing ever lowers an output, and all end at 1.
signed-hinge   max(0, 1 - s z) with s = 1 or -1: what a hinge loss is defined on
cross-entropy  -y log z - (1 - y) log(1 - z)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Settings:
    """All that a training follows from, its legs aside."""

    loss: str = "cross-entropy"  # of LOSSES
    weighting: str = "none"  # of WEIGHTINGS
    batch: int = 32  # legs
    epochs: int = 100  # at most
    patience: int = 5  # epochs without lower loss after which training ends
    rate: float = 0.001  # of Adam; the paper prints none
    seed: int = 1  # of the first weights, the legs and their order
    hidden: int = 3  # layers of 256
    legs: int = 15_000  # half from racks to docks, half back


# The paper minimizes its printed hinge loss; the others show what its network could have learnt.
LOSSES: Final = ("hinge", "signed-hinge", "cross-entropy")
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
