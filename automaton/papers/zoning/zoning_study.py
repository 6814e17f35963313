"""Table 5 and Figure 5 of Keith & La: zones of a factory that are redesigned, centrally or not."""

from __future__ import annotations

import math
import textwrap
from dataclasses import replace
from statistics import fmean, variance
from typing import Any, Final

from automaton.papers.reproduction_study import Further, Reproduced, Reproduction, Table
from automaton.papers.scenario_runs import conduct_all
from automaton.papers.zoning.zoning_cases import (
    REFERENCE,
    all_cases,
    judged_cases,
    printed,
    single_cases,
    unprinted,
)
from automaton.papers.zoning.zoning_claims import CLAIMS, REMARKS
from automaton.papers.zoning.zoning_curves import as_data, curve_text, curves
from automaton.papers.zoning.zoning_evenness import SIGMA, all_evenness, evenness_text, together
from automaton.papers.zoning.zoning_runs import completed, travelled

PANELS: Final = (
    ("hours", "mean_ft", "sigma_ft"),
    ("in_balance", "redesigns", "load_shares", "parts"),
)
COMPARED: Final = {"hours": 2, "mean_ft": 0, "sigma_ft": 0, "redesigns": 1}  # digits
WHY: Final = (
    "That program goes by seconds and events: legs are rounded to whole seconds, and nobody is on a "
    "grid; here a tick is the 0.635 s of a cell, a pick or a drop 4 ticks and up to 8 more. Where zones "
    "are fixed without sharing that makes about half a second for each leg of the busiest robot. Zones "
    "that are redesigned are a random walk in which any second leads to other zones: only means over "
    "many runs can be compared, and its means are from few runs (+-: 95 % interval of the difference). "
    "SA and GA drive a little less here, for which we know no cause."
)


def beside_reference(made: Reproduced) -> list[dict[str, Any]]:
    """Our means minus those of the other program, with 95 % intervals (Welch)."""
    samples = made.samples()
    found = []
    for name, reference in REFERENCE.items():
        for metric in COMPARED:
            ours = samples.get((metric, (name,)))
            if ours is None or len(ours) < 2:
                continue
            mean, sd = getattr(reference, metric)
            own = fmean(ours)
            error = math.sqrt(variance(ours, own) / len(ours) + sd**2 / reference.runs)
            found.append(
                {
                    "configuration": name,
                    "metric": metric,
                    "reference": mean,
                    "difference": own - mean,
                    "half_width": 2.0 * error,
                }
            )
    return found


def reference_text(found: list[dict[str, Any]]) -> str:
    """A line for each configuration."""
    by = {(row["configuration"], row["metric"]): row for row in found}
    lines = ["".join([f"{'configuration':<27}", *(f"{metric:>17}" for metric in COMPARED)])]
    for name in dict.fromkeys(row["configuration"] for row in found):
        cells = [f"{name:<27}"]
        for metric, digits in COMPARED.items():
            row = by.get((name, metric))
            if row is None:
                cells.append(" " * 17)
                continue
            text = f"{row['difference']:+,.{digits}f} +-{row['half_width']:,.{digits}f}"
            cells.append(f"{text:>17}")
        lines.append("".join(cells).rstrip())
    return "\n".join(lines)


def further(made: Reproduced) -> list[Further]:
    """Figure 5, how evenly robots drive in pairs of runs, and the other program."""
    drawn, pairs, beside = curves(made), all_evenness(made), beside_reference(made)
    found = [
        Further(
            "figure_5",
            "Figure 5: finished parts (- 5 to 95 % of our runs, o median, x printed, * both)",
            "\n\n".join(f"{one.name}\n{curve_text(one)}" for one in drawn),
            as_data(drawn),
        ),
        Further(
            "smaller_sigma",
            "Who drives more evenly",
            evenness_text(pairs),
            [pair._asdict() for pair in pairs],
        ),
        Further(
            "reference",
            "Beside an independent program of the same rules (our mean minus its)",
            f"{reference_text(beside)}\n{textwrap.fill(WHY, 80)}",
            beside,
        ),
    ]
    return [one for one in found if one.data]


TABLE_5: Final = Table(
    name="table5",
    title="Table 5, and what else there is (hours to the last work done; feet driven)",
    cases=all_cases,
    panels=PANELS,
    shares=("in_balance",),
    published=printed,
    run=conduct_all(completed),
    digits=2,
    seeds=100,
    ranked=True,
)

REPRODUCTION: Final = Reproduction(
    name="zoning",
    title="Zones of a factory, redesigned by annealing, breeding and negotiation",
    source="S. Keith & H. M. La, Dynamic Zoning of Industrial Environments with Autonomous Mobile "
    "Robots: Table 5 and Figure 5, one run each; 100 parts, 18 stations, 3 robots",
    strategies=(),
    tables=(
        TABLE_5,
        Table(
            name="claim",
            title="How evenly robots drive, in more runs",
            cases=judged_cases,
            panels=((SIGMA,),),
            published=unprinted,
            run=conduct_all(travelled),
            seeds=400,
            ranked=True,
            grouped=0,
            together=together,
        ),
        replace(
            TABLE_5,
            name="lanes",
            title="A cell of an aisle holds one robot",
            cases=single_cases,
            published=unprinted,
            seeds=40,
            grouped=0,
            usual=False,
        ),
    ),
    averaged=(),
    claims=CLAIMS,
    remarks=REMARKS,
    seeds=100,
    claims_title="The publication's claims",
    further=further,
)
