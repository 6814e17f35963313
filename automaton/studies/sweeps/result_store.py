"""A results folder: rows in complete, verified Parquet files, read as one table.

    DIR/sweep.json      the manifest: study, points, seeds, and hashes of the code
    DIR/study.yaml      the study as declared, for you and for another sweep
    DIR/my-floor.yaml   the study's own scenarios, files and strategies, at their relative paths
    DIR/outside/        those that lie elsewhere, by the name of their folder
    DIR/rows/*.parquet  rows; each file is named by its content, so damage is detected
    DIR/rows/*.bad      damaged files; their runs are repeated

Readers need no lock: files appear complete under their names and never change. One writer holds the
lock. It writes rows when 500 have accumulated or the oldest is one second old; only unwritten rows are
lost when the machine fails, and their runs are repeated. A file is written under a temporary name,
synced, and renamed. Small files are merged when they become many, and all files at the end.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import socket
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from automaton.atomic_write import put_in_place, replacing
from automaton.errors import InputError
from automaton.runs.provenance import MANIFEST
from automaton.scenario.document import Document
from automaton.studies.sweeps.run_keys import (
    Manifest,
    Row,
    SweepRun,
    blank,
    manifest_json,
    read_manifest,
    reason,
)
from automaton.studies.sweeps.study import (
    PERIOD_COLUMNS,
    PERIODS_COLUMN,
    RESULT_COLUMNS,
    SERIES_COLUMN,
    SUMS_COLUMN,
    USES_COLUMN,
    Study,
    checked_study,
    column_value,
    document_of,
    metric_names,
    sum_names,
)
from automaton.units import count

if TYPE_CHECKING:
    import pyarrow as pa

STUDY_FILE: Final = "study.yaml"
ROWS_FOLDER: Final = "rows"
LISTS_OF_ROWS: Final = (SERIES_COLUMN, SUMS_COLUMN, USES_COLUMN, PERIODS_COLUMN)
KEY_COLUMNS: Final = ["key", "error"]  # the run of a row, and why it failed
ATTEMPTS: Final = 10  # to list files, since some may be merged meanwhile
BATCH_ROWS: Final = 500  # rows after which a file is written
BATCH_S: Final = 1.0  # age of the oldest row after which a file is written
MANY_FILES: Final = 256  # small files after which they are merged
MERGED_GROUP_ROWS: Final = 20_000  # rows held in memory while files are merged
RESERVE: Final = ".reserve"
RESERVE_BYTES: Final = 4_000_000  # released when the disk is full, to save the pending rows
LOCK_FILE: Final = ".lock"
UNFIT: Final = (ArithmeticError, TypeError, ValueError)  # errors of values that do not fit a column
PREFIX_PART, PREFIX_MERGED = "part", "rows"
FILE_NAME: Final = re.compile(r"(?:part|rows)-(\d+)-")
Copies = Mapping[str, bytes]  # path in a results folder -> content


class DamagedFileError(Exception):
    """The content of a file of rows has changed since it was written."""


def arrow() -> Any:
    """The module pyarrow. Raises InputError if it is not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise InputError(
            f"results folders need pyarrow, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[experiments]'"
        ) from None
    return pyarrow


class Store:
    """A reader of a results folder. Raises InputError if the folder has no results.

    `manifest`: replaces the manifest of the folder; only rows that belong to it are read.
    """

    def __init__(self, folder: str | Path, manifest: Manifest | None = None) -> None:
        self.folder = Path(folder)
        manifest = manifest or read_manifest(self.folder)
        if manifest is None:
            why = "holds no results of a sweep" if self.folder.is_dir() else "no such folder"
            raise InputError(why, str(folder))
        self.manifest: Manifest = manifest
        self.declared: Study = declared_in(self.folder, manifest)
        self.study: Study = so_far(self.declared, manifest)
        self.damaged: list[Path] = []  # files that the last read skipped

    @property
    def schema(self) -> pa.Schema:
        """The columns of every row of the study."""
        return schema_of(self.study, self.manifest)

    def rows(self) -> pa.Table:
        """All valid rows, one for each run, by point and replication.

        Rows of other code or of another floor and damaged files are skipped. If a failed run was
        retried with success, the row with metrics is used. The key of a row determines its point, even
        if the point had another number when the row was written.
        """
        pa = arrow()
        schema = self.schema
        tables = [fitted(table, schema) for _, table in self._tables(None)]
        table = pa.concat_tables(tables) if tables else schema.empty_table()
        expected = {run.key: run.point for run in self.manifest.runs()}
        failed = table.column("error").to_pylist()
        taken: dict[str, int] = {}
        for index, key in enumerate(table.column("key").to_pylist()):
            better = key not in taken or (failed[taken[key]] and not failed[index])
            if key in expected and better:
                taken[key] = index
        chosen = table.take(pa.array(list(taken.values()), pa.int64()))
        columns = point_columns(self.study, [expected[key] for key in taken])
        for name, values in columns.items():
            field = schema.field(name)
            at = schema.get_field_index(name)
            chosen = chosen.set_column(at, field, pa.array(values, field.type))
        return chosen.sort_by([("point", "ascending"), ("replication", "ascending")])

    def every_row(self) -> Iterator[Row]:
        """The rows of all valid files by column, of whatever study and code."""
        for _, table in self._tables(None):
            yield from table.to_pylist()

    def keys(self, with_failed: bool = True) -> set[str]:
        """The keys of the runs that are done; `with_failed`: including failed runs."""
        done, failed = self._done_and_failed()
        return done | failed if with_failed else done

    def failed(self) -> set[str]:
        """The keys of failed runs, which have no row with metrics."""
        done, failed = self._done_and_failed()
        return failed - done

    def _done_and_failed(self) -> tuple[set[str], set[str]]:
        """The keys of this study's rows with metrics, and of its rows without metrics."""
        expected = self.manifest.keys()
        found: tuple[set[str], set[str]] = set(), set()
        for _, table in self._tables(KEY_COLUMNS):
            for all_keys, keys in zip(found, done_and_failed(table), strict=True):
                all_keys |= keys & expected
        return found

    def files(self) -> list[Path]:
        """The files of rows, including damaged ones."""
        return sorted((self.folder / ROWS_FOLDER).glob("*.parquet"))

    def _tables(self, columns: list[str] | None) -> Iterator[tuple[Path, pa.Table]]:
        """The table of each file. If a file is merged into another one meanwhile, that one is read."""
        self.damaged = []
        seen: set[Path] = set()
        for _ in range(ATTEMPTS):
            fresh = [path for path in self.files() if path not in seen]
            for path in fresh:
                try:
                    table = read_rows(path, columns)
                except FileNotFoundError:
                    continue
                except DamagedFileError:
                    self.damaged.append(path)
                else:
                    yield path, table
                seen.add(path)
            if not fresh:
                return


def study_document_in(folder: Path, manifest: Manifest) -> Document:
    """The study text in the manifest, so that study and manifest always match."""
    return document_of(manifest.text, folder / STUDY_FILE)


def declared_in(folder: Path, manifest: Manifest) -> Study:
    """The study of a results folder. Raises InputError."""
    return checked_study(study_document_in(folder, manifest))


def so_far(study: Study, manifest: Manifest) -> Study:
    """The study with the replications up to the present round, if it has rounds."""
    if not study.in_rounds:
        return study
    return msgspec.structs.replace(study, replications=manifest.replications)


def schema_of(study: Study, manifest: Manifest) -> pa.Schema:
    """The columns of a study's rows: run, factors, results and metrics; absent metrics are null."""
    pa = arrow()
    types = {"text": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}
    factors = study.column_types()
    kinds = {**dict(list(RESULT_COLUMNS.items())[:6]), **factors, **RESULT_COLUMNS}
    fields = [pa.field(name, types[kind]) for name, kind in kinds.items()]
    fields += [pa.field(name, pa.float64()) for name in metric_names(manifest.counted)]
    if study.design == "steady-state":
        fields.append(pa.field(SERIES_COLUMN, pa.list_(pa.int32())))
        sums = [pa.field(name, pa.list_(pa.int64())) for name in sum_names(manifest.counted)]
        fields.append(pa.field(SUMS_COLUMN, pa.struct(sums)))
    fields.append(pa.field(USES_COLUMN, pa.map_(pa.string(), pa.int64())))
    periods = [pa.field(name, pa.list_(pa.float64())) for name in PERIOD_COLUMNS]
    fields.append(pa.field(PERIODS_COLUMN, pa.struct(periods)))
    return pa.schema(fields)


def point_columns(study: Study, points: Sequence[int]) -> dict[str, list[Any]]:
    """The columns that are determined by the design points of rows, given by number."""
    declared = study.points
    own = [declared[point] for point in points]
    factors = {
        name: [column_value(one.levels.get(name), kind) for one in own]
        for name, kind in study.column_types().items()
    }
    return {
        "study": [study.name] * len(points),
        "scenario": [one.scenario for one in own],
        "point": list(points),
        **factors,
    }


def fitted(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """A table with exactly these columns; columns that it lacks or has with another type are null."""
    pa = arrow()
    columns = []
    for field in schema:
        held = (
            field.name in table.column_names and table.schema.field(field.name).type == field.type
        )
        columns.append(table.column(field.name) if held else pa.nulls(table.num_rows, field.type))
    return pa.table(columns, schema=schema)


def done_and_failed(table: pa.Table) -> tuple[set[str], set[str]]:
    """The keys of a table's rows with metrics, and of its rows without; it must have KEY_COLUMNS."""
    found: tuple[set[str], set[str]] = set(), set()
    columns = (table.column(name).to_pylist() for name in KEY_COLUMNS)
    for key, failed in zip(*columns, strict=True):
        found[failed is not None].add(key)
    return found


def content_name(content: bytes | str, first: str) -> str:
    """The name of a file with this content or digest; the prefix `first` sorts names by time."""
    digest = content if isinstance(content, str) else hashlib.sha256(content).hexdigest()
    return f"{first}-{digest[:16]}.parquet"


def file_digest(path: Path) -> str:
    """The SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def content_of(path: Path) -> bytes:
    """Read a file. Raises FileNotFoundError, or InputError if the file cannot be read."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read: {why}", str(path)) from None


def read_rows(path: Path, columns: Iterable[str] | None = None) -> pa.Table:
    """Read and verify the rows of a file. Raises DamagedFileError, FileNotFoundError, or InputError.

    Arrow must not use threads here: one of them may release a Python object after the read, and the
    process aborts if Python ends at this moment.
    """
    pa = arrow()
    content = content_of(path)
    if content_name(content, path.name.rpartition("-")[0]) != path.name:
        raise DamagedFileError(path)
    try:
        file = pa.parquet.ParquetFile(pa.BufferReader(content), page_checksum_verification=True)
        chosen = file.schema_arrow.names if columns is None else list(columns)
        table = file.read(chosen, use_threads=False)
    except (OSError, ValueError) as error:
        raise DamagedFileError(path) from error
    if table.column_names != chosen:
        raise DamagedFileError(path)
    return table


# The writer of a results folder.


@contextlib.contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Lock a results folder, created if missing. Raises InputError if another sweep holds the lock."""
    with _told(folder):
        (folder / ROWS_FOLDER).mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK_FILE).open("a+b", buffering=0)
    with file:
        with _told(folder):
            _claim(file, folder)
        yield


def _claim(file: FileIO, folder: Path) -> None:
    """Lock a folder by this file, which names the holder; delete temporary files of killed sweeps."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.seek(0)
        who = file.read().decode(errors="replace").strip() or "another process"
        raise InputError(f"another sweep writes to this folder ({who})", str(folder)) from None
    file.truncate(0)
    file.write(f"process {os.getpid()} on {socket.gethostname()}".encode())
    for left in (*(folder / ROWS_FOLDER).glob("*.writing"), *folder.glob("*.writing")):
        left.unlink()


class Writer:
    """Collects rows and writes them; only for the holder of the folder's lock."""

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
                write_atomically(reserve, os.urandom(RESERVE_BYTES))  # file systems compress zeros

    def hold(self, rows: list[Row]) -> None:
        """Accept rows; `tick` writes them when a batch is due, `flush` at once."""
        if not self.held:
            self.since = time.monotonic()
        self.held += rows

    def tick(self) -> None:
        """Write the pending rows if a batch is due."""
        old = self.held and time.monotonic() - self.since >= BATCH_S
        if len(self.held) >= BATCH_ROWS or old:
            self.flush()

    def flush(self) -> None:
        """Write all pending rows. Raises InputError after an attempt to save them from the error."""
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
        """The pending rows; rows that cannot be written become failed runs."""
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
        """The error if rows cannot be written; first try again with the reserved space released."""
        self.release()
        runs = count(len(self.held), "finished run")
        why = (error.strerror or str(error)).lower()
        try:
            self._write()
            end = "all finished runs are saved; repeat the command when there is space to continue"
        except OSError:
            self.held.clear()
            end = f"{runs} could not be saved and must be repeated; all others are saved"
        return InputError(f"cannot write results: {why}; {end}", str(self.folder))

    def close(self) -> None:
        """Write the pending rows, and merge all files into one."""
        self.flush()
        self.merge()

    def release(self) -> None:
        """Release the reserved disk space."""
        with contextlib.suppress(OSError):  # must not hide an earlier error
            (self.folder / RESERVE).unlink(missing_ok=True)

    def merge(self, only_small: bool = False) -> None:
        """Merge files, with one row for each run. Files that are damaged or have other columns stay."""
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
            return  # no space for a second copy; the separate files remain valid
        finally:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
        with _told(self.folder):
            for path in merged:
                path.unlink()
        self.small = len(list(self.folder.glob(f"{PREFIX_PART}-*.parquet")))

    def _merge_into(self, part: Path, paths: list[Path]) -> list[Path]:
        """Write the rows of files to one file; return the files that it replaces."""
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
    """The keys of rows with metrics in files, including failed runs that a retry has completed."""
    found: set[str] = set()
    for path in paths:
        with contextlib.suppress(DamagedFileError, FileNotFoundError):
            found |= done_and_failed(read_rows(path, KEY_COLUMNS))[0]
    return found


def set_damaged_aside(store: Store) -> list[Path]:
    """Rename damaged files; return their new paths."""
    store.keys()
    aside = []
    for path in store.damaged:
        aside.append(path.with_suffix(".bad"))
        with _told(aside[-1]):
            os.replace(path, aside[-1])
    return aside


def write_manifest(folder: Path, manifest: Manifest, copies: Copies | None = None) -> Store:
    """Write the manifest of a folder, its study and its copies of files. Raises InputError."""
    with _told(folder):
        for place, content in (copies or {}).items():
            if not holds(folder / place, content):
                (folder / place).parent.mkdir(parents=True, exist_ok=True)
                write_atomically(folder / place, content)
        write_atomically(folder / STUDY_FILE, manifest.text.encode())
        write_atomically(folder / MANIFEST, manifest_json(manifest))
    return Store(folder)


def check_free(folder: Path, copies: Copies) -> None:
    """Raise InputError if a folder has files with the names but not the contents of the copies."""
    with _told(folder):
        for place, content in copies.items():
            if (folder / place).exists() and not holds(folder / place, content):
                text = f"has a file {place} that differs from the study's file: use another folder"
                raise InputError(text, str(folder))


def holds(path: Path, content: bytes) -> bool:
    """Whether a file exists with this content."""
    return path.is_file() and path.read_bytes() == content


def table_of(rows: list[Row], store: Store, schema: Any) -> Any:
    """Rows as an Arrow table with the schema's columns."""
    pa = arrow()
    known = point_columns(store.study, [row["point"] for row in rows])
    arrays = []
    for field in schema:
        if field.name in known:
            values = known[field.name]
        elif field.name in (*RESULT_COLUMNS, *LISTS_OF_ROWS):
            values = [row.get(field.name) for row in rows]
        else:
            values = [row["metrics"].get(field.name) for row in rows]
        arrays.append(pa.array(values, field.type))
    return pa.table(arrays, schema=schema)


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file under a temporary name, sync it, and rename it. Raises OSError."""
    with replacing(path, path.with_name(f"{path.name}.writing"), durable=True) as file:
        file.write(content)


@contextlib.contextmanager
def _told(place: Path) -> Iterator[None]:
    """Convert an OSError inside to an InputError."""
    try:
        yield
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise InputError(f"cannot write results: {why}", str(place)) from error
