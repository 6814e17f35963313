"""Layouts of other programs become scenarios: one site in three formats, figure by figure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from lif_layouts import LAYOUTS, imported, lif, write

from automaton.commands import main
from automaton.errors import InputError
from automaton.exchange.imported_floor import check_values
from automaton.world.resolve import resolve

PICTURE = """\
z###########
│###########
│<<<<<<<<###
v#######^###
v#######^###
v#######^###
v#######^###
v#######^###
>>>>>>>>└──t
"""
SITES = {  # file: the curve's centimetres, percent and ticks wanted, and what is lost of it
    "site-1.lif": (-10.858, -3.493, 6.217, "trajectory (drawn straight, its length counts)"),
    "site-2.lif": (-10.858, -3.493, 6.217, "trajectory (drawn straight, its length counts)"),
    "site-opentcs.xml": (-10.9, -3.506, 6.218, "pathLayout"),
}
RING = {"A": (0.0, 0.0), "B": (4.0, 0.0), "C": (4.0, 2.0), "D": (0.0, 2.0)}
AROUND = ["A-B", "B-C", "C-D", "D-A"]


def scenario(path: Path) -> dict[str, Any]:
    """The scenario of a file that `check` accepts."""
    resolve(path)
    data: dict[str, Any] = yaml.safe_load(path.read_text())
    return data


@pytest.mark.parametrize("name", SITES)
def test_one_site_in_three_formats(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "floor.yaml"
    assert main(["import", str(LAYOUTS / name), "--out", str(out), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["cell_m"], report["tick_s"]) == (0.5, 0.5)
    assert (report["columns"], report["rows"]) == (12, 9)
    rows = {row["edge"]: row for row in report["edges"]}
    centimetres, percent, ticks, lost = SITES[name]
    assert rows["B-C"]["error_cm"] == pytest.approx(centimetres, abs=0.001)
    assert rows["B-C"]["error_percent"] == pytest.approx(percent, abs=0.001)
    assert rows["B-C"]["ticks_wanted"] == pytest.approx(ticks, abs=0.001)
    assert rows["D-A"] == {
        "edge": "D-A",
        "metres": 3.1,
        "cells": 6,
        "error_cm": -10.0,
        "error_percent": -3.2258,
        "ticks_wanted": 6.2,
        "ticks": 6,
        "time_error_percent": -3.2258,
        "speed_error_percent": 0.0,
    }
    others = [row for edge, row in rows.items() if edge not in ("B-C", "D-A")]
    assert len(others) == 6 and {row["error_percent"] for row in others} <= {0.0, -0.0}
    assert [row["ticks"] for edge, row in rows.items() if edge[:3] in ("B-S", "S-B")] == [6, 6]
    assert report["lost"][lost] == 1 and report["refused"] is None

    data = scenario(out)
    assert data["layout"]["picture"] == PICTURE
    assert data["layout"]["legend"]["z"] == {"kind": "charger", "opens": ["south"]}
    assert data["units"] == {"tick": "0.5 s", "cell": "0.5 m"}
    limit = {"cells": [[8, 8], [11, 8]], "max_speed": "0.5 m/s"}
    assert data["floor"]["speed_limits"] == [limit]
    assert data["locations"]["CONV-1"] == data["locations"]["S"] == [11, 8]
    assert data["locations"]["CHARGE-1"] == [0, 0] and data["locations"]["B"] == [8, 8]
    block = {"cells": [[9, 8], [11, 8]], "max_robots": 1, "direction": "any"}
    assert data["floor"].get("blocks") == ([block] if "opentcs" in name else None)
    kind = "tug-1" if "opentcs" in name else "acme.tug"
    assert data["fleet"]["types"][0]["name"] == kind


def test_an_edge_that_is_too_far_off_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "floor.yaml"
    assert main(["import", str(LAYOUTS / "site-1.lif"), "--out", str(out), "--cell", "1m"]) == 1
    printed = capsys.readouterr()
    assert "the edge B-S, 1.5 m, would be 2 m (+33.3 %) in cells of 1 m" in printed.err
    (edge,) = (line for line in printed.out.splitlines() if "B-S" in line)
    assert edge.split()[:3] == ["B-S", "1.500", "2"]
    assert not out.exists()
    accepting = ["--cell", "1m", "--accept", "34%"]
    assert main(["import", str(LAYOUTS / "site-1.lif"), "--out", str(out), *accepting]) == 0


def test_the_worst_edges_are_marked_in_the_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        imported(write(tmp_path, lif({**RING, "C": (4.0, 2.08)}, AROUND)), "--cell", "1m")[0] == 0
    )
    out = capsys.readouterr().out
    assert out.startswith("v<<<<\nv###1\n>>>>^\n")
    assert "1  B-C    2.080      2  -8.0  -3.85          2.08      2" in out


def test_the_picture_goes_to_a_file_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "floors").mkdir()
    code, out = imported(
        write(tmp_path, lif(RING, AROUND)), "--floor", str(tmp_path / "floors" / "ring.txt")
    )
    assert code == 0 and scenario(out)["layout"]["file"] == "floors/ring.txt"
    assert (tmp_path / "floors" / "ring.txt").read_text() == "v<<\n>>^\n"


def test_stations_have_tours_and_a_name_for_each_node(tmp_path: Path) -> None:
    path = write(tmp_path, lif(RING, AROUND, {"P": ["A", "C"], "B": ["D"]}))
    code, out = imported(path, "--cell", "1m", "--robots", "2", "--ticks", "50")
    data = scenario(out)
    assert code == 0 and data["stop"]["max_duration"] == 50
    assert data["locations"] == {
        "P/1": [0, 2],
        "P/2": [4, 0],
        "B": [0, 0],  # the station; the node of that name gets another one
        "A": [0, 2],
        "B (node)": [4, 2],
        "C": [4, 0],
        "D": [0, 0],
    }
    assert data["orders"]["list"][0]["stops"] == [
        {"at": "P/1", "for": "10 s"},
        {"at": "P/2", "for": "10 s"},
    ]
    assert data["fleet"]["robots"] == 2 and data["fleet"]["start"] == [[0, 2], [4, 2]]


def test_the_tick_is_what_the_fastest_robot_takes_for_a_cell(tmp_path: Path) -> None:
    edges = {"A_B": {"maxSpeed": 2.0}, "B_C": {"maxSpeed": 0.8}, "C_D": {"maxSpeed": None}}
    path = write(tmp_path, lif(RING, AROUND, **edges))
    data = scenario(imported(path, "--cell", "1m", "--speed", "4 km/h")[1])
    assert data["units"]["tick"] == "0.5 s" and data["durations"] == {"move": "2 m/s"}
    speeds = {
        tuple(map(tuple, one["cells"])): one["max_speed"] for one in data["floor"]["speed_limits"]
    }
    assert speeds[(4, 2), (4, 0)] == "0.8 m/s"
    assert speeds[(4, 0), (0, 0)] == "1.111111111111 m/s"
    data = scenario(imported(path, "--cell", "1m", "--tick", "0.1s")[1])
    assert data["units"]["tick"] == "0.1 s"


def test_the_slower_direction_counts_for_both(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, lif(RING, ["A=B", "B-C", "C-D", "D-A"], A_B={"maxSpeed": 0.5}))
    assert imported(path, "--cell", "1m", "--json")[0] == 0
    report = json.loads(capsys.readouterr().out)
    assert report["lost"] == {"speed of the faster direction of an edge": 1}
    ticks = {row["edge"]: (row["ticks_wanted"], row["ticks"]) for row in report["edges"]}
    assert ticks["A-B"] == (8.0, 8) and ticks["B-A"] == (4.0, 8)


def test_robots_with_a_load_may_be_kept_out(tmp_path: Path) -> None:
    kept_out = {"A_B": {"loadRestriction": {"loaded": False, "unloaded": True}}}
    data = scenario(imported(write(tmp_path, lif(RING, AROUND, **kept_out)), "--cell", "1m")[1])
    assert data["areas"] == {"A-B": {"from": [1, 2], "to": [3, 2], "closed_to": ["loaded"]}}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--cell", "0.5"], "'0.5' is not a length such as 0.5m"),
        (["--cell", "0m"], "'0m' is not a length"),
        (["--tick", "soon"], "'soon' is not a time such as 0.5s"),
        (["--speed", "3 m"], "'3 m' is not a speed such as 1.5m/s"),
        (["--accept", "0.1"], "'0.1' is not a percentage such as 10%"),
        (["--tick", "9s"], "would be less than half a tick of 9 s: set a smaller --tick"),
        (["--tick", "1 us"], "'1 us' is not a time"),
        (["--tick", "0.01 ms"], "a move would take more than 10,000 ticks; set a larger --tick"),
        (["--robots", "99"], "99 robots do not fit on the"),
        (["--layout", "upper"], "has no layout 'upper'; the layouts are ground"),
    ],
)
def test_an_option_that_does_not_fit_is_said_in_a_sentence(
    arguments: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert imported(write(tmp_path, lif(RING, AROUND)), *arguments)[0] == 2
    assert sentence in capsys.readouterr().err


def test_no_speed_and_no_way_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    slow = {edge.replace("-", "_"): {"maxSpeed": None} for edge in AROUND}
    assert imported(write(tmp_path, lif(RING, AROUND, **slow)))[0] == 2
    assert "has no speed: set --speed, such as 1m/s" in capsys.readouterr().err
    assert imported(write(tmp_path, lif(RING, AROUND[:3])))[0] == 2
    assert "the graph has neither a ring nor a two-way edge" in capsys.readouterr().err


def test_options_of_layouts_are_refused_for_problems(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.lif"  # its content tells that it is a map
    path.write_text("type octile\nheight 1\nwidth 3\nmap\n...\n")
    assert imported(path, "--cell", "1m")[0] == 2
    assert "--cell has no effect on this file (a MovingAI map)" in capsys.readouterr().err
    assert imported(path)[0] == 0


def test_what_is_not_a_file_is_not_read(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", "/dev/zero", "--out", "floor.yaml"]) == 2
    assert "/dev/zero: is not a regular file" in capsys.readouterr().err


def test_a_scenario_has_no_more_values_than_are_read() -> None:
    sections = {"name": "a", "floor": {"speed_limits": [{"max_speed": 1}] * 40_000}}
    with pytest.raises(InputError, match="120,004 values, most of them in floor; at most 90,000"):
        check_values(sections, "site.lif")


@pytest.mark.parametrize("name", ["site.lif", "problem.json"])
def test_keys_that_are_not_utf_8_are_said(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_bytes(b'{"layouts\xff": []}')
    assert main(["import", str(path), "--out", str(tmp_path / "out.yaml")]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"automaton: {path}") and "utf-8" in said.lower()
