"""Orders from a CSV file: what it may hold, and where a mistake stands."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.studies.sweeps.run_keys import fingerprint
from automaton.verification.verification import verify
from automaton.world.resolve import Resolved, resolve

SCENARIO = """name: from-file
layout:
  picture: |
    t...t
    ..#..
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
orders: {transports: {file: orders.csv}}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: delivered, max_duration: 500}
"""
ORDERS = "released,from_x,from_y,to_x,to_y\n30,0,0,4,0\n\n3,4,0,0,0\n"


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
    lines = resolve(scenario(tmp_path, "to_x,to_y,from_x,from_y,released\n4,0,0,0,9\n")).scenario
    assert [(one.release, one.source, one.target) for one in lines.orders.listed or ()] == [
        (9, (0, 0), (4, 0))
    ]


@pytest.mark.parametrize(
    ("orders", "line", "sentence"),
    [
        ("", 0, "is empty; its first line must name the columns"),
        ("released,from_x,from_y,to_x,to_y\n", 0, "has no rows below its header"),
        (ORDERS.replace("from_x", "fromx"), 1, "no column for from or from_x and from_y (did you"),
        (ORDERS.replace("from_x", "to_x"), 1, "the column to_x appears twice"),
        ("released,from_x,from_y,to_x\n1,2,3,4\n", 1, "there is no column for to or to_x and to_y"),
        (ORDERS.replace("3,4,0,0,0", "3,4,0,0"), 4, "the row has 4 values, but the header has 5"),
        (ORDERS.replace("30,", "soon,"), 2, "released 'soon' is not a time"),
        (ORDERS.replace("30,", "-1,"), 2, "released '-1' is not a time"),
        (ORDERS.replace("30,", ","), 2, "released is empty"),
        (
            ORDERS.replace("3,4,0", "3,4.5,0"),
            4,
            "from_x must be a whole number from 0 to 1,000,000",
        ),
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
    said = " ".join(capsys.readouterr().out.split())
    assert "orders.csv has changed since the run was recorded" in said
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


WAREHOUSE = """name: shift
layout:
  picture: |
    t...t
    ..#..
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
units: {tick: 0.5 s, clock: "2026-03-02 06:00"}
locations: plätze.csv
orders:
  transports:
    file: schicht.csv
    columns: {order: AUFTRAG, from: VON, to: NACH, released: ANGELEGT, due: FÄLLIG}
    where: {STATUS: [OFFEN, NEU]}
    time: "%d.%m.%Y %H:%M"
    encoding: cp1252
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: delivered, max_duration: 10000}
"""
PLACES = "name;x;y\nRegal-Süd;0;0\nPackplatz;4;0\n"
SHIFT = """AUFTRAG;POS;VON;NACH;ANGELEGT;FÄLLIG;STATUS
1;1;Regal-Süd;Packplatz;02.03.2026 06:01;02.03.2026 08:00;OFFEN
2;1;Packplatz;Regal-Süd;02.03.2026 05:30;02.03.2026 05:00;NEU
3;1;Regal-Süd;Packplatz;morgen;;STORNO
"""


def warehouse(
    folder: Path, shift: str = SHIFT, scenario: str = WAREHOUSE, places: str = PLACES
) -> Path:
    (folder / "schicht.csv").write_text(shift, "cp1252")
    (folder / "plätze.csv").write_text(places)
    path = folder / "shift.yaml"
    path.write_text(scenario)
    return path


def test_a_shift_of_a_warehouse_system_is_read_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = warehouse(tmp_path)
    lines = resolve(path).scenario.orders.listed or ()
    assert [(line.release, line.source, line.target, line.due_tick) for line in lines] == [
        (120, (0, 0), (4, 0), 14_400),
        (0, (4, 0), (0, 0), -7200),
    ]
    assert main(["check", str(path)]) == 0
    told = capsys.readouterr()
    assert told.out.splitlines()[1:] == [
        "  schicht.csv: 2 of 3 rows read; left out: 1 STATUS STORNO",
        "  schicht.csv: ignored columns: POS",
        "  read in ticks of 0.5 s: stop.max_duration 10,000 (83.33 min)",
    ]
    assert [line.partition("warning: ")[2] for line in told.err.splitlines()] == [
        "schicht.csv: 1 row released before tick 0, so known from the start",
        "schicht.csv:3: due before it is released, and therefore late from the start",
    ]


def test_checking_a_shift_needs_no_numba(tmp_path: Path) -> None:
    code = (
        "import sys; from automaton.commands import main; code = main(['check', sys.argv[1]]);"
        "sys.exit(code or 'numba' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code, str(warehouse(tmp_path))], check=False)
    assert run.returncode == 0


def test_without_a_clock_check_says_what_tick_0_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = warehouse(tmp_path, scenario=WAREHOUSE.replace(', clock: "2026-03-02 06:00"', ""))
    assert main(["check", str(path)]) == 0
    assert (
        "  schicht.csv: tick 0 is 02.03.2026 05:30, the earliest release\n"
        in capsys.readouterr().out
    )


def test_unknown_places_are_gathered_and_check_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{k};1;Regal-Nord;Packplatz;02.03.2026 06:0{k % 9};;NEU" for k in range(31)]
    rows += ["99;1;Regal-Süd;;02.03.2026 06:00;;NEU"]
    path = warehouse(tmp_path, SHIFT + "\n".join(rows))
    assert main(["check", str(path)]) == 2
    place = f"{tmp_path}/schicht.csv"
    assert capsys.readouterr().err.splitlines() == [
        f"automaton: {place}:5: VON 'Regal-Nord' is not a location (did you mean 'Regal-Süd'?); "
        f"30 more such rows, in lines {', '.join(map(str, range(6, 16)))} and 20 more",
        f"{place}:36: NACH is empty",
    ]


@pytest.mark.parametrize(
    ("scenario", "places", "sentence"),
    [
        (WAREHOUSE.replace("locations: plätze.csv\n", ""), PLACES,
         "schicht.csv:1: names cells, but the scenario has no locations; set locations"),
        (WAREHOUSE.replace("VON", "VOM"), PLACES,
         "schicht.csv:1: there is no column 'VOM' (did you mean 'VON'?); the columns are AUFTRAG"),
        (WAREHOUSE.replace("from: VON, ", ""), PLACES,
         "there is no column for from or from_x and from_y; the columns are"),
        (WAREHOUSE.replace("from: VON", "form: VON"), PLACES,
         "shift.yaml:12: unknown key 'form' in orders.transports.columns (did you mean 'from'?)"),
        (WAREHOUSE.replace("cp1252", "latin-1"), PLACES, "must be cp1252 or utf-8, found 'latin-1'"),
        (WAREHOUSE.replace("cp1252", "utf-8"), PLACES, "schicht.csv:1: is not utf-8 text (byte 0xc4)"),
        (WAREHOUSE.replace("%d.%m.%Y", "%m/%d/%Y"), PLACES,
         "schicht.csv:2: ANGELEGT '02.03.2026 06:01' is not a time; expected the format "
         "'%m/%d/%Y %H:%M', such as 03/02/2026 06:30; set time: \"%d.%m.%Y %H:%M\"; 1 more such row"),
        (WAREHOUSE.replace("time: \"%d.%m.%Y %H:%M\"", "time: \"%d.%m. %H:%M\""), PLACES,
         "time is the format '%d.%m. %H:%M', of dates without a year"),
        (WAREHOUSE, "name;x;y\nRegal-Süd;0;0\nPackplatz;9;0\n",
         "plätze.csv:3: the location Packplatz [9, 0] lies outside the floor (x 0..4, y 0..1)"),
        (WAREHOUSE, PLACES + "Packplatz;1;0\nTor;x;0\n",
         "plätze.csv:4: name 'Packplatz' appears twice"),
        (WAREHOUSE, "name;x\nTor;1\n", "plätze.csv:1: there is no column for y"),
        (WAREHOUSE, PLACES.replace("Packplatz;4", "Packplatz;2"),
         "schicht.csv:2: an order ends at a shelf, a destination, a rack or a station; [2, 0] is a"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_shift_is_said_with_its_place(
    scenario: str, places: str, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as error:
        resolve(warehouse(tmp_path, scenario=scenario, places=places))
    assert sentence in str(error.value), str(error.value)


def test_check_takes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(scenario(tmp_path))]) == 0
    assert main(["check", str(scenario(tmp_path, "tick\n"))]) == 2
    assert (
        "orders.csv:1: there is no column for released; the columns are tick"
        in capsys.readouterr().err
    )
