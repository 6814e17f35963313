"""Names of cells that orders use instead of [x, y]."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from automaton.errors import InputError
from automaton.scenario.document import Document
from automaton.scenario.floor_section import json_schema
from automaton.scenario.table_files import names_of_cells, read_locations
from automaton.world.resolve import resolve

SCENARIO = """name: named
layout:
  picture: |
    t...t
    ..#..
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
locations: {rack-7: [0, 0], packing: [4, 0], gate: [2, 0], pillar: [2, 1]}
orders:
  list:
    - {from: rack-7, to: packing, stops: [gate, [1, 0]]}
    - {stops: [{at: gate, for: 3}]}
strategy: {allocation: first-come, right_of_way: wait}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "named.yaml"
    path.write_text(text)
    return path


def test_a_name_stands_for_its_cell(tmp_path: Path) -> None:
    scenario = resolve(written(tmp_path, SCENARIO)).scenario
    load, tour = scenario.orders.listed or ()
    assert (load.source, load.target, load.stop_cells) == ((0, 0), (4, 0), ((2, 0), (1, 0)))
    assert (tour.stop_cells, tour.stop_ticks) == (((2, 0),), (3,))
    assert isinstance(scenario.locations, dict) and scenario.locations["packing"] == (4, 0)
    assert resolve(scenario).scenario == scenario


def test_names_may_come_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "places.csv").write_text("name,x,y\nrack-7,0,0\npacking,4,0\ngate,2,0\n")
    head, _, tail = SCENARIO.partition("locations: ")
    text = f"{head}locations: places.csv\n{tail.partition(chr(10))[2]}"
    resolved = resolve(written(tmp_path, text))
    assert resolved.scenario.orders == resolve(written(tmp_path, SCENARIO)).scenario.orders
    assert [Path(file).name for file, _ in resolved.files] == ["places.csv"]


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("to: packing", "to: paking",
         "named.yaml:10: orders.list[0].to: 'paking' is not a location (did you mean 'packing'?)"),
        ("[gate, [1, 0]]", "[[1, 0], gaet]",
         "named.yaml:10: orders.list[0].stops[1]: 'gaet' is not a location (did you mean 'gate'?)"),
        ("at: gate", "at: gaet", "named.yaml:11: orders.list[1].stops[0].at: 'gaet' is not a"),
        ("at: gate", "at: pillar", 
         "named.yaml:11: orders.list[1].stops[0]: the stop [2, 1] is a wall: robots do not drive"),
        ("gate: [2, 0]", "gate: [2]", "named.yaml:7: locations.gate must be a cell [x, y]"),
        ("gate: [2, 0]", "gate: [7, 0]", "named.yaml:7: the location gate [7, 0] lies outside"),
        ("{rack-7: [0, 0], packing: [4, 0], gate: [2, 0], pillar: [2, 1]}", "{}",
         "'rack-7' is a name, and the scenario has no locations; write [x, y], or set locations"),
        ("{rack-7: [0, 0], packing: [4, 0], gate: [2, 0], pillar: [2, 1]}", "places.csv",
         "named.yaml:7: there is no file of locations 'places.csv'"),
    ],
)  # fmt: skip
def test_an_unknown_name_is_told_with_its_order(
    old: str, new: str, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as error:
        resolve(written(tmp_path, SCENARIO.replace(old, new)))
    assert sentence in str(error.value), str(error.value)


def test_further_names_do_not_contradict_those_of_locations() -> None:
    """Stations and pods have names, too."""
    stations = {"P1": {"at": [1, 1]}, "P2": {"at": "gate"}}
    pods = {"list": [{"at": [5, 5], "name": "rack-7"}, {"at": [6, 5]}]}
    named: dict[str, Any] = {"locations": {"P1": [1, 1], "gate": [2, 2]}}
    found = names_of_cells(Document({**named, "stations": stations, "pods": pods}))
    assert found == {"P1": (1, 1), "P2": (2, 2), "gate": (2, 2), "rack-7": (5, 5)}
    with pytest.raises(InputError, match=r"the location P1 is at \[1, 1\], but the station P1 is"):
        names_of_cells(Document({**named, "stations": {"P1": {"at": [3, 1]}}}))
    pods = {"list": [{"at": [5, 5], "name": "gate"}]}
    with pytest.raises(InputError, match=r"the location gate is at \[2, 2\], but the pod gate is"):
        names_of_cells(Document({**named, "pods": pods}))


def test_editors_know_that_names_are_possible() -> None:
    validator = jsonschema.Draft202012Validator(json_schema())
    data = yaml.safe_load(SCENARIO)
    validator.validate(data)
    validator.validate(data | {"locations": "places.csv"})
    data["orders"]["list"][0]["to"] = 3
    assert not validator.is_valid(data)


def test_names_in_a_file_of_windows(tmp_path: Path) -> None:
    (tmp_path / "places.csv").write_bytes("name;x;y\nGang Süd;1;1\n".encode("cp1252"))
    assert read_locations(tmp_path / "places.csv")[0] == {"Gang Süd": [1, 1]}


def test_a_file_whose_columns_have_their_names(tmp_path: Path) -> None:
    (tmp_path / "places.csv").write_text("Ort;x;y\nA;1;1\n", encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_locations(tmp_path / "places.csv")
    assert error.value.message == "there is no column for name; the columns are Ort, x, y"
