"""Zones, explored and predicted cells in pictures, in the inspector and in Find."""

from __future__ import annotations

import asyncio
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from panel_harness import moment, of_cell, of_robot, shown
from render_scenes import camera_at, drawn, make_scene, open_floor, shipped, text
from viewer_harness import mini, record, viewing

from automaton.engine.observation import CAUSE_REDUCED_SPEED
from automaton.engine.state import GOAL_PICK, NIL
from automaton.errors import InputError
from automaton.floor.traffic_zones import ZONE_MODES, traffic_zones_of
from automaton.history.snapshot import take_snapshot
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.routing.astar import FIFO, LARGER_G, TIES
from tui.layers.astar_paths import Paths, driven, explored, ties_of
from tui.layers.zones import tints_of
from tui.playback.film import Request, make_picture
from tui.playback.panel_view import View
from tui.playback.playback_state import Overlays
from tui.render.cell_looks import TINT_CODES, TINTS
from tui.render.compose import compose
from tui.render.styles import ASCII
from tui.screens.find_dialog import find
from tui.widgets.inspector import Inspector
from tui.widgets.legend_panel import legend
from tui.widgets.metrics_panel import Figures
from tui.widgets.status import describe
from tui.widgets.why_panel import Why
from tui.widgets.zone_facts import slow_zones

SLOW = ("world={slowdown: zones}", "fleet.robots=5")
AISLES = ".....\n.#.#.\n....."
ZONES_PICTURE = ["+h+g+", "f%f%f", "+h+g+"]
EXPLORED_PICTURE = [".....", ".=#=.", "....."]
PREDICTED_PICTURE = [".....", "..-..", "....."]


@pytest.fixture(scope="module")
def crowded() -> View:
    """Robots of tabletop-1 at work where zones slow them down."""
    return moment(300, "tabletop-1", *SLOW)


def observed() -> Simulation:
    resolved = resolve("tabletop-1", ["fleet.robots=5"])
    return Simulation(resolved, on_observe=Simulation.empty_observation)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("run") / "run.rec", "fleet.robots=6", until=60)


@pytest.fixture(scope="module")
def run() -> Simulation:
    simulation = observed()
    simulation.run(until=300)
    return simulation


def drawn_ascii(scene, zoom: str = "1x1") -> str:
    return text(compose(scene, camera_at(scene.floor.floor_plan, zoom), ASCII), ASCII)


def test_zones_bear_letters_where_touching_ones_differ_and_crossings_a_sign() -> None:
    floor_plan = drawn(AISLES)
    scene = make_scene(floor_plan, zones=traffic_zones_of(floor_plan), layer="traffic-zones")
    picture = drawn_ascii(scene).splitlines()
    assert [row.strip() for row in picture if row.strip()] == ZONES_PICTURE


@pytest.mark.parametrize("mode", ZONE_MODES)
@pytest.mark.parametrize("name", ["tabletop-1", "warehouse-100"])
def test_touching_zones_have_other_tints(name: str, mode: str) -> None:
    floor_plan = shipped(name)
    traffic_zones = traffic_zones_of(floor_plan, mode)
    tint = tints_of(traffic_zones, *floor_plan.kind.shape).reshape(floor_plan.kind.shape)
    number = traffic_zones.of[:, 0].reshape(floor_plan.kind.shape)
    assert ((tint == NIL) == (number == NIL)).all() and tint.max() < len(TINTS)
    for step, axis in ((1, 0), (1, 1)):
        beside, its_tint = np.roll(number, -step, axis), np.roll(tint, -step, axis)
        touch = (number != NIL) & (beside != NIL) & (number != beside)
        assert (tint[touch] != its_tint[touch]).all()


def test_no_letter_of_a_zone_is_a_sign_of_something_else_in_ascii() -> None:
    signs = set(ASCII.characters[127:]) - set("eswn")  # streets are another layer
    assert not signs & set(map(chr, TINT_CODES)) and len(set(TINT_CODES)) == len(TINTS)


def test_a_floor_of_intersections_says_that_it_has_no_zones() -> None:
    floor_plan = open_floor(3, 3)
    scene = make_scene(floor_plan, zones=traffic_zones_of(floor_plan), layer="traffic-zones")
    meanings = [entry.meaning for entry in legend(scene, camera_at(floor_plan, "1x1").zoom, ASCII)]
    assert "zones: this floor has none, all of it is intersections" in meanings
    assert describe(scene, floor_plan.cell(1, 1)) == "(1, 1) floor, intersection"


def test_explored_and_predicted_cells_are_shaded_where_there_are_no_colours() -> None:
    floor_plan = open_floor(5, 3)
    field = np.zeros(floor_plan.kind.size, np.int32)
    for x, value in enumerate((0, 1, 2, 1, 0)):
        field[floor_plan.cell(x, 1)] = value
    searched = make_scene(floor_plan, heat=field, layer="explored", selected=NIL)
    assert [row.strip() for row in drawn_ascii(searched).splitlines()] == EXPLORED_PICTURE
    foreseen = searched.with_(layer="predicted")
    assert [row.strip() for row in drawn_ascii(foreseen).splitlines()] == PREDICTED_PICTURE
    all_of_them = drawn_ascii(foreseen.with_(least=1)).splitlines()[1].strip()
    assert all_of_them == ".-+-."


# The numbers


def route_of(run: Simulation, robot: int) -> list[int]:
    return take_snapshot(run, robot).route.tolist()


def busiest(run: Simulation) -> int:
    return max(range(5), key=lambda robot: len(route_of(run, robot)))


def paths_of(run: Simulation, ties: int = LARGER_G) -> Paths:
    return Paths(run.world, ties)


def test_a_search_explores_its_path_and_what_lies_around_it(run: Simulation) -> None:
    robot = busiest(run)
    field = explored(run.world, paths_of(run), robot)
    i = int(run.world.robots.at_index[robot])
    path = np.flatnonzero(field == 2)
    assert run.world.robots.goal_cell[i] in path and np.count_nonzero(field == 1) > 0
    assert len(path) == len(route_of(run, robot)) + 1  # nobody is in its way: as short as its route
    assert (run.world.grid.cell_flags[field > 0] & 15 != 0).all()
    assert not explored(run.world, paths_of(run), NIL).any()


def test_the_tie_rule_of_the_scenario_decides_what_is_explored(run: Simulation) -> None:
    robot = busiest(run)
    counts = [np.count_nonzero(explored(run.world, paths_of(run, t), robot)) for t in (FIFO, 1)]
    assert counts[0] >= counts[1]
    fifo = resolve("tabletop-1", ["strategy.routing={name: astar, tie_break: fifo}"])
    assert TIES[ties_of(fifo.scenario)] == "fifo"
    assert TIES[ties_of(resolve("tabletop-1").scenario)] == "larger_g"


def test_predicted_paths_hold_the_routes_and_lose_the_selected_robot(run: Simulation) -> None:
    robot, grid = busiest(run), run.world.grid
    everybody = paths_of(run).counted(run.world, NIL)
    others = paths_of(run).counted(run.world, robot)
    least = np.zeros(grid.cell_flags.size, np.int32)
    for one in range(5):
        least[list(set(route_of(run, one)))] += 1
    assert (everybody >= least).all() and everybody.max() >= 2
    own = everybody - others
    assert set(own.tolist()) == {0, 1} and (own[route_of(run, robot)] == 1).all()


def test_predicted_paths_are_the_routes_and_the_rest_of_the_tasks(run: Simulation) -> None:
    """Each robot counts once in a cell, however often it will be there."""
    world, paths = run.world, paths_of(run)
    robots, headings = world.robots, world.grid.headings
    expected = np.zeros(world.grid.cell_flags.size, np.int32)
    for i in np.flatnonzero(robots.goal_cell != NIL):
        cell = int(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
        steps = robots.route[i, robots.route_index[i] : robots.route_length[i]]
        cells = [cell, *(cell + np.cumsum(world.grid.offset[steps]))]
        if robots.goal_type[i] == GOAL_PICK:
            heading = int(steps[-1]) % headings if len(steps) else int(robots.heading[i])
            access = world.slots.access[world.orders.target[robots.order[i]]]
            beyond = next(int(access[way]) for way in (2, 0, 3, 1) if access[way] != NIL)
            cells += paths.found(0, int(robots.goal_cell[i]) * headings + heading, beyond)[
                1
            ].tolist()
        expected[sorted({int(cell) for cell in cells})] += 1
    assert expected.max() >= 2 and (robots.goal_type == GOAL_PICK).any()
    assert np.array_equal(paths.counted(world, NIL), expected)


def test_paths_are_those_of_one_seed(run: Simulation) -> None:
    other = Simulation(run.resolved, seed=run.seed + 1)
    paths = paths_of(run)
    assert paths.fit(run.world, LARGER_G)
    assert other.world.grid is run.world.grid and not paths.fit(other.world, LARGER_G)


def test_steps_are_cells() -> None:
    assert driven(np.array([1, 10, -1, -10]), 42, np.array([0, 0, 1])).tolist() == [42, 43, 44, 54]


def test_while_ticks_go_by_an_overlay_is_kept_for_a_while() -> None:
    simulation, overlays = observed(), Overlays()

    def heat(tick: int, playing: bool):
        simulation.run(until=tick)
        bare = take_snapshot(simulation, NIL, "predicted")
        return overlays.laid_over(bare, simulation, "predicted", playing).heat

    first = heat(100, True)
    assert first is not None and first.any()
    assert heat(140, True) is first
    paused = heat(140, False)
    assert paused is not None and not np.array_equal(paused, first)
    assert heat(140, False) is paused


# The inspector, and Find


def occupied(view: View) -> tuple[int, int, list[int]]:
    """A zone with robots, a cell of it and the robots, found without the inspector."""
    traffic_zones, fleet = traffic_zones_of(view.floor_plan), view.snapshot.robots
    of = np.array([traffic_zones.of[c, t >> 1] if c != NIL else NIL
                   for c, t in zip(fleet.cell, fleet.travel, strict=True)])  # fmt: skip
    zone = int(of[of != NIL][0])
    return (
        zone,
        int(np.flatnonzero(traffic_zones.of[:, 0] == zone)[0]),
        np.flatnonzero(of == zone).tolist(),
    )


def test_a_cell_tells_its_zone_who_is_in_it_and_what_a_move_takes(crowded: View) -> None:
    zone, cell, robots = occupied(crowded)
    said = shown(Inspector(), of_cell(crowded, *crowded.floor_plan.xy(cell)))
    many = len(robots)
    assert f"zone {zone} with {many} robot" in said
    move = crowded.run.resolved.scenario.durations.move
    ticks = f"{many} x {move} = {many * move} ticks" if move != 1 else f"{many} tick"
    assert f"a move from here takes {ticks}" in said
    crossing = crowded.floor_plan.xy(
        int(np.flatnonzero(traffic_zones_of(crowded.floor_plan).intersection)[0])
    )
    assert "zone none: an intersection, which slows no robot down" in shown(
        Inspector(), of_cell(crowded, *crossing)
    )


def test_a_zone_lists_its_robots(crowded: View) -> None:
    zone, _, robots = occupied(crowded)
    said = shown(Inspector(), replace(crowded, zone=zone))
    assert f"zone {zone} of {traffic_zones_of(crowded.floor_plan).count}, undirected" in said
    assert "here " + ", ".join(f"robot {robot}" for robot in robots) in said


def test_a_zone_tells_what_it_has_cost(crowded: View) -> None:
    lost = crowded.snapshot.lost_in_zone
    zone = int(np.argmax(lost))
    said = shown(Inspector(), replace(crowded, zone=zone))
    assert lost[zone] > 1 and f"so far moves from here took {lost[zone]} ticks longer" in said


def test_the_slowest_zones_are_listed_and_lead_to_themselves(crowded: View) -> None:
    lost = crowded.snapshot.lost_in_zone
    worst = [zone for zone in np.argsort(-lost, kind="stable")[:5].tolist() if lost[zone]]
    assert len(worst) > 1
    rows = " ".join(f"zone {zone} {lost[zone]}" for zone in worst)
    assert f"slowest zones by ticks lost in them {rows}" in shown(Figures(), crowded, 56, 90)
    links = [span.link for made in slow_zones(crowded) for span in made if span.link]
    assert links == [("zone", zone) for zone in worst]
    assert "slowest zones" not in shown(Figures(), moment(300, "tabletop-1"), 56, 90)


def test_driving_slowly_is_told_beside_lost_time_and_is_no_wait(crowded: View) -> None:
    lost = crowded.snapshot.robots.lost
    robot = int(np.argmax(lost[:, CAUSE_REDUCED_SPEED]))
    ticks = int(lost[robot, CAUSE_REDUCED_SPEED])
    row = shown(Why(), of_robot(crowded, robot)).partition(" reduced speed ")[2]
    assert row.split()[1:3] == [str(ticks), f"{100 * ticks / 300:.0f}"]
    assert " reduced speed " in shown(Figures(), crowded, 56, 90)
    assert f"slowed by {ticks} ticks" in shown(Inspector(), of_robot(crowded, robot))
    found = find(f"slowdown_ticks >= {ticks}", crowded).robots
    assert found == tuple(np.flatnonzero(lost[:, CAUSE_REDUCED_SPEED] >= ticks).tolist())


def test_zones_are_found_by_number(crowded: View) -> None:
    assert find("Zone 3", crowded).zones == (3,) and find("zone 3", crowded).many == "1 zone"
    last = traffic_zones_of(crowded.floor_plan).count - 1
    with pytest.raises(InputError, match=f"no zone 999; zones are numbered from 0 to {last}"):
        find("zone 999", crowded)


def test_a_zone_that_was_found_is_marked_on_the_map_until_escape() -> None:
    async def story() -> None:
        async with viewing(mini()) as user:
            await user.press("slash", *"zone", "space", "3", "enter")
            await user.until(lambda: user.session.choice.zone == 3)
            scene = user.session.pictures.scene(user.session.playback, user.session.choice, 0)
            of = traffic_zones_of(scene.floor.floor_plan).of
            assert scene.zone_cells.tolist() == np.flatnonzero(of[:, 0] == 3).tolist()
            await user.until(lambda: "zone 3 of" in "".join(
                span.text for line in user.display.column.panels["inspector"].lines for span in line
            ))  # fmt: skip
            await user.press("i", "i")
            assert user.session.choice.zone == 3  # it is what is inspected, not a cell
            before = user.display.codes_of(0)
            await user.press("escape")
            assert user.session.choice.zone == NIL
            changed = np.argwhere(user.display.codes_of(0) != before).tolist()
            places = [
                user.session.pictures.camera.place_of(cell) for cell in scene.zone_cells.tolist()
            ]
            assert {(row, column) for row, column in changed} >= set(places)

    asyncio.run(story())


@pytest.mark.parametrize("layer", ["traffic-zones", "explored", "predicted"])
def test_a_picture_of_a_recording_shows_them(layer: str, recording: Path) -> None:
    plain, laid = recording.with_suffix(".txt"), recording.with_name(f"{layer}.txt")
    for out, name in ((plain, ""), (laid, layer)):
        request = Request(layer=name, follow=1, color="none", ascii=True, zoom="1x1")
        make_picture([recording], request, out, 30)
    before, after = plain.read_text().splitlines(), laid.read_text().splitlines()
    assert f"{layer}  robot 1" in after[-3] + after[-2] + after[-1]
    assert before[:-2] != after[: len(before) - 2]
    key = "a tint or letter (f g h) for each zone  touching ones differ"
    assert (key in after[-1]) == (layer == "traffic-zones")


def test_a_drawing_of_zones_says_what_its_letters_mean(recording: Path) -> None:
    out = recording.with_name("zones.svg")
    make_picture([recording], Request(layer="traffic-zones", size=(80, 24)), out, 30)
    words = re.findall(r"<text[^>]*>([^<]*)</text>", out.read_text())
    assert "a tint or letter (f g h) for each zone" in words and "touching ones differ" in words


def test_the_map_as_text_says_what_the_letters_of_zones_mean(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    async def story() -> None:
        async with viewing(mini()) as user:
            for key in ("S", "f7", "S"):
                await user.press(key)
                await user.shown()
                if key == "S":
                    (file,) = tmp_path.glob("*.txt")
                    texts.append(file.read_text().splitlines()[-1])
                    file.unlink()

    texts: list[str] = []
    asyncio.run(story())
    assert "for each zone" not in texts[0]
    assert texts[1] == "a tint or letter (f g h) for each zone; touching ones differ"
