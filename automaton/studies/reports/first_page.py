"""The first page of a report: what was asked, the answer with its certainty, one picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from automaton.runs.report_document import Block, Heading, Listed, NumberText, Table, Text
from automaton.studies.inference.effects import Effect, effect
from automaton.studies.inference.intervals import STUDENT_MIN_RUNS
from automaton.studies.reports.best_points import Answer, condition_factors, mean_of
from automaton.studies.reports.comparison_tables import p_text, relative_text
from automaton.studies.reports.comparisons import Comparison
from automaton.studies.reports.curves import picture
from automaton.studies.reports.directions import direction_of
from automaton.studies.reports.metric_tables import interval_of
from automaton.studies.reports.point_names import (
    heads_by_factor,
    level_text,
    levels_named,
    varied_factors,
)
from automaton.studies.reports.range_edges import edge_sentences
from automaton.studies.reports.reader_units import described
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.study import SCENARIO, Point
from automaton.units import count, number, percent

MAX_NAMED: Final = 3  # points in a sentence
MAX_LEVELS_NAMED: Final = 8  # of a factor
MAX_SENTENCES: Final = 6  # answers in full sentences; more stand in the table alone


_WORSE: Final = {"lowest": "lower", "highest": "higher"}


class Opponent(NamedTuple):
    """What the leading point of an answer is compared with."""

    point: Point
    effect: Effect
    adjusted: float | None  # Holm's p value of a declared comparison


def first_page(
    results: Results,
    answers: Sequence[Answer],
    compared: Sequence[Comparison],
    notes: Sequence[str],
) -> Iterator[Block]:
    """Question, answer, the best point against the baseline, a picture, and what to know first."""
    if not answers:
        yield Heading("Answer")
        yield Text("No answer: no run has a metric.", strong=True)
    else:
        yield Heading("Question")
        yield Text(question(results))
        yield Heading("Answer")
        lines = answer_lines(results, answers)
        yield Listed(lines, strong=True) if len(lines) > 1 else Text(lines[0], strong=True)
        yield Text(certainty(results, answers))
        table = answer_table(results, answers, compared)
        drawn = picture(results, answers[0].metric)
        if table is not None:
            yield table
            yield from (Text(line) for line in table_words(results, table))
        yield from [drawn] if drawn is not None else []
    if notes:
        yield Text("To know beforehand:")
        yield Listed(notes)


def question(results: Results) -> str:
    """What a study asks, in a sentence."""
    study, metric = results.study, results.analysis.metrics[0]
    conditions = condition_factors(results)
    choices = [name for name in varied_factors(study) if name not in conditions]
    if SCENARIO not in conditions and len(study.scenarios) > 1:
        choices = [SCENARIO, *choices]
    varied = _listing(results, choices)
    what = f"What is the mean {metric}{f' by {varied}' if varied else ''}"
    if (better := direction_of(metric)) and len(study.points) > 1:
        what = f"Which of {varied} gives the {better} mean {metric}"
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
    head = "" if factor == SCENARIO else heads_by_factor(study)[factor]
    names = [name.removeprefix(f"{head} ") for name in names]
    more = len(names) - MAX_LEVELS_NAMED
    return ", ".join(names[:MAX_LEVELS_NAMED]) + (f" and {more:,} more" if more > 0 else "")


def answer_lines(results: Results, answers: Sequence[Answer]) -> list[str]:
    """The answers in sentences; of very many the count."""
    if len(answers) <= MAX_SENTENCES:
        return [answer_sentence(results, answer) for answer in answers]
    settled = sum(answer.best is not None for answer in answers)
    return [
        f"Of {len(answers):,} conditions the best point is certain under {settled:,}; the table has "
        "the leading point of each."
    ]


def answer_sentence(results: Results, answer: Answer) -> str:
    """What the runs say of the best point, with its certainty."""
    start = f"{answer.conditions}: " if answer.conditions else ""
    edges = edge_sentences(results, answer)
    return start + " ".join([_verdict(results, answer), *edges, *_limits(results, answer)])


def _verdict(results: Results, answer: Answer) -> str:
    metric, leading = answer.metric, answer.leading
    of = count(len(answer.compared), "point")
    sure = f"{percent(1 - results.analysis.error, 0)} certainty"
    if not answer.compared:
        return f"No answer: no point has two runs with {metric}, all of them finished."
    if len(answer.compared) == 1:
        return f"{_with_mean(results, answer, answer.compared[0])} is the only point to judge by."
    if answer.better is None:
        ordered = sorted(answer.compared, key=lambda point: mean_of(results, point, metric))
        low, high = (_with_mean(results, answer, point) for point in (ordered[0], ordered[-1]))
        return f"No best point, since {metric} is not better low or high: from {low} to {high}."
    assert leading is not None
    if answer.best is not None:
        return (
            f"Best, with {sure}: {_with_mean(results, answer, leading)}. No other of the {of} "
            f"compared has a {_WORSE[answer.better]} mean {metric}."
        )
    names = [_with_mean(results, answer, point) for point in answer.candidates[:MAX_NAMED]]
    more = len(answer.candidates) - len(names)
    rest = f"; and {more:,} more" if more else ""
    others = len(answer.compared) - len(answer.candidates)
    apart = f", and not at the {f'{others:,} others' if others > 1 else 'other'}" if others else ""
    return (
        f"Cannot be told apart: {'; '.join(names)}{rest}. With {sure} the {answer.better} mean "
        f"{metric} of the {of} compared is at one of these {len(answer.candidates)}{apart}."
    )


def certainty(results: Results, answers: Sequence[Answer]) -> str:
    """With what certainty the answers hold, and what takes from it."""
    sure, few = percent(1 - results.analysis.error, 0), max(one.few_runs for one in answers)
    sentences = [f"In brackets: means, with their {sure} intervals."]
    if len(answers) > 1:
        sentences.append(f"All of these answers hold together with {sure} certainty.")
    if few:
        sentences.append(
            f"There are only {min(a.few_runs for a in answers if a.few_runs)} runs of a point: with "
            f"fewer than {STUDENT_MIN_RUNS} it may be less certain."
        )
    if any(results.counts(point).missing for point in results.points):
        sentences.append("Not all runs are done: the answer may change.")
    return " ".join(sentences)


def _limits(results: Results, answer: Answer) -> Iterator[str]:
    """Which points an answer says nothing of."""
    if answer.incomplete:
        names = [_name(results, point) for point in answer.incomplete[:MAX_NAMED]]
        more = len(answer.incomplete) - len(names)
        rest = f"; and {more:,} more" if more else ""
        yield (
            "Not compared, since runs of them lack, failed, did not finish or were not measured: "
            f"{'; '.join(names)}{rest}."
        )


def table_words(results: Results, table: Table) -> Iterator[str]:
    """What the heads of the table of answers mean."""
    if results.analysis.baseline:
        levels = results.analysis.baseline.items()
        what = ", ".join(f"{key} {level_text(results.study, key, one)}" for key, one in levels)
        yield f"baseline: what the study declares to compare with, {what}."
    if "p Holm" in table.head:
        yield (
            "p Holm: how likely a difference at least as large is by chance alone, corrected for all "
            f"comparisons that are made (Holm); below {results.analysis.error:g} it is taken for more."
        )


def _name(results: Results, point: Point) -> str:
    """The levels that were chosen; conditions stand beside them."""
    study, conditions = results.study, condition_factors(results)
    varied = ([SCENARIO] if len(study.scenarios) > 1 else []) + varied_factors(study)
    chosen = [name for name in varied if name not in conditions]
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
    unit = "" if scale.unit == "share" else f" {scale.unit}"
    if shown.low is None or shown.high is None:
        return f"{number(shown.value)}{unit}"
    return f"{number(shown.value)}{unit}, {number(shown.low)} to {number(shown.high)}"


def answer_table(
    results: Results, answers: Sequence[Answer], compared: Sequence[Comparison]
) -> Table | None:
    """The leading point of each answer against the baseline, else against the next best one."""
    rows, has_p = [], False
    for answer in answers:
        leading = answer.leading
        if leading is None:
            continue
        scale = results.scale(answer.metric)
        opponent = opponent_of(results, answer, compared)
        cells = ["-"] * 5
        if opponent is not None:
            adjusted = opponent.adjusted
            has_p = has_p or adjusted is not None
            value = mean_of(results, opponent.point, answer.metric) * scale.factor
            difference = opponent.effect.difference.value * scale.factor
            cells = [
                _name(results, opponent.point),
                NumberText(number(value), value),
                NumberText(f"{difference:+,.4g}", difference),
                relative_text(opponent.effect.relative),
                "-" if adjusted is None else p_text(adjusted),
            ]
        elif any(one.b.number == leading.number for one in compared):
            cells[0] = "it is the baseline"
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
    head += [f"mean {metric}, {unit}", against, "its mean", "difference", "relative", "p Holm"]
    left = 1 + len(several)
    if not has_p:
        head, rows = head[:-1], [row[:-1] for row in rows]
    return Table(head, rows, left=left, also_left=(left + 1, left + 4))


def opponent_of(
    results: Results, answer: Answer, compared: Sequence[Comparison]
) -> Opponent | None:
    """The baseline of a leading point; without any declared, the next best point."""
    leading, metric = answer.leading, answer.metric
    if leading is None:
        return None
    if results.analysis.baseline:
        for one in compared:
            if one.metric == metric and one.a.number == leading.number:
                return Opponent(one.b, one.effect, one.adjusted)
        return None
    others = [point for point in answer.compared if point.number != leading.number]
    if not others:
        return None
    sign = -1 if answer.better == "highest" else 1
    next_best = min(others, key=lambda point: sign * mean_of(results, point, metric))
    x, y = (results.values(point, metric) for point in (leading, next_best))
    paired = results.study.paired
    if paired:
        both = sorted(set(x) & set(y))
        x, y = {r: x[r] for r in both}, {r: y[r] for r in both}
    if min(len(x), len(y)) < 2:
        return None
    return Opponent(
        next_best, effect(list(x.values()), list(y.values()), paired, answer.level), None
    )
