"""Orders without a load: a robot stands in their stops in turn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.observation import EVENT_NAMES
from automaton.engine.state import LAYER_ALLOCATION, LAYER_CHARGING
from automaton.history.event_history import EventHistory
from automaton.runs.simulation import Simulation
from automaton.strategy import lookup
from automaton.strategy.api import (
    CMD_RETREAT,
    CMD_STEP,
    CMD_TAKE_ORDER,
    GOAL_STOP,
    NIL,
    ORDER_STARTED,
    Strategy,
)
from automaton.verification.verification import verify_recording
from automaton.world.resolved import Resolved

CORRIDOR = "........"
STRATEGY = {"allocation": "first-come", "right_of_way": "wait"}
Stops = Sequence[tuple[int, int]]


def tours(
    *orders: Stops,
    start: Sequence[tuple[int, int]] = ((0, 0),),
    picture: str = CORRIDOR,
    **parts: Any,
) -> Resolved:
    """Orders without a load, known from the start, each a sequence of cells (x, y)."""
    listed = {"list": [{"stops": list(stops)} for stops in orders]}
    parts.setdefault("strategy", STRATEGY)
    return scene(picture, list(start), orders=listed, **parts)


def events(run: Simulation, history: EventHistory, *names: str) -> list[tuple[int, str, int, int]]:
    """(tick, event, robot, order) of the events of these names."""
    found = [history.event(k) for k in range(len(history.events))]
    told = [(e.tick, EVENT_NAMES[e.code], e.robot, e.subject) for e in found]
    return [one for one in told if one[1] in names]


def played(resolved: Resolved, strategies: Any = None) -> tuple[Simulation, EventHistory]:
    history = EventHistory()
    run = Simulation(resolved, on_observe=history, strategies=strategies)
    run.run()
    return run, history


def test_stops_are_done_in_their_sequence_and_nobody_is_asked_between() -> None:
    run, history = played(tours([(3, 0), (6, 0), (5, 0)]))
    assert run.world.stops.done.tolist() == [3, 6, 7]
    assert run.finished and run.tick == 7, "no tick lies between two legs"
    assert run.world.tally.batches[LAYER_ALLOCATION] == 1
    assert events(run, history, "visited", "delivered") == [
        (3, "visited", 0, 0),
        (6, "visited", 0, 0),
        (7, "visited", 0, 0),
        (7, "delivered", 0, 0),
    ]


def test_a_later_stop_on_the_way_does_not_count() -> None:
    run, _ = played(tours([(6, 0), (3, 0)]))
    assert run.world.stops.done.tolist() == [6, 9]


def test_who_stands_there_when_it_takes_the_order_has_done_it_at_the_end_of_that_tick() -> None:
    run, history = played(tours([(0, 0)], [(0, 0), (1, 0)]))
    assert run.world.orders.delivered.tolist() == [1, 3]
    assert run.world.stops.done.tolist() == [1, 2, 3]
    assert events(run, history, "order taken", "order returned") == [
        (1, "order taken", 0, 0),
        (2, "order taken", 0, 1),
    ]


def test_a_robot_does_one_stop_in_a_tick() -> None:
    run, _ = played(tours([(2, 0), (2, 0), (2, 0)]))
    assert run.world.stops.done.tolist() == [2, 3, 4]


def test_a_robot_in_a_long_move_stands_nowhere() -> None:
    """It leaves (0, 0) in tick 1, gets the order meanwhile, and comes back for it."""
    resolved = tours([(1, 0)], [(0, 0)], durations={"move": 4})
    run, _ = played(resolved)
    assert run.world.stops.done.tolist() == [4, 8]


def test_turns_are_part_of_the_legs() -> None:
    fleet = {"robots": 1, "kinematics": "differential", "start": [(0, 0)]}
    resolved = tours([(2, 0), (2, 1)], picture="...\n...", durations={"turn": 5}, fleet=fleet)
    run, _ = played(resolved)
    assert run.world.stops.done.tolist() == [7, 13], "it faces south: turn, two moves; turn, move"


class Steers(Strategy):
    """Right of way that lets robot 0 step east, whatever its route."""

    layer = "right_of_way"
    period = 1

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        if view.clock.tick <= 3:
            decisions.right_of_way.command[0] = CMD_STEP
            decisions.right_of_way.value[0] = 0


class NoRoute(Strategy):
    """Routing that gives no routes."""

    layer = "routing"

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        pass


def layers(**mine: Strategy) -> list[Any]:
    """first-come and shortest, with other strategies in their places."""
    names = {"allocation": "first-come", "routing": "shortest", "right_of_way": "wait"}
    built_in = {
        layer: lookup.load(layer, name)(lookup.parameters_type(layer, name)())
        for layer, name in names.items()
    }
    return [
        (built_in | mine).get(layer)
        for layer in ("zoning", "charging", "allocation", "routing", "right_of_way")
    ]


def test_it_does_not_matter_how_a_robot_came_to_its_stop() -> None:
    run, _ = played(tours([(1, 0), (3, 0)]), layers(right_of_way=Steers(), routing=NoRoute()))
    assert run.world.stops.done.tolist() == [1, 3]


class Gives(Strategy):
    """Allocation by a table: tick -> {robot: order}."""

    layer = "allocation"
    period = 1

    def __init__(self, **ticks: dict[int, int]) -> None:
        super().__init__()
        self.ticks = {int(name[1:]): given for name, given in ticks.items()}

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        given = self.ticks.get(int(view.clock.tick), {})
        for k in range(batch.count):
            order = given.get(int(view.robots.identity[batch.robot[k]]))
            if order is not None:
                stop = view.orders.first_stop[order] + view.orders.stops_done[order]
                decisions.allocation.command[k] = CMD_TAKE_ORDER
                decisions.allocation.order[k] = order
                decisions.allocation.goal_cell[k] = view.stops.cell[stop]


def given(*orders: Stops, until: int, **ticks: dict[int, int]) -> tuple[Simulation, EventHistory]:
    """A run of two robots, at both ends of a corridor, that get orders by a table."""
    history = EventHistory()
    resolved = tours(*orders, start=[(0, 0), (7, 0)])
    run = Simulation(resolved, on_observe=history, strategies=layers(allocation=Gives(**ticks)))
    run.run(until=until)
    return run, history


def test_an_order_that_is_not_begun_may_be_given_to_another_robot() -> None:
    run, history = given([(3, 0), (1, 0)], until=9, t1={1: 0}, t2={0: 0})
    assert events(run, history, "order taken", "order returned", "visited") == [
        (1, "order taken", 1, 0),
        (2, "order taken", 0, 0),
        (2, "order returned", 1, 0),
        (4, "visited", 0, 0),
        (6, "visited", 0, 0),
    ]
    assert run.world.robots.cell[1] == run.world.grid.width + 7, (
        "B went one cell, and stopped there"
    )


def test_robots_exchange_orders_in_one_batch() -> None:
    run, _ = given([(4, 0)], [(3, 0)], until=2, t1={0: 0, 1: 1}, t2={0: 1, 1: 0})
    assert run.world.orders.reserved_by.tolist() == [1, 0]
    assert run.world.tally.illegal[LAYER_ALLOCATION] == 0


def test_an_order_that_is_begun_stays_with_its_robot() -> None:
    run, _ = given([(1, 0), (6, 0)], until=4, t1={0: 0}, t3={1: 0})
    assert run.world.orders.state[0] == ORDER_STARTED
    assert run.world.orders.reserved_by[0] == 0
    assert run.world.tally.illegal[LAYER_ALLOCATION] == 1


def test_who_has_begun_an_order_gets_no_other() -> None:
    run, _ = given([(1, 0), (6, 0)], [(4, 0)], until=4, t1={0: 0}, t3={0: 1})
    assert run.world.robots.order[0] == 0
    assert run.world.tally.illegal[LAYER_ALLOCATION] == 1


def test_a_batch_gives_an_order_to_one_robot() -> None:
    run, _ = given([(4, 0)], until=1, t1={0: 0, 1: 0})
    assert run.world.orders.reserved_by[0] == 0
    assert run.world.tally.illegal[LAYER_ALLOCATION] == 1


def test_only_the_next_stop_is_a_legal_goal() -> None:
    class Wrong(Gives):
        def decide(self, view: Any, *others: Any) -> None:
            super().decide(view, *others)
            others[1].allocation.goal_cell[:] = view.stops.cell[1]

    resolved = tours([(3, 0), (5, 0)])
    run = Simulation(resolved, strategies=layers(allocation=Wrong(t1={0: 0})))
    run.run(until=2)
    assert run.world.orders.reserved_by[0] == NIL
    assert run.world.tally.illegal[LAYER_ALLOCATION] == 1


def test_the_order_of_a_robot_that_breaks_down_waits_with_the_stops_that_are_left() -> None:
    faults = {"list": [{"robot": 0, "at": 3}], "tow_after": 4}
    resolved = tours([(2, 0), (4, 0)], start=[(0, 0), (7, 0)], faults=faults)
    history = EventHistory()
    run = Simulation(resolved, on_observe=history)
    run.run(until=2)
    assert run.world.orders.state[0] == ORDER_STARTED
    run.run()
    assert run.finished
    visits = events(run, history, "visited", "order taken")
    assert [one[1:] for one in visits] == [
        ("order taken", 0, 0),
        ("visited", 0, 0),
        ("order taken", 1, 0),
        ("visited", 1, 0),
    ], "the stop that is done is not repeated"
    assert run.world.orders.legs[0] == 2, "two robots have begun it"


class Retreats(Strategy):
    """Right of way that sends robot 0 on a retreat, and wants its order back."""

    layer = "right_of_way"
    period = 1

    def __init__(self, tick: int, moves: int) -> None:
        super().__init__()
        self.tick, self.moves = tick, moves

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        out = decisions.right_of_way
        if view.clock.tick == self.tick:
            out.command[0], out.value[0], out.return_order[0] = (
                CMD_RETREAT,
                self.moves,
                1,
            )
        elif view.robots.retreat_moves[0]:
            out.command[0], out.value[0] = CMD_STEP, 0


@pytest.mark.parametrize("moves", [2, 0])
@pytest.mark.parametrize(("tick", "keeps"), [(2, False), (4, True)])
def test_a_retreat_returns_only_what_is_not_begun(tick: int, keeps: bool, moves: int) -> None:
    """So does a retreat of no moves, after which the robot plans again where it stands."""
    right_of_way = Retreats(tick, moves)
    run = Simulation(tours([(3, 0), (6, 0)]), strategies=layers(right_of_way=right_of_way))
    run.run(until=tick)
    assert (run.world.robots.order[0] != NIL) == keeps
    if keeps:
        assert run.world.robots.goal_type[0] == GOAL_STOP
        run.run()
        assert run.world.stops.done.tolist() == [3, 7], "a tick to decide, and the same way"


def test_who_has_begun_an_order_does_not_go_to_charge() -> None:
    from example_strategies import ChargeFirst

    class ChargesLate(ChargeFirst):
        def decide(self, view: Any, *others: Any) -> None:
            if view.clock.tick == 3:
                others[1].charging.goal_cell[0] = view.chargers.cell[0]
                others[1].charging.charge_target[0] = 1_000

    battery = {"drain": {"move": 0.1}, "charge_rate": 10.0}
    resolved = tours([(1, 0), (6, 0)], picture="c.......", start=[(0, 0)], battery=battery)
    run = Simulation(resolved, strategies=layers(charging=ChargesLate()))
    run.run(until=3)
    assert run.world.tally.illegal[LAYER_CHARGING] == 1
    assert run.world.robots.goal_type[0] == GOAL_STOP


@pytest.mark.parametrize("kinematics", ["omni", "differential"])
def test_a_run_with_tours_is_recorded_and_comes_out_equal_again(kinematics: str) -> None:
    picture = ".......\n.##.##.\n......."
    fleet = {"robots": 2, "kinematics": kinematics, "start": [(0, 0), (6, 2)]}
    faults = {"failure_probability": 0.01, "tow_after": 3, "repair_time": 5}
    orders = {"generator": "tours", "count": 30, "stops": {"from": 1, "to": 4}}
    resolved = scene(picture, [(0, 0)], orders=orders, fleet=fleet, faults=faults)
    run, recorder = recorded_run(resolved)
    found = verify_recording(recorder.recording())
    assert found.report.violations == [] and found.difference is None
    assert found.report.counts["visit"] == len(run.world.stops.cell) > 60
