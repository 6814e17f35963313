"""A folder of results: whole files, one writer, nothing damaged taken for a result."""

from __future__ import annotations

import errno
import fcntl
import os
import random
import subprocess
import sys
import threading
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from sweep_studies import environment, plain, row_files, small_study, swept_here

from automaton.atomic_write import atomic_writer
from automaton.errors import InputError
from automaton.studies.sweeps import result_store, sweep_session
from automaton.studies.sweeps.pools import ExternalExecutor
from automaton.studies.sweeps.result_store import (
    DamagedFileError,
    Store,
    Writer,
    lock_folder,
    read_rows,
)
from automaton.studies.sweeps.run_keys import Row, SweepRun
from automaton.studies.sweeps.sweep_plan import SweepPlan, make_sweep_plan


def made_up(run: SweepRun) -> Row:
    """A row that no run has given."""
    digest = f"{run.seed % 2**64:016x}"
    metrics = {"makespan": run.seed % 997 / 7}
    figures = {"ticks": run.seed % 997, "orders": 25, "delivered": 25, "digest": digest}
    times = {"wall_s": 0.01, "cpu_s": 0.01}
    return {
        **run._asdict(),
        "finished": True,
        "error": None,
        **figures,
        **times,
        "metrics": metrics,
    }


def declared(folder: Path, replications: int = 50) -> tuple[SweepPlan, Store]:
    """A folder for the small study, without rows."""
    plan = make_sweep_plan(small_study(folder, replications))
    out = folder / "out"
    (out / "rows").mkdir(parents=True)
    return plan, sweep_session.open_results(out, plan)[0]


def filled(folder: Path, batch: int = 20) -> tuple[SweepPlan, Store]:
    """A folder with made-up rows of 200 runs, in files of so many rows."""
    plan, store = declared(folder)
    writer = Writer(store)
    for number, run in enumerate(plan.manifest.runs(), 1):
        writer.hold([made_up(run)])
        writer.tick()
        if number % batch == 0:
            writer.flush()
    return plan, store


def test_rows_come_in_the_order_of_points_and_replications(tmp_path: Path) -> None:
    plan, store = filled(tmp_path)
    rows = store.rows().to_pylist()
    order = [(row["point"], row["replication"]) for row in rows]
    assert order == [(point, r) for point in range(4) for r in range(50)]
    assert store.keys() == plan.manifest.keys() == {row["key"] for row in rows}
    assert [row["fleet.robots"] for row in rows[::50]] == [1, 1, 2, 2]
    assert store.study == plan.study


def test_a_reader_between_two_writes_has_the_study_that_its_manifest_has(tmp_path: Path) -> None:
    plan, store = filled(tmp_path)
    (store.folder / "study.yaml").write_text("name: the next one")
    read = Store(store.folder)
    assert read.study == plan.study and read.rows().num_rows == 200
    (store.folder / "sweep.json").write_text('{"format": 1}')
    with pytest.raises(InputError, match="is of format 1, not 5: use another folder"):
        Store(store.folder)


@pytest.mark.parametrize("part", ["[1, 2]", "replications", "fingerprint", "checksum", "tabletop"])
def test_a_damaged_manifest_is_refused(part: str, tmp_path: Path) -> None:
    study, out = small_study(tmp_path, 1), tmp_path / "out"
    rows = swept_here(study, out)
    manifest = out / "sweep.json"
    content = bytearray(manifest.read_bytes())
    content[content.index(part.encode()) + 4] ^= 4
    manifest.write_bytes(content)
    with pytest.raises(InputError, match=r"sweep\.json: (is damaged|cannot be read: )"):
        Store(out)
    manifest.unlink()
    assert swept_here(study, out).equals(rows)


def test_files_are_merged_and_no_row_is_there_twice(tmp_path: Path) -> None:
    _, store = filled(tmp_path)
    before, files = store.rows(), row_files(store.folder)
    assert len(files) == 10
    kept = {path: path.read_bytes() for path in files[:3]}
    writer = Writer(store)
    writer.merge()
    assert len(row_files(store.folder)) == 1
    for path, content in kept.items():  # as if the sweep had been killed while it took them away
        path.write_bytes(content)
    assert store.rows().equals(before)
    writer.merge()
    (only,) = row_files(store.folder)
    assert store.rows().equals(before) and pq.read_metadata(only).num_rows == 200


def test_many_small_files_are_merged_on_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(result_store, "MANY_FILES", 7)
    _, store = filled(tmp_path)
    assert len(row_files(store.folder)) == 1 + 3
    assert store.rows().num_rows == 200


def test_rows_are_written_when_they_are_many_or_old(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, store = declared(tmp_path, 200)
    monkeypatch.setattr(result_store, "BATCH_S", 1e9)
    writer = Writer(store)
    for run in plan.manifest.runs():
        writer.hold([made_up(run)])
        writer.tick()
    assert [pq.read_metadata(path).num_rows for path in row_files(store.folder)] == [500]
    monkeypatch.setattr(result_store, "BATCH_S", 0.0)
    writer.tick()
    assert store.rows().num_rows == 800


@pytest.mark.parametrize("seed", range(4))
def test_no_damage_goes_unnoticed(seed: int, tmp_path: Path) -> None:
    _, store = filled(tmp_path, batch=200)
    (path,) = row_files(store.folder)
    good, draw = path.read_bytes(), random.Random(seed)
    for _ in range(100):
        bad = bytearray(good)
        for _ in range(draw.choice((1, 1, 3))):
            bad[draw.randrange(len(bad))] ^= 1 << draw.randrange(8)
        path.write_bytes(bytes(bad[: draw.choice((len(bad), draw.randrange(len(bad))))]))
        if path.read_bytes() != good:
            with pytest.raises(DamagedFileError):
                read_rows(path)
    path.write_bytes(good)
    assert read_rows(path).num_rows == 200


def test_other_readers_notice_damaged_pages_too(tmp_path: Path) -> None:
    """Files carry the checksums of Parquet, whoever reads them."""
    _, store = filled(tmp_path, batch=200)
    (path,) = row_files(store.folder)
    page = pq.read_metadata(path).row_group(0).column(5).data_page_offset  # the seeds
    content = bytearray(path.read_bytes())
    content[page + 200] ^= 1
    path.write_bytes(bytes(content))
    with pytest.raises(OSError, match="CRC"):
        pq.read_table(path, page_checksum_verification=True)


def test_damaged_files_are_set_aside_and_their_runs_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(result_store, "BATCH_ROWS", 8)
    monkeypatch.setattr(sweep_session, "MAX_SWEEP_CHUNK", 2)
    monkeypatch.setattr(result_store.Writer, "merge", lambda self, only_small=False: None)
    study, out = small_study(tmp_path), tmp_path / "out"
    expected = plain(swept_here(study, out))
    cut, flipped, _ = row_files(out)
    cut.write_bytes(cut.read_bytes()[:-100])
    content = bytearray(flipped.read_bytes())
    content[len(content) // 2] ^= 4
    flipped.write_bytes(bytes(content))
    assert Store(out).rows().num_rows == 8  # a reader leaves them out
    assert plain(swept_here(study, out)) == expected
    assert sorted(path.name for path in (out / "rows").glob("*.bad")) == sorted(
        path.with_suffix(".bad").name for path in (cut, flipped)
    )
    assert not cut.exists()


def damaging(out: Path, times: int) -> Callable[[list[Row]], None]:
    """Flips a bit in a file of rows, so many times, while a sweep goes on."""
    hit: list[Path] = []

    def flip(rows: list[Row]) -> None:
        for path in set(row_files(out)) - set(hit):
            if len(hit) < times:
                content = bytearray(path.read_bytes())
                content[len(content) // 2] ^= 1
                path.write_bytes(bytes(content))
                hit.append(path)

    return flip


def test_files_that_are_damaged_while_a_sweep_goes_on_are_noticed_at_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(result_store, "BATCH_ROWS", 2)
    monkeypatch.setattr(sweep_session, "MAX_SWEEP_CHUNK", 2)
    plan, out = make_sweep_plan(small_study(tmp_path)), tmp_path / "out"
    expected = plain(swept_here(small_study(tmp_path)))
    with ThreadPoolExecutor(1) as executor:
        backend, heard = ExternalExecutor(executor), []
        swept = sweep_session.sweep_into(
            out, plan, lambda: backend, on_begun=heard.append, on_rows=damaging(out, times=1)
        )
        assert plain(swept.store.rows()) == expected and swept.tally.done == 26
        assert [(begun.done, len(begun.aside)) for begun in heard] == [(0, 0), (22, 1)]
        with pytest.raises(InputError, match=r"lacks .* of 24 because files of rows were damaged"):
            sweep_session.sweep_into(
                tmp_path / "bad", plan, lambda: backend, on_rows=damaging(tmp_path / "bad", 99)
            )


def test_a_full_disk_is_told_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, out = small_study(tmp_path), tmp_path / "out"
    expected = plain(swept_here(study))
    monkeypatch.setattr(result_store, "BATCH_ROWS", 4)
    monkeypatch.setattr(sweep_session, "MAX_SWEEP_CHUNK", 2)
    full = fill_the_disk(monkeypatch, after=2)
    with pytest.raises(InputError, match="no space left on device; all finished runs are saved"):
        swept_here(study, out)
    assert full and Store(out).rows().num_rows >= 12
    assert not list(out.rglob("*.writing")) and not (out / "rows" / ".reserve").exists()
    full.clear()
    assert plain(swept_here(study, out)) == expected


def test_the_room_that_is_kept_is_really_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file system that compresses keeps no room for zeros, and none for what is not synced."""
    synced, real = [], os.fsync
    monkeypatch.setattr(
        os, "fsync", lambda file: (synced.append(os.fstat(file).st_size), real(file))
    )
    _, store = declared(tmp_path)
    Writer(store)
    content = (store.folder / "rows" / ".reserve").read_bytes()
    assert len(content) == result_store.RESERVE_BYTES in synced
    assert len(zlib.compress(content, 1)) > 0.99 * len(content)


def fill_the_disk(monkeypatch: pytest.MonkeyPatch, after: int) -> list[bool]:
    """Have files of rows fail for want of room, unless the reserve has been given back."""
    full = [True]
    real, written = result_store.write_atomically, []

    def write(path: Path, content: bytes) -> None:
        if path.suffix == ".parquet":
            written.append(path)
            if full and len(written) > after and (path.parent / ".reserve").exists():
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(path, content)

    monkeypatch.setattr(result_store, "write_atomically", write)
    return full


def test_where_nothing_can_be_written_it_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot write results: not a directory"):
        swept_here(small_study(tmp_path), tmp_path / "file" / "out")
    with pytest.raises(InputError, match="no such folder"):
        Store(tmp_path / "nothing")
    with pytest.raises(InputError, match="holds no results of a sweep"):
        Store(tmp_path)


@pytest.mark.parametrize("value", [2**53 + 1, "many"])
def test_a_row_that_cannot_be_written_has_failed_and_the_others_are_kept(
    value: object, tmp_path: Path
) -> None:
    plan, store = declared(tmp_path)
    writer = Writer(store)
    rows = [made_up(run) for run in plan.manifest.runs()]
    rows[3]["metrics"] = {"makespan": value}
    writer.hold(rows)
    writer.close()
    assert len(store.keys()) == 200 and store.failed() == {rows[3]["key"]}
    (why,) = (why for why in store.rows().column("error").to_pylist() if why)
    assert why.startswith("its row cannot be written: ")


@pytest.mark.parametrize(
    ("place", "call", "code", "said"),
    [
        (fcntl, "flock", errno.ENOLCK, "out: cannot write results: no locks available"),
        (Path, "unlink", errno.EROFS, "out: cannot write results: read-only file system"),
        (os, "replace", errno.EACCES, r"\.bad: cannot write results: permission denied"),
        (Path, "read_bytes", errno.EIO, "cannot be read: input/output error"),
    ],
)
def test_what_the_disk_refuses_is_told_in_one_sentence(
    place: Any, call: str, code: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, store = filled(tmp_path, batch=200)
    (store.folder / "rows" / "left.writing").touch()
    (path,) = row_files(store.folder)
    path.write_bytes(path.read_bytes()[1:])
    real = getattr(place, call)

    kind = ".writing" if call == "unlink" else ".parquet"

    def refuse(*arguments: Any, **options: Any) -> Any:
        if call == "flock" or Path(arguments[0]).suffix == kind:
            raise OSError(code, os.strerror(code))
        return real(*arguments, **options)

    monkeypatch.setattr(place, call, refuse)
    with pytest.raises(InputError, match=f"(?i){said}"):
        sweep_session.sweep_into(store.folder, plan, lambda: pytest.fail("nothing is to be done"))


def test_a_file_on_a_read_only_file_system_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: Any, **options: Any) -> Any:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(Path, "open", refuse)
    monkeypatch.setattr(Path, "unlink", refuse)
    said = r"r\.html: cannot write it: Read-only file system"
    with pytest.raises(InputError, match=said), atomic_writer(tmp_path / "r.html"):
        pass


def test_rows_are_read_by_the_thread_that_asks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    let_go_by: set[int] = set()

    class Content(bytes):
        def __del__(self) -> None:
            let_go_by.add(threading.get_ident())

    _, store = filled(tmp_path, batch=200)
    real = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: Content(real(path)))
    for _ in range(400):
        assert len(store.keys()) == 200
    assert store.rows().num_rows == 200
    assert let_go_by == {threading.get_ident()}  # another one would abort a process that ends


def test_one_sweep_writes_to_a_folder_at_a_time(tmp_path: Path) -> None:
    study, out = small_study(tmp_path), tmp_path / "out"
    with lock_folder(out):
        command = [sys.executable, "-m", "automaton", "sweep", str(study), "--out", str(out)]
        done = subprocess.run(command, capture_output=True, text=True, env=environment())
    assert done.returncode == 2
    assert f"another sweep writes to this folder (process {os.getpid()} on " in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_reader_follows_files_that_are_merged_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, store = filled(tmp_path)
    expected = store.rows()
    real, merged = read_rows, []

    def read(path: Path, columns: Any = None) -> pa.Table:
        if not merged:
            merged.append(True)
            Writer(store).merge()
        return real(path, columns)

    monkeypatch.setattr("automaton.studies.sweeps.result_store.read_rows", read)
    assert store.rows().equals(expected)
