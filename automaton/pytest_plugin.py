"""The pytest fixture `grid_snapshot`: compare pictures of the grid with golden files.

    pytest_plugins = ["automaton.pytest_plugin"]  # in conftest.py: loaded only on request

    def test_my_floor(grid_snapshot):
        simulation = Simulation(resolve("my-floor.yaml"))
        simulation.run(until=40)
        grid_snapshot(simulation)

Golden files lie beside the test, in snapshots/<test module>/<test>[-name].txt. `pytest --update-grids`
writes them, and removes those that a passing test no longer compares. NumPy and Numba are imported only
to draw a world.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import re
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

from automaton.atomic_write import replacing

OPTION = "--update-grids"
LONGEST_NAME = 120  # characters of the name of a golden file
ALLOWED = re.compile(r"[^\w\[\].,+= -]")  # not allowed in file names on some systems
WRITTEN = pytest.StashKey[list[str]]()
COMPARED_GOLDENS = pytest.StashKey[set[Path]]()
GridSnapshot = Callable[..., None]


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("automaton")
    group.addoption(
        OPTION,
        action="store_true",
        default=False,
        dest="update_grids",
        help="rewrite the golden pictures of grid_snapshot, remove stale ones",
    )


@pytest.fixture
def grid_snapshot(request: pytest.FixtureRequest) -> GridSnapshot:
    """Compare a picture with its golden file: `grid_snapshot(simulation_or_text, name=None)`.

    Takes a text, or draws a Simulation, a World with its plan, or a FloorPlan. A test with more than one
    picture must name them.
    """
    item: pytest.Item = request.node
    compared = item.stash.setdefault(COMPARED_GOLDENS, set())
    update = bool(request.config.getoption("update_grids"))

    def compare(subject: Any, name: str | None = None) -> None:
        __tracebackhide__ = True
        golden = golden_path(item, name)
        if golden in compared:
            pytest.fail(f"{golden.name} is compared twice in one test: give each picture a name")
        compared.add(golden)
        text = text_of(subject)
        if update:
            if rewrite(golden, text):
                item.stash.setdefault(WRITTEN, []).append(shown(golden, item))
            return
        check(golden, text, shown(golden, item))

    return compare


def text_of(subject: Any) -> str:
    """The picture of a subject, as in a golden file: no trailing blanks, one newline at the end."""
    if not isinstance(subject, str):
        from automaton.runs import pictures  # imported late: other sessions do not need it

        subject = pictures.drawn(subject)
    return "\n".join(line.rstrip() for line in subject.splitlines()).strip("\n") + "\n"


def golden_path(item: pytest.Item, name: str | None = None) -> Path:
    """The path of the golden file of a test; tests of a class are named Class.test."""
    base = file_name(".".join(item.nodeid.split("::")[1:]))
    part = "" if name is None else f"-{file_name(name)}"
    return folder_of(item) / f"{base}{part}.txt"


def folder_of(item: pytest.Item) -> Path:
    return item.path.parent / "snapshots" / item.path.stem


def file_name(text: str) -> str:
    """A name for every file system; a changed name gets a hash to stay unique."""
    name = ALLOWED.sub("_", text)[:LONGEST_NAME]
    if name == text:
        return name
    return f"{name}~{hashlib.blake2b(text.encode(), digest_size=4).hexdigest()}"


def shown(golden: Path, item: pytest.Item) -> str:
    """The path of a golden file, relative to the root folder."""
    return Path(os.path.relpath(golden, item.config.rootpath)).as_posix()


def rewrite(golden: Path, text: str) -> bool:
    """Write a golden file atomically if it differs. Returns whether it was written."""
    if golden.is_file() and golden.read_text(encoding="utf-8") == text:
        return False
    golden.parent.mkdir(parents=True, exist_ok=True)
    with replacing(golden, golden.with_name(f"{golden.name}.{os.getpid()}.part")) as file:
        file.write(text.encode())
    return True


def check(golden: Path, text: str, path: str) -> None:
    """Fail the test unless the golden file exists and is equal."""
    __tracebackhide__ = True
    if not golden.is_file():
        pytest.fail(
            f"there is no golden {path}; if this picture is right, "
            f"pytest {OPTION} writes it:\n\n{text}",
            pytrace=False,
        )
    wanted = golden.read_text(encoding="utf-8")
    if wanted != text:
        pytest.fail(
            f"the picture differs from {path} "
            f"(if it is right now, pytest {OPTION} rewrites the golden):\n\n"
            + difference(wanted, text),
            pytrace=False,
        )


def difference(wanted: str, text: str) -> str:
    """The rows that differ (- golden, + now), with carets below changed characters."""
    rows = list(
        difflib.unified_diff(wanted.splitlines(), text.splitlines(), "golden", "now", lineterm="")
    )
    out: list[str] = []
    while rows:
        removed = _leading(rows, "-")
        added = _leading(rows, "+")
        if removed and len(removed) == len(added):
            for old, new in zip(removed, added, strict=True):
                out += [old, new, *_carets(old, new)]
        else:
            out += removed + added
        if rows and rows[0][0] not in "-+":
            out.append(rows.pop(0))
    return "\n".join(out)


def _leading(rows: list[str], sign: str) -> list[str]:
    taken: list[str] = []
    while rows and rows[0].startswith(sign):
        taken.append(rows.pop(0))
    return taken


def _carets(old: str, new: str) -> list[str]:
    if old.startswith("---") or len(old) != len(new):
        return []
    marks = "".join("^" if a != b else " " for a, b in zip(old[1:], new[1:], strict=True))
    return [f" {marks.rstrip()}"] if marks.strip() else []


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Report the state of golden files in the test report, which pytest-xdist transfers."""
    report = yield
    if report.when == "call":
        stale = list(_stale(item)) if report.passed else []
        vars(report).update(grids_written=item.stash.get(WRITTEN, []), grids_stale=stale)
    return report


def _stale(item: pytest.Item) -> Iterator[str]:
    """Golden files that a passed test did not compare; removed under the option."""
    compared = item.stash.get(COMPARED_GOLDENS, set())
    base = golden_path(item).stem
    for golden in _goldens(folder_of(item)):
        mine = golden.stem == base or golden.stem.startswith(f"{base}-")
        if mine and golden not in compared:
            if item.config.getoption("update_grids"):
                golden.unlink(missing_ok=True)
            yield shown(golden, item)


def _goldens(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.txt")) if folder.is_dir() else []


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """List the golden files that were written, removed, or are stale."""
    reports = [r for group in terminalreporter.stats.values() for r in group]
    written = sorted({path for r in reports for path in getattr(r, "grids_written", ())})
    stale = sorted({path for r in reports for path in getattr(r, "grids_stale", ())})
    if not written and not stale:
        return
    terminalreporter.section("grid snapshots")
    for path in written:
        terminalreporter.write_line(f"written  {path}")
    word = "removed " if config.getoption("update_grids") else "stale   "
    for path in stale:
        terminalreporter.write_line(f"{word} {path}")
    if stale and not config.getoption("update_grids"):
        terminalreporter.write_line(f"no passing test compares these; {OPTION} removes them")
