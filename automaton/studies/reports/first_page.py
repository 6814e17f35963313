"""The first page of a report: the question, the decision, a picture, caveats, and the answer.

The decision says what to do, and follows from the answer: the best point of a study, or the points that
may be the best. Points that differ by choices, such as fleet and strategies, are compared, by the tests
of the table of comparisons. Conditions, such as orders and floor, divide a study into separate questions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

from automaton.documents.report_document import Block, Heading, Listed, NumberText, Table, Text
from automaton.studies.inference.intervals import STUDENT_MIN_RUNS, TOO_FEW
from automaton.studies.reports.comparison_tables import ADJUSTED, p_text, relative_text
from automaton.studies.reports.comparisons import (
    Answer,
    Comparison,
    condition_factors,
    direction_of,
    heads_by_factor,
    level_text,
    levels_named,
    mean_of,
    varied_columns,
    varied_factors,
)
from automaton.studies.reports.metric_tables import (
    ROBOTS_FACTOR,
    bias_text,
    interval_of,
    is_numeric,
    picture,
)
from automaton.studies.reports.study_results import PERCENT, Results, described
from automaton.studies.sweeps.study import SCENARIO_FACTOR, Point
from automaton.units import count, duration, number, percent

NEGLIGIBLE: Final = 0.05  # share by which a dearer point may be better without being worth it
MAX_NAMED: Final = 3  # points in a sentence
MAX_LEVELS_NAMED: Final = 8  # of a factor
MAX_SENTENCES: Final = 6  # answers in sentences; more appear only in the table
COSTS: Final = (ROBOTS_FACTOR, "floor.open_stations", "floor.open_chargers")  # fewer are cheaper
_WORSE: Final = {"lowest": "lower", "highest": "higher"}


# Whether the best point is at the limit of the tested range, beyond which better ones may exist.


def edge_sentences(results: Results, answer: Answer) -> Iterator[str]:
    """Suggestions for each numeric factor in which the leading point has the least or largest level."""
    leading = answer.leading
    if leading is None or answer.better is None or len(answer.compared) < 2:
        return
    study, conditions = results.study, condition_factors(results)
    what = "best" if answer.best is not None else "leading point"
    for factor in varied_factors(study):
        if factor in conditions or factor not in leading.levels or not is_numeric(results, factor):
            continue
        tried = {point.levels[factor] for point in answer.compared if factor in point.levels}
        own, low, high = leading.levels[factor], min(tried), max(tried)
        is_least = own == low and own > (1 if isinstance(own, int) else 0)  # 0 may be meaningless
        if low == high or not (own == high or is_least):
            continue
        shown = level_text(study, factor, own)
        beyond = f"{heads_by_factor(study)[factor]} {'above' if own == high else 'below'} {shown}"
        if factor == ROBOTS_FACTOR:
            beyond = f"{'more' if own == high else 'fewer'} than {shown} robots"
        yield f"The {what} is at the limit of the tested range: try {beyond}."


# The page.


def first_page(
    results: Results, answers: Sequence[Answer], notes: Sequence[str]
) -> Iterator[Block]:
    """Question, decision, the answers with their confidence, a picture, and caveats."""
    if not answers:
        yield Heading("Decision")
        yield Text("Sweep again: no run has metrics yet.", strong=True)
    else:
        yield Heading("Question")
        yield Text(question(results))
        yield Heading("Decision")
        yield from sentences(decision_lines(results, answers), strong=True)
        yield from sentences(answer_lines(results, answers))
        yield Text(certainty(results, answers))
        drawn = picture(results, answers[0].metric)
        yield from [drawn] if drawn is not None else []
    yield from caveats(notes)


def answer_section(
    results: Results, answers: Sequence[Answer], compared: Sequence[Comparison]
) -> Iterator[Block]:
    """The leading points against the baseline or the next best, in a table."""
    table = answer_table(results, answers, compared)
    if table is not None:
        yield Heading("Leading points")
        yield table
        yield from (Text(line) for line in table_words(results, table))


def sentences(lines: Sequence[str], strong: bool = False) -> Iterator[Block]:
    """One paragraph, or a list of several."""
    yield Listed(lines, strong=strong) if len(lines) > 1 else Text(lines[0], strong=strong)


def caveats(notes: Sequence[str]) -> Iterator[Block]:
    """What to know before one acts on the decision."""
    if notes:
        yield Text("Caveats:")
        yield Listed(notes)


# The decision: what to do, in a sentence.


def decision_lines(results: Results, answers: Sequence[Answer]) -> list[str]:
    """What to do, under each condition; only the first ones of many."""
    lines = [
        f"{answer.conditions}: {decision(results, answer)}"
        if answer.conditions
        else decision(results, answer)
        for answer in answers[:MAX_SENTENCES]
    ]
    more = len(answers) - len(lines)
    return [*lines, *([f"The table below has {more:,} more conditions."] if more else [])]


def decision(results: Results, answer: Answer) -> str:
    """What to do: the cheapest of the points that may be the best, or what is missing for a choice."""
    metric, chosen, leading = answer.metric, recommended(answer), answer.leading
    if not answer.compared:
        counts = [results.counts(point) for point in results.points]
        if any(one.failed for one in counts):
            return f"See why runs failed: no point has two complete runs with {metric}."
        if any(one.censored for one in counts):
            return f"Raise stop.max_duration: no point has two complete runs with {metric}."
        return f"Make more runs: no point has two runs, all of them complete, with {metric}."
    if len(answer.compared) == 1:
        return (
            f"Take {_name(results, answer.compared[0])}: no other point has usable results (mean "
            f"{metric} {mean_text(results, answer.compared[0], metric)})."
        )
    if chosen is None or leading is None:
        return (
            f"Choose by other metrics: a low {metric} is neither better nor worse than a high one."
        )
    edges = " ".join(edge_sentences(results, answer))
    if chosen is not leading:
        lead = most_lead(answer, chosen)
        return (
            f"{_subject(results, chosen, 'is enough', 'are enough')}: mean {metric} "
            f"{_beside(results, answer, chosen, leading)} than {_subject(results, leading)}, which is "
            f"not significant and at most {percent(lead)}. {edges}"
        ).strip()
    best = f"{_subject(results, chosen)}: the {answer.better} mean {metric}, "
    best += _value(results, chosen, metric)
    if answer.best is None:
        rest = [point for point in answer.candidates if point is not chosen]
        cheaper = min(alike_but_for_costs(answer), key=costs_of)
        more = ""
        if costs_of(cheaper) < costs_of(chosen):
            more = (
                f"Make more runs to see whether {_subject(results, cheaper, 'is', 'are')} enough."
            )
        return (
            f"{best}; not significantly better than {_listed_names(results, rest)}. {more} {edges}"
        ).strip()
    following = next_best(results, answer)
    assert following is not None
    after = f"{_subject(results, following)}, {_beside(results, answer, following, chosen)}"
    return f"{best}; next: {after}. {edges}".strip()


def next_best(results: Results, answer: Answer) -> Point | None:
    """The point with the best mean but one; None without a leading point."""
    others = [point for point in answer.compared if point is not answer.leading]
    sign = -1 if answer.better == "highest" else 1
    if answer.leading is None or not others:
        return None
    return min(others, key=lambda point: sign * mean_of(results, point, answer.metric))


def recommended(answer: Answer) -> Point | None:
    """The leading point, or a cheaper one to which it is shown to be better by NEGLIGIBLE at most.

    Cheaper points differ from it in their robots, stations and chargers alone.
    """
    alike = alike_but_for_costs(answer)
    good = [one for one in alike if one is answer.leading or most_lead(answer, one) <= NEGLIGIBLE]
    return min(good, key=costs_of, default=None)


def alike_but_for_costs(answer: Answer) -> list[Point]:
    """The candidates that differ from the leading point in COSTS alone, and itself."""
    leading = answer.leading
    if leading is None:
        return []

    def beside(point: Point) -> list[tuple[str, str]]:
        return sorted((key, repr(one)) for key, one in point.levels.items() if key not in COSTS)

    alike = [point for point in answer.candidates if beside(point) == beside(leading)]
    varied = [key for key in COSTS if key in leading.levels]
    known = [p for p in alike if [k for k in COSTS if k in p.levels] == varied]
    if any(not isinstance(p.levels[key], int) for p in known for key in varied):
        return [leading]
    most = costs_of(leading)
    return [p for p in known if all(a <= b for a, b in zip(costs_of(p), most, strict=True))]


def costs_of(point: Point) -> list[Any]:
    """The numbers of robots, stations and chargers of a point, as far as it lists them."""
    return [point.levels[key] for key in COSTS if key in point.levels]


def most_lead(answer: Answer, point: Point) -> float:
    """By how much the leading point may be better than a point, as a share; inf if that is unknown."""
    for one in answer.against:
        ends = one.effect.relative
        if one.b is point and ends is not None and ends.low is not None and ends.high is not None:
            return -ends.low if answer.better == "lowest" else ends.high
    return math.inf


def decision_points(
    results: Results, answers: Sequence[Answer], compared: Sequence[Comparison]
) -> list[Point]:
    """The points that a decision is about: recommended, leading, its opponent, and the next best."""
    points: dict[int, Point] = {}
    for answer in answers:
        opponent = opponent_of(results, answer, compared)
        own = [recommended(answer), answer.leading, opponent and opponent.b]
        for point in (*own, next_best(results, answer)):
            points |= {} if point is None else {point.number: point}
    return list(points.values())


def _subject(results: Results, point: Point, one: str = "", several: str = "") -> str:
    """A point with a verb: "6 robots are", "routing b is"."""
    name = _name(results, point)
    robots = name.removeprefix("robots ")
    if robots != name and robots.isdecimal():
        return f"{count(int(robots), 'robot')} {one if robots == '1' else several}".strip()
    return f"{name} {one}".strip()


def _listed_names(results: Results, points: Sequence[Point]) -> str:
    """The names of points, at most MAX_NAMED."""
    names = [_subject(results, point) for point in points[:MAX_NAMED]]
    more = len(points) - len(names)
    names += [f"{more:,} more"] if more else []
    return " or ".join(names) if len(names) < 3 else f"{'; '.join(names[:-1])}; or {names[-1]}"


def _value(results: Results, point: Point, metric: str) -> str:
    """The mean of a point with its unit."""
    scale = results.scale(metric)
    return f"{number(mean_of(results, point, metric) * scale.factor)} {scale.unit}"


def _beside(results: Results, answer: Answer, point: Point, other: Point) -> str:
    """The mean of a point, and its difference from another: "4.25 min, 9 s more (+3.6 %)"."""
    metric = answer.metric
    value, base = (mean_of(results, one, metric) for one in (point, other))
    scale, off = results.scale(metric), value - base
    amount, unit = abs(off) * scale.factor, scale.unit
    if described(metric)[0] == "ticks":
        amount, unit = duration(abs(off), results.units.tick)
    elif scale is PERCENT:
        unit = "percentage points"
    relative = f" ({100 * off / base:+.1f} %)" if base and scale is not PERCENT else ""
    more = "more" if off > 0 else "less"
    return f"{_value(results, point, metric)}, {number(amount)} {unit} {more}{relative}"


def question(results: Results) -> str:
    """The question of a study, in a sentence."""
    study, metric = results.study, results.analysis.metrics[0]
    conditions = condition_factors(results)
    choices = [name for name in varied_columns(study) if name not in conditions]
    varied = _listing(results, choices)
    unit = results.scale(metric).unit
    what = f"What is the mean {metric} in {unit}{f' by {varied}' if varied else ''}"
    if (better := direction_of(metric)) and len(study.points) > 1:
        what = f"Which of {varied} gives the {better} mean {metric} in {unit}"
    each = f", for each {_listing(results, conditions)}" if conditions else ""
    _, meaning = described(metric)
    runs = f"{count(len(study.points), 'point')} with {count(study.max_replications, 'run')} each"
    return f"{what}{each}? {metric}: {meaning}. {runs}."


def _listing(results: Results, factors: Sequence[str]) -> str:
    """Factors with their levels: "robots (1, 2, 3) and allocation (a, b)"."""
    heads = heads_by_factor(results.study)
    return " and ".join(f"{heads.get(name, name)} ({_levels(results, name)})" for name in factors)


def _levels(results: Results, factor: str) -> str:
    study = results.study
    names = list(dict.fromkeys(levels_named(study, point, [factor]) for point in study.points))
    head = "" if factor == SCENARIO_FACTOR else heads_by_factor(study)[factor]
    names = [name.removeprefix(f"{head} ") for name in names]
    more = len(names) - MAX_LEVELS_NAMED
    return ", ".join(names[:MAX_LEVELS_NAMED]) + (f" and {more:,} more" if more > 0 else "")


def answer_lines(results: Results, answers: Sequence[Answer]) -> list[str]:
    """The answers in sentences, or a summary of many."""
    if len(answers) <= MAX_SENTENCES:
        return [answer_sentence(results, answer) for answer in answers]
    settled = sum(answer.best is not None for answer in answers)
    return [
        f"The best point is determined under {settled:,} of {len(answers):,} conditions; the table "
        "lists the leading point of each."
    ]


def answer_sentence(results: Results, answer: Answer) -> str:
    """The answer about the best point, with its confidence."""
    start = f"{answer.conditions}: " if answer.conditions else ""
    return start + " ".join([_verdict(results, answer), *_limits(results, answer)])


def _verdict(results: Results, answer: Answer) -> str:
    metric, leading = answer.metric, answer.leading
    of = count(len(answer.compared), "point")
    sure = f"{percent(1 - results.analysis.error, 0)} confidence"
    if not answer.compared:
        return f"No answer: no point has at least two complete runs with {metric}."
    if len(answer.compared) == 1:
        return f"Only {_with_mean(results, answer, answer.compared[0])} has usable results."
    if answer.better is None:
        ordered = sorted(answer.compared, key=lambda point: mean_of(results, point, metric))
        low, high = (_with_mean(results, answer, point) for point in (ordered[0], ordered[-1]))
        return f"No best point: {metric} has no better direction. Means range from {low} to {high}."
    if leading is None:
        return f"No best point: no point has {metric} in all of its runs."
    if answer.best is not None:
        return (
            f"Best, with {sure}: {_with_mean(results, answer, leading)}. None of the {of} "
            f"compared has a {_WORSE[answer.better]} mean {metric}."
        )
    first, *names = (_with_mean(results, answer, one) for one in answer.candidates[:MAX_NAMED])
    more = len(answer.candidates) - 1 - len(names)
    rest = f"; and {more:,} more" if more else ""
    others = len(answer.compared) - len(answer.candidates)
    text = f"No statistically significant difference between {first} and {names[0]}."
    if len(answer.candidates) > 2:
        same = f"{'; '.join(names)}{rest}"
        text = f"No statistically significant difference from the leading point, {first}: {same}."
    if not others:
        return text
    apart = f"{others:,} others are" if others > 1 else "the other is"
    return (
        f"{text} With {sure} one of these {len(answer.candidates)} has the {answer.better} mean "
        f"{metric} of the {of} compared; {apart} worse."
    )


def certainty(results: Results, answers: Sequence[Answer]) -> str:
    """The confidence of the answers, and its limits."""
    sure, few = percent(1 - results.analysis.error, 0), max(one.few_runs for one in answers)
    sentences = [f"In brackets: means with {sure} confidence intervals."]
    declared = " and comparisons" if results.analysis.comparisons != "none" else ""
    if len(answers) > 1 or declared:
        sentences.append(f"All answers{declared} hold simultaneously with {sure} confidence.")
    if few:
        sentences.append(
            f"A point has only {min(a.few_runs for a in answers if a.few_runs)} runs: with fewer than "
            f"{STUDENT_MIN_RUNS} runs the confidence may be lower."
        )
    if any(results.counts(point).missing for point in results.points):
        sentences.append("Some runs are not done yet: the answer may change.")
    return " ".join(sentences)


def _limits(results: Results, answer: Answer) -> Iterator[str]:
    """The points that cannot be the best because of their runs, in a sentence."""
    texts = [(point, bias_text(results, point, answer.metric)) for point in answer.incomplete]
    names = [f"{_name(results, point)} ({text})" for point, text in texts if text]
    if names:
        more = len(names) - MAX_NAMED
        rest = f"; and {more:,} more" if more > 0 else ""
        yield f"Not called best, because runs are left out: {'; '.join(names[:MAX_NAMED])}{rest}."


def table_words(results: Results, table: Table) -> Iterator[str]:
    """The meanings of headings in the table of answers."""
    if results.analysis.baseline:
        levels = results.analysis.baseline_levels.items()
        what = ", ".join(f"{key} {level_text(results.study, key, one)}" for key, one in levels)
        yield f"baseline: {what}, as the study declares."
    if ADJUSTED in table.head:
        yield (
            f"{ADJUSTED}: p value times the number of tests (Bonferroni); a difference is called "
            f"significant below {results.analysis.error:g}."
        )


def _name(results: Results, point: Point) -> str:
    """The levels of a point in the factors that are choices, not conditions."""
    study, conditions = results.study, condition_factors(results)
    chosen = [name for name in varied_columns(study) if name not in conditions]
    return levels_named(study, point, chosen) or point.scenario


def _with_mean(results: Results, answer: Answer, point: Point) -> str:
    identical = results.identical(answer.metric)
    twins = [
        _name(results, other)
        for other in results.points
        if other.number != point.number and identical[other.number] == identical[point.number]
    ]
    same = f", the same runs as {'; '.join(twins[:MAX_NAMED])}" if twins else ""
    return f"{_name(results, point)} ({mean_text(results, point, answer.metric)}{same})"


def mean_text(results: Results, point: Point, metric: str) -> str:
    """The mean of a point with its unit and interval: "12.4 min, 12.1 to 12.7"."""
    interval = interval_of(results, metric, list(results.values(point, metric).values()))
    if interval is None:
        return "-"
    scale = results.scale(metric)
    shown = scale.of(interval)
    unit = f" {scale.unit}"
    if shown.low is None or shown.high is None:
        return f"{number(shown.value)}{unit}, {TOO_FEW} for an interval"
    return f"{number(shown.value)}{unit}, {number(shown.low)} to {number(shown.high)}"


def answer_table(
    results: Results, answers: Sequence[Answer], compared: Sequence[Comparison]
) -> Table | None:
    """The leading point of each answer against the baseline, else against the next best point."""
    rows = []
    for answer in answers:
        leading = answer.leading
        if leading is None:
            continue
        scale = results.scale(answer.metric)
        one = opponent_of(results, answer, compared)
        cells = ["-"] * 5
        if one is not None:
            other = one.b
            value = mean_of(results, other, answer.metric) * scale.factor
            difference = one.effect.difference.value * scale.factor
            cells = [
                _name(results, other),
                NumberText(number(value), value),
                NumberText(f"{difference:+,.4g}", difference),
                relative_text(one.effect.relative),
                p_text(one.adjusted),
            ]
        elif any(one.b.number == leading.number for one in compared):
            cells[0] = "is the baseline"
        value = mean_of(results, leading, answer.metric) * scale.factor
        row = [_name(results, leading), NumberText(number(value), value), *cells]
        rows.append([*([answer.conditions] if answer.conditions else []), *row])
    if not rows:
        return None
    metric = answers[0].metric
    several = ["condition"] if answers[0].conditions else []
    against = "against the baseline" if results.analysis.baseline else "against the next best"
    all_best = all(answer.best is not None for answer in answers if answer.leading is not None)
    head = [*several, "best point" if all_best else "leading point"]
    unit = results.scale(metric).unit
    head += [f"mean {metric}, {unit}", against, "its mean", "difference", "relative", ADJUSTED]
    left = 1 + len(several)
    return Table(head, rows, left=left, also_left=(left + 1, left + 4))


def opponent_of(
    results: Results, answer: Answer, compared: Sequence[Comparison]
) -> Comparison | None:
    """The leading point against its baseline; if none is declared, against the next best point."""
    leading, metric = answer.leading, answer.metric
    if leading is None:
        return None
    if results.analysis.baseline:
        declared = (one for one in compared if one.metric == metric)
        return next((one for one in declared if one.a.number == leading.number), None)
    sign = -1 if answer.better == "highest" else 1
    return min(answer.against, key=lambda one: sign * mean_of(results, one.b, metric), default=None)
