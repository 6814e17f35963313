"""The factory of Keith & La as a grid, and the roads of floors in general."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from zoning_scenes import DISTANCES, drawn, factory

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.floor.floor_plan import DIRECTION_VECTORS, FloorPlan
from automaton.world.building import roads_of
from layouts.factory import FEET, SEGMENTS, Factory
from layouts.racks import Racks
from strategies.zoning.zone_workspace import typical_distance


def test_all_station_distances_are_those_of_the_authors() -> None:
    _, _, roads = factory()
    assert (roads.between == DISTANCES).sum() == 324


def test_the_critical_points_are_the_52_of_the_authors() -> None:
    floor, floor_plan, roads = factory()
    points = {floor_plan.cell(x, y) for x, y in floor.points().values()}
    assert len(points) == 52 and set(roads.cell.tolist()) == points
    assert int((roads.next != NIL).sum()) == 2 * len(SEGMENTS) == 2 * 63
    assert int(roads.step.sum()) * 2.5 == 2 * 2735


def test_the_sizes_of_both_grids() -> None:
    fine, coarse = Factory().build(), Factory(cell=5).build()
    assert (fine.width, fine.height, int(fine.drivable.sum())) == (117, 157, 1083)
    assert (coarse.width, coarse.height, int(coarse.drivable.sum())) == (59, 79, 536)


def test_cells_of_five_feet_are_a_little_off() -> None:
    _, _, roads = factory(5)
    off = np.abs(roads.between * 2 - DISTANCES)[np.triu_indices(18, 1)] * 2.5
    assert (off == 0).sum() == 84 and off.max() == 5 and abs(off.mean() - 1.2) < 0.01


def test_the_distance_of_adjacent_stations_is_the_authors() -> None:
    _, _, roads = factory()
    assert typical_distance(roads.between) * 2.5 == pytest.approx(243.6437908496732, abs=1e-12)
    near = roads.between * 2.5 < typical_distance(roads.between) * 2.5
    assert near[np.triu_indices(18, 1)].sum() == 67
    assert (roads.between * 2.5 < 300)[np.triu_indices(18, 1)].sum() == 89


def test_following_hops_is_a_shortest_way() -> None:
    _, _, roads = factory()
    for a in roads.point.tolist():
        for b in roads.point.tolist():
            here, cells = a, 0
            while here != b:
                there = int(roads.hop[here, b])
                cells += int(roads.step[here, roads.next[here].tolist().index(there)])
                here = there
            assert cells == roads.between[roads.station[a], roads.station[b]]


def test_lanes_hold_any_number_of_robots_or_one() -> None:
    for lanes, capacity in (("pass", 0), ("single", 1)):
        floor_plan = Factory(lanes=lanes).build()  # type: ignore[arg-type]
        assert set(floor_plan.capacity[floor_plan.drivable].tolist()) == {capacity}


def test_areas_have_all_stations() -> None:
    floor = Factory()
    assert sorted(n for area in floor.areas().values() for n in area) == list(floor.stations())
    assert set(FEET) == set(floor.points())


def test_cells_of_another_size_are_refused() -> None:
    with pytest.raises(ValueError, match=r"cell is 2\.5 or 5 feet, found 3"):
        Factory(cell=3)


def test_points_are_stations_crossings_corners_and_dead_ends() -> None:
    floor_plan, roads = drawn("""
        1....2#.
        .####.#.
        ........
    """)
    found = {floor_plan.xy(cell) for cell in roads.cell}
    assert found == {(0, 0), (5, 0), (7, 0), (0, 2), (5, 2), (7, 2)}
    assert roads.between.tolist() == [[0, 5], [5, 0]]


def test_one_way_aisles_are_driven_one_way() -> None:
    _, roads = drawn("""
        1>>>2
        .###.
        .....
    """)
    assert roads.between.tolist() == [[0, 4], [8, 0]]


@pytest.mark.parametrize(
    ("picture", "sentence"),
    [("1.##.2", "no route leads from station 1 at (0, 0) to station 2 at (5, 0)")],
)
def test_stations_must_be_reachable(picture: str, sentence: str) -> None:
    with pytest.raises(InputError) as error:
        drawn(picture)
    assert error.value.message == sentence


def test_stations_stand_apart_on_cells_that_robots_drive_on() -> None:
    floor_plan, _ = drawn("1...2\n.###.")
    with pytest.raises(InputError, match=r"station 2 at \(1, 0\) is in the cell of station 1"):
        roads_of(floor_plan, [floor_plan.cell(1, 0), floor_plan.cell(1, 0)])
    with pytest.raises(InputError, match=r"station 1 at \(1, 1\) is not on a drivable cell"):
        roads_of(floor_plan, [floor_plan.cell(1, 1)])


def cells_to_all(floor_plan: FloorPlan, start: int) -> dict[int, int]:
    """How far each cell is, found cell by cell."""
    exits, far, wave = floor_plan.exits.reshape(-1), {start: 0}, deque([start])
    while wave:
        here = wave.popleft()
        for direction, (dx, dy) in enumerate(DIRECTION_VECTORS):
            there = here + dx + dy * floor_plan.stride
            if exits[here] >> direction & 1 and there not in far:
                far[there] = far[here] + 1
                wave.append(there)
    return far


def test_distances_in_a_warehouse_are_those_found_cell_by_cell() -> None:
    floor_plan = Racks(preset="E1").build()
    corners = roads_of(floor_plan, []).cell
    stations = corners[:: max(1, len(corners) // 50)].tolist()
    roads = roads_of(floor_plan, stations)
    for number in (0, len(stations) // 2, len(stations) - 1):
        far = cells_to_all(floor_plan, stations[number])
        assert roads.between[number].tolist() == [far[cell] for cell in stations]
    assert 0 < typical_distance(roads.between) < roads.between.max()
