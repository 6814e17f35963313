"""Files that were good once: every mutation is taken, or refused with its place and a reason.

The same mutations every time. The suite does 150; AUTOMATON_MUTATIONS=1000 does more.
"""

from __future__ import annotations

import os
import random
import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml

from automaton.commands import main
from automaton.scenario.text_files import shipped
from automaton.studies.sweeps.study import shipped_studies

COUNT = int(os.environ.get("AUTOMATON_MUTATIONS", "150"))
SCENARIOS = ("crossing", "tabletop-mini", "tabletop-1", "depots", "depots-line", "factory")
STUDIES = ("tabletop-fleet", "depots-fleet")
OF_STREAMS = """name: streams
layout:
  picture: |
    t...t
    ..#..
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
orders: {generator: stations, count: 9, arrivals: {bursts: {size: {mean: 2}, every: 40}}}
strategy: {allocation: first-come, right_of_way: {name: wait}}
durations: {move: 1, pick: 2, drop: 2}
stop: {when: delivered, max_duration: 500}
"""
OF_PARTS = OF_STREAMS.replace(
    "generator: stations, count: 9, arrivals: {bursts: {size: {mean: 2}, every: 40}}",
    "parts: [{route: [1, 2], count: 3, interarrival_time: 9}, {route: [2]}], processing_time: "
    "[{mean: 20}, 5]",
)
FROM_FILE = re.sub("orders: .*", "orders: {transports: {file: orders.csv}}", OF_STREAMS)
WITH_UNITS = """name: units
layout:
  picture: |
    t...t
    ..#..
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
units: {tick: 0.5 s, cell: 0.8 m, clock: "2026-03-02 06:00"}
orders: {list: [{from: [0, 0], to: [4, 0], release: "06:01"}, {from: [4, 0], to: [0, 0], release: 20 s}]}
strategy: {allocation: first-come, right_of_way: {name: wait, wait_empty: [1 s, 3 s]}}
durations: {move: 1.5 m/s, turn: 90 deg/s, pick: 00:00:03, drop: 2500 ms}
battery: {drain: {move: 90 %/h, wait: 9 %/h}, charge_rate: [[0, 2 %/min], [80, 1 %/min]]}
faults: {mtbf: 400 h, repair_time: 2 h, list: [{robot: 0, at: "06:10"}]}
information: {radius: 3 m}
stop: {when: delivered, max_duration: 1 h}
"""
CSV = "released,from_x,from_y,to_x,to_y\n30,0,0,4,0\n3,4,0,0,0\n"
HOSTILE = (
    *(0, -1, 1, 2**31, 2**63, 2**64, 1.5, -0.0, 1e308, True, None, "", " ", "none", "..", "a: b"),
    *(
        [],
        {},
        [[]],
        {"name": "x"},
        [1, 2],
        [[0, 0]],
        {"mean": 0},
        "os:system",
        "ü\u200b",
        "9" * 400,
        *(
            "-3 s",
            "1,5 s",
            "1e99 h",
            "1e-99 s",
            "00:10",
            "9:99:99",
            "0 m/s",
            "5 /0",
            "31.2.26",
            "1e9 d",
        ),
    ),
)
JUNK = b"\x00\t{}[]:#&*!|>'\"%@`,-\xff\xc3 \n0e"


def originals() -> list[str]:
    files = [shipped()[name] for name in SCENARIOS] + [shipped_studies()[name] for name in STUDIES]
    return [*(path.read_text() for path in files), OF_STREAMS, OF_PARTS, FROM_FILE, WITH_UNITS]


def broken_bytes(text: str, chance: random.Random) -> bytes:
    """Some bytes replaced, left out, put in, or repeated."""
    data = bytearray(text.encode())
    for _ in range(chance.choice((1, 1, 2, 8))):
        at = chance.randrange(len(data))
        until = min(len(data), at + chance.choice((1, 1, 3, 20)))
        how = chance.randrange(4)
        if how == 0:
            data[at] = chance.choice(JUNK)
        elif how == 1:
            del data[at:until]
        elif how == 2:
            data[at:at] = bytes(chance.choice(JUNK) for _ in range(3))
        else:
            data[at:at] = data[at:until]
    return bytes(data) or b"#"


def places(value: Any) -> list[tuple[Any, Any]]:
    """(container, key) of everything in a tree."""
    items: Any = ()
    if isinstance(value, dict):
        items = list(value.items())
    elif isinstance(value, list):
        items = list(enumerate(value))
    return [place for key, inner in items for place in [(value, key), *places(inner)]]


def broken_tree(text: str, chance: random.Random) -> bytes:
    """A branch replaced, left out, renamed, put elsewhere or made a list."""
    data = yaml.safe_load(text)
    found = places(data)
    holder, key = chance.choice(found)
    how = chance.randrange(5)
    if how == 0:
        holder[key] = chance.choice(HOSTILE)
    elif how == 1:
        del holder[key]
    elif how == 2 and isinstance(holder, dict):
        holder[str(key) + chance.choice(("s", "x", " ", "_"))] = holder.pop(key)
    elif how == 3:
        other, there = chance.choice(found)
        holder[key] = yaml.safe_load(yaml.safe_dump(other[there]))
    else:
        holder[key] = [holder[key], holder[key]]
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True).encode()


def broken_value(text: str, chance: random.Random) -> bytes:
    """A number in the text replaced by another one, or by something else."""
    numbers = list(re.finditer(r"\b[0-9]+(\.[0-9]+)?\b", text))
    match = chance.choice(numbers)
    return f"{text[: match.start()]}{chance.choice(HOSTILE)}{text[match.end() :]}".encode()


KINDS = (broken_bytes, broken_tree, broken_value)


def test_mutated_files_are_refused_with_place_and_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    codes: Counter[int] = Counter()
    texts = originals()
    csv, path = tmp_path / "orders.csv", tmp_path / "file.yaml"
    for number in range(COUNT):
        chance = random.Random(f"mutation {number}")
        text = chance.choice(texts)
        csv.write_text(CSV)
        path.write_bytes(text.encode())
        if text is FROM_FILE and chance.random() < 0.7:
            csv.write_bytes(broken_bytes(CSV, chance))
        else:
            path.write_bytes(KINDS[number % len(KINDS)](text, chance))
        code = main(["check", str(path)])
        said = capsys.readouterr().err
        codes[code] += 1
        assert code in (0, 2), f"mutation {number}: {said}"
        assert "Traceback" not in said, f"mutation {number}: {said}"
        if code == 2:
            place = r"automaton: \S+\.(yaml|csv)(:\d+)?: ."  # a study's may be in its scenario
            assert re.match(place, said) and said.count("\n") == 1, f"mutation {number}: {said}"
    assert codes[2] >= COUNT / 2, codes
