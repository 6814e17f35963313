"""An archive of results: whole, checked by its digests, and repeated elsewhere with the same results."""

from __future__ import annotations

import json
import os
import shutil
import sys
import zipfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sweep_studies import OwnThread, row_files, swept_here

from automaton.commands import main
from automaton.strategy import lookup
from automaton.studies.sweeps import pools, sweep_plan
from automaton.studies.sweeps.result_store import content_name, read_rows

STUDY = """name: sent
scenario: site.yaml
replications: 2
factors: {fleet.robots: [1, 2]}
"""
SCENARIO = """name: site
layout: {file: floor.txt}
fleet: {robots: 1}
orders: {generator: picture-loads}
strategy: {allocation: 'sent_plug_in:Own'}
stop: {when: delivered, max_duration: 500}
"""
PLUG_IN = """from automaton.strategy.contract import Strategy


class Own(Strategy):
    layer = "allocation"

    def decide(self, view, batch, decisions, memory, workspace):
        decisions.allocation.command[: batch.count] = 0
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A results folder with a strategy of its own, without the files it was made from."""
    home = tmp_path_factory.mktemp("sent")
    for file, text in {
        "sent.yaml": STUDY,
        "site.yaml": SCENARIO,
        "floor.txt": "b.$.d\nb....\n#....\n",
        "sent_plug_in.py": PLUG_IN,
    }.items():
        (home / file).write_text(text)
    swept_here(home / "sent.yaml", home / "results")
    for file in ("sent.yaml", "site.yaml", "floor.txt", "sent_plug_in.py"):
        (home / file).unlink()
    return home / "results"


@pytest.fixture(autouse=True)
def runs_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """No processes are started."""
    monkeypatch.setattr(pools, "LocalPool", OwnThread)


def copied(results: Path, folder: Path) -> Path:
    """A copy of the results that may be changed."""
    return Path(shutil.copytree(results, folder / "results"))


def asked(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command in a process that has imported no plug-in yet."""
    pools._plugin.cache_clear()
    sys.modules.pop("sent_plug_in", None)
    sys.path[:] = [one for one in sys.path if not Path(one, "sent_plug_in.py").exists()]
    lookup._plugins.cache_clear()
    capsys.readouterr()
    code = main([str(one) for one in arguments])
    return code, *capsys.readouterr()


def without(archive: Path, left_out: str, changed: str = "") -> Path:
    """A copy of an archive that lacks a file, or has another content of one."""
    path = archive.with_name("other.zip")
    with zipfile.ZipFile(archive) as before, zipfile.ZipFile(path, "w") as after:
        for name in before.namelist():
            if name != left_out:
                after.writestr(name, before.read(name) + b"#" * (name == changed))
    return path


def test_an_archive_is_run_again_elsewhere_with_equal_results(
    results: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    one, other = tmp_path / "one.zip", tmp_path / "other" / "one.zip"
    other.parent.mkdir()
    assert asked(capsys, "report", results, "--archive", one)[0] == 0
    assert asked(capsys, "report", results, "--archive", other)[0] == 0
    with zipfile.ZipFile(one) as archive:
        names, readme = archive.namelist(), archive.read("README.md").decode()
        listed = json.loads(archive.read("archive.json"))
    assert {"results/site.yaml", "results/floor.txt", "results/sent_plug_in.py"} < set(names)
    assert sorted([*listed["files"], "archive.json"]) == names
    assert {"python", "fleet-automaton", "numpy", "numba"} <= set(listed["versions"])
    assert "automaton verify one.zip\n" in readme and "4 runs of 2 points" in readme
    assert "executes the\nstrategies that the archive holds" in readme
    assert one.read_bytes() == other.read_bytes()
    hidden = results.with_name("hidden")
    results.rename(hidden)
    monkeypatch.chdir(tmp_path)
    code, out, err = asked(capsys, "verify", "one.zip")
    assert (code, err) == (0, "")
    assert out == "one.zip: verified: sent, 4 runs done again\nall results are equal\n"
    hidden.rename(results)


def swept_plug_in(folder: Path) -> Path:
    """The archive of a study whose strategy has an entry point in a folder that is then removed."""
    project = folder / "project"
    info = project / "sent_plug_in-2.dist-info"
    info.mkdir(parents=True)
    (project / "sent_plug_in.py").write_text(PLUG_IN)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: sent-plug-in\nVersion: 2\n")
    points = "[automaton.strategies]\nallocation.sent-own = sent_plug_in:Own\n"
    (info / "entry_points.txt").write_text(points)
    (folder / "sent.yaml").write_text(STUDY)
    (folder / "site.yaml").write_text(SCENARIO.replace("sent_plug_in:Own", "sent-own"))
    (folder / "floor.txt").write_text("b.$.d\nb....\n#....\n")
    pools._plugin.cache_clear()
    sys.modules.pop("sent_plug_in", None)
    lookup.look_in(str(project))
    results, archive = folder / "results", folder / "one.zip"
    assert main(["sweep", str(folder / "sent.yaml"), "--out", str(results)]) == 0
    assert main(["report", str(results), "--archive", str(archive)]) == 0
    for one in (project, results):
        shutil.rmtree(one)
        sys.path[:] = [other for other in sys.path if other != str(one)]
    return archive


def test_an_archive_holds_the_strategy_of_an_entry_point(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    archive = swept_plug_in(tmp_path)
    code, out, err = asked(capsys, "verify", archive)
    assert (code, err) == (0, "") and "all results are equal" in out


def test_the_package_of_a_strategy_that_is_not_installed_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep_plan, "is_installed", lambda root: root.name == "project")
    archive = swept_plug_in(tmp_path)
    code, _, err = asked(capsys, "verify", archive)
    assert code == 2 and "'sent-own' is unknown" in err
    assert err.endswith("that are not installed here: pip install sent-plug-in==2\n")


def test_a_result_that_differs_is_named(
    results: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = copied(results, tmp_path)
    monkeypatch.chdir(tmp_path)
    (path,) = row_files(folder)
    table = read_rows(path)
    ticks = [1, *table.column("ticks").to_pylist()[1:]]
    at = table.schema.get_field_index("ticks")
    table = table.set_column(at, table.schema.field(at), pa.array(ticks, pa.int64()))
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, write_page_checksum=True)
    content = sink.getvalue().to_pybytes()
    path.unlink()
    (path.parent / content_name(content, "rows-000009")).write_bytes(content)
    code, out, _ = asked(capsys, "verify", "results")
    assert (
        code == 1 and "results: not verified: sent, 4 runs done again\n1 of 4 runs differ\n" in out
    )
    assert "point 0 (site.yaml, fleet.robots 1), replication 0: ticks was 1, done again" in out
    code, out, _ = asked(capsys, "verify", "results", "--json")
    told = json.loads(out)
    assert code == 1 and not told["verified"] and len(told["differences"]) == 1


@pytest.mark.parametrize(
    ("left_out", "changed", "said"),
    [
        ("results/floor.txt", "", "lacks results/floor.txt, which its archive.json lists"),
        ("", "results/site.yaml", "is damaged: results/site.yaml has changed"),
        ("archive.json", "", "is not an archive of results: it lacks archive.json"),
    ],
)
def test_an_archive_that_is_not_whole_is_refused_in_a_sentence(
    results: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    left_out: str,
    changed: str,
    said: str,
) -> None:
    assert asked(capsys, "report", results, "--archive", tmp_path / "one.zip")[0] == 0
    other = without(tmp_path / "one.zip", left_out, changed)
    code, out, err = asked(capsys, "verify", other)
    assert (code, out, err) == (2, "", f"automaton: {other}: {said}\n")
    other.write_bytes(other.read_bytes()[:200])
    code, out, err = asked(capsys, "verify", other)
    assert code == 2 and "is not an archive of results: " in err and err.count("\n") == 1


def test_a_flipped_byte_in_an_archive_is_named_as_damage(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Inside compressed data, where the archive's own list of files is still whole."""
    path = tmp_path / "one.zip"
    assert asked(capsys, "report", results, "--archive", path)[0] == 0
    with zipfile.ZipFile(path) as archive:
        entry = archive.getinfo("results/sweep.json")
    content, begin = path.read_bytes(), entry.header_offset + 30 + len(entry.filename)
    for place in range(begin, begin + min(entry.compress_size, 40)):
        path.write_bytes(content[:place] + bytes([content[place] ^ 255]) + content[place + 1 :])
        code, out, err = asked(capsys, "verify", path)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert err.startswith(f"automaton: {path}: is "), err


def test_a_folder_without_runs_is_not_run_to_compare_nothing(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(results, tmp_path)
    for path in row_files(folder):
        path.unlink()
    code, out, err = asked(capsys, "verify", folder)
    assert (code, out) == (2, "")
    assert err == f"automaton: {folder}: holds no runs to compare with; sweep it first\n"


def test_a_folder_that_lacks_a_file_is_not_archived(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for file, said in (
        ("floor.txt", "there is no floor file 'floor.txt'"),
        ("sent_plug_in.py", "cannot import 'sent_plug_in'"),
        ("study.yaml", "lacks study.yaml"),
    ):
        folder = copied(results, tmp_path / file)
        (folder / file).unlink()
        code, _, err = asked(capsys, "report", folder, "--archive", tmp_path / "one.zip")
        assert code == 2 and said in err and err.count("\n") == 1
        assert not os.path.exists(tmp_path / "one.zip")
    folder = copied(results, tmp_path / "changed")
    with (folder / "sent_plug_in.py").open("a") as file:
        file.write("# changed\n")
    code, _, err = asked(capsys, "verify", folder)
    said = f"automaton: {folder}: has other strategies than its runs: sent_plug_in.py changed\n"
    assert (code, err) == (2, said)
