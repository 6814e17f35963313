"""Altered recordings of pods: what a header says of pods and lines is bounded, and checked."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from handmade_recordings import recorded

from automaton.commands import main
from automaton.recording.frames import Recording, encoded

REFUSED = {  # array, what becomes of it, what the sentence says
    "nowhere": ("pods.slot", lambda a: a - 1, "pods.slot has the value -1"),
    "two in one": ("pods.slot", lambda a: a * 0, "two of its pods stand in one cell"),
    "too few": ("pods.slot", lambda a: a[:1], "lines.pod has the value"),
    "no such pod": ("lines.pod", lambda a: a + 100, "lines.pod has the value 10"),
    "no such station": ("lines.station", lambda a: a + 1, "lines.station has the value 1"),
    "no such order": ("lines.order", lambda a: a + 9, "lines.order has the value 11"),
    "less than no time": ("lines.handling", lambda a: a - 2**62, "lines.handling has the value -"),
    "for ever": ("lines.handling", lambda a: a + 2**62, "lines.handling has the value 46"),
    "no such rule": ("pod_stations.rule", lambda a: a + 1, "pod_stations.rule has the value 1"),
    "off the floor": ("pod_stations.cell", lambda a: a + 999, "pod_stations.cell has the value"),
    "no station": ("pod_stations.cell", lambda a: a - 1, "its stations do not match its floor"),
    "a long visit": ("pod_stations.visit", lambda a: a + 2**60, "pod_stations.visit has the value"),
    "a line less": ("lines.due", lambda a: a[1:], "lines.due has 2 rows"),
    "of another kind": ("lines.due", lambda a: a.astype(np.int64), "lines.due has the type int64"),
    "known too early": ("stops.cell", lambda a: a + 30, "a trip is released before its lines"),
    "other trips": ("orders.first_stop", lambda a: a // 2, "its stops do not match"),
}
FOUND = {
    "another pod": ("pods.slot", lambda a: a[::-1].copy()),
    "another station": ("lines.station", lambda a: a * 0 - 1),
    "longer": ("lines.handling", lambda a: a + 1),
    "one place more": ("pod_stations.places", lambda a: a + 1),
    "later": ("lines.release_tick", lambda a: a + 1),
    "not due": ("lines.due", lambda a: a + 0 * a - a),
    "more urgent": ("lines.priority", lambda a: a + 1),
}


@pytest.fixture(scope="module")
def mini() -> Recording:
    return recorded("goods-mini")


def outcome(mini: Recording, name: str, change: Any, path: Path) -> int:
    """The exit code of `verify`, where an array of the header was changed."""
    header = copy.deepcopy(mini.header)
    part, array = name.split(".")
    header[part][array] = change(header[part][array])
    path.write_bytes(encoded(header, mini.frames))
    return main(["verify", str(path)])


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused(
    case: str, mini: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, change, sentence = REFUSED[case]
    assert outcome(mini, name, change, tmp_path / "run.rec") == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1 and sentence in told.err


@pytest.mark.parametrize("case", FOUND)
def test_what_was_not_so_is_found(
    case: str, mini: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, change = FOUND[case]
    assert outcome(mini, name, change, tmp_path / "run.rec") == 1
    assert f"header differs: {name} does not follow" in capsys.readouterr().out


def test_lines_by_sku_need_pods_that_hold_it(
    mini: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    nowhere = np.full(3, -1, np.int32)
    for skus, says in (
        ({}, "arrays for its lines by SKU are missing"),
        ({"first": [0, 0]}, "a SKU is in none of its pods"),
        ({"first": [0, 1], "held": [9]}, "pods.sku_pod has the value 9"),
        ({"first": [0, 1], "held": [2], "wanted": 1}, "a line needs a SKU that no pod holds"),
        (
            {"first": [0, 1], "held": [2], "wanted": 0},
            "its distances from slots to stations do not match",
        ),
    ):
        header = copy.deepcopy(mini.header)
        header["lines"]["pod"] = nowhere
        if skus:
            header["pods"]["sku_first"] = np.array(skus["first"], np.int32)
            header["pods"]["sku_pod"] = np.array(skus.get("held", []), np.int32)
            header["lines"]["sku"] = nowhere * 0 + skus.get("wanted", 0)
            header["pod_stations"]["ticks_from"] = np.zeros((1, 2), np.int32)
        path = tmp_path / "run.rec"
        path.write_bytes(encoded(header, mini.frames))
        assert main(["verify", str(path)]) == 2
        assert says in capsys.readouterr().err


LISTED = (
    "orders={list: [{from: [2, 1], stops: [{at: [5, 3], for: 9}]}, {from: [2, 1], to: [7, 1]}, "
    "{stops: [[0, 0]]}]}"
)


def test_orders_of_a_list_carry_pods_that_there_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, path = recorded("goods-mini", LISTED), tmp_path / "run.rec"
    path.write_bytes(encoded(run.header, run.frames))
    assert main(["verify", str(path)]) == 0
    assert "rules: no violations" in capsys.readouterr().out
    stands = run.header["pods"]["slot"]
    for part, array, change, says in (
        (
            "orders",
            "source",
            lambda a: np.add(a, [0, max(stands) + 1, 0]),
            "an order of its list has no pod",
        ),
        ("orders", "target", lambda a: a * 0 - 1, ""),
        ("orders", "source", lambda a: a * 0 - 1, "neither a load nor stops"),
        ("pods", "slot", lambda a: a * 0, "two of its pods stand in one cell"),
    ):
        header = copy.deepcopy(run.header)
        header[part][array] = change(header[part][array]).astype(np.int32)
        path.write_bytes(encoded(header, run.frames))
        assert main(["verify", str(path)]) == (2 if says else 1), array
        said = capsys.readouterr()
        assert says in said.err if says else "orders.target does not follow" in said.out, said
    for part in ("pods", "pod_stations"):
        header = {name: value for name, value in run.header.items() if name != part}
        path.write_bytes(encoded(header, run.frames))
        assert main(["verify", str(path)]) == 2
        assert "its pods, lines or stations do not match its scenario" in capsys.readouterr().err


@pytest.mark.parametrize("part", ["pods", "lines", "pod_stations"])
def test_a_header_has_all_of_it_or_nothing(
    part: str, mini: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header = copy.deepcopy(mini.header)
    del header[part]
    path = tmp_path / "run.rec"
    path.write_bytes(encoded(header, mini.frames))
    assert main(["verify", str(path)]) == 2
    assert "frame 0" in capsys.readouterr().err
