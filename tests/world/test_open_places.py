"""The first stations and chargers of a floor are open, the others plain floor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_scenes import recorded_run, scene

from automaton.commands import main
from automaton.errors import InputError
from automaton.floor.floor_plan import CHARGER, FLOOR, STATION
from automaton.recording.frames import resolved_of
from automaton.studies.sweeps.sweep_plan import make_sweep_plan
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve

HALL = """\
name: hall
layout:
  picture: |
    >>>>>>>>>v
    ^#pppp#p#v
    ^########v
    ^<t<t<t<c<
    ^########^
    ^c######c^
fleet: {robots: 2, kinematics: omni, start: [[0, 0], [3, 0]]}
stations:
  third: {at: [6, 3]}
  first: {at: [2, 3]}
orders:
  lines: [{pod: 1}, {pod: 2}, {pod: 3, station: third}, {pod: 4}]
battery: {drain: {move: 0.1, turn: 0, wait: 0}, charge_rate: 5, initial_charge: 60}
strategy: {allocation: first-come, charging: threshold, routing: shortest}
stop: {when: delivered, max_duration: 2000}
"""


def hall(folder: Path, *settings: str) -> Resolved:
    (folder / "hall.yaml").write_text(HALL, encoding="utf-8")
    return resolve(folder / "hall.yaml", settings)


def places(resolved: Resolved, kind: int) -> list[tuple[int, int]]:
    floor_plan = resolved.floor_plan
    return [floor_plan.xy(cell) for cell in np.flatnonzero(floor_plan.kind == kind).tolist()]


def test_named_stations_open_first_in_their_sequence_then_the_others(tmp_path: Path) -> None:
    opened = {k: hall(tmp_path, f"floor.open_stations={k}") for k in (1, 2, 3)}
    assert places(opened[1], STATION) == [(6, 3)] and list(opened[1].scenario.stations) == ["third"]
    assert places(opened[2], STATION) == [(2, 3), (6, 3)]
    assert opened[2].station_names == ("first", "third")
    assert places(opened[3], STATION) == [(2, 3), (4, 3), (6, 3)]
    assert opened[3].floor_plan == hall(tmp_path).floor_plan


def test_chargers_open_in_reading_order_and_closed_ones_are_floor(tmp_path: Path) -> None:
    opened = hall(tmp_path, "floor.open_chargers=2")
    assert places(opened, CHARGER) == [(8, 3), (1, 5)]
    cell = opened.floor_plan.cell(8, 5)
    assert opened.floor_plan.kind.flat[cell] == FLOOR
    assert opened.floor_plan.drivable.flat[cell]
    assert opened.floor_plan.exits.flat[cell] == hall(tmp_path).floor_plan.exits.flat[cell]


def test_a_run_uses_the_open_ones_alone_and_its_recording_knows_it(tmp_path: Path) -> None:
    settings = ("floor.open_stations=1", "floor.open_chargers=1", "refine=2")
    resolved = hall(tmp_path, *settings)
    run, recorder = recorded_run(resolved)
    assert run.finished
    assert len(run.world.pod_stations.cell) == 1 and len(run.world.chargers.cell) == 1
    assert (run.world.lines.served_at == 0).all()
    recording = recorder.recording()
    assert validate_stored(recording).valid
    assert resolved_of(recording.header).floor_plan == resolved.floor_plan
    again = resolve(resolved.unrefined.scenario)
    assert again.floor_plan == resolved.floor_plan, "the resolved scenario is one that can be read"


def test_a_recording_is_verified_with_its_closed_places(tmp_path: Path) -> None:
    hall(tmp_path)
    settings = ["--set", "floor.open_stations=2", "--set", "floor.open_chargers=1"]
    file = str(tmp_path / "run.rec")
    assert main(["run", str(tmp_path / "hall.yaml"), *settings, "--record", file]) == 0
    assert main(["verify", file]) == 0


def test_a_line_for_a_closed_station_is_refused(tmp_path: Path) -> None:
    hall(tmp_path)
    text = HALL.replace("  third: {at: [6, 3]}\n", "").replace(
        "lines: [", "lines: [{pod: 1, station: 3}, "
    )
    (tmp_path / "hall.yaml").write_text(text.replace("station: third", "station: 1"))
    with pytest.raises(InputError, match="station"):
        resolve(tmp_path / "hall.yaml", ["floor.open_stations=2"])


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("floor.open_stations=4", "floor.open_stations is 4, but the floor has 3 stations"),
        ("floor.open_chargers=9", "floor.open_chargers is 9, but the floor has 3 chargers"),
        ("floor.open_stations=0", "floor.open_stations must be a whole number from 1"),
        ("floor.open_chargers=0", "strategy.charging is threshold, but the floor has no charger"),
    ],
)
def test_more_than_the_floor_has_is_refused(tmp_path: Path, setting: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        hall(tmp_path, setting)
    assert says in str(error.value)


def test_stations_of_parts_close_by_their_numbers() -> None:
    orders = {"parts": [{"route": [1, 2], "count": 3}]}
    stop = {"when": "delivered", "max_duration": 500}
    strategy = {"allocation": "first-come", "right_of_way": "wait"}
    parts: dict[str, Any] = {"orders": orders, "stop": stop, "strategy": strategy}
    run, recorder = recorded_run(scene("t.t.t", [(1, 0)], ["floor.open_stations=2"], **parts))
    assert run.finished and validate_stored(recorder.recording()).valid
    with pytest.raises(
        InputError, match="a part goes to station 2, but the floor has the stations 1"
    ):
        scene("t.t.t", [(1, 0)], ["floor.open_stations=1"], **parts)


def test_both_are_factors_of_a_sweep(tmp_path: Path) -> None:
    hall(tmp_path)
    (tmp_path / "study.yaml").write_text(
        "name: places\nscenario: hall.yaml\n"
        "factors: {floor.open_stations: [1, 2, 3], floor.open_chargers: [1, 3]}\nreplications: 2\n"
    )
    plan = make_sweep_plan(tmp_path / "study.yaml")
    assert len({point.fingerprint for point in plan.manifest.points}) == 6


def test_check_says_how_many_are_open(tmp_path: Path, capsys: Any) -> None:
    hall(tmp_path)
    settings = ["--set", "floor.open_stations=2", "--set", "floor.open_chargers=1"]
    assert main(["check", str(tmp_path / "hall.yaml"), *settings]) == 0
    assert "2 stations open, 1 charger open" in capsys.readouterr().out.replace("\n  ", " ")
