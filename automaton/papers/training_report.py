"""Tables 1 to 4 of Bhattathiri, Li & Kuhl: results of the network, by loss and by monitored metrics.

Tables 1 and 2 start the output bias at log(N1 / N0), Tables 3 and 4 weight samples; 1 and 3 are measured
on the training legs, 2 and 4 on other legs. The rows of a table differ only in the metrics that must
improve for weights to be stored, so one training gives all rows of two tables. This module also prints
the outcome of a training.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from automaton.documents.report_document import Block, Heading, Listed, ReportDocument, Table, Text
from automaton.documents.text_output import print_document
from automaton.papers.training_settings import MEASURES

Keep = tuple[str, ...]
Figures = tuple[float, float, float]  # accuracy, precision, recall

PRINTED_TABLES: Final[dict[int, dict[Keep, Figures]]] = {
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
TABLES_BY_WEIGHTING: Final = {
    "bias": (1, 2),
    "samples": (3, 4),
}  # weighting: tables on old and on new legs
MORE: Final = ("f1", "mcc")  # measures that the paper names but does not print

SHOWN_MEASURES: Final = (*COLUMNS, *MORE, "subset")
WHAT: Final = {
    1: "output bias, legs it was trained on",
    2: "output bias, legs of an unused seed",
    3: "sample weights, legs it was trained on",
    4: "sample weights, legs of an unused seed",
}
SHORT_METRICS: Final = {"accuracy": "acc", "precision": "prec", "recall": "rec"}


class TrainingRow(NamedTuple):
    """A row of a table: the metrics monitored, the printed figures, and ours for a loss."""

    table: int
    loss: str
    monitored: Keep
    epoch: int  # the epoch whose weights were stored
    epochs: int  # number of epochs of the training
    paper: dict[str, float]  # by COLUMNS
    ours: dict[str, float]  # by COLUMNS and MORE

    @property
    def short(self) -> str:
        """The monitored metrics, short enough for a line of a table."""
        return " ".join(SHORT_METRICS.get(name, name) for name in self.monitored)


def monitored(weighting: str) -> list[Keep]:
    """The monitored metrics in the rows of a weighting's two tables, in printed order."""
    return list(
        dict.fromkeys(
            keep for table in TABLES_BY_WEIGHTING[weighting] for keep in PRINTED_TABLES[table]
        )
    )


def as_json(rows: Sequence[TrainingRow]) -> list[dict[str, Any]]:
    """Rows for a results file, with figures rounded to four decimals."""
    return [
        row._asdict() | {"ours": {name: round(value, 4) for name, value in row.ours.items()}}
        for row in rows
    ]


def from_json(rows: Sequence[dict[str, Any]]) -> list[TrainingRow]:
    """Rows from a results file."""
    return [TrainingRow(**{**row, "monitored": tuple(row["monitored"])}) for row in rows]


# The outcome of a training as text.


def print_outcome(mode: str, outcome: Mapping[str, Any]) -> None:
    """Print the outcome of `automaton train` in one of its modes."""
    blocks = {
        "network": network_blocks,
        "tables": table_blocks,
        "depths": depth_blocks,
        "classifiers": classifier_blocks,
    }
    print_document(ReportDocument(title(outcome), list(blocks[mode](outcome))))


def title(outcome: Mapping[str, Any]) -> str:
    return f"{outcome['scenario']}, {outcome['zones']:,} zones ({outcome['mode']})"


def effort(outcome: Mapping[str, Any]) -> str:
    """The amount of training data, in words."""
    settings = outcome["settings"]
    return (
        f"{title(outcome)}: {settings['legs']:,} legs, batches of {settings['batch']}, "
        f"at most {settings['epochs']} epochs"
    )


def network_blocks(outcome: Mapping[str, Any]) -> Iterator[Block]:
    """The training of a network, its measures by kind of legs, and its file."""
    settings = outcome["settings"]
    first = f"{title(outcome)}: {settings['loss']}, weighting {settings['weighting']}"
    monitored = " and ".join(
        MEASURES[m].title if m in MEASURES else m for m in outcome["monitored"]
    )
    epochs = (
        f"{outcome['epochs']} epochs of {settings['legs']:,} legs, "
        f"weights of epoch {outcome['epoch']} chosen by {monitored}"
    )
    yield Listed([first, epochs], mark="")
    rows = [
        [name, *(f"{measures[measure]:.3f}" for measure in SHOWN_MEASURES)]
        for name, measures in outcome["measures"].items()
    ]
    yield Table(("legs", *SHOWN_MEASURES), rows)
    yield Text(f"written to {outcome['file']}")


def table_blocks(outcome: Mapping[str, Any]) -> Iterator[Block]:
    """Tables 1 to 4, with printed figures beside ours for each loss.

    Each table is a block with a row for each set of monitored metrics and loss.
    """
    yield Text(effort(outcome))
    rows = from_json(outcome["rows"])
    for number in sorted({row.table for row in rows}):
        some = [row for row in rows if row.table == number]
        yield Heading(f"Table {number} ({WHAT[number]}): paper / ours", 3)
        lines = [
            [
                *(row.short, row.loss),
                *(f"{row.paper[name]:.2f} / {row.ours[name]:.2f}" for name in COLUMNS),
                f"{row.epoch} of {row.epochs}",
            ]
            for keep in dict.fromkeys(row.monitored for row in some)
            for row in some
            if row.monitored == keep
        ]
        yield Table(("monitored", "loss", *COLUMNS, "epoch"), lines, left=2)


def depth_blocks(outcome: Mapping[str, Any]) -> Iterator[Block]:
    """The least loss of each network, compared with the least loss of a constant answer."""
    what = "least: the loss of the best epoch; constant: of the best constant answer"
    yield Listed([effort(outcome), what], mark="")
    figures = ("least", "constant", "precision", "recall")
    rows = [
        [row["loss"], str(row["hidden"]), str(row["epochs"]), *(f"{row[n]:.4f}" for n in figures)]
        for row in outcome["rows"]
    ]
    yield Table(("loss", "hidden", "epochs", *figures), rows)


def classifier_blocks(outcome: Mapping[str, Any]) -> Iterator[Block]:
    """The classifiers; the first measure is the share of completely right legs, as in the paper."""
    yield Text(
        f"{title(outcome)}: judged by {outcome['judged_by']:,} legs of the training and as many of "
        "an unused seed"
    )
    figures = ("subset", "precision", "recall")
    rows = [
        [
            *(result["classifier"], f"{result['learnt_from']:,}", legs),
            *(f"{result[legs][name]:.3f}" for name in figures),
        ]
        for result in outcome["classifiers"]
        for legs in ("training", "unused")
    ]
    yield Table(("classifier", "learnt from", "legs", *figures), rows, also_left=(2,))
