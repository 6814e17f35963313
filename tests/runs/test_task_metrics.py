"""Loads that come in at docks and go to racks: who takes what, and how long it takes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from metrics_of_some_runs import OF_OTHER_RUNS

from automaton.commands import main
from automaton.engine.state import LAYER_ALLOCATION
from automaton.floor.floor_plan import DOCK, RACK
from automaton.floor.reachability import rack_stands
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.metrics import METRIC_CATALOGUE, metrics_of
from automaton.runs.simulation import Simulation
from automaton.runs.task_metrics import quantile
from automaton.scenario.unavailable_metrics import TASK_METRICS
from automaton.strategy.api import (
    ACTION_TURN,
    CMD_PARK,
    NIL,
    ORDER_DELIVERED,
    ORDER_WAITING,
    REASON_PERIODIC,
    REASON_PICKED,
    InputError,
    Strategy,
    deliver,
    take_order,
)
from automaton.verification.validator import validate_stored
from automaton.world.demand import build_orders
from automaton.world.prepared_floor import floor_for
from automaton.world.resolve import resolve
from automaton.world.starts import random_stands
from layouts.racks import Racks

SMALL = """
name: small
layout: {generator: racks, rows: 9, columns: 16, block: 3, last_row: 0}
fleet: {robots: 3, kinematics: omni, start: racks}
orders: {generator: dock-to-rack, count: 40}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: never, max_duration: 400}
measure: {warm_up: 50}
"""
LINE = """
name: line
layout:
  picture: |
    ~~~~~~~~
    i~rrrrrr
fleet: {robots: 1, kinematics: omni, start: [[7, 0]]}
orders: {list: [{from: [0, 1], to: [5, 1]}, {from: [0, 1], to: [2, 1]}, {from: [0, 1], to: [7, 1]}]}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: parked, max_duration: 100}
measure: {}
"""


@pytest.fixture
def scenario(tmp_path):
    def written(text, *settings, seed=None):
        path = tmp_path / "scenario.yaml"
        path.write_text(text)
        return resolve(path, settings, seed)

    return written


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The small warehouse after its 400 ticks, recorded."""
    path = tmp_path_factory.mktemp("small") / "small.yaml"
    path.write_text(SMALL)
    resolved = resolve(path)
    recorder = MemoryRecorder(resolved)
    simulation = Simulation(resolved, on_record=recorder)
    simulation.run()
    return simulation, recorder.recording()


# Orders and starts.


def demand(resolved, seed):
    floor = floor_for(resolved.floor_plan, "undirected", resolved.fleet.types)
    homes = np.array([resolved.floor_plan.cell(1, 1)])
    return build_orders(resolved, floor, seed, homes, None)[:2]


def test_orders_lead_from_docks_to_racks_each_drawn_alike(scenario):
    resolved = scenario(SMALL, "orders.count=4000")
    orders, slots = demand(resolved, 1)
    kind = resolved.floor_plan.kind.reshape(-1)[slots.cell]
    docks, racks = np.flatnonzero(kind == DOCK), np.flatnonzero(kind == RACK)
    assert set(orders.source) == set(docks) and set(orders.target) == set(racks)
    for drawn, slots_of_kind in ((orders.source, docks), (orders.target, racks)):
        expected = 4000 / len(slots_of_kind)
        times = np.bincount(drawn, minlength=len(kind))[slots_of_kind]
        assert abs(times - expected).max() < 5 * np.sqrt(expected)
    pairs = set(zip(orders.source.tolist(), orders.target.tolist(), strict=True))
    assert len(pairs) == len(docks) * len(racks), "source and target are drawn independently"


def test_an_order_depends_on_the_seed_and_its_number_alone(scenario):
    few, _ = demand(scenario(SMALL), 7)
    many, _ = demand(scenario(SMALL, "orders.count=900", "fleet.robots=9"), 7)
    other, _ = demand(scenario(SMALL), 8)
    assert many.source[:40].tolist() == few.source.tolist()
    assert many.target[:40].tolist() == few.target.tolist()
    assert other.target.tolist() != few.target.tolist()


def test_racks_without_access_are_never_drawn(scenario):
    text = SMALL.replace("last_row: 0", "last_row: 0, closed: [[5, 4]]")
    orders, slots = demand(scenario(text, "orders.count=2000"), 1)
    buried = (slots.access == NIL).all(axis=1)
    assert np.count_nonzero(buried) == 9
    assert not buried[orders.target].any()
    assert len(set(orders.target)) == 2 * 3 * 6 + 3 - 9


def test_robots_begin_in_front_of_racks_even_in_one_cell():
    floor_plan = Racks(rows=9, columns=16, block=3, last_row=0).build()
    stands = rack_stands(floor_plan)
    assert len(stands) == 36 and len(set(stands)) == 27
    starts = random_stands(floor_plan, 500, seed=3)
    assert set(starts) == set(stands)
    assert random_stands(floor_plan, 20, seed=3).tolist() == starts[:20].tolist()


@pytest.mark.parametrize("capacity", [1, 2])
def test_robots_begin_in_different_cells_where_cells_are_narrow(capacity):
    floor_plan = Racks(rows=9, columns=16, block=3, last_row=0, capacity=capacity).build()
    starts = random_stands(floor_plan, 27, seed=3)
    assert set(starts) == set(rack_stands(floor_plan))


# First come, first served.


def test_a_lone_robot_serves_the_orders_in_turn_without_delay(scenario):
    simulation = Simulation(scenario(LINE))
    simulation.run()
    orders = simulation.world.orders
    cell = simulation.resolved.floor_plan.cell
    assert orders.state.tolist() == [ORDER_DELIVERED] * 3
    # To the dock and back to (5, 0): 7 + 5 moves, the pick and the tick of setting down.
    assert (orders.delivered - orders.dispatched + 1).tolist() == [14, 9, 11]
    assert orders.dispatched.tolist() == [1, 15, 24]
    assert orders.dispatched_from.tolist() == [cell(7, 0), cell(5, 0), cell(2, 0)]
    figures = metrics_of(simulation)
    assert figures["task_time"] == pytest.approx(34 / 3)
    assert figures["delay"] == 0
    assert figures["throughput_per_robot"] == 1000 * 3 / simulation.tick
    assert list(figures) == [name for name in METRIC_CATALOGUE if name not in NOT_HERE]


NOT_HERE = set(OF_OTHER_RUNS) - set(TASK_METRICS)


@pytest.mark.parametrize("kinematics", ["omni", "differential"])
def test_times_at_slots_are_no_delay(scenario, kinematics):
    settings = ["durations.move=3", "durations.pick=4", "durations.drop=5"]
    resolved = scenario(LINE, *settings, f"fleet.kinematics={kinematics}")
    simulation = Simulation(resolved)
    simulation.run()
    turns = simulation.world.tally.ticks[0, 2].sum()
    assert (turns > 0) == (kinematics == "differential")
    assert metrics_of(simulation)["delay"] == 0


def test_the_oldest_order_is_taken_first(ran):
    orders = ran[0].world.orders
    taken = orders.dispatched[orders.dispatched != NIL]
    assert len(taken) > 20
    assert (orders.dispatched[: len(taken)] == np.sort(taken)).all()
    assert (orders.dispatched[len(taken) :] == NIL).all()


def test_every_order_is_looked_at_once_in_a_run(scenario):
    """Five thousand orders, some hundreds of questions: not a million looks."""
    simulation = Simulation(scenario(SMALL, "orders.count=5000", "stop.max_duration=3000"))
    simulation.run()
    taken = int((simulation.world.orders.dispatched != NIL).sum())
    assert taken > 200
    assert simulation.states[LAYER_ALLOCATION].looked == taken


class Plainly(Strategy):
    """First come, first served, looking at all orders each time."""

    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        out = decisions.allocation
        for k in range(batch.count):
            i = int(batch.robot[k])
            waits = (view.orders.state == ORDER_WAITING) & (view.orders.reserved_by == NIL)
            open_orders = np.flatnonzero(waits & (out.order_taken == 0))
            if batch.reason[k] == REASON_PICKED:
                deliver(view, out, k, i)
            elif batch.reason[k] == REASON_PERIODIC:
                continue
            elif len(open_orders):
                take_order(view, out, k, i, int(open_orders[0]))
            else:
                out.command[k] = CMD_PARK


@pytest.mark.parametrize("information", ["everything", "orders", "{radius: 2}"])
@pytest.mark.parametrize("seed", range(4))
def test_orders_that_are_given_back_are_taken_again(information, seed):
    """Robots in each other's way give orders back before they withdraw."""
    digests = []
    for name in ("first-come", "test_task_metrics:Plainly"):
        settings = [f"strategy.allocation={name}", "fleet.robots=5", f"information={information}"]
        simulation = Simulation(resolve("tabletop-mini", settings, seed))
        simulation.run()
        assert simulation.finished
        assert metrics_of(simulation)["retreats"] > 5
        digests.append(simulation.digest)
    assert digests[0] == digests[1]


# Figures, and the end of a run.


def test_figures_of_tasks_leave_the_warm_up_out(ran):
    simulation = ran[0]
    orders, figures = simulation.world.orders, metrics_of(simulation)
    done = orders.state == ORDER_DELIVERED
    times = (orders.delivered - orders.dispatched + 1)[done & (orders.dispatched > 50)]
    completed = np.count_nonzero(done & (orders.delivered > 50))
    assert 0 < len(times) < completed < np.count_nonzero(done)
    assert figures["task_time"] == pytest.approx(times.mean())
    assert figures["throughput_per_robot"] == pytest.approx(1000 * completed / (3 * 350))
    assert figures["delay"] == 0, "any number of robots fit into a cell"


TURNS = """
name: turns
layout:
  picture: |
    b+---+---+
    #|s$s|s$s|
    #+---+---+
    #|s$s|sss|
    #+---+---+d
fleet: {robots: 1, kinematics: rail}
orders: {generator: picture-loads}
durations: {move: 2, turn: 5, pick: 3, drop: 4}
stop: {when: parked, max_duration: 2000}
measure: {}
"""


@pytest.mark.parametrize("routing", ["shortest", "astar", "congestion"])
@pytest.mark.parametrize("kinematics", ["omni", "rail", "differential"])
def test_a_robot_alone_is_never_delayed(scenario, kinematics, routing):
    """It turns as often as it must, also where it takes an order and where it picks up."""
    strategies = [f"strategy.routing={routing}", "strategy.right_of_way=retreat"]
    simulation = Simulation(scenario(TURNS, f"fleet.kinematics={kinematics}", *strategies))
    simulation.run()
    assert simulation.finished and (simulation.world.orders.delivered != NIL).all()
    turns = int(simulation.world.tally.operations[0, ACTION_TURN].sum())
    assert (turns > 5) == (kinematics != "omni")
    assert metrics_of(simulation)["delay"] == 0


def test_the_heading_is_known_in_which_an_order_was_taken(scenario):
    simulation = Simulation(scenario(LINE.replace("i~", "i#"), "fleet.kinematics=differential"))
    before = int(simulation.world.robots.heading[0])
    simulation.run()
    east = 0
    assert simulation.world.orders.dispatched_heading.tolist() == [before, east, east]


@pytest.mark.parametrize("routing", ["shortest", "astar", "congestion"])
def test_a_differential_robot_alone_in_a_warehouse_is_not_delayed(scenario, routing):
    settings = ["fleet.robots=1", "fleet.kinematics=differential", "durations.turn=3"]
    simulation = Simulation(scenario(SMALL, *settings, f"strategy.routing={routing}"))
    simulation.run()
    figures = metrics_of(simulation)
    assert figures["delivered"] > 5 and figures["delay"] == 0


def test_narrow_aisles_delay(scenario):
    simulation = Simulation(scenario(SMALL, "layout.capacity=2", "strategy.right_of_way=retreat"))
    simulation.run()
    assert metrics_of(simulation)["delay"] > 0


def test_without_measure_there_are_no_figures_of_tasks(scenario):
    resolved = scenario(SMALL.replace("measure: {warm_up: 50}", ""))
    simulation = Simulation(resolved)
    simulation.run(until=60)
    assert not set(TASK_METRICS) & set(metrics_of(simulation))


def test_a_run_for_a_number_of_ticks_is_a_finished_run(tmp_path, capsys):
    path = tmp_path / "small.yaml"
    path.write_text(SMALL)
    assert main(["run", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["finished"] and found["ticks"] == 400
    assert set(TASK_METRICS) < set(found["metrics"])
    assert main(["run", str(path)]) == 0
    out = capsys.readouterr().out
    assert "ran for 400 ticks" in out and "task_time" in out and "delay" in out


def test_the_validator_accepts_the_run_and_refuses_a_rack_served_from_its_side(ran):
    _, recording = ran
    report = validate_stored(recording)
    assert report.valid and report.counts["drop"] > 20
    slots, plan = recording.header["slots"]["cell"], recording.header["floor"]
    kind = plan["kind"].reshape(-1)[slots]
    # The same run on a floor in which one dock that loads were fetched from is a rack.
    used = recording.header["orders"]["source"][0]
    assert kind[used] == DOCK
    kinds = plan["kind"].copy()
    kinds.reshape(-1)[slots[used]] = RACK
    altered = replace(recording, header=recording.header | {"floor": plan | {"kind": kinds}})
    texts = [violation.text for violation in validate_stored(altered).violations]
    assert "order 0 starts on no shelf" in texts
    assert "handles a rack from the side" in texts


# What is refused.


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (("count: 40", "count: 0"), 5, "orders.count must be a whole number from 1 to 1000000"),
        ((", count: 40", ""), 5, "the generator dock-to-rack needs a count of orders"),
        (
            ("dock-to-rack", "full-shelves"),
            5,
            "count belongs to the generators dock-to-rack, stations, visits",
        ),
        (("warm_up: 50", "warm_up: 400"), 8, "measure begins after 400 ticks (warm_up), but"),
        (("warm_up: 50", "warm_up: -1"), 8, "measure.warm_up must be a whole number from 0"),
        (("when: never", "when: nevr"), 7, "(did you mean 'never'?)"),
        (("first-come", "first-cme"), 6, "(did you mean 'first-come'?)"),
        (("start: racks", "start: rack"), 4, "(did you mean 'racks'?)"),
    ],
)
def test_bad_values_are_named_with_their_place(scenario, change, line, message):
    with pytest.raises(InputError) as raised:
        scenario(SMALL.replace(*change))
    assert message in str(raised.value) and raised.value.line == line


DRAWN = """
name: drawn
layout:
  picture: |
{picture}
fleet: {fleet}
orders: {orders}
"""
TWO = "{robots: 2, kinematics: omni, start: racks}"
TEN = "{generator: dock-to-rack, count: 10}"


@pytest.mark.parametrize(
    ("picture", "fleet", "orders", "message"),
    [
        ("i~~\n#rr", TWO, "{list: [{from: [1, 1], to: [2, 1]}]}", "[1, 1] is a rack"),
        ("i~~\n#rr", TWO, "{list: [{from: [0, 0], to: [0, 0]}]}", "[0, 0] is a dock"),
        ("i~~\n#rs", TWO, TEN.replace("dock-to-rack, count: 10", "full-shelves"), "a destination"),
        ("~~~\nrrr", TWO, TEN, "the orders dock-to-rack need a dock, but the floor has none"),
        ("i~~\n###", TWO, TEN, "robots cannot stand in front of any rack"),
        ("i~~\n###", TWO.replace("racks", "random"), TEN, "need a rack, but the floor has none"),
        ("i~~r", TWO, TEN, "robots cannot stand in front of any rack"),
        ("i~~r", TWO.replace("racks", "random"), TEN, "no rack can be served"),
        ("i#~\n##r", TWO, TEN, "no dock can be served"),
        ("i..\n#r#", TWO, TEN, "fleet.robots is 2 but in front of racks there is room for 1"),
        (
            "i~~\n#rr\n##r",
            TWO,
            "{list: [{from: [0, 0], to: [2, 2]}]}",
            "the rack at [2, 2] cannot be served",
        ),
    ],
)
def test_floors_that_cannot_serve_are_refused(scenario, picture, fleet, orders, message):
    rows = "\n".join("    " + row for row in picture.split("\n"))
    text = DRAWN.replace("{picture}", rows).replace("{fleet}", fleet).replace("{orders}", orders)
    with pytest.raises(InputError) as raised:
        scenario(text)
    assert message in str(raised.value) and raised.value.line is not None


def test_where_nothing_ended_there_are_no_times() -> None:
    run = Simulation(resolve("warehouse-100", ["fleet.robots=2"]))
    run.run(until=310)  # ten ticks after the warm-up
    figures = metrics_of(run)
    times = {"task_time", "delay", "delay_p95"}
    assert not times & set(figures) and "throughput_per_robot" in figures
    nothing = Simulation(resolve("depots", []))
    nothing.run(until=1)
    assert not {"lead_time", "lead_time_p95", "legs_per_order"} & set(metrics_of(nothing))


def test_a_rack_out_of_reach_is_no_fault_if_there_are_others(scenario):
    rows = "\n".join("    " + row for row in ("i~~", "#rr", "##r"))
    text = DRAWN.replace("{picture}", rows).replace("{fleet}", TWO).replace("{orders}", TEN)
    assert scenario(text).floor_plan.width == 3


@pytest.mark.parametrize(
    ("values", "found"),
    [([7], 7), (list(range(1, 101)), 95), (list(range(1, 21)), 19), ([3, 1, 2], 3)],
)
def test_a_quantile_is_the_least_value_that_95_percent_do_not_exceed(
    values: list[int], found: float
) -> None:
    assert quantile(np.array(values, np.int64), 95) == found
