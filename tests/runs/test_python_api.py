"""What `import automaton` offers: runs that are stepped, branched, saved and pickled."""

from __future__ import annotations

import os
import pickle
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from doc_commands import in_this_process
from docs_pages import page
from everything_on import scenario_of

import automaton
from automaton.commands import commit_of, main
from automaton.engine.state import LAYER_ALLOCATION
from automaton.errors import InputError
from automaton.scenario.reading import read
from automaton.strategy.per_robot import Decision, LocalView, Me, deliver, park, take
from automaton.verification.verification import verify
from strategies.allocation.first_come import FirstCome

EVERYTHING_ON = (9, 28)  # seeds of floors with pods, gates, faults and charging
TICKS, LATER = 150, 400


@automaton.per_robot("allocation", memory=1)
def in_turn(me: Me, view: LocalView) -> Decision | None:
    """Take the first and the last open order in turn."""
    if me.load is not None:
        return deliver()
    orders = view.open_orders()
    if not orders:
        return park()
    me.memory[0] += 1
    return take(orders[-(me.memory[0] % 2)])


def futures(simulation: Any, path: Path) -> list[Any]:
    """The simulation and all that can be made of its state."""
    saved = simulation.save(path)
    others = [simulation.branch(), pickle.loads(pickle.dumps(simulation)), saved.simulation()]
    return [simulation, *others]


def test_the_import_takes_nothing_along() -> None:
    heavy = ["numba", "numpy", "msgspec", "textual", "pyarrow"]
    program = f"import sys, automaton; sys.exit(any(name in sys.modules for name in {heavy}))"
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize("number", EVERYTHING_ON)
def test_branches_pickles_and_saved_runs_have_one_future(number: int, tmp_path: Path) -> None:
    run = automaton.Simulation(scenario_of(number, LATER))
    run.step(TICKS)
    assert run.tick == TICKS
    runs = futures(run, tmp_path / "run.rec")
    assert len({one.digest for one in runs}) == 1
    for one in runs:
        one.run(LATER)
    assert len({(one.tick, one.digest) for one in runs}) == 1
    assert all(repr(one.metrics) == repr(run.metrics) for one in runs)
    assert verify(tmp_path / "run.rec").passed


def test_strategies_in_python_remember_the_past(tmp_path: Path) -> None:
    run = automaton.Simulation("tabletop-mini", strategies={"allocation": in_turn})
    run.step(TICKS)
    runs = futures(run, tmp_path / "run.rec")
    for one in runs:
        one.run()
        assert one.finished
    assert len({(one.tick, one.digest) for one in runs}) == 1
    whole = automaton.simulate("tabletop-mini", strategies={"allocation": in_turn})
    assert whole.digest == run.digest != automaton.simulate("tabletop-mini").digest


class Watched(automaton.Strategy):
    """Allocation: keeps a list of ticks outside its state."""

    layer = "allocation"

    def __init__(self, parameters: Any = None, first: int = 0) -> None:
        super().__init__(parameters)
        self.ticks = [first]

    def decide(self, view: Any, batch: Any, *_: Any) -> None:
        self.ticks.append(int(view.clock.tick))


def test_names_classes_and_instances_are_strategies_and_runs_copy_instances() -> None:
    plain = automaton.Simulation("tabletop-mini", strategies={"allocation": FirstCome()})
    named = automaton.Simulation("tabletop-mini", strategies={"allocation": "first-come"})
    assert plain.run(100).digest == named.run(100).digest
    own, other = Watched(first=7), Watched(first=8)
    runs = [automaton.Simulation("tabletop-mini", strategies={"allocation": own}) for _ in "ab"]
    more = automaton.Simulation("tabletop-mini", strategies={"allocation": other})
    for run in (*runs, more):
        run.step(2)
    used = [run._run.strategies[LAYER_ALLOCATION] for run in (*runs, more)]
    assert [one.ticks for one in used] == [[7, 1], [7, 1], [8, 1]] and own.ticks == [7]
    assert runs[0].branch().step(1).tick == 3


def test_a_branch_is_what_the_command_makes(tmp_path: Path, capsys: Any) -> None:
    first, out = tmp_path / "run.rec", tmp_path / "branch.rec"
    automaton.simulate("tabletop-mini", record=first)
    changed = ["--set", "strategy.allocation=first-come"]
    assert main(["branch", str(first), "--at", "100", *changed, "--out", str(out)]) == 0
    run = automaton.read(first).simulation(at=100)
    before = run.digest
    branch = run.branch(strategy__allocation="first-come")
    branch.run()
    assert branch.digest == automaton.read(out).simulation().digest
    assert (run.tick, run.digest) == (100, before)
    saved = branch.save(tmp_path / "saved.rec")
    assert verify(saved.path).passed
    again = saved.simulation(at=120)
    assert again.scenario == branch.scenario
    assert again.run().digest == branch.digest


@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("tabletop-mini", {"strategy__allocation": "first-come"}),
        ("factory", {"strategy__zoning": "none"}),
        ("goods-mini", {"world__following": "handover"}),
    ],
)
def test_a_branch_that_is_saved_at_once_goes_on_as_a_branch(
    scenario: str, settings: dict[str, Any], tmp_path: Path
) -> None:
    branch = automaton.Simulation(scenario).step(60).branch(**settings)
    again = branch.save(tmp_path / "run.rec").simulation()
    assert again.scenario == branch.scenario
    assert again.step(200).digest == branch.step(200).digest
    assert pickle.loads(pickle.dumps(branch)).digest == branch.digest


def test_the_version_says_which_commit_a_clone_is_of(tmp_path: Path, capsys: Any) -> None:
    assert main(["--version"]) == 0
    assert re.fullmatch(
        rf"automaton {re.escape(automaton.__version__)}(, commit [0-9a-f]{{8}})?\n",
        capsys.readouterr().out,
    )
    assert commit_of(tmp_path) == ""
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git" / "HEAD").write_text("ref: refs/heads/main\n")
    (tmp_path / ".git" / "packed-refs").write_text(
        "# pack-refs\n0123456789abcdef refs/heads/main\n"
    )
    assert commit_of(tmp_path) == ", commit 01234567"
    (tmp_path / ".git" / "refs" / "heads").mkdir(parents=True)
    (tmp_path / ".git" / "refs" / "heads" / "main").write_text("fedcba9876543210\n")
    assert commit_of(tmp_path) == ", commit fedcba98"
    (tmp_path / ".git" / "HEAD").write_text("89abcdef01234567\n")
    assert commit_of(tmp_path) == ", commit 89abcdef"


def test_a_package_of_that_name_that_has_replaced_ours_is_named(tmp_path: Path) -> None:
    shutil.copytree(Path(automaton.__file__).parent, tmp_path / "automaton")
    (tmp_path / "automaton" / "__init__.py").write_text('"""Theirs."""\n')
    command = [sys.executable, "-P", "-m", "automaton", "list"]
    done = subprocess.run(
        command, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(tmp_path)}
    )
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "another distribution" in done.stderr


def test_a_scenario_is_a_path_a_dict_or_a_scenario() -> None:
    checked = automaton.load("tabletop-mini", seed=4)
    in_a_file = read("tabletop-mini").data
    digests = {
        automaton.simulate(one, seed=4).digest for one in ("tabletop-mini", checked, in_a_file)
    }
    assert len(digests) == 1


def test_the_world_is_read_and_not_written() -> None:
    run = automaton.Simulation("tabletop-mini")
    cells = run.world.robots.cell
    with pytest.raises(ValueError, match="read-only"):
        cells[0] = 1
    before = cells.copy()
    run.step(40)
    assert (cells != before).any(), "the arrays are those of the run"


def test_check_returns_what_the_command_prints(capsys: Any) -> None:
    warnings = automaton.check("goods-60x40")
    assert main(["check", "goods-60x40"]) == 0
    printed = " ".join(capsys.readouterr().err.split())
    assert warnings and all(" ".join(one.split()) in printed for one in warnings)


def test_check_reads_the_files_of_strategies_as_the_command_does(tmp_path: Path) -> None:
    missing = {"name": "traffic-avoidance", "predictor": {"network": str(tmp_path / "no.npz")}}
    with pytest.raises(InputError, match=r"there is no file .*no\.npz"):
        automaton.check("warehouse-100", strategy__routing=missing)
    design = {"name": "static", "design": {"zones": [[1]]}}
    with pytest.raises(InputError, match="zone"):
        automaton.check("factory", strategy__zoning=design)


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ("automaton.load('tabletop-9')", "no file and no shipped scenario"),
        ("automaton.load('tabletop-1', fleet__robots=0)", "fleet.robots"),
        ("automaton.load({'nmae': 'x'})", "name"),
        ("automaton.Simulation('tabletop-mini').step(-1)", "ticks must be at least 0, found -1"),
        ("automaton.Simulation('tabletop-mini').branch(fleet__robots=2)", "cannot change during"),
        (
            "automaton.simulate('tabletop-mini', strategies={'routing': in_turn})",
            "is a strategy for",
        ),
        ("automaton.simulate('tabletop-mini', strategies={'routing': dict})", "is not a strategy"),
        ("automaton.read('no.rec')", "no.rec"),
        ("automaton.Simulation('tabletop-mini').save('/no/run.rec')", "/no/run.rec"),
    ],
)
def test_bad_input_gets_one_sentence(asked: str, sentence: str) -> None:
    with pytest.raises(InputError, match=re.escape(sentence)) as caught:
        eval(asked, {"automaton": automaton, "in_turn": in_turn})
    assert "\n" not in str(caught.value)


def test_a_strategy_that_decides_otherwise_cannot_be_saved(tmp_path: Path) -> None:
    asked = [0]

    @automaton.per_robot("allocation")
    def fickle(me: Me, view: LocalView) -> Decision | None:
        asked[0] += 1
        orders = view.open_orders()
        return take(orders[-1 if asked[0] % 7 else 0]) if orders and me.load is None else None

    run = automaton.Simulation("tabletop-1", strategies={"allocation": fickle})
    run.step(300)
    asked[0] = 3
    with pytest.raises(InputError, match="decides differently this time"):
        run.save(tmp_path / "run.rec")
    assert not os.listdir(tmp_path)


def test_the_examples_of_the_page_run(tmp_path: Path) -> None:
    examples = [one.text for one in page("docs/reference/python.md").blocks]
    assert len(examples) >= len(automaton.OFFERED)
    with in_this_process(tmp_path):
        for example in examples:
            exec(example, {"__name__": "example"})
