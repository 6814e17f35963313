"""Keys of runs follow from contents: the same study in another folder has the same ones."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from sweep_studies import environment, plain, swept_here

from automaton.commands import main
from automaton.errors import InputError
from automaton.runs import provenance
from automaton.runs.provenance import sources_of
from automaton.studies.reports.build_report import scenarios_of
from automaton.studies.sweeps import pools
from automaton.studies.sweeps import run_keys as keys
from automaton.studies.sweeps.result_store import Store
from automaton.studies.sweeps.sweep_plan import make_sweep_plan

PLUG_IN = """from pathlib import Path

import msgspec

from automaton.strategy.contract import Strategy


class Parameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    table: str = "table.txt"

    @property
    def files(self):
        return (Path(self.table),)

    def resolve_paths(self, folder):
        return msgspec.structs.replace(self, table=str((folder / self.table).resolve()))


class Own(Strategy):
    layer = "allocation"
    Parameters = Parameters

    def decide(self, view, batch, decisions, memory, workspace):
        decisions.allocation.command[: batch.count] = CMD_PARK
"""
SCENARIO = """name: own
layout: {file: floor.txt}
fleet: {robots: 1}
orders: {generator: picture-loads}
strategy: {allocation: {name: 'own_allocation:Own', table: table.txt}}
"""
STUDY = """name: own
scenario: own.yaml
factors:
  fleet.robots: [1, 2]
  strategy.allocation:
    - {name: 'own_allocation:Own', table: table.txt}
    - independent
replications: 2
"""
TELL = (
    "import sys\n"
    "from automaton.studies.sweeps.sweep_plan import make_sweep_plan\n"
    "print(*sorted(make_sweep_plan(sys.argv[1]).manifest.keys()))\n"
)


def copied(folder: Path, table: str = "1 2 3\n") -> Path:
    """A checkout: a study, its scenario with a floor, a plug-in and the file that it reads."""
    folder.mkdir()
    (folder / "own_allocation.py").write_text(PLUG_IN)
    (folder / "table.txt").write_text(table)
    (folder / "floor.txt").write_text("b.$.d\nb....\n#....\n")
    (folder / "own.yaml").write_text(SCENARIO)
    (folder / "own-study.yaml").write_text(STUDY)
    return folder / "own-study.yaml"


def keys_told(study: Path, folder: Path) -> str:
    """The keys of a study as a process tells them that runs in a folder, and has its plug-ins."""
    paths = os.pathsep.join([str(study.parent), environment()["PYTHONPATH"]])
    found = subprocess.run(
        [sys.executable, "-c", TELL, os.path.relpath(study, folder)],
        cwd=folder,
        env=environment() | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert found.returncode == 0, found.stderr
    return found.stdout


def test_two_checkouts_have_the_same_keys(tmp_path: Path) -> None:
    one, other = copied(tmp_path / "one"), copied(tmp_path / "another one")
    changed = copied(tmp_path / "changed", table="1 2 4\n")
    keys = keys_told(one, one.parent)
    assert len(set(keys.split())) == 4 * 2
    assert keys_told(other, tmp_path) == keys
    differ = set(keys_told(changed, tmp_path).split()) - set(keys.split())
    assert len(differ) == 2 * 2  # the points whose strategy reads the table


@pytest.mark.parametrize("begun", ["", "__init__.py"], ids=["without __init__", "with it"])
def test_all_files_of_a_package_of_plug_ins_count(
    begun: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"own_package{len(begun)}"
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / name / "deep").mkdir(parents=True)
    (tmp_path / "beside.py").touch()
    for file in ("own.py", "deep/more.py", *([begun] if begun else [])):
        (tmp_path / name / file).touch()
    for file in ("deep/data.json", "__pycache__/own.pyc", ".git/HEAD", "results/sweep.json"):
        (tmp_path / name / file).parent.mkdir(exist_ok=True)
        (tmp_path / name / file).touch()
    counted = {file for file in sources_of((f"{name}.own",)) if file.startswith(name)}
    names = {"own.py", "deep/more.py", "deep/data.json", *([begun] if begun else [])}
    assert counted == {f"{name}/{file}" for file in names}


def far_study(folder: Path, scenario: str) -> Path:
    """A study whose scenario lies deeper, with its floor above it and its orders beside it."""
    (folder / "deep").mkdir(parents=True)
    (folder / "floor.txt").write_bytes(b"b.$.d\r\nb....\r\ns....\r\n")
    (folder / "deep" / "orders.csv").write_text("released,from_x,from_y,to_x,to_y\n0,0,2,4,0\n")
    (folder / "deep" / "own.yaml").write_text(
        "name: own\nlayout: {file: ../floor.txt}\nfleet: {robots: 1}\n"
        "orders: {transports: {file: orders.csv}}\nstop: {when: delivered, max_duration: 500}\n"
    )
    study = folder / "far.yaml"
    study.write_text(
        f"name: far\nscenario: {scenario}\nfactors: {{fleet.robots: [1, 2]}}\nreplications: 1\n"
    )
    return study


def test_a_folder_of_results_needs_no_file_of_its_study(tmp_path: Path) -> None:
    study, out = far_study(tmp_path / "home", "deep/own.yaml"), tmp_path / "out"
    rows = swept_here(study, out)
    shutil.rmtree(study.parent)
    scenarios, note = scenarios_of(Store(out))
    assert set(scenarios) == {0, 1} and note == ""
    assert swept_here(out / "study.yaml", out).equals(rows)
    assert plain(swept_here(out / "study.yaml", tmp_path / "again")) == plain(rows)


OUTER_SCENARIO = """name: outer  # Größe: klein
layout: {{file: "{floor}"}}
fleet: {{robots: 1}}
orders: {{transports: {{file: '../Tage/*.csv'}}}}
strategy: {{allocation: {{name: 'outer_plug_in:Own', table: table.txt}}}}
stop: {{when: delivered, max_duration: 500}}
"""


def outer_study(home: Path) -> Path:
    """A study whose scenario, orders and floor lie elsewhere; its strategy imports a module beside it."""
    orders = "released,from_x,from_y,to_x,to_y\n0,0,2,4,0\n"
    plug_in = f"import outer_costs\n{PLUG_IN.replace('CMD_PARK', 'CMD_STAY')}"
    for file, text in {
        "study/outer.yaml": "name: outer\nscenario: ../site/outer.yaml\nreplications: 1\n"
        f"factors:\n  layout.file: [{home / 'maps' / 'floor.txt'}, '../wide/floor.txt']\n",
        "site/outer.yaml": OUTER_SCENARIO.format(floor=home / "maps" / "floor.txt"),
        "site/table.txt": "1 2 3",
        "Tage/1.csv": orders,
        "Tage/2.csv": orders.replace("0,0,2", "5,0,2"),
        "maps/floor.txt": "b.$.d\nb....\ns....\n",
        "wide/floor.txt": "b.$.d.\nb.....\ns.....\n",
        "study/outer_plug_in.py": plug_in.replace("= CMD_STAY", "= outer_costs.COMMAND"),
        "study/outer_costs.py": "COMMAND = 0\n",
        "study/outer_unused.py": "",
    }.items():
        (home / file).parent.mkdir(parents=True, exist_ok=True)
        (home / file).write_text(text)
    return home / "study" / "outer.yaml"


@pytest.mark.parametrize(
    ("name", "is_refused"),
    [("rows/__init__.py", True), ("outside/__init__.py", True), ("rows.py", False)],
)
def test_a_package_named_as_a_folder_of_results_is_refused(
    tmp_path: Path, name: str, is_refused: bool
) -> None:
    package = name.removesuffix(".py").partition("/")[0]
    plug_in = (
        f"uses_{package}_{'package' if is_refused else 'module'}"  # imported once in a process
    )
    study = outer_study(tmp_path / "home")
    scenario = tmp_path / "home" / "site" / "outer.yaml"
    scenario.write_text(scenario.read_text().replace("outer_plug_in", plug_in))
    (study.parent / f"{plug_in}.py").write_text(f"import {package}\n{PLUG_IN}")
    (study.parent / name).parent.mkdir(exist_ok=True)
    (study.parent / name).write_text("COMMAND = 0\n")
    try:
        if is_refused:
            with pytest.raises(InputError, match=f"'{package}' of a strategy cannot be copied"):
                make_sweep_plan(study)
        else:
            assert {"rows.py", f"{plug_in}.py"} <= set(make_sweep_plan(study).copies)
    finally:
        sys.path[:] = [one for one in sys.path if one != str(study.parent)]
        sys.modules.pop(package, None)


def test_a_moved_folder_of_results_needs_nothing_from_elsewhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study, out = outer_study(tmp_path / "home"), tmp_path / "out"
    rows = swept_here(study, out)
    assert rows.column("layout.file").to_pylist() == [
        "../maps/floor.txt",
        "../wide/floor.txt",
    ]
    assert "# Größe: klein" in (out / "outside" / "site" / "outer.yaml").read_text()
    assert {path.relative_to(out).as_posix() for path in out.rglob("*.*") if path.is_file()} >= {
        "outside/Tage/2.csv",
        "outside/site/table.txt",
        "outer_costs.py",
    }
    assert not (out / "outer_unused.py").exists()
    shutil.rmtree(study.parent.parent)
    moved = (tmp_path / "elsewhere").resolve()
    out.rename(moved)
    monkeypatch.chdir(moved)
    for name in ("outer_plug_in", "outer_costs"):  # as in a new process
        sys.modules.pop(name, None)
    assert main(["report", "."]) == 0
    (command,) = (line for line in capsys.readouterr().out.splitlines() if "--out ." in line)
    assert command.strip() == "automaton sweep study.yaml --out . && automaton report ."
    assert main(command.partition(" && ")[0].split()[1:]) == 0
    monkeypatch.chdir(moved.parent)  # a folder above the files
    assert main(["sweep", "elsewhere/study.yaml", "--out", "elsewhere"]) == 0
    monkeypatch.chdir(moved)
    assert Store(moved).rows().equals(rows)
    (moved / "rows").rename(tmp_path / "rows")
    assert plain(swept_here(moved / "study.yaml", moved)) == plain(rows)


def test_a_file_that_is_in_the_way_of_a_copy_stays(tmp_path: Path) -> None:
    study, out = far_study(tmp_path / "home", "deep/own.yaml"), tmp_path / "out"
    out.mkdir()
    (out / "floor.txt").write_text("mine")
    with pytest.raises(InputError, match=r"has a file floor\.txt that differs"):
        swept_here(study, out)
    assert (out / "floor.txt").read_text() == "mine"


def test_a_worker_that_lives_on_says_which_code_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "lasting_plug_in.py").touch()
    pools._packages.cache_clear()
    mine = pools._version(())
    with monkeypatch.context() as later:  # the disk has other code now
        later.setattr(provenance, "DECIDING", (".py",))
        changed = keys.hashed(sources_of(("lasting_plug_in",)))
        assert pools._version(("lasting_plug_in",)) != changed and pools._version(()) == mine
    assert pools._version(("lasting_plug_in",)) == keys.hashed(sources_of(("lasting_plug_in",)))


def test_a_plug_in_counts_with_what_it_imports_and_not_with_what_lies_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Imports are followed through modules and packages, in functions too; a circle ends."""
    monkeypatch.syspath_prepend(tmp_path)
    for file, text in {
        "followed_plug_in.py": "import json, followed_costs\nimport automaton\n",
        "followed_costs.py": "def cost():\n    from followed_tools.deep import rate\n",
        "followed_tools/__init__.py": "from .deep import rate\n",
        "followed_tools/deep.py": "import followed_plug_in\n",
        "followed_tools/table.csv": "1,2",
        "json.py": "",
        "unrelated.py": "def broken(:\n",
        "data/table.csv": "1,2",
    }.items():
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(text)
    found = set(sources_of(("followed_plug_in",))) - set(sources_of())
    tools = {f"followed_tools/{name}" for name in ("__init__.py", "deep.py", "table.csv")}
    assert found == {"followed_plug_in.py", "followed_costs.py", *tools}


@pytest.mark.parametrize("name", ["script.py", "queue.py"])
def test_the_script_of_a_program_counts_with_what_it_imports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """A class of a script is found as __main__:NAME, even if it is named like a standard module; a
    notebook has no file."""
    for file, text in {
        name: "import main_costs, heapq\n",
        "heapq.py": "",
        "main_costs.py": "",
        "other.py": "",
    }.items():
        (tmp_path / file).write_text(text)
    script = ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", script)
    assert sources_of(("__main__",)) == sources_of()
    script.__file__ = str(tmp_path / name)
    assert set(sources_of(("__main__",))) - set(sources_of()) == {name, "main_costs.py"}


def test_a_link_that_leads_nowhere_is_no_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as an editor leaves beside a file that is open in it."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "edited_plug_in.py").touch()
    (tmp_path / ".#edited_plug_in.py").symlink_to("somebody@somewhere.1")
    assert set(sources_of(("edited_plug_in",))) - set(sources_of()) == {"edited_plug_in.py"}
