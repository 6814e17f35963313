"""Curves of a report, and how points and lines are named."""

from __future__ import annotations

import json
import math
import re

import pytest
from synthetic_results import study_of, synthetic_store

from automaton.documents.html_output import LINE_STYLES, SMALL, curves_svg, panels_html
from automaton.documents.report_document import Curves, Panels, ReportCurve
from automaton.documents.text_output import CURVE_MARKS, chart
from automaton.studies.reports.comparisons import point_name
from automaton.studies.reports.metric_tables import curves


def test_curves_are_drawn_over_the_robots_one_for_each_other_level() -> None:
    factors = {"strategy.allocation": ("a", "b"), "fleet.robots": (1, 2, 4)}
    results = synthetic_store(study_of(factors), lambda p, r: 100.0 * p + r)
    (drawn,) = curves(results)
    assert [line.name for line in drawn.lines] == ["allocation a", "allocation b"]
    assert list(drawn.lines[1].x) == [1, 2, 4]
    assert drawn.lines[1].value == pytest.approx([329.5, 429.5, 529.5])


def test_levels_with_equal_values_have_lines_of_their_own_and_names_that_tell_them_apart() -> None:
    rules = (
        {"name": "retreat", "max_retries": 3},
        {"name": "retreat", "after": 3},
        {"name": "wait"},
    )
    factors = {"fleet.robots": (1, 2), "strategy.right_of_way": rules}
    (drawn,) = curves(synthetic_store(study_of(factors), lambda p, r: 100.0 * p))
    assert [line.name for line in drawn.lines] == [
        "right_of_way retreat max_retries 3",
        "right_of_way retreat after 3",
        "right_of_way wait",
    ]
    assert [list(line.x) for line in drawn.lines] == [[1, 2]] * 3
    assert drawn.lines[1].value == pytest.approx([100, 400])


def test_curves_find_no_bounds_since_they_show_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("automaton.studies.reports.metric_tables.bound")
    (drawn,) = curves(
        synthetic_store(study_of({"fleet.robots": (1, 2)}, 2), lambda p, r: 100.0 * p)
    )
    assert list(drawn.lines[0].value) == [0, 100]


def test_every_line_has_a_sign_and_a_colour_of_its_own() -> None:
    factors = {"fleet.robots": (1, 2), "strategy.allocation": tuple("abcdefghij")}
    (drawn,) = curves(synthetic_store(study_of(factors, 2), lambda p, r: 100.0 * p))
    assert len(drawn.lines) == len(CURVE_MARKS) == len(LINE_STYLES)
    assert drawn.title == "makespan by fleet.robots, 2 more not shown"


def test_points_are_named_by_their_levels() -> None:
    study = study_of(
        {
            "fleet.robots": (1, 2),
            "strategy.charging": ("none",),
            "strategy.routing": ("shortest", {"name": "astar", "tie_break": "fifo"}),
        }
    )
    assert point_name(study, study.points[3]) == "robots 2, routing astar fifo"
    alone = study_of({"fleet.robots": (1,), "strategy.charging": ("none",)})
    assert point_name(alone, alone.points[0]) == "robots 1, charging none"
    assert json.dumps(point_name(study, study.points[0]))


def test_numbers_have_as_many_digits_as_tell_them_apart() -> None:
    for levels, names in (
        ((0.123456789, 0.5), ["0.123457", "0.5"]),
        ((0.1234567, 0.12345671), ["0.1234567", "0.12345671"]),
    ):
        study = study_of({"strategy.gain": levels})
        assert [point_name(study, point) for point in study.points] == [f"gain {n}" for n in names]


def test_curves_over_names_stand_beside_each_other() -> None:
    one, other = (ReportCurve(name, [0, 1], [1, 2], [0, 1], [2, 3]) for name in "ab")
    over_names = Curves("t", "metric", "%", [one, other], x_names=["first", "second"])
    over_numbers = Curves("t", "robots", "%", [one, other])
    marks = [re.findall(r'translate\(([\d.]+),[\d.]+\)"', curves_svg(curves))
             for curves in (over_names, over_numbers)]  # fmt: skip
    assert len(set(marks[0][:4])) == 4
    assert marks[1][:2] == marks[1][2:4]
    bars = [line.count(":") for line in chart(over_names, 40) if ":" in line]
    assert max(bars) == 4  # two intervals at each name, none hidden behind another


def test_the_last_name_of_a_small_chart_is_inside_and_a_chart_of_zeros_begins_at_zero() -> None:
    hours = [f"{6 + k:02}:00" for k in range(6)]
    none = [math.nan] * 6
    down = ReportCurve("today", list(range(6)), [0.0] * 6, none, none)
    chart = Curves("down", "from", "robots", [down], hours, from_zero=True, is_in_order=True)
    assert chart.span == (0, 1)
    small = panels_html(Panels("by hour", [chart]))
    labels = re.findall(r'<text x="([\d.]+)"[^>]*>(\d\d:00)</text>', small)
    assert labels[-1][1] == "11:00" and float(labels[-1][0]) + 3.3 * 5 <= SMALL.width
