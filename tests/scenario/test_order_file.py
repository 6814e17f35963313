"""Orders from a CSV file: what it may hold, and where a mistake stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.build.resolve import Resolved, resolve
from automaton.commands import main
from automaton.errors import InputError
from automaton.evidence.verification.verification import verify
from automaton.runs.simulation import Simulation
from automaton.studies.sweeps.run_keys import fingerprint

SCENARIO = """name: from-file
layout:
  picture: |
    t...t
    ..#..
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
orders: {arrivals: {file: orders.csv}}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: delivered, max_duration: 500}
"""
ORDERS = "tick,from_x,from_y,to_x,to_y\n30,0,0,4,0\n\n3,4,0,0,0\n"


def scenario(folder: Path, orders: str = ORDERS) -> Path:
    (folder / "orders.csv").write_text(orders)
    path = folder / "floor.yaml"
    path.write_text(SCENARIO)
    return path


def test_the_orders_of_a_file_are_those_of_a_list(tmp_path: Path) -> None:
    resolved = resolve(scenario(tmp_path))
    assert [
        (line.release, line.source, line.target) for line in resolved.scenario.orders.listed or ()
    ] == [
        (30, (0, 0), (4, 0)),
        (3, (4, 0), (0, 0)),
    ]
    run = Simulation(resolved)
    run.run()
    assert run.finished and run.world.orders.dispatched.tolist() == [30, 3]


@pytest.mark.parametrize(
    "text", [ORDERS.replace(",", ";"), ORDERS.replace(",", "\t"), "\ufeff" + ORDERS]
)
def test_columns_may_be_parted_as_spreadsheets_do(text: str, tmp_path: Path) -> None:
    lines = resolve(scenario(tmp_path, text)).scenario.orders.listed or ()
    assert [line.release for line in lines] == [30, 3]


def test_columns_are_found_by_their_names(tmp_path: Path) -> None:
    lines = resolve(scenario(tmp_path, "to_x,to_y,from_x,from_y,tick\n4,0,0,0,9\n")).scenario
    assert [(one.release, one.source, one.target) for one in lines.orders.listed or ()] == [
        (9, (0, 0), (4, 0))
    ]


@pytest.mark.parametrize(
    ("orders", "line", "sentence"),
    [
        ("", 0, "is empty; its head must name the columns tick, from_x, from_y, to_x, to_y"),
        ("tick,from_x,from_y,to_x,to_y\n", 1, "holds no order below its head"),
        (ORDERS.replace("from_x", "fromx"), 1, "unknown column 'fromx' (did you mean 'from_x'?)"),
        (ORDERS.replace("from_x", "tick"), 1, "the column tick appears twice"),
        ("tick,from_x,from_y,to_x\n1,2,3,4\n", 1, "the column to_y is missing"),
        (ORDERS.replace("3,4,0,0,0", "3,4,0,0"), 4, "the line has 4 values, the head names 5"),
        (ORDERS.replace("30,", "soon,"), 2, "tick must be a whole number from 0 to 2,000,000,000"),
        (ORDERS.replace("30,", "-1,"), 2, "found '-1'"),
        (ORDERS.replace("30,", ","), 2, "found nothing"),
        (ORDERS.replace("3,4,0", "3,4.5,0"), 4, "from_x must be a whole number"),
        (ORDERS.replace("3,4,0", "3,9,0"), 4, "[9, 0] lies outside the floor (x 0..4, y 0..1)"),
        (ORDERS.replace("3,4,0", "3,1,0"), 4, "an order begins at a shelf, a dock or a station"),
    ],
)
def test_a_mistake_is_named_with_its_line(
    orders: str, line: int, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as error:
        resolve(scenario(tmp_path, orders))
    place = f"orders.csv:{line}: " if line else "orders.csv: "
    assert place in str(error.value) and sentence in str(error.value), str(error.value)


def test_a_recording_stands_alone_and_verify_notices_changes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, recording = scenario(tmp_path), tmp_path / "run.rec"
    assert main(["run", str(path), "--record", str(recording)]) == 0
    assert verify(recording).changed_files == () and verify(recording).passed
    (tmp_path / "orders.csv").write_text(ORDERS.replace("30", "40"))
    capsys.readouterr()
    assert main(["verify", str(recording)]) == 0
    assert "orders.csv is not what it was when the run was recorded" in capsys.readouterr().out
    (tmp_path / "orders.csv").unlink()
    path.unlink()
    assert verify(recording).passed, "the orders are in it"


def test_a_study_tells_runs_of_other_orders_apart(tmp_path: Path) -> None:
    def key(orders: str) -> str:
        resolved: Resolved = resolve(scenario(tmp_path, orders))
        return fingerprint(resolved)

    assert key(ORDERS) == key(ORDERS) != key(ORDERS.replace("30", "40"))
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    assert fingerprint(resolve(scenario(elsewhere))) == key(ORDERS)


def test_check_takes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(scenario(tmp_path))]) == 0
    assert main(["check", str(scenario(tmp_path, "tick\n"))]) == 2
    assert "orders.csv:1: the column from_x is missing" in capsys.readouterr().err
