"""What is read of openTCS plant models, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from automaton.errors import InputError
from automaton.exchange.graphs.graph import Graph
from automaton.exchange.graphs.import_graph import import_opentcs
from automaton.exchange.graphs.opentcs import read_opentcs
from automaton.exchange.imported_floor import ImportOptions

POINTS = """
<point name="A" positionX="0" positionY="0" type="HALT_POSITION"/>
<point name="B" positionX="4000" positionY="0" type="PARK_POSITION"/>
<point name="C" positionX="4000" positionY="3000" type="HALT_POSITION"/>
"""
PATHS = """
<path name="A-B" sourcePoint="A" destinationPoint="B" length="4000" maxVelocity="1000"
  maxReverseVelocity="500" locked="false"/>
<path name="B-C" sourcePoint="B" destinationPoint="C" length="3100" maxVelocity="1000"
  maxReverseVelocity="0" locked="false"/>
"""


def model(more: str = "", points: str = POINTS, paths: str = PATHS, version: str = "7.0.0") -> str:
    """A plant model as text."""
    return (
        f'<?xml version="1.0"?>\n<model version="{version}" name="m">{points}{paths}{more}</model>'
    )


@pytest.fixture
def path(tmp_path: Path) -> Iterator[Path]:
    """Where models are written."""
    yield tmp_path / "site.xml"


def graph(path: Path, text: str) -> Graph:
    """Read a model."""
    path.write_text(text)
    return read_opentcs(path)


@pytest.mark.parametrize("version", ["6.0.0", "7.0.0"])
def test_paths_count_with_their_length_and_both_speeds(version: str, path: Path) -> None:
    read = graph(path, model(version=version))
    assert [(e.name, e.metres, e.speed) for e in read.edges] == [
        ("A-B", 4.0, 1.0),
        ("A-B backwards", 4.0, 0.5),
        ("B-C", 3.1, 1.0),
    ]
    assert read.parking == [1] and not read.lost


def test_locked_paths_are_dropped(path: Path) -> None:
    locked = PATHS.replace('maxReverseVelocity="0" locked="false"', 'locked="true"')
    read = graph(path, model(paths=locked))
    assert [edge.name for edge in read.edges] == ["A-B", "A-B backwards"]
    assert read.lost == {"locked paths": 1, "nodes without an edge": 1}


@pytest.mark.parametrize(
    ("operation", "symbol", "charges"),
    [("Charge", "NONE", True), ("Load", "RECHARGE_ALT_1", True), ("Load", "DEFAULT", False)],
)
def test_locations_are_stations_or_chargers(
    operation: str, symbol: str, charges: bool, path: Path
) -> None:
    more = f"""<locationType name="t"><allowedOperation name="{operation}"/>
      <locationTypeLayout locationRepresentation="{symbol}"/></locationType>
      <location name="P" type="t" locked="false"><link point="A"/><link point="C"/></location>"""
    read = graph(path, model(more))
    assert [(one.name, one.nodes) for one in read.stations] == [("P", (0, 2))]
    assert read.chargers == ({0, 2} if charges else set())


def test_blocks_have_points_and_paths(path: Path) -> None:
    more = """<block name="k" type="SAME_DIRECTION_ONLY"><member name="A-B"/><member name="A"/>
      <member name="P"/></block>"""
    read = graph(path, model(more))
    [block] = read.blocks
    assert (block.nodes, block.edges, block.same_direction) == ((0,), (0, 1), True)
    assert read.lost == {"block members that are neither point nor path": 1}


def test_what_is_not_read_is_counted_by_name(path: Path) -> None:
    more = """<vehicle name="v" maxVelocity="800" envelopeKey="e"><property name="a" value="b"/>
      </vehicle><visualLayout name="l"><layer id="0"/><layer id="1"/></visualLayout>"""
    points = POINTS.replace('type="HALT', 'positionZ="0" type="HALT')
    read = graph(path, model(more, points))
    assert [(one.name, one.speed) for one in read.vehicles] == [("v", 0.8)]
    assert read.lost == {
        "point positionZ": 2,
        "vehicle envelopeKey": 1,
        "property": 1,
        "visualLayout": 1,
    }


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        (model().replace("<model", '<!DOCTYPE m [<!ENTITY a "b">]><model'), 2, "has a DOCTYPE"),
        (model("<a>" * 40 + "</a>" * 40), 11, "is nested more than 32 levels deep"),
        (model()[:200], 5, "is not XML: unclosed token"),
        (model("&x;"), 11, "is not XML: undefined entity"),
        ("<html/>", 1, "is XML, but not a plant model: it begins with <html>"),
        (model(version="4.0.0"), 2, "version '4.0.0' is not read; 6.0.0 and 7.0.0 are"),
        (model().replace('"4000" positionY="0"', '"NaN" positionY="0"'), 4, "found 'NaN'"),
        (model().replace('"4000" positionY="0"', '"1e999" positionY="0"'), 4, "found '1e999'"),
        (model().replace('destinationPoint="C"', 'destinationPoint="Q"'), 9, "names the point Q"),
        (model().replace('name="C"', 'name="B"'), 5, "the point B appears twice"),
        (model().replace(' destinationPoint="C"', ""), 9, "no attribute destinationPoint"),
        (model(paths=""), None, "has no drivable edge"),
        (model('<block name="k" type="ANY"/>'), 11, "must have the type SINGLE_VEHICLE_ONLY or"),
    ],
)
def test_a_mistake_is_a_sentence_with_its_line(
    text: str, line: int | None, sentence: str, path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        graph(path, text)
    assert sentence in caught.value.message and caught.value.line == line


def test_too_many_elements_are_refused(path: Path) -> None:
    with pytest.raises(InputError, match="has more than 1,000,000 elements"):
        graph(path, model("<a/>" * 1_000_001))


def test_robots_begin_where_blocks_have_room(path: Path) -> None:
    """A and B are in a block for one robot: the second robot begins at C."""
    more = """<block name="k" type="SINGLE_VEHICLE_ONLY"><member name="A-B"/><member name="A"/>
      <member name="B"/></block><vehicle name="v" maxVelocity="1000"/>
      <vehicle name="w" maxVelocity="1000"/>"""
    both_ways = PATHS.replace('maxReverseVelocity="0"', 'maxReverseVelocity="1000"')
    path.write_text(model(more, paths=both_ways.replace("3100", "3000")))
    floor = import_opentcs(path, ImportOptions())
    cells = {name: list(cell) for name, cell in floor.locations.items()}
    assert floor.sections["fleet"]["start"] == [cells["B"], cells["C"]]
    with pytest.raises(InputError, match=r"9 robots (do not fit|cannot begin)"):
        import_opentcs(path, ImportOptions(robots=9))
