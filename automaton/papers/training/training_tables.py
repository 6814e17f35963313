"""Tables 1 to 4 of Bhattathiri, Li & Kuhl: what the network learns, by loss and by monitored metrics.

Tables 1 and 2 start the output bias at log(N1 / N0), Tables 3 and 4 weigh samples; 1 and 3 are
measured on the legs of the training, 2 and 4 on others. The rows of a table differ only in the metrics
that must all improve for weights to be kept, so one training makes all rows of two tables.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

from automaton.papers.training.leg_samples import Data, Site, network_of
from automaton.papers.training.prediction_metrics import measured
from automaton.papers.training.training_settings import Settings
from strategies.routing.routing_parameters import predicted_zones

Keep = tuple[str, ...]
Figures = tuple[float, float, float]  # accuracy, precision, recall

PRINTED: Final[dict[int, dict[Keep, Figures]]] = {
    1: {
        ("accuracy",): (0.97, 0.48, 0.00),
        ("precision", "recall"): (0.97, 0.39, 0.00),
        ("recall",): (0.97, 0.00, 0.00),
        ("accuracy", "hamming"): (0.97, 0.52, 0.00),
        ("accuracy", "precision", "recall"): (0.97, 0.21, 0.34),
    },
    2: {
        ("accuracy",): (0.97, 0.00, 0.00),
        ("precision", "recall"): (0.97, 0.02, 0.00),
        ("recall",): (0.97, 0.00, 0.00),
        ("accuracy", "hamming"): (0.04, 0.52, 0.00),
        ("accuracy", "precision", "recall"): (0.02, 0.21, 0.00),
    },
    3: {
        ("precision", "recall"): (0.49, 0.40, 0.84),
        ("precision",): (0.97, 0.00, 0.00),
        ("accuracy", "hamming"): (0.66, 0.05, 0.10),
        ("accuracy", "mcc"): (0.97, 0.00, 0.00),
    },
    4: {
        ("accuracy",): (0.60, 0.05, 0.75),
        ("precision", "recall"): (0.45, 0.00, 0.84),
        ("precision",): (1.00, 0.00, 0.00),
        ("accuracy", "hamming"): (0.66, 0.05, 0.62),
        ("accuracy", "mcc"): (0.97, 0.00, 0.00),
    },
}
COLUMNS: Final = ("accuracy", "precision", "recall")
TRAINED: Final = {"bias": (1, 2), "samples": (3, 4)}  # weighting: tables on old and on new legs
MORE: Final = ("f1", "mcc")  # measures that the paper names but does not print

SHORT: Final = {"accuracy": "acc", "precision": "prec", "recall": "rec"}

OnEpoch = Callable[[str, str, int], None]  # loss, weighting, epoch from 1


class Row(NamedTuple):
    """A row of a table: the metrics monitored, the printed figures, and ours for a loss."""

    table: int
    loss: str
    monitored: Keep
    epoch: int  # after which the weights were kept
    epochs: int  # of the whole training
    paper: dict[str, float]  # by COLUMNS
    ours: dict[str, float]  # by COLUMNS and MORE

    @property
    def short(self) -> str:
        """The monitored metrics, short enough for a line of a table."""
        return " ".join(SHORT.get(name, name) for name in self.monitored)


def monitored(weighting: str) -> list[Keep]:
    """What the rows of a weighting's two tables monitor, in the order of print."""
    return list(dict.fromkeys(keep for table in TRAINED[weighting] for keep in PRINTED[table]))


def train_rows(data: Data, site: Site, settings: Settings, on_epoch: OnEpoch) -> list[Row]:
    """Train with the loss of `settings` once for each weighting; the rows of its tables."""
    rows = []
    for weighting in TRAINED:
        rows += _rows(data, site, settings, weighting, on_epoch)
    return rows


def _rows(
    data: Data, site: Site, settings: Settings, weighting: str, on_epoch: OnEpoch
) -> list[Row]:
    from automaton.papers.training.training import train

    def told(epoch: int, loss: float, now: Any) -> None:
        on_epoch(settings.loss, weighting, epoch)

    keeps = monitored(weighting)
    trained = train(data.training, replace(settings, weighting=weighting), keeps, told)
    rows = []
    for table, legs in zip(TRAINED[weighting], (data.training, data.unused), strict=True):
        for keep, figures in PRINTED[table].items():
            kept = trained.kept[keep]
            network = network_of(kept.layers, site, "", "", {})
            answers = predicted_zones(network, legs.start_zone, legs.end_zone)
            found = measured(answers, legs.touched)
            ours = {name: found[name] for name in (*COLUMNS, *MORE)}
            paper = dict(zip(COLUMNS, figures, strict=True))
            rows.append(
                Row(table, settings.loss, keep, kept.epoch, len(trained.losses), paper, ours)
            )
    return rows


def as_json(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Rows for a file of results, figures with four digits."""
    return [
        row._asdict() | {"ours": {name: round(value, 4) for name, value in row.ours.items()}}
        for row in rows
    ]


def from_json(rows: Sequence[dict[str, Any]]) -> list[Row]:
    """Rows from a file of results."""
    return [Row(**{**row, "monitored": tuple(row["monitored"])}) for row in rows]
