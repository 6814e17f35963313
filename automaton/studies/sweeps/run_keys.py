"""The manifest of a results folder, and the key that identifies each run.

    key = hash(version of the code, resolved scenario, seed)

A row belongs to the study of a folder if its key is one of the keys of the manifest. Results of other
code or of another floor have other keys.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.printable import one_line
from automaton.runs.provenance import MANIFEST, PACKAGES, Sources, file_hashes, sources_of
from automaton.scenario.order_lines import plain_data
from automaton.scenario.unavailable_metrics import warm_up_of
from automaton.strategy import lookup
from automaton.studies.sweeps.study import Levels, Study
from automaton.world.resolved import Resolved

MANIFEST_FORMAT: Final = 5
DRAWN_ELSEWHERE: Final = ("file", "matrix")  # keys of a layout whose floor is in a separate file
MAX_REASON_LENGTH: Final = 500  # characters


class SweepRun(NamedTuple):
    """One run of a study."""

    key: str
    point: int
    replication: int
    seed: int


Row = dict[str, Any]  # stored results of a run, by column; its metrics under "metrics"


def blank(run: SweepRun, failed: str | None = None) -> Row:
    """The row of a run without results; `failed`: why it failed."""
    return {**run._asdict(), "finished": False, "error": failed, "metrics": {}}


def reason(text: str) -> str:
    """Why a run failed, as stored in a row: one line of limited length and valid Unicode."""
    return one_line(text.encode(errors="replace").decode(), MAX_REASON_LENGTH)


class Windows(NamedTuple):
    """The time resolution of steady-state rows in ticks; 0: no time series."""

    window: int = 0  # length of the windows in which deliveries are counted
    stretch: int = 0  # length of the stretches (several windows) for which all sums are stored


WHOLE_RUNS: Final = Windows()


class PlannedPoint(msgspec.Struct, frozen=True):
    """A resolved design point."""

    scenario: str
    levels: Levels
    fingerprint: str  # of the resolved scenario, floor included
    windows: Windows
    warm_up: int  # ticks that the metrics of its rows exclude


class Declared(msgspec.Struct, frozen=True):
    """The parts of a study that concern its analysis and do not enter the keys of runs."""

    # Bound of a study in rounds; in an earlier declaration, the replications requested by then.
    replications: int
    warm_up: int | str | None
    analysis: Any  # as plain data; None: nothing was declared

    def analysed_as(self, other: Declared) -> bool:
        """Whether warm-up and analysis are the same."""
        return (self.warm_up, self.analysis) == (other.warm_up, other.analysis)


class ManifestForm(msgspec.Struct, frozen=True):
    """The part of a manifest that is the same in all formats."""

    format: int


class Manifest(msgspec.Struct, frozen=True):
    """Everything that determines the results in a folder."""

    study: str
    text: str  # content of the study file
    replications: int  # of a study in rounds: up to the present round
    seed: int
    common_random_numbers: bool
    points: tuple[PlannedPoint, ...]
    sources: Sources
    versions: dict[str, str]  # of libraries; for information only
    counted: tuple[str, ...]  # metrics counted by strategies
    earlier: tuple[Declared, ...] = ()  # declarations that changed after runs were made
    # Replications after each round, if a study continues until it reaches a precision.
    rounds: tuple[int, ...] | msgspec.UnsetType = msgspec.UNSET
    format: int = MANIFEST_FORMAT
    checksum: str = ""  # of all other fields, in a file; "" in memory

    def going_on(self, replications: int) -> Manifest:
        """The manifest of the next round; `replications`: number after this round."""
        rounds = () if self.rounds is msgspec.UNSET else self.rounds
        return msgspec.structs.replace(
            self, replications=replications, rounds=(*rounds, replications)
        )

    @property
    def version(self) -> str:
        """Hash of the code, 16 hex digits."""
        return hashed(self.sources)

    def runs(self) -> Iterator[SweepRun]:
        """All runs, by replication and then by point."""
        version = self.version
        for replication in range(self.replications):
            for point in range(len(self.points)):
                yield self.run(version, point, replication)

    def run(self, version: str, point: int, replication: int) -> SweepRun:
        """One run; `version` is `self.version`, which is slow to compute."""
        planned = self.points[point]
        salt = "" if self.common_random_numbers else f" {planned.fingerprint}"
        seed = seed_of(f"{self.seed} {replication}{salt}")
        return SweepRun(run_key(version, planned.fingerprint, seed), point, replication, seed)

    def keys(self) -> set[str]:
        """The keys of all runs."""
        return {run.key for run in self.runs()}


def run_key(version: str, fingerprint: str, seed: int) -> str:
    """The key of a run by the code, its scenario and its seed, 32 hex digits."""
    return digest(f"{version} {fingerprint} {seed}")[:32]


def seed_of(text: str) -> int:
    """A seed from 0 to 2^63 - 1, derived from a text."""
    return int(digest(text)[:16], 16) >> 1


def replication_seeds(seed: int, first: int, number: int) -> list[int]:
    """Seeds of `number` replications from `first` on, as in a sweep with common random numbers."""
    return [seed_of(f"{seed} {replication}") for replication in range(first, first + number)]


def digest(text: str) -> str:
    """The SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def hashed(value: Any) -> str:
    """Hash of data, 16 hex digits; the order of keys does not matter."""
    return digest(json.dumps(value, sort_keys=True, ensure_ascii=False, default=str))[:16]


def fingerprint(resolved: Resolved, windows: Windows = WHOLE_RUNS) -> str:
    """Hash of a resolved scenario without its seed and summary, 32 hex digits.

    Files count by content, not by path, so the hash is the same in another folder or on another
    machine. A floor counts as built. `windows`: the windows of its rows.
    """
    scenario = plain_data(resolved.scenario)
    del scenario["seed"], scenario["summary"]
    for form in DRAWN_ELSEWHERE:
        scenario["layout"].pop(form, None)
    if resolved.day_pattern:  # the seed of a run draws one
        scenario["orders"] = [day.key for day in resolved.days]
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
    """Plain data with each path replaced by the hash of the file; `contents`: path -> hash."""
    if isinstance(data, dict):
        return {key: by_content(value, contents) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [by_content(value, contents) for value in data]
    return contents.get(data, data) if isinstance(data, str) else data


def plugins_of(resolved: Resolved) -> set[str]:
    """The modules of a scenario's strategies that are not built in."""
    places = (lookup.place(layer, choice.name) for layer, choice in resolved.choices)
    modules = {place.partition(":")[0] for place in places if place}
    return {module for module in modules if module.partition(".")[0] not in PACKAGES}


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a folder; None if it has no results yet. Raises InputError."""
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
            "is damaged; delete it and sweep the same study into this folder again: this restores the "
            "file and keeps the rows",
            str(path),
        )
    return plain


def manifest_json(manifest: Manifest) -> bytes:
    """The content of a manifest file, with the checksum."""
    sealed = msgspec.structs.replace(manifest, checksum=checksum_of(manifest))
    return msgspec.json.format(msgspec.json.encode(sealed), indent=1) + b"\n"


def checksum_of(manifest: Manifest) -> str:
    """Hash of all fields of a manifest, 32 hex digits."""
    return digest(msgspec.json.encode(manifest).decode())[:32]


def declared_by(study: Study) -> Declared:
    """The declaration of a study; reports mention changes of it after runs have been made."""
    analysis = msgspec.json.decode(msgspec.json.encode(study.analysis))  # as in a manifest file
    return Declared(study.max_replications, study.warm_up, analysis)


def manifest_of(
    study: Study,
    text: str,
    scenarios: tuple[Resolved, ...],
    windows: Windows,
    versions: dict[str, str],
    counted: tuple[str, ...],
) -> tuple[Manifest, tuple[str, ...]]:
    """The manifest of a study, and the modules of the plug-ins that its scenarios use.

    `text`: the content of the study file; `scenarios`: the resolved scenario of each point.
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
                point.settings,
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
