"""A folder of results: rows in Parquet files that are whole, checked, and read as one table.

    DIR/sweep.json      what the rows follow from: the study, points, seeds, hashes of the code
    DIR/study.yaml      the study as declared, for you and for another sweep
    DIR/my-floor.yaml   the study's own scenarios and their files, placed as seen from the study
    DIR/rows/*.parquet  rows, each file named by its content: what was damaged is noticed
    DIR/rows/*.bad      files that were damaged; their runs are done again

Readers need no lock: files appear whole under their names, and never change.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec

from automaton.errors import InputError
from automaton.scenario.document import Document
from automaton.studies.sweeps.run_keys import Manifest, read_manifest
from automaton.studies.sweeps.study import (
    RESULT_COLUMNS,
    SERIES_COLUMN,
    SUMS_COLUMN,
    Study,
    checked_study,
    column_value,
    document_of,
    metric_names,
    sum_names,
)

if TYPE_CHECKING:
    import pyarrow as pa

STUDY_FILE: Final = "study.yaml"
ROWS_FOLDER: Final = "rows"
KEY_COLUMNS: Final = ["key", "error"]  # which run a row is of, and why it failed
ATTEMPTS: Final = 10  # to read files of which some are merged meanwhile


class DamagedFileError(Exception):
    """A file of rows is not what was written."""


def arrow() -> Any:
    """The module pyarrow. Raises InputError where it is not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise InputError(
            f"results are kept with pyarrow, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[experiments]'"
        ) from None
    return pyarrow


class Store:
    """The results in a folder; reading alone. Raises InputError where there are none.

    `manifest`: what they must follow from, if that is not what the folder says.
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
        self.damaged: list[Path] = []  # files that the last reading left out

    @property
    def schema(self) -> pa.Schema:
        """The columns of every row: the same for all runs of the study."""
        return schema_of(self.study, self.manifest)

    def rows(self) -> pa.Table:
        """All valid rows, each run once, by point and replication.

        Rows of other code or of another floor are left out, as are files that are damaged. Of a run
        that failed and was tried again with success, the row with metrics is taken. A row belongs
        to the point that its key follows from, whatever point the study had when it was written.
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
        columns = point_columns(self.study, self.manifest, [expected[key] for key in taken])
        for name, values in columns.items():
            field = schema.field(name)
            at = schema.get_field_index(name)
            chosen = chosen.set_column(at, field, pa.array(values, field.type))
        return chosen.sort_by([("point", "ascending"), ("replication", "ascending")])

    def keys(self, with_failed: bool = True) -> set[str]:
        """The keys of the runs that are done; `with_failed`: those that failed included."""
        done, failed = self._done_and_failed()
        return done | failed if with_failed else done

    def failed(self) -> set[str]:
        """The keys of the runs that failed: no row has metrics of them."""
        done, failed = self._done_and_failed()
        return failed - done

    def _done_and_failed(self) -> tuple[set[str], set[str]]:
        """The keys of this study's rows with metrics, and of those without."""
        expected = self.manifest.keys()
        found: tuple[set[str], set[str]] = set(), set()
        for _, table in self._tables(KEY_COLUMNS):
            for all_keys, keys in zip(found, done_and_failed(table), strict=True):
                all_keys |= keys & expected
        return found

    def files(self) -> list[Path]:
        """The files of rows, damaged ones included."""
        return sorted((self.folder / ROWS_FOLDER).glob("*.parquet"))

    def _tables(self, columns: list[str] | None) -> Iterator[tuple[Path, pa.Table]]:
        """Each file's table. A file that is merged into another one while we read is read there."""
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
    """The study as the manifest has it: a reader never finds one of them without the other."""
    return document_of(manifest.text, folder / STUDY_FILE)


def declared_in(folder: Path, manifest: Manifest) -> Study:
    """The study that the rows of a folder belong to. Raises InputError."""
    return checked_study(study_document_in(folder, manifest))


def so_far(study: Study, manifest: Manifest) -> Study:
    """The study that the rows are of: with a number of replications, where they come in rounds."""
    if not study.in_rounds:
        return study
    return msgspec.structs.replace(study, replications=manifest.replications)


def schema_of(study: Study, manifest: Manifest) -> pa.Schema:
    """Columns of a study's rows: of every run, factors, metrics; metrics are null where absent."""
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
    return pa.schema(fields)


def point_columns(study: Study, manifest: Manifest, points: Sequence[int]) -> dict[str, list[Any]]:
    """The columns that follow from the design points of rows, given by their numbers."""
    planned = [manifest.points[point] for point in points]
    factors = {
        name: [column_value(one.levels.get(name), kind) for one in planned]
        for name, kind in study.column_types().items()
    }
    return {
        "study": [study.name] * len(points),
        "scenario": [one.scenario for one in planned],
        "point": list(points),
        **factors,
    }


def fitted(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """A table with exactly these columns; what it lacks, or has in another type, is null."""
    pa = arrow()
    columns = []
    for field in schema:
        held = (
            field.name in table.column_names and table.schema.field(field.name).type == field.type
        )
        columns.append(table.column(field.name) if held else pa.nulls(table.num_rows, field.type))
    return pa.table(columns, schema=schema)


def done_and_failed(table: pa.Table) -> tuple[set[str], set[str]]:
    """The keys of a table's rows with metrics, and of those without; it has KEY_COLUMNS."""
    found: tuple[set[str], set[str]] = set(), set()
    columns = (table.column(name).to_pylist() for name in KEY_COLUMNS)
    for key, failed in zip(*columns, strict=True):
        found[failed is not None].add(key)
    return found


def content_name(content: bytes | str, first: str) -> str:
    """The name of a file with this content, or of this digest; `first` makes names sort by time."""
    digest = content if isinstance(content, str) else hashlib.sha256(content).hexdigest()
    return f"{first}-{digest[:16]}.parquet"


def file_digest(path: Path) -> str:
    """The SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def content_of(path: Path) -> bytes:
    """What is in a file. Raises FileNotFoundError, or InputError for a file that cannot be read."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read: {why}", str(path)) from None


def read_rows(path: Path, columns: Iterable[str] | None = None) -> pa.Table:
    """The rows of a file, verified. Raises DamagedFileError, FileNotFoundError, or InputError.

    This thread alone reads: a thread of Arrow lets go of a Python object now and then after the rows
    are here, and the process aborts if Python ends in that moment.
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
