"""A reproduction as text: the published table beside ours, the claims, the remarks."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.text import Text

from automaton.papers.claims import Judged, JudgedClaim
from automaton.papers.reproduction_study import MadeTable, Reproduced, Row
from automaton.papers.reproduction_study import Table as PublishedTable
from automaton.runs.console_output import ConsoleBlock, console, print_blocks, rich_table
from automaton.runs.report_document import Table
from automaton.units import count, percent

STYLES = {
    "holds": "green", "not contradicted": "cyan", "undecided": "yellow", "does not hold": "red"
}  # fmt: skip
SHORT = {"configuration": "cfg", "robots": "N"}
WIDEST_TEXT = 110
VERDICT_WIDTH = 18
PRINTED_SD = "(sd)"
EXPLANATION = (
    "A claim holds if the 95 % interval of each of its figures lies in the range, and does not "
    "hold if one lies outside; else it is undecided. What came out alike in all runs is not "
    "contradicted, or does not hold, and how many runs may be otherwise is said "
    "(Clopper-Pearson). Shown is the figure that decides."
)


def print_reproduced(reproduced: Reproduced, judged: Sequence[JudgedClaim]) -> None:
    """Print everything."""
    out = console()
    print_blocks(out, blocks(reproduced, judged, out.width))


def blocks(
    reproduced: Reproduced, judged: Sequence[JudgedClaim], width: int
) -> Iterator[ConsoleBlock]:
    """Everything, for a console of this width."""
    reproduction, text_width = reproduced.reproduction, min(width, WIDEST_TEXT)
    yield Text(reproduction.title, "bold")
    yield from textwrap.wrap(reproduction.source, text_width)
    yield from set_lines(reproduced, text_width)
    for made in reproduced.tables:
        if made.cases:  # none where its strategy was not asked for
            yield from made_blocks(made, width)
    if reproduction.further is not None:
        for one in reproduction.further(reproduced):
            yield from section(one.title, one.text.splitlines())
    yield from error_lines(reproduced)
    yield from claim_blocks(reproduction.claims_title, judged, text_width)
    for premise in reproduced.premises:
        yield from premise_blocks(reproduced, judged, premise, text_width)
    if reproduction.remarks:
        bullets = (bulleted(remark, text_width) for remark in reproduction.remarks)
        lines = (line for bullet in bullets for line in bullet)
        yield from section(reproduction.remarks_title, lines)
    for title, text in reproduction.texts() if reproduction.texts is not None else ():
        yield from section(title, text.splitlines())


def set_lines(reproduced: Reproduced, width: int) -> list[str]:
    """Say that scenarios were changed, and how."""
    if not reproduced.settings:
        return []
    settings = " ".join(f"--set {setting}" for setting in reproduced.settings)
    text = f"NOT THE PUBLISHED EXPERIMENT: made with {settings}"
    return textwrap.wrap(text, width, break_on_hyphens=False)


def section(title: str, lines: Iterable[str]) -> Iterator[ConsoleBlock]:
    """Lines under a title, as they are."""
    yield ""
    yield Text(title, "bold")
    yield from lines


def bulleted(text: str, width: int) -> list[str]:
    """A sentence as an item of a list."""
    return textwrap.wrap(text, width, initial_indent="- ", subsequent_indent="  ")


def made_blocks(made: MadeTable, width: int) -> Iterator[ConsoleBlock]:
    """A table: what was run for it, then its panels."""
    if made.table.title:
        yield from section(made.table.title, ())
    yield from textwrap.wrap(effort(made), min(width, WIDEST_TEXT))
    rows = made.rows()
    for panel in made.table.panels:
        for metrics in fitting(panel, rows, width, made.table):
            yield ""
            yield panel_table(metrics, rows, made.table)


def effort(made: MadeTable) -> str:
    """How much was run, and what means and spreads are taken over."""
    if made.table.stored is not None:
        return made.table.stored()
    what, each, spread = made.table.repetition, made.table.per_seed, made.table.spread
    repeated = f" of {count(each, what)}" if each > 1 else ""
    seeds = f"{count(len(made.results[0]) // each, 'seed')}"
    seeds += f" from {made.first_seed:,}" if made.first_seed > 1 else ""
    return (
        f"{count(made.repetitions, what)}, {made.unfinished} unfinished; {seeds}"
        f"{repeated} for each case; mean and {spread} over the {what + 's' if each > 1 else 'seeds'}"
    )


def fitting(
    panel: Sequence[str], rows: Sequence[Row], width: int, table: PublishedTable
) -> Iterator[list[str]]:
    """The metrics of a panel, split so that each table fits the width."""
    taken: list[str] = []
    for metric in panel:
        if taken and table_width([*taken, metric], rows, table) > width:
            yield taken
            taken = []
        taken.append(metric)
    yield taken


def table_width(metrics: Sequence[str], rows: Sequence[Row], table: PublishedTable) -> int:
    measured = Console(width=1000).measure(rich_table(panel_table(metrics, rows, table)))
    return int(measured.maximum)


def panel_table(metrics: Sequence[str], rows: Sequence[Row], made_of: PublishedTable) -> Table:
    """A line for each case; for each metric the printed figure, ours, sd and relative error."""
    end = -1 if made_of.premise else None  # the title says it
    labels = dict(list(rows[0].case.items())[:end])
    printed = {row.metric for row in rows if row.paper is not None}
    exact = {row.metric for row in rows if row.exact is not None}
    deviations = {row.metric for row in rows if row.paper_sd is not None}
    columns = {
        name: heads_of(made_of, name in printed, name in exact, name in deviations)
        for name in metrics
    }
    head = [f"\n{SHORT.get(label, label)}" for label in labels]
    for metric, (first, *others) in columns.items():
        head += [f"  {metric}\n  {first}", *(f"\n{other}" for other in others)]
    lines: list[list[str]] = []
    group: list[str] = []
    for figures_of in cases_of(rows):
        cells = [str(value) for value in next(iter(figures_of.values())).case.values()][:end]
        before, group = group, cells[: made_of.grouped]
        if before and before != group:
            lines.append([])
        for metric, heads in columns.items():
            cells += figures(figures_of.get(metric), heads, made_of)
        lines.append(cells)
    left = [index for index, value in enumerate(labels.values()) if isinstance(value, str)]
    return Table(head, lines, left=0, also_left=left, gap=1)


def heads_of(table: PublishedTable, printed: bool, exact: bool, deviation: bool) -> list[str]:
    """The columns of a metric; a stored figure has no spread, an exact share its interval.

    `deviation`: a standard deviation is printed beside the printed mean.
    """
    spread = "95 %" if exact else table.spread
    heads = ["paper", "ours", spread, "error"] if printed else ["ours", spread]
    if deviation:
        heads.insert(1, PRINTED_SD)
    if table.ranked:
        heads = ["paper", "rank", "ours", "95 %", spread] if printed else ["ours", "95 %", spread]
        heads = list(dict.fromkeys(heads))
    return heads if table.stored is None else ["paper", "stored"] if printed else ["stored"]


def cases_of(rows: Sequence[Row]) -> Iterator[dict[str, Row]]:
    """The rows of each case by metric."""
    found: dict[tuple[Any, ...], dict[str, Row]] = {}
    for row in rows:
        found.setdefault(tuple(row.case.values()), {})[row.metric] = row
    yield from found.values()


def figures(row: Row | None, heads: Sequence[str], table: PublishedTable) -> list[str]:
    """The cells of a metric; blank where a case does not have it."""
    if row is None:
        return [""] * len(heads)
    error = "-" if row.error is None else f"{100 * row.error:+.1f} %"
    cells = {"paper": row.paper, "ours": row.mean, "sd": row.sd, "se": row.se, "stored": row.mean}
    cells[PRINTED_SD] = row.paper_sd
    rank = "" if row.rank is None else percent(row.rank, 0)
    shown = {
        head: "-" if value is None else in_table(value, row.metric, table)
        for head, value in cells.items()
    }
    return [(shown | {"error": error, "95 %": around(row, table), "rank": rank})[h] for h in heads]


def around(row: Row, table: PublishedTable) -> str:
    """The 95 % interval of a mean."""
    if row.exact is not None and row.exact.low is not None and row.exact.high is not None:
        return f"{100 * row.exact.low:.1f} to {100 * row.exact.high:.1f} %"
    return "-" if row.half_width is None else f"+-{in_table(row.half_width, row.metric, table)}"


def in_table(value: float, metric: str, table: PublishedTable) -> str:
    return percent(value) if metric in table.shares else f"{value:,.{table.digits}f}"


def error_lines(reproduced: Reproduced) -> list[str]:
    """The mean relative error of each metric."""
    lines = []
    for premise in ("", *reproduced.premises):
        parts = [
            f"{metric} {percent(error)}"
            for metric, error in reproduced.mean_errors(premise).items()
            if error is not None
        ]
        shown = premise or (reproduced.reproduction.premise if reproduced.premises else "")
        if parts:
            lines.append(f"mean |error|: {', '.join(parts)}{f' ({shown})' if shown else ''}")
    return ["", *lines] if lines else []


def premise_blocks(
    reproduced: Reproduced, judged: Sequence[JudgedClaim], premise: str, width: int
) -> Iterator[ConsoleBlock]:
    """The claims that come to another verdict by another premise."""
    own = {claim.claim.text: claim.verdict for claim in judged}
    changed = [one for one in reproduced.judged(premise) if own.get(one.claim.text) != one.verdict]
    yield from section(f"Claims with another verdict by {premise}", ())
    for claim in changed:
        yield from bulleted(f"{claim.verdict}: {claim.claim.text}; {evidence(claim)}", width)
    if not changed:
        yield "none"


def claim_blocks(title: str, judged: Sequence[JudgedClaim], width: int) -> Iterator[ConsoleBlock]:
    """A verdict for each claim, with the figure that decides it."""
    if not judged:
        return
    yield from section(title, textwrap.wrap(EXPLANATION, width))
    for claim in judged:
        yield ""
        quoted = f'"{claim.claim.source}"' if claim.claim.source else ""
        first, *others = (
            line
            for text in (claim.claim.text, quoted, evidence(claim))
            for line in textwrap.wrap(text, width - VERDICT_WIDTH)
        )
        yield Text(f"{claim.verdict:<{VERDICT_WIDTH}}", STYLES[claim.verdict]).append(
            first, "default"
        )
        yield from (" " * VERDICT_WIDTH + line for line in others)


def evidence(claim: JudgedClaim) -> str:
    """The deciding figure of a claim, its range, and what the publication's own table says."""
    figure = deciding(claim)
    most = len(claim.figures)
    good = sum(one.verdict == "holds" for one in claim.figures)
    of_all = f" ({good} of {most} figures hold)" if most > 1 else ""
    if most > 1 and claim.verdict == "not contradicted":
        of_all = f" (none of {most} figures is contradicted)"
    parts = [
        f"{figure.figure.label}: {valued(figure)}, needed {bounds(figure)}{reason(figure)}{of_all}"
    ]
    bounded = claim.verdict == "not contradicted" or figure.low is None
    if bounded and figure.otherwise is not None:
        parts.insert(0, f"at most {100 * figure.otherwise:.1f} % of {figure.what}s (95 %)")
    if figure.printed is not None:
        in_print = figure.in_print if claim.in_print is None else claim.in_print
        agrees = "agrees" if in_print else "DISAGREES"
        parts.append(f"the paper's own table: {shown(figure, figure.printed)}, {agrees}")
    return "; ".join(parts)


def deciding(claim: JudgedClaim) -> Judged:
    """The figure on which the verdict hangs: of the worst verdict, the farthest from its range."""
    worst = [figure for figure in claim.figures if figure.verdict == claim.verdict]
    return min(worst, key=lambda figure: (figure.margin, figure.runs))


def shown(figure: Judged, value: float) -> str:
    unit = figure.figure.unit
    return f"{100 * value:,.1f} {unit}" if unit else f"{value:,.{figure.figure.digits}f}"


def valued(figure: Judged) -> str:
    if figure.low is None or figure.high is None:
        alike = f"in all {count(figure.runs, figure.what)}"
        why = alike if figure.alike else f"one {figure.what} gives no interval"
        return f"{shown(figure, figure.value)} ({why})"
    low, high = shown(figure, figure.low), shown(figure, figure.high)
    return f"{shown(figure, figure.value)} ({low} to {high})"


def reason(figure: Judged) -> str:
    """Why the range ends where it does."""
    return f" ({figure.figure.why})" if figure.figure.why else ""


def bounds(figure: Judged) -> str:
    """The range of a figure in words."""
    low, high = figure.figure.at_least, figure.figure.at_most
    if low > float("-inf") and high < float("inf"):
        return f"{shown(figure, low)} to {shown(figure, high)}"
    if low > float("-inf"):
        return f"{'above' if figure.figure.strict else 'at least'} {end(figure, low)}"
    return f"{'below' if figure.figure.strict else 'at most'} {end(figure, high)}"


def end(figure: Judged, value: float) -> str:
    """The end of a range; 0 needs neither digits nor unit, unless it is a share."""
    return "0" if value == 0 and figure.figure.unit != "%" else shown(figure, value)
