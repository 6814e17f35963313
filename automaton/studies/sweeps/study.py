"""Study files: the design points, the number of runs, and the declared analysis.

A study varies keys of one or several scenarios: `factors` crosses their levels, `points` lists the
combinations one by one. Points with names have one factor, the name: `point_name`. The study also
defines the columns of its results and the permitted factors.
This module imports without Numba and Arrow.
"""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple

import msgspec
from msgspec import Meta

from automaton.errors import InputError, InvalidValueError, nearest
from automaton.runs.metric_catalogue import METRIC_CATALOGUE
from automaton.runs.metric_sums import PERIOD_COLUMNS as PERIOD_COLUMNS
from automaton.runs.metric_sums import SUMS
from automaton.scenario.document import Document, parse
from automaton.scenario.floor_section import SCHEMA_REFERENCE
from automaton.scenario.reading import STUDY_KEYS
from automaton.scenario.schema import ConfigSection, NonEmptyText, SingleLine
from automaton.scenario.text_files import SHIPPED_FOLDER, read_text, shipped
from automaton.scenario.validation import MSER_OR_TIME, TIME_PATTERN, shown, validated
from automaton.studies.sweeps.named_changes import (
    FIXED_KEYS,
    NamedPoint,
    check_key,
    check_settings,
    checked_changes,
    is_named,
)
from automaton.studies.sweeps.named_changes import Levels as Levels
from automaton.units import count

# The columns of every row, before the factors and the metrics, with their types.
RESULT_COLUMNS: Final = {
    "key": "text",  # identifies the run: hash of scenario, seed and code
    "study": "text",
    "scenario": "text",  # name in the study
    "point": "int",  # number of the design point, from 0
    "replication": "int",  # from 0
    "seed": "int",
    "finished": "bool",
    "error": "text",  # why the run failed; null if it did not fail
    "ticks": "int",
    "orders": "int",
    "delivered": "int",
    "digest": "text",
    "standstill_at": "text",  # cell of the longest deadlock; null without one
    "standstill_from": "int",  # its first tick
    "jam": "text",  # the first jam, with its tick; null without one
    "wall_s": "float",  # of the run, including set-up
    "cpu_s": "float",
}
SERIES_COLUMN: Final = "series"  # deliveries in each window; only in steady-state studies
SUMS_COLUMN: Final = "sums"  # SUMS in each stretch of several windows; likewise
USES_COLUMN: Final = "time_uses"  # robot ticks of the whole run by use, as of `uses_of_run`
PERIODS_COLUMN: Final = "periods"  # PERIOD_COLUMNS by quarter of an hour; null without times
TICKS_PER_SECOND: Final = "ticks_per_second"  # computed in reports: `ticks` / `cpu_s`
RUN_METRICS: Final = {  # further metrics that an analysis may use: unit and meaning
    "ticks": ("ticks", "length of the run"),
    "orders": ("orders", "number of orders of the run"),
    TICKS_PER_SECOND: (
        "ticks/s",
        "simulated ticks per CPU second of the whole run; depends on the machine",
    ),
}
STUDY_WANTED: Final = (
    "a study is a separate file, such as {name: my-fleet, scenario: my-floor.yaml, "
    "factors: {fleet.robots: [2, 3]}, replications: 60}"
)
SHIPPED_STUDIES: Final = SHIPPED_FOLDER / "studies"
MAX_WINDOW: Final = 1_000_000  # ticks
MAX_DESIGN_POINTS: Final = 10_000
MAX_STUDY_RUNS: Final = 10_000_000
MIN_FIRST_ROUND: Final = 10  # runs; the variance of fewer runs would end a study too early
SCENARIO_FACTOR: Final = "scenario"  # a column, and a factor if a study has several scenarios
POINT_NAME: Final = "point_name"  # a column, and the factor of a study whose points have names


def check_factor(key: str) -> str | None:
    """Why a key cannot be a factor; None if it can."""
    if key in FIXED_KEYS:
        why = "set `seed` of the study" if key == "seed" else "it does not change runs"
        return f"{key} is not a factor: {why}"
    if key in RESULT_COLUMNS:
        return f"{key} cannot be a factor as a whole; vary a part of it, such as {key}.count"
    return check_key(key)


def column_type(levels: tuple[Any, ...]) -> str:
    """The type of a column with these levels: "int", "float", "bool", or "text"."""
    kinds = {type(level) for level in levels if level is not None}
    if kinds == {bool}:
        return "bool"
    if kinds == {int} and all(abs(level) < 2**63 for level in levels if level is not None):
        return "int"
    return "float" if kinds and kinds <= {int, float} else "text"


def column_value(level: Any, kind: str) -> Any:
    """The value of a level in its column: text as it is, lists and mappings as JSON."""
    if level is None:
        return None
    if kind == "text" and not isinstance(level, str):
        return json.dumps(level, ensure_ascii=False)
    return float(level) if kind == "float" else level


def metric_names(counted: tuple[str, ...] = ()) -> tuple[str, ...]:
    """All metrics that a row may have: those of the catalogue, then those counted by strategies.

    `delivered` is not included: it is one of RESULT_COLUMNS.
    """
    known = tuple(name for name in METRIC_CATALOGUE if name not in RESULT_COLUMNS)
    return (*known, *(name for name in counted if name not in known))


def sum_names(counted: tuple[str, ...] = ()) -> tuple[str, ...]:
    """The sums in a row of a steady state, including counters of strategies."""
    return (*SUMS, *(name for name in counted if name not in SUMS))


# The study.


def plain(value: Any) -> Any:
    """Convert a Python or NumPy value to plain data of a study file. Raises InputError."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, tuple):
        return tuple(map(plain, value))
    if isinstance(value, list | range):
        return list(map(plain, value))
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise InputError(f"a study holds numbers, text, lists and mappings, found {shown(value)}")


class Analysis(ConfigSection, frozen=True, kw_only=True):
    """The analysis of the runs, declared before they are made."""

    metrics: Annotated[
        tuple[NonEmptyText, ...],
        Meta(
            min_length=1,
            description="Metrics of the report, such as makespan. Required, except if points have "
            "names: then the default is throughput, lead_time, lead_time_p95 and late_share, "
            "where measured.",
        ),
    ] = ()
    paired: Annotated[
        bool | None,
        Meta(
            description="Whether runs of the same replication are compared in pairs; default: "
            "true if they have the same seed (common_random_numbers)."
        ),
    ] = None
    baseline: Annotated[
        Levels | NonEmptyText | None,
        Meta(
            description="The baseline: the points with these levels of some factors, {FACTOR: "
            "LEVEL}. If points have names: the name of the baseline (default: the first)."
        ),
    ] = None
    comparisons: Annotated[
        Literal["none", "baseline", "pairs"],
        Meta(
            description="Which points are compared. baseline: each point is compared with the "
            "baseline point that has the same levels of all factors that `baseline` does not "
            "list; pairs: every point is compared with every other. If points have names, the "
            "default is baseline."
        ),
    ] = "none"
    family: Annotated[
        Literal["metric", "study"],
        Meta(
            description="The family of tests that share one error probability. metric: the "
            "comparisons of one metric; study: all comparisons. Comparisons that decide which "
            "point is best belong to the family of the first metric."
        ),
    ] = "study"
    error: Annotated[
        float,
        Meta(
            gt=0,
            le=0.5,
            description="Error probability of the family; 0.05: 95 % intervals.",
        ),
    ] = 0.05
    precision: Annotated[
        Annotated[float, Meta(ge=1e-6, le=1)] | None,
        Meta(
            description="Target half-width of intervals. If there are comparisons, it applies to "
            "differences, as a share of the baseline mean; otherwise to means, as a share of the "
            "mean. The report estimates how many runs this needs; if `replications` is "
            "`{at_most: N}`, the sweep makes them."
        ),
    ] = None

    def __post_init__(self) -> None:
        msgspec.structs.force_setattr(self, "baseline", plain(self.baseline))
        if isinstance(self.baseline, dict) and self.comparisons != "baseline":
            raise ValueError("baseline needs comparisons: baseline")

    @property
    def baseline_levels(self) -> Levels:
        """The levels of the baseline by factor; {} without a baseline."""
        if isinstance(self.baseline, str):
            return {POINT_NAME: self.baseline}
        return self.baseline or {}


class Replications(ConfigSection, frozen=True, kw_only=True):
    """Sequential replication: rounds of runs, until all intervals reach analysis.precision."""

    at_most: Annotated[
        int,
        Meta(ge=MIN_FIRST_ROUND, le=1_000_000, description="Greatest number of runs of a point."),
    ]
    at_least: Annotated[
        int,
        Meta(
            ge=MIN_FIRST_ROUND, le=1_000_000, description="Runs of each point in the first round."
        ),
    ] = 20

    def __post_init__(self) -> None:
        if self.at_least > self.at_most:
            raise ValueError(f"at_least {self.at_least} is more than at_most {self.at_most}")


class Point(NamedTuple):
    """A design point: a scenario with some keys changed."""

    number: int  # from 0, in the order of the study
    scenario: str  # name in the study
    levels: Levels  # by factor
    change: Levels | None = None  # settings of a named point; None: the scenario as it is

    @property
    def name(self) -> str:
        """The name; "" for a point without one."""
        return str(self.levels.get(POINT_NAME, ""))

    @property
    def settings(self) -> Levels:
        """The keys of the scenario that this point sets, with their values."""
        return (self.change or {}) if self.name else self.levels


class Study(ConfigSection, frozen=True, kw_only=True):
    """A study: scenarios, the factors that vary, and the number of runs."""

    name: Annotated[SingleLine, Meta(description="Name of the study in tables.")]
    summary: Annotated[SingleLine | None, Meta(description="One line for `automaton list`.")] = None
    scenario: Annotated[
        NonEmptyText | tuple[NonEmptyText, ...],
        Meta(description="The scenario, by path or shipped name, or a list of scenarios."),
    ]
    factors: Annotated[
        dict[str, Any] | None,
        Meta(
            description="Factors: keys of the scenario, such as fleet.robots, each with its levels."
        ),
    ] = None
    listed: Annotated[
        tuple[Levels, ...] | None,
        Meta(
            description="A list of points, instead of factors. Each is {name: NAME, set: {KEY: "
            "VALUE, ...}} or, without a name, {KEY: VALUE, ...}."
        ),
    ] = msgspec.field(name="points", default=None)
    settings: Annotated[
        Levels | None,
        Meta(
            description="Settings for all points, {KEY: VALUE, ...}; factors and points override them."
        ),
    ] = msgspec.field(name="set", default=None)
    replications: Annotated[
        Annotated[int, Meta(ge=1, le=1_000_000)] | Replications,
        Meta(
            description="Number of runs of each point, with different seeds. With {at_least: 20, "
            "at_most: 200}, there are as many as analysis.precision requires, within these limits."
        ),
    ]
    seed: Annotated[
        int,
        Meta(ge=0, le=2**63 - 1, description="The seed that determines the seeds of all runs."),
    ] = 1
    common_random_numbers: Annotated[
        bool,
        Meta(
            description="Whether replication r of every point has the same seed, and so the same "
            "demand."
        ),
    ] = True
    design: Annotated[
        Literal["terminating", "steady-state"],
        Meta(
            description="Whether runs end by themselves (terminating), or are a section of an endless "
            "process (steady-state)."
        ),
    ] = "terminating"
    warm_up: Annotated[
        Annotated[int, Meta(ge=0, le=2_000_000_000)]
        | Annotated[str, Meta(pattern=MSER_OR_TIME)]
        | None,
        Meta(
            description="Warm-up period of a steady state, in ticks or as a time such as 30 min; "
            "mser-5: determined by the MSER-5 rule."
        ),
    ] = None
    window: Annotated[
        Annotated[int, Meta(ge=1, le=MAX_WINDOW)]
        | Annotated[str, Meta(pattern=TIME_PATTERN)]
        | None,
        Meta(
            description="Length of the periods in which the deliveries of a steady state are counted, "
            "in ticks or as a time such as 10 min; default: 1/200 of the run, at least 1 tick."
        ),
    ] = None
    analysis: Analysis | None = None

    def __post_init__(self) -> None:
        for field in set(self.__struct_fields__) - {"analysis", "replications"}:
            msgspec.structs.force_setattr(self, field, plain(getattr(self, field)))
        if (self.factors is None) == (self.listed is None):
            raise ValueError("a study must have either factors or points")
        if not self.scenarios:
            raise ValueError("scenario must name at least one scenario")
        if len(set(self.scenarios)) < len(self.scenarios):
            raise ValueError("scenario names a scenario twice")
        if not isinstance(self.replications, Replications):
            msgspec.structs.force_setattr(self, "replications", plain(self.replications))
        if self.factors is not None:
            self._check_factors(self.factors)
        if self.listed is not None and not self.listed:
            raise ValueError("points must list at least one point")
        if self.design == "terminating" and (self.warm_up is not None or self.window is not None):
            key = "window" if self.warm_up is None else "warm_up"
            raise ValueError(f"{key} needs design: steady-state")
        if self.is_named:
            named = analysis_of_names(self.analysis or Analysis(), self.levels(POINT_NAME))
            msgspec.structs.force_setattr(self, "analysis", named)
        if self.analysis and self.analysis.paired and not self.common_random_numbers:
            raise ValueError("common_random_numbers must be true because analysis.paired is true")

    def _check_factors(self, factors: dict[str, Any]) -> None:
        if not factors:
            raise ValueError("factors must have at least one key, such as fleet.robots")
        points = len(self.scenarios)
        for levels in factors.values():
            points *= max(1, len(levels)) if isinstance(levels, list | tuple) else 1
        if points > MAX_DESIGN_POINTS:
            raise ValueError(
                f"the factors give {points:,} points; the maximum is {MAX_DESIGN_POINTS:,}"
            )

    @property
    def in_rounds(self) -> bool:
        """Whether rounds of runs are made until a precision is reached."""
        return isinstance(self.replications, Replications)

    @property
    def min_replications(self) -> int:
        """Minimum number of runs of each point."""
        declared = self.replications
        return declared.at_least if isinstance(declared, Replications) else declared

    @property
    def max_replications(self) -> int:
        """Maximum number of runs of each point."""
        declared = self.replications
        return declared.at_most if isinstance(declared, Replications) else declared

    @property
    def planned(self) -> tuple[str, str]:
        """Numbers of replications and runs in words: "20 to 200 replications", "80 to 800 runs"."""
        words = count(self.max_replications, "replication"), count(self.runs, "run")
        if not self.in_rounds:
            return words
        least = len(self.points) * self.min_replications
        return f"{self.min_replications:,} to {words[0]}", f"{least:,} to {words[1]}"

    @property
    def paired(self) -> bool:
        """Whether comparisons are paired by replication."""
        declared = self.analysis.paired if self.analysis else None
        return self.common_random_numbers if declared is None else declared

    @property
    def scenarios(self) -> tuple[str, ...]:
        """The names of the scenarios in the study."""
        return (self.scenario,) if isinstance(self.scenario, str) else self.scenario

    @property
    def is_named(self) -> bool:
        """Whether the points have names, which are then the levels of the only factor."""
        return any(map(is_named, self.listed or ()))

    @property
    def factor_names(self) -> tuple[str, ...]:
        """The keys that vary: columns of the results."""
        if self.factors is not None:
            return tuple(self.factors)
        if self.is_named:
            return (POINT_NAME,)
        return tuple(dict.fromkeys(key for levels in self.listed or () for key in levels))

    def levels(self, factor: str) -> tuple[Any, ...]:
        """The levels of a factor, each once, in the order of the study."""
        if factor == SCENARIO_FACTOR:
            return self.scenarios
        if self.factors is not None:
            return tuple(self.factors[factor])
        found: list[Any] = []
        for levels in self._combinations():
            if factor in levels and levels[factor] not in found:
                found.append(levels[factor])
        return tuple(found)

    @property
    def points(self) -> tuple[Point, ...]:
        """The design points: every combination for each scenario; the last factor varies fastest."""
        changes: list[Levels | None] = [None] * len(self._combinations())
        if self.is_named:
            changes = [entry.get("set") for entry in self.listed or ()]
        each = zip(self._combinations(), changes, strict=True)
        return tuple(
            Point(number, scenario, *entry)
            for number, (scenario, entry) in enumerate(itertools.product(self.scenarios, each))
        )

    @property
    def runs(self) -> int:
        """Maximum number of runs of the study."""
        return len(self.scenarios) * len(self._combinations()) * self.max_replications

    def _combinations(self) -> list[Levels]:
        if self.is_named:
            return [{POINT_NAME: entry.get("name", "")} for entry in self.listed or ()]
        if self.factors is None:
            return list(self.listed or ())
        names = list(self.factors)
        crossed = itertools.product(*self.factors.values())
        return [dict(zip(names, levels, strict=True)) for levels in crossed]

    def column_types(self) -> dict[str, str]:
        """The type of each factor's column: "int", "float", "bool" or "text".

        Levels that are lists or mappings, or of several types, are stored as JSON text.
        """
        return {name: column_type(self.levels(name)) for name in self.factor_names}


def analysis_of_names(analysis: Analysis, names: tuple[Any, ...]) -> Analysis:
    """The analysis of points with names: against the baseline, unless all pairs are declared."""
    if analysis.comparisons == "pairs":
        return analysis
    baseline = analysis.baseline or names[0]
    return msgspec.structs.replace(analysis, comparisons="baseline", baseline=baseline)


def shipped_studies() -> dict[str, Path]:
    """The studies shipped with the package, by name."""
    return {path.stem: path for path in sorted(SHIPPED_STUDIES.glob("*.yaml"))}


def read_study(name: str | Path) -> Study:
    """Read a study by path or shipped name, without checking it against its scenarios.

    Raises InputError.
    """
    return checked_study(study_document(name))


def study_document(name: str | Path) -> Document:
    """The unchecked content of a study, given by path or shipped name. Raises InputError."""
    path = Path(name)
    known = shipped_studies()
    if not os.path.exists(path) and str(name) in known:
        path = known[str(name)]
    elif not os.path.exists(path) and path.suffix not in (".yaml", ".yml") and len(path.parts) == 1:
        if str(name) in shipped():
            raise InputError(f"'{name}' is a scenario; {STUDY_WANTED}")
        hint = nearest(str(name), known) or f"; there are {', '.join(known)}"
        raise InputError(f"no file and no shipped study is called '{name}'{hint}")
    elif not os.path.exists(path):
        raise InputError("no such file", str(name))
    elif os.path.isdir(path):
        raise InputError("is a folder, not a study file", str(name))
    return document_of(read_text(path), path)


def document_of(text: str, path: Path) -> Document:
    """The unchecked content of a study file with this text. Raises InputError."""
    data, root = parse(text, str(path))
    if data is None:
        raise InputError(
            "is empty; a study needs a name, scenario, factors and replications", str(path)
        )
    if not isinstance(data, dict):
        raise InputError("a study has keys such as name, scenario and factors", str(path), 1)
    return Document(data=data, file=str(path), folder=path.parent, text=text, root=root)


def checked_study(document: Document) -> Study:
    """The checked study of a document. Raises InputError with the line of an error."""
    if "layout" in document.data and STUDY_KEYS.isdisjoint(document.data):
        raise InputError(f"this is a scenario; {STUDY_WANTED}", document.file)
    try:
        study = validated(document.data, Study)
    except InvalidValueError as error:
        raise document.error(error.keys, error.message) from None
    check_settings(document, ("set",), study.settings or {})
    if study.is_named:
        checked_changes(document, study.listed or ())
    for where, levels in () if study.is_named else _declared(study):
        for key, value in levels.items():
            objection = check_factor(key)
            if objection:
                raise document.error((*where, key), objection)
            if study.factors is not None:
                _check_levels(document, key, value)
    if study.runs > MAX_STUDY_RUNS:
        text = f"the study has {study.runs:,} runs; the maximum is {MAX_STUDY_RUNS:,}"
        raise document.error(("replications",), text)
    if study.analysis is not None:
        _check_analysis(document, study, study.analysis)
    _check_precision(document, study)
    return study


def _check_precision(document: Document, study: Study) -> None:
    precise = study.analysis is not None and study.analysis.precision is not None
    compared = study.analysis is not None and study.analysis.comparisons != "none"
    if study.in_rounds and not precise:
        text = "replications with at_most need analysis.precision, which determines when to stop"
        raise document.error(("replications",), text)
    if precise and not compared and not study.in_rounds:
        text = (
            "precision needs comparisons, and none are declared; a precision of means needs "
            "replications: {at_most: N}, with which the sweep makes runs until it is reached"
        )
        raise document.error(("analysis", "precision"), text)


def _declared(study: Study) -> Iterator[tuple[tuple[str | int, ...], Levels]]:
    if study.factors is not None:
        yield ("factors",), dict(study.factors)
    for number, levels in enumerate(study.listed or ()):
        yield ("points", number), levels


def _check_levels(document: Document, key: str, levels: Any) -> None:
    keys = ("factors", key)
    if not isinstance(levels, list | tuple):
        text = f"factors.{key} must be a list of levels, found {shown(levels)}"
        raise document.error(keys, text)
    if not levels:
        raise document.error(keys, f"factors.{key} must list at least one level")
    for number, level in enumerate(levels):
        if any(_same(level, earlier) for earlier in levels[:number]):
            raise document.error((*keys, number), f"factors.{key} has {shown(level)} twice")


def _check_analysis(document: Document, study: Study, analysis: Analysis) -> None:
    keys: tuple[str, ...] = ("analysis", "comparisons")
    if study.is_named:
        _check_baseline_name(document, study, analysis)
        return
    if not analysis.metrics:
        raise document.error(keys[:1], "the key 'metrics' is missing in analysis")
    if isinstance(analysis.baseline, str):
        text = (
            f"analysis.baseline must be levels of factors such as {{fleet.robots: 4}}, found "
            f"{shown(analysis.baseline)}; only points with names can be called by a name"
        )
        raise document.error(("analysis", "baseline"), text)
    if analysis.comparisons == "baseline" and not analysis.baseline:
        raise document.error(keys, "comparisons with the baseline need a baseline")
    _check_baseline(document, study, analysis)


def _check_baseline_name(document: Document, study: Study, analysis: Analysis) -> None:
    """Check the baseline of points with names, and that they are compared."""
    declared = document.data.get("analysis") or {}
    if isinstance(declared, dict) and declared.get("comparisons") == "none":
        text = "points with names are always compared: leave comparisons: none out"
        raise document.error(("analysis", "comparisons"), text)
    names, baseline, keys = study.levels(POINT_NAME), analysis.baseline, ("analysis", "baseline")
    if isinstance(baseline, dict):
        text = f"analysis.baseline must be the name of a point, found {shown(baseline)}"
        raise document.error(keys, f"{text}; there are {', '.join(names)}")
    if baseline is not None and analysis.comparisons == "pairs":
        raise document.error(keys, "baseline needs comparisons: baseline")
    if baseline is not None and baseline not in names:
        text = f"the baseline '{baseline}' is not a point{nearest(baseline, names)}"
        raise document.error(keys, f"{text}; there are {', '.join(names)}")


def _check_baseline(document: Document, study: Study, analysis: Analysis) -> None:
    names = study.factor_names
    several = (SCENARIO_FACTOR,) if len(study.scenarios) > 1 else ()
    for key, level in analysis.baseline_levels.items():
        keys = ("analysis", "baseline", key)
        if key not in (*names, *several):
            known = ", ".join((*names, *several))
            hint = nearest(key, names)
            text = f"the baseline names '{key}', which is not a factor{hint}; there are {known}"
            raise document.error(keys, text)
        levels = study.levels(key)
        if not any(_same(level, known) for known in levels):
            found = ", ".join(shown(known) for known in levels)
            text = f"the baseline has {key} {shown(level)}, but the levels of {key} are: {found}"
            raise document.error(keys, text)


def _same(one: Any, other: Any) -> bool:
    # In Python 1 == True == 1.0.
    return bool(one == other) and isinstance(one, bool) == isinstance(other, bool)


def study_schema() -> dict[str, Any]:
    """A JSON Schema (2020-12) for editors and other programs."""
    (reference, named), definitions = msgspec.json.schema_components(
        (Study, NamedPoint), ref_template=SCHEMA_REFERENCE
    )
    properties = definitions["Study"]["properties"]
    mapping = properties["factors"]["anyOf"][0]
    mapping["additionalProperties"] = {"type": "array", "minItems": 1}
    points = properties["points"]["anyOf"][0]
    points["items"] = {"anyOf": [named, {**points["items"], "not": {"required": ["name"]}}]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "automaton study",
        **reference,
        "$defs": definitions,
    }
