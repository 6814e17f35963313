"""--format and a file: an answer in five formats, each written as a whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import openpyxl
import pytest
from doc_commands import in_this_process
from sweep_studies import small_study

from automaton.commands import main

COMMANDS = {
    "run": ("run tabletop-mini --until 300", "--out"),
    "size": (
        "size tabletop-mini --target makespan<=3000 --robots 1..3 --workers 1 --budget 200",
        "--report",
    ),
    "reproduce": ("reproduce tabletop --seeds 1 --strategies independent --workers 1", "--out"),
    "sweep": ("sweep {study} --out {folder}/results --workers 1", "--report"),
}
BEGINS = {".md": "", ".html": "<!doctype html>", ".txt": "", ".json": "{"}


@pytest.fixture(scope="module", autouse=True)
def quickly(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with in_this_process(tmp_path_factory.mktemp("work")):
        yield


@pytest.mark.parametrize("name", COMMANDS)
def test_an_answer_has_five_formats(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, option = COMMANDS[name]
    command = text.format(study=small_study(tmp_path, 1), folder=tmp_path).split()
    main(command)
    word = capsys.readouterr().out.split()[0].rstrip(":,")
    for suffix, begin in BEGINS.items():
        file = tmp_path / f"answer{suffix}"
        assert main([*command, option, str(file)]) in (0, 1)
        told = capsys.readouterr()
        assert told.out == "" and f"automaton: wrote {file}\n" in told.err
        written = file.read_text(encoding="utf-8")
        assert written.startswith(begin) and (word in written or suffix == ".json")
    main([*command, "--format", "json"])
    assert json.loads(capsys.readouterr().out).keys() == json.loads(written).keys()
    book = tmp_path / "answer.xlsx"
    assert main([*command, option, str(book)]) in (0, 1)
    sheet = openpyxl.load_workbook(book)["report"]
    cells = [cell for row in sheet.iter_rows(values_only=True) for cell in row]
    assert any(word in str(cell) for cell in cells)
    assert not list(tmp_path.glob(".*.part"))


def test_a_workbook_has_numbers(tmp_path: Path) -> None:
    book = tmp_path / "run.xlsx"
    main(["run", "tabletop-mini", "--out", str(book)])
    rows = list(openpyxl.load_workbook(book)["report"].iter_rows(values_only=True))
    values = {row[0]: row[1] for row in rows if row}
    assert values["makespan"] == 1474 and isinstance(values["throughput"], float)


def test_pictures_and_events_are_part_of_the_answer(tmp_path: Path) -> None:
    page = tmp_path / "run.md"
    main(["run", "tabletop-mini", "--until", "20", "--picture", "--events", "--out", str(page)])
    written = page.read_text(encoding="utf-8")
    assert written.count("```") == 4 and written.index("tick ") < written.index("| metric |")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--format", "xlsx"], "--format xlsx: needs --out FILE"),
        (["--out", "run.yaml"], "--out run.yaml: no format has this extension (known: .md, "),
        (["--out", "no/such/run.html"], "no/such/run.html: cannot write it: there is no folder"),
        (["--out", "."], "--out .: no format has this extension"),
        (["--format", "html", "--out", "."], ".: cannot write it: this is not a regular file"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_run(
    options: list[str],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "tabletop-mini", "--record", "a.rec", *options]) == 2
    told = capsys.readouterr()
    assert told.out == "" and sentence in told.err and told.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_scenario_is_not_replaced_by_a_workbook(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "scenario.yaml"
    file.write_text("name: mine\n")
    command = ["run", "tabletop-mini", "--format", "xlsx", "--out", str(file)]
    assert main(command) == 2 and file.read_text() == "name: mine\n"
    assert "is not overwritten" in capsys.readouterr().err
    assert main(["run", "tabletop-mini", "--json", "--format", "text"]) == 2
