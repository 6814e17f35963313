"""Metrics of reports in the units of the reader."""

from __future__ import annotations

from dataclasses import replace

import pytest
from report_helpers import tables
from synthetic_results import study_of, synthetic_store

from automaton.documents.report_document import NumberText
from automaton.studies.reports.comparison_tables import comparison_section
from automaton.studies.reports.metric_tables import curves, metric_section
from automaton.studies.reports.study_results import ReportUnits, Results, units_of_points
from automaton.units import Unit
from automaton.world.resolve import resolve

HALF_SECOND = ReportUnits(Unit(0.5, "s"), Unit(1.2, "m"))


def half_seconds(largest: float = 2400.0) -> Results:
    study = study_of({"fleet.robots": (1, 2)}, 10, comparisons="pairs")
    results = synthetic_store(study, lambda p, r: largest - 600 * p + r)
    return replace(results, units=HALF_SECOND)


@pytest.mark.parametrize(
    ("metric", "largest", "factor", "unit"),
    [
        ("makespan", 100, 0.5, "s"),
        ("makespan", 2400, 1 / 120, "min"),
        ("makespan", 28_800, 1 / 7200, "h"),
        ("throughput", 50, 7.2, "orders/h"),
        ("throughput_per_robot", 5, 7.2, "orders/h and robot"),
        ("distance", 10, 1.2, "m"),
        ("utilization", 0.5, 100, "%"),
        ("my_counter", 3, 1, "times"),
    ],
)
def test_where_a_tick_is_a_time_metrics_are_times(
    metric: str, largest: float, factor: float, unit: str
) -> None:
    scale = HALF_SECOND.scale(metric, largest)
    assert (pytest.approx(factor), unit) == (scale.factor, scale.unit)


def test_where_a_tick_is_only_a_tick_nothing_changes() -> None:
    assert ReportUnits().scale("makespan", 2400) == (1.0, "ticks")
    assert ReportUnits().scale("throughput", 50).unit == "orders/1000 ticks"
    assert ReportUnits(Unit(1, "cycle")).scale("makespan", 2400) == (1.0, "cycles")


def test_tables_comparisons_and_curves_of_a_report_have_one_unit() -> None:
    """2,400 ticks of half a second are 20 minutes."""
    results = half_seconds()
    (table,) = tables(metric_section(results, {}, "makespan"))
    mean = table.rows[0][1]
    assert isinstance(mean, NumberText) and mean.value == pytest.approx(20 + 4.5 / 120)
    (compared,) = tables(comparison_section(results))
    at = list(compared.head).index("difference, min")
    assert compared.rows[0][at] == "-5"
    (drawn,) = curves(results)
    assert drawn.y_label == "min" and drawn.lines[0].value[0] == mean.value
    assert drawn.from_zero and drawn.span[0] == 0


def test_points_that_disagree_about_a_tick_keep_ticks() -> None:
    half, one = (resolve("tabletop-mini", [f"units.tick={tick}"]) for tick in ("0.5 s", "1 s"))
    assert units_of_points([half, half], 2).tick == Unit(0.5, "s")
    assert units_of_points([half, one], 2).tick == Unit(1.0, "tick")
    assert units_of_points([half], 2).tick == Unit(1.0, "tick")  # of one the scenario is gone
