"""Run the cases of a published table, and print published and simulated values side by side.

Exit code 0: done; 1: some runs did not finish; 2: bad input.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from automaton.commands.arguments import (
    add_output_arguments,
    add_settings_argument,
    note,
    output_of,
    progress_bar,
    whole,
)
from automaton.errors import InputError

if TYPE_CHECKING:
    from automaton.papers.claims import Judged, JudgedClaim
    from automaton.papers.reproduction_study import Reproduced

Listeners = tuple[Callable[[int], None] | None, Callable[[int], None] | None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton reproduce`."""
    parser.add_argument("name", metavar="NAME", help="a published table, such as tabletop")
    parser.add_argument(
        "--seeds", type=int, metavar="N", help="run N seeds (default: as many as the table needs)"
    )
    parser.add_argument(
        "--seed-from",
        type=whole("a seed", 1),
        default=1,
        metavar="N",
        help="use seeds from this one on (default: 1); other seeds may change the verdicts",
    )
    parser.add_argument(
        "--strategies",
        default="",
        metavar="A,B",
        help=("run these strategies instead of the published ones"),
    )
    parser.add_argument(
        "--tables",
        nargs="?",
        const="",
        metavar="A,B",
        help="print all tables, claims and remarks, not only the first screen; with names, compute "
        "only those tables; some tables are left out unless they are named",
    )
    add_settings_argument(
        parser,
        "change a value of the scenarios, such as durations.turn=10; may be repeated",
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="use N processes (default: one per core)"
    )
    parser.add_argument(
        "--data",
        type=Path,
        metavar="FOLDER",
        help="read the published problems from this folder (for tables whose problems are not "
        "shipped)",
    )
    add_output_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run all cases, judge the claims, report."""
    from automaton.papers.claim_report import first_screen, whole_report
    from automaton.papers.reproduction_study import find, reproduce

    output = output_of(args)
    for option, value in (("--seeds", args.seeds), ("--workers", args.workers)):
        if value is not None and value < 1:
            raise InputError(f"{option} must be at least 1, not {value}")
    reproduction = find(args.name)
    if args.data is not None:
        if reproduction.from_data is None:
            raise InputError(f"{args.name} needs no published problems: leave out --data")
        reproduction = reproduction.from_data(args.data)
    strategies, tables = listed(args.strategies), listed(args.tables or "")
    with progress() as (on_start, on_done):
        listeners = on_start, on_done
        many = args.seeds, strategies, args.workers
        reproduced = reproduce(
            reproduction,
            *many,
            *listeners,
            tables=tables,
            first_seed=args.seed_from,
            settings=tuple(args.settings),
        )
    judged = reproduced.judged()
    compose = first_screen if args.tables is None else whole_report
    output.write(
        lambda: compose(reproduced, judged),
        lambda: as_json(reproduced, judged),
    )
    if reproduced.unfinished:
        note(f"{reproduced.unfinished:,} of {reproduced.repetitions:,} runs did not finish")
        return 1
    return 0


def listed(text: str) -> list[str]:
    """The names in a comma-separated list, without duplicates."""
    names = (name.strip() for name in text.split(","))
    return list(dict.fromkeys(name for name in names if name))


@contextlib.contextmanager
def progress() -> Iterator[Listeners]:
    """A progress bar on stderr if it is a terminal."""
    if not sys.stderr.isatty():
        yield None, None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TimeRemainingColumn

    with progress_bar("runs", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task("runs", total=None)
        yield (lambda total: bar.update(task, total=total), lambda runs: bar.advance(task, runs))


def as_json(reproduced: Reproduced, judged: list[JudgedClaim]) -> dict[str, Any]:
    """The table as one object; the same for any number of workers."""
    return {
        "name": reproduced.reproduction.name,
        "seeds": reproduced.seeds,
        "seed_from": reproduced.first_seed,
        "settings": list(reproduced.settings),
        "runs": reproduced.repetitions,
        "unfinished": reproduced.unfinished,
        "rows": [
            {
                "case": dict(row.case),
                "metric": row.metric,
                "paper": row.paper,
                "mean": row.mean,
                "sd": row.sd,
                "error": row.error,
                **({"half_width": row.half_width, "rank": row.rank} if row.ranked else {}),
                **({"paper_sd": row.paper_sd} if row.paper_sd is not None else {}),
                **({"stored": True} if row.stored else {}),
                **(
                    {
                        "prototype": row.prototype[0],
                        "prototype_se": row.prototype[1],
                        "standard_errors": row.standard_errors,
                    }
                    if row.prototype
                    else {}
                ),
                **({"low": row.exact.low, "high": row.exact.high} if row.exact else {}),
            }
            for row in reproduced.rows()
        ],
        "mean_absolute_error": reproduced.mean_errors(),
        "claims": [
            {
                "claim": claim.claim.text,
                "source": claim.claim.source or None,
                "verdict": claim.verdict,
                "holds_in_print": claim.in_print,
                "figures": [figure_as_json(figure) for figure in claim.figures],
            }
            for claim in judged
        ],
        **premises_as_json(reproduced),
        "remarks": list(reproduced.reproduction.remarks),
        **further_as_json(reproduced),
    }


def premises_as_json(reproduced: Reproduced) -> dict[str, Any]:
    """The mean errors and the verdicts of all claims, for each other premise."""
    if not reproduced.premises:
        return {}
    return {
        "premises": [
            {
                "premise": premise,
                "mean_absolute_error": reproduced.mean_errors(premise),
                "claims": {one.claim.text: one.verdict for one in reproduced.judged(premise)},
            }
            for premise in reproduced.premises
        ]
    }


def further_as_json(reproduced: Reproduced) -> dict[str, Any]:
    """The results of a reproduction other than tables."""
    further = reproduced.reproduction.further
    return {one.name: one.data for one in further(reproduced)} if further is not None else {}


def figure_as_json(figure: Judged) -> dict[str, Any]:
    """A figure of a claim; missing bounds are null."""
    wanted = figure.figure
    return {
        "figure": wanted.label,
        "value": figure.value,
        "low": figure.low,
        "high": figure.high,
        "at_least": None if math.isinf(wanted.at_least) else wanted.at_least,
        "at_most": None if math.isinf(wanted.at_most) else wanted.at_most,
        "why": wanted.why or None,
        "printed": figure.printed,
        "runs": figure.runs,
        "repetition": figure.what,
        "otherwise": figure.otherwise,
        "verdict": figure.verdict,
    }
