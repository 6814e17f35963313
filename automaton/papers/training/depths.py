"""Do deeper networks learn? "The deeper neural networks did not converge" (Bhattathiri, Li & Kuhl, 4).

Networks with more hidden layers than the paper's three are trained as it is. What they come to stands
beside the least loss of a constant answer, the same for every leg and zone: a network that does not get
below it has learnt nothing of where its legs lead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.papers.training.leg_samples import Legs
from automaton.papers.training.prediction_metrics import precision, recall
from automaton.papers.training.training_settings import Settings

HIDDEN: Final = (3, 6, 12)  # layers
LOSSES: Final = ("hinge", "cross-entropy")  # the printed one, and one with which three layers learn


class Depth(NamedTuple):
    """A training, as it was when its loss was least."""

    loss: str
    hidden: int
    epochs: int  # of the whole training
    least: float  # mean loss of an epoch
    constant: float  # the least loss of a constant answer
    precision: float  # on the legs of the training
    recall: float


def constant_loss(loss: str, touched: npt.NDArray[np.bool_]) -> float:
    """The least mean loss of one answer for all legs and zones."""
    share = float(touched.mean())
    if loss == "hinge":
        return 1 - share  # every zone, for sure
    return -share * math.log(share) - (1 - share) * math.log(1 - share)


def train_depths(
    legs: Legs,
    settings: Settings,
    told: Callable[[str], None] | None = None,
    hidden: Sequence[int] = HIDDEN,
) -> list[Depth]:
    """Train once for each loss and depth."""
    from automaton.papers.training.training import train

    found = []
    for loss in LOSSES:
        for layers in hidden:

            def tell(epoch: int, mean: float, now: Any, of: str = f"{loss}, {layers}") -> None:
                if told is not None:
                    told(f"{of} hidden layers: epoch {epoch} of at most {settings.epochs}")

            trained = train(legs, replace(settings, loss=loss, hidden=layers), on_epoch=tell)
            kept = trained.kept[()]
            quality = precision(kept.counts), recall(kept.counts)
            constant = constant_loss(loss, legs.touched)
            found.append(
                Depth(loss, layers, len(trained.losses), min(trained.losses), constant, *quality)
            )
    return found
