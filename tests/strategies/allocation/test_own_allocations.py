"""Robots of one fleet with different allocation strategies: `fleet.types[].strategy.allocation`."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from drawn_scenes import recorded_run
from panel_harness import moment, of_robot, shown
from played_back import check_at, digests_of, playback_of, recorded

from automaton.commands.check import described
from automaton.engine.record_codes import CHANGE_DROPPED
from automaton.engine.state import LAYER_ALLOCATION, LAYER_NAMES, NIL, STRATEGY_COUNT
from automaton.errors import InputError
from automaton.recording.contents import FRAME_KIND_TICKS
from automaton.recording.frames import Recording, encoded, resolved_of
from automaton.recording.recording_reader import read_recording
from automaton.runs.headless import run_once
from automaton.runs.run_report import heading
from automaton.runs.simulation import Simulation
from automaton.units import unit
from automaton.verification.verification import verify_recording
from automaton.world.resolve import MAX_ALLOCATIONS, Resolved, branched, resolve
from tui.widgets.inspector import Inspector

BRIGADE, CARRIERS = (0, 1), (2, 3)
GREEDY = tuple({"name": "greedy", "reassign": ticks} for ticks in (7, 5))


def mixed(*own: Any, scenario: str = "tabletop-1", **settings: Any) -> Resolved:
    """A shipped scenario with a type of two robots for each of some allocations; None: the scenario's."""
    types: list[dict[str, Any]] = [
        {"name": f"type {number}", "robots": 2}
        | ({} if spec is None else {"strategy": {"allocation": spec}})
        for number, spec in enumerate(own)
    ]
    texts = [f"{key.replace('__', '.')}={value}" for key, value in settings.items()]
    fleet = [f"fleet.robots={2 * len(types)}", f"fleet.types={msgspec.json.encode(types).decode()}"]
    return resolve(scenario, [*fleet, *texts])


def dropped_at(recording: Recording) -> dict[int, set[int]]:
    """The slots where each robot has set loads down."""
    found: dict[int, set[int]] = {}
    for frame in recording.frames:
        if frame.kind == FRAME_KIND_TICKS:
            for _, code, robot, slot in frame.content["changes"].tolist():
                if code == CHANGE_DROPPED:
                    found.setdefault(robot, set()).add(slot)
    return found


@pytest.mark.parametrize("information", ["everything", "orders", "{radius: 3}"])
def test_two_pass_loads_on_and_two_carry_them_all_the_way(information: str) -> None:
    resolved = mixed(
        "cooperative", None, strategy__allocation="independent", information=information
    )
    run, recorder = recorded_run(resolved)
    assert run.finished
    recording = recorder.recording()
    endless = run.world.slots.unbounded
    shelves = {r: sum(not endless[s] for s in at) for r, at in dropped_at(recording).items()}
    assert all(shelves[r] > 0 for r in BRIGADE), "a brigade passes loads on"
    assert all(shelves[r] == 0 for r in CARRIERS), "the others do not"
    assert verify_recording(recording).passed


@pytest.mark.parametrize(
    ("scenario", "own", "information"),
    [
        ("tabletop-mini", ("cooperative", "independent"), "everything"),
        ("tabletop-mini", ("cooperative", "independent"), "{radius: 3}"),
        ("random-400", GREEDY, "everything"),
        ("random-400", (None, *GREEDY), "{radius: 3}"),
        ("depots", ("auction", "first-come"), "everything"),
    ],
)
def test_a_recording_is_played_back(scenario: str, own: tuple[Any, ...], information: str) -> None:
    settings = {"stop__max_duration": 300, "information": information}
    if scenario == "random-400":
        settings |= {"strategy__right_of_way": "pibt", "strategy__allocation": "first-come"}
    recording = recorded(mixed(*own, scenario=scenario, **settings))
    digests, playback = digests_of(recording), playback_of(recording)
    for tick in (len(digests) // 2, len(digests), 10):
        check_at(playback, digests, tick)


def test_it_does_not_depend_on_how_robots_are_stored() -> None:
    resolved = mixed("cooperative", "independent", "adaptive", "shortest-job")
    usual = Simulation(resolved)
    other = Simulation(resolved, storage=np.array([5, 0, 7, 2, 6, 4, 1, 3], np.int32))
    for run in (usual, other):
        run.run(until=4000)
    assert usual.digest == other.digest


@pytest.mark.parametrize("spec", ["cooperative", {"name": "greedy", "reassign": 30}])
def test_types_with_the_same_strategy_share_it(spec: Any) -> None:
    """So it is as if that were the scenario's; its own is then asked about nobody."""
    scenario = "tabletop-1" if spec == "cooperative" else "crossing"
    alike = mixed(spec, spec, scenario=scenario, strategy__allocation="first-come")
    usual = mixed(None, None, scenario=scenario)
    usual = resolve(usual.scenario, [f"strategy.allocation={msgspec.json.encode(spec).decode()}"])
    assert alike.allocation_of_types == [0, 0] and len(alike.allocations) == 1
    runs = [Simulation(one) for one in (alike, usual)]
    for run in runs:
        run.run(until=3000)
    assert runs[0].digest == runs[1].digest


def test_strategies_in_python_and_compiled_ones_go_together() -> None:
    runs = [
        Simulation(mixed("cooperative", name, scenario="tabletop-mini"))
        for name in ("independent", "independent-python")
    ]
    for run in runs:
        run.run()
    assert runs[0].finished and runs[0].digest == runs[1].digest


def test_each_is_asked_in_its_own_period() -> None:
    own, other = GREEDY
    run = Simulation(mixed(own, other, None, scenario="random-400"))
    period = run.world.rules.period
    assert period[LAYER_ALLOCATION] == 0
    assert period[5:].tolist() == [7, 5, 0]
    assert run.world.rules.allocation.tolist() == [5, 6, LAYER_ALLOCATION]


def test_an_auction_sells_to_its_own_robots() -> None:
    resolved = mixed("auction", "first-come", scenario="depots", orders__count=40)
    run, recorder = recorded_run(resolved)
    assert run.finished and (run.world.tally.illegal == 0).all()
    took = run.world.orders.dispatched_to[run.world.orders.delivered != NIL]
    assert {0, 1} & set(took.tolist()) and {2, 3} & set(took.tolist()), "both do some"
    planned = [planned_orders(one) for one in (resolved, mixed("auction", None, scenario="depots"))]
    assert planned[0] == {0, 1} and planned[1] == {0, 1, 2, 3}
    assert verify_recording(recorder.recording()).passed


def test_a_branch_keeps_what_stays() -> None:
    """The base changes to the strategy of a type: both are one then, and the other keeps its lists."""
    settings = {"strategy__allocation": "greedy", "fleet__start": "random"}
    resolved = mixed("auction", "first-come", None, scenario="depots", **settings)
    run = Simulation(resolved)
    run.run(until=300)
    lists = run.world.robots.order_queue_length.copy()
    assert lists.sum() > 0
    changed = branched(resolved, ("strategy.allocation=auction",))
    assert [choice.name for choice in changed.allocations] == ["auction", "first-come"]
    after = run.continue_with(changed)
    assert after.world.robots.order_queue_length.tolist() == lists.tolist()
    after.run(until=600)
    assert (after.world.tally.illegal == 0).all()


def test_a_branch_is_checked_for_types_too() -> None:
    resolved = mixed("auction", None, scenario="depots", strategy__allocation="greedy")
    with pytest.raises(InputError, match="information"):
        branched(resolved, ("information=orders", "strategy.charging=none"))


def planned_orders(resolved: Resolved) -> set[int]:
    """Who has had orders ahead of it in the first 500 ticks."""
    run, found = Simulation(resolved), set[int]()
    while run.tick < 500:
        run.run(until=run.tick + 1)
        robots = run.world.robots
        found |= set(robots.identity[robots.order_queue_length > 0].tolist())
    return found


def test_it_goes_on_in_a_branch() -> None:
    resolved = mixed("cooperative", "independent")
    whole, run = Simulation(resolved), Simulation(resolved)
    run.run(until=500)
    run = run.continue_with(branched(resolved, ("stop.max_duration=49000",)))
    run.run()
    whole.run()
    assert run.finished and run.digest == whole.digest


def test_in_finer_ticks_they_decide_alike() -> None:
    """Of moves of one tick, decided in coarse ones: the same orders at the same times."""
    settings = {"world__following": "convoy"}
    once = Simulation(mixed("cooperative", "independent", scenario="tabletop-mini", **settings))
    fine = Simulation(
        mixed("cooperative", "independent", scenario="tabletop-mini", refine=2, **settings)
    )
    once.run()
    fine.run()
    assert once.finished and fine.finished
    assert fine.world.orders.dispatched_to.tolist() == once.world.orders.dispatched_to.tolist()


def test_the_report_names_them() -> None:
    resolved = mixed("cooperative", None, strategy__allocation="independent")
    outcome = run_once(resolved)
    head = "\n".join(heading(resolved, outcome, unit(resolved.scenario.units.tick)))
    assert "allocation independent (type 0: cooperative)" in head
    nobody_else = mixed("cooperative", "adaptive")
    head = "\n".join(heading(nobody_else, outcome, unit(resolved.scenario.units.tick)))
    assert "allocation type 0: cooperative, type 1: adaptive, routing" in head
    assert "4 robots (type 0 2 by cooperative, type 1 2)" in described(resolved)
    types = '[{"name": "brigade", "robots": 2, "strategy": {"allocation": "cooperative"}}, {"name": "b"}]'
    view = moment(20, "tabletop-1", f"fleet.types={types}")
    assert "brigade: allocation cooperative" in shown(Inspector(), of_robot(view, 0))


# Bad input


@pytest.mark.parametrize(
    ("types", "sentence"),
    [
        (
            [{"name": "a", "strategy": {"allocation": "cooperativ"}}],
            "allocation strategy 'cooperativ' is unknown",
        ),
        (
            [{"name": "a", "strategy": {"routing": "astar"}}],
            "fleet.types[0].strategy.routing: all robots have the same one; set it under strategy",
        ),
        (
            [{"name": "a", "strategy": {"allocation": {"name": "greedy", "reasign": 3}}}],
            "unknown key 'reasign' in fleet.types[0].strategy.allocation (did you mean 'reassign'?)",
        ),
        (
            [{"name": "a", "strategy": {"allocation": {"name": "independent-python", "x": 1}}}],
            "unknown key 'x' in fleet.types[0].strategy.allocation; no keys are allowed",
        ),
        (
            [{"name": "a", "strategy": {"allocation": {"reassign": 3}}}],
            "the key 'name' is missing in fleet.types[0].strategy.allocation",
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_place(
    tmp_path: Path, types: list[dict[str, Any]], sentence: str
) -> None:
    scenario: dict[str, Any] = {
        "name": "wrong",
        "layout": {"picture": "s...d"},
        "fleet": {"robots": 1, "types": types},
    }
    path = tmp_path / "wrong.yaml"
    path.write_bytes(msgspec.yaml.encode(scenario))
    with pytest.raises(InputError) as caught:
        resolve(path)
    assert sentence in str(caught.value) and "wrong.yaml:" in str(caught.value)


def test_more_than_four_are_refused() -> None:
    own = ["independent", "adaptive", "shortest-job", "first-come"]
    assert len(mixed(*own).allocations) == 4, "the scenario's own is asked about nobody"
    with pytest.raises(InputError, match="name 5 different allocation strategies; at most 4"):
        mixed(*own, None)
    assert 1 + STRATEGY_COUNT - len(LAYER_NAMES) == MAX_ALLOCATIONS


def test_a_part_of_one_can_be_set(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    types = [{"name": "a", "robots": 2, "strategy": {"allocation": "greedy"}}, {"name": "b"}]
    scenario = {
        "name": "own",
        "layout": {"picture": "tt\n.."},
        "fleet": {"robots": 3, "types": types},
    }
    path.write_bytes(
        msgspec.yaml.encode(scenario | {"orders": {"generator": "stations", "count": 5}})
    )
    resolved = resolve(path, ["fleet.types.0.strategy.allocation.idle=stay"])
    own = resolved.own_allocations[0]
    assert own is not None and own.parameters.idle == "stay"  # type: ignore[attr-defined]
    assert resolved.may_stay


def test_a_recording_has_the_strategies_of_its_scenario(tmp_path: Path) -> None:
    resolved = mixed("cooperative", None, stop__max_duration=20)
    _, recorder = recorded_run(resolved)
    recording = recorder.recording()
    assert resolved_of(recording.header).own_allocations[0] == resolved.own_allocations[0]
    for name, change in (
        ("named", {"allocation of type 0": {"name": "adaptive", "parameters": {}}}),
        ("more", {"allocation of type 1": {"name": "adaptive", "parameters": {}}}),
    ):
        header = copy.deepcopy(recording.header)
        header["strategies"] |= change
        path = tmp_path / f"{name}.rec"
        path.write_bytes(encoded(header, recording.frames))
        with pytest.raises(InputError, match=r"its scenario|strategies for|but recorded as"):
            read_recording(path)


def test_a_scenario_without_types_has_one_allocation() -> None:
    resolved = resolve("tabletop-mini")
    assert resolved.own_allocations == () and resolved.allocation_of_types == []
    assert [layer for layer, _ in resolved.choices] == list(resolved.strategies)
