"""The classifiers that Bhattathiri, Li & Kuhl tried before networks, with scikit-learn's defaults.

They report zero training accuracy; of many zones at once scikit-learn's accuracy is the share of legs
of which every zone is right (subset accuracy). Input is the one-hot start and end zone, as for the
network. Time grows with legs x zones, so they learn from some of the legs only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import sparse
from sklearn.ensemble import RandomForestClassifier
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC, LinearSVC

from automaton.engine.state import NIL
from automaton.papers.training.leg_samples import Data, Legs
from automaton.papers.training.prediction_metrics import Answers, measured

NEIGHBOURS: Final = (1, 5)  # the paper names none; 5 is scikit-learn's default
TREES: Final = 20  # of its 100: more take longer and change little
EVALUATED: Final = 2_000  # legs


class Result(NamedTuple):
    """How well a classifier does on the legs it learnt from and on legs of an unused seed."""

    classifier: str
    learnt_from: int  # legs
    training: dict[str, float]  # automaton.papers.training.prediction_metrics.measured
    unused: dict[str, float]


def one_hot(legs: Legs) -> Any:
    """(n, 2Z) sparse: a one for the start zone and one for the end zone, none for NIL."""
    zones = legs.touched.shape[1]
    n = np.arange(len(legs.touched))
    rows = np.concatenate([n[legs.start_zone != NIL], n[legs.end_zone != NIL]])
    columns = np.concatenate(
        [
            legs.start_zone[legs.start_zone != NIL],
            legs.end_zone[legs.end_zone != NIL] + zones,
        ]
    )
    ones = np.ones(len(rows), np.float32)
    return sparse.csr_matrix((ones, (rows, columns)), shape=(len(n), 2 * zones))


class EachZone:
    """One binary classifier for each zone; a zone with one answer only always gets that answer."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make
        self._zones: list[Any] = []

    def fit(self, inputs: Any, truth: Answers) -> EachZone:
        """Learn every zone for itself."""
        self._zones = [
            self._make().fit(inputs, zone) if zone.any() and not zone.all() else bool(zone.all())
            for zone in truth.T
        ]
        return self

    def predict(self, inputs: Any) -> Answers:
        """(n, Z) bool."""
        n = inputs.shape[0]
        columns = [
            np.full(n, zone) if isinstance(zone, bool) else zone.predict(inputs)
            for zone in self._zones
        ]
        return np.stack(columns, axis=1).astype(np.bool_)


def classifiers(seed: int) -> dict[str, tuple[int, Any]]:
    """name: (legs it learns from at most, classifier)."""
    return {
        "linear support vectors": (15_000, EachZone(lambda: LinearSVC(random_state=seed))),
        "support vectors, radial kernel": (1_500, EachZone(lambda: SVC(random_state=seed))),
        **{
            f"nearest neighbours, k = {k}": (15_000, KNeighborsClassifier(n_neighbors=k))
            for k in NEIGHBOURS
        },
        f"random forest, {TREES} trees": (
            3_000,
            RandomForestClassifier(n_estimators=TREES, random_state=seed, n_jobs=1),
        ),
    }


def try_classifiers(
    data: Data, seed: int, on_done: Callable[[str], None] | None = None, at_most: int = 15_000
) -> list[Result]:
    """Each classifier, judged on the first 2,000 legs that it learnt from and of an unused seed."""
    results = []
    for name, (most, classifier) in classifiers(seed).items():
        legs = min(most, at_most, len(data.training.touched))
        first = data.training.some(np.arange(len(data.training.touched)) < legs)
        classifier.fit(one_hot(first), first.touched)
        training, unused = (
            measured(predictions_of(classifier, some), some.touched)
            for some in (_first(first), _first(data.unused))
        )
        results.append(Result(name, legs, training, unused))
        if on_done is not None:
            on_done(name)
    return results


def _first(legs: Legs) -> Legs:
    return legs.some(np.arange(len(legs.touched)) < EVALUATED)


def predictions_of(classifier: Any, legs: Legs) -> Answers:
    """(n, Z) bool: what a classifier says about legs."""
    found: Answers = np.asarray(classifier.predict(one_hot(legs))).astype(np.bool_)
    return found
