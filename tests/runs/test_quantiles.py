"""Quantiles of delay: of the orders of a run, and in the report of every floor where orders arrive."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from sweep_studies import swept_here

from automaton.commands import main
from automaton.engine.state import ORDER_DELIVERED
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

STREAM = [
    "orders.count=60",
    "orders.mean_interarrival_time=8",
    "stop.max_duration=700",
    "measure.warm_up=100",
]
STUDY = """name: streams
scenario: warehouse-100
factors:
  orders.count: [60]
  orders.mean_interarrival_time: [8]
  stop.max_duration: [700]
  strategy.routing: [shortest, congestion]
replications: 2
analysis: {metrics: [throughput]}
"""


def test_95_percent_of_a_runs_orders_have_this_lead_time_or_less() -> None:
    run = Simulation(resolve("warehouse-100", STREAM))
    run.run()
    orders = run.world.orders
    done = orders.state == ORDER_DELIVERED
    times = (orders.delivered - orders.release_tick)[done]
    figures = metrics_of(run)
    assert 40 < len(times) <= 60
    assert figures["lead_time"] == pytest.approx(times.mean())
    assert figures["lead_time_p95"] == np.quantile(times, 0.95, method="inverted_cdf")
    assert (times <= figures["lead_time_p95"]).mean() >= 0.95
    assert 0 <= figures["delay"] <= figures["delay_p95"]


def test_reports_tell_them_where_orders_come_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyarrow")
    (tmp_path / "streams.yaml").write_text(STUDY)
    table = swept_here(tmp_path / "streams.yaml", tmp_path / "out")
    assert main(["report", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    for metric in ("lead_time_p95", "delay_p95"):
        section = text.partition(f"\n{metric}\n")[2]
        assert "Not declared by the study" in section
        mean = sum(table.column(metric).to_pylist()[:2]) / 2
        assert f"{mean:,.4g}" in section.partition("Not declared")[0]
    assert "\nthroughput\n" in text and "\nlead_time\n" not in text
