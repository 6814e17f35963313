"""Settings of the training of a network; defaults are those of Bhattathiri, Li & Kuhl where printed.

Losses, by the logit:

    a  logit, one for each zone        z = 1 / (1 + exp(-a))  the network's output
    y  1 where the leg touches the zone, else 0

hinge          max(0, 1 - y z), as printed (Bhattathiri, Li & Kuhl, equation 1). For y = 0 it is
               constant 1 without a gradient, so nothing lowers an output, and all outputs become 1.
signed-hinge   max(0, 1 - s z) with s = 1 or -1, the usual definition of the hinge loss
cross-entropy  -y log z - (1 - y) log(1 - z)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Settings:
    """Everything that determines a training, except its legs."""

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
    """log(N1 / N0), with N1 touched and N0 untouched zones of all legs (equation 3); negative here.

    A network that starts with this bias predicts "empty", although the text intends the opposite.
    """
    ones = int(np.count_nonzero(touched))
    return float(np.log(ones / (touched.size - ones)))


def sample_weights(touched: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """(weight of an untouched zone, weight of a touched zone): N / N_i (equation 2)."""
    ones = int(np.count_nonzero(touched))
    return touched.size / (touched.size - ones), touched.size / ones


# Measures of predicted sets of zones, from the counts of answers.
#
# Every (leg, zone) is one answer; the counts of all answers are pooled (micro average). A measure with a
# zero denominator is 0: a network that predicts no zone has precision 0, not 1.


Answers = npt.NDArray[np.bool_]  # (legs, zones)


class AnswerCounts(NamedTuple):
    """Numbers of answers by prediction and truth."""

    true_positive: int
    false_positive: int
    true_negative: int
    false_negative: int


def counts(predicted: Answers, truth: Answers) -> AnswerCounts:
    """Count the answers; both arrays have the same shape, else ValueError."""
    if predicted.shape != truth.shape:
        raise ValueError(f"shapes differ: {predicted.shape} predicted, {truth.shape} true")
    hits = int(np.count_nonzero(predicted & truth))
    yes, wanted = int(np.count_nonzero(predicted)), int(np.count_nonzero(truth))
    return AnswerCounts(hits, yes - hits, truth.size - yes - wanted + hits, wanted - hits)


def accuracy(c: AnswerCounts) -> float:
    """Share of right answers (TP + TN) / all."""
    return _share(c.true_positive + c.true_negative, sum(c))


def hamming_loss(c: AnswerCounts) -> float:
    """Share of wrong answers, 1 - accuracy; lower is better."""
    return _share(c.false_positive + c.false_negative, sum(c))


def precision(c: AnswerCounts) -> float:
    """Share of the predicted zones that are touched, TP / (TP + FP)."""
    return _share(c.true_positive, c.true_positive + c.false_positive)


def recall(c: AnswerCounts) -> float:
    """Share of the touched zones that are predicted, TP / (TP + FN)."""
    return _share(c.true_positive, c.true_positive + c.false_negative)


def f1(c: AnswerCounts) -> float:
    """Harmonic mean of precision and recall, 2 TP / (2 TP + FP + FN)."""
    return _share(2 * c.true_positive, 2 * c.true_positive + c.false_positive + c.false_negative)


def mcc(c: AnswerCounts) -> float:
    """Matthews correlation coefficient (Matthews 1975), -1 to 1; 0 where a factor is 0.

    (TP TN - FP FN) / sqrt((TP + FP) (TP + FN) (TN + FP) (TN + FN))
    """
    tp, fp, tn, fn = c
    product = (tp + fp) * (tp + fn) * (tn + fp) * (tn + fn)  # exact: Python's integers
    return (tp * tn - fp * fn) / math.sqrt(product) if product else 0.0


def subset_accuracy(predicted: Answers, truth: Answers) -> float:
    """Share of the legs with every zone right."""
    return _share(int(np.count_nonzero((predicted == truth).all(axis=1))), len(truth))


def _share(part: int, whole: int) -> float:
    return part / whole if whole else 0.0


class Metric(NamedTuple):
    """A measure that training may monitor."""

    of: Callable[[AnswerCounts], float]
    title: str
    better: int  # 1: more is better, -1: less is

    def improves(self, now: AnswerCounts, before: AnswerCounts) -> bool:
        """Whether `now` is strictly better."""
        return self.better * (self.of(now) - self.of(before)) > 0


MEASURES: Final[dict[str, Metric]] = {
    "accuracy": Metric(accuracy, "Accuracy", 1),
    "precision": Metric(precision, "Precision", 1),
    "recall": Metric(recall, "Recall", 1),
    "f1": Metric(f1, "F1", 1),
    "hamming": Metric(hamming_loss, "Hamming Loss", -1),
    "mcc": Metric(mcc, "Matthews Correlation Coefficient", 1),
}


def measured(predicted: Answers, truth: Answers) -> dict[str, Any]:
    """All measures by name, including the share of completely right legs."""
    found = counts(predicted, truth)
    values = {name: metric.of(found) for name, metric in MEASURES.items()}
    return values | {"subset": subset_accuracy(predicted, truth)}
