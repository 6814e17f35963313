"""Zone designs as data: the shipped ones, what is refused, and their pictures."""

from __future__ import annotations

from typing import Any

import pytest
from zoning_scenes import check_partition, drawn, factory, segments, shipped, stations

from automaton.errors import InputError
from strategies.zoning.design_files import read_design
from strategies.zoning.service_zone_lines import design_picture

FLOOR = """
    1...2...3
    .###.####
    .###.....
    4.......5
"""


@pytest.mark.parametrize("name", ["factory-logged", "factory-ddz"])
def test_shipped_designs_are_partitions(name: str) -> None:
    _, _, roads = factory()
    check_partition(roads, shipped(name))


def test_the_logged_design_has_the_zones_of_the_log() -> None:
    assert stations(shipped("factory-logged")) == [
        {9, 10, 7, 6, 3, 15},
        {2, 4, 1, 5},
        {14, 18, 16, 13, 12, 17, 11, 8},
    ]


def test_without_segments_a_zone_is_joined_by_shortest_paths() -> None:
    floor_plan, roads = drawn(FLOOR)
    data = {"zones": [{"stations": [1, 2, 3]}, {"stations": [4, 5]}]}
    design = read_design(floor_plan, roads, data)
    check_partition(roads, design)
    assert segments(floor_plan, roads, design, 0) == [[(0, 0), (4, 0)], [(4, 0), (8, 0)]]


def test_points_straight_between_two_may_be_left_out() -> None:
    floor_plan, roads = drawn("""
        1...2
        ..#..
        3...4
    """)
    data = {"zones": [{"stations": [1, 2, 3, 4]}]}
    data["zones"][0]["segments"] = [  # type: ignore[assignment]
        [[0, 0], [4, 0]],
        [[0, 0], [0, 2]],
        [[4, 0], [4, 2]],
    ]
    design = read_design(floor_plan, roads, data)
    assert segments(floor_plan, roads, design, 0)[1] == [(0, 0), (0, 1), (0, 2)]


ONE = {"stations": [1, 2, 3]}
TWO = {"stations": [4, 5]}


def zones(*entries: Any) -> Any:
    return {"zones": list(entries)}


def path(*cells: Any) -> list[list[int]]:
    return [list(cell) for cell in cells]


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ([], "a zone design has a list `zones`, such as zones: [{stations: [1, 4]}, …]"),
        (zones({}), "zone 1 has no list `stations`, such as stations: [1, 4]"),
        (zones({"stations": []}), "zone 1 has no station"),
        (zones({"stations": [1], "path": []}), "zone 1 has stations and segments, found 'path'"),
        (zones({"stations": [1], "segments": "ab"}), "the segments of zone 1 are not a list"),
        (zones(ONE, {"stations": [4, 6]}), "zone 2: stations are 1 to 5, found 6"),
        (zones(ONE, {"stations": [3, 4, 5]}), "station 3 is in zone 1 and in zone 2"),
        (
            zones(ONE, {"stations": [4]}),
            "no zone has station 5; each of the stations 1 to 5 is in one zone",
        ),
        (
            zones({"stations": [1, 2]}, {"stations": [3, 4, 5]}),
            "zone 2 can be joined only by points of other zones",
        ),
        (
            zones(ONE, {**TWO, "segments": [path((0, 3))]}),
            "segment 1 of zone 2 is a list of cells [x, y] or a word of point names",
        ),
        (
            zones(ONE, {**TWO, "segments": ["AB"]}),
            "segment 1 of zone 2: no point of this floor is called 'A'",
        ),
        (
            zones(ONE, {**TWO, "segments": [[7, 8]]}),
            "segment 1 of zone 2: a point is [x, y], found 7",
        ),
        (
            zones(ONE, {**TWO, "segments": [path((2, 0), (8, 3))]}),
            "segment 1 of zone 2: (2, 0) is not a station, crossing, corner or dead end of this "
            "floor",
        ),
        (
            zones(ONE, {**TWO, "segments": [path((0, 3), (8, 2))]}),
            "segment 1 of zone 2 is not a path: no straight line leads from (0, 3) to (8, 2)",
        ),
        (
            zones(ONE, {**TWO, "segments": [path((0, 3), (0, 0))]}),
            "segment 1 of zone 2 ends at (0, 0), not a station of the zone",
        ),
        (
            zones({**ONE, "segments": [path((0, 0), (4, 0))]}, TWO),
            "the segments of zone 1 do not join its stations 1 and 3; without `segments` shortest "
            "paths join all of them",
        ),
        (
            zones(ONE, {**TWO, "segments": [path((0, 3), (8, 3)), path((8, 3), (0, 3))]}),
            "zone 2 has 2 segments for 2 stations: 1 join them without a ring",
        ),
        (
            {**zones(ONE, TWO), "transfer": []},
            "a zone design has zones and transfers, found 'transfer'",
        ),
        (
            {**zones(ONE, TWO), "transfers": 5},
            "transfers are a list of {zones: [1, 2], stations: [...]}, found 5",
        ),
    ],
)
def test_bad_data_is_refused_in_a_sentence(data: Any, sentence: str) -> None:
    floor_plan, roads = drawn(FLOOR)
    with pytest.raises(InputError) as error:
        read_design(floor_plan, roads, data)
    assert error.value.message == sentence


def test_a_point_is_in_one_zone_only() -> None:
    floor_plan, roads = drawn(FLOOR)
    data = zones(
        {"stations": [1, 4], "segments": [path((0, 0), (4, 0), (4, 3), (0, 3))]},
        {
            "stations": [2, 3, 5],
            "segments": [path((4, 0), (8, 0)), path((4, 0), (4, 2), (8, 2), (8, 3))],
        },
    )
    with pytest.raises(InputError, match=r"the point \(4, 0\) is in zone 2 and in zone 1"):
        read_design(floor_plan, roads, data)


def test_more_zones_than_stations_are_refused() -> None:
    floor_plan, roads = drawn("1.2")
    with pytest.raises(InputError, match="2 stations allow at most as many zones, found 3"):
        read_design(floor_plan, roads, zones(*({"stations": [1]},) * 3))


def test_the_picture_of_a_design() -> None:
    floor_plan, roads = drawn(FLOOR)
    design = read_design(floor_plan, roads, zones(ONE, TWO))
    design.transfer[0, 1, 1] = design.transfer[1, 0, 1] = 1
    assert design_picture(floor_plan, roads, design).split("\n") == [
        "Dddd*dddD",
        ".###.####",
        ".###.....",
        "EeeeeeeeE",
        "small letters: paths of zones; capitals: their stations; *: transfer stations",
        "zone 1 (d): 1 2* 3",
        "zone 2 (e): 4 5",
        "",
    ]
