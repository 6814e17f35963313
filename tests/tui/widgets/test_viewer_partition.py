"""Stations and the zones that robots serve in the panels, in Find, in events and breakpoints."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from panel_harness import moment, of_cell, of_robot, shown

from automaton.commands import main
from automaton.engine.observation import (
    CAUSE_REDESIGN,
    EVENT_JOB_DONE,
    EVENT_PART_FINISHED,
    EVENT_ZONES_REDESIGNED,
)
from automaton.engine.state import NIL, ORDER_CARRIED, ORDER_WAITING
from automaton.errors import InputError
from automaton.history.breakpoints import breakpoint_of
from automaton.history.event_history import Event, EventHistory, event_words
from automaton.history.explanation import explain
from automaton.history.live_run import LiveRun
from automaton.history.snapshot import take_snapshot
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.zoning.loads_and_transfers import load_of
from strategies.zoning.service_zone_lines import coloured, partition_picture
from strategies.zoning.zone_workspace import space_for, zone_rules
from tui.playback.film import Request, make_picture
from tui.playback.panel_view import View
from tui.screens.find_dialog import find
from tui.widgets.event_list import EventFilter, kinds_of
from tui.widgets.inspector import Inspector
from tui.widgets.metrics_panel import Figures
from tui.widgets.robot_table import ROBOT_TABLE_COLUMNS

DDZ = "strategy.zoning={name: decentralized, design: factory-ddz, adjacency: 300}"
AT = 2500


@pytest.fixture(scope="module")
def factory() -> View:
    """Three robots at work in zones, lines at some stations."""
    return moment(AT, "factory")


def observed(*settings: str) -> tuple[Simulation, EventHistory]:
    event_history = EventHistory()
    return Simulation(resolve("factory", list(settings)), on_observe=event_history), event_history


def station_with(view: View, mask: np.ndarray) -> int:
    return int(np.flatnonzero(mask)[0])


def of_station(view: View, station: int) -> View:
    (cell,) = find(f"station {station + 1}", view).cells
    return of_cell(view, *view.floor_plan.xy(cell))


# The inspector


def test_a_station_tells_its_zone_its_work_and_its_line(factory: View) -> None:
    stations, service_zones = factory.snapshot.stations, factory.snapshot.service_zones
    in_service = stations.in_service
    at = station_with(
        factory, (in_service != NIL) & (stations.next_in_queue[np.maximum(in_service, 0)] != NIL)
    )
    said = shown(Inspector(), of_station(factory, at), 60)
    part, left = stations.part[in_service[at]], stations.job_done_tick[at] - AT
    assert f"station {at + 1} of 18, in zone {service_zones.design.zone[at] + 1}" in said
    assert f"works on part {part}, {left} ticks left" in said
    assert f"queue {len(line_of(factory, at))} part" in said
    done = int(np.count_nonzero((stations.station == at) & (stations.completion_tick != NIL)))
    assert f"so far {done} part" in said


def line_of(view: View, station: int) -> list[int]:
    """Works that have come there and are not begun, found without following the line."""
    stations = view.snapshot.stations
    there = (
        (stations.station == station)
        & (stations.arrival_tick != NIL)
        & (stations.completion_tick == NIL)
    )
    return [work for work in np.flatnonzero(there) if work != stations.in_service[station]]


def test_a_transfer_station_names_its_zones(factory: View) -> None:
    transfer = factory.snapshot.service_zones.design.transfer
    a, b, station = (int(n) for n in np.argwhere(transfer)[0])
    said = shown(Inspector(), of_station(factory, station), 60)
    assert f"between zone {min(a, b) + 1} - zone {max(a, b) + 1}" in said


def test_a_robot_tells_its_zone_and_its_queue(factory: View) -> None:
    orders, service_zones = factory.snapshot.orders, factory.snapshot.service_zones
    for robot in range(3):
        said = shown(Inspector(), of_robot(factory, robot), 60)
        mine = (
            (service_zones.queue == robot)
            & (orders.state == ORDER_WAITING)
            & (orders.reserved_by == NIL)
        )
        assert f"serves zone {robot + 1}" in said
        assert f"queue {np.count_nonzero(mine)} order" in said and "halted" not in said


def test_a_robot_and_its_zone_tell_how_long_the_work_in_the_queue_takes(factory: View) -> None:
    """As the zones' own kernel reckons it, of all stations and without a base."""
    orders, service_zones = factory.snapshot.orders, factory.snapshot.service_zones
    workspace = space_for(service_zones.roads, 3)
    workspace.member[:] = 1
    speed, handling = 60 / 0.635055, 8 * 0.635055 / 60
    rules = zone_rules(speed, adjacent=1, base=0, handling=handling)
    for robot in range(3):
        legs = np.zeros((18, 18))
        for order in np.flatnonzero(
            (service_zones.queue == robot) & (service_zones.next_slot != NIL)
        ):
            if orders.state[order] in (ORDER_WAITING, ORDER_CARRIED):
                slot = (
                    orders.current_slot
                    if orders.state[order] == ORDER_WAITING
                    else service_zones.picked_from
                )
                here, there = service_zones.station_of[
                    [slot[order], service_zones.next_slot[order]]
                ]
                legs[here, there] += here != there
        minutes = load_of(service_zones.roads.read_only(), rules, legs, workspace, robot)
        assert minutes > 1
        said = shown(Inspector(), of_robot(factory, robot), 70)
        assert f"its work {minutes:.1f} minutes of driving and handling" in said
        said = shown(Inspector(), replace(factory, zone=robot), 70)
        assert f"work {minutes:.1f} minutes of driving and handling" in said


def test_an_order_tells_its_queue_and_its_next_stop(factory: View) -> None:
    service_zones, orders = factory.snapshot.service_zones, factory.snapshot.orders
    order = int(np.flatnonzero((service_zones.queue >= 0) & (orders.state == ORDER_WAITING))[0])
    panel = Inspector()
    panel.order = order
    panel._chosen = (NIL, NIL, NIL)
    said = shown(panel, factory, 60)
    stop = service_zones.station_of[service_zones.next_slot[order]] + 1
    last = service_zones.next_slot[order] == orders.target[order]
    assert f"queue of zone {service_zones.queue[order] + 1}" in said
    assert f"next stop station {stop}, {'its target' if last else 'a transfer station'}" in said


def test_a_zone_lists_its_stations_and_its_transfer_stations(factory: View) -> None:
    design = factory.snapshot.service_zones.design
    said = shown(Inspector(), replace(factory, zone=1), 60)
    assert "zone 2 of 3 that robots serve" in said and "served by robot 1" in said
    listed = ", ".join(str(s + 1) for s in np.flatnonzero(design.zone == 1))
    assert f"stations {listed}" in said
    for other in (0, 2):
        shared = ", ".join(str(s + 1) for s in np.flatnonzero(design.transfer[1, other]))
        assert (f"to zone {other + 1} through {shared}" in said) == bool(shared)


def test_robots_that_stand_still_say_why_and_for_how_long(factory: View) -> None:
    service_zones = factory.snapshot.service_zones
    halt = np.array([NIL, AT + 30, NIL], np.int64)
    robots = replace(factory.snapshot.robots, cause=np.array([0, CAUSE_REDESIGN, 0], np.uint8))
    snapshot = replace(
        factory.snapshot, robots=robots, service_zones=service_zones.replaced(halt=halt)
    )
    view = replace(factory, playback=replace(factory.playback, snapshots=(snapshot,)))
    said = shown(Inspector(), of_robot(view, 1), 60)
    assert "halted zones are redesigned: it stands still for 30 ticks" in said
    (link,) = explain(snapshot, view.floor_plan, 1).chain
    assert "stands still while the service zones are redesigned" in link.text


# Find, the table, the metrics


def test_stations_and_zones_are_found_by_number(factory: View) -> None:
    assert find("zone 2", factory).zones == (1,) and find("Station 11", factory).many == "1 cell"
    with pytest.raises(InputError, match="no zone 4; zones are numbered from 1 to 3"):
        find("zone 4", factory)
    with pytest.raises(InputError, match="no zone 0"):
        find("zone 0", factory)
    with pytest.raises(InputError, match="no station 19; stations are numbered from 1 to 18"):
        find("station 19", factory)
    with pytest.raises(InputError, match="no station 1; there is none"):
        find("station 1", moment(10, "tabletop-1"))
    assert find("zone == 2", factory).robots == (1,)


def test_the_table_has_columns_for_zone_and_queue_where_robots_serve_zones(factory: View) -> None:
    def titles(view: View) -> set[str]:
        return {column.title for column in ROBOT_TABLE_COLUMNS if column.there(view)}

    assert {"zone", "queue"} <= titles(factory)
    assert not {"zone", "queue"} & titles(moment(10, "tabletop-1"))


def test_the_figures_count_parts_and_redesigns(factory: View) -> None:
    said = shown(Figures(), factory, 56, 90)
    assert "parts 0 of 100 finished" in said
    assert f"zones redesigned {factory.snapshot.redesigns} time" in said
    assert "finished" not in shown(Figures(), moment(10, "tabletop-1"), 56, 90)


# Events


def test_stations_tell_when_they_are_done_with_a_part(factory: View) -> None:
    events = factory.run.event_history.events
    done = events[
        np.isin(events[:, 1], (EVENT_JOB_DONE, EVENT_PART_FINISHED)) & (events[:, 0] <= AT)
    ]
    stations = factory.snapshot.stations
    works = np.flatnonzero((stations.completion_tick != NIL) & (stations.completion_tick <= AT))
    expected = sorted(
        (stations.completion_tick[w], stations.part[w], stations.station[w]) for w in works
    )
    assert len(expected) > 20
    assert sorted((tick, part, at) for tick, _, _, part, at in done.tolist()) == expected
    part, at = done[0, 3:].tolist()
    assert event_words(Event(*done[0].tolist())) == f"station {at + 1} is done with part {part}"
    assert EventFilter(words=f"part {part}").mask(done)[0]
    assert not EventFilter(words="load 0").mask(done).any()
    assert {"parts", "zones"} <= set(kinds_of(factory))
    assert not {"parts", "zones"} & set(kinds_of(moment(10, "tabletop-1")))


def test_a_station_that_comes_into_another_zone_is_an_event_and_stops_a_run() -> None:
    run, event_history = observed()
    run.run(until=50)
    point = breakpoint_of("zones redesigned")
    assert point.test(run, run.resolved.floor_plan).tolist() == []
    run.world.service_zones.design.zone[0] = 2  # station 1 was in zone 2
    run.run(until=51)
    assert point.test(run, run.resolved.floor_plan).tolist() == [1, 2]
    run.run(until=60)
    assert point.test(run, run.resolved.floor_plan).tolist() == []
    events = event_history.events[event_history.events[:, 1] == EVENT_ZONES_REDESIGNED]
    assert events[:, [0, 4]].tolist() == [[51, 1]] and event_history.redesigns.tolist() == [51]
    assert event_words(Event(*events[0].tolist())) == "zones redesigned: 1 station"
    assert take_snapshot(run).redesigns == 1


def test_a_snapshot_keeps_the_design_that_it_was_taken_of() -> None:
    run, _ = observed()
    run.run(until=5)
    before = take_snapshot(run).service_zones.design.zone
    kept = before.copy()
    run.world.service_zones.design.zone[0] = 2
    assert before.tolist() == kept.tolist()


@pytest.mark.parametrize("setting", ["seed=1", DDZ])
def test_designs_are_the_same_when_a_run_is_shown_again(setting: str) -> None:
    """Forwards the first time, then backwards, over a redesign."""
    run = LiveRun(resolve("factory", [setting]), 1)
    first, tick = {}, 0
    while run.event_history.redesigns.size == 0 and tick < 6000:
        tick += 500
        show(run, tick)
        first[tick] = designs(run)
    assert run.event_history.redesigns.size
    assert len(set(first.values())) > 1
    for tick in reversed(first):
        show(run, tick)
        assert designs(run) == first[tick]


def show(run: LiveRun, tick: int) -> None:
    while run.show(tick) != tick:
        pass


def designs(run: LiveRun) -> tuple[bytes, ...]:
    snapshot = take_snapshot(run.shown)
    design = snapshot.service_zones.design
    arrays = (design.zone, design.path, design.transfer, snapshot.stations.in_service)
    return tuple(array.tobytes() for array in arrays)


# As text


def test_zones_and_stations_as_text(factory: View) -> None:
    world = factory.run.shown.world
    lines = partition_picture(world, factory.floor_plan).split("\n")
    assert len(lines[0]) == factory.floor_plan.width and lines[factory.floor_plan.height] == ""
    zones = lines[factory.floor_plan.height + 2 : factory.floor_plan.height + 5]
    assert [line[:10] for line in zones] == ["zone 1 (d)", "zone 2 (e)", "zone 3 (f)"]
    assert sum(line.startswith("station ") for line in lines) == 18
    at = station_with(factory, world.stations.in_service != NIL)
    (told,) = (line for line in lines if line.startswith(f"station {at + 1},"))
    assert (
        f"part {world.stations.part[world.stations.in_service[at]]}, " in told and " done" in told
    )
    rows = coloured("\n".join(lines))
    assert ["".join(text for text, _ in row) for row in rows] == lines
    assert any(style for row in rows for _, style in row)


def test_without_zones_and_stations_there_is_nothing_to_draw() -> None:
    run = Simulation(resolve("tabletop-mini"))
    assert partition_picture(run.world, run.resolved.floor_plan) == ""


def test_a_run_with_pictures_prints_zones_and_stations(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "factory", "--until", "1000", "--picture"]) == 0
    lines = capsys.readouterr().out.splitlines()
    told = [line for line in lines if line.startswith("zone 1 (d): ")]
    assert len(told) == 1 and float(told[0].split("robot 0, ")[1].split()[0]) > 0
    (uneven,) = (line for line in lines if line.startswith("SVp "))
    assert 0 < float(uneven[4:8]) <= 1
    assert any(line.startswith("station 14, zone 3: ") for line in lines)
    assert main(["run", "factory", "--until", "1000", "--picture", "--json"]) == 0
    zones = json.loads(capsys.readouterr().out)["service_zones"]
    assert told[0] in zones and uneven in zones


def test_a_picture_of_a_recording_shows_the_zones_that_robots_serve(tmp_path: Path) -> None:
    file, out = tmp_path / "run.rec", tmp_path / "zones.txt"
    assert main(["run", "factory", "--until", "40", "--record", str(file), "--json"]) == 0
    request = Request(layer="service-zones", color="none", ascii=True, size=(100, 40))
    make_picture([file], request, out, 20)
    drawn = out.read_text()
    assert "f zone 1  g zone 2  h zone 3  T transfer station" in drawn
    assert "ggggggg" in drawn and drawn.count("T") > 3


def test_the_list_says_what_methods_of_zoning_are_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    table = capsys.readouterr().out.split("uses of zoning methods")[1].partition("\n---")[2]
    rows = {line.split()[0]: line.split()[1:] for line in table.splitlines()[1:]}
    assert rows == {
        "annealing": ["no", "yes", "yes", "no", "no"],
        "genetic": ["yes", "yes", "yes", "yes", "no"],
        "decentralized": ["yes"] * 5,
    }
    assert main(["list", "--json"]) == 0
    listed = {one["name"]: one for one in json.loads(capsys.readouterr().out)["strategies"]}
    assert listed["genetic"]["properties"]["warehouse"] is True
    assert listed["genetic"]["properties"]["decentralized"] is False
    assert "properties" not in listed["static"]
