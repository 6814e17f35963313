"""Promises about compiled code: one signature for each kernel, and a cache that notices edits."""

from __future__ import annotations

import ast
import os
import stat
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from automaton import compiled
from automaton.compiled import KERNEL_SOURCES, jit_is_on
from automaton.numba_parts import TRIED

ROOT = Path(__file__).parent.parent

LISTED = """
import sys
from numba.core.dispatcher import Dispatcher
from automaton.scenario.resolve import resolve
from automaton.simulation import Simulation
from automaton.bench import plans
from automaton.reproductions.traffic_trials import Setting, exact, run_seed
for allocation in ("independent", "cooperative", "adaptive"):
    simulation = Simulation(resolve("tabletop-mini", [f"strategy.allocation={allocation}"]))
    simulation.run()
for routing in ("astar", "traffic-avoidance"):
    simulation = Simulation(resolve("tabletop-mini", [f"strategy.routing={routing}"]))
    simulation.run()
run_seed(Setting(exact), 1)
from automaton.reproductions.auctions import REPRODUCTION
from automaton.reproductions.study import reproduce
reproduce(REPRODUCTION, 1)
import random
from automaton.auctions import assignment, bids, bundle_space, sequential
from tests.auction_scenes import random_auction
for robots, rule in ((2, bids.AVERAGE), (5, bids.AVERAGE_ADDED)):
    *market, items = random_auction(random.Random(robots), robots, 4, policy=1)
    sequential.parallel(*market, items, 4, rule, 500)
    assignment.assign_once(*market, bundle_space.assignment_for(5), items, 4, rule, 500)
plans.prepare_avoidance(30, 1)()
kernels = {
    kernel for name, module in sys.modules.items() if name.startswith(("automaton.", "strategies."))
    for kernel in vars(module).values() if isinstance(kernel, Dispatcher)
}
for kernel in kernels:
    print(kernel.py_func.__name__, len(kernel.signatures), kernel.py_func.__module__)
"""

# What the world has writable is read-only for strategies.
READ_AND_WRITTEN = {"has_room", "first_cell"}


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_every_kernel_is_compiled_for_one_signature() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LISTED], cwd=ROOT, capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in done.stdout.splitlines()]
    assert len(rows) > 60
    several = {name for name, count, _ in rows if int(count) > 1}
    assert several <= READ_AND_WRITTEN


def imports_of(path: Path) -> set[str]:
    tree = ast.parse(path.read_text())
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in names if name.split(".")[0] in ("automaton", "strategies")}


def module_file(name: str) -> Path | None:
    path = ROOT / name.replace(".", "/")
    return path.with_suffix(".py") if path.with_suffix(".py").is_file() else None


def test_kernels_are_made_of_the_sources_that_name_the_cache_and_of_nothing_else() -> None:
    known: set[Path] = set()
    for package, places in KERNEL_SOURCES.items():
        for place in places:
            path = ROOT / package / place
            known |= {path} if path.is_file() else set(path.rglob("*.py"))
    kernels = [path for path in known if "@kernel" in path.read_text()]
    assert len(kernels) > 10
    numba_free = {f"automaton.strategy.{name}" for name in ("paths", "entry", "network")}
    for path in kernels:
        for name in imports_of(path) - numba_free:
            source = module_file(name)
            assert source is None or source in known, f"{path.name} imports {name}"


def test_the_cache_folder_changes_with_a_source(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from automaton import compiled

    for package in KERNEL_SOURCES:
        (tmp_path / package / "kernels").mkdir(parents=True)
    edited = tmp_path / "automaton" / "kernels" / "motion.py"
    edited.write_text("RULE = 1\n")
    for place in KERNEL_SOURCES["automaton"]:
        if place.endswith(".py"):
            (tmp_path / "automaton" / place).parent.mkdir(exist_ok=True)
            (tmp_path / "automaton" / place).write_text("")
    monkeypatch.setattr(compiled, "_folder", lambda package: tmp_path / package)
    compiled.source_hash.cache_clear()
    before = compiled.source_hash()
    edited.write_text("RULE = 2\n")
    compiled.source_hash.cache_clear()
    after = compiled.source_hash()
    compiled.source_hash.cache_clear()
    assert before != after


RUN = (
    "from automaton.commands import main; sys.exit(main(['run', 'tabletop-mini', '--until', '1']))"
)


@pytest.mark.parametrize(
    ("missing", "told"),
    [
        ("import numba.np.arrayobj as part; del part.populate_array", "cannot import name"),
        (
            "import numba.core.dispatcher as part; part.Dispatcher.get_call_template = print",
            "Dispatcher.get_call_template takes other arguments",
        ),
        (
            "import numba.core.event as part; del part.Listener.on_end; part.Listener.on_finish = 1",
            "event.Listener hears other events",
        ),
    ],
)
def test_a_numba_without_the_private_parts_is_refused_in_a_sentence(
    missing: str, told: str
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; {missing}; {RUN}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert told in done.stderr and done.stderr.count("\n") == 1
    assert f"was tried with {TRIED[0]} to {TRIED[1]}: pip install" in done.stderr


def kept_in(cache: Path, temporary: Path) -> tuple[str, str]:
    """Where a process of its own keeps compiled code, and what it says about that."""
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from automaton.compiled import cache_folder; print(cache_folder())",
        ],
        env=os.environ | {"AUTOMATON_CACHE_DIR": str(cache), "TMPDIR": str(temporary)},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip(), done.stderr


@pytest.fixture
def unwritable(tmp_path: Path) -> Path:
    """No folder can be made in it, by root neither: it is a file."""
    (tmp_path / "file").touch()
    return tmp_path / "file" / "cache"


@pytest.fixture
def temporary(tmp_path: Path) -> Path:
    (tmp_path / "temporary").mkdir()
    return tmp_path / "temporary"


def test_where_the_cache_cannot_be_written_later_processes_find_another_folder(
    unwritable: Path, temporary: Path
) -> None:
    folder, said = kept_in(unwritable, temporary)
    shared = temporary / f"automaton-kernels-{os.getuid()}"
    assert Path(folder).parent == shared and stat.S_IMODE(shared.stat().st_mode) == 0o700
    assert said == (
        f"automaton: compiled code cannot be kept in {unwritable / 'kernels'} (Not a directory), so it "
        f"goes to {shared}; AUTOMATON_CACHE_DIR names another folder\n"
    )
    assert kept_in(unwritable, temporary) == (folder, ""), "it is said once"


def test_a_folder_that_others_can_write_to_is_not_trusted(
    unwritable: Path, temporary: Path
) -> None:
    shared = temporary / f"automaton-kernels-{os.getuid()}"
    shared.mkdir()
    shared.chmod(0o777)
    folder, _ = kept_in(unwritable, temporary)
    assert shared not in Path(folder).parents and not any(shared.iterdir())
    assert not Path(folder).exists(), "it ends with its process"


def test_the_temporary_folder_is_removed_when_nobody_used_it_for_a_week(
    unwritable: Path, temporary: Path, tmp_path: Path
) -> None:
    folder, _ = kept_in(unwritable, temporary)
    shared = Path(folder).parent
    (Path(folder) / "kernel.nbi").touch()
    kept_in(tmp_path / "cache", temporary)
    assert Path(folder).exists(), "another process may be using it"
    os.utime(folder, (0, 0))
    kept_in(tmp_path / "cache", temporary)
    assert not shared.exists()


def test_what_is_compiled_for_long_is_said_once_and_is_no_time_of_a_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(compiled, "PATIENCE_S", 0.0)
    kernel = SimpleNamespace(py_func=SimpleNamespace(__module__="strategies.right_of_way.withdraw"))
    event: Any = SimpleNamespace(data={"dispatcher": kernel})
    listener = compiled._Compilations()
    for _ in range(2):
        listener.on_start(event)
        listener.on_start(event)  # a kernel that it calls
        listener._timer.join(10)
        listener.on_end(event)
        listener.on_end(event)
    said = "automaton: first use on this machine: right of way is compiled, once ...\n"
    assert capsys.readouterr().err == said
    assert listener.seconds > 0
    assert compiled.subject_of("automaton.kernels.loop") == "the world"
    # The first run on a machine is told as that; what explain needs beyond it is not.
    for before, said in ((False, "first run of this version"), (True, "another part of the world")):
        other = compiled._Compilations()
        other._kernels_before = before
        other.tell(compiled.WORLD)
        assert said in capsys.readouterr().err
    assert compiled.subject_of("mine") == "mine"
