"""Mutants of all files that the program reads: what becomes of them within bounds of time and memory.

A case is a folder of good files, and the commands that read it. In a mutant one of the files is
altered: as bytes, as text, as the tree of values that it is, or as the members of its archive. Then
each command ends in one sentence with exit code 2, or does what it is for; what `check` accepts, `run`
begins.

    python tests/proofs/mutated_files.py [--count 10000] [--seed 1] [--only CASE]
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import random
import re
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml
from docs_pages import pages
from lif_layouts import LAYOUTS

from automaton.commands import main
from automaton.scenario.text_files import SHIPPED_FOLDER, shipped
from automaton.studies.sweeps.study import shipped_studies

TICKS: Final = "100"  # of a run, to see that it begins
SLOW: Final = ("warehouse-100", "warehouse-100-trial", "goods-60x40", "goods-to-person")
SLOW_WEIGHT: Final = 0.1  # how often one of them is drawn, for each time that another one is

Chance = random.Random
Command = tuple[str, ...]
Files = dict[str, bytes]

NUMBERS: Final = (
    *(0, -1, 1, 2, 3, 7, 255, 2**15, 2**31 - 1, 2**31, 2**63, 2**64, -(2**31), 10**40),
    *(0.5, 1.5, -0.0, 1e-9, 1e308, float("inf"), float("nan")),
)
OTHERS: Final = (
    *(None, True, False, "", " ", "none", "..", "a: b", "os:system", "ü\u200b", "\x1b[2J\u202e"),
    *("9" * 400, "x" * 5000, "=1+1", "<script>", "2026-03-02 06:00", "-3 s", "1,5 s", "1e99 h"),
    *("9:99:99", "0 m/s", "5 /0", "31.2.26", "/dev/null", "."),
    *(
        [],
        {},
        [[]],
        {"name": "x"},
        [1, 2],
        [[0, 0]],
        {"mean": 0},
        {"mean": 3},
        {"from": 1, "to": 3},
    ),
)
JUNK: Final = b"\x00\t{}[]:#&*!|>'\"%@`,;-\xff\xc3 \n\r0eE9.<"


class Case(NamedTuple):
    """Good files, which of them are altered, and what reads them."""

    name: str
    files: Files
    altered: tuple[str, ...]
    commands: tuple[Command, ...]  # each one only if those before it accept what they read
    weight: float = 1.0


# Cases


@functools.cache
def cases() -> dict[str, Case]:
    """Return all cases by their names."""
    made = [*scenario_cases(), *page_cases(), *study_cases(), *exchange_cases(), *table_cases()]
    return {case.name: case for case in made}


def scenario_cases() -> Iterator[Case]:
    for name, path in shipped().items():
        files = {"a.yaml": path.read_bytes()}
        for other in re.findall(r"[\w-]+\.txt", path.read_text(encoding="utf-8")):
            files[other] = (SHIPPED_FOLDER / other).read_bytes()
        weight = SLOW_WEIGHT if name in SLOW else 3.0
        yield Case(f"scenario {name}", files, tuple(files), checked_and_run("a.yaml"), weight)


def checked_and_run(file: str) -> tuple[Command, ...]:
    return (("check", file), ("run", file, "--until", TICKS))


def page_cases() -> Iterator[Case]:
    """The files that pages of the documentation give: scenarios with their tables, and studies."""
    for page in pages():
        files = {block.title: block.text.encode() for block in page.blocks if block.title}
        for name, content in files.items():
            if not name.endswith(".yaml"):
                continue
            is_scenario = re.search(rb"^layout:", content, re.MULTILINE)
            is_study = re.search(rb"^scenario:", content, re.MULTILINE)
            if is_scenario or is_study:
                named = [other for other in files if other.encode() in content]
                commands = checked_and_run(name) if is_scenario else (("check", name),)
                page_name = Path(page.name).stem
                yield Case(f"{page_name} {name}", files, (name, *named), commands, 1.0)


def study_cases() -> Iterator[Case]:
    for name, path in shipped_studies().items():
        yield Case(
            f"study {name}", {"a.yaml": path.read_bytes()}, ("a.yaml",), (("check", "a.yaml"),)
        )


MAP: Final = "type octile\nheight 3\nwidth 4\nmap\n.G@.\nSE.@\nTOW.\n"
PROBLEM: Final = {
    "mapFile": "a.map",
    "agentFile": "a.agents",
    "taskFile": "a.tasks",
    "teamSize": 2,
    "numTasksReveal": 1.5,
    "version": "2024 LoRR",
}
LEAGUE: Final = {
    "a.map": MAP,
    "a.agents": "# of two robots\n2\n0\n5\n",
    "a.tasks": "# tasks\n3\n1,4\n5\n0,1,4,5\n",
    "problem.json": json.dumps(PROBLEM),
}
FOLDER: Final = {
    "map.txt": "type octile\nheight 2\nwidth 3\nmap\n..@\nGST\n",
    "agents_0.csv": "agent id,row,col\n0,0,1\n1,1,0\n",
    "tasks_one.csv": "targets\n0\n4\n",
}
# Of the problem above: what another program could have answered.
OUTPUT: Final = {
    "actionModel": "MAPF_T",
    "version": "2024 LoRR",
    "AllValid": "Yes",
    "teamSize": 2,
    "start": [[0, 0, "E"], [1, 1, "E"]],
    "numTaskFinished": 0,
    "sumOfCost": 4,
    "makespan": 2,
    "actualPaths": ["W,W", "W,W"],
    "plannerPaths": ["W,W", "W,W"],
    "plannerTimes": [0.1, 0.1],
    "errors": [],
    "actualSchedule": ["0:0", "0:1"],
    "plannerSchedule": ["0:0", "0:1"],
    "scheduleErrors": [],
    "events": [],
    "tasks": [[0, 0, [0, 1, 1, 0]], [1, 0, [1, 1]], [2, 0, [0, 0, 0, 1, 1, 0, 1, 1]]],
}


def exchange_cases() -> Iterator[Case]:
    """Layouts, maps and problems of other programs."""
    imported = (("import", "SOURCE", "--out", "o.yaml", "--force"), *checked_and_run("o.yaml"))

    def case(source: str, files: Files, *options: str) -> Case:
        first, *rest = imported
        command = tuple(source if word == "SOURCE" else word for word in first) + options
        return Case(f"import {source}", files, tuple(files), (command, *rest), 2.0)

    graph = {"layout": ["w.e", ".@."], "n_row": 2, "n_col": 3, "weights": [0.5, 2.0] * 4}
    yield case("graph.json", {"graph.json": json.dumps(graph).encode()})
    for name in ("site-1.lif", "site-2.lif", "site-opentcs.xml"):
        yield case(name, {name: (LAYOUTS / name).read_bytes()})
    league = {name: text.encode() for name, text in LEAGUE.items()}
    yield case("problem.json", league)
    yield case("a.map", {"a.map": MAP.encode()}, "--robots", "2")
    scen = "version 1\n0\ta.map\t4\t3\t0\t0\t1\t1\t2.0\n1\ta.map\t4\t3\t1\t1\t0\t1\t2\n"
    yield case("a.scen", {"a.map": MAP.encode(), "a.scen": scen.encode()})
    tables = {f"problem/{name}": text.encode() for name, text in FOLDER.items()}
    yield case("problem", tables)
    hall = {name: (LAYOUTS / name).read_bytes() for name in ("hall.yaml", "hall.pgm")}
    yield case("hall.yaml", hall, "--cell", "0.5m", "--robots", "2")
    output = league | {"output.json": json.dumps(OUTPUT).encode()}
    command = ("verify", "output.json", "--problem", "problem.json")
    yield Case("output.json", output, ("output.json",), (command,), 2.0)


SHIFT: Final = """\
name: shift
units: {tick: 0.5 s, clock: "2026-03-02 06:00"}
layout:
  picture: |
    >>>>>>>>>v
    ^#q##q#p#v
    ^########v
    ^<<<<t<<<<
fleet: {robots: 1, kinematics: differential, start: {file: starts.csv}}
durations: {move: 1, pick: 30, drop: 3 s, handling: {line: {empirical: times.csv, column: took}}}
pods: {file: pods.csv}
stations: {P1: {at: [5, 3], queue: [[6, 3], [8, 3]]}}
orders: {lines: {file: LINES, columns: {released: T, pod: LOCATION, due: CUTOFF}}}
strategy: {allocation: first-come, routing: shortest, right_of_way: wait}
stop: {when: delivered, max_duration: 1000}
"""
TOURS: Final = """\
name: tours
layout: {matrix: floor.csv}
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
orders: {tasks: floor.tasks}
strategy: {allocation: greedy}
"""
TRANSPORTS: Final = """\
name: from-file
layout: {file: floor.txt}
fleet: {robots: 1, kinematics: omni, start: [[2, 0]]}
locations: places.csv
orders: {transports: {file: orders.csv}}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: delivered, max_duration: 500}
"""
OF_SHIFT: Final = {
    "starts.csv": "x,y,heading\n1,0,east\n",
    "times.csv": "who;took\na;5\nb;7 s\nc;00:00:09\nd;5\n",
    "pods.csv": "x;y;bay\n2;1;7\n5;1;8\n7;1;9\n",
}
LINES: Final = (
    ("T", "LOCATION", "CUTOFF"),
    ("06:00:01", 1, "06:10"),
    (7, 2, ""),
    ("2026-03-02 06:00:30", 3, "2 h"),
)


def table_cases() -> Iterator[Case]:
    """Scenarios with tables of orders, pods, starts, durations and locations, and a workbook."""
    common = {name: text.encode() for name, text in OF_SHIFT.items()}
    lines = "\n".join(";".join(map(str, row)) for row in LINES).encode()
    for file, content in (("lines.csv", lines), ("lines.xlsx", workbook())):
        files = common | {"a.yaml": SHIFT.replace("LINES", file).encode(), file: content}
        yield Case(f"tables {file}", files, (*common, file, file), checked_and_run("a.yaml"), 6.0)
    orders = "released,from,to_x,to_y\n30,in,4,0\n3,4/0,0,0\n"
    files = {
        "a.yaml": TRANSPORTS,
        "floor.txt": "t...t\n..#..\n",
        "places.csv": "name,x,y\nin,0,0\n4/0,4,0\n",
        "orders.csv": orders,
    }
    of_transports = {name: text.encode() for name, text in files.items()}
    yield Case("tables orders.csv", of_transports, tuple(files), checked_and_run("a.yaml"), 4.0)


def workbook() -> bytes:
    import openpyxl

    book = openpyxl.Workbook()
    for row in LINES:
        book.active.append(row)
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()


# Mutations


def mutant(case: Case, chance: Chance) -> Files:
    """Return the files of a case with one of them altered."""
    files = dict(case.files)
    name = chance.choice(case.altered)
    content = files[name]
    for _ in range(chance.choice((1, 1, 1, 1, 2, 4))):
        content = chance.choice(alterations(name))(content, chance)
    return files | {name: content or b"#"}


def alterations(name: str) -> tuple[Callable[[bytes, Chance], bytes], ...]:
    """Return the ways to alter a file of that name."""
    suffix = Path(name).suffix
    if suffix in (".yaml", ".json", ".lif"):
        return (altered_tree, altered_tree, altered_tree, altered_tree, altered_text, altered_bytes)
    if suffix == ".xlsx":
        return (altered_archive, altered_archive, altered_archive, altered_bytes)
    return (altered_text, altered_text, altered_cells, altered_cells, altered_bytes)


def altered_bytes(content: bytes, chance: Chance) -> bytes:
    """Some bytes replaced, left out, put in, repeated, or the end gone."""
    data = bytearray(content or b"\n")
    for _ in range(chance.choice((1, 1, 2, 8))):
        at = chance.randrange(len(data) + 1)
        until = at + chance.choice((1, 1, 3, 20, 300))
        how = chance.randrange(6)
        if how == 0:
            data[at : at + 1] = bytes([chance.choice(JUNK)])
        elif how == 1:
            del data[at:until]
        elif how == 2:
            data[at:at] = bytes(chance.choice(JUNK) for _ in range(3))
        elif how == 3:
            data[at:at] = data[at:until]
        elif how == 4 and at < len(data):
            data[at] ^= 1 << chance.randrange(8)
        elif chance.random() < 0.2:
            del data[at:]
    return bytes(data)


def altered_text(content: bytes, chance: Chance) -> bytes:
    """A number or a word replaced; a line left out, repeated, or in another's place."""
    text = content.decode("utf-8", "replace")
    spots = list(re.finditer(r"-?\b\d+(\.\d+)?\b|[\w-]{2,}", text))
    if spots and chance.random() < 0.6:
        spot = chance.choice(spots)
        return f"{text[: spot.start()]}{value(spot[0], chance)}{text[spot.end() :]}".encode(
            "utf-8", "replace"
        )
    lines = text.splitlines(keepends=True) or [""]
    one, other = chance.randrange(len(lines)), chance.randrange(len(lines))
    how = chance.randrange(3)
    if how == 0:
        del lines[one]
    elif how == 1:
        lines.insert(other, lines[one])
    else:
        lines[one], lines[other] = lines[other], lines[one]
    return "".join(lines).encode("utf-8", "replace")


def altered_cells(content: bytes, chance: Chance) -> bytes:
    """A symbol of a picture or a cell of a table replaced by another of the file, or by junk."""
    text = content.decode("utf-8", "replace")
    parts = re.split(r"([,;\t\n])", text) if re.search(r"[,;\t]", text) else list(text)
    if not parts:
        return content
    here, there = chance.randrange(len(parts)), chance.randrange(len(parts))
    parts[here] = parts[there] if chance.random() < 0.7 else str(value(parts[here], chance))
    return "".join(parts).encode("utf-8", "replace")


def value(before: Any, chance: Chance) -> Any:
    """Something else in the place of a value: often one that is like it."""
    if isinstance(before, str) and re.fullmatch(r"-?\d+", before) and len(before) < 18:
        before = int(before)
    if isinstance(before, int | float) and not isinstance(before, bool) and chance.random() < 0.6:
        return chance.choice((before + 1, before - 1, -before, before * 2, before * 1000))
    return chance.choice(NUMBERS) if chance.random() < 0.4 else chance.choice(OTHERS)


def altered_tree(content: bytes, chance: Chance) -> bytes:
    """A branch replaced, left out, renamed, repeated, moved, or that of another file."""
    text = content.decode("utf-8", "replace")
    is_json = text.lstrip().startswith("{")
    try:
        data = json.loads(text) if is_json else yaml.safe_load(text)
        spots = list(places(data))
    except (ValueError, RecursionError, yaml.YAMLError):
        return altered_bytes(content, chance)
    if not spots:
        return altered_bytes(content, chance)
    holder, key = chance.choice(spots)
    if chance.random() < 0.3:  # as often a section as a number
        holder, key = (
            data,
            chance.choice(list(data) if isinstance(data, dict) else range(len(data))),
        )
    _alter(data, holder, key, spots, chance)
    try:
        if is_json:
            return json.dumps(data).encode("utf-8", "replace")
        return yaml.safe_dump(data, sort_keys=False, allow_unicode=True).encode("utf-8", "replace")
    except (ValueError, RecursionError):  # a value that holds itself
        return content


def _alter(data: Any, holder: Any, key: Any, spots: list[tuple[Any, Any]], chance: Chance) -> None:
    how = chance.randrange(10)
    if how < 3:
        holder[key] = value(holder[key], chance)
    elif how == 3:
        del holder[key]
    elif how == 4 and isinstance(holder, dict):
        holder[f"{key}{chance.choice(('s', 'x', ' ', '_'))}"] = holder.pop(key)
    elif how == 5:
        other, there = chance.choice(spots)
        holder[key] = _copied(other.get(there) if isinstance(other, dict) else other[there])
    elif how == 6:
        holder[key] = [holder[key], holder[key]]
    elif how == 7 and isinstance(data, dict):  # a section that the file may not have
        section = chance.choice(sorted(vocabulary()))
        if re.match(r"[a-z_]+$", section):
            data[section] = _copied(chance.choice(vocabulary()[section]))
    elif isinstance(key, str) and key in vocabulary():
        holder[key] = _copied(chance.choice(vocabulary()[key]))
    else:
        holder[key] = value(holder[key], chance)


def _copied(data: Any) -> Any:
    return yaml.safe_load(yaml.safe_dump(data))


def places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Yield (container, key) of everything in a tree."""
    items: Any = ()
    if isinstance(data, dict):
        items = list(data.items())
    elif isinstance(data, list):
        items = list(enumerate(data))
    for key, inner in items:
        yield data, key
        yield from places(inner)


@functools.cache
def vocabulary() -> dict[str, list[Any]]:
    """Return what scenarios and studies have under each key, wherever it stands."""
    words: dict[str, list[Any]] = {}
    for case in cases().values():
        for name, content in case.files.items():
            if not name.endswith(".yaml"):
                continue
            for holder, key in places(yaml.safe_load(content)):
                if isinstance(holder, dict) and isinstance(key, str):
                    words.setdefault(key, []).append(holder[key])
    return words


def altered_archive(content: bytes, chance: Chance) -> bytes:
    """A member of an archive altered, left out or renamed; the archive itself is whole."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:  # it has been altered before
        return altered_bytes(content, chance)
    sheets = [name for name in members if "sheet1" in name or "styles" in name] or list(members)
    name = chance.choice(sheets if chance.random() < 0.7 else list(members))
    how = chance.random()
    if how < 0.85:
        alter = chance.choice((altered_text, altered_text, altered_bytes))
        members[name] = alter(members[name], chance)
    elif how < 0.95:
        del members[name]
    else:
        members[f"{name}x"] = members.pop(name)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, data in members.items():
            archive.writestr(member, data)
    return out.getvalue()


# What becomes of them


def draw(number: int, seed: int, only: str = "") -> tuple[Case, Files]:
    """Return a case, and its files with one altered; the same numbers give the same."""
    chance = random.Random(f"{seed} {number}")
    drawn = [case for name, case in cases().items() if only in name]
    case = chance.choices(drawn, [one.weight for one in drawn])[0]
    return case, mutant(case, chance)


def outcome(case: Case, files: Files) -> str:
    """Carry out the commands of a case in an empty folder; return "accepted" or "refused".

    Anything else that is returned must not be: it says what is wrong.
    """
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for name, content in files.items():
            Path(name).parent.mkdir(exist_ok=True)
            Path(name).write_bytes(content)
        for number, command in enumerate(case.commands):
            code, said = carried_out(command)
            wrong = complaint(command, code, said, is_first=number == 0)
            if wrong:
                return wrong
            if code == 2 or (code == 1 and command[0] != "run"):
                return "refused"
    return "accepted"


def carried_out(command: Command) -> tuple[int, str]:
    """Run a command in this process; return its exit code and what is on standard error."""
    errors = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
        code = main([*command, "--debug"])
    return code, errors.getvalue()


def complaint(command: Command, code: int, said: str, is_first: bool) -> str:
    """Return what is wrong with the end of a command, or ""."""
    name = " ".join(command[:1])
    if "internal error" in said:
        where = re.findall(r'File "[^"]*?([^"/]+)", line (\d+)', said)[-1:]
        return f"{name}: {last_line(said)} {where}"
    if code not in (0, 1, 2):
        return f"{name}: exit code {code}"
    if code == 2 and not is_first:
        return f"{name} refuses what was accepted: {last_line(said)}"
    sentences = [line for line in said.splitlines() if line.startswith("automaton: ")]
    if code == 2 and not sentences:
        return f"{name}: no sentence"
    return ""


def last_line(said: str) -> str:
    lines = [line for line in said.splitlines() if line.startswith("automaton: ")]
    return (lines or [said])[-1][:300]
