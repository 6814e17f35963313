"""Maps of ROS become scenarios: the figures of a hall made by hand, and what is said of broken ones.

`layouts/hall.yaml`: 26 x 18 pixels of 0.25 m with a door, a gap of 0.5 m, a pillar and a niche.
"""

from __future__ import annotations

import json
import os
import random
from pathlib import Path

import numpy as np
import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.exchange.image_floor import read_image_floor
from automaton.exchange.imported_floor import ImportOptions
from automaton.exchange.ros_map import ImageValues, classes, read_ros_map
from automaton.floor.floor_plan import EAST, NORTH, SOUTH, WEST
from automaton.scenario.quantities import Fraction
from automaton.world.resolve import resolve

DATA = Path(__file__).parent / "layouts"
HALL = """\
......#.....
............
............
......#.##..
......#.##..
......#...##
##....#...##
##....#...##
"""
FIELDS = "resolution: 1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def imported(folder: Path, *rows: str, cell: int = 1, **options: object) -> Path:
    """The scenario of an image drawn as text, '.' free, '?' unknown, with pixels of 1 m."""
    greys = {".": 254, "#": 0, "?": 205}
    values = bytes(greys[symbol] for row in rows for symbol in row)
    (folder / "a.pgm").write_bytes(b"P5 %d %d 255\n" % (len(rows[0]), len(rows)) + values)
    (folder / "a.yaml").write_text(f"image: a.pgm\n{FIELDS}")
    given = ImportOptions(cell=Fraction(cell), **options)  # type: ignore[arg-type]
    for name, text in read_image_floor(folder / "a.yaml", given).files("floor").items():
        (folder / name).write_text(text)
    return folder / "floor.yaml"


def test_the_figures_of_the_hall(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, floor = tmp_path / "floor.yaml", tmp_path / "floor.txt"
    command = ["import", str(DATA / "hall.yaml"), "--out", str(out), "--cell", "0.5m", "--json"]
    assert main([*command, "--floor", str(floor)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report == {
        "files": ["floor.txt", "floor.yaml"],
        "format": "map of ROS",
        "columns": 12,
        "rows": 8,
        "robots": 1,
        "cells": 76,
        "pixels_free": 353,
        "pixels_reached": 229,
        "pixels_kept": 229,
        "m2_free": 22.0625,
        "m2_reached": 14.3125,
        "m2_kept": 14.3125,
        "offset_x": 1,
        "offset_y": 1,
        "pieces_before": 1,
        "pieces_after": 1,
        "passages_lost": 0,
        "edges": [],
        "lost": {"pixels of unknown area": 12, "origin (kept only in a comment)": 1},
        "notes": ["unknown area counts as wall"],
        "refused": None,
    }
    assert floor.read_text() == HALL
    assert "x -3 m, y -2 m, yaw 0" in out.read_text()
    scenario = resolve(str(out)).scenario
    assert (scenario.units.cell, scenario.units.tick, scenario.durations.moves[0]) == (
        *("0.5 m", "0.5 s"),
        1,
    )


def test_a_wider_robot_and_unknown_area(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = {}
    for options in ("--robot 0.6m", "--unknown free", "--robot 0.8m"):
        command = ["import", str(DATA / "hall.yaml"), "--out", str(tmp_path / "a.yaml"), "--force"]
        assert main([*command, "--cell", "0.5m", "--json", *options.split()]) == 0
        report = json.loads(capsys.readouterr().out)
        figures[options] = [report[f"pixels_{name}"] for name in ("free", "reached")]
    assert figures == {
        "--robot 0.6m": [353, 229],
        "--unknown free": [365, 241],
        "--robot 0.8m": [353, 121],
    }


def test_cells_that_do_not_touch_open_other_sides(tmp_path: Path) -> None:
    """The walls are thinner than a cell; the middle row of pixels belongs to no way down."""
    rows = (
        ".......",
        ".#####.",
        ".......",
        ".......",
    )
    plan = resolve(str(imported(tmp_path, *rows, cell=2, robot=Fraction(1)))).floor_plan
    ways = [
        [
            [d for d in (EAST, SOUTH, WEST, NORTH) if plan.exits[y + 1, x + 1] >> d & 1]
            for x in range(4)
        ]
        for y in range(plan.height)
    ]
    assert ways == [
        [[EAST, SOUTH], [EAST, WEST], [EAST, WEST], [SOUTH, WEST]],
        [[EAST, SOUTH, NORTH], [EAST, SOUTH, WEST], [EAST, SOUTH, WEST], [SOUTH, WEST, NORTH]],
        [[EAST, NORTH], [EAST, WEST, NORTH], [EAST, WEST, NORTH], [WEST, NORTH]],
    ]


@pytest.mark.parametrize("seed", range(25))
def test_random_images_become_scenarios_with_their_exits(seed: int, tmp_path: Path) -> None:
    draw = random.Random(seed)
    width, height = draw.randint(2, 16), draw.randint(2, 16)
    wall = draw.uniform(0.1, 0.6)
    rows = ["".join("#."[draw.random() > wall] for _ in range(width)) for _ in range(height)]
    rows[0] = "." + rows[0][1:]
    k = draw.randint(1, min(width, height, 5))
    plan = resolve(str(imported(tmp_path, *rows, cell=k, robot=Fraction(1)))).floor_plan
    free = np.count_nonzero(plan.drivable)
    assert 1 <= free <= sum(row.count(".") for row in rows)
    if k == 1:
        asked = [row.strip("#") for row in rows if "." in row]
        assert free == sum(row.count(".") for row in asked)


def test_robots_are_spread_over_the_largest_piece(tmp_path: Path) -> None:
    scenario = resolve(str(imported(tmp_path, "..#....", "..#....", robots=4))).scenario
    assert scenario.fleet.start == ((3, 0), (5, 0), (3, 1), (5, 1))
    with pytest.raises(
        InputError, match="--robots 9, but the largest piece of the floor has 8 cells"
    ):
        imported(tmp_path, "..#....", "..#....", robots=9)


def test_a_single_cell_has_an_order_for_where_it_is(tmp_path: Path) -> None:
    assert resolve(str(imported(tmp_path, "#.#", "###"))).scenario.orders.listed


@pytest.mark.parametrize(
    ("mode", "negate", "kinds"),
    [
        ("trinary", False, "###??..."),
        ("scale", False, "###??..."),
        ("trinary", True, "...??###"),
        ("raw", False, "..?#????"),
    ],
)
def test_what_greys_mean(mode: str, negate: bool, kinds: str) -> None:
    values = np.array([[0, 19, 55, 90, 205, 206, 254, 255]], np.uint8)
    values = np.sort(255 - values) if negate else values
    free, unknown = classes(ImageValues(values, 255), mode, negate, 0.65, 0.196)
    assert "".join(np.where(free, ".", np.where(unknown, "?", "#"))[0]) == kinds


def test_greys_are_scaled_by_the_maxval() -> None:
    kinds = [
        classes(ImageValues(values, white), "trinary", False, 0.65, 0.196)[0].tolist()
        for values, white in (
            (np.array([[0, 7, 12, 13, 15]], np.uint8), 15),
            (np.array([[0, 30_000, 52_000, 54_000, 65_535]], np.uint16), 65_535),
        )
    ]
    assert kinds == [[[False, False, False, True, True]]] * 2


CHANGES = [
    ("image: hall.pgm", "image: none.pgm", 1, "the image 'none.pgm' is not there"),
    ("image: hall.pgm", "image: /dev/zero", 1, "the image '/dev/zero' is not a regular file"),
    ("image: hall.pgm", "image: pipe", 1, "the image 'pipe' is not a regular file"),
    ("image: hall.pgm", "image: .", 1, "the image '.' is not a regular file"),
    ("image: hall.pgm", 'image: "a\\0b"', 1, "the image 'a\\\\u0000b' is not there"),
    ("image: hall.pgm", "image: [1]", 1, "image must be the name of a file, found '[1]'"),
    ("trinary", "trinry", 2, "mode must be trinary, scale or raw, found 'trinry' (did you mean"),
    ("0.25", "0", 3, "resolution must be a number from 0.0001 to 1000, found '0'"),
    ("0.25", ".nan", 3, "YAML reads .nan as a number in a special notation"),
    ("0.25", "1.0e999", 3, "resolution must be a number from 0.0001 to 1000"),
    ("0.25", "true", 3, "resolution must be a number from 0.0001 to 1000, found 'True'"),
    ("[-3.0, -2.0, 0.0]", "[-3.0, -2.0]", 4, "origin must be three numbers, x, y and yaw"),
    ("[-3.0, -2.0, 0.0]", "[-3.0, .inf, 0]", 4, "YAML reads .inf as a number"),
    ("negate: 0", "negate: 2", 5, "negate must be 0 or 1, found '2'"),
    ("0.65", "65", 6, "occupied_thresh must be a number from 0 to 1, found '65'"),
    (
        "free_thresh",
        "free_tresh",
        None,
        "the key free_thresh of the map of ROS is missing (did you mean",
    ),
    ("image: hall.pgm", "image: &a [*a]", 1, "an alias refers to the value that it is part of"),
    ("trinary", "[" * 50 + "]" * 50, 2, "nested more than 40 levels deep"),
]


@pytest.mark.parametrize(("old", "new", "line", "sentence"), CHANGES, ids=range(len(CHANGES)))
def test_what_is_wrong_with_a_map_is_said_with_its_line(
    old: str, new: str, line: int | None, sentence: str, tmp_path: Path
) -> None:
    os.mkfifo(tmp_path / "pipe")
    text = (DATA / "hall.yaml").read_text()
    assert text.count(old) == 1
    path = tmp_path / "a.yaml"
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        read_ros_map(path)
    assert sentence in caught.value.message
    assert (caught.value.file, caught.value.line) == (str(path), line)


@pytest.mark.parametrize(
    ("options", "code", "sentence"),
    [
        (
            "--cell 0.6m",
            2,
            "--cell 0.6 m is not a whole number of pixels of 0.25 m: use 0.5 m or 0.75 m",
        ),
        ("--cell 0.1m", 2, "use 0.25 m"),
        (
            "",
            2,
            "an image has no cell size: set --cell to whole pixels of 0.25 m",
        ),
        ("--cell 100m", 2, "the image has 26 x 18 pixels, and a cell has at most 500 per side"),
        ("--cell 0.5m --tick 7s", 2, "a move over 0.5 m would take 0 ticks"),
        ("--cell 0.5m --accept 9%", 2, "--accept has no effect on this file (a map of ROS)"),
        (
            "--cell 0.5m --robot 4m",
            1,
            "no free cell is left: a robot of 4 m does not fit on 353 free",
        ),
    ],
)
def test_options_that_do_not_fit_leave_no_file(
    options: str, code: int, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "floor.yaml"
    assert main(["import", str(DATA / "hall.yaml"), "--out", str(out), *options.split()]) == code
    assert sentence in capsys.readouterr().err and not out.exists()


def test_the_image_alone_is_sent_to_its_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "floor.yaml"), "--cell", "0.5m"]
    assert main(["import", str(DATA / "hall.pgm"), *out]) == 2
    assert "is the image of a map; give the YAML file that names it" in capsys.readouterr().err


def test_a_cell_follows_from_the_robot_and_times_from_options(tmp_path: Path) -> None:
    given = ImportOptions(robot=Fraction("0.6"), tick=Fraction("0.2"), speed=Fraction("1.5"))
    sections = read_image_floor(DATA / "hall.yaml", given).sections
    assert sections["units"] == {"tick": "0.2 s", "cell": "0.75 m"}
    assert sections["durations"] == {"move": 3}, "2.5 ticks are 3"


@pytest.mark.parametrize("seed", range(8))
def test_mutants_give_a_sentence_or_a_scenario_that_is_accepted(seed: int, tmp_path: Path) -> None:
    draw = random.Random(seed)
    originals = {name: (DATA / name).read_bytes() for name in ("hall.yaml", "hall.pgm")}
    done = 0
    for _ in range(40):
        for name, content in originals.items():
            (tmp_path / name).write_bytes(content)
        changed = draw.choice(("hall.yaml", "hall.yaml", "hall.pgm"))
        (tmp_path / changed).write_bytes(mutant(draw, originals[changed]))
        try:
            cell = Fraction(draw.choice(("0.25", "0.5", "0.75", "1")))
            floor = read_image_floor(tmp_path / "hall.yaml", ImportOptions(cell=cell))
        except InputError as error:
            assert error.message and "\n" not in str(error)
            continue
        if not floor.report.refusal:
            (tmp_path / "floor.yaml").write_text(floor.files("floor")["floor.yaml"])
            resolve(str(tmp_path / "floor.yaml"))
            done += 1
    assert done > 2, "some mutants are harmless"


def mutant(draw: random.Random, content: bytes) -> bytes:
    """Content with a few bytes changed, cut out, doubled or put in."""
    data = bytearray(content)
    for _ in range(draw.randint(1, 4)):
        at, kind = draw.randrange(min(len(data), draw.choice((90, len(data))))), draw.randrange(5)
        end = at + draw.randint(1, 12)
        if kind == 0:
            data[at] = draw.choice((draw.randrange(256), *b"0123456789-.:[]{}&*!#\n "))
        elif kind == 1:
            del data[at:end]
        elif kind == 2:
            data[at:at] = data[at:end]
        elif kind == 3:
            data[at:at] = draw.choice(
                (b"999999999", b".nan", b"-", b"1e99", b"null", b"\0", b"\xff")
            )
        else:
            del data[max(20, at) :]
        if not data:
            data = bytearray(b"x")
    return bytes(data)
