"""The cache of compiled code: what an edit compiles again, and where the cache may lie."""

from __future__ import annotations

import ast
import json
import os
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest
from compiled_kernels import LISTENING

import strategies.allocation.first_come
from automaton.engine.jit import kernel_cache
from automaton.engine.jit.kernel import jit_is_on
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

ROOT = Path(__file__).parents[2]
ENGINE = {"automaton.engine.loop", "automaton.engine.motion"}


def kernel_modules() -> dict[str, Path]:
    """The shipped modules with kernels."""
    files = [path for top in ("automaton", "strategies") for path in (ROOT / top).rglob("*.py")]
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): path
        for path in files
        if "\n@kernel" in path.read_text()
    }


def made_of(edited: str) -> set[str]:
    """The modules with kernels whose cache is named by a file, among others."""
    path = ROOT / edited
    assert path.is_file()
    return {
        name for name, file in kernel_modules().items() if path in kernel_cache.sources(name, file)
    }


def test_an_edit_in_a_strategy_concerns_nobody_else() -> None:
    assert made_of("strategies/right_of_way/retreat.py") == {"strategies.right_of_way.retreat"}
    measured = "automaton.bench.leg_plans"
    assert made_of("strategies/routing/congestion.py") == {
        "strategies.routing.congestion",
        measured,
    }
    assert not made_of("automaton/world/resolve.py")
    assert not made_of("automaton/runs/simulation.py")


def test_the_world_and_all_that_calls_it_are_made_of_its_kernels() -> None:
    assert made_of("automaton/engine/motion.py") >= ENGINE | {"strategies.right_of_way.retreat"}
    assert made_of("automaton/engine/state.py") >= ENGINE, "constants are compiled in"
    everything = set(kernel_modules())
    assert (
        made_of("automaton/engine/jit/struct_types.py")
        == made_of("automaton/engine/jit/kernel.py")
        == everything
    )


def test_the_world_is_made_of_no_source_of_a_method() -> None:
    world = kernel_cache.sources("automaton.engine.loop", ROOT / "automaton/engine/loop.py")
    assert ROOT / "automaton/engine/facilities.py" in world
    methods = (
        *("strategies", "strategies/allocation/auction", "strategies/zoning", "strategies/routing"),
        *(
            "strategies/routing/predicted_paths.py",
            "strategies/routing/astar.py",
        ),
    )
    for method in methods:
        assert (ROOT / method).exists()
        assert not [path for path in world if path.is_relative_to(ROOT / method)], method
    # What strategies may call is of the world, too.
    public = kernel_cache.sources("automaton.strategy.api", ROOT / "automaton/strategy/api.py")
    for method in methods:
        assert not [path for path in public if path.is_relative_to(ROOT / method)], method


def test_all_ways_to_import_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "owner" / "deep").mkdir(parents=True)
    numbers = ("one", "two", "three", "four", "six", "seven", "eight", "nine", "größe", "never")
    for name in ("__init__", *numbers, "deep/__init__", "deep/five"):
        (tmp_path / "owner" / f"{name}.py").write_text("")
    start = tmp_path / "owner" / "start.py"
    start.write_text(
        "import owner.one as first, os; import owner.six\n"
        "from owner import (  # (from owner import never)\n    two,  # 2)\n    größe,\n)\n"
        "from .three import NAME as OTHER\n"
        "from . import four, \\\n    seven\n"
        "from .deep.five import NAME\n"
        "try:\n    import owner.eight\nexcept ImportError:\n    import owner.nine\n"
        "def later():\n    if True:\n        import owner.never\n"
        "if TYPE_CHECKING:\n    from owner import never\n"
    )
    (tmp_path / "owner" / "two.py").write_text("from .start import later\n")  # a cycle
    found = {
        path.relative_to(tmp_path).as_posix() for path in kernel_cache.sources("owner.start", start)
    }
    expected = {"__init__", "start", "deep/five", *numbers} - {"never"}
    assert found == {f"owner/{name}.py" for name in expected}


def parsed(nodes: list[ast.stmt]) -> Iterator[str]:
    """The names that the import statements among parsed ones may mean, as they run with a module."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None and node.level == 0
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from parsed(node.orelse)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from parsed(inner(node))


def inner(node: ast.AST) -> list[ast.stmt]:
    """The statements right inside another one, in any of its blocks."""
    return [
        statement
        for block in ("body", "orelse", "handlers", "finalbody")
        for child in getattr(node, block, [])
        for statement in (inner(child) if isinstance(child, ast.ExceptHandler) else [child])
    ]


def test_imports_are_found_as_a_parser_finds_them() -> None:
    files = [
        path for top in ("automaton", "strategies", "tui") for path in (ROOT / top).rglob("*.py")
    ]
    assert len(files) > 300
    with_kernels = set(kernel_modules().values())
    for path in files:
        source = path.read_text()
        found = set(kernel_cache._imported_names(source, "automaton"))
        wanted = set(parsed(ast.parse(source).body))
        assert found >= wanted, path
        # An example in a docstring may look like an import, which only costs a compilation more.
        assert found == wanted or path not in with_kernels, path


def test_what_has_no_file_is_made_of_all_that_a_strategy_may_call() -> None:
    cell = kernel_cache.sources("__main__", Path("<a cell of a notebook>"))
    assert {ROOT / "automaton/engine/motion.py", ROOT / "automaton/strategy/api.py"} <= cell


# Another one in each session: its folders, and the cache of its kernels, may be those of an earlier one.
SESSION = f"# {uuid4()}\n"
PLUG_IN = """
from automaton.strategy.api import CMD_WAIT, Strategy, kernel
from mine.deep.ticks import TICKS
from another import doubled


@kernel
def decide(view, batch, decisions, memory, workspace):
    out = decisions.right_of_way
    for k in range(batch.count):
        out.command[k] = CMD_WAIT
        out.value[k] = doubled(TICKS)


class Patient(Strategy):
    layer = "right_of_way"
    compiled = decide
"""
ANOTHER = "from automaton.strategy.api import kernel\n\n@kernel\ndef doubled(x):\n    return {}\n"

COUNTED = """
import json, sys
from automaton.engine.jit.numba_parts import event
compiled = []
class Listener(event.Listener):
    def on_start(self, event):
        module = event.data["dispatcher"].py_func.__module__
        if not module.startswith("numba."):  # parts of Numba that it compiles when they are called
            compiled.append(module)
    def on_end(self, event):
        pass
event.register("numba:compile", Listener())
from automaton.world.resolve import resolve
from automaton.runs.simulation import Simulation
run = Simulation(resolve("tabletop-mini", ["fleet.robots=4", f"strategy.{sys.argv[1]}"]))
run.run(400)
print(json.dumps([sorted(set(compiled)), run.digest]))
"""


def compiled_in_a_run(folder: Path, strategy: str) -> tuple[set[str], str]:
    """The modules that a process of its own compiles for a run, and the run's digest."""
    done = subprocess.run(
        [sys.executable, "-c", COUNTED, strategy],
        env=os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"},
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    modules, digest = json.loads(done.stdout)
    return set(modules), digest


def compile_the_rest() -> None:
    """Compile all that such a run needs besides the plug-in, if this is the first test of all."""
    Simulation(resolve("tabletop-mini", ["fleet.robots=4", "strategy.right_of_way=wait"])).run(400)


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_an_edit_in_what_a_plug_in_calls_compiles_it_anew(tmp_path: Path) -> None:
    (tmp_path / "mine" / "deep").mkdir(parents=True)
    (tmp_path / "mine" / "patient.py").write_text(SESSION + PLUG_IN)
    (tmp_path / "mine" / "deep" / "ticks.py").write_text("TICKS = 2\n")
    (tmp_path / "another.py").write_text(SESSION + ANOTHER.format("2 * x"))
    ours, name = {"mine.patient", "another"}, "right_of_way=mine.patient:Patient"
    compile_the_rest()
    modules, before = compiled_in_a_run(tmp_path, name)
    assert modules == ours
    assert compiled_in_a_run(tmp_path, name) == (set(), before)

    (tmp_path / "mine" / "deep" / "ticks.py").write_text("TICKS = 9\n")
    modules, after = compiled_in_a_run(tmp_path, name)
    assert modules == {"mine.patient"} and after != before

    (tmp_path / "another.py").write_text(SESSION + ANOTHER.format("x"))
    modules, last = compiled_in_a_run(tmp_path, name)
    assert modules == ours and last != after


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_comment_in_a_strategy_compiles_that_strategy_alone(tmp_path: Path) -> None:
    edited = tmp_path / "edited.py"
    edited.write_text(SESSION + Path(strategies.allocation.first_come.__file__).read_text())
    modules, before = compiled_in_a_run(tmp_path, "allocation=edited:FirstCome")
    assert "edited" in modules
    edited.write_text(edited.read_text() + "# a comment\n")
    assert compiled_in_a_run(tmp_path, "allocation=edited:FirstCome") == ({"edited"}, before)


COUNTING = """
from automaton.strategy.api import Array, Strategy, Struct, field, kernel


class CountingState(Struct):
    {field}


@kernel
def decide(view, batch, decisions, memory, workspace):
    state = CountingState.of(memory)
    for k in range(batch.count):
        state.{name}[batch.robot[k]] += 1


class Counting(Strategy):
    layer = "right_of_way"
    compiled = decide
    period = 1
    counters = {{"asked": "{name}"}}

    def reset(self, view):
        return CountingState.sized({{"n": len(view.robots.cell)}})
"""


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_field_of_a_strategys_state_is_declared_in_its_folder_alone(tmp_path: Path) -> None:
    plug_in = tmp_path / "counting.py"
    plug_in.write_text(
        SESSION + COUNTING.format(field='asked: Array = field("(n,) int64")', name="asked")
    )
    compile_the_rest()
    modules, before = compiled_in_a_run(tmp_path, "right_of_way=counting:Counting")
    assert modules == {"counting"}
    fields = 'asked: Array = field("(n, 2) float64")\n    times: Array = field("(n,) int32")'
    plug_in.write_text(SESSION + COUNTING.format(field=fields, name="times"))
    modules, after = compiled_in_a_run(tmp_path, "right_of_way=counting:Counting")
    assert modules == {"counting"} and after == before


def kept_in(cache: Path, temporary: Path) -> tuple[str, str]:
    """Where a process of its own keeps compiled code, and what it says about that."""
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from automaton.engine.jit import kernel_cache as s\n"
            "from automaton.engine.jit.kernel_cache import cache_folder\n"
            "print(cache_folder(s.__name__, s.__file__))",
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
        f"automaton: compiled code cannot be kept in {unwritable / 'kernels'} (Not a directory); it "
        f"is kept in {shared} instead. Set AUTOMATON_CACHE_DIR to choose a folder\n"
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


SQUARES = "from automaton.strategy.api import kernel\n\n@kernel\ndef {name}(x):\n    return x * x\n"
# Runs as root, too, which may write everywhere: a process without this capability may not (CAPBSET_DROP
# of CAP_DAC_OVERRIDE; what it executes has not got it).
DROPPED = "__import__('ctypes').CDLL(None).prctl(24, 1, 0, 0, 0)"
USED = f"""{LISTENING}for name in sys.argv[1:]:
    function = getattr(__import__(name), name)
    assert function(7) == 49 and function.is_compiled
print(json.dumps(compiled))
"""


@pytest.fixture
def filled(tmp_path: Path) -> Iterator[Path]:
    """A cache with the kernel `square`, in which nothing can be written."""
    for name in ("square", "other"):
        (tmp_path / f"{name}.py").write_text(SESSION + SQUARES.format(name=name))
    cache = tmp_path / "filled"
    assert compiled_where(cache, tmp_path, tmp_path, "square") == (["square"], "")
    folders = [cache, *(path for path in cache.rglob("*") if path.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    yield cache
    for folder in folders:
        folder.chmod(0o755)


def compiled_where(
    cache: Path, modules: Path, temporary: Path, *names: str
) -> tuple[list[str], str]:
    """What a process compiles that calls a kernel of each module, and what it says about that."""
    executed = [sys.executable, "-c", USED, *names]
    done = subprocess.run(
        [sys.executable, "-c", f"{DROPPED}; __import__('os').execv({executed[0]!r}, {executed!r})"],
        env=os.environ
        | {
            "AUTOMATON_CACHE_DIR": str(cache),
            "TMPDIR": str(temporary),
            "PYTHONPATH": f"{modules}{os.pathsep}{ROOT}",
        },
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout), done.stderr


def cannot_be_written(folder: Path) -> bool:
    written = f"open({str(folder / 'probe')!r}, 'w')"
    command = f"import os; {DROPPED}; os.execv({sys.executable!r}, ['python', '-c', {written!r}])"
    return subprocess.run([sys.executable, "-c", command], stderr=subprocess.DEVNULL).returncode > 0


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_cache_that_cannot_be_written_is_read(
    filled: Path, temporary: Path, tmp_path: Path
) -> None:
    if not cannot_be_written(filled):
        pytest.skip("nothing is unwritable here")
    assert compiled_where(filled, tmp_path, temporary, "square") == ([], "")
    # What it lacks is kept in the temporary folder, and both are read.
    assert compiled_where(filled, tmp_path, temporary, "square", "other") == (["other"], "")
    assert compiled_where(filled, tmp_path, temporary, "other", "square") == ([], "")


@pytest.mark.skipif(not jit_is_on(), reason="compilation is off")
def test_a_cache_is_read_where_nothing_can_be_written_at_all(filled: Path, tmp_path: Path) -> None:
    """Not even in a temporary folder: each process compiles what the cache lacks."""
    if not cannot_be_written(filled):
        pytest.skip("nothing is unwritable here")
    nowhere = without_temporary_folder(tmp_path)
    for _ in range(2):
        assert compiled_where(filled, nowhere, tmp_path, "square", "other") == (["other"], "")


def without_temporary_folder(modules: Path) -> Path:
    """Modules for a process that finds no temporary folder, as in an image that is read only."""
    (modules / "sitecustomize.py").write_text(
        "import tempfile\n\n\ndef gettempdir():\n    raise FileNotFoundError(2, 'No usable folder')\n\n\n"
        "tempfile.gettempdir = gettempdir\n"
    )
    return modules
