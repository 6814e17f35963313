"""Times, speeds and rates with their units, instead of ticks."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated

import jsonschema
import msgspec
import pytest
import yaml

from automaton.errors import InputError
from automaton.scenario.floor_section import json_schema
from automaton.scenario.quantities import (
    CELLS,
    CHARGE_RATE,
    GAP,
    LENGTH,
    MINUTES,
    PROBABILITY,
    SECONDS,
    STEP,
    TIME,
    TURN,
    Quantity,
    Scale,
    quantity,
)
from automaton.scenario.validation import NumberRange, Place, convert, with_numbers
from automaton.world.resolve import Resolved, resolve

HALF_SECONDS = Scale(tick="0.5 s", cell="0.8 m")
WIDE = NumberRange(is_whole=False)

SCENARIO = """name: yard
layout: {generator: tabletop, tables: 2, positions: 3}
fleet: {robots: 2, kinematics: omni}
units: {tick: 0.5 s, cell: 0.8 m, clock: "2026-03-02 06:00"}
durations: {pick: 20 s}
orders: {generator: full-shelves}
faults: {list: [{robot: 1, at: 9}]}
"""


def exact(text: str, quantity: Quantity, scale: Scale = HALF_SECONDS) -> Fraction:
    return convert("key", text, Place(quantity, WIDE), scale).exact


def resolved(folder: Path, old: str = "", new: str = "", *settings: str) -> Resolved:
    """The scenario above with one thing written otherwise."""
    assert old in SCENARIO
    path = folder / "yard.yaml"
    path.write_text(SCENARIO.replace(old, new, 1))
    return resolve(path, settings)


def complaint(folder: Path, old: str, new: str, *settings: str) -> str:
    with pytest.raises(InputError) as caught:
        resolved(folder, old, new, *settings)
    return str(caught.value).replace(str(folder / "yard.yaml"), "FILE")


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("20 s", "20"), ("20s", "20"), (" 20  s ", "20"), ("1.5min", "90"), ("8h", "28800"),
        ("2 d", "172800"), ("250 ms", "1/4"), ("00:10:00", "600"), ("1:30:00", "5400"),
        ("0:00:01.5", "3/2"), ("100:00:00", "360000"), ("1e3 ms", "1"), ("1e3ms", "1"), (".5 s", "1/2"),
        ("5. s", "5"), ("20 seconds", "20"), ("2 hours", "7200"), ("1 day", "86400"), ("0 s", "0"),
        ("0.1 s", "1/10"), ("20\u00a0s", "20"),
    ],
)  # fmt: skip
def test_times_are_read_exactly(text: str, seconds: str) -> None:
    assert exact(text, TIME) == 2 * Fraction(seconds)
    assert exact(text, SECONDS) == Fraction(seconds)
    assert exact(text, MINUTES) == Fraction(seconds) / 60


@pytest.mark.parametrize(
    ("text", "quantity", "number"),
    [
        ("1 m/s", STEP, "8/5"),
        ("1.5 m/s", STEP, "16/15"),
        ("3.6 km/h", STEP, "8/5"),
        ("60 m/min", STEP, "8/5"),
        ("100 cm / s", STEP, "8/5"),
        ("2 cells/s", STEP, "1"),
        ("1 cell/s", STEP, "2"),
        ("3 s", STEP, "6"),
        ("90 deg/s", TURN, "2"),
        ("45°/s", TURN, "4"),
        ("1 s", TURN, "2"),
        ("120/h", GAP, "60"),
        ("2 /min", GAP, "60"),
        ("2 / minute", GAP, "60"),
        ("30 s", GAP, "60"),
        ("0.72/h", PROBABILITY, "1/10000"),
        ("9 %/h", CHARGE_RATE, "1/800"),
        ("9%/h", CHARGE_RATE, "1/800"),
        ("4 m", CELLS, "5"),
        ("400 cm", CELLS, "5"),
        ("5 cells", CELLS, "5"),
        ("400 cm", LENGTH, "4"),
        ("5 cells", LENGTH, "4"),
    ],
)
def test_speeds_rates_and_lengths_are_read_exactly(
    text: str, quantity: Quantity, number: str
) -> None:
    assert exact(text, quantity) == Fraction(number)


def test_lengths_of_strategies_are_in_the_unit_of_the_cell() -> None:
    scale = Scale(tick="0.635055 s", cell="2.5 ft")
    assert exact("100 ft", LENGTH, scale) == 100
    assert exact("30.48 m", LENGTH, scale) == 100
    assert exact("25 ft", CELLS, scale) == 10
    assert exact("1 s", TIME, scale) == Fraction(1_000_000, 635_055)


def test_halves_are_rounded_up() -> None:
    whole = Place(TIME, NumberRange(is_whole=True, ge=1))
    values = [
        convert("key", text, whole, HALF_SECONDS).value
        for text in ("0.74 s", "0.75 s", "1.24 s", "1.25 s")
    ]
    assert values == [1, 2, 2, 3]


REFUSED = [  # a text, what is said of it
    ("1,5 s", ["'1,5 s'", "decimal point", "such as 1.5 s"]),
    ("1 000 s", ["'1 000 s'", "nothing between the digits"]),
    ("1_000 s", ["nothing between the digits"]),
    ("-3 s", ["'-3 s' must not be below 0"]),
    ("+3 s", ["'+3 s' is not a number with a unit, such as 20 s"]),
    ("1.2.3 s", ["'1.2.3 s'"]),
    ("20 sek", ["no unit 'sek' here", "did you mean 'sec'?", "ms, s, min, h or d"]),
    ("20 mins", ["no unit 'mins' here", "did you mean 'min'?"]),
    ("20 hrs", ["did you mean 'hours'?"]),
    ("20 parsecs", ["no unit 'parsecs' here", "the units are ms, s, min, h or d"]),
    ("20 S", ["did you mean 's'?"]),
    ("20 m", ["'20 m' is a length, expected a time such as 20 s; minutes are min"]),
    ("1.5 m/s", ["'1.5 m/s' is a speed, expected a time such as 20 s"]),
    ("120/h", ["'120/h' is a rate, expected a time"]),
    ("5 %", ["'5 %' is percent, expected a time"]),
    ("20", ["'20' is text without a unit"]),
    ("1 h 30 min", ["'1 h 30 min' is not one number with one unit"]),
    ("00:10", ["hours and minutes or minutes and seconds", "'00:10:00' or '0:00:10'"]),
    ("90:30", ["'90:30:00' or '1:30:30'"]),
    ("00:75:00", ["minutes and seconds of H:MM:SS go up to 59"]),
    ("00:00:60", ["go up to 59"]),
    ("2026-03-02 06:30", ["is a clock time, expected a time such as 20 s"]),
    ("2026-03-02", ["is a clock time, expected a time such as 20 s"]),
    ("1" * 61 + " s", ["has 63 characters"]),
    ("5 s/s", ["no unit 's/s' here"]),
    ("0.2 s", ["'0.2 s' is less than half a tick of 0.5 s, so it would be 0 ticks"]),
    ("0 s", ["'0 s' is 0 ticks (0 s); allowed is from 1 tick (0.5 s) to 10,000 ticks (83.33 min)"]),
    ("8 h", ["'8 h' is 57,600 ticks (8 h); allowed is from 1 tick (0.5 s) to 10,000 ticks (83.33 min)"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "words"), REFUSED, ids=[text[:20] for text, _ in REFUSED])
def test_what_is_not_a_time_is_refused_in_a_sentence(text: str, words: list[str]) -> None:
    place = Place(TIME, NumberRange(is_whole=True, ge=1, le=10_000))
    with pytest.raises(InputError) as caught:
        convert("durations.pick", text, place, HALF_SECONDS)
    said = str(caught.value)
    assert said.startswith("durations.pick: ") and "\n" not in said
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("text", "quantity", "words"),
    [
        ("0 m/s", STEP, "a speed or a rate must be above 0"),
        ("1.5 mph", STEP, "no unit 'mph' here"),
        ("1.5 m/sec2", STEP, "not one number with one unit"),
        ("2 cell/s/s", STEP, "no unit 'cell/s/s' here"),
        ("90 rad/s", TURN, "did you mean 'deg/s'?"),
        ("9 %/hour", TIME, "'9 %/hour' is percent per time"),
        ("9 %", CHARGE_RATE, "'9 %' is percent, expected percent per time, such as 9 %/h"),
        ("3 yd", CELLS, "the units are m, cm, mm, km, ft, in or cells"),
    ],
)
def test_units_that_do_not_fit_are_refused(text: str, quantity: Quantity, words: str) -> None:
    with pytest.raises(InputError) as caught:
        exact(text, quantity)
    assert words in str(caught.value)


WRONG = [  # instead of what, what is written, line, words of the answer
    ("pick: 20 s", "pick: 20 sek", 5, ["durations.pick", "did you mean 'sec'?"]),
    ("pick: 20 s", "pick: 10:00", 5, ["YAML reads 10:00", 'quote it: "10:00"']),
    ("pick: 20 s", 'pick: "10:00"', 5, ["durations.pick", "'10:00:00' or '0:10:00'"]),
    ("pick: 20 s", "pick: 10:00:00", 5, ["YAML reads 10:00:00", 'quote it: "10:00:00"']),
    ("pick: 20 s", "pick: 2026-03-02 06:00:05", 5, ["durations.pick", "is a clock time"]),
    ("pick: 20 s", "pick: twenty", 5, ["whole number from 0 to 10000, or a time such as 20 s"]),
    ("pick: 20 s", "pick: 0.5", 5, ["whole number", "or a time such as 20 s", "found 0.5"]),
    ("tick: 0.5 s", "tick: 1 cycle", 5, ["durations.pick: units.tick is '1 cycle', which is not a"]),
    ("tick: 0.5 s, ", "", 5, ["durations.pick: units.tick is '1 tick', which is not a time in ms"]),
    ("pick: 20 s", "move: 1 m/s, pick: 20 s", 0, []),
    ("cell: 0.8 m, ", "", 0, []),
    ("at: 9", 'at: "05:00"', 7, ["faults.list[0].at", "is before tick 0", "on the day of units.clock"]),
    ("at: 9", "at: 2026-03-01 07:00", 7, ["faults.list[0].at", "before tick 0"]),
    ("at: 9", "at: 2026-02-30 07:00", 7, ["is not a day of the calendar"]),
    ("at: 9", 'at: "25:00"', 7, ["not a time of the day", "00:00 to 23:59"]),
    ("at: 9", "at: 2026-03-02", 7, ["not a date with a time, such as '2026-03-02 06:30'"]),
    ("at: 9", "at: 02.03.2026 07:00", 7, ["not a date with a time"]),
    ("at: 9", "at: 2026-03-02T07:00Z", 7, ["time zone"]),
    ("at: 9", "at: 2026-03-02 07:00+01:00", 7, ["time zone"]),
    ("at: 9", "at: 06:10:00", 7, ["may be a time of the day or a time after the start"]),
    ("at: 9", "at: 06:00", 7, ["'06:00' is 0 ticks (0 s); allowed is from 1 tick (0.5 s)"]),
    ('clock: "2026-03-02 06:00"', 'clock: "6 am"', 4, ["units.clock", "is not a clock time"]),
    ('clock: "2026-03-02 06:00"', "clock: 10:30", 4, ['quote it: "10:30"']),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "words"), WRONG, ids=[row[1][:30] for row in WRONG])
def test_a_mistake_has_its_line(
    tmp_path: Path, old: str, new: str, line: int, words: list[str]
) -> None:
    if not line:
        assert resolved(tmp_path, old, new).scenario.durations.pick == 40
        return
    said = complaint(tmp_path, old, new)
    assert said.startswith(f"FILE:{line}: "), said
    assert all(word in said for word in words), said


def test_a_speed_needs_to_know_what_a_cell_is(tmp_path: Path) -> None:
    said = complaint(tmp_path, "cell: 0.8 m, ", "", "durations.move=0.5 m/s")
    assert said.startswith(
        "--set durations.move=0.5 m/s: durations.move: the size of a cell is unknown"
    )
    said = complaint(tmp_path, "cell: 0.8 m", "cell: 1 slot", "durations.move=0.5 m/s")
    assert "units.cell is '1 slot', which is not a length in m, cm, mm, km, ft or in" in said
    assert (
        resolved(tmp_path, "cell: 0.8 m, ", "", "durations.move=2 cells/s").scenario.durations.move
        == 1
    )


@pytest.mark.parametrize("tick", ["0.5s", "0.5 s", "500ms", "0.5 seconds"])
def test_a_tick_may_be_written_in_several_ways(tmp_path: Path, tick: str) -> None:
    assert resolved(tmp_path, "tick: 0.5 s", f"tick: {tick}").scenario.durations.pick == 40


@pytest.mark.parametrize("tick", ["0 s", "-1 s", "1e3ms", "0.5", f"0.{'0' * 400}1 s", "0,5 s"])
def test_what_is_not_a_tick_is_refused(tmp_path: Path, tick: str) -> None:
    said = complaint(tmp_path, "tick: 0.5 s", f'tick: "{tick}"')
    assert said.startswith("FILE:4: units.tick must be a number above 0 and a name"), said


def test_a_clock_time_needs_a_clock(tmp_path: Path) -> None:
    clock = ', clock: "2026-03-02 06:00"'
    said = complaint(tmp_path, clock, "", "faults.list.0.at=06:30")
    assert "the clock time of tick 0 is unknown" in said
    bare = ', clock: "06:00"'
    said = complaint(tmp_path, clock, bare, "faults.list.0.at=2026-03-02 06:30")
    assert "has a date, but units.clock has none" in said


def test_settings_take_the_same_texts(tmp_path: Path) -> None:
    run = resolved(
        tmp_path, "", "",
        "durations.move=1 m/s", "stop.max_duration=8h", "faults.list.0.at=01:40:10", "units.clock=null",
        "faults.tow_after=5 min", "orders={generator: full-shelves, mean_interarrival_time: 120/h}",
        "measure.warm_up=10 min", "information.radius=4 m",
        "strategy.right_of_way={name: wait, wait_empty: [1 s, 2 s]}",
    ).scenario  # fmt: skip
    assert (run.durations.move, run.stop.max_duration, run.faults.listed[0].at) == (
        2,
        57_600,
        12_020,
    )
    assert (run.faults.tow_after, run.orders.mean_interarrival_time) == (600, 60.0)
    assert run.measure is not None and run.measure.warm_up == 1200
    assert run.information.radius == 5


def test_a_finer_tick_counts_the_same_times_anew(tmp_path: Path) -> None:
    run = resolved(tmp_path, "", "", "units.tick=0.1s", "strategy.right_of_way.name=wait",
                   "strategy.right_of_way.wait_empty=[1 s, 2 s]")  # fmt: skip
    assert run.scenario.durations.pick == 200
    assert run.strategies["right_of_way"].parameters.wait_empty == (10, 20)


def test_clock_times_count_from_the_clock(tmp_path: Path) -> None:
    def tick_of(text: str) -> int:
        return resolved(tmp_path, "at: 9", f"at: {text}").scenario.faults.listed[0].at

    assert tick_of("06:30") == tick_of("2026-03-02 06:30") == tick_of("2026-03-02T06:30:00") == 3600
    assert tick_of("2026-03-03 06:00") == 2 * 86_400
    assert tick_of("2026-03-02 06:00:05") == 10  # YAML takes it for a date, and it stays text
    assert tick_of("0.5 h") == 3600


def test_failures_have_a_rate_or_a_mean_time_between_them(tmp_path: Path) -> None:
    for setting in ("mtbf: 8 h", "mtbf: 57600", "failure_probability: 0.125/h"):
        faults = resolved(tmp_path, "list: [{robot: 1, at: 9}]", setting).scenario.faults
        assert faults.probability == pytest.approx(1 / 57_600, rel=1e-15)
    said = complaint(tmp_path, "at: 9}]", "at: 9}], mtbf: 8 h, failure_probability: 0.1")
    assert "mtbf and failure_probability are alternatives; set one of them" in said
    said = complaint(tmp_path, "at: 9}]", "at: 9}], failure_probability: 3 /s")
    assert "'3 /s' is 1.5; allowed is from 0 to 1" in said


def test_batteries_drain_and_charge_by_percent_in_a_time(tmp_path: Path) -> None:
    battery = (
        "battery: {drain: {move: 36 %/h, wait: 0.0005}, charge_rate: [[0, 2 %/min], [80, 0.5]]}"
    )
    run = resolved(tmp_path, "", battery + "\n").scenario.battery
    assert run is not None
    assert (run.drain.move, run.drain.wait) == (0.005, 0.0005)
    assert run.charge_rate == ((0, 1 / 60), (80, 0.5))


def test_texts_in_lists_are_read_in_one_pass(tmp_path: Path) -> None:
    faults = ", ".join(f"{{robot: 0, at: {k} s}}" for k in range(1, 5001))
    listed = resolved(tmp_path, "{robot: 1, at: 9}", faults).scenario.faults.listed
    assert [fault.at for fault in listed] == list(range(2, 10_001, 2))


def test_the_reader_of_a_file_of_orders_takes_times_and_clock_times(tmp_path: Path) -> None:
    (tmp_path / "orders.csv").write_text(
        "released;from_x;from_y;to_x;to_y\n12;0;0;4;0\n20 s;4;0;0;0\n06:30;0;0;4;0\n"
    )
    floor = 'layout: {picture: "t...t\\n....."}'
    settings = (floor.replace("layout: ", "layout="), "fleet.start=[[1, 0], [2, 0]]")
    setting = "transports: {file: orders.csv}"
    with pytest.raises(InputError) as caught:
        resolved(tmp_path, "generator: full-shelves", setting, *settings, "units.clock=null")
    assert "orders.csv:4: released '06:30' is a clock time" in str(caught.value)
    run = resolved(tmp_path, "generator: full-shelves", setting, *settings)
    assert [line.release for line in run.scenario.orders.listed or ()] == [12, 40, 3600]


class OwnParameters(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """Parameters of a plug-in."""

    patience: Annotated[int, quantity(TIME, ge=1)] = 5
    limits: dict[str, Annotated[float, quantity(SECONDS)]] = {}


def test_parameters_of_a_plug_in_take_texts_too() -> None:
    given = {"patience": "10 s", "limits": {"east": "2 min", "west": 3.5}}
    numbers, conversions = with_numbers(given, OwnParameters, HALF_SECONDS)
    assert numbers == {"patience": 20, "limits": {"east": 120.0, "west": 3.5}}
    assert [one.key for one in conversions] == ["patience", "limits.east"]


def test_editors_know_the_texts_from_the_schema(tmp_path: Path) -> None:
    validator = jsonschema.Draft202012Validator(json_schema())
    data = yaml.safe_load(SCENARIO)
    validator.validate(data)
    for setting in (
        {"durations": {"move": "1.5 m/s", "pick": 3}},
        {"information": {"radius": "3 m"}},
        {"orders": {"list": [{"from": [0, 0], "to": [1, 0], "release": "06:30"}]}},
        {"strategy": {"right_of_way": {"name": "wait", "wait_empty": ["1 s", 5]}}},
        {"battery": {"drain": {"move": "9 %/h"}, "charge_rate": [[0, "2 %/min"]]}},
    ):
        validator.validate(data | setting)
    assert not validator.is_valid(data | {"durations": {"pick": "soon"}})
    assert not validator.is_valid(data | {"fleet": {"robots": "5 s"}})
