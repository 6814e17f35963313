"""One sweep into a folder: begun, or gone on with if the code and the study are the same.

A study with a bound of replications goes on in rounds: all points have equally many runs after each.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.runs.first_compilation import compiled_parts
from automaton.runs.headless import attribute_strategy_errors
from automaton.runs.simulation import Simulation
from automaton.studies.sweeps.coordinator import Coordinator, OnRows, SweepTally
from automaton.studies.sweeps.pools import Backend
from automaton.studies.sweeps.result_store import Store, arrow, declared_in
from automaton.studies.sweeps.result_writing import (
    Writer,
    check_free,
    lock_folder,
    set_damaged_aside,
    write_manifest,
)
from automaton.studies.sweeps.run_keys import Manifest, changed_sources, declared_by, read_manifest
from automaton.studies.sweeps.study import Point
from automaton.studies.sweeps.sweep_plan import Copies, SweepPlan, describe_point
from automaton.units import count

ADVICE = (
    "use another folder, or --recompute: then rows of other code, scenarios or seeds are ignored"
)


Decide = Callable[[Store], int | None]  # replications after the next round; None: it is enough


class SweepStart(NamedTuple):
    """What a sweep found when it began."""

    runs: int
    done: int  # of these, before
    aside: tuple[Path, ...]  # files that were damaged; their runs are done again
    reanalysed: bool  # the declared analysis is not that with which runs were made


class SweepResult(NamedTuple):
    """A sweep that came to its end."""

    store: Store
    begun: SweepStart
    tally: SweepTally
    failed: int  # runs without metrics, those that failed in earlier sweeps included


def sweep_into(
    folder: Path,
    plan: SweepPlan,
    backend: Callable[[], Backend],
    recompute: bool = False,
    on_begun: Callable[[SweepStart], None] | None = None,
    on_rows: OnRows | None = None,
    retry_failed: bool = False,
    copies: Copies | None = None,
    patience: float | None = None,
    decide: Decide | None = None,
) -> SweepResult:
    """Do the runs that a folder lacks. Raises InputError; what is done is kept in any case.

    `retry_failed`: runs that failed are lacking, too. `copies`: of the study's own files, to keep.
    `patience`: seconds that a Python strategy has for each decision. `decide`: after each round of a
    study that goes on until a precision is reached, how many replications the next one is to make.
    """
    arrow()
    with lock_folder(folder):
        store, reanalysed = open_results(folder, plan, recompute, copies)
        begun, done = load_existing(store, reanalysed, retry_failed, on_begun)
        writer = Writer(store)
        try:
            with Crew(backend, writer, on_rows, patience) as crew:
                while True:
                    plan = plan._replace(manifest=store.manifest)
                    crew.run_missing(plan, done)
                    if lacking(store):  # files were damaged meanwhile
                        _, done = load_existing(store, False, False, on_begun)
                        crew.run_missing(plan, done)
                    check_complete(store)
                    replications = decide(store) if decide and plan.study.in_rounds else None
                    if replications is None:
                        break
                    store = write_manifest(folder, store.manifest.going_on(replications))
                    _, done = load_existing(store, False, False, on_begun)
        finally:
            writer.release()
        return SweepResult(store, begun, crew.tally, len(store.failed()))


class Crew:
    """The workers of a sweep: they start when a run is first missing, and end with the sweep."""

    def __init__(
        self,
        backend: Callable[[], Backend],
        writer: Writer,
        on_rows: OnRows | None,
        patience: float | None,
    ) -> None:
        self.backend, self.writer = backend, writer
        self.on_rows, self.patience = on_rows, patience
        self.coordinator: Coordinator | None = None

    def run_missing(self, plan: SweepPlan, done: set[str]) -> None:
        """Do the runs that are not done, and put all rows into one file."""
        if len(done) < plan.runs:
            if self.coordinator is None:
                warm(plan, self.patience)
                self.coordinator = Coordinator(
                    self.backend(), self.writer, self.on_rows, self.patience
                )
            self.coordinator.conduct(plan, done)
        self.writer.close()

    @property
    def tally(self) -> SweepTally:
        """What was done so far."""
        return SweepTally(0, 0, 0, 0) if self.coordinator is None else self.coordinator.tally

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        if self.coordinator is not None:
            self.coordinator.close(now=kind is not None)


def load_existing(
    store: Store,
    reanalysed: bool,
    retry_failed: bool,
    on_begun: Callable[[SweepStart], None] | None,
) -> tuple[SweepStart, set[str]]:
    """What a folder holds, and the keys of the runs that are done; damaged files are set aside."""
    aside = tuple(set_damaged_aside(store))
    done = store.keys(with_failed=not retry_failed)
    begun = SweepStart(store.study.runs, len(done), aside, reanalysed)
    if on_begun is not None:
        on_begun(begun)
    return begun, done


def lacking(store: Store) -> int:
    """Runs of which a folder has no row."""
    return store.study.runs - len(store.keys())


def check_complete(store: Store) -> None:
    """Raises InputError if runs have no row, though all were done and written."""
    lost = lacking(store)
    if lost:
        raise InputError(
            f"lacks {count(lost, 'row')} of {store.study.runs:,}, since files of rows were damaged "
            "twice after they had been written; the same command does their runs again",
            str(store.folder),
        )


def open_results(
    folder: Path, plan: SweepPlan, recompute: bool = False, copies: Copies | None = None
) -> tuple[Store, bool]:
    """The folder's results, if they are of this plan; whether its analysis was another one.

    What was declared before stays in the manifest where any of its runs count. Raises InputError if
    the results follow from anything else, unless they are to be computed again.
    """
    before = read_manifest(folder)
    manifest = plan.manifest if recompute else gone_on_with(plan, before)
    if before is None:
        check_free(folder, copies or {})
        return write_manifest(folder, manifest, copies), False
    objection = "" if recompute else difference(before, manifest)
    if objection:
        raise InputError(f"{objection}; {ADVICE}", str(folder))
    if not Store(folder, manifest).keys():
        return write_manifest(folder, plan.manifest, copies), False
    earlier, now = declared_by(declared_in(folder, before)), declared_by(plan.study)
    is_same, asked = earlier == now, before.replications  # of a study in rounds: so far
    earlier = msgspec.structs.replace(earlier, replications=asked)
    history = before.earlier if is_same else (*before.earlier, earlier)
    manifest = msgspec.structs.replace(manifest, earlier=history)
    return write_manifest(folder, manifest, copies), not earlier.analysed_as(now)


def gone_on_with(plan: SweepPlan, before: Manifest | None) -> Manifest:
    """The manifest of a plan, from the round on which a folder is in; all rounds before stay in it."""
    study, now = plan.study, plan.manifest
    if before is None or not study.in_rounds or before.replications > study.max_replications:
        return now
    rounds = before.rounds if isinstance(before.rounds, tuple) else (before.replications,)
    replications = max(before.replications, study.min_replications)
    if replications > rounds[-1]:
        rounds = (*rounds, replications)
    return msgspec.structs.replace(now, replications=replications, rounds=rounds)


def difference(before: Manifest, now: Manifest) -> str:
    """Why results do not belong to a plan, in a phrase; "" if they do."""
    if before.study != now.study:
        return f"holds the results of the study '{before.study}', not of '{now.study}'"
    changed = changed_sources(before.sources, now.sources)
    if changed:
        return f"holds results of other code: {changed}"
    for name in ("seed", "common_random_numbers"):
        if getattr(before, name) != getattr(now, name):
            was, becomes = getattr(before, name), getattr(now, name)
            return f"holds results of a study with {name} {was}, not {becomes}".lower()
    if len(before.points) != len(now.points):
        return f"holds results of {len(before.points)} points, not {len(now.points)}"
    for number, (old, new) in enumerate(zip(before.points, now.points, strict=True)):
        point = describe_point(Point(number, old.scenario, old.levels))
        if (old.scenario, old.levels) != (new.scenario, new.levels):
            becomes = describe_point(Point(number, new.scenario, new.levels))
            return f"holds results of other points: point {number} was {point}, is {becomes}"
        if old.fingerprint != new.fingerprint:
            return f"holds results of other scenarios: {point} changed (the file, or its floor)"
    if now.replications < before.replications:
        return f"holds {before.replications} replications; the study asks for fewer"
    return ""


def warm(plan: SweepPlan, patience: float | None = None) -> None:
    """Compile, or find in the cache, what the workers will load, so that it is done once."""
    for point in points_to_warm(plan):
        resolved = plan.scenarios[point]
        # Rows will say what a strategy raises.
        with contextlib.suppress(Exception), attribute_strategy_errors(resolved):
            Simulation(resolved, patience=patience)


def points_to_warm(plan: SweepPlan) -> list[int]:
    """The first point of each combination of strategies and features."""
    first: dict[Hashable, int] = {}
    for point, resolved in enumerate(plan.scenarios):
        first.setdefault(compiled_parts(resolved), point)
    return list(first.values())
