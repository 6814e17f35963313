"""The commands that say what there is and what is right: check, schema, list, --help."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import msgspec
import pytest

from automaton.commands import COMMANDS, main
from automaton.scenario.document import override
from automaton.scenario.floor_section import generators, json_schema
from automaton.scenario.reading import read
from automaton.scenario.schema import LAYER_NAMES, Scenario
from automaton.scenario.text_files import shipped
from automaton.strategy import lookup
from automaton.studies.sweeps.study import shipped_studies
from automaton.world.resolve import resolve

HEAVY = ("numba", "textual", "rich")


@cache
def validator() -> jsonschema.Draft202012Validator:
    """What judges scenarios by the schema, which is one itself."""
    schema = json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_check_says_one_line_about_each_good_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "tabletop-1", "tabletop-mini"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "tabletop-1: 50 shelves, 12 destinations, 4 robots, ok",
        "tabletop-mini: 25 shelves, 7 destinations, 3 robots, ok",
    ]


def test_check_draws_the_floor(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "goods-mini", "--picture"]) == 0
    floor = ">>>>>>>>>v\n^#pppp#q#v\n^########v\n^<<<<t<<<<"
    assert floor in capsys.readouterr().out
    assert main(["check", "goods-mini", "--picture", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["picture"].startswith(floor)
    study = next(iter(shipped_studies()))
    assert main(["check", study, "--picture"]) == 2
    assert (
        f"--picture draws the floor of one scenario; {study} is a study" in capsys.readouterr().err
    )


def test_check_takes_settings_as_run_does(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "tabletop-1", "--set", "fleet.robots=2"]) == 0
    assert capsys.readouterr().out.endswith("2 robots, ok\n")
    assert main(["check", "tabletop-1", "--set", "fleet.robots=two"]) == 2
    assert "--set fleet.robots=two: fleet.robots must be" in capsys.readouterr().err


NOTHING_TO_AVOID = "finds no traffic to avoid: every cell holds any number of robots"


@pytest.mark.parametrize(
    ("settings", "warned"),
    [
        (("strategy.routing=congestion", "world.slowdown=none"), True),
        (("strategy.routing=traffic-avoidance", "world.slowdown=none"), True),
        (("strategy.routing=congestion",), False),
        (("strategy.routing=astar", "world.slowdown=none"), False),
        (("strategy.routing=congestion", "world.slowdown=none", "layout.capacity=1"), False),
    ],
)
def test_a_floor_without_traffic_to_avoid_is_warned_of(
    settings: tuple[str, ...], warned: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [option for setting in settings for option in ("--set", setting)]
    for command in (["check"], ["run", "--until", "2"]):
        assert main([command[0], "warehouse-100", *command[1:], *options]) == 0
        out, err = capsys.readouterr()
        assert (NOTHING_TO_AVOID in err) == warned and err.count("\n") == warned
        assert "warning" not in out


STATIONS = """name: yard
layout:
  picture: |
    b.t..t
    b...c.
fleet: {robots: 2, kinematics: omni}
orders: {parts: [{route: [1, 2], count: 3}]}
strategy: {allocation: shortest-job, right_of_way: wait}
stop: {when: delivered}
"""


@pytest.mark.parametrize(
    ("settings", "warned"),
    [
        (["fleet.start=parking-bays"], ""),
        (["fleet.start=random"], ""),  # not on stations
        (["fleet.start=random", "fleet.robots=8"], "so robots begin and park on stations too"),
        (["fleet.start=[[0, 0], [4, 0]]"], "robot 1 begins on a station and therefore parks there"),
        (["fleet.start=[[0, 0], [2, 0]]"], ""),
        (["strategy.allocation={name: shortest-job, idle: stay}"], "stay where they dropped"),
        (["fleet.start=random", "fleet.robots=1"], ""),
        (["fleet.start=random", "fleet.when_idle=leave"], ""),
        (
            ["fleet.start=random", "fleet.robots=8", "strategy.right_of_way=retreat"],
            "idle_give_way: true",
        ),
        (["fleet.start=random", "strategy.right_of_way={name: retreat, idle_give_way: true}"], ""),
        (
            ["battery={drain: {move: 1}, charge_rate: 1}"],
            "the floor has 1 charger, but strategy.charging",
        ),
        (["battery={drain: {move: 1}, charge_rate: 1}", "strategy.charging=threshold"], ""),
    ],
)
def test_robots_that_stay_on_stations_and_batteries_for_nothing_are_warned_of(
    settings: list[str], warned: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(STATIONS)
    assert main(["check", str(path), *(part for one in settings for part in ("--set", one))]) == 0
    said = capsys.readouterr().err
    assert warned in said and bool(warned) == ("warning" in said)


@pytest.mark.parametrize(
    ("settings", "warned"),
    [
        ([], ""),
        (
            [
                "stop.max_duration=90",
                "orders={parts: [{route: [1, 2], count: 3, first_release: 90}]}",
            ],
            "the last of 3 parts comes after about 90 ticks, when the run is over "
            "(stop.max_duration 90 ticks), so it may not finish",
        ),
        (["stop={when: never, max_duration: 90}", "ORDERS, mean_interarrival_time: 60}"], ""),
        (
            ["stop.max_duration=90", "orders={list: [LATE, {from: [1, 0], to: [4, 0]}]}"],
            "1 of 2 orders in the list comes after 95 ticks or later",
        ),
        (
            ["stop={when: never, max_duration: 90}", "orders={list: [LATE]}"],
            "1 of 1 order in the list comes after 95 ticks or later, when the run is over "
            "(stop.max_duration 90 ticks)\n",
        ),
        (["stop.max_duration=90", "ORDERS, mean_interarrival_time: 9}"], ""),
        (
            ["stop.max_duration=90", "ORDERS, mean_interarrival_time: 10}"],
            "the last of 10 orders comes after about 90 ticks",
        ),
        (
            ["stop.max_duration=90", "ORDERS, arrivals: {bursts: {size: 4, every: {mean: 50}}}}"],
            "the last of 10 orders comes after about 100 ticks",
        ),
    ],
)
def test_orders_that_come_when_the_run_is_over_are_warned_of(
    settings: list[str], warned: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(STATIONS)
    short = {
        "LATE": "{from: [1, 0], to: [4, 0], release: 95}",
        "ORDERS": "orders={generator: stations, count: 10",
    }
    for name, text in short.items():
        settings = [setting.replace(name, text) for setting in settings]
    assert main(["check", str(path), *(part for one in settings for part in ("--set", one))]) == 0
    said = capsys.readouterr().err
    assert warned in said and bool(warned) == ("warning" in said)


def test_check_warns_of_the_points_of_a_study_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "yard.yaml").write_text(STATIONS)
    (tmp_path / "all.yaml").write_text(
        "name: all\nscenario: yard.yaml\nfactors: {stop.max_duration: [2, 3, 9],"
        " orders.parts: [[{route: [1, 2], first_release: 5}]]}\nreplications: 1\n"
    )
    assert main(["check", str(tmp_path / "all.yaml")]) == 0
    out, err = capsys.readouterr()
    assert out == "all: 3 points x 1 replication, 3 runs, ok\n"
    assert err.startswith("automaton: all: warning: the last of 1 part comes after about 5 ticks")
    assert "(point 0: yard.yaml, stop.max_duration 2, " in err
    assert err.endswith("; and 1 more point)\n") and err.count("\n") == 1


@pytest.mark.parametrize("key", ["precision", "recall"])
def test_a_share_out_of_range_is_told_the_whole_range(
    key: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = {"precision": 0.4, "recall": 0.8, key: 40}
    noisy = f"precision: {given['precision']}, recall: {given['recall']}"
    routing = f"strategy.routing={{name: traffic-avoidance, predictor: noisy, {noisy}}}"
    assert main(["check", "warehouse-100", "--set", routing]) == 2
    said = f"strategy.routing.{key} must be a number above 0 and at most 1, found 40\n"
    assert capsys.readouterr().err.endswith(said)


def test_a_zone_design_that_robots_of_a_type_cannot_serve_is_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As `run` refuses it."""
    setting = "strategy.zoning={name: genetic, design: factory-ddz, generations: 2}"
    for command in ("check", "run"):
        assert main([command, "factory-types", "--set", setting]) == 2
        assert "but robot 0 (tug) cannot reach it" in capsys.readouterr().err


def test_check_goes_on_after_a_bad_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "nothing", "tabletop-2", "nor.yaml"]) == 2
    out, err = capsys.readouterr()
    assert out == "tabletop-2: 50 shelves, 6 destinations, 4 robots, ok\n"
    assert len(err.splitlines()) == 2


def test_a_default_is_recorded_as_it_is_read_again(tmp_path: Path) -> None:
    """0 beside 0.0 would stand as a difference over two runs that are compared."""
    file = tmp_path / "plain.yaml"
    layout = "{generator: tabletop, tables: 2, positions: 3}"
    file.write_text(f"name: plain\nlayout: {layout}\nfleet: {{robots: 1}}\n")
    recorded = msgspec.to_builtins(resolve(file).scenario)
    again = msgspec.to_builtins(msgspec.convert(recorded, Scenario))
    assert str(recorded) == str(again)


def test_schema_prints_the_json_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(json_schema()))


def test_the_schema_has_every_key_and_describes_it() -> None:
    definitions = json_schema()["$defs"]
    assert set(definitions["Scenario"]["properties"]) == set(Scenario.__struct_fields__)
    for name, definition in definitions.items():
        assert definition.get("description"), name
        for key, schema in definition.get("properties", {}).items():
            referred = schema.get("$ref") or schema.get("const") or schema.get("anyOf")
            assert "description" in schema or referred or name.startswith(LAYER_NAMES), (name, key)


def test_the_schema_names_every_generator_and_strategy() -> None:
    definitions = json_schema()["$defs"]
    expected = {f"layout-{name}" for name in generators()}
    expected |= {f"{layer}-{name}" for layer in LAYER_NAMES for name in lookup.names(layer)}
    assert expected <= set(definitions)
    assert set(definitions["layout-tabletop"]["properties"]) == {
        "generator",
        "tables",
        "positions",
        "destinations",
    }


@pytest.mark.parametrize("name", shipped())
def test_the_schema_accepts_the_shipped_scenarios(name: str) -> None:
    validator().validate(read(name).data)


@pytest.mark.parametrize(
    "setting",
    [
        "fleet.robots=5",
        "fleet.start=[[0, 0], [2, 0], [4, 0]]",
        "strategy.right_of_way={name: retreat, max_retries: 3}",
        "strategy.right_of_way=null",
        "information={radius: 3}",
        "orders={list: [{from: [1, 1], to: [3, 1]}]}",
        "layout.destinations=3",
        "stop={when: never, max_duration: 100}",
    ],
)
def test_schema_and_reader_accept_the_same(setting: str) -> None:
    resolve("tabletop-mini", [setting])
    validator().validate(changed(setting))


@pytest.mark.parametrize(
    "setting",
    [
        "fleet.robots=0",
        "fleet.robot=5",
        "fleet.kinematics=hover",
        "fleet.start=[[0]]",
        "durations.turn=0",
        "strategy.allocation=fastest",
        "strategy.right_of_way={name: retreat, max_retries: 0}",
        "strategy.right_of_way={max_retries: 2}",
        "information={radius: 0}",
        "orders={list: [{from: [1], to: [3, 1]}]}",
        "layout.tables=0",
        "layout.table=3",
        "layout={picture: '.', legend: {x: {kind: wal}}}",
        "stop.when=soon",
        "seed=-1",
        "colour=red",
    ],
)
def test_schema_and_reader_refuse_the_same(setting: str) -> None:
    with pytest.raises(Exception, match="--set"):
        resolve("tabletop-mini", [setting])
    with pytest.raises(jsonschema.ValidationError):
        validator().validate(changed(setting))


def changed(setting: str) -> dict[str, Any]:
    return override(read("tabletop-mini"), [setting]).data


def test_list_names_everything_with_one_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"scenarios", "studies", "floors", "strategies"}
    assert {entry["name"] for entry in found["scenarios"]} == set(shipped())
    assert {entry["name"] for entry in found["floors"]} == set(generators())
    assert {"name", "layer", "summary"} == set(found["strategies"][0])
    for entries in found.values():
        assert all(entry["summary"] and "\n" not in entry["summary"] for entry in entries)


def test_list_as_text_has_a_line_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"\n  tabletop-mini +The small table-top", out)
    assert any(line.split()[:2] == ["cooperative", "allocation"] for line in out.splitlines())


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == main([]) == 0
    out = capsys.readouterr().out
    assert all(f"\n  {name} " in out for name in COMMANDS)


@pytest.mark.parametrize(
    ("arguments", "forbidden"),
    [
        (["--help"], (*HEAVY, "numpy", "msgspec", "yaml")),
        (["check", "tabletop-1"], HEAVY),
        (["schema"], HEAVY),
        (["list"], HEAVY),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_light_commands_import_nothing_heavy(
    arguments: list[str], forbidden: tuple[str, ...]
) -> None:
    code = (
        "import sys; from automaton.commands import main; "
        f"code = main({arguments!r}); "
        f"print([name for name in {forbidden!r} if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"


WITH_STATIONS = tuple(name for name in shipped() if name.startswith(("depots", "factory")))


@pytest.mark.parametrize("allocation", ["cooperative", "adaptive"])
def test_an_allocation_that_passes_loads_on_is_refused_at_stations(
    allocation: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(WITH_STATIONS) == 8
    for name in WITH_STATIONS:
        assert main(["check", name, "--set", f"strategy.allocation={allocation}"]) == 2
        errors = capsys.readouterr().err
        told = "it finds loads only on shelves, but orders begin at stations; use first-come"
        assert told in errors.splitlines()[-1]  # above it, that zones are compiled, once


def test_who_knows_the_orders_of_zones_alone_needs_zones(
    capsys: pytest.CaptureFixture[str],
) -> None:
    none = ["--set", "strategy.zoning=none"]
    assert main(["check", "factory-ddz", *none]) == 2
    errors = capsys.readouterr().err
    assert "strategy.zoning is none, but information.orders is zones" in errors
    assert errors.count("\n") == 1
    for known in ("everything", "orders", "{radius: 131, shape: circle}"):
        assert main(["check", "factory-ddz", *none, "--set", f"information={known}"]) == 0


@pytest.mark.parametrize("zoning", ["static", "annealing", "genetic"])
@pytest.mark.parametrize(
    "information", ["orders", "{radius: 131, shape: circle, orders: zones}", "{radius: 5}"]
)
def test_zones_of_one_computer_need_to_see_everything(
    zoning: str, information: str, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["--set", f"strategy.zoning={zoning}", "--set", f"information={information}"]
    assert main(["check", "factory-ddz", *settings]) == 2
    errors = capsys.readouterr().err
    assert "one computer monitors all zones, so it needs information: everything" in errors
    assert errors.count("\n") == 1
    assert main(["check", "factory-ddz", *settings[:2], "--set", "information=everything"]) == 0


@pytest.mark.parametrize("allocation", ["cooperative", "adaptive"])
def test_an_allocation_that_sees_no_docks_is_refused(
    allocation: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn = tmp_path / "drawn.yaml"
    drawn.write_text(
        "name: drawn\nlayout:\n  picture: |\n    i...\n    #rs.\nfleet: {robots: 1}\n"
        "orders: {list: [{from: [2, 1], to: [1, 1]}, {from: [0, 0], to: [1, 1]}]}\n"
        f"strategy: {{allocation: {allocation}}}\n"
    )
    racks = tmp_path / "racks.yaml"
    text = shipped()["warehouse-100"].read_text(encoding="utf-8")
    racks.write_text(text.replace("allocation: first-come", f"allocation: {allocation}"))
    for path in (drawn, racks):
        assert main(["check", str(path)]) == 2
        errors = capsys.readouterr().err
        assert "it finds loads only on shelves, but orders begin at docks" in errors
        assert errors.count("\n") == 1 and f"{path}:" in errors
    drawn.write_text(drawn.read_text().replace(", {from: [0, 0], to: [1, 1]}", ""))
    assert main(["check", str(drawn)]) == 0
