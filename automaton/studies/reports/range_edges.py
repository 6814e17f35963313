"""Whether the best point of a study is at the edge of what was tried: a better one may lie beyond."""

from __future__ import annotations

from collections.abc import Iterator

from automaton.studies.reports.best_points import Answer, condition_factors
from automaton.studies.reports.curves import ROBOTS, is_numeric
from automaton.studies.reports.point_names import heads_by_factor, level_text, varied_factors
from automaton.studies.reports.study_results import Results


def edge_sentences(results: Results, answer: Answer) -> Iterator[str]:
    """What to try next, for each factor of numbers of which the leading point has the last one."""
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
        is_least = own == low and own > (1 if isinstance(own, int) else 0)  # less may mean nothing
        if low == high or not (own == high or is_least):
            continue
        shown = level_text(study, factor, own)
        beyond = f"{heads_by_factor(study)[factor]} {'above' if own == high else 'below'} {shown}"
        if factor == ROBOTS:
            beyond = f"{'more' if own == high else 'fewer'} than {shown} robots"
        yield f"The {what} is at the edge of what was tried: try {beyond}."
