"""What a training gave, as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from automaton.papers.training.prediction_metrics import METRICS
from automaton.papers.training.training_tables import COLUMNS, from_json
from automaton.runs.console_output import ConsoleBlock, console, print_blocks
from automaton.runs.report_document import Table

SHOWN = ("accuracy", "precision", "recall", "f1", "mcc", "subset")
WHAT = {
    1: "output bias, legs it was trained on",
    2: "output bias, legs of an unused seed",
    3: "sample weights, legs it was trained on",
    4: "sample weights, legs of an unused seed",
}


def print_outcome(mode: str, outcome: Mapping[str, Any]) -> None:
    """Print what `automaton train` gave in one of its modes."""
    blocks = {
        "network": network_blocks,
        "tables": table_blocks,
        "depths": depth_blocks,
        "classifiers": classifier_blocks,
    }
    print_blocks(console(), blocks[mode](outcome))


def title(outcome: Mapping[str, Any]) -> str:
    return f"{outcome['scenario']}, {outcome['zones']:,} zones ({outcome['mode']})"


def effort(outcome: Mapping[str, Any]) -> str:
    """How much was learnt from."""
    settings = outcome["settings"]
    return (
        f"{title(outcome)}: {settings['legs']:,} legs, batches of {settings['batch']}, "
        f"at most {settings['epochs']} epochs"
    )


def network_blocks(outcome: Mapping[str, Any]) -> Iterator[ConsoleBlock]:
    """How it was trained, how well it predicts which legs, and where it is."""
    settings = outcome["settings"]
    yield f"{title(outcome)}: {settings['loss']}, weighting {settings['weighting']}"
    monitored = " and ".join(METRICS[m].title if m in METRICS else m for m in outcome["monitored"])
    yield (
        f"{outcome['epochs']} epochs of {settings['legs']:,} legs, "
        f"weights of epoch {outcome['epoch']} kept by {monitored}"
    )
    yield ""
    rows = [
        [name, *(f"{measures[measure]:.3f}" for measure in SHOWN)]
        for name, measures in outcome["measures"].items()
    ]
    yield Table(("legs", *SHOWN), rows)
    yield f"\nwritten to {outcome['file']}"


def table_blocks(outcome: Mapping[str, Any]) -> Iterator[ConsoleBlock]:
    """Tables 1 to 4, the printed figures beside ours for each loss.

    One block for each table: a row for each set of monitored metrics and loss.
    """
    yield effort(outcome)
    rows = from_json(outcome["rows"])
    for number in sorted({row.table for row in rows}):
        some = [row for row in rows if row.table == number]
        yield f"\nTable {number} ({WHAT[number]}): paper / ours"
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


def depth_blocks(outcome: Mapping[str, Any]) -> Iterator[ConsoleBlock]:
    """The least loss of each network beside that of a constant answer."""
    yield effort(outcome)
    yield "least: the loss of the best epoch; constant: of the best constant answer\n"
    figures = ("least", "constant", "precision", "recall")
    rows = [
        [row["loss"], str(row["hidden"]), str(row["epochs"]), *(f"{row[n]:.4f}" for n in figures)]
        for row in outcome["rows"]
    ]
    yield Table(("loss", "hidden", "epochs", *figures), rows)


def classifier_blocks(outcome: Mapping[str, Any]) -> Iterator[ConsoleBlock]:
    """The share of wholly right legs first: the measure by which the paper discards them."""
    yield (
        f"{title(outcome)}: judged by {outcome['judged_by']:,} legs of the training and as many of "
        "an unused seed"
    )
    yield ""
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
