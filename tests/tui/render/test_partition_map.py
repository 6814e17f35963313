"""Zones that robots serve on the map: tints of their ways, letters without colours, a sign where
parts change robots."""

from __future__ import annotations

import numpy as np
import pytest
from render_scenes import bg, camera_at, composed, fg, make_scene, text
from zone_pictures import two_zones
from zoning_scenes import drawn

from automaton.floor.drawn_floors import draw_floor
from automaton.world.building import roads_of, service_zones_of
from strategies.zoning.design_files import read_design
from strategies.zoning.service_zone_lines import ways_of
from tui.layers.zones import (
    SHARED_TINTS_TEXT,
    design_key,
    service_zone_tints,
    sparest_first,
)
from tui.render import styles
from tui.render.cell_looks import TINTS, TRANSFER_COLOUR
from tui.render.compose import compose
from tui.render.scene import Scene
from tui.render.styles import ASCII
from tui.widgets.legend_panel import legend
from tui.widgets.status import describe


def rows(scene: Scene, zoom: str) -> list[str]:
    return text(compose(scene, camera_at(scene.floor.floor_plan, zoom), ASCII), ASCII).split("\n")


def test_ways_of_zones_bear_letters_where_there_are_no_colours() -> None:
    assert rows(two_zones(), "1x1") == ["tfffT...t", "f%%%%%%%g", "t.......t"]


def test_where_there_is_room_stations_bear_their_numbers() -> None:
    assert rows(two_zones(), "3x1")[0] == "t1 f  f  f  T2 .  .  .  t3"


@pytest.mark.parametrize("zoom", ["4x2", "6x3", "8x4"])
def test_in_large_cells_a_station_has_one_sign_beside_its_number(zoom: str) -> None:
    width, height = map(int, zoom.split("x"))
    first, second = (
        "".join(row[x * width : (x + 1) * width] for row in rows(two_zones(), zoom)[:height])
        for x in (0, 4)
    )
    assert first.count("t") == 1 and "t1" in first
    assert second.count("T") == 1 and "t" not in second and "T2" in second


def test_nothing_is_left_of_the_number_of_a_station_on_which_a_robot_stands() -> None:
    floor_plan = draw_floor("t" * 11)
    roads = roads_of(floor_plan, floor_plan.stations)
    design = read_design(floor_plan, roads, {"zones": [{"stations": list(range(1, 12))}]})
    station_of = np.arange(11, dtype=np.int32)
    service_zones = service_zones_of(roads, 1, station_of, 0, 1).replaced(design=design)
    robot = {"cell": floor_plan.cell(10, 0), "heading": 1}
    assert rows(make_scene(floor_plan, robot, zoning=service_zones, layer="service-zones"), "3x1")[
        0
    ].endswith("t10v0")


def test_a_way_has_the_tint_of_its_zone_and_a_transfer_station_another_ink() -> None:
    scene = two_zones()
    codes, camera = composed(scene, "1x1")
    code_at = {(x, y): int(codes[camera.place_of(scene.floor.floor_plan.cell(x, y))])
               for x in range(9) for y in (0, 2)}  # fmt: skip
    assert bg(code_at[1, 0]) == fg(code_at[1, 0]) == TINTS[0]
    assert bg(code_at[8, 0]) == TINTS[1] and bg(code_at[6, 0]) == styles.COLOUR_FLOOR
    assert fg(code_at[4, 0]) == TRANSFER_COLOUR and fg(code_at[0, 0]) == styles.COLOUR_STATION


def test_from_afar_ways_and_stations_are_seen() -> None:
    scene = two_zones()
    codes, camera = composed(scene, "half")
    way, station = (camera.place_of(scene.floor.floor_plan.cell(x, 0)) for x in (1, 4))
    assert TINTS[0] in (fg(int(codes[way])), bg(int(codes[way])))
    assert TRANSFER_COLOUR in (fg(int(codes[station])), bg(int(codes[station])))


def test_from_afar_without_colours_one_half_of_a_character_is_enough_for_a_letter() -> None:
    assert rows(two_zones(), "half") == ["tfffT===t", "t       t"]


def test_without_the_layer_zones_are_not_drawn() -> None:
    assert rows(two_zones(""), "1x1") == ["t...t...t", ".%%%%%%%.", "t.......t"]


def test_the_legend_says_who_serves_which_zone() -> None:
    scene = two_zones()
    said = [
        entry.meaning
        for entry in legend(scene, camera_at(scene.floor.floor_plan, "1x1").zoom, ASCII)
    ]
    assert said[:3] == [
        "zone 1: robot 0, 3 stations",
        "zone 2: robot 1, 2 stations",
        "transfer station: parts change robots",
    ]


def lattice_zones(columns: int, lines: int) -> Scene:
    """A lattice with a station at every crossing, and a zone for each, numbered line by line."""
    line, between = ".".join("t" * columns), "#".join("." * columns)
    floor_plan = draw_floor(f"\n{between}\n".join([line] * lines))
    cells = [floor_plan.cell(2 * x, 2 * y) for y in range(lines) for x in range(columns)]
    roads = roads_of(floor_plan, cells)
    data = {"zones": [{"stations": [k + 1]} for k in range(len(cells))]}
    station_of = np.arange(len(cells), dtype=np.int32)
    service_zones = service_zones_of(roads, len(cells), station_of, 0, len(cells))
    return make_scene(
        floor_plan,
        zoning=service_zones.replaced(design=read_design(floor_plan, roads, data)),
        layer="service-zones",
    )


def test_of_more_zones_than_tints_those_that_touch_differ() -> None:
    """By its number each would have the tint of the one below it."""
    columns, lines = len(TINTS), 4
    scene = lattice_zones(columns, lines)
    assert scene.service_zones is not None
    tint = service_zone_tints(scene.service_zones).reshape(lines, columns)
    assert (tint[:-1] != tint[1:]).all() and (tint[:, :-1] != tint[:, 1:]).all()
    assert set(tint.reshape(-1).tolist()) == set(range(len(TINTS)))
    entries = legend(scene, camera_at(scene.floor.floor_plan, "1x1").zoom, ASCII)
    assert [entry.meaning for entry in entries[:2]] == [
        SHARED_TINTS_TEXT,
        "zone 1: robot 0, 1 station",
    ]
    assert (
        entries[7].signs
        == entries[1 + int(np.flatnonzero(tint.reshape(-1) == tint[1, 0])[0])].signs
    )
    assert SHARED_TINTS_TEXT in " ".join(design_key(columns * lines, ASCII))


def test_as_many_zones_as_tints_have_one_each() -> None:
    scene = lattice_zones(len(TINTS), 1)
    assert scene.service_zones is not None
    assert service_zone_tints(scene.service_zones).tolist() == list(range(len(TINTS)))
    assert SHARED_TINTS_TEXT not in " ".join(design_key(len(TINTS), ASCII))


def test_six_tints_are_enough_wherever_ways_do_not_cross() -> None:
    """A wheel in a wheel: the hub touches all, each ring zone its two neighbours and the outside."""
    spokes = 9
    ring = [{0, 1 + (k + 1) % spokes, 1 + (k - 1) % spokes, spokes + 1} for k in range(spokes)]
    near = [set(range(1, spokes + 1)), *ring, set(range(1, spokes + 1))]
    order = sparest_first(near)
    assert sorted(order) == list(range(spokes + 2))
    left = set(order)
    for zone in order:
        left.remove(zone)
        assert len(near[zone] & left) < len(TINTS)


def test_a_station_and_a_way_are_described() -> None:
    scene = two_zones()
    cell = scene.floor.floor_plan.cell
    told = "station 2, zone 1, transfers between zones 1 and 2"
    assert told in describe(scene, cell(4, 0))
    assert describe(scene, cell(1, 0)).endswith("zone 1")
    assert "zone" not in describe(scene, cell(6, 0))


def test_a_marked_zone_is_its_ways_and_stations() -> None:
    scene = two_zones("").with_(zone=1)
    floor_plan = scene.floor.floor_plan
    assert scene.zone_cells.tolist() == [floor_plan.cell(8, y) for y in range(3)]
    assert scene.zone_name == "zone 2"


@pytest.mark.parametrize("back", [False, True])
def test_the_cells_of_a_way_with_a_corner(back: bool) -> None:
    floor_plan, roads = drawn("1..\n.#.\n..2")
    path = [[0, 0], [2, 0], [2, 2]]
    data = {"zones": [{"stations": [1, 2], "segments": [path[::-1] if back else path]}]}
    cells, zones = ways_of(roads, read_design(floor_plan, roads, data), floor_plan.stride)
    expected = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2)]
    assert sorted(set(cells.tolist())) == [floor_plan.cell(x, y) for x, y in expected]
    assert set(zones.tolist()) == {0}
