"""A reproduction as text: the published table beside ours, the claims, the remarks."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from automaton.papers.claims import Judged, JudgedClaim
from automaton.papers.reproduction_study import MadeTable, Reproduced, Row
from automaton.papers.reproduction_study import Table as PublishedTable
from automaton.runs.run_report import console, print_table
from automaton.units import count, percent

STYLES = {
    "holds": "green", "not contradicted": "cyan", "undecided": "yellow", "does not hold": "red"
}  # fmt: skip
SHORT = {"configuration": "cfg", "robots": "N"}
WIDEST_TEXT = 110


def print_reproduced(reproduced: Reproduced, judged: Sequence[JudgedClaim]) -> None:
    """Print everything."""
    out = console()
    reproduction = reproduced.reproduction
    out.print(Text(reproduction.title, "bold"), soft_wrap=True)
    for line in textwrap.wrap(reproduction.source, text_width(out)):
        out.print(line, soft_wrap=True)
    for made in reproduced.tables:
        if made.cases:  # none where its strategy was not asked for
            print_made(out, made)
    if reproduction.further is not None:
        print_texts(out, [(one.title, one.text) for one in reproduction.further(reproduced)])
    print_errors(out, reproduced)
    print_claims(out, reproduction.claims_title, judged)
    print_remarks(out, reproduction.remarks_title, reproduction.remarks)
    print_texts(out, reproduction.texts() if reproduction.texts is not None else ())


def print_made(out: Console, made: MadeTable) -> None:
    """Print a table: what was run for it, then its panels."""
    if made.table.title:
        out.print()
        out.print(Text(made.table.title, "bold"), soft_wrap=True)
    for line in textwrap.wrap(effort(made), text_width(out)):
        out.print(line, soft_wrap=True)
    rows = made.rows()
    for panel in made.table.panels:
        for metrics in fitting(panel, rows, out.width, made.table):
            out.print()
            print_table(out, panel_table(metrics, rows, made.table))


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


def text_width(out: Console) -> int:
    return min(out.width, WIDEST_TEXT)


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
    measured: int = Console(width=1000).measure(panel_table(metrics, rows, table)).maximum
    return measured


def panel_table(metrics: Sequence[str], rows: Sequence[Row], made_of: PublishedTable) -> Table:
    """A line for each case; for each metric the printed figure, ours, sd and relative error."""
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold underline")
    for label, value in rows[0].case.items():
        justify: Any = "left" if isinstance(value, str) else "right"
        table.add_column(f"\n{SHORT.get(label, label)}", justify=justify, no_wrap=True)
    printed = {row.metric for row in rows if row.paper is not None}
    exact = {row.metric for row in rows if row.exact is not None}
    for metric in metrics:
        heads = heads_of(made_of, metric in printed, metric in exact)
        first, *others = heads
        table.add_column(f"  {metric}\n  {first}", justify="right", no_wrap=True)
        for head in others:
            table.add_column(f"\n{head}", justify="right", no_wrap=True)
    group: list[str] = []
    for lines in cases_of(rows):
        cells = [str(value) for value in next(iter(lines.values())).case.values()]
        before, group = group, cells[: made_of.grouped]
        if before and before != group:
            table.add_row()
        for metric in metrics:
            heads = heads_of(made_of, metric in printed, metric in exact)
            cells += figures(lines.get(metric), heads, made_of)
        table.add_row(*cells)
    return table


def heads_of(table: PublishedTable, printed: bool, exact: bool) -> list[str]:
    """The columns of a metric; a stored figure has no spread, an exact share its interval."""
    spread = "95 %" if exact else table.spread
    heads = ["paper", "ours", spread, "error"] if printed else ["ours", spread]
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


def print_errors(out: Console, reproduced: Reproduced) -> None:
    """The mean relative error of each metric."""
    parts = [
        f"{metric} {percent(error)}"
        for metric, error in reproduced.mean_errors().items()
        if error is not None
    ]
    if parts:
        out.print()
        out.print(f"mean |error|: {', '.join(parts)}", soft_wrap=True)


def print_claims(out: Console, title: str, judged: Sequence[JudgedClaim]) -> None:
    """A verdict for each claim, with the figure that decides it."""
    if not judged:
        return
    out.print()
    out.print(Text(title, "bold"))
    explanation = (
        "A claim holds if the 95 % interval of each of its figures lies in the range, and does not "
        "hold if one lies outside; else it is undecided. What came out alike in all runs is not "
        "contradicted, or does not hold, and how many runs may be otherwise is said "
        "(Clopper-Pearson). Shown is the figure that decides."
    )
    for line in textwrap.wrap(explanation, text_width(out)):
        out.print(line)
    indent = " " * 18
    for claim in judged:
        out.print()
        first, *others = textwrap.wrap(claim.claim.text, text_width(out) - len(indent))
        head = Text(f"{claim.verdict:<18}", STYLES[claim.verdict])
        out.print(head.append(first, "default"), soft_wrap=True)
        quoted = f'"{claim.claim.source}"' if claim.claim.source else ""
        texts = (quoted, evidence(claim))
        more = [
            line for text in texts for line in textwrap.wrap(text, text_width(out) - len(indent))
        ]
        for line in (*others, *more):
            out.print(indent + line, soft_wrap=True)


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


def print_remarks(out: Console, title: str, remarks: Sequence[str]) -> None:
    """A list of sentences."""
    if not remarks:
        return
    out.print()
    out.print(Text(title, "bold"))
    for remark in remarks:
        lines = textwrap.wrap(remark, text_width(out) - 2)
        for bullet, line in zip(["- ", *["  "] * len(lines)], lines, strict=False):
            out.print(bullet + line, soft_wrap=True)


def print_texts(out: Console, texts: Sequence[tuple[str, str]]) -> None:
    """Drawings and worked steps, each under its title, as they are."""
    for title, text in texts:
        out.print()
        out.print(Text(title, "bold"), soft_wrap=True)
        for line in text.splitlines():
            out.print(line, soft_wrap=True, markup=False, highlight=False)
