"""The report of a reproduction: a first screen, or all tables beside ours with claims and remarks.

The first screen shows printed numbers, ours and verdicts in 24 lines of 80 columns; `--tables` prints
everything.
"""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from automaton.documents.report_document import (
    Block,
    Heading,
    Listed,
    ReportDocument,
    StyledText,
    Table,
    Text,
)
from automaton.papers.claims import Judged, JudgedClaim, Verdict
from automaton.papers.reproduction_study import (
    FigureRow,
    Headline,
    MadeTable,
    PublishedTable,
    Reproduced,
)
from automaton.units import count, percent

STYLES = {
    "holds": "green", "not contradicted": "cyan", "undecided": "yellow", "does not hold": "red"
}  # fmt: skip
SHORT_LABELS = {"configuration": "cfg", "robots": "N"}
PRINTED_SD = "(sd)"
DIFFERENCE = "diff/se"
EXPLANATION = (
    "A claim holds if the 95 % interval of each of its quantities lies in the range. It does not hold "
    "if one interval lies outside; otherwise it is undecided. If all runs agree, the claim is not "
    "contradicted or does not hold, and a 95 % bound on exceptions is given (Clopper-Pearson). The "
    "deciding quantity is shown."
)
SHORTENED_TO = 150  # characters on the first screen: two lines of 80 columns
UNITS = {"%": " %", "points": " pt"}  # pt: percentage points
COUNTED: dict[Verdict, tuple[str, str]] = {
    "holds": ("holds", "hold"),
    "not contradicted": ("is not contradicted", "are not contradicted"),
    "undecided": ("is undecided", "are undecided"),
    "does not hold": ("does not hold", "do not hold"),
}

Line = tuple[str, str, str, str, str]  # label, printed, ours, ours under the other premise, verdict


def first_screen(reproduced: Reproduced, judged: Sequence[JudgedClaim]) -> ReportDocument:
    """The first screen: effort, a line for each headline, and the numbers of verdicts."""
    reproduction = reproduced.reproduction
    document = ReportDocument(reproduction.title, [Heading(reproduction.title, 3)])
    lines = [shortened(reproduction.source), effort_of_all(reproduced), *set_lines(reproduced)]
    document.add(Listed(lines, mark=""))
    others = {premise: reproduced.judged(premise) for premise in reproduced.premises}
    figures = list(headline_lines(reproduced, judged, others))
    document.add(*([table_of(reproduced, figures)] if figures else []))
    changed = (
        shortened(changed_verdicts(reproduction.headlines, judged, claims, premise))
        for premise, claims in others.items()
    )
    more = f"All tables, claims and remarks: automaton reproduce {reproduction.name} --tables"
    document.add(Listed([tally(judged), *changed, more], mark=""))
    return document


def shortened(text: str) -> str:
    """The text, cut off if it is too long for the first screen."""
    return textwrap.shorten(text, SHORTENED_TO, placeholder=" ...")


def effort_of_all(reproduced: Reproduced) -> str:
    """The numbers of runs and seeds."""
    seeds = sorted({one.seeds for one in reproduced.tables if one.table.stored is None})
    many = count(seeds[0], "seed") if len(seeds) == 1 else f"{seeds[0]:,} to {seeds[-1]:,} seeds"
    begin = f" from {reproduced.first_seed:,}" if reproduced.first_seed > 1 else ""
    kinds = {one.table.repetition for one in reproduced.tables if one.table.stored is None}
    what = kinds.pop() if len(kinds) == 1 else "repetition"
    runs = f"{count(reproduced.repetitions, what)}, {reproduced.unfinished:,} unfinished"
    return f"{runs}; {many}{begin}; ours: mean and 95 % interval"


def headline_lines(
    reproduced: Reproduced, judged: Sequence[JudgedClaim], others: dict[str, list[JudgedClaim]]
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
            yield headline.label, beside_ours, interval_around(figure), theirs, claim.verdict


def named(judged: Sequence[JudgedClaim], headline: Headline) -> JudgedClaim | None:
    """The claim of a headline; None if its cases were not run."""
    return next((one for one in judged if one.claim.text.startswith(headline.claim)), None)


def of_cell(headline: Headline, row: FigureRow) -> Line:
    """The line of a cell of a table, with the relative error instead of a verdict."""

    def shown(value: float) -> str:
        scaled = 100 * value if headline.unit == "%" else value
        return f"{scaled:,.{headline.digits}f}"

    unit = f" {headline.unit}" if headline.unit else ""
    ends = (row.exact.low, row.exact.high) if row.exact is not None else None
    if ends is None and row.half_width:
        ends = row.mean - row.half_width, row.mean + row.half_width
    paper = "-" if row.paper is None else shown(row.paper) + unit
    error = "" if row.error is None else f"error {100 * row.error:+.1f} %"
    if row.standard_errors is not None:
        error = f"prototype {row.standard_errors:+.1f} se"
    return headline.label, paper, with_ends(shown, row.mean, ends) + unit, "-", error


def with_ends(
    shown: Callable[[float], str], value: float, ends: tuple[float | None, float | None] | None
) -> str:
    """A value with its 95 % interval: the half-width if it is symmetric, else its ends.

    Ends are whole numbers, since they belong to a share of runs.
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


def interval_around(figure: Judged) -> str:
    """Our value with its interval, if this has a width."""
    ends = figure.low, figure.high
    unit = UNITS.get(figure.figure.unit, "")
    return with_ends(lambda value: bare(figure, value), figure.value, ends) + unit


def table_of(reproduced: Reproduced, lines: Sequence[Line]) -> Table:
    """The table of the first screen, with a column for another premise if there is one."""
    premises = reproduced.premises
    if not premises:
        head = ["figure", "printed", "ours", "verdict"]
        return Table(head, [[*line[:3], line[4]] for line in lines], also_left=(3,))
    # For example `orders`, from `information: orders`.
    own = [premise.partition(": ")[2] for premise in (reproduced.reproduction.premise, premises[0])]
    return Table(["figure", "printed", *own, "verdict"], lines, also_left=(4,))


def tally(judged: Sequence[JudgedClaim]) -> str:
    """The number of claims with each verdict, in a sentence."""
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
    """The headlines whose verdicts differ under another premise, in a sentence."""
    verdicts = {one.claim.text: one.verdict for one in others}
    changed = []
    for headline in headlines:
        claim = named(judged, headline) if headline.claim else None
        theirs = verdicts.get(claim.claim.text) if claim is not None else None
        if claim is not None and theirs not in (None, claim.verdict):
            changed.append(f"{headline.label} ({theirs})")
    return f"Other verdicts with {premise}: {'; '.join(changed) or 'none of these'}."


# All tables, all claims and the remarks.


def whole_report(reproduced: Reproduced, judged: Sequence[JudgedClaim]) -> ReportDocument:
    """Everything."""
    reproduction = reproduced.reproduction
    document = ReportDocument(reproduction.title, [Heading(reproduction.title, 3)])
    document.add(Listed([reproduction.source, *set_lines(reproduced)], mark=""))
    for made in reproduced.tables:
        if made.cases:  # empty if its strategy was not chosen
            document.add(*made_blocks(made))
    if reproduction.further is not None:
        for one in reproduction.further(reproduced):
            document.add(Heading(one.title, 3), Text(one.text, code=True))
    document.add(Listed(error_lines(reproduced), mark=""))
    document.add(*claim_blocks(reproduction.claims_title, judged))
    for premise in reproduced.premises:
        document.add(*premise_blocks(reproduced, judged, premise))
    if reproduction.remarks:
        document.add(Heading(reproduction.remarks_title, 3), Listed(reproduction.remarks))
    for title, text in reproduction.texts() if reproduction.texts is not None else ():
        document.add(Heading(title, 3), Text(text, code=True))
    return document


def set_lines(reproduced: Reproduced) -> list[str]:
    """A warning that states changed settings of the scenarios, if any."""
    if not reproduced.settings:
        return []
    settings = " ".join(f"--set {setting}" for setting in reproduced.settings)
    return [f"NOT THE PUBLISHED EXPERIMENT: made with {settings}"]


def made_blocks(made: MadeTable) -> Iterator[Block]:
    """A table: its effort, then its panels."""
    if made.table.title:
        yield Heading(made.table.title, 3)
    yield Text(effort(made))
    rows = made.rows()
    for panel in made.table.panels:
        yield panel_table(panel, rows, made.table)


def effort(made: MadeTable) -> str:
    """The numbers of runs and seeds of a table, and the basis of means and spreads."""
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


def panel_table(
    metrics: Sequence[str], rows: Sequence[FigureRow], made_of: PublishedTable
) -> Table:
    """A line for each case; for each metric the printed figure, ours, sd and relative error."""
    end = -1 if made_of.premise else None  # the title states the premise
    labels = dict(list(rows[0].case.items())[:end])
    printed = {row.metric for row in rows if row.paper is not None}
    exact = {row.metric for row in rows if row.exact is not None}
    deviations = {row.metric for row in rows if row.paper_sd is not None}
    columns = {
        name: heads_of(made_of, name in printed, name in exact, name in deviations)
        for name in metrics
    }
    for name in {row.metric for row in rows if row.prototype is not None} & columns.keys():
        columns[name] += ["prototype", DIFFERENCE]
    head = [SHORT_LABELS.get(label, label) for label in labels]
    head += [name for heads in columns.values() for name in heads]
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
    groups = [(metric, len(heads)) for metric, heads in columns.items()]
    return Table(head, lines, left=0, also_left=left, groups=groups)


def heads_of(table: PublishedTable, printed: bool, exact: bool, deviation: bool) -> list[str]:
    """The columns of a metric: a stored figure has no spread, an exact share has its interval.

    `deviation`: whether the paper prints a standard deviation with the mean.
    """
    spread = "95 %" if exact else table.spread
    heads = ["paper", "ours", spread, "error"] if printed else ["ours", spread]
    if deviation:
        heads.insert(1, PRINTED_SD)
    if table.ranked:
        heads = ["paper", "rank", "ours", "95 %", spread] if printed else ["ours", "95 %", spread]
        heads = list(dict.fromkeys(heads))
    return heads if table.stored is None else ["paper", "stored"] if printed else ["stored"]


def cases_of(rows: Sequence[FigureRow]) -> Iterator[dict[str, FigureRow]]:
    """The rows of each case by metric."""
    found: dict[tuple[Any, ...], dict[str, FigureRow]] = {}
    for row in rows:
        found.setdefault(tuple(row.case.values()), {})[row.metric] = row
    yield from found.values()


def figures(row: FigureRow | None, heads: Sequence[str], table: PublishedTable) -> list[str]:
    """The cells of a metric; blank if the case does not have it."""
    if row is None:
        return [""] * len(heads)
    error = "-" if row.error is None else f"{100 * row.error:+.1f} %"
    cells = {"paper": row.paper, "ours": row.mean, "sd": row.sd, "se": row.se, "stored": row.mean}
    cells[PRINTED_SD] = row.paper_sd
    cells["prototype"] = None if row.prototype is None else row.prototype[0]
    difference = "-" if row.standard_errors is None else f"{row.standard_errors:+.1f}"
    rank = "" if row.rank is None else percent(row.rank, 0)
    shown = {
        head: "-" if value is None else in_table(value, row.metric, table)
        for head, value in cells.items()
    }
    shown |= {"error": error, "95 %": around(row, table), "rank": rank, DIFFERENCE: difference}
    return [shown[head] for head in heads]


def around(row: FigureRow, table: PublishedTable) -> str:
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
    return lines


def premise_blocks(
    reproduced: Reproduced, judged: Sequence[JudgedClaim], premise: str
) -> tuple[Heading, Listed]:
    """The claims whose verdicts differ under another premise."""
    own = {claim.claim.text: claim.verdict for claim in judged}
    changed = [one for one in reproduced.judged(premise) if own.get(one.claim.text) != one.verdict]
    lines = [f"{one.verdict}: {one.claim.text}; {evidence(one)}" for one in changed]
    title = Heading(f"Claims with another verdict under {premise}", 3)
    return title, Listed(lines) if lines else Listed(["none"], mark="")


def claim_blocks(title: str, judged: Sequence[JudgedClaim]) -> Iterator[Block]:
    """A verdict for each claim, with the figure that decides it."""
    if not judged:
        return
    yield Heading(title, 3)
    yield Text(EXPLANATION)
    rows: list[list[str]] = []
    for claim in judged:
        quoted = f'"{claim.claim.source}"' if claim.claim.source else ""
        lines = filter(None, (claim.claim.text, quoted, evidence(claim)))
        rows += [[], [StyledText(claim.verdict, STYLES[claim.verdict]), "\n".join(lines)]]
    yield Table(("", ""), rows[1:], left=2)


def evidence(claim: JudgedClaim) -> str:
    """The deciding figure of a claim, its range, and the value from the publication's own table."""
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
    """The deciding figure: of those with the worst verdict, the one farthest from its range."""
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
    """The reason for the bounds of the range, in brackets."""
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
    """The end of a range in words; 0 has neither digits nor unit, unless it is a share."""
    return "0" if value == 0 and figure.figure.unit != "%" else shown(figure, value)
