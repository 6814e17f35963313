"""Pictures: what they show, and that text and world are the same thing twice."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from automaton.engine.state import GOAL_CHARGE, ORDER_DELIVERED, Clock
from automaton.errors import InputError
from automaton.floor.drawn_floors import draw_floor, symbol_of
from automaton.floor.floor_plan import make_floor_plan
from automaton.pytest_plugin import GridSnapshot
from automaton.runs.pictures import (
    drawn,
    floor_drawing,
    floor_legend,
    floor_picture,
    picture_of,
    world_from,
)
from automaton.runs.pictures.picture_lines import read_route, write_route
from automaton.runs.pictures.pictures import CROWD_LEGEND
from automaton.runs.simulation import Simulation
from automaton.runs.state_copy import OF_THE_BUFFERS
from automaton.world.resolve import Resolved, resolve
from layouts.tabletop import Tabletop

SHIPPED = ("tabletop-mini", "tabletop-1", "crossing")
DERIVED = [k for k, name in enumerate(Clock.meanings) if name not in OF_THE_BUFFERS]
SYMBOLS = "#.-|+sdc><v^=~$b"
LEGEND = (
    ("o", symbol_of("track", exits=("east",))),
    ("x", symbol_of("turntable", 2, ("east", "north"))),
    ("y", symbol_of("floor", 2, ())),
    ("z", symbol_of("charger", 0, ("west",))),
)


def simulation(name: str, *settings: str, tick: int = 0) -> Simulation:
    made = Simulation(resolve(name, settings))
    if tick:
        made.run(until=tick)
    return made


def assert_same_state(one: Simulation, other: Simulation) -> None:
    assert one.digests().tolist() == other.digests().tolist()
    assert one.world.clock[DERIVED].tolist() == other.world.clock[DERIVED].tolist()
    assert np.array_equal(one.world.traffic.occupancy, other.world.traffic.occupancy)
    assert np.array_equal(one.world.orders.reserved_by, other.world.orders.reserved_by)
    assert np.array_equal(one.world.slots.content, other.world.slots.content)


# Worlds


@pytest.mark.parametrize("tick", [0, 1, 40, 200])
@pytest.mark.parametrize("name", ["tabletop-mini", "crossing"])
def test_pictures_of_shipped_scenarios(name: str, tick: int, grid_snapshot: GridSnapshot) -> None:
    grid_snapshot(simulation(name, tick=tick))


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize(
    "settings",
    [
        (),
        ("strategy.allocation=independent", "fleet.robots=4"),
        ("durations.move=3", "durations.turn=5", "fleet.robots=4"),
        ("world.following=none", "seed=7"),
        ("strategy.right_of_way=wait", "durations.move=2"),
        (
            "world.slowdown=zones",
            "world.extra_tick_probability=0.2",
            "durations.pick=0",
            "durations.drop=0",
        ),
    ],
)
def test_a_picture_restores_the_world_in_every_tick(name: str, settings: tuple[str, ...]) -> None:
    running = simulation(name, *settings)
    for tick in [*range(24), *range(24, 700, 23)]:
        if tick:
            running.run(until=tick)
        picture = picture_of(running)
        restored = world_from(picture, running.resolved)
        assert_same_state(running, restored)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_restored_world_goes_on_with_the_same_digests(name: str) -> None:
    running = simulation(name, "strategy.allocation=independent", tick=123)
    restored = world_from(picture_of(running), running.resolved)
    for tick in range(124, 400):
        running.run(until=tick)
        restored.run(until=tick)
        assert running.digest == restored.digest, f"after tick {tick}"
    running.run()
    restored.run()
    assert (running.tick, running.digest) == (restored.tick, restored.digest)
    assert running.finished and restored.finished


def test_a_finished_world_stays_finished() -> None:
    running = simulation("crossing")
    running.run()
    restored = world_from(picture_of(running), running.resolved)
    restored.run()
    assert (restored.tick, restored.digest) == (running.tick, running.digest)


def test_the_seed_of_a_run_is_in_its_picture() -> None:
    resolved = resolve("tabletop-mini")
    running = Simulation(resolved, seed=77)
    running.run(until=50)
    assert world_from(picture_of(running), resolved).digest == running.digest


def test_how_robots_are_stored_does_not_show() -> None:
    resolved = resolve("tabletop-mini")
    other = Simulation(resolved, storage=np.array([2, 0, 1]))
    other.run(until=90)
    assert picture_of(other) == picture_of(simulation("tabletop-mini", tick=90))


def test_a_world_and_its_view_have_pictures_too() -> None:
    running = simulation("crossing", tick=9)
    assert picture_of(running.view, running.resolved.floor_plan) == picture_of(running)
    with pytest.raises(TypeError, match="needs its floor plan"):
        picture_of(running.world)


BIG = """
layout:
  picture: |
    {row}
    {row}
    {row}
    sdd
fleet: {{robots: 30, start: random, kinematics: {kinematics}}}
orders: {{list: [{{from: [0, 3], to: [1, 3]}}]}}
name: big
"""


def big(tmp_path_factory: pytest.TempPathFactory, kinematics: str, row: str) -> Resolved:
    path = tmp_path_factory.mktemp("big") / "big.yaml"
    path.write_text(BIG.format(kinematics=kinematics, row=row))
    return resolve(path)


def test_robots_beyond_the_26th_have_numbers(tmp_path_factory: pytest.TempPathFactory) -> None:
    resolved = big(tmp_path_factory, "omni", "." * 20)
    running = Simulation(resolved)
    picture = picture_of(running)
    assert picture.split("\n\n")[1].count("@") == 4
    assert "\nZ (" in picture and "\n26 (" in picture and "\n29 (" in picture
    assert_same_state(running, world_from(picture, resolved))


def test_robots_in_passing_aisles_and_crowds_are_restored(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    resolved = big(tmp_path_factory, "differential", ".==~~==.~~~~~~~..")
    running = Simulation(resolved)
    for tick in range(1, 60, 2):
        running.run(until=tick)
        assert_same_state(running, world_from(picture_of(running), resolved))


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ({"priority": -3, "service_zone": 2}, "priority -3, zone 3"),
        (
            {"retreat_moves": 1, "need": 4, "route_length": 0, "route_index": 0},
            "retreats 1 more step, asks for",
        ),
        (
            {"failed_retries": 2, "retry_state": 2, "need": 4},
            "failed 2 times, is stuck, asks for the right",
        ),
        ({"action": 10, "busy": 0}, "waited in its parking bay"),
        ({"action": 7, "charge": 250_000_000}, "charged, charge 25 %"),
        ({"charge": 836_701_123}, "charge 83.6701123 %"),
        (
            {"charging_interruptible": 1, "charging_reason": 10},
            "may have an order while it charges, charging",
        ),
        ({"status": 3, "status_until": 40}, "empty battery, until tick 40"),
        ({"status": 6, "status_until": -1}, "gone, for good"),
        ({"ticket": 5}, "has ticket 5"),
        ({"try_drop": 1}, "will try to drop first"),
        ({"reason": 3, "route_reason": 0}, "last asked for a new plan, never routed"),
        ({"need": 3, "seen_revision": 7}, "found no work at change 7, asks for a route"),
        ({"step": 2}, "is told to step west"),
    ],
)
def test_whatever_a_robot_is_doing_is_told_and_restored(state: dict[str, int], words: str) -> None:
    running = simulation("crossing", tick=41)
    robots = running.world.robots
    for field, value in state.items():
        getattr(robots, field)[2] = value
    if state.get("route_length") == 0:
        robots.route_hash[2] = 0
    picture = picture_of(running)
    assert words in picture
    assert world_from(picture, running.resolved).digests().tolist() == running.digests().tolist()


def test_a_robot_on_its_way_to_a_charger_is_told_and_restored() -> None:
    running = simulation("crossing", tick=200)
    robots, floor_plan = running.world.robots, running.resolved.floor_plan
    robots.goal_type[3], robots.charge_target[3], robots.goal_cell[3] = (
        GOAL_CHARGE,
        800_000_000,
        floor_plan.cell(9, 5),
    )
    picture = picture_of(running)
    assert "D (2, 4) facing west, goes to (9, 5) to charge up to 80 %" in picture
    assert world_from(picture, running.resolved).digests().tolist() == running.digests().tolist()


# For people


def test_a_brief_picture_leaves_out_what_tells_a_person_nothing() -> None:
    settings = (
        "strategy.charging=none",
        "battery.drain.move=0.01",
        "strategy.allocation=first-come",
    )
    running = Simulation(resolve("depots", settings))
    running.run(until=900)
    whole, brief = picture_of(running), picture_of(running, brief=True)
    delivered = int((running.world.orders.state == ORDER_DELIVERED).sum())
    assert delivered > 1 and whole.count(" delivered to ") == delivered
    assert " delivered to " not in brief and brief.endswith(f"{delivered} orders delivered")
    assert "asks for charging" in whole and "asks for charging" not in brief
    assert "bound, " in whole and "bound, " not in brief, "depots has robots that never turn"
    assert re.search(r"charge \d+(\.\d+)? %", brief)


def test_a_brief_picture_says_what_stands_for_robots_beyond_the_letters() -> None:
    running = Simulation(resolve("random-400", ("fleet.robots=27",)))
    brief = picture_of(running, brief=True)
    rows, legend = brief.split(CROWD_LEGEND)
    assert rows.count("@") == 1 and "\n26 (" in legend
    few = Simulation(resolve("random-400", ("fleet.robots=26",)))
    assert CROWD_LEGEND not in picture_of(few, brief=True)


# Contradictions


def test_an_edited_picture_that_contradicts_itself_is_refused() -> None:
    running = simulation("tabletop-mini", tick=40)
    picture, resolved = picture_of(running), running.resolved
    line = next(line for line in picture.split("\n") if line.startswith("A ("))

    def refused(old: str, new: str) -> str:
        assert old in picture
        with pytest.raises(InputError) as error:
            world_from(picture.replace(old, new), resolved)
        return str(error.value)

    assert "line for robot A" in refused(f"{line}\n", "")
    assert "is not a known fact about robot A" in refused("turning for", "dances for")
    assert refused("tick 40", "tock 40").startswith("the picture:1: the first line must be like")
    assert "contradicts the rest of the picture" in refused("b|$|$", "b|s|$")
    assert "is not a line about a robot" in refused("A (", "the robot (")
    assert "not on the floor" in refused("via (10, 1)", "via (10, 99)")
    assert "the scenario has only 25" in refused("fetches 20", "fetches 99")


def test_a_world_may_be_changed_by_editing_its_picture() -> None:
    running = simulation("tabletop-mini", tick=40)
    edited = picture_of(running).replace("turning for 14 more ticks", "turning for 1 more tick")
    restored = world_from(edited, running.resolved)
    assert restored.world.robots.busy[0] == 1
    restored.run()
    assert restored.finished


# Floors


@pytest.mark.parametrize("name", [*SHIPPED, "tabletop-2"])
def test_shipped_floors_need_no_legend_and_come_back(name: str) -> None:
    floor_plan = resolve(name).floor_plan
    assert draw_floor(floor_picture(floor_plan)) == floor_plan
    assert floor_legend(floor_plan) == {}


def test_a_floor_is_drawn_as_a_person_would() -> None:
    picture = "b>>>>v\nb^$s$vd\nb====~d\n#^<<<.c\n##A.B#+"
    lines = [line.ljust(7, "#") for line in picture.split("\n")]
    assert floor_picture(draw_floor(picture)).split("\n") == lines


def test_what_has_no_symbol_gets_one_and_a_legend() -> None:
    table = symbol_of("turntable", capacity=2)
    one_way = symbol_of("charger", exits=("east",))
    floor_plan = draw_floor("..x.\n.k..", (("x", table), ("k", one_way)))
    drawing = floor_drawing(floor_plan)
    assert drawing.picture == "..o.\n.x.."
    assert floor_legend(floor_plan) == {
        "o": {"kind": "turntable", "capacity": 2},
        "x": {"kind": "charger", "exits": ["east"]},
    }
    assert draw_floor(*drawing) == floor_plan


def test_a_legend_takes_no_symbol_that_means_something_already() -> None:
    capacities = {str(capacity): symbol_of("turntable", capacity=capacity) for capacity in range(8)}
    floor_plan = draw_floor("t0s1d2.3.4.5.6.7\n" + "." * 16, tuple(capacities.items()))
    drawing = floor_drawing(floor_plan)
    assert draw_floor(*drawing) == floor_plan and drawing.picture.startswith("t")


def test_bays_at_x_0_are_not_taken_for_the_column_before_it() -> None:
    floor_plan = draw_floor("o.\n#.\no.", (("o", symbol_of("parking-bay")),))
    drawing = floor_drawing(floor_plan)
    assert draw_floor(*drawing) == floor_plan


def test_a_floor_that_no_picture_expresses_is_refused() -> None:
    floor_plan = draw_floor("...\n...")
    exits = floor_plan.exits.copy()
    exits[1, 1] = 4  # out through the border
    with pytest.raises(InputError, match="no picture can express"):
        floor_picture(replace(floor_plan, exits=exits))


@settings(max_examples=examples(40))
@given(st.lists(st.text(SYMBOLS + "oxyz", min_size=6, max_size=6), min_size=1, max_size=6))
def test_every_floor_comes_back(rows: list[str]) -> None:
    picture = "\n".join(["." * 6, *rows]).replace("b", ".")
    floor_plan = draw_floor(picture, LEGEND)
    assert draw_floor(*floor_drawing(floor_plan)) == floor_plan


def test_generated_floors_come_back() -> None:
    for tables, positions in ((1, 1), (3, 2), (40, 60)):
        floor_plan = Tabletop(tables=tables, positions=positions).build()
        assert draw_floor(*floor_drawing(floor_plan)) == floor_plan
    assert (
        make_floor_plan(floor_plan.kind, floor_plan.exits, floor_plan.capacity, floor_plan.loads)
        == floor_plan
    )


# Routes, imports


@given(st.lists(st.integers(0, 3), max_size=40), st.data())
def test_routes_come_back(steps: list[int], data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(steps)))
    assert read_route(write_route(steps, at)) == (steps, at)


def test_a_route_tells_steps_driven_from_steps_to_come() -> None:
    assert write_route([0, 0, 1, 1, 0], 2) == "eeSSE"
    assert write_route([0] * 12 + [1], 4) == "4e8ES"
    with pytest.raises(InputError, match="not a route"):
        read_route("EEss")


def test_a_floor_is_drawn_without_numba() -> None:
    code = (
        "import sys; from automaton.runs.pictures import drawn; from layouts.tabletop import Tabletop;"
        "print(drawn(Tabletop(tables=1, positions=1).build())); assert 'numba' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "b+-+d\nb|s|d\nb+-+d\n", done.stderr


def test_drawn_takes_whatever_has_a_picture() -> None:
    running = simulation("crossing")
    assert drawn(running) == picture_of(running)
    assert drawn(running.resolved.floor_plan) == floor_picture(running.resolved.floor_plan)
