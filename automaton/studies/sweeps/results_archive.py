"""An archive of results: one zip that another machine can check, run again and compare.

    README.md      what the archive holds, and the command that runs everything again
    archive.json   versions, and the SHA-256 of every other file
    report.html    the report
    results/       the results folder: study, scenarios, their files, strategies, rows

A results folder is repeated in the same way. Equal archives have equal bytes.
"""

from __future__ import annotations

import hashlib
import itertools
import shlex
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any, Final, NamedTuple

import msgspec

from automaton.atomic_write import atomic_writer
from automaton.errors import InputError
from automaton.runs.provenance import MANIFEST, PACKAGES, changed_sources
from automaton.studies.sweeps.pools import Backend
from automaton.studies.sweeps.result_store import ROWS_FOLDER, STUDY_FILE, Store, content_of, holds
from automaton.studies.sweeps.sweep_plan import SweepPlan, describe_point, make_sweep_plan
from automaton.studies.sweeps.sweep_session import OnRows, difference, gone_on_with, sweep_into
from automaton.units import count

ARCHIVE_FILE: Final = "archive.json"
RESULTS_FOLDER: Final = "results"
ARCHIVE_BEGINS: Final = b"PK"
ENTRY_DATE: Final = (1980, 1, 1, 0, 0, 0)  # of all entries, so that equal contents give equal bytes
NOT_REPEATED: Final = ("key", "wall_s", "cpu_s")  # columns that depend on code and machine
README: Final = """# {study}: results

{summary}{runs} of {points}, seed {seed}. `report.html` is the report; `{results}` holds the study with
its scenarios, files and strategies, and a row for each run.

This command checks all files, does all runs again, and compares every result. It executes the
strategies that the archive holds, so run it only if you trust the sender:

```sh
automaton verify {file}
```

Install the same versions first, because other ones may give other results:

```sh
pip install {packages}
```

The runs were made with Python {python}. `{archive}` lists the versions and the SHA-256 of every file.
"""


class ArchiveList(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of ARCHIVE_FILE."""

    study: str
    versions: dict[str, str]  # of Python and libraries, when the runs were made
    files: dict[str, str]  # name -> SHA-256


class RepeatedResults(NamedTuple):
    """A results folder compared with the same runs done again."""

    study: str
    compared: int  # runs
    differences: list[str]  # sentences, one for each run that differs
    changed_sources: list[str]  # since the results were made


def write_archive(store: Store, report: str, path: Path) -> None:
    """Write an archive of results with its report as HTML. Raises InputError if a file is missing."""
    folder, manifest = store.folder, store.manifest
    places = [MANIFEST, STUDY_FILE, *planned_again(store)[0].copies]
    places += [f"{ROWS_FOLDER}/{file.name}" for file in store.files()]
    contents = {f"{RESULTS_FOLDER}/{place}": content_of(folder / place) for place in sorted(places)}
    contents |= {"report.html": report.encode(), "README.md": readme(store, path.name).encode()}
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
    listed = msgspec.json.encode(ArchiveList(manifest.study, manifest.versions, digests))
    contents[ARCHIVE_FILE] = msgspec.json.format(listed, indent=1) + b"\n"
    with atomic_writer(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(contents.items()):
            entry = zipfile.ZipInfo(name, ENTRY_DATE)
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)


def readme(store: Store, file: str) -> str:
    """The description of an archive with this file name."""
    study, versions = store.study, dict(store.manifest.versions)
    python = versions.pop("python", "of unknown version")
    extra = {"fleet-automaton": "fleet-automaton[experiments]"}
    packages = (shlex.quote(f"{extra.get(name, name)}=={one}") for name, one in versions.items())
    return README.format(
        study=study.name,
        summary=f"{study.summary}\n\n" if study.summary else "",
        runs=count(len(store.keys()), "run"),
        points=count(len(study.points), "point"),
        seed=study.seed,
        results=RESULTS_FOLDER,
        file=shlex.quote(file),
        packages=" ".join(packages),
        python=python,
        archive=ARCHIVE_FILE,
    )


def planned_again(store: Store) -> tuple[SweepPlan, list[str]]:
    """The plan of the study in a results folder, and the changes of the code since its runs.

    Raises InputError if the folder lacks a file, or if a file differs from that of the runs.
    """
    folder, before = store.folder, store.manifest
    study = folder / STUDY_FILE
    if not holds(study, before.text.encode()):
        what = (
            f"has another {STUDY_FILE} than its runs" if study.exists() else f"lacks {STUDY_FILE}"
        )
        raise InputError(what, str(folder))
    try:
        plan = make_sweep_plan(study)
    except InputError as error:
        raise with_missing_packages(error, before.versions) from None
    for place, content in plan.copies.items():
        if not (folder / place).is_file():
            raise InputError(
                f"lacks {place}; repeat the sweep into this folder to add it", str(folder)
            )
        if not holds(folder / place, content):  # of a strategy imported from elsewhere
            raise InputError(f"has another {place} than the one in use here", str(folder))
    changes = changed_sources(before.sources, plan.manifest.sources)
    ours = tuple(f"{package}/" for package in PACKAGES)
    if own := [one for one in changes if not one.startswith(ours)]:
        raise InputError(f"has other strategies than its runs: {', '.join(own)}", str(folder))
    manifest = gone_on_with(plan, before)
    same_code = msgspec.structs.replace(manifest, sources=before.sources)
    if objection := difference(before, same_code):
        raise InputError(objection, str(folder))
    return plan._replace(manifest=manifest), changes


def with_missing_packages(error: InputError, needed: Mapping[str, str]) -> InputError:
    """The error, with the packages to install of those that the runs needed, by name and version."""
    from importlib.metadata import distributions  # slow: imports the parser of e-mails

    installed = {one.name for one in distributions()}
    missing = [f"{name}=={version}" for name, version in needed.items() if name not in installed]
    missing = [one for one in missing if not one.startswith("python==")]
    if not missing:
        return error
    text = f"{error}; the runs used strategies of packages that are not installed here"
    return InputError(f"{text}: pip install {shlex.join(missing)}")


@contextmanager
def opened(path: Path) -> Iterator[Store]:
    """The results in a folder or in an archive with all its files. Raises InputError."""
    if path.is_dir():
        yield Store(path)
        return
    with tempfile.TemporaryDirectory(prefix="automaton-verify-") as folder:
        unpack(path, Path(folder))
        yield Store(Path(folder, RESULTS_FOLDER))


def unpack(path: Path, folder: Path) -> None:
    """Check all files of an archive and write those of the results. Raises InputError."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
            if ARCHIVE_FILE not in names:
                raise InputError(
                    f"is not an archive of results: it lacks {ARCHIVE_FILE}", str(path)
                )
            listed = msgspec.json.decode(archive.read(ARCHIVE_FILE), type=ArchiveList)
            for name, expected in listed.files.items():
                place = PurePosixPath(name)
                if name not in names:
                    raise InputError(f"lacks {name}, which its {ARCHIVE_FILE} lists", str(path))
                content = archive.read(name)
                inside = not place.is_absolute() and ".." not in place.parts
                if hashlib.sha256(content).hexdigest() != expected or not inside:
                    raise InputError(f"is damaged: {name} has changed", str(path))
                (folder / place).parent.mkdir(parents=True, exist_ok=True)
                (folder / place).write_bytes(content)
    except (zlib.error, RuntimeError) as error:  # a changed byte; encryption, unknown compression
        raise InputError(f"is damaged: {error}", str(path)) from None
    except (zipfile.BadZipFile, msgspec.DecodeError, OSError, EOFError) as error:
        raise InputError(f"is not an archive of results: {error}", str(path)) from None


def repeat_results(
    path: Path, backend: Callable[[], Backend], on_rows: OnRows | None = None
) -> RepeatedResults:
    """Do the runs of a results folder or archive again, and compare the rows. Raises InputError."""
    with opened(path) as store, tempfile.TemporaryDirectory(prefix="automaton-again-") as folder:
        rows = rows_by_run(store)
        if not rows:
            raise InputError("holds no runs to compare with; sweep it first", str(path))
        try:
            plan, changes = planned_again(store)
        except InputError as error:
            text = str(error).replace(f"{store.folder}: ", "").replace(f"{store.folder}/", "")
            raise InputError(text, str(path)) from None
        again = sweep_into(Path(folder), plan, backend, on_rows=on_rows).store
        differences = [
            text
            for run, row in rows_by_run(again).items()
            if run in rows and (text := first_difference(store, rows[run], row))
        ]
        return RepeatedResults(store.study.name, len(rows), differences, changes)


def rows_by_run(store: Store) -> dict[tuple[int, int], dict[str, Any]]:
    """The rows of a folder by point and replication."""
    return {(row["point"], row["replication"]): row for row in store.rows().to_pylist()}


def first_difference(store: Store, row: dict[str, Any], again: dict[str, Any]) -> str:
    """The first column in which a row differs from that of the run done again; "" if none does."""
    for name in itertools.chain(["digest"], row):
        if name not in NOT_REPEATED and repr(row[name]) != repr(again.get(name)):
            point = describe_point(store.study.points[row["point"]])
            where = f"point {row['point']} ({point}), replication {row['replication']}"
            return f"{where}: {name} was {row[name]}, done again {again.get(name)}"
    return ""
