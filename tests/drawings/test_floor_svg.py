"""Floors as SVG: what is drawn is what the state says, and it loads nothing."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from automaton.drawings import floor_svg as module
from automaton.drawings.floor_svg import floor_svg
from automaton.drawings.looks import DRAW_WAITING, blended, css, rgb
from automaton.drawings.moment import (
    DrawnFloor,
    Moment,
    drawn_floor,
    empty_moment,
    moment_of,
)
from automaton.drawings.shapes import FADED, name_in_cell
from automaton.engine.state import NIL
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def crossing() -> tuple[DrawnFloor, Moment, Simulation]:
    """Four robots after 90 ticks."""
    simulation = Simulation(resolve("crossing"), 1, on_observe=Simulation.empty_observation)
    simulation.run(until=90)
    floor = drawn_floor(simulation.resolved)
    return floor, moment_of(floor, simulation.world, simulation.observation), simulation


def colour(name: str) -> str:
    return css(rgb(name, "light"))


def boxes(root: ET.Element, name: str) -> list[str]:
    """The rectangles of a colour that are filled."""
    paths = [path for path in root.iter(f"{SVG}path") if path.get("fill") == colour(name)]
    return [box for path in paths for box in re.findall(r"M[^M]+", path.get("d", ""))]


def test_robots_stand_where_the_state_has_them(
    crossing: tuple[DrawnFloor, Moment, Simulation],
) -> None:
    floor, moment, simulation = crossing
    root = ET.fromstring(floor_svg(floor, moment))
    found = {}
    for group in root.iter(f"{SVG}g"):
        title = group.findtext(f"{SVG}title")
        if title is not None:
            body = next(group.iter(f"{SVG}path"))
            x, y = re.findall(r"-?\d+", body.get("d", ""))[:2]
            found[title] = (int(x) + 42) // 100, int(y) // 100
    robots = simulation.world.robots
    cells = robots.cell[robots.at_index].tolist()
    places = [floor.floor_plan.xy(cell) for cell in cells]
    assert [title.split(":")[0] for title in found] == [f"robot {k}" for k in range(4)]
    assert list(found.values()) == places
    assert "robot 2: turning" in found and "robot 0: driving" in found


def test_loads_lie_on_full_shelves(crossing: tuple[DrawnFloor, Moment, Simulation]) -> None:
    floor, moment, simulation = crossing
    slots = simulation.world.slots
    full = slots.cell[(slots.content != NIL) & floor.bounded[slots.cell]]
    root = ET.fromstring(floor_svg(floor, moment))
    on_floor = [box for box in boxes(root, "load") if "h60v60" in box]
    expected = [floor.floor_plan.xy(cell) for cell in sorted(full.tolist())]
    corners = [tuple(int(n) // 100 for n in re.findall(r"\d+", box)[:2]) for box in on_floor]
    assert corners == expected and len(expected) == 7


def test_a_closed_cell_is_crossed_out(crossing: tuple[DrawnFloor, Moment, Simulation]) -> None:
    floor, moment, _ = crossing
    shut = replace(moment, shut=np.array([floor.floor_plan.cell(4, 0)], np.int32))
    before, after = (floor_svg(floor, one).count(colour("fault")) for one in (moment, shut))
    assert (before, after) == (0, 2)


def test_a_chosen_robot_is_ringed_and_tied_to_what_keeps_it(
    crossing: tuple[DrawnFloor, Moment, Simulation],
) -> None:
    floor, moment, _ = crossing
    kept = replace(moment, cause=np.full(4, 1, np.int32), blocker=np.array([3, 0, 1, 2], np.int32))
    assert "stroke-dasharray" not in floor_svg(floor, kept)
    chosen = floor_svg(floor, kept, selected=0)
    ends = [f"{100 * (kept.x[r] + 0.5):.0f} {100 * (kept.y[r] + 0.5):.0f}" for r in (0, 3)]
    assert f'd="M{ends[0]}L{ends[1]}"' in chosen and "stroke-dasharray" in chosen
    assert chosen.count(f'stroke="{colour("selected")}"') == 1


def test_waiting_is_told_by_shape_too(crossing: tuple[DrawnFloor, Moment, Simulation]) -> None:
    floor, moment, _ = crossing
    state = moment.looks.state.copy()
    state[0] = DRAW_WAITING
    waits = replace(moment, looks=moment.looks._replace(state=state))
    rings = [floor_svg(floor, one).count(f'stroke="{colour("floor")}"') for one in (moment, waits)]
    assert rings[1] == rings[0] + 1


def test_walls_beside_the_floor_stand_out_from_the_inside_of_blocks() -> None:
    simulation = Simulation(resolve("depots"), 1)
    floor = drawn_floor(simulation.resolved)
    moment = moment_of(floor, simulation.world, simulation.observation)
    drawn = floor_svg(floor, moment)
    faded = css(blended("wall", "floor", FADED, "light"))
    assert f'fill="{colour("wall")}"' in drawn and f'fill="{faded}"' in drawn


def test_doors_lifts_and_closings_have_signs_and_lifts_have_names() -> None:
    floor = drawn_floor(resolve("bad-day"))
    drawn = floor_svg(floor, empty_moment())
    kinds = Counter(kind for kind, _ in floor.places.values())
    (lines,) = re.findall(rf'stroke="{colour("turntable")}"[^>]* d="([^"]*)"', drawn)
    assert kinds == {"door": 1, "lift": 3, "closing": 7}
    assert lines.count("M") == 1 + 3 * 4 + 7 * 2
    assert re.findall(r">(\d)</text>", drawn) == ["1", "1"]  # of a door, and of a lift only once
    shut = np.array(list(floor.places), np.int32)
    crosses = floor_svg(floor, replace(empty_moment(), shut=shut))
    assert len(boxes(ET.fromstring(crosses), "floor")) == len(boxes(ET.fromstring(drawn), "floor"))
    assert f'stroke="{colour("fault")}"' in crosses


def test_names_of_places_are_written_where_they_are_legible_and_fit() -> None:
    floor_plan = resolve("tabletop-mini").floor_plan
    names = {floor_plan.cell(1, 0): "station P3", floor_plan.cell(2, 0): "station reception 4"}
    names |= {floor_plan.cell(3, 0): "station east", floor_plan.cell(4, 0): "station P2 3"}
    floor = replace(drawn_floor(resolve("tabletop-mini")), place_names=names)
    found = [name_in_cell(names, 40) for _, names in floor.places.values()]
    assert found == ["P3", "4", "east", "P2 3"]
    assert [name_in_cell(names, 20) for _, names in floor.places.values()] == [""] * 4


def test_a_floor_of_many_cells_is_pixels_and_stays_small(monkeypatch: pytest.MonkeyPatch) -> None:
    resolved = resolve("crossing")
    simulation = Simulation(resolved, 1)
    floor = drawn_floor(resolved)
    moment = moment_of(floor, simulation.world, simulation.observation)
    monkeypatch.setattr(module, "MAX_DRAWN_CELLS", 10)
    monkeypatch.setattr(module, "MAX_NUMBERED_DISCS", 0)
    root = ET.fromstring(floor_svg(floor, moment))
    (image,) = root.iter(f"{SVG}image")
    assert image.get("href", "").startswith("data:image/png;base64,")
    assert (image.get("width"), image.get("height")) == ("1200", "600")
    assert root.find(f".//{SVG}title") is None  # robots are discs alone
    assert len(ET.tostring(root)) < 2_500


def test_it_loads_nothing_and_a_name_cannot_break_out(
    crossing: tuple[DrawnFloor, Moment, Simulation],
) -> None:
    floor, moment, _ = crossing
    drawn = floor_svg(floor, moment, "dark", title='<b> & "quoted"')
    assert ET.fromstring(drawn).get("aria-label") == '<b> & "quoted"'
    assert not re.search(r"href|url\(|<script|@import", drawn)
