"""`check-strategy`: each of 16 broken strategies fails the check that is meant for it."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
import yaml

import automaton
from automaton.commands.check_strategy_command import keep
from automaton.conformance import (
    CONFORMANCE_CHECKS,
    EARLIER_CASE,
    FAILS,
    LEFT_OUT,
    MAX_DEATHS,
    OK,
    CheckRequest,
    Child,
    Children,
    checked,
)
from automaton.conformance.new_project import LAYERS, write_project
from automaton.conformance.random_cases import KINEMATICS, random_case
from automaton.conformance.strategy_checks import (
    CaseRefusedError,
    Subject,
    branches,
    legality,
    reply_to,
    storage,
    trace_and_halfway,
)
from automaton.errors import InputError
from automaton.world.resolve import resolve
from strategies.catalogue import CATALOGUE

BROKEN = {  # class: its check, and the number of a case in which it is noticed
    "NoDocstring": ("contract", 0),
    "WrongPeriod": ("contract", 0),
    "WrongState": ("contract", 0),
    "Illegal": ("legality", 0),
    "Raises": ("survival", 0),
    "Endless": ("survival", 0),
    "Chance": ("repeats", 0),
    "ByStorage": ("storage", 0),
    "WritesWorld": ("writes", 0),
    "WritesOtherLayers": ("writes", 0),
    "Grows": ("memory", 4),
    "Peeks": ("information", 5),
    "Gossips": ("information", 2),
    "Idle": ("delivery", 0),
}

SHIPPED = [(layer, name) for layer, entries in CATALOGUE.items() for name in entries]


class Here:
    """Does the tasks of a child in this process, where everything is compiled."""

    def __init__(self) -> None:
        self.subjects: dict[str, Subject] = {}

    def ask(self, task: dict[str, Any]) -> dict[str, Any]:
        reply: dict[str, Any] = json.loads(reply_to(json.dumps(task), self.subjects))
        return reply


class AllHere(Children):
    """Children that do their tasks here."""

    def __init__(self) -> None:
        self.pair: Any = [Here(), Here()]
        self.plain: Any = None

    def side_by_side(
        self,
        tasks: Iterable[list[dict[str, Any]]],
        pair: Any = None,
        done: Callable[[dict[str, Any]], None] = lambda _: None,
    ) -> list[list[dict[str, Any]]]:
        replies: list[list[dict[str, Any]]] = []
        for child, some in zip(self.pair, tasks, strict=True):
            replies.append([])
            for task in some:
                replies[-1].append(child.ask(task))
                done(task)
        return replies


def failing(name: str, check: str, case: int, children: Any) -> list[str]:
    timeout = 0.2 if name == "Endless" else 60
    request = CheckRequest(f"broken_strategies:{name}", only=check, case=case, timeout=timeout)
    verdict = checked(request, children=children)
    return [one.name for one in verdict.checks if one.verdict == FAILS]


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_strategy_fails_its_own_check(name: str) -> None:
    check, case = BROKEN[name]
    assert failing(name, check, case, AllHere()) == [check]


def test_hashes_and_a_crash_are_noticed_between_processes() -> None:
    with Children() as children:
        children.pair[0].deaths = MAX_DEATHS  # by another strategy
        assert failing("HashOrder", "repeats", 0, children) == ["repeats"]
        task = {"layer": None, "strategy": "broken_strategies:Dies", "seed": 1, "timeout": 60}
        task |= {"scenario": None, "parameters": None, "check": "contract", "case": 0}
        reply = children.pair[0].ask({**task, "check": "case"})
        assert reply["found"][0][:2] == ["survival", "the process died by SIGKILL"]


def test_a_death_that_an_earlier_case_may_have_caused_is_not_blamed_on_the_case() -> None:
    task = {"layer": None, "strategy": "broken_strategies:DiesLater", "seed": 1, "timeout": 60}
    task |= {"scenario": None, "parameters": None, "check": "trace"}
    child = Child(1)
    try:
        first, second = (child.ask({**task, "case": case}) for case in (0, 1))
    finally:
        child.close()
    assert first["tried"] == ["trace"] and not first["found"]
    text = f"the process died by SIGKILL, but not when it did this case alone: {EARLIER_CASE}"
    assert [one[:2] for one in second["found"]] == [["survival", text]]
    assert second["tried"] == ["trace"]


def test_a_check_whose_cases_all_raise_is_left_out() -> None:
    verdict = checked(CheckRequest("broken_strategies:NeverAnswers", case=0), children=AllHere())
    checks = {one.name: one for one in verdict.checks}
    assert checks["contract"].verdict == OK and checks["survival"].verdict == FAILS
    for name in ("legality", "repeats", "storage", "branches", "writes", "delivery"):
        assert checks[name].verdict == LEFT_OUT
        assert checks[name].text.startswith("no case could be tried: the strategy raised")


def test_a_sound_strategy_conforms() -> None:
    shown: list[tuple[str, str]] = []
    verdict = checked(
        CheckRequest("broken_strategies:Sound", case=2),
        lambda *words: shown.append(words),
        AllHere(),
    )
    cases = [("case 0 of 1", "1 case"), ("case 1 of 1", "")]
    assert [words for words in shown if words in cases] == cases
    assert verdict.conforms and verdict.refused == 0 and verdict.decisions > 0
    names = [one.name for one in verdict.checks]
    assert names == list(CONFORMANCE_CHECKS) and verdict.lines()[2].startswith("contract     ok")


@pytest.mark.parametrize(("layer", "name"), SHIPPED)
def test_a_shipped_strategy_conforms_on_two_floors(layer: str, name: str) -> None:
    """Without the checks that call it from Python, for which its kernels would be compiled again."""
    subject = Subject({"layer": layer, "strategy": name, "seed": 1, "timeout": 60})
    for number, resolved in islice(accepted(subject), 2):
        run = subject.run(resolved)
        digests, halfway = trace_and_halfway(subject, run)
        found = [*legality(subject, run, resolved), *branches(subject, resolved, digests, halfway)]
        found += storage(subject, resolved, digests, number)
        assert found == []


def accepted(subject: Subject) -> Iterator[tuple[int, Any]]:
    """The cases that the strategy accepts, by number."""
    for number in range(40):
        with suppress(CaseRefusedError):
            yield number, subject.case(number)


def test_a_failure_says_where_and_how_to_repeat_it() -> None:
    request = CheckRequest("broken_strategies:Illegal", only="legality", case=0)
    check = checked(request, children=AllHere()).checks[0]
    assert (check.case, check.tick, check.robot) == (0, 1, 0)
    assert "first: case 0, tick 1, robot 0: CMD_TAKE_ORDER" in check.text
    assert check.command.endswith("--only legality --case 0")


def test_failing_floors_are_kept_as_scenarios(tmp_path: Path) -> None:
    request = CheckRequest("broken_strategies:Idle", only="delivery", case=0)
    keep(tmp_path, request, checked(request, children=AllHere()))
    kept = resolve(tmp_path / "delivery-0.yaml")
    assert kept.strategies["allocation"].name == "broken_strategies:Idle"
    assert kept.scenario.fleet.robots == 1


def test_cases_have_addresses_and_every_kind_of_robot() -> None:
    cases = [random_case(1, number) for number in range(3)]
    assert tuple(case["fleet"]["kinematics"] for case in cases) == KINEMATICS
    assert random_case(1, 2) == cases[2] != random_case(2, 2)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("layer", LAYERS)
def test_a_new_project_can_be_read_and_is_well_formed(
    layer: str, compiled: bool, tmp_path: Path
) -> None:
    files = write_project("mine-first", layer, compiled, tmp_path)
    for file in files:
        if file.suffix == ".py":
            compile(file.read_text(), str(file), "exec")
    command = [sys.executable, "-m", "ruff"]
    for action in (["check", "--select", "E,F,I,UP,B,SIM"], ["format", "--check"]):
        subprocess.run([*command, *action, str(tmp_path)], check=True, capture_output=True)
    point = tomllib.loads((tmp_path / "mine-first" / "pyproject.toml").read_text())
    points = point["project"]["entry-points"]["automaton.strategies"]
    assert points == {f"{layer}.mine-first": "mine_first.strategy:MineFirst"}


@pytest.mark.parametrize("layer", LAYERS)
def test_the_example_of_a_new_project_delivers_all_orders(
    layer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"example-{layer.replace('_', '-')}"
    module = name.replace("-", "_")
    write_project(name, layer, False, tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path / name / "src"))
    example = LAYERS[layer].example_run(layer, name)
    assert example in (tmp_path / name / "README.md").read_text()
    kind = "".join(part.capitalize() for part in name.split("-"))
    pairs = [part.split("=") for part in example.split(" --set ")[1:-1]]
    settings: dict[str, Any] = {key: yaml.safe_load(value) for key, value in pairs}
    strategies = {layer: f"{module}.strategy:{kind}"}
    outcome = automaton.simulate(example.split()[2], strategies=strategies, **settings)
    assert outcome.finished
    assert layer != "charging" or outcome.metrics["battery_depletions"] == 0


@pytest.mark.parametrize(
    ("name", "said"),
    [("Mine", "lower-case"), ("json", "module of Python"), ("pibt", "right of way")],
)
def test_a_name_that_is_taken_writes_nothing(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        write_project(name, "allocation", False, tmp_path)
    assert list(tmp_path.iterdir()) == []
