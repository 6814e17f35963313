"""Whatever a file says, the answer is one sentence with its place, given at once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from example_counts import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from automaton.commands import main
from automaton.errors import InputError
from automaton.world.resolve import resolve

GOOD = """name: good
layout: {generator: tabletop, tables: 2, positions: 3}
fleet: {robots: 2, kinematics: rail}
durations: {turn: 22, pick: 9}
orders: {generator: full-shelves}
strategy:
  allocation: cooperative
  right_of_way: {name: retreat, max_retries: 3}
seed: 1
"""

DRAWN = """name: drawn
layout:
  picture: |
    {rows}
fleet: {{robots: 1}}
"""


def complaint(folder: Path, text: str | bytes) -> str:
    """What is said about a scenario with this text; "FILE" stands for its path."""
    path = folder / "scenario.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        resolve(path)
    said = str(caught.value)
    assert "\n" not in said
    return said.replace(str(path), "FILE")


def drawn(*rows: str) -> str:
    return DRAWN.format(rows="\n    ".join(rows))


CHANGES = [  # what is typed instead of what, line, words of the answer
    ("robots: 2", "robot: 2", 3, ["unknown key 'robot' in fleet", "did you mean 'robots'?"]),
    ("fleet:", "flet:", 3, ["unknown key 'flet'", "did you mean 'fleet'?"]),
    ("robots: 2", "robots: five", 3, ["fleet.robots must be a whole number", "found 'five'"]),
    ("robots: 2", "robots: 0", 3, ["from 1 to", "found 0"]),
    ("robots: 2", "robots: [true, null]", 3, ["found [true, null]"]),
    ("robots: 2", "robots: 2.5", 3, ["whole number", "found 2.5"]),
    ("robots: 2", "robots: 1:30", 3, ["1:30", "plain decimal"]),
    ("robots: 2", "robots: 010", 3, ["010", "plain decimal"]),
    ("robots: 2", "robots: 9", 3, ["fleet.robots is 9 but the floor has 5 parking bays"]),
    ("rail", "rails", 3, ["differential, omni or rail", "did you mean 'rail'?"]),
    ("name: good", "name: no", 1, ["true or false", "quote it"]),
    ("name: good", "name: 5", 1, ["name must be text", "found 5"]),
    ("name: good", "name: a: b", 1, ["not valid YAML"]),
    ("name: good", "name: [", 3, ["not valid YAML", "begins in line 1"]),
    ("name: good", "name: !!python/object:os.system x", 1, ["tag", "no meaning"]),
    ("name: good\n", "", 1, ["the key 'name' is missing"]),
    ("seed: 1", "seed: 1\nseed: 2", 10, ["'seed' appears twice", "line 9"]),
    ("seed: 1", "seed: -1", 9, ["seed must be", "found -1"]),
    ("seed: 1", "\tseed: 1", 9, ["begins with a tab"]),
    ("seed: 1", "stop: {when: parcked}", 9, ["did you mean 'parked'?"]),
    ("seed: 1", "information: {radius: 0}", 9, ["information.radius", "found 0"]),
    ("seed: 1", "---\nseed: 1", 9, ["second document"]),
    ("turn: 22", "turn: 0", 4, ["durations.turn", "from 1 to 10000", "found 0"]),
    ("turn: 22", "turn: 1" + "0" * 25, 4, ["durations.turn", "from 1 to 10000"]),
    ("tabletop", "tabeltop", 2, ["unknown generator 'tabeltop'", "did you mean 'tabletop'?"]),
    ("tabletop", "os:path", 2, ["generator 'os:path'"]),
    ("tables: 2", "table: 2", 2, ["unknown key 'table' in layout", "did you mean 'tables'?"]),
    ("tables: 2", "tables: 100000", 2, ["layout.tables", "from 1 to 2000"]),
    ("positions: 3", "positions: 3, destinations: 6", 2, ["layout.destinations", "= 5", "found 6"]),
    ("generator: tabletop", "picture: x, generator: tabletop", 2, ["exactly one of"]),
    ("{generator: tabletop, tables: 2, positions: 3}", "", 2, ["must be a mapping"]),
    ("{generator: tabletop, tables: 2, positions: 3}", "{file: x.txt}", 2, ["no floor file"]),
    ("full-shelves", "full-shelfs", 5, ["did you mean 'full-shelves'?"]),
    ("generator: full-shelves", "list: []", 5, ["orders.list", "at least one"]),
    ("cooperative", "cooperativ", 7, ["'cooperativ'", "did you mean 'cooperative'?"]),
    ("allocation", "alocation", 7, ["unknown key 'alocation'", "did you mean 'allocation'?"]),
    ("cooperative", "json:loads", 7, ["'json:loads': loads is not a strategy"]),
    (
        "cooperative",
        "strategies.right_of_way.retreat:Wait",
        7,
        ["a strategy for layer 'right_of_way'"],
    ),
    ("max_retries: 3", "max_retries: 0", 8, ["strategy.right_of_way.max_retries", "found 0"]),
    ("max_retries: 3", "max_retrys: 3", 8, ["did you mean 'max_retries'?"]),
    ("name: retreat, ", "", 8, ["'name' is missing in strategy.right_of_way"]),
    (
        "{name: retreat, max_retries: 3}",
        "pibt\n  routing: astar",
        8,
        ["'astar' would have no effect"],
    ),
    (
        "{robots: 2, kinematics: rail}",
        "{robots: 99, start: random}",
        3,
        ["fleet.robots is 99 but robots can stand on 19 cells"],
    ),
]


@pytest.mark.parametrize(("old", "new", "line", "words"), CHANGES, ids=[c[1][:30] for c in CHANGES])
def test_a_mistake_is_named_with_its_line(
    tmp_path: Path, old: str, new: str, line: int, words: list[str]
) -> None:
    assert old in GOOD
    said = complaint(tmp_path, GOOD.replace(old, new, 1))
    assert said.startswith(f"FILE:{line}: ")
    assert all(word in said for word in words), said


STARTS = [
    ("[[0, 0], [1, 1]]", ["robot 1", "[1, 1]", "a shelf"]),
    ("[[0, 0], [0, 0]]", ["robot 1", "where robot 0 starts already"]),
    ("[[0, 0], [0, 99]]", ["robot 1", "outside the floor (x 0..5, y 0..4)"]),
    ("[[0, 0]]", ["fleet.robots is 2 but fleet.start lists 1 cell"]),
    ("[[0, 0, 0], [1, 1]]", ["fleet.start[0] must be a cell [x, y]"]),
    ("parking-bay", ["did you mean 'parking-bays'?"]),
]


@pytest.mark.parametrize(("start", "words"), STARTS, ids=[start for start, _ in STARTS])
def test_robots_start_on_free_cells_of_their_own(
    tmp_path: Path, start: str, words: list[str]
) -> None:
    said = complaint(tmp_path, GOOD.replace("kinematics: rail", f"start: {start}"))
    assert said.startswith("FILE:3: ")
    assert all(word in said for word in words), said


ORDERS = [
    (
        "[{from: [0, 0], to: [5, 0]}]",
        "an order begins at a shelf, a dock or a station; [0, 0] is a turntable",
    ),
    (
        "[{from: [1, 1], to: [0, 0]}]",
        "an order ends at a shelf, a destination, a rack or a station; [0, 0] is",
    ),
    ("[{from: [1, 1], to: [1, 1]}]", "ends where it begins"),
    ("[{from: [1, 1], to: [9, 0]}]", "[9, 0] lies outside the floor"),
    ("[{from: [1, 1]}]", "the key 'to' is missing in orders.list[0]"),
    ("[{from: [1, 1], to: [5, 0]}, {from: [1, 1], to: [5, 1]}]", "a shelf holds one load"),
]


@pytest.mark.parametrize(("orders", "words"), ORDERS, ids=[words for _, words in ORDERS])
def test_orders_lead_from_shelves_to_slots(tmp_path: Path, orders: str, words: str) -> None:
    said = complaint(tmp_path, GOOD.replace("{generator: full-shelves}", f"{{list: {orders}}}"))
    assert said.startswith("FILE:5: ")
    assert words in said


PICTURES = [
    (["A.s", "x.d"], 5, "row 2, column 1 of the picture: 'x' has no meaning"),
    (
        ["A.d", "###", ".s."],
        6,
        "the shelf at (1, 2) cannot be served",
    ),
    (
        ["A...d", ".sss.", ".sss.", ".sss.", "....."],
        6,
        "the shelf at (2, 2) has no drivable cell beside it",
    ),
    (["A.s", "A.d"], 5, "robot A is drawn twice, at [0, 0] and at [0, 1]"),
    (["A.s", "B.d"], 5 + 1, "fleet.robots is 1 but the picture draws 2, the last at [0, 1]"),
    (["b#", "b.sd"], 4, "a parking bay in this row opens on no cell"),
    (["###"], 4, "no cell that robots drive on"),
    (["A.d"], 2, "need a shelf"),
    (["A.\ts", "..d"], 4, "tab"),
]


@pytest.mark.parametrize(("rows", "line", "words"), PICTURES, ids=[p[2] for p in PICTURES])
def test_a_picture_is_corrected_in_its_own_row(
    tmp_path: Path, rows: list[str], line: int, words: str
) -> None:
    said = complaint(tmp_path, drawn(*rows))
    assert said.startswith(f"FILE:{line}: "), said
    assert words in said


def test_a_floor_file_is_corrected_in_its_own_row(tmp_path: Path) -> None:
    (tmp_path / "floor.txt").write_text("A.s\n.?d\n")
    said = complaint(tmp_path, "name: x\nlayout: {file: floor.txt}\nfleet: {robots: 1}\n")
    assert said.startswith(f"{tmp_path / 'floor.txt'}:2: row 2, column 2 of the picture: '?'")


LEGENDS = [
    ("'.': {kind: wall}", "already stands for floor"),
    ("xx: {kind: wall}", "a single character"),
    ("X: {kind: wall}", "capital letters are reserved for robots; use a lower-case letter"),
    ("x: {kind: wal}", "did you mean 'wall'?"),
    ("x: {kind: track}", "a track needs exits along one axis"),
    ("x: {kind: track, exits: [east, north]}", "a track needs exits along one axis"),
    ("x: {kind: shelf, capacity: 2}", "robots do not drive on it"),
    ("x: {kind: floor, capacity: 3}", "must be 0, 1 or 2, found 3"),
    ("x: {kind: floor, exits: [up]}", "east, north, south or west"),
    ("x: floor", "must be a mapping with the keys kind"),
]


@pytest.mark.parametrize(("entry", "words"), LEGENDS, ids=[entry for entry, _ in LEGENDS])
def test_a_legend_makes_sense(tmp_path: Path, entry: str, words: str) -> None:
    text = drawn("A.s", "..d").replace("fleet", f"  legend:\n    {entry}\nfleet")
    said = complaint(tmp_path, text)
    assert said.startswith("FILE:7: "), said
    assert words in said


def bomb() -> str:
    lines = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    for name, previous in zip("bcdefghij", "abcdefghi", strict=True):
        lines.append(f"{name}: &{name} [{', '.join([f'*{previous}'] * 9)}]")
    return "\n".join(lines)


NO_SCENARIOS: list[tuple[str, str | bytes, str]] = [
    ("empty", "", "is empty"),
    ("only a comment", "# nothing\n", "is empty"),
    ("a list", "- a\n", "a scenario has keys"),
    ("plain text", "hello", "a scenario has keys"),
    ("random bytes", bytes(range(256)) * 400, "not a text file"),
    ("a bell", "name: \x07", "control character U+0007"),
    ("latin-1", "name: caf\xe9".encode("latin-1"), "not UTF-8"),
    ("utf-16", GOOD.encode("utf-16"), "UTF-16"),
    ("a bomb of aliases", bomb(), "aliases expand"),
    ("an alias to itself", "name: &a [*a]", "part of"),
    ("deep nesting", "[" * 100_000, "nested more than"),
    ("too many values", "- a\n" * 1_000_000, "more than 100,000 values"),
    ("a long word", "a" * 7_000_000, "a scenario has keys"),
    ("100 MB", b"a: 1\n" * 20_000_000, "has 100.0 MB"),
]


@pytest.mark.parametrize(
    ("text", "words"), [case[1:] for case in NO_SCENARIOS], ids=[case[0] for case in NO_SCENARIOS]
)
def test_what_is_no_scenario_is_refused(tmp_path: Path, text: str | bytes, words: str) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        resolve(path)
    assert words in str(caught.value)
    path.unlink()


def test_a_missing_file_or_name_is_explained(tmp_path: Path) -> None:
    for name, words in [
        ("tabeltop-1", "did you mean 'tabletop-1'?"),
        ("zzz", "there are bad-day, crossing, depots"),
        ("zzz.yaml", "zzz.yaml: no such file"),
        (str(tmp_path), "is a folder"),
        (os.devnull, "not a regular file"),
    ]:
        with pytest.raises(InputError) as caught:
            resolve(name)
        assert words in str(caught.value)


SETTINGS = [
    ("fleet.robts=5", "did you mean 'robots'?"),
    ("flet.robots=5", "did you mean 'fleet'?"),
    ("fleet.robots=five", "found 'five'"),
    ("fleet.robots=99", "the floor has 12 parking bays"),
    ("fleet.robots", "expected KEY=VALUE"),
    ("=5", "expected KEY=VALUE"),
    ("fleet.robots.x=3", "fleet.robots has no keys that can be set"),
    ("layout.tabels=3", "did you mean 'tables'?"),
    ("fleet.robots=[1", "not valid YAML"),
    ("fleet.robots=1:30", "plain decimal"),
    ("strategy.right_of_way.max_retries=0", "found 0"),
    ("strategy.routing=shortst", "did you mean 'shortest'?"),
]


@pytest.mark.parametrize(("setting", "words"), SETTINGS, ids=[setting for setting, _ in SETTINGS])
def test_a_mistake_in_set_names_the_argument(setting: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        resolve("tabletop-1", [setting])
    assert str(caught.value).startswith(f"--set {setting}: ")
    assert words in str(caught.value)


def test_a_mistake_beside_a_set_keeps_its_own_line(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(GOOD.replace("turn: 22", "turn: 0"))
    with pytest.raises(InputError, match=r"scenario\.yaml:4: durations\.turn"):
        resolve(path, ["fleet.robots=1", "durations.pick=3"])


def test_the_command_line_says_one_sentence_and_exits_with_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(GOOD.replace("robots: 2", "robots: 0"))
    assert main(["check", str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "Traceback" not in err
    assert err.startswith(f"automaton: {path}:3: ")


def test_debug_shows_the_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "nothing", "--debug"]) == 2
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["chek"], "did you mean 'check'?"),
        (["--jsn"], "unknown option '--jsn'"),
        (["check"], "the following arguments are required: FILE"),
        (["list", "--jsn"], "did you mean '--json'?"),
        (["schema", "x"], "invalid choice: 'x' (choose from"),
    ],
)
def test_a_wrong_command_line_is_explained(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert words in err


def test_a_closed_pipe_is_no_error() -> None:
    command = f"{sys.executable} -m automaton schema | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.stdout == "{\n" and done.stderr == ""


def test_interruption_ends_with_130(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("automaton.commands.check.resolve", interrupted)
    assert main(["check", "tabletop-1"]) == 130
    assert capsys.readouterr().err == "automaton: interrupted\n"


@settings(max_examples=examples(80), deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_no_damage_to_a_file_gets_past_with_anything_but_a_sentence(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Characters of a good file replaced, removed or added: it stays good or is explained."""
    place = data.draw(st.integers(0, len(GOOD) - 1))
    length = data.draw(st.integers(0, 5))
    new = data.draw(st.text("ab:[]{}-,|>&*!%@'\"#\n\t 019.~?\\é\x00", max_size=4))
    path = tmp_path_factory.getbasetemp() / "damaged.yaml"
    path.write_text(GOOD[:place] + new + GOOD[place + length :], encoding="utf-8")
    try:
        resolve(path)
    except InputError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize("form", ["file", "matrix"])
def test_a_name_longer_than_files_may_have_is_no_file(form: str, tmp_path: Path) -> None:
    text = GOOD.replace(
        "layout: {generator: tabletop, tables: 2, positions: 3}",
        f"layout: {{{form}: {'9' * 400}x}}",
    )
    assert complaint(tmp_path, text).startswith("FILE:2: there is no floor file '999")
    with pytest.raises(InputError, match="no file and no shipped scenario is called"):
        resolve("9" * 400)
