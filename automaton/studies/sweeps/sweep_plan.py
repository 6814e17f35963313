"""A study prepared to run: every design point is resolved and checked before the first run.

Copies of the study's own files and strategies make a results folder readable and repeatable anywhere.
Files keep their paths relative to the study; those that lie elsewhere get new names. What comes with
automaton or is installed is not copied.
"""

from __future__ import annotations

import contextlib
import glob
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import yaml

from automaton.errors import InputError, nearest
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.provenance import MANIFEST, is_installed, plugin_files, versions
from automaton.scenario.document import LOADER, Document, Override, keys_of, parse
from automaton.scenario.quantities import TIME
from automaton.scenario.reading import LONGEST_FILE_NAME
from automaton.scenario.table_fields import is_pattern
from automaton.scenario.text_files import SHIPPED_FOLDER, find, read_text
from automaton.scenario.unavailable_metrics import not_measured, warm_up_of
from automaton.scenario.validation import NumberRange, Place, convert
from automaton.strategy import lookup
from automaton.studies.inference.steady_state import MIN_OBSERVATIONS, MIN_REPLICATIONS, MSER_BATCH
from automaton.studies.sweeps.named_changes import NamedChange, place_of
from automaton.studies.sweeps.result_store import ROWS_FOLDER, STUDY_FILE, Copies
from automaton.studies.sweeps.run_keys import (
    WHOLE_RUNS,
    Manifest,
    Windows,
    fingerprint,
    manifest_of,
    plugins_of,
)
from automaton.studies.sweeps.study import (
    MAX_WINDOW,
    RESULT_COLUMNS,
    RUN_METRICS,
    Point,
    Study,
    checked_study,
    document_of,
    study_document,
)
from automaton.world.resolve import Resolved, resolve

DEFAULT_WINDOWS = 200  # number of windows in a run, unless a study gives their length
MSER = "mser-5"  # value of warm_up
WARM_UP_KEYS = ("measure", "warm_up")
OUTSIDE_FOLDER: Final = "outside"  # folder of the files that are not below the study's folder
# An installed package of this name finds the strategies that a results folder holds.
ENTRY_POINTS_FOLDER: Final = "study_strategies-0.dist-info"
ENTRY_POINTS_METADATA: Final = b"Metadata-Version: 2.1\nName: study-strategies\nVersion: 0\n"
RESERVED_FILE_NAMES: Final = (MANIFEST, STUDY_FILE, ROWS_FOLDER, OUTSIDE_FOLDER)
SCENARIO_KEY: Final = "scenario"
NO_FILES: Final = ("name", "summary")  # keys whose values name no files


class SweepPlan(NamedTuple):
    """Everything that determines the runs of a study."""

    study: Study
    points: tuple[Point, ...]
    scenarios: tuple[Resolved, ...]  # by point
    plugins: tuple[str, ...]  # modules of foreign strategies
    manifest: Manifest
    copies: Copies  # of the files that the study uses, with their paths in a results folder

    @property
    def runs(self) -> int:
        """Number of runs; of a study in rounds, up to the end of the present round."""
        return len(self.points) * self.manifest.replications


def make_sweep_plan(study: str | Path | Study | Document) -> SweepPlan:
    """Check and plan a study: a path, a shipped name, a Study or its document. Raises InputError.

    This imports the study's strategies, and therefore Numba.
    """
    declared, document, scenarios = resolved_study(study)
    names = counted_by(scenarios)
    check_metrics(document, declared, scenarios, names)
    windows = windows_of(declared, scenarios)
    text = document.text or yaml.safe_dump(_plain(declared), sort_keys=False, allow_unicode=True)
    portable, copies = whole_study(document, declared, text, scenarios)
    if portable != text:
        renamed = checked_study(document_of(portable, Path(STUDY_FILE)))
        declared = msgspec.structs.replace(renamed, window=declared.window)
    packages = versions() | plugin_versions(scenarios)
    manifest, plugins = manifest_of(declared, portable, scenarios, windows, packages, names)
    return SweepPlan(declared, declared.points, scenarios, plugins, manifest, copies)


def resolved_study(
    study: str | Path | Study | Document,
) -> tuple[Study, Document, tuple[Resolved, ...]]:
    """The study, its document, and the resolved scenario of each point. Raises InputError.

    Does not import Numba.
    """
    document = _document(study)
    if document.file is not None:
        lookup.look_in(str(document.folder.absolute()))  # strategies may be beside the study
    declared = checked_study(document)
    scenarios = tuple(_resolved(document, declared, point) for point in declared.points)
    _check_changes(document, declared, scenarios)
    seen: dict[str, Point] = {}
    for point, resolved in zip(declared.points, scenarios, strict=True):
        first = seen.setdefault(fingerprint(resolved), point)
        if first is not point:
            text = f"points {first.number} and {point.number} have the same runs: {describe_point(point)}"
            if point.name:
                text = f"'{first.name}' and '{point.name}' are the same scenario"
            raise document.error(_where(declared, point), text)
    declared = with_window_in_ticks(document, declared, scenarios)
    check_windows(document, declared, scenarios)
    return declared, document, scenarios


def _check_changes(document: Document, study: Study, scenarios: tuple[Resolved, ...]) -> None:
    """Raise InputError for a named point whose settings change nothing."""
    as_it_is: dict[str, str] = {}  # scenario -> fingerprint; "" if only its points can be run
    for point, resolved in zip(study.points, scenarios, strict=True):
        if point.change is None:
            continue
        if point.scenario not in as_it_is:
            as_it_is[point.scenario] = ""
            with contextlib.suppress(InputError):
                unchanged = _resolved(document, study, Point(point.number, point.scenario, {}))
                as_it_is[point.scenario] = fingerprint(unchanged)
        if fingerprint(resolved) == as_it_is[point.scenario]:
            keys = (*_where(study, point), "set")
            raise document.error(keys, without_effect(point.name, point.scenario))


def without_effect(name: str, scenario: str) -> str:
    """The sentence about a named change that changes nothing."""
    return (
        f"'{name}' changes nothing: with these settings {scenario} is the same scenario; leave `set` out "
        "for the scenario as it is"
    )


def resolve_changes(
    scenario: str | Path, settings: Sequence[str | Override], changes: Sequence[NamedChange]
) -> list[Resolved]:
    """The scenario with some settings and each of the changes. Raises InputError.

    Refuses a change without effect, with its file and line.
    """
    as_it_is = resolve(scenario, settings)
    scenarios = []
    for change in changes:
        changed = resolve(scenario, (*settings, *change.overrides)) if change.settings else as_it_is
        if change.settings is not None and fingerprint(changed) == fingerprint(as_it_is):
            raise InputError(without_effect(change.name, str(scenario)), *change.place)
        scenarios.append(changed)
    return scenarios


def with_same_right_of_way(
    study: Document, plan: SweepPlan, base: Resolved, note: Callable[[str], None]
) -> SweepPlan:
    """The plan of changes of a scenario, in which a change replaces its right of way only if it must.

    `note`: is called with a sentence about each change with another default.
    """
    rule, points = base.scenario.strategy.right_of_way, list(study.data["points"])
    for number, (point, resolved) in enumerate(zip(points, plan.scenarios, strict=True)):
        settings = point.get("set") or {}
        keeping = resolved.unrefined.with_rule_of(base, settings)
        if keeping == settings:
            continue
        other = resolved.unrefined.scenario.strategy.right_of_way
        points[number] = {**point, "set": keeping}
        try:
            plan = make_sweep_plan(replace(study, data={**study.data, "points": points}))
        except InputError as error:
            points[number], why = point, f"right of way {other} instead of {rule}, which is refused"
            note(f"{point['name']}: warning: {why}: {error.message}")
        else:
            note(f"{point['name']}: right of way {rule} as in the scenario; its default is {other}")
    return plan


def _document(study: str | Path | Study | Document) -> Document:
    if isinstance(study, Study):
        return Document(data=_plain(study))
    return study if isinstance(study, Document) else study_document(study)


def _plain(study: Study) -> dict[str, Any]:
    data: dict[str, Any] = msgspec.to_builtins(study)
    if study.analysis is not None and not study.analysis.metrics:
        del data["analysis"]["metrics"]
    return {key: value for key, value in data.items() if value is not None}


def _resolved(document: Document, study: Study, point: Point) -> Resolved:
    settings = [
        Override(place_of(document, ("set", key)), keys_of(key), value)
        for key, value in (study.settings or {}).items()
    ]
    settings += [
        Override(_place(document, study, point, key), keys_of(key), value)
        for key, value in point.settings.items()
    ]
    if study.warm_up is not None and study.warm_up != MSER:
        argument = place_of(document, ("warm_up",))
        settings.append(Override(argument, WARM_UP_KEYS, study.warm_up))
    file = scenario_file(document, point.scenario)
    try:
        resolved = resolve(file, settings)
    except InputError as error:
        error.message = f"{error.message} (point {point.number}: {describe_point(point)})"
        raise error.at(document.file, document.line(("scenario",))) from None
    if study.design == "steady-state" and resolved.scenario.stop.when != "never":
        text = (
            "a steady-state study needs runs of fixed length: set stop.when: never in the scenario"
        )
        raise document.error(("design",), f"{text} (point {point.number}: {describe_point(point)})")
    if study.design == "steady-state" and resolved.scenario.refine > 1:
        text = "a steady-state study cannot be refined: remove refine or design: steady-state"
        raise document.error(("design",), f"{text} (point {point.number}: {describe_point(point)})")
    every = {**(study.settings or {}), **point.settings}
    spelled = tuple(f"{key}={json.dumps(value)}" for key, value in every.items())
    return replace(resolved, overrides=spelled)


def describe_point(point: Point) -> str:
    """A point in words: "tabletop-1, fleet.robots 3"; a named point: "tabletop-1, one robot more"."""
    if point.name:
        return f"{point.scenario}, {point.name}"
    levels = (
        f"{key} {level if isinstance(level, str) else json.dumps(level)}"
        for key, level in point.levels.items()
    )
    return ", ".join([point.scenario, *levels])


def scenario_file(document: Document, name: str) -> Path:
    """Find a scenario of a study: relative to the study, to the working folder, or a shipped one.

    Raises InputError.
    """
    beside = document.folder / name
    if document.file is not None and os.path.isfile(beside):
        return beside
    try:
        return find(name)
    except InputError as error:
        text = f"{name}: {error.message}" if error.file else error.message
        raise document.error(("scenario",), text) from None


def _where(study: Study, point: Point) -> tuple[str | int, ...]:
    """The keys of a point in its study."""
    if study.listed is None:
        return ("factors",)
    return ("points", point.number % len(study.listed))


def _place(document: Document, study: Study, point: Point, key: str) -> str:
    """The place of a point's level in the study, for error messages."""
    if study.factors is None:
        inner = ("set", key) if study.is_named else (key,)
        return place_of(document, (*_where(study, point), *inner))
    levels = study.factors[key]
    index = next(i for i, level in enumerate(levels) if level is point.levels[key])
    return place_of(document, ("factors", key, index))


def with_window_in_ticks(
    document: Document, study: Study, scenarios: tuple[Resolved, ...]
) -> Study:
    """The study with a window given as a time converted to ticks. Raises InputError."""
    if not isinstance(study.window, str):
        return study
    place = Place(TIME, NumberRange(is_whole=True, ge=1, le=MAX_WINDOW))
    try:
        ticks = {
            convert("window", study.window, place, resolved.scenario.units.scale).value
            for resolved in scenarios
        }
    except InputError as error:
        raise document.error(("window",), error.message) from None
    if len(ticks) > 1:
        text = (
            f"window {study.window} is a different number of ticks at some points; give it in ticks"
        )
        raise document.error(("window",), text)
    return msgspec.structs.replace(study, window=int(ticks.pop()))


def windows_of(study: Study, scenarios: tuple[Resolved, ...]) -> Windows:
    """The windows of a study's rows, equal at all points so that they share one warm-up cut."""
    if study.design != "steady-state":
        return WHOLE_RUNS
    ticks = shortest(scenarios)
    window = int(study.window or 0) or math.ceil(ticks / DEFAULT_WINDOWS)
    groups = math.ceil(ticks / (window * DEFAULT_WINDOWS))
    return Windows(window, window * MSER_BATCH * groups)


def shortest(scenarios: tuple[Resolved, ...]) -> int:
    """Ticks of the shortest runs of a steady-state study."""
    return min(resolved.scenario.stop.max_duration for resolved in scenarios)


def counted_by(scenarios: tuple[Resolved, ...]) -> tuple[str, ...]:
    """The counters of the strategies in use that are neither in the catalogue nor result columns."""
    picks = {(layer, choice.name) for resolved in scenarios for layer, choice in resolved.choices}
    names = {
        name
        for layer, strategy in sorted(picks)
        if strategy != lookup.NO_STRATEGY
        for name in getattr(lookup.load(layer, strategy), "counters", {})
    }
    return tuple(sorted(names - set(METRIC_CATALOGUE) - set(RESULT_COLUMNS)))


def check_metrics(
    document: Document, study: Study, scenarios: tuple[Resolved, ...], counted: tuple[str, ...]
) -> None:
    """Raise InputError for a metric of the analysis that no run has."""
    known = [*RUN_METRICS, *METRIC_CATALOGUE, *counted]
    lacking = [not_measured(resolved.scenario) for resolved in scenarios]
    for number, name in enumerate(study.analysis.metrics if study.analysis else ()):
        place = ("analysis", "metrics", number)
        if name not in known:
            hint = nearest(name, known) or f"; there are {', '.join(known)}"
            raise document.error(place, f"no metric is called '{name}'{hint}")
        if all(name in one for one in lacking):
            needs = lacking[0][name]
            raise document.error(place, f"no point of this study measures {name}; it needs {needs}")


def check_windows(document: Document, study: Study, scenarios: tuple[Resolved, ...]) -> None:
    """Raise InputError if some runs end within the declared warm-up, or are too few for MSER-5."""
    if study.design == "steady-state":
        check_cut(document, study, scenarios)
    if study.warm_up != MSER:
        return
    if study.min_replications < MIN_REPLICATIONS:
        text = f"warm_up: mser-5 needs {MIN_REPLICATIONS} replications, but the study has"
        raise document.error(("replications",), f"{text} {study.min_replications}")
    window, ticks = windows_of(study, scenarios).window, shortest(scenarios)
    if ticks // window < MIN_OBSERVATIONS:
        text = (
            f"warm_up: mser-5 needs {MIN_OBSERVATIONS} windows in a run, but stop.max_duration "
            f"{ticks:,} has {ticks // window} of {window:,} ticks"
        )
        where = ("window",) if study.window else ("warm_up",)
        raise document.error(where, text)


def check_cut(document: Document, study: Study, scenarios: tuple[Resolved, ...]) -> None:
    """Raise InputError if the largest warm-up of a steady state leaves nothing of some runs."""
    declared = [warm_up_of(resolved.scenario) for resolved in scenarios]
    cut, ticks = max(declared), shortest(scenarios)
    if min(declared) < cut:  # sums of some runs can be cut only at the end of a stretch
        stretch = windows_of(study, scenarios).stretch
        cut = math.ceil(cut / stretch) * stretch
    if cut < ticks:
        return
    point = next(
        point
        for point, resolved in zip(study.points, scenarios, strict=True)
        if resolved.scenario.stop.max_duration == ticks
    )
    text = (
        f"the largest warm-up applies to all points and excludes the first {cut:,} ticks, but runs of "
        f"point {point.number} end after {ticks:,} ({describe_point(point)}); use a shorter warm-up "
        "or longer runs"
    )
    raise document.error(_where(study, point), text)


def check_study(name: str | Path) -> tuple[Study, tuple[Resolved, ...]]:
    """Check a study as far as possible without running it. Raises InputError."""
    study, document, scenarios = resolved_study(name)
    ordinary = {*RUN_METRICS, *METRIC_CATALOGUE}
    asked = study.analysis.metrics if study.analysis else ()
    strange = [metric for metric in asked if metric not in ordinary]
    check_metrics(document, study, scenarios, counted_by(scenarios) if strange else ())
    return study, scenarios


# Copies of the files of a study, under names that a results folder can have anywhere.


class CopyPlaces:
    """The files of a study, each with its path in a results folder.

    Files below `home` keep their paths there; others are in OUTSIDE_FOLDER, by the name of their folder.
    """

    def __init__(self, home: Path) -> None:
        self.home = Path(os.path.abspath(home))
        self.files: dict[str, Path] = {}  # path in the results folder -> file
        self._folders: dict[Path, str] = {}  # folders elsewhere -> their names in OUTSIDE_FOLDER

    def place(self, file: Path) -> str:
        """The path of a file in the results folder, where it will be copied."""
        path = Path(os.path.abspath(file))
        if path.is_relative_to(self.home):
            place = path.relative_to(self.home)
            if place.parts[0] not in RESERVED_FILE_NAMES:
                self.files[place.as_posix()] = path
                return place.as_posix()
        if path.parent not in self._folders:
            first = name = path.parent.name or "root"
            number = 1
            while name in self._folders.values():
                number += 1
                name = f"{first}-{number}"
            self._folders[path.parent] = name
        place = Path(OUTSIDE_FOLDER, self._folders[path.parent], path.name)
        self.files[place.as_posix()] = path
        return place.as_posix()

    def names_in(self, data: Any, bases: Sequence[Path], scenario: str) -> dict[str, str]:
        """{name of a file in data: its name for the copy of a scenario with this place}."""
        folder = os.path.dirname(scenario) or "."
        names: dict[str, str] = {}
        for name in texts_of(data):
            places = [self.place(path) for path in files_at(name, bases)]
            if not places or is_pattern(os.path.dirname(name)):
                continue
            renamed = os.path.relpath(places[0], folder)
            if is_pattern(name):
                renamed = os.path.join(os.path.dirname(renamed), os.path.basename(name))
            names[name] = name if os.path.normpath(name) == renamed else renamed
        return names


def whole_study(
    document: Document, study: Study, text: str, scenarios: tuple[Resolved, ...]
) -> tuple[str, Copies]:
    """The text of a study and copies of its files, so that a results folder needs no other file.

    Scenarios and files that lie outside the study's folder get other names, in the text and in the
    copies of scenarios. Raises InputError.
    """
    places = CopyPlaces(document.folder)
    texts: dict[str, bytes] = {}  # place of a scenario -> its text, if names in it change
    renamed: dict[str, str] = {}  # scenario as named in the study -> its place
    files: dict[str, set[str]] = {}  # file as named in the study -> its names for the scenarios
    for name in dict.fromkeys(point.scenario for point in study.points):
        file = scenario_file(document, name)
        bases = [file.parent]
        if file.resolve().is_relative_to(SHIPPED_FOLDER):
            if not any(files_at(one, [Path()]) for one in texts_of(document.data)):
                continue  # it comes with automaton, and so do its files
            bases.append(Path())
        place = renamed[name] = places.place(file)
        for one, inner in places.names_in(document.data, bases, place).items():
            files.setdefault(one, set()).add(inner)
        content = read_text(file)
        changed = with_names(content, places.names_in(parse(content, None)[0], bases, place))
        texts |= {place: changed.encode()} if changed != content else {}
    one_name = {name: names.pop() for name, names in files.items() if len(names) == 1}
    copies = {place: _content(file) for place, file in places.files.items()}
    copies |= {**texts, **plugin_copies(scenarios)}
    return with_names(text, one_name, renamed), copies


def texts_of(data: Any, key: str = "") -> Iterator[str]:
    """The texts in data of a scenario or study that may name files."""
    if isinstance(data, dict):
        for inner, value in data.items():
            yield from texts_of(value, inner)
    elif isinstance(data, list | tuple):
        for value in data:
            yield from texts_of(value, key)
    elif (
        isinstance(data, str)
        and key not in (SCENARIO_KEY, *NO_FILES)
        and 0 < len(data) <= LONGEST_FILE_NAME
    ):
        yield data


def files_at(name: str, bases: Iterable[Path]) -> list[Path]:
    """The files that a text names in the first folder that has any; wildcards name several."""
    for base in bases:
        if os.path.isfile(base / name):
            return [base / name]
        if is_pattern(name) and name.isprintable():
            names = sorted(glob.glob(name, root_dir=base))
            if files := [base / one for one in names if os.path.isfile(base / one)]:
                return files
    return []


def with_names(text: str, files: dict[str, str], scenarios: Mapping[str, str] = {}) -> str:
    """A YAML text with other names of files and, at the key `scenario`, of scenarios."""
    changes: dict[int, tuple[int, str]] = {}

    def look(node: yaml.Node, key: str) -> None:
        if isinstance(node, yaml.ScalarNode):
            names = {} if key in NO_FILES else scenarios if key == SCENARIO_KEY else files
            if names.get(node.value, node.value) != node.value:
                written = json.dumps(names[node.value], ensure_ascii=False)
                changes[node.start_mark.index] = (node.end_mark.index, written)
        elif isinstance(node, yaml.MappingNode):
            for name, inner in node.value:
                look(inner, name.value)
        else:
            for inner in node.value:
                look(inner, key)

    root = yaml.compose(text, Loader=LOADER)
    if root is not None:
        look(root, "")
    for begin, (end, written) in sorted(changes.items(), reverse=True):
        text = text[:begin] + written + text[end:]
    return text


def plugin_copies(scenarios: tuple[Resolved, ...]) -> Copies:
    """The files of the strategies and generators in use, except those of installed packages.

    Raises InputError for a package that has the name of a folder of results.
    """
    modules = set().union(*map(plugins_of, scenarios))
    for resolved in scenarios:
        module, colon, _ = str(resolved.scenario.layout.get("generator", "")).partition(":")
        modules |= {module} if colon else set()
    copies: dict[str, bytes] = {}
    for module in sorted(modules):
        root, files = plugin_files(module)
        if not is_installed(root):
            copies |= {path.relative_to(root).as_posix(): _content(path) for path in files}
    copies |= entry_point_copies(scenarios)
    for place in copies:
        package, below, _ = place.partition("/")
        if below and package in (ROWS_FOLDER, OUTSIDE_FOLDER):
            raise InputError(
                f"the package '{package}' of a strategy cannot be copied into a results folder, which "
                f"has a folder '{package}' of its own: rename the package"
            )
    return copies


def entry_point_copies(scenarios: tuple[Resolved, ...]) -> Copies:
    """The entry points of the strategies whose files are copied, as those of a package."""
    lines = [
        f"{layer}.{name} = {point.value}"
        for (layer, name), point in entry_points_of(scenarios).items()
        if not is_installed(plugin_files(point.module)[0])
    ]
    if not lines:
        return {}
    points = "\n".join([f"[{lookup.PLUGINS}]", *lines, ""])
    return {
        f"{ENTRY_POINTS_FOLDER}/METADATA": ENTRY_POINTS_METADATA,
        f"{ENTRY_POINTS_FOLDER}/entry_points.txt": points.encode(),
    }


def plugin_versions(scenarios: tuple[Resolved, ...]) -> dict[str, str]:
    """The versions of the installed packages whose strategies are in use, which are not copied."""
    return {
        point.dist.name: point.dist.version
        for point in entry_points_of(scenarios).values()
        if is_installed(plugin_files(point.module)[0])
    }


def entry_points_of(scenarios: tuple[Resolved, ...]) -> dict[tuple[str, str], Any]:
    """The entry points of the strategies in use, by layer and name."""
    names = {(layer, one.name) for resolved in scenarios for layer, one in resolved.choices}
    points = {one: lookup.entry_point(*one) for one in sorted(names)}
    return {one: point for one, point in points.items() if point is not None}


def _content(file: Path) -> bytes:
    """The content of a file. Raises InputError."""
    try:
        return file.read_bytes()
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read: {why}", str(error.filename)) from None
