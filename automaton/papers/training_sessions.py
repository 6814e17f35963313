"""The modes of `automaton train` on the floor of one scenario: networks, tables, depths, classifiers.

torch and scikit-learn are imported where they are used, since each mode needs only one of them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from automaton.atomic_write import atomic_writer
from automaton.engine.state import NIL
from automaton.papers.leg_samples import Data, Legs, Site, data_of, judged, network_of, site_of
from automaton.papers.training_report import (
    COLUMNS,
    MORE,
    PRINTED_TABLES,
    TABLES_BY_WEIGHTING,
    TrainingRow,
    as_json,
    monitored,
)
from automaton.papers.training_settings import (
    LOSSES,
    AnswerCounts,
    Answers,
    Settings,
    measured,
    precision,
    recall,
)
from automaton.world.resolve import resolve
from strategies.routing.routing_parameters import floor_fingerprint, predicted_zones, save_network

RESULTS: Final = "automaton traffic tables 1"  # format of a results file
HIDDEN_LAYERS: Final = (3, 6, 12)  # depths of networks; the paper has 3
DEPTH_LOSSES: Final = ("hinge", "cross-entropy")  # printed; with this 3 layers learn
NEIGHBOURS: Final = (1, 5)  # the paper states no number; 5 is scikit-learn's default
TREES: Final = 20  # instead of the default 100, which take longer and change little
EVALUATED: Final = 2_000  # legs for judging a classifier

ProgressCallback = Callable[[str], None]
OnEpoch = Callable[[str, str, int], None]  # loss, weighting, epoch from 1


@dataclass(frozen=True)
class TrainingSession:
    """A floor with legs that are drawn once."""

    name: str  # of the scenario
    mode: str  # mode of its zones
    site: Site
    data: Data
    settings: Settings

    @classmethod
    def of(cls, scenario: str, overrides: Sequence[str], settings: Settings) -> TrainingSession:
        """Raises InputError for an invalid scenario, or a floor without zones."""
        resolved = resolve(scenario, overrides)
        site = site_of(resolved)
        data = data_of(site, settings.legs, settings.seed)
        return cls(
            resolved.scenario.name, resolved.scenario.world.traffic_zones, site, data, settings
        )

    def train_network(
        self, keep: tuple[str, ...], out: Path, told: ProgressCallback | None = None
    ) -> dict[str, Any]:
        """Train a network, write it to `out`, and measure its predictions."""
        from automaton.papers.training import train  # needs torch

        def tell(epoch: int, loss: float, now: AnswerCounts) -> None:
            if told is not None:
                told(
                    f"epoch {epoch} of at most {self.settings.epochs}: loss {loss:.5f}, "
                    f"precision {precision(now):.3f}, recall {recall(now):.3f}"
                )

        trained = train(self.data.training, self.settings, (keep,), tell)
        kept = trained.kept[keep]
        about = {
            "settings": asdict(self.settings),
            "monitored": list(keep) or ["loss"],
            "epochs": len(trained.losses),
            "epoch": kept.epoch,
            "loss": kept.loss,
        }
        network = network_of(kept.layers, self.site, self.name, self.mode, about)
        save_network(out, network)
        measures = judged(network, self.data)
        return {"file": str(out), **network.about, "zones": network.zones, "measures": measures}

    def train_tables(
        self, out: Path | None, told: ProgressCallback | None = None
    ) -> dict[str, Any]:
        """Train for Tables 1 to 4 with each loss; write the results to `out` if given."""

        def tell(loss: str, weighting: str, epoch: int) -> None:
            if told is not None:
                told(f"{loss}, {weighting}: epoch {epoch} of at most {self.settings.epochs}")

        rows = []
        for loss in LOSSES:
            settings = replace(self.settings, loss=loss)
            rows += train_rows(self.data, self.site, settings, tell)
        shared = self._settings_but("loss", "weighting")
        results = {"format": RESULTS, **self._origin(), "settings": shared, "rows": as_json(rows)}
        return written(results, out)

    def train_depths(
        self, out: Path | None, told: ProgressCallback | None = None
    ) -> dict[str, Any]:
        """Train networks of several depths; write the results to `out` if given."""
        rows = [depth._asdict() for depth in train_depths(self.data.training, self.settings, told)]
        shared = self._settings_but("loss", "weighting", "hidden")
        results = {**self._origin(), "settings": shared, "rows": rows}
        return written(results, out)

    def try_classifiers(self, told: ProgressCallback | None = None) -> dict[str, Any]:
        """Train other classifiers on the same legs, or on as many as they can handle."""
        results = try_classifiers(self.data, self.settings.seed, told)
        return {
            **self._origin(),
            "judged_by": EVALUATED,
            "classifiers": [result._asdict() for result in results],
        }

    def _settings_but(self, *varied: str) -> dict[str, Any]:
        """The settings that all rows share."""
        return {name: one for name, one in asdict(self.settings).items() if name not in varied}

    def _origin(self) -> dict[str, Any]:
        grid = self.site.floor.grid
        return {
            "scenario": self.name,
            "mode": self.mode,
            "zones": int(grid.traffic_zone_count),
            "floor": floor_fingerprint(grid, self.site.duration),
        }


def written(results: dict[str, Any], out: Path | None) -> dict[str, Any]:
    """Write results to a file if one is given; return them."""
    if out is not None:
        with atomic_writer(out) as file:
            file.write((json.dumps(results, indent=1, ensure_ascii=False) + "\n").encode())
    return results


def train_rows(data: Data, site: Site, settings: Settings, on_epoch: OnEpoch) -> list[TrainingRow]:
    """Train with the loss of `settings` once for each weighting; return the rows of its tables."""
    rows = []
    for weighting in TABLES_BY_WEIGHTING:
        rows += _rows(data, site, settings, weighting, on_epoch)
    return rows


def _rows(
    data: Data, site: Site, settings: Settings, weighting: str, on_epoch: OnEpoch
) -> list[TrainingRow]:
    from automaton.papers.training import train

    def told(epoch: int, loss: float, now: Any) -> None:
        on_epoch(settings.loss, weighting, epoch)

    keeps = monitored(weighting)
    trained = train(data.training, replace(settings, weighting=weighting), keeps, told)
    rows = []
    for table, legs in zip(
        TABLES_BY_WEIGHTING[weighting], (data.training, data.unused), strict=True
    ):
        for keep, figures in PRINTED_TABLES[table].items():
            kept = trained.kept[keep]
            network = network_of(kept.layers, site, "", "", {})
            answers = predicted_zones(network, legs.start_zone, legs.end_zone)
            found = measured(answers, legs.touched)
            ours = {name: found[name] for name in (*COLUMNS, *MORE)}
            paper = dict(zip(COLUMNS, figures, strict=True))
            rows.append(
                TrainingRow(
                    table, settings.loss, keep, kept.epoch, len(trained.losses), paper, ours
                )
            )
    return rows


# Do deeper networks learn? "The deeper neural networks did not converge" (Bhattathiri, Li & Kuhl, 4).
#
# Their loss is compared with the least loss of a constant answer, which is the same for every leg and
# zone: a network that does not get below it has learnt nothing about the routes of its legs.


class TrainedDepth(NamedTuple):
    """A training at the epoch with its least loss."""

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
    hidden: Sequence[int] = HIDDEN_LAYERS,
) -> list[TrainedDepth]:
    """Train once for each loss and depth."""
    from automaton.papers.training import train

    found = []
    for loss in DEPTH_LOSSES:
        for layers in hidden:

            def tell(epoch: int, mean: float, now: Any, of: str = f"{loss}, {layers}") -> None:
                if told is not None:
                    told(f"{of} hidden layers: epoch {epoch} of at most {settings.epochs}")

            trained = train(legs, replace(settings, loss=loss, hidden=layers), on_epoch=tell)
            kept = trained.kept[()]
            quality = precision(kept.counts), recall(kept.counts)
            constant = constant_loss(loss, legs.touched)
            found.append(
                TrainedDepth(
                    loss, layers, len(trained.losses), min(trained.losses), constant, *quality
                )
            )
    return found


# The classifiers that Bhattathiri, Li & Kuhl tried before networks, with scikit-learn's defaults.
#
# They report zero training accuracy; for many zones at once, scikit-learn's accuracy is the share of legs
# with every zone right (subset accuracy). The input is the one-hot start and end zone, as for the
# network. Training time grows with legs x zones, so they learn from a part of the legs.


class ClassifierResult(NamedTuple):
    """The measures of a classifier on its training legs and on legs of an unused seed."""

    classifier: str
    learnt_from: int  # legs
    training: dict[str, float]  # all measures
    unused: dict[str, float]


def one_hot(legs: Legs) -> Any:
    """(n, 2Z) sparse: 1 for the start zone and 1 for the end zone; nothing for NIL."""
    from scipy import sparse

    zones = legs.touched.shape[1]
    n = np.arange(len(legs.touched))
    rows = np.concatenate([n[legs.start_zone != NIL], n[legs.end_zone != NIL]])
    columns = np.concatenate(
        [legs.start_zone[legs.start_zone != NIL], legs.end_zone[legs.end_zone != NIL] + zones]
    )
    ones = np.ones(len(rows), np.float32)
    return sparse.csr_matrix((ones, (rows, columns)), shape=(len(n), 2 * zones))


class EachZone:
    """One binary classifier for each zone; a zone whose answers are all equal gets a constant answer."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make
        self._zones: list[Any] = []

    def fit(self, inputs: Any, truth: Answers) -> EachZone:
        """Train a classifier for each zone."""
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
    """Name -> (maximum number of training legs, classifier)."""
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.neighbors import KNeighborsClassifier
    from sklearn.svm import SVC, LinearSVC

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
) -> list[ClassifierResult]:
    """Each classifier, judged on its first 2,000 training legs and on 2,000 legs of an unused seed."""
    results = []
    for name, (most, classifier) in classifiers(seed).items():
        legs = min(most, at_most, len(data.training.touched))
        first = data.training.some(np.arange(len(data.training.touched)) < legs)
        classifier.fit(one_hot(first), first.touched)
        training, unused = (
            measured(predictions_of(classifier, some), some.touched)
            for some in (_first(first), _first(data.unused))
        )
        results.append(ClassifierResult(name, legs, training, unused))
        if on_done is not None:
            on_done(name)
    return results


def _first(legs: Legs) -> Legs:
    return legs.some(np.arange(len(legs.touched)) < EVALUATED)


def predictions_of(classifier: Any, legs: Legs) -> Answers:
    """(n, Z) bool: the answers of a classifier about legs."""
    found: Answers = np.asarray(classifier.predict(one_hot(legs))).astype(np.bool_)
    return found
