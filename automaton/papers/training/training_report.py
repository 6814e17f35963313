"""What a training gave, as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from automaton.papers.training.prediction_metrics import METRICS
from automaton.papers.training.training_tables import COLUMNS, Row, from_json
from automaton.runs.run_report import console, plain_table, print_table

SHOWN = ("accuracy", "precision", "recall", "f1", "mcc", "subset")
WHAT = {
    1: "output bias, legs it was trained on",
    2: "output bias, legs of an unused seed",
    3: "sample weights, legs it was trained on",
    4: "sample weights, legs of an unused seed",
}


def print_outcome(mode: str, outcome: Mapping[str, Any]) -> None:
    """Print what `automaton train` gave in one of its modes."""
    out = console()
    printers = {
        "network": print_network,
        "tables": print_tables,
        "depths": print_depths,
        "classifiers": print_classifiers,
    }
    printers[mode](out, outcome)


def title(outcome: Mapping[str, Any]) -> str:
    return f"{outcome['scenario']}, {outcome['zones']:,} zones ({outcome['mode']})"


def print_network(out: Console, outcome: Mapping[str, Any]) -> None:
    """How it was trained, how well it predicts which legs, and where it is."""
    settings = outcome["settings"]
    out.print(f"{title(outcome)}: {settings['loss']}, weighting {settings['weighting']}")
    monitored = " and ".join(METRICS[m].title if m in METRICS else m for m in outcome["monitored"])
    out.print(
        f"{outcome['epochs']} epochs of {settings['legs']:,} legs, "
        f"weights of epoch {outcome['epoch']} kept by {monitored}",
        soft_wrap=True,
    )
    out.print()
    table = plain_table("legs", *SHOWN)
    table.columns[0].justify = "left"
    for name, measures in outcome["measures"].items():
        table.add_row(name, *(f"{measures[measure]:.3f}" for measure in SHOWN))
    print_table(out, table)
    out.print(f"\nwritten to {outcome['file']}", soft_wrap=True)


def print_tables(out: Console, outcome: Mapping[str, Any]) -> None:
    """Tables 1 to 4, the printed figures beside ours for each loss."""
    settings = outcome["settings"]
    out.print(
        f"{title(outcome)}: {settings['legs']:,} legs, batches of {settings['batch']}, "
        f"at most {settings['epochs']} epochs",
        soft_wrap=True,
    )
    print_rows(out, from_json(outcome["rows"]))


def print_rows(out: Console, rows: Sequence[Row]) -> None:
    """One block for each table: a row for each set of monitored metrics and loss."""
    for number in sorted({row.table for row in rows}):
        some = [row for row in rows if row.table == number]
        out.print(f"\nTable {number} ({WHAT[number]}): paper / ours")
        table = plain_table("monitored", "loss", *COLUMNS, "epoch")
        table.columns[0].justify = table.columns[1].justify = "left"
        for keep in dict.fromkeys(row.monitored for row in some):
            for row in (row for row in some if row.monitored == keep):
                figures = (f"{row.paper[name]:.2f} / {row.ours[name]:.2f}" for name in COLUMNS)
                table.add_row(row.short, row.loss, *figures, f"{row.epoch} of {row.epochs}")
        print_table(out, table)


def print_depths(out: Console, outcome: Mapping[str, Any]) -> None:
    """The least loss of each network beside that of a constant answer."""
    settings = outcome["settings"]
    out.print(
        f"{title(outcome)}: {settings['legs']:,} legs, batches of {settings['batch']}, "
        f"at most {settings['epochs']} epochs",
        soft_wrap=True,
    )
    out.print("least: the loss of the best epoch; constant: of the best constant answer\n")
    table = plain_table("loss", "hidden", "epochs", "least", "constant", "precision", "recall")
    table.columns[0].justify = "left"
    for row in outcome["rows"]:
        figures = (f"{row[name]:.4f}" for name in ("least", "constant", "precision", "recall"))
        table.add_row(row["loss"], str(row["hidden"]), str(row["epochs"]), *figures)
    print_table(out, table)


def print_classifiers(out: Console, outcome: Mapping[str, Any]) -> None:
    """The share of wholly right legs first: the measure by which the paper discards them."""
    out.print(
        f"{title(outcome)}: judged by {outcome['judged_by']:,} legs of the training and as many of "
        "an unused seed",
        soft_wrap=True,
    )
    out.print()
    table = plain_table("classifier", "learnt from", "legs", "subset", "precision", "recall")
    table.columns[0].justify = table.columns[2].justify = "left"
    for result in outcome["classifiers"]:
        for legs in ("training", "unused"):
            figures = (f"{result[legs][name]:.3f}" for name in ("subset", "precision", "recall"))
            table.add_row(result["classifier"], f"{result['learnt_from']:,}", legs, *figures)
    print_table(out, table)
