"""What a folder of results was made of, and the key by which each run is known.

    key = hash(version of the code, resolved scenario, seed)

A row belongs to a folder's study as it stands if its key is one of those that follow from here; so
results of other code, or of another floor, are never taken for these.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.printable import one_line
from automaton.runs.provenance import DECIDING, PACKAGES, file_hashes
from automaton.scenario.order_lines import plain_data
from automaton.scenario.unavailable_metrics import warm_up_of
from automaton.strategy import lookup
from automaton.studies.sweeps.study import Levels, Study
from automaton.world.resolved import Resolved

DATA_SUFFIXES: Final = (".yaml", ".json")  # of automaton's packages: what their code may read
MANIFEST: Final = "sweep.json"
MANIFEST_FORMAT: Final = 5
DRAWN_ELSEWHERE: Final = ("file", "matrix")  # keys of a layout whose floor is in a file of its own
MAX_REASON_LENGTH: Final = 500  # characters
Sources = dict[str, str]  # file -> 16 hex digits of its content


class SweepRun(NamedTuple):
    """One run of a study."""

    key: str
    point: int
    replication: int
    seed: int


Row = dict[str, Any]  # what is kept of a run, by column; its metrics under "metrics"


def blank(run: SweepRun, failed: str | None = None) -> Row:
    """The row of a run that failed."""
    return {**run._asdict(), "finished": False, "error": failed, "metrics": {}}


def reason(text: str) -> str:
    """Why a run failed, as a row keeps it: not too long, and text that files can hold."""
    return one_line(text.encode(errors="replace").decode(), MAX_REASON_LENGTH)


class Windows(NamedTuple):
    """In what steps the rows of a steady state tell of their runs; 0: they keep none."""

    window: int = 0  # ticks of a window of deliveries
    stretch: int = 0  # and of a stretch of several, of which they keep all sums


WHOLE_RUNS: Final = Windows()


class PlannedPoint(msgspec.Struct, frozen=True):
    """A design point as it was resolved."""

    scenario: str
    levels: Levels
    fingerprint: str  # of the resolved scenario, floor included
    windows: Windows
    warm_up: int  # ticks that the metrics of its rows leave out


class Declared(msgspec.Struct, frozen=True):
    """What a study says of its analysis, and no key of a run follows from."""

    replications: int  # of a study in rounds its bound; of an earlier one those asked for by then
    warm_up: int | str | None
    analysis: Any  # as plain data; None: nothing was declared

    def analysed_as(self, other: Declared) -> bool:
        """Whether the runs are asked the same."""
        return (self.warm_up, self.analysis) == (other.warm_up, other.analysis)


class ManifestForm(msgspec.Struct, frozen=True):
    """What every manifest says, whatever wrote it."""

    format: int


class Manifest(msgspec.Struct, frozen=True):
    """What the results in a folder follow from."""

    study: str
    text: str  # of the study's file
    replications: int  # of a study in rounds: so far
    seed: int
    common_random_numbers: bool
    points: tuple[PlannedPoint, ...]
    sources: Sources
    versions: dict[str, str]  # of libraries; for the record
    counted: tuple[str, ...]  # metrics that the strategies count themselves
    earlier: tuple[Declared, ...] = ()  # what was declared before, when runs had been made
    # replications after each round, where a study goes on until a precision is reached
    rounds: tuple[int, ...] | msgspec.UnsetType = msgspec.UNSET
    format: int = MANIFEST_FORMAT
    checksum: str = ""  # of all else, in a file; "" in memory

    def going_on(self, replications: int) -> Manifest:
        """The manifest of the next round, after which there are so many replications."""
        rounds = () if self.rounds is msgspec.UNSET else self.rounds
        return msgspec.structs.replace(
            self, replications=replications, rounds=(*rounds, replications)
        )

    @property
    def version(self) -> str:
        """16 hex digits of the code."""
        return hashed(self.sources)

    def runs(self) -> Iterator[SweepRun]:
        """All runs: replications one after the other, and in each all points."""
        version = self.version
        for replication in range(self.replications):
            for point in range(len(self.points)):
                yield self.run(version, point, replication)

    def run(self, version: str, point: int, replication: int) -> SweepRun:
        """One of them; `version` is `self.version`, which takes a while."""
        planned = self.points[point]
        salt = "" if self.common_random_numbers else f" {planned.fingerprint}"
        seed = seed_of(f"{self.seed} {replication}{salt}")
        key = digest(f"{version} {planned.fingerprint} {seed}")[:32]
        return SweepRun(key, point, replication, seed)

    def keys(self) -> set[str]:
        """The keys of all runs."""
        return {run.key for run in self.runs()}


def seed_of(text: str) -> int:
    """A seed from 0 to 2^63 - 1 that follows from a text."""
    return int(digest(text)[:16], 16) >> 1


def replication_seeds(seed: int, first: int, number: int) -> list[int]:
    """The seeds of so many replications; those of a sweep with common random numbers."""
    return [seed_of(f"{seed} {replication}") for replication in range(first, first + number)]


def digest(text: str) -> str:
    """The SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def hashed(value: Any) -> str:
    """16 hex digits of data; the order of keys does not matter."""
    return digest(json.dumps(value, sort_keys=True, ensure_ascii=False, default=str))[:16]


def fingerprint(resolved: Resolved, windows: Windows = WHOLE_RUNS) -> str:
    """Of a resolved scenario but for its seed and summary: 32 hex digits.

    Files count by their contents and not by their places, so that it is the same in another folder
    and on another machine; of a floor, what was built. `windows`: of its rows.
    """
    scenario = plain_data(resolved.scenario)
    del scenario["seed"], scenario["summary"]
    for form in DRAWN_ELSEWHERE:
        scenario["layout"].pop(form, None)
    picks = [
        (layer, choice.name, msgspec.to_builtins(choice.parameters))
        for layer, choice in resolved.choices
    ]
    contents = file_hashes(resolved).get("files", {})
    whole = [
        by_content(scenario, contents),
        by_content(picks, contents),
        resolved.floor_plan.fingerprint,
        resolved.start,
        windows,
    ]
    return digest(json.dumps(whole, sort_keys=True, ensure_ascii=False, default=str))[:32]


def by_content(data: Any, contents: Mapping[str, str]) -> Any:
    """Plain data with the hash of its content instead of each path; `contents`: path -> hash."""
    if isinstance(data, dict):
        return {key: by_content(value, contents) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [by_content(value, contents) for value in data]
    return contents.get(data, data) if isinstance(data, str) else data


def plugins_of(resolved: Resolved) -> set[str]:
    """The modules of a scenario's strategies that are not built-ins."""
    places = (lookup.place(layer, choice.name) for layer, choice in resolved.choices)
    modules = {place.partition(":")[0] for place in places if place}
    return {module for module in modules if module.partition(".")[0] not in PACKAGES}


def sources_of(plugins: tuple[str, ...] = ()) -> Sources:
    """The files from which runs follow: automaton's packages, and the modules of plug-ins.

    Of a plug-in that is a package all its files count but caches, of a single module the Python
    files beside it.
    """
    found = package_sources()
    for plugin in plugins:
        found |= plugin_sources(plugin)
    return dict(sorted(found.items()))


def package_sources() -> Sources:
    """Those of automaton's packages."""
    found: Sources = {}
    for package in PACKAGES:
        root, _ = _home(package)
        deciding = (path for path in root.rglob("*") if path.suffix in DECIDING + DATA_SUFFIXES)
        found |= _contents(deciding, root.parent, "")
    return found


def plugin_sources(plugin: str) -> Sources:
    """Those of a plug-in, given by its module."""
    top = plugin.partition(".")[0]
    root, whole = _home(top)
    return _contents(_own_files(root) if whole else root.glob("*.py"), root, f"{top}: ")


def _contents(files: Iterable[Path], root: Path, first: str) -> Sources:
    """Names as seen from a folder, with something first; links that lead nowhere are not files."""
    return {
        first + path.relative_to(root).as_posix(): _content(path)
        for path in files
        if path.is_file()
    }


def _own_files(root: Path) -> Iterator[Path]:
    """The files of a package: not caches, nothing hidden, and no results that a sweep keeps there."""
    for path in sorted(root.iterdir()):
        if path.name.startswith(".") or path.name == "__pycache__" or path.suffix == ".pyc":
            continue
        if path.is_file():
            yield path
        elif path.is_dir() and not path.is_symlink() and not (path / MANIFEST).exists():
            yield from _own_files(path)


def _home(name: str) -> tuple[Path, bool]:
    """The folder of a package or module, and whether it is a package, with `__init__.py` or without."""
    import importlib.util

    spec = importlib.util.find_spec(name)
    if spec is not None and spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations))), True
    if spec is None or spec.origin is None:
        raise InputError(f"the package {name} is not installed here")
    return Path(spec.origin).parent, False


def _content(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def changed_sources(before: Sources, now: Sources) -> str:
    """What differs between two states of the code, in a phrase; "" if nothing does."""
    changes = [
        f"{file} {'is new' if file not in before else 'is gone' if file not in now else 'changed'}"
        for file in sorted({*before, *now})
        if before.get(file) != now.get(file)
    ]
    more = len(changes) - 3
    return ", ".join([*changes[:3], *([f"and {more} files more"] if more > 0 else [])])


def read_manifest(folder: Path) -> Manifest | None:
    """What the results in a folder follow from; None if it holds none yet. Raises InputError."""
    path = folder / MANIFEST
    try:
        content = path.read_bytes()
        form = msgspec.json.decode(content, type=ManifestForm).format
        if form != MANIFEST_FORMAT:
            raise InputError(
                f"is of format {form}, not {MANIFEST_FORMAT}: use another folder", str(path)
            )
        manifest = msgspec.json.decode(content, type=Manifest)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (msgspec.DecodeError, OSError) as error:
        raise InputError(f"cannot be read: {error}", str(path)) from None
    plain = msgspec.structs.replace(manifest, checksum="")
    if manifest.checksum != checksum_of(plain):
        raise InputError(
            "is damaged: it is not what was written; remove it, and the sweep of the same study into "
            "this folder writes it again and keeps the rows",
            str(path),
        )
    return plain


def manifest_json(manifest: Manifest) -> bytes:
    """A manifest as its file holds it, with its checksum."""
    sealed = msgspec.structs.replace(manifest, checksum=checksum_of(manifest))
    return msgspec.json.format(msgspec.json.encode(sealed), indent=1) + b"\n"


def checksum_of(manifest: Manifest) -> str:
    """32 hex digits of all that a manifest says."""
    return digest(msgspec.json.encode(manifest).decode())[:32]


def declared_by(study: Study) -> Declared:
    """What must be told of a study if it is another one after runs have been made."""
    analysis = msgspec.json.decode(msgspec.json.encode(study.analysis))  # as a manifest has it
    return Declared(study.max_replications, study.warm_up, analysis)


def manifest_of(
    study: Study,
    text: str,
    scenarios: tuple[Resolved, ...],
    windows: Windows,
    versions: dict[str, str],
    counted: tuple[str, ...],
) -> tuple[Manifest, tuple[str, ...]]:
    """The manifest of a study with this text, of which the points were resolved to these scenarios.

    And the modules of plug-ins that they use.
    """
    plugins = tuple(sorted(set().union(*map(plugins_of, scenarios))))
    each = zip(study.points, scenarios, strict=True)
    manifest = Manifest(
        study=study.name,
        text=text,
        replications=study.min_replications,
        seed=study.seed,
        common_random_numbers=study.common_random_numbers,
        points=tuple(
            PlannedPoint(
                point.scenario,
                point.levels,
                fingerprint(resolved, windows),
                windows,
                warm_up_of(resolved.unrefined.scenario),
            )
            for point, resolved in each
        ),
        sources=sources_of(plugins),
        versions=versions,
        counted=counted,
        rounds=(study.min_replications,) if study.in_rounds else msgspec.UNSET,
    )
    return manifest, plugins
