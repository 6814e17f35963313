"""The first screen of a reproduction: printed numbers, ours and verdicts in 24 lines of 80 columns.

Everything else (all tables, all claims, remarks) is behind `--tables`.
"""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

from rich.text import Text

from automaton.papers.claim_report import set_lines
from automaton.papers.claims import Judged, JudgedClaim, Verdict
from automaton.papers.reproduction_study import Headline, Reproduced, Row
from automaton.runs.console_output import ConsoleBlock, console, print_blocks
from automaton.runs.report_document import Table
from automaton.units import count, percent

WIDTH = 80
MAX_LINES = 2  # of a sentence
GAP = 1
UNITS = {"%": " %", "points": " pt"}  # pt: points of per cent
COUNTED: dict[Verdict, tuple[str, str]] = {
    "holds": ("holds", "hold"),
    "not contradicted": ("is not contradicted", "are not contradicted"),
    "undecided": ("is undecided", "are undecided"),
    "does not hold": ("does not hold", "do not hold"),
}

Line = tuple[str, str, str, str, str]  # label, printed, ours, ours by the other premise, verdict


def print_first_screen(reproduced: Reproduced, judged: Sequence[JudgedClaim]) -> None:
    """Print the first screen."""
    print_blocks(console(), first_screen(reproduced, judged))


def first_screen(reproduced: Reproduced, judged: Sequence[JudgedClaim]) -> Iterator[ConsoleBlock]:
    """The first screen: what was run, a line for each headline, and how many claims hold."""
    reproduction = reproduced.reproduction
    yield Text(reproduction.title, "bold")
    yield from wrapped(reproduction.source)
    yield from textwrap.wrap(effort(reproduced), WIDTH)
    yield from set_lines(reproduced, WIDTH)
    yield ""
    others = {premise: reproduced.judged(premise) for premise in reproduced.premises}
    lines = list(headline_lines(reproduced, judged, others))
    if lines:
        yield table_of(reproduced, lines)
        yield ""
    yield from textwrap.wrap(tally(judged), WIDTH)
    for premise, claims in others.items():
        changed = changed_verdicts(reproduction.headlines, judged, claims, premise)
        yield from wrapped(changed)
    yield from textwrap.wrap(
        f"All tables, claims and remarks: automaton reproduce {reproduction.name} --tables", WIDTH
    )


def wrapped(text: str) -> list[str]:
    """Two lines of a text at most."""
    return textwrap.wrap(text, WIDTH, max_lines=MAX_LINES, placeholder=" ...")


def effort(reproduced: Reproduced) -> str:
    """How much was run."""
    seeds = sorted({one.seeds for one in reproduced.tables if one.table.stored is None})
    many = count(seeds[0], "seed") if len(seeds) == 1 else f"{seeds[0]:,} to {seeds[-1]:,} seeds"
    begin = f" from {reproduced.first_seed:,}" if reproduced.first_seed > 1 else ""
    kinds = {one.table.repetition for one in reproduced.tables if one.table.stored is None}
    what = kinds.pop() if len(kinds) == 1 else "repetition"
    runs = f"{count(reproduced.repetitions, what)}, {reproduced.unfinished:,} unfinished"
    return f"{runs}; {many}{begin}; ours: mean and 95 % interval"


def headline_lines(
    reproduced: Reproduced,
    judged: Sequence[JudgedClaim],
    others: dict[str, list[JudgedClaim]],
) -> Iterator[Line]:
    """A line for each mean error and each headline that was run."""
    other = next(iter(others), "")
    beside = reproduced.mean_errors(other) if other else {}
    for metric, error in reproduced.mean_errors().items():
        if error is not None:
            value = beside.get(metric)
            yield (
                f"mean |error| of {metric}",
                "-",
                percent(error),
                "-" if value is None else percent(value),
                "",
            )
    rows = {(row.metric, tuple(row.case.values())): row for row in reproduced.rows()}
    for headline in reproduced.reproduction.headlines:
        if headline.cell is not None:
            if headline.cell in rows:
                yield of_cell(headline, rows[headline.cell])
            continue
        claim = named(judged, headline)
        if claim is not None:
            figure = claim.figures[headline.figure]
            twin = named(others.get(other, ()), headline)
            theirs = (
                "-"
                if twin is None
                else number(twin.figures[headline.figure], twin.figures[headline.figure].value)
            )
            paper = figure.printed if headline.printed is None else headline.printed
            beside_ours = "-" if paper is None else number(figure, paper)
            yield headline.label, beside_ours, around(figure), theirs, claim.verdict


def named(judged: Sequence[JudgedClaim], headline: Headline) -> JudgedClaim | None:
    """The claim of a headline; None if its cases were not run."""
    return next((one for one in judged if one.claim.text.startswith(headline.claim)), None)


def of_cell(headline: Headline, row: Row) -> Line:
    """The line of a cell of a table; in place of a verdict how far ours is from print."""

    def shown(value: float) -> str:
        scaled = 100 * value if headline.unit == "%" else value
        return f"{scaled:,.{headline.digits}f}"

    unit = f" {headline.unit}" if headline.unit else ""
    ends = (row.exact.low, row.exact.high) if row.exact is not None else None
    if ends is None and row.half_width:
        ends = row.mean - row.half_width, row.mean + row.half_width
    paper = "-" if row.paper is None else shown(row.paper) + unit
    error = "" if row.error is None else f"error {100 * row.error:+.1f} %"
    return headline.label, paper, with_ends(shown, row.mean, ends) + unit, "-", error


def with_ends(
    shown: Callable[[float], str], value: float, ends: tuple[float | None, float | None] | None
) -> str:
    """A value with its 95 % interval: half of it where both halves are alike, else its ends.

    Ends are whole numbers, for they are those of a share of runs.
    """
    low, high = ends if ends is not None else (None, None)
    if low is None or high is None or low == high:
        return shown(value)
    if math.isclose(high - value, value - low, rel_tol=1e-6):
        return f"{shown(value)} +-{shown(high - value)}"
    ends_shown = " to ".join(f"{float(shown(end).replace(',', '')):,.0f}" for end in (low, high))
    return f"{shown(value)} ({ends_shown})"


def bare(figure: Judged, value: float) -> str:
    """A value of a claim without its unit."""
    if figure.figure.unit:
        return f"{100 * value:,.1f}"
    return f"{value:,.{figure.figure.digits}f}"


def number(figure: Judged, value: float) -> str:
    """A value with its unit."""
    return bare(figure, value) + UNITS.get(figure.figure.unit, "")


def around(figure: Judged) -> str:
    """Our value and its interval, where it has one with a width."""
    ends = figure.low, figure.high
    unit = UNITS.get(figure.figure.unit, "")
    return with_ends(lambda value: bare(figure, value), figure.value, ends) + unit


def table_of(reproduced: Reproduced, lines: Sequence[Line]) -> Table:
    """The table of the first screen; with a column for another premise where there is one."""
    premises = reproduced.premises
    if not premises:
        head = ["figure", "printed", "ours", "verdict"]
        return Table(head, [[*line[:3], line[4]] for line in lines], also_left=(3,), gap=GAP)
    own = [value_of(premise) for premise in (reproduced.reproduction.premise, premises[0])]
    return Table(["figure", "printed", *own, "verdict"], lines, also_left=(4,), gap=GAP)


def value_of(premise: str) -> str:
    """`orders` of `information: orders`."""
    return premise.partition(": ")[2]


def tally(judged: Sequence[JudgedClaim]) -> str:
    """How many claims hold and do not."""
    if not judged:
        return "No claim rests on these tables."
    counts = Counter(claim.verdict for claim in judged)
    parts = [
        f"{counts[verdict]} {several if counts[verdict] > 1 else one}"
        for verdict, (one, several) in COUNTED.items()
        if counts[verdict]
    ]
    return f"{count(len(judged), 'claim')}: {', '.join(parts)}."


def changed_verdicts(
    headlines: Sequence[Headline],
    judged: Sequence[JudgedClaim],
    others: Sequence[JudgedClaim],
    premise: str,
) -> str:
    """Which headlines come to another verdict by another premise."""
    verdicts = {one.claim.text: one.verdict for one in others}
    changed = []
    for headline in headlines:
        claim = named(judged, headline) if headline.claim else None
        theirs = verdicts.get(claim.claim.text) if claim is not None else None
        if claim is not None and theirs not in (None, claim.verdict):
            changed.append(f"{headline.label} ({theirs})")
    return f"Other verdicts with {premise}: {'; '.join(changed) or 'none of these'}."
