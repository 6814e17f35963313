"""Rows on their way into a folder: a file at a time, whole or not at all, by one coordinator.

Rows are written when 500 have come together or one is a second old: at most those are lost when
the machine goes down, and their runs are done again. A file is written beside its place, synced,
and renamed; small files are merged as they become many, and at the end all into one.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pickle
import queue
import re
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator
from io import FileIO
from pathlib import Path
from typing import Any, Final, NamedTuple

from automaton.atomic_write import put_in_place, replacing
from automaton.errors import InputError
from automaton.studies.sweeps.pools import Backend, FutureLike
from automaton.studies.sweeps.result_store import (
    KEY_COLUMNS,
    ROWS_FOLDER,
    STUDY_FILE,
    DamagedFileError,
    Store,
    arrow,
    content_name,
    done_and_failed,
    file_digest,
    point_columns,
    read_rows,
)
from automaton.studies.sweeps.run_keys import (
    MANIFEST,
    CodeMismatchError,
    Manifest,
    Row,
    SweepChunk,
    SweepRun,
    blank,
    manifest_json,
    reason,
)
from automaton.studies.sweeps.study import RESULT_COLUMNS, SERIES_COLUMN, SUMS_COLUMN
from automaton.studies.sweeps.sweep_plan import Copies, SweepPlan
from automaton.units import count

BATCH_ROWS: Final = 500
BATCH_S: Final = 1.0
MANY_FILES: Final = 256  # small ones, that are then merged
MERGED_GROUP_ROWS: Final = 20_000  # of a merged file are held in memory
RESERVE: Final = ".reserve"
RESERVE_BYTES: Final = 4_000_000  # given back when the disk is full, for the rows in hand
LOCK_FILE: Final = ".lock"
UNFIT: Final = (ArithmeticError, TypeError, ValueError)  # of a value that its column cannot hold
PREFIX_PART, PREFIX_MERGED = "part", "rows"
FILE_NAME: Final = re.compile(r"(?:part|rows)-(\d+)-")


@contextlib.contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Hold a folder of results, made if it is not there. Raises InputError if another sweep does."""
    with _told(folder):
        (folder / ROWS_FOLDER).mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK_FILE).open("a+b", buffering=0)
    with file:
        with _told(folder):
            _claim(file, folder)
        yield


def _claim(file: FileIO, folder: Path) -> None:
    """Lock a folder by this file, which says who did; take away what a killed sweep has left."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.seek(0)
        who = file.read().decode(errors="replace").strip() or "another process"
        raise InputError(f"another sweep writes to it ({who})", str(folder)) from None
    file.truncate(0)
    file.write(f"process {os.getpid()} on {socket.gethostname()}".encode())
    for left in (*(folder / ROWS_FOLDER).glob("*.writing"), *folder.glob("*.writing")):
        left.unlink()


class Writer:
    """Takes rows and writes them; used by the one who holds the folder's lock."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self.folder = store.folder / ROWS_FOLDER
        self.schema = store.schema
        self.held: list[Row] = []
        self.since = 0.0
        numbers = (FILE_NAME.match(path.name) for path in self.folder.iterdir())
        self.number = max((int(match[1]) for match in numbers if match), default=0)
        self.small = len(list(self.folder.glob(f"{PREFIX_PART}-*.parquet")))
        with _told(self.folder):
            reserve = self.folder / RESERVE
            if not reserve.exists():
                write_atomically(reserve, os.urandom(RESERVE_BYTES))  # zeros may take no room

    def hold(self, rows: list[Row]) -> None:
        """Take rows; `tick` writes them when it is time, `flush` at once."""
        if not self.held:
            self.since = time.monotonic()
        self.held += rows

    def tick(self) -> None:
        """Write if it is time."""
        old = self.held and time.monotonic() - self.since >= BATCH_S
        if len(self.held) >= BATCH_ROWS or old:
            self.flush()

    def flush(self) -> None:
        """Write all rows in hand. Raises InputError, with the rows written if any way is left."""
        if not self.held:
            return
        try:
            self._write()
        except OSError as error:
            raise self._rescued(error) from error
        if self.small >= MANY_FILES:
            self.merge(only_small=True)

    def _write(self) -> None:
        pa = arrow()
        table = self._table()
        sink = pa.BufferOutputStream()
        pa.parquet.write_table(table, sink, compression="zstd", write_page_checksum=True)
        content = sink.getvalue().to_pybytes()
        self.number += 1
        place = self.folder / content_name(content, f"{PREFIX_PART}-{self.number:06d}")
        write_atomically(place, content)
        self.small += 1
        self.held.clear()

    def _table(self) -> Any:
        """The rows in hand; those that cannot be written have failed."""
        try:
            return table_of(self.held, self.store, self.schema)
        except UNFIT:
            self.held = [self._fit(row) for row in self.held]
            return table_of(self.held, self.store, self.schema)

    def _fit(self, row: Row) -> Row:
        try:
            table_of([row], self.store, self.schema)
        except UNFIT as error:
            run = SweepRun(*(row[name] for name in SweepRun._fields))
            return blank(run, reason(f"its row cannot be written: {error}"))
        return row

    def _rescued(self, error: OSError) -> InputError:
        """What to say when rows cannot be written, after giving back the room that was kept."""
        self.release()
        runs = count(len(self.held), "finished run")
        why = (error.strerror or str(error)).lower()
        try:
            self._write()
            end = "all finished runs are kept; the same command goes on when there is room"
        except OSError:
            self.held.clear()
            end = f"{runs} could not be kept and will be done again; all others are kept"
        return InputError(f"cannot write results: {why}; {end}", str(self.folder))

    def close(self) -> None:
        """Write what is in hand, and merge all files into one."""
        self.flush()
        self.merge()

    def release(self) -> None:
        """Give back the room that was kept."""
        with contextlib.suppress(OSError):  # what has gone wrong already is what is told
            (self.folder / RESERVE).unlink(missing_ok=True)

    def merge(self, only_small: bool = False) -> None:
        """Put files together, each run once. Files of other columns or that are damaged stay."""
        pattern = f"{PREFIX_PART}-*.parquet" if only_small else "*.parquet"
        paths = sorted(self.folder.glob(pattern))
        if len(paths) < 2 and not (paths and paths[0].name.startswith(PREFIX_PART)):
            return
        self.number += 1
        part = self.folder / f"{PREFIX_MERGED}-{self.number:06d}.writing"
        try:
            merged = self._merge_into(part, paths)
            if merged:
                place = self.folder / content_name(
                    file_digest(part), f"{PREFIX_MERGED}-{self.number:06d}"
                )
                put_in_place(part, place, durable=True)
        except OSError:
            return  # no room for a second copy: many files are as good
        finally:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
        with _told(self.folder):
            for path in merged:
                path.unlink()
        self.small = len(list(self.folder.glob(f"{PREFIX_PART}-*.parquet")))

    def _merge_into(self, part: Path, paths: list[Path]) -> list[Path]:
        """Write the rows of files to one file; the files that it replaces."""
        pa = arrow()
        merged: list[Path] = []
        group: list[Any] = []
        seen: set[str] = set()
        done = _with_figures(paths)
        with part.open("wb") as file:
            with pa.parquet.ParquetWriter(
                file, self.schema, compression="zstd", write_page_checksum=True
            ) as writer:
                for path in paths:
                    try:
                        table = read_rows(path)
                    except (DamagedFileError, FileNotFoundError):
                        continue
                    if not table.schema.equals(self.schema):
                        continue
                    columns = (table.column(name).to_pylist() for name in KEY_COLUMNS)
                    fresh = []
                    for index, (key, failed) in enumerate(zip(*columns, strict=True)):
                        if key not in seen and (failed is None or key not in done):
                            seen.add(key)
                            fresh.append(index)
                    group.append(table.take(pa.array(fresh, pa.int64())))
                    merged.append(path)
                    if sum(one.num_rows for one in group) >= MERGED_GROUP_ROWS:
                        writer.write_table(pa.concat_tables(group), MERGED_GROUP_ROWS)
                        group.clear()
                if group:
                    writer.write_table(pa.concat_tables(group), MERGED_GROUP_ROWS)
            file.flush()
            os.fsync(file.fileno())
        return merged


def _with_figures(paths: list[Path]) -> set[str]:
    """The keys of rows with metrics in files; a run that failed and then did not has such a row."""
    found: set[str] = set()
    for path in paths:
        with contextlib.suppress(DamagedFileError, FileNotFoundError):
            found |= done_and_failed(read_rows(path, KEY_COLUMNS))[0]
    return found


def set_damaged_aside(store: Store) -> list[Path]:
    """Rename the files that are not what was written; their new names."""
    store.keys()
    aside = []
    for path in store.damaged:
        aside.append(path.with_suffix(".bad"))
        with _told(aside[-1]):
            os.replace(path, aside[-1])
    return aside


def write_manifest(folder: Path, manifest: Manifest, copies: Copies | None = None) -> Store:
    """Write what a folder's results follow from. Raises InputError."""
    with _told(folder):
        for place, content in (copies or {}).items():
            if not holds(folder / place, content):
                (folder / place).parent.mkdir(parents=True, exist_ok=True)
                write_atomically(folder / place, content)
        write_atomically(folder / STUDY_FILE, manifest.text.encode())
        write_atomically(folder / MANIFEST, manifest_json(manifest))
    return Store(folder)


def check_free(folder: Path, copies: Copies) -> None:
    """Raises InputError if a folder that is not a folder of results yet has other files in their
    place."""
    with _told(folder):
        for place, content in copies.items():
            if (folder / place).exists() and not holds(folder / place, content):
                text = f"holds another file {place} than the study: use another folder"
                raise InputError(text, str(folder))


def holds(path: Path, content: bytes) -> bool:
    """Whether there is a file with this content."""
    return path.is_file() and path.read_bytes() == content


def table_of(rows: list[Row], store: Store, schema: Any) -> Any:
    """Rows as an Arrow table of the schema's columns."""
    pa = arrow()
    known = point_columns(store.study, store.manifest, [row["point"] for row in rows])
    arrays = []
    for field in schema:
        if field.name in known:
            values = known[field.name]
        elif field.name in (*RESULT_COLUMNS, SERIES_COLUMN, SUMS_COLUMN):
            values = [row.get(field.name) for row in rows]
        else:
            values = [row["metrics"].get(field.name) for row in rows]
        arrays.append(pa.array(values, field.type))
    return pa.table(arrays, schema=schema)


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file that takes its name when it is on the disk. Raises OSError."""
    with replacing(path, path.with_name(f"{path.name}.writing"), durable=True) as file:
        file.write(content)


@contextlib.contextmanager
def _told(place: Path) -> Iterator[None]:
    """Turns what goes wrong with files in here into an InputError."""
    try:
        yield
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise InputError(f"cannot write results: {why}", str(place)) from error


# The coordinator of a sweep: hands out the runs that are missing, and keeps each row once.
#
# Few chunks are under way at a time, so that memory stays bounded and little is lost when a worker
# dies. A run that was under way then is tried once more, alone; if its worker dies again, the row
# says so.


CHUNK_S = 0.3  # long enough that sending costs nothing, short enough that progress is seen
MAX_SWEEP_CHUNK = 100  # runs
RUNS_PER_BLOCK = 50  # replications of a point that are done before the next point's
CLOCK_POLL_S = 0.2  # between two looks at the clock
DIED_MESSAGE = "the worker process died twice, the second time with this run alone"
UNABLE_MESSAGE = (
    "the workers cannot start: they have said why; a script that sweeps needs "
    'its `if __name__ == "__main__":`'
)

OnRows = Callable[[list[Row]], None]


class SweepTally(NamedTuple):
    """What a sweep did."""

    done: int  # runs of which rows were written
    failed: int  # of these failed
    unfinished: int  # of these reached their limit
    repeated: int  # runs begun a second time, since a worker died


class Coordinator:
    """Carries out the runs of plans that are not done yet, round after round, by the same workers."""

    def __init__(
        self,
        backend: Backend,
        writer: Writer,
        on_rows: OnRows | None = None,
        patience: float | None = None,
    ) -> None:
        self.backend, self.writer = backend, writer
        self.on_rows = on_rows  # also called without rows now and then, while none arrive
        self.patience = patience
        self.finished: queue.SimpleQueue[FutureLike] = queue.SimpleQueue()
        self.under_way: dict[
            FutureLike, tuple[SweepChunk, bool]
        ] = {}  # chunk, whether it runs alone
        self.retry_in_isolation: deque[SweepRun] = deque()
        self.waiting: Iterator[list[SweepRun]] = iter(())
        self.block: deque[SweepRun] = deque()
        self.has_results = False  # a result has arrived, so workers can start
        self.refused = False  # the pool takes nothing more: it has broken
        self.seconds_per_run: dict[int, float] = {}  # point -> seconds of a run
        self.chunks = self.done = self.failed = self.unfinished = self.repeated = 0

    def conduct(self, plan: SweepPlan, done: set[str]) -> None:
        """Run what is missing. What is raised on the way leaves all finished rows written."""
        self.plan, self.version = plan, plan.manifest.version
        self.waiting = self._missing(done)
        try:
            while self._submit_while_room():
                self._wait_for_chunk()
            self.writer.flush()
        except BaseException:
            with contextlib.suppress(Exception):  # what has gone wrong already is what is told
                try:
                    self._take_finished()
                finally:  # Ctrl-C may come again
                    self.writer.flush()
            raise

    def close(self, now: bool) -> None:
        """End the workers; `now`: without waiting for what they do."""
        self.backend.close(now)

    @property
    def tally(self) -> SweepTally:
        """What was done so far."""
        repeated = self.repeated + self.backend.repeated
        return SweepTally(self.done, self.failed, self.unfinished, repeated)

    def _missing(self, done: set[str]) -> Iterator[list[SweepRun]]:
        """The runs to do, in blocks of one point each: all points advance together."""
        manifest = self.plan.manifest
        for first in range(0, manifest.replications, RUNS_PER_BLOCK):
            for point in range(len(manifest.points)):
                block = range(first, min(first + RUNS_PER_BLOCK, manifest.replications))
                runs = (manifest.run(self.version, point, replication) for replication in block)
                missing = [run for run in runs if run.key not in done]
                if missing:
                    yield missing

    def _submit_while_room(self) -> bool:
        """Submit what there is room for; return whether anything is under way."""
        if self.retry_in_isolation:  # all others pause: alone, a run has all memory to itself
            if not self.under_way:
                self._submit((self.retry_in_isolation.popleft(),), alone=True)
        else:
            self.refused = False
            while (
                not self.refused
                and len(self.under_way) < self.backend.max_in_flight
                and self._has_more()
            ):
                self._submit(self._next_runs(), alone=False)
        return bool(self.under_way or self.retry_in_isolation) or self._has_more()

    def _has_more(self) -> bool:
        if not self.block:
            self.block.extend(next(self.waiting, ()))
        return bool(self.block)

    def _next_runs(self) -> tuple[SweepRun, ...]:
        known = self.seconds_per_run.get(self.block[0].point)
        if known is None:
            known = max(self.seconds_per_run.values(), default=CHUNK_S)
        size = max(1, min(MAX_SWEEP_CHUNK, int(CHUNK_S / max(known, 1e-6))))
        return tuple(self.block.popleft() for _ in range(min(size, len(self.block))))

    def _submit(self, runs: tuple[SweepRun, ...], alone: bool) -> None:
        self.chunks += 1
        chunk = chunk_of(self.plan, self.version, self.chunks, runs, self.patience)
        try:
            future = self.backend.submit_alone(chunk) if alone else self.backend.submit(chunk)
        except Exception as error:
            if alone or not self.backend.is_worker_lost(error):
                raise refused(error) from error
            self._return_runs(runs)
            return
        self.under_way[future] = (chunk, alone)
        future.add_done_callback(self.finished.put)

    def _return_runs(self, runs: tuple[SweepRun, ...]) -> None:
        """Runs that a pool did not take, since it had broken; what is under way will say so."""
        self.block.extendleft(reversed(runs))
        self.refused = True
        if not self.under_way:
            self.backend.restart()

    def _wait_for_chunk(self) -> None:
        """Wait for a chunk, or until it is time to write."""
        try:
            future = self.finished.get(timeout=CLOCK_POLL_S)
        except queue.Empty:
            self.writer.tick()
            if self.on_rows is not None:
                self.on_rows([])
            return
        chunk, alone = self.under_way.pop(future)
        try:
            rows = future.result()
        except Exception as error:
            if not self.backend.is_worker_lost(error):
                raise refused(error) from error
            rows = self._handle_dead_worker(chunk, alone)
        else:
            self.has_results = True
        self._keep(rows)

    def _take_finished(self) -> None:
        """Keep the rows that have arrived meanwhile."""
        while not self.finished.empty():
            future = self.finished.get()
            with contextlib.suppress(Exception):
                self._keep(future.result())

    def _handle_dead_worker(self, chunk: SweepChunk, alone: bool) -> list[Row]:
        """Handle a worker that died: a run that was alone has failed, others are retried in isolation."""
        if alone:
            if not self.has_results and not self.backend.can_start():
                raise InputError(UNABLE_MESSAGE)
            return [blank(run, DIED_MESSAGE) for run in chunk.runs]
        self.repeated += len(chunk.runs)
        self.retry_in_isolation.extend(chunk.runs)
        # The pool breaks as a whole: what else was under way comes back broken, too.
        if not any(not alone for _, alone in self.under_way.values()):
            self.backend.restart()
        return []

    def _keep(self, rows: list[Row]) -> None:
        """Rows that are done; they are counted before they are written, as Ctrl-C may come then."""
        self.writer.hold(rows)
        for row in rows:
            self.done += 1
            if row["error"] is not None:
                self.failed += 1
            else:
                self.seconds_per_run[row["point"]] = row["wall_s"]
                self.unfinished += not row["finished"]
        if rows and self.on_rows is not None:
            self.on_rows(rows)
        self.writer.tick()


def chunk_of(
    plan: SweepPlan,
    version: str,
    number: int,
    runs: tuple[SweepRun, ...],
    patience: float | None = None,
) -> SweepChunk:
    """What a worker is told about runs of one point."""
    point = runs[0].point
    return SweepChunk(
        number=number,
        version=version,
        plugins=plan.plugins,
        fingerprint=plan.manifest.points[point].fingerprint,
        scenario=pickle.dumps(plan.scenarios[point], pickle.HIGHEST_PROTOCOL),
        windows=plan.manifest.points[point].windows,
        runs=runs,
        patience=patience,
    )


def refused(error: BaseException) -> InputError:
    """What to say when workers cannot work."""
    if isinstance(error, CodeMismatchError):
        return InputError(f"a worker has other code than this process: {error}")
    what = " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return InputError(f"the workers cannot go on ({what}); what is done is kept")
