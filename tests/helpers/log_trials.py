"""Whether hostile logs do harm, and what large ones cost: long trials, run by hand.

    python tests/helpers/log_trials.py mutated [LOGS [FIRST]]
    python tests/helpers/log_trials.py large

`mutated`: exported messages, as JSON of both versions and as CSV, are altered in values, types, units,
lines and bytes, and read by `automaton log`. Each must end with an observed run that can be verified, or
with one sentence and without a file. `large`: 108,030 messages of goods-60x40, and the same repeated to
1 GB, are read by processes of their own; prints CPU seconds and memory.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import random
import subprocess
import sys
import tempfile
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

from disturbed_logs import disturbed
from handmade_recordings import recorded

from automaton.commands import main
from automaton.exports.vda5050_export import VERSIONS, write_trace

LOGS = 1000
GIGABYTE = 1_000_000_000
FLOOR = ("--floor", "goods-mini", "--set", "units={tick: 0.5 s, cell: 1 m}")
VALUES = (
    *(
        None,
        True,
        -1,
        0,
        1e308,
        -1e308,
        2**31,
        2**63,
        2**70,
        "",
        "x",
        "NaN",
        [],
        {},
        [[]],
        {"x": {}},
    ),
    *(
        "2026-03-02T06:00:00+25:00",
        "9999-12-31T23:59:59.999Z",
        "0001-01-01T00:00:00Z",
        "\0",
        "a" * 5000,
    ),
)
BYTES = b'\0\n\r{}[]":,-+eE.\\\xff\xc3 0129;\t'


def lines_of_logs() -> list[list[bytes]]:
    """Lines of good logs."""
    run = recorded(
        "goods-mini",
        *(FLOOR[3], "battery={drain: {move: 0.5}, initial_charge: 50, charge_rate: 1}"),
        *("faults={list: [{at: 25, robot: 1}], tow_after: 10, repair_time: 20}",),
        "stop.max_duration=60",
    )
    logs = []
    for version in VERSIONS:
        for on_events in (False, True):
            file = io.BytesIO()
            write_trace(run, file, version=version, on_events=on_events)
            logs.append([line + b"\n" for line in file.getvalue().splitlines()])
    table = io.StringIO()
    rows = csv.writer(table)
    rows.writerow(("robot", "time", "x", "y", "theta", "load", "charge", "state"))
    for line in logs[0]:
        message = json.loads(line)
        at = message.get("mobileRobotPosition", {"x": "", "y": "", "theta": ""})
        load = message["loads"][0]["loadId"] if message["loads"] else ""
        power = message["powerSupply"]["stateOfCharge"]
        place = (at["x"], at["y"], at["theta"])
        rows.writerow((message["serialNumber"], message["timestamp"], *place, load, power, "idle"))
    logs.append([line.encode() + b"\n" for line in table.getvalue().splitlines()])
    return logs


def with_value(line: bytes, draws: random.Random) -> bytes:
    """A line with another value somewhere."""
    try:
        message: Any = json.loads(line)
    except (ValueError, RecursionError):
        cells = line.split(b",")
        cells[draws.randrange(len(cells))] = str(draws.choice(VALUES)).encode()
        return b",".join(cells)
    part = message
    while isinstance(part, dict | list):
        keys = list(part) if isinstance(part, dict) else list(range(len(part)))
        key = draws.choice(keys) if keys else None
        if key is None:
            return line
        if isinstance(part[key], dict | list) and part[key] and draws.random() < 0.7:
            part = part[key]
            continue
        if draws.random() < 0.2:
            del part[key]
        else:
            part[key] = draws.choice(VALUES)
        return json.dumps(message).encode() + b"\n"
    return line


def of_bytes(line: bytes, draws: random.Random) -> bytes:
    """A line with some bytes replaced."""
    out = bytearray(line)
    for _ in range(draws.randint(1, 5)):
        out[draws.randrange(len(out))] = draws.choice(BYTES)
    return bytes(out)


def mutated(lines: list[bytes], draws: random.Random) -> bytes:
    """A log with some of the usual and unusual mistakes."""
    lines = list(lines)
    for _ in range(draws.randint(1, 3)):
        kind = draws.randrange(10)
        at = draws.randrange(len(lines))
        if kind <= 2:
            for _ in range(draws.choice((1, 5, 50))):
                at = draws.randrange(len(lines))
                lines[at] = with_value(lines[at], draws)
        elif kind == 3:
            lines[at] = of_bytes(lines[at], draws)
        elif kind == 4:
            del lines[at : at + draws.choice((1, 20, 500))]
        elif kind == 5:
            lines[at:at] = lines[at : at + draws.choice((1, 20))]
        elif kind == 6:
            draws.shuffle(lines)
        elif kind == 7:
            lines[at] = lines[at][: draws.randrange(len(lines[at]))]
        elif kind == 8:
            lines[at] = draws.choice(
                (b"[" * 100_000, b"{" * 9, b"\0" * 99, b'"', b"\n", b"\xef\xbb\xbf")
            )
        elif lines[0][:1] == b"{":
            with contextlib.suppress(
                ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError
            ):
                lines = list(disturbed(lines, draws.randrange(99)))
        lines = lines or [b"\n"]
    text = b"".join(lines)
    if draws.random() < 0.1:
        text = text[: draws.randrange(len(text) + 1)]
    return text.replace(b'"x": ', b'"x":1000') if draws.random() < 0.05 else text


def outcome(text: bytes, folder: Path) -> str:
    """How `automaton log` and `automaton verify` end; "harm: ..." for anything that is not allowed."""
    log, out = folder / "log", folder / "real.rec"
    log.write_bytes(text)
    said, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(errors):
        code = main(["log", str(log), *FLOOR, "--out", str(out)])
        if code == 0:
            code = main(["verify", str(out)])
            code = code if code == 0 else 99
    words = errors.getvalue().strip()
    there = sorted(path.name for path in folder.iterdir())
    for path in (log, out):
        path.unlink(missing_ok=True)
    if code == 0 and there == ["log", "real.rec"]:
        return "observed"
    if (
        code == 2
        and there == ["log"]
        and words.count("\n") == 0
        and words.startswith("automaton: ")
    ):
        return "refused"
    return f"harm: code {code}, files {there}: {words[:500]}"


def try_mutated(logs: int, first: int) -> int:
    good, counts = lines_of_logs(), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, first + logs):
            draws = random.Random(number)
            ends = outcome(mutated(draws.choice(good), draws), Path(folder))
            counts[ends.partition(":")[0]] += 1
            if ends.startswith("harm"):
                print(f"log {number}: {ends}", flush=True)
    print(", ".join(f"{what} {many:,}" for what, many in counts.items()))
    return 1 if counts["harm"] else 0


READ = """
import sys, time
from pathlib import Path
from automaton.calibration.state_log import read_log
began = time.process_time()
log = read_log([Path(sys.argv[1])])
cpu = time.process_time() - began
memory = int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024
print(f"{log.counts.messages:,} messages: {cpu:.1f} CPU s, {memory:,.0f} MiB")
"""


def try_large() -> int:
    run = recorded("goods-60x40", "stop.max_duration=3600")  # 30 robots, 30 minutes
    file = io.BytesIO()
    write_trace(run, file, every=Fraction(1, 2))
    block = file.getvalue()
    with tempfile.TemporaryDirectory() as folder:
        for least in (1, GIGABYTE):
            log, day = Path(folder, "log.jsonl"), 2
            with log.open("wb") as stream:
                while stream.tell() < least:
                    stream.write(block.replace(b"2026-03-02T", b"2026-03-%02dT" % day))
                    day += 1
            command = [sys.executable, "-c", READ, str(log)]
            said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            print(f"{log.stat().st_size / 1e6:,.0f} MB, {said.strip()}", flush=True)
    return 0


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[2:]]
    if sys.argv[1:2] == ["large"]:
        sys.exit(try_large())
    sys.exit(try_mutated(*[*numbers, *(LOGS, 0)[len(numbers) :]]))
