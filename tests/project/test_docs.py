"""README and docs: pages, links, and every command and snippet in them."""

from __future__ import annotations

import ast
import json
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from doc_commands import (
    NEEDS_TORCH,
    ONLY_READ,
    carry_out,
    commands_of,
    compare,
    in_this_process,
    parse,
    parser_of,
    write_files,
)
from docs_pages import AT_THE_ROOT, ROOT, Page, page, pages

from automaton.commands import COMMANDS
from automaton.engine import loop
from automaton.runs.simulation import Simulation
from automaton.strategy.lookup import names, parameters_type
from automaton.studies.sweeps.sweep_plan import check_study
from automaton.world.resolve import resolve

LANGUAGES = {"sh", "console", "yaml", "csv", "python", "text", "mermaid"}
WITH_COMMANDS = [
    one for one in pages() if any(block.language in ("sh", "console") for block in one.blocks)
]
FOR_DEVELOPERS = [
    page(f"docs/how-to/add-a-{thing}.md")
    for thing in ("cell-kind", "metric", "map-layer", "strategy")
]


def test_the_readme_is_short() -> None:
    assert len(page("README.md").text.splitlines()) <= 150


@pytest.mark.parametrize("name", ["README.md", "docs/explanation/trust.md"])
def test_the_wait_that_a_page_asks_about_is_one(name: str, tmp_path: Path) -> None:
    """In the recording that the page makes; the same recording is verified and branched off."""
    of_recording = r"`automaton ((?:run tabletop-1 --record|verify|explain|branch) [^`]+)`"
    with in_this_process(tmp_path):
        printed = {
            command.split()[0]: carry_out(f"automaton {command}", tmp_path)
            for command in re.findall(of_recording, page(name).prose)
        }
    assert "robot 1 has been waiting for" in printed["explain"]
    assert "the runs differ first at tick" in printed["branch"]


def test_every_page_is_in_the_index() -> None:
    index = page("docs/index.md")
    linked = {f"docs/{link.partition('#')[0]}" for link in index.links}
    assert {one.name for one in pages()} - {*AT_THE_ROOT, "docs/index.md"} <= linked


def test_the_site_has_every_page_once() -> None:
    project = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]
    parts = [part for section in project["nav"] for part in section.values()]
    paths = [path for part in parts for path in ([part] if isinstance(part, str) else part)]
    of_docs = [one.name for one in pages() if one.name.startswith("docs/")]
    assert sorted(f"docs/{path}" for path in paths) == sorted(of_docs)


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    shutil.copy(ROOT / "zensical.toml", tmp_path)
    command = [Path(sys.executable).with_name("zensical"), "build", "--strict"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "site/index.html").exists()


@pytest.mark.parametrize("one", pages(), ids=lambda one: one.name)
def test_links_lead_somewhere(one: Page) -> None:
    by_path = {(ROOT / other.name).resolve(): other for other in pages()}
    for link in one.links:
        target, _, name = link.partition("#")
        path = (ROOT / one.name).parent.joinpath(target).resolve() if target else ROOT / one.name
        assert path.exists(), f"{one.name}: {link}"
        if name:
            assert name in by_path[path].anchors, f"{one.name}: {link}"


@pytest.mark.parametrize("one", pages(), ids=lambda one: one.name)
def test_blocks_are_closed_and_of_a_known_language(one: Page) -> None:
    assert one.text.count("\n```") == 2 * len(one.blocks)
    assert {block.language for block in one.blocks} <= LANGUAGES


@pytest.mark.parametrize("one", WITH_COMMANDS, ids=lambda one: one.name)
def test_the_commands_of_a_page_run(one: Page, tmp_path: Path) -> None:
    write_files(one, tmp_path)
    with in_this_process(tmp_path):
        for block in one.blocks:
            if "#SBATCH" in block.text:
                continue  # test_sweep_cluster runs it
            for line, shown in commands_of(block) if block.language in ("sh", "console") else ():
                printed = carry_out(line, tmp_path, bool(shown))
                if shown:
                    compare(shown, printed)
        for block in one.blocks:
            if "__main__" in block.text and NEEDS_TORCH not in block.text:
                runpy.run_path(block.title, run_name="__main__")
            elif block.language == "python" and not block.title and one not in FOR_DEVELOPERS:
                exec(block.text, {})


@pytest.mark.parametrize("one", pages(), ids=lambda one: one.name)
def test_commands_within_the_text_take_their_arguments(one: Page) -> None:
    shown = "\n".join(block.text for block in one.blocks if block.language == "text")
    commands = re.findall(r"(?<!`)`automaton\s+([^`]+)`", one.prose)
    commands += re.findall(r"^\s*automaton (.+)$", shown, re.MULTILINE)
    for command in commands:
        if command.startswith(("--", "COMMAND")) or "..." in command:
            continue
        words = shlex.split(command)
        assert words[0] in COMMANDS, command
        if len(words) > 1 and not {"SCENARIO", "FILE", "DIR", "STUDY"} & set(words):
            parse(words)


@pytest.mark.parametrize("one", pages(), ids=lambda one: one.name)
def test_files_that_a_page_names_exist(one: Page) -> None:
    named = r"(?<![\w./-])((?:automaton|strategies|layouts|tui|tests|docs)/[\w*./-]*\w)"
    assert [path for path in re.findall(named, one.text) if not list(ROOT.glob(path))] == []


def test_pages_that_the_sources_name_exist() -> None:
    """In docstrings, comments and messages."""
    sources = [
        path
        for top in ("automaton", "strategies", "layouts", "tui")
        for path in (ROOT / top).rglob("*.py")
    ]
    texts = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    named = set(re.findall(r"\bdocs/[\w/-]+\.md\b", texts))
    assert named and {name for name in named if not (ROOT / name).exists()} == set()


def test_the_changelog_names_every_command() -> None:
    named = set(re.findall(r"`([\w-]+)`", page("CHANGELOG.md").text))
    assert set(COMMANDS) - named == {"reproduce"}  # it names the reproductions


@pytest.mark.parametrize("one", FOR_DEVELOPERS, ids=lambda one: one.name)
def test_names_in_pages_for_developers_exist_in_the_files_beside_them(one: Page) -> None:
    """In each list item, row and paragraph: tables of constants and functions, `SUMS`, `counted()`."""
    for part in re.split(r"\n\n|\n(?=\d+\. |\|)", one.prose):
        paths = [path for text in re.findall(r"`([\w/]+\.py)`", part) for path in ROOT.glob(text)]
        text = "\n".join(path.read_text(encoding="utf-8") for path in paths)
        for name, function in re.findall(r"`(?:([A-Z][A-Z_0-9]+)|(\w+)\(\))`", part):
            declared = rf"^{name}\b.* = " if name else rf"^def {function}\("
            assert re.search(declared, text, re.MULTILINE), f"{name or function}: {part}"


def test_commands_that_are_only_read_are_run_by_other_tests() -> None:
    for test in ONLY_READ.values():
        assert list((ROOT / "tests").rglob(f"{test}.py")), test


def test_the_picture_test_of_the_page_draws_its_floor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_files(page("docs/how-to/test-with-pictures.md"), tmp_path)
    asked: list[int] = []
    module = runpy.run_path("test_my_floor.py")
    module["test_my_floor"](lambda simulation: asked.append(simulation.tick))
    assert len(asked) == 1


def test_the_layer_of_the_page_has_a_number_for_each_cell() -> None:
    (block,) = (
        one for one in page("docs/how-to/add-a-map-layer.md").blocks if one.language == "python"
    )
    names: dict[str, Any] = {}
    exec(block.text, names)
    run = Simulation(resolve("tabletop-1"), on_observe=Simulation.empty_observation)
    run.run(until=700)
    grains = names["Dust"]().numbers(run, 0)
    assert grains.shape == run.world.grid.kind.shape and grains.any()


def test_the_study_of_the_tutorial_has_its_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_files(page("docs/tutorials/your-own-floor.md"), tmp_path)
    study, scenarios = check_study("my-fleet.yaml")
    assert len(scenarios) == 4 * 2 and study.scenario == "my-floor.yaml"


def test_the_compiled_strategy_of_the_tutorial_decides_as_the_one_in_python(tmp_path: Path) -> None:
    write_files(page("docs/tutorials/your-own-strategy.md"), tmp_path)
    run = "automaton run tabletop-1 --json --set strategy.allocation="
    with in_this_process(tmp_path):
        python, kernel = (
            json.loads(carry_out(run + one, tmp_path)) for one in ("nearest:Nearest", "near:Near")
        )
    assert python["digest"] == kernel["digest"]
    assert kernel["metrics"]["orders_taken"] >= kernel["delivered"] > 0


def test_the_compiled_right_of_way_of_the_tutorial_decides_as_the_one_in_python(
    tmp_path: Path,
) -> None:
    write_files(page("docs/tutorials/your-own-right-of-way.md"), tmp_path)
    run = "automaton run random-400 --until 10 --json --set strategy.right_of_way="
    with in_this_process(tmp_path):
        python, kernel = (
            json.loads(carry_out(run + one, tmp_path)) for one in ("right:Right", "quick:Quick")
        )
    assert python["digest"] == kernel["digest"]
    assert kernel["metrics"]["illegal_answers"] == 0 < kernel["delivered"]


@pytest.mark.parametrize(
    "scenario",
    [
        "goods-mini",
        "tabletop-mini --set orders='{generator: tours, count: 20, stops: {from: 1, to: 3}}'",
    ],
)
def test_the_strategies_of_the_tutorial_know_pods_and_stops(tmp_path: Path, scenario: str) -> None:
    write_files(page("docs/tutorials/your-own-strategy.md"), tmp_path)
    with in_this_process(tmp_path):
        for name in ("mine:eager", "nearest:Nearest", "near:Near"):
            run = f"automaton run {scenario} --json --set strategy.allocation={name}"
            done = json.loads(carry_out(run, tmp_path))
            assert done["finished"] and done["metrics"]["illegal_answers"] == 0, name


def test_zones_of_ones_own_floor(tmp_path: Path) -> None:
    write_files(page("docs/how-to/divide-a-floor-into-zones.md"), tmp_path)
    with in_this_process(tmp_path):
        printed = carry_out("automaton run my-plant.yaml --picture", tmp_path)
    printed = " ".join(printed.split())
    assert "zone 1 (d): 1 2* 4; robot 0, " in printed and "60 of 60 orders delivered" in printed
    assert (
        resolve(str(tmp_path / "my-plant.yaml")).strategies["zoning"].parameters.design is not None
    )


def test_every_parameter_of_zoning_has_its_row() -> None:
    table = page("docs/reference/strategies.md").text
    for name in names("zoning"):
        for field in parameters_type("zoning", name).__struct_fields__:
            assert f"| `{field}` |" in table, (name, field)


def test_warnings_that_the_page_explains_are_printed() -> None:
    """Each phrase is a part of one string of the modules that warn."""
    files = [*(ROOT / "automaton/world").glob("*.py"), ROOT / "automaton/scenario/table_reader.py"]
    texts = [
        node.value
        for file in files
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]
    section = page("docs/how-to/troubleshooting.md").text.partition("## Warnings of check")[2]
    rows = re.findall(r"^\| (`[^|]+`) \| ", section, re.MULTILINE)
    phrases = [phrase for row in rows for phrase in re.findall(r"`([^`]+)`", row)]
    assert len(phrases) > 25
    assert [phrase for phrase in phrases if not any(phrase in text for text in texts)] == []


def test_exit_codes_stand_in_one_table() -> None:
    for code in (0, 1, 2, 130, 141, 143):
        assert f"\n| {code} | " in page("docs/reference/json.md").text
    assert sum("exit code of every command" in one.text for one in pages()) == 1


def test_every_command_with_json_has_its_row_of_keys() -> None:
    table = page("docs/reference/json.md").text.partition("## Keys of `run`")[0]
    rows = set(re.findall(r"^\| `([\w-]+)` \| ", table, re.MULTILINE))
    assert rows == {name for name in COMMANDS if "--json" in parser_of(name).format_help()}


def test_the_phases_of_a_tick_are_those_of_the_loop() -> None:
    def phases(text: str) -> list[str]:
        chain = re.search(r"^ *faults -> .*?observe$", text, re.MULTILINE | re.DOTALL)
        assert chain is not None
        return [phase.strip() for phase in chain.group().split("->")]

    tick = page("docs/explanation/tick.md")
    assert phases(tick.text) == phases(loop.__doc__ or "")
    assert re.findall(r"^\| ([a-z ]+) \| ", tick.text, re.MULTILINE)[1:] == phases(tick.text)


def test_the_page_on_json_names_the_keys_that_are_printed(tmp_path: Path) -> None:
    rows = dict(
        re.findall(r"^\| `([\w-]+)` \| (.+) \|$", page("docs/reference/json.md").text, re.M)
    )
    recorded = "run tabletop-mini --until 200 --record a.rec"
    study = {"name": "small", "scenario": "tabletop-mini", "points": [{}], "replications": 2}
    (tmp_path / "small.yaml").write_text(json.dumps(study))
    changes = [{"name": "fewer", "set": {"fleet.robots": 2}}]
    (tmp_path / "changes.yaml").write_text(json.dumps(changes))
    with in_this_process(tmp_path):
        carry_out("automaton run crossing --record b.rec --set units.cell=1m", tmp_path)
        carry_out("automaton export b.rec --vda5050 log.jsonl", tmp_path)
        for command in (
            recorded,
            "explain a.rec --robot 0 --at 100",
            "verify a.rec",
            "branch a.rec --at 100 --until 150",
            "list",
            "sweep small.yaml --out out",
            "report out",
            "what-if tabletop-mini changes.yaml --pairs 2",
            "compare crossing log.jsonl --runs 20 --workers 1 --set units.cell=1m",
            "log log.jsonl --floor crossing --out c.rec --set units.cell=1m",
            "bottlenecks tabletop-mini --most 1 --pairs 2,2",
            "size tabletop-mini --target makespan<=5000 --robots 2 --budget 70 --workers 1",
            "tune random-400 --budget 63 --workers 1 --set stop.max_duration=5 --set fleet.robots=20",
            "reproduce tabletop --seeds 1 --strategies cooperative --workers 1",
        ):
            printed = json.loads(carry_out(f"automaton {command} --json", tmp_path, True))
            named = re.findall(r"`(\w+)`", rows[command.split()[0]])
            assert set(printed) <= set(named), command
