"""Orders that are late: how many, and by how much, counted by hand on a corridor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from drawn_scenes import scene

from automaton.runs.headless import CountedStretches, run_marked, sums_by_stretch
from automaton.runs.metric_sums import metric
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.runs.task_metrics import due_orders, lead_times
from automaton.scenario.unavailable_metrics import OF_DUE_TIMES, not_measured

CORRIDOR = "t........t"
STRATEGY = {"allocation": "first-come", "right_of_way": "wait"}


def run_of(*lines: dict[str, Any], ticks: int | None = None) -> Simulation:
    """One robot that begins at the left and drives a cell in a tick."""
    orders = {"list": list(lines)}
    run = Simulation(scene(CORRIDOR, [(0, 0)], orders=orders, strategy=STRATEGY))
    run.run(until=ticks)
    return run


def stop(x: int, **more: Any) -> dict[str, Any]:
    return {"stops": [[x, 0]], **more}


def late(run: Simulation) -> dict[str, float]:
    figures = metrics_of(run)
    return {name: figures[name] for name in OF_DUE_TIMES if name in figures}


def test_what_is_done_after_it_was_due_is_late() -> None:
    """Ends in ticks 3, 5, 8, 9, 11: the second one is two ticks late, the last one a tick."""
    lines = (stop(3, due=3), stop(5, due=3), stop(8, due=90), stop(9), stop(9, due={"at": 10}))
    run = run_of(*lines)
    assert run.world.orders.delivered.tolist() == [3, 5, 8, 9, 10]
    assert late(run) == {
        "late_share": 1 / 4,
        "not_yet_due": 0,
        "tardiness": 2 / 4,
        "tardiness_p95": 2,
        "tardiness_p99": 2,
    }


def test_open_orders_are_late_once_they_are_due() -> None:
    """After tick 4: one done in time, one open since it was due in tick 1, one due in this tick, one
    due later, one without a due time, and one that is not released."""
    lines = (stop(3, due=3), stop(9, due=1), stop(9, due=4), stop(9, due=5), stop(9))
    run = run_of(*lines, stop(9, release=5, due=0), ticks=4)
    assert due_orders(run.world).tardiness.tolist() == [0, 3, 0, 0]
    assert late(run) == {
        "late_share": 1 / 2,
        "not_yet_due": 2,
        "tardiness": 3 / 4,
        "tardiness_p95": 3,
        "tardiness_p99": 3,
    }


def test_where_nothing_is_due_yet_there_is_no_share() -> None:
    assert late(run_of(stop(9, due=50), ticks=2)) == {
        "not_yet_due": 1,
        "tardiness": 0,
        "tardiness_p95": 0,
        "tardiness_p99": 0,
    }
    assert late(run_of(stop(9, release=7, due=50), ticks=2)) == {"not_yet_due": 0}


def test_without_due_times_nothing_is_said_of_them() -> None:
    run = run_of(stop(9))
    assert late(run) == {}
    absent = not_measured(run.resolved.scenario)
    assert all(absent[name].startswith("orders with due times: due in") for name in OF_DUE_TIMES)
    assert not set(OF_DUE_TIMES) & set(not_measured(run_of(stop(9, due=9)).resolved.scenario))


def test_an_order_due_before_the_run_is_late_from_then_on() -> None:
    run = run_of(stop(4, due={"at": -6}))
    assert late(run)["late_share"] == 1 and late(run)["tardiness"] == 10


def test_the_longest_lead_time_may_be_that_of_an_open_order() -> None:
    """The first is done in tick 9 after 9 ticks; the second one waits from tick 1 on."""
    lines = (stop(9), stop(0, release=1), stop(0, release=90))
    assert metrics_of(run_of(*lines, ticks=10))["lead_time_max"] == 9
    assert metrics_of(run_of(*lines, ticks=15))["lead_time_max"] == 14
    figures = metrics_of(run_of(*lines))
    assert figures["lead_time_max"] == 17 and figures["oldest_order"] == 0
    begun = metrics_of(run_of(*lines, ticks=5))
    assert begun["lead_time_max"] == begun["oldest_order"] == 5 and "lead_time_p99" not in begun


def test_quantiles_are_those_of_numpy() -> None:
    draws = np.random.default_rng(3)
    lines = [stop(int(x), release=1, due=int(due)) for x, due in draws.integers(0, 9, (40, 2))]
    run = run_of(*lines)
    times = np.array(run.world.orders.delivered - run.world.orders.release_tick, np.int64)
    tardiness = np.maximum(0, run.world.orders.delivered - run.world.orders.due)
    figures = metrics_of(run)
    for name, values in (("lead_time", times), ("tardiness", tardiness)):
        for share in (95, 99):
            expected = np.quantile(values, share / 100, method="inverted_cdf")
            assert figures[f"{name}_p{share}"] == expected
    assert figures["tardiness"] == pytest.approx(tardiness.mean(), abs=0)
    assert lead_times(run.world, 0)["lead_time_max"] == times.max()


def test_after_a_warm_up_only_what_ended_then_counts() -> None:
    """What was done in the warm-up is left out; what is open counts, however old it is."""
    lines = (stop(9, due=2), stop(0, due=5), stop(9, due=90), stop(0, due=8), stop(9, due=400))
    resolved = scene(
        CORRIDOR,
        [(0, 0)],
        orders={"list": list(lines)},
        strategy=STRATEGY,
        stop={"when": "never", "max_duration": 30},
        measure={"warm_up": 10},
    )
    run = Simulation(resolved)
    marks: CountedStretches = run_marked(run, every=10)
    assert run.world.orders.delivered.tolist() == [9, 18, 27, -1, -1]
    figures = metrics_of(run, marks.warm_up)
    assert (figures["late_share"], figures["not_yet_due"]) == (2 / 3, 1)
    assert figures["tardiness"] == (13 + 0 + 22 + 0) / 4 and figures["tardiness_p95"] == 22
    sums = sums_by_stretch(run, marks.stretches)
    assert sums["late_orders"] == [1, 1, 1] and sums["due_orders"] == [1, 1, 2]
    assert sums["tardiness_ticks"] == [7, 13, 22] and sums["not_yet_due"] == [0, 0, 1]
    after = {name: sum(values[1:]) for name, values in sums.items()}
    for name in ("late_share", "tardiness", "not_yet_due"):
        assert metric(name, after) == figures[name]
