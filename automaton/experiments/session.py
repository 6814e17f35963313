"""One sweep into a folder: begun, or gone on with if the code and the study are the same."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec

from automaton.errors import InputError
from automaton.experiments.copies import Copies
from automaton.experiments.keys import Manifest, changed_sources, declared_by, read_manifest
from automaton.experiments.plan import Plan, told
from automaton.experiments.pools import Crew
from automaton.experiments.store import Store, arrow, declared_in
from automaton.experiments.study import Point
from automaton.experiments.sweeping import Coordinator, OnRows, Tally
from automaton.experiments.writing import Writer, check_free, declare, locked, set_damaged_aside
from automaton.headless import strategies_blamed
from automaton.simulation import Simulation
from automaton.units import count

ADVICE = (
    "take another folder, or --recompute: rows of other code, scenarios or seeds then count no more"
)


class Begun(NamedTuple):
    """What a sweep found when it began."""

    runs: int
    done: int  # of these, before
    aside: tuple[Path, ...]  # files that were damaged; their runs are done again
    reanalysed: bool  # the declared analysis is not that with which runs were made


class Swept(NamedTuple):
    """A sweep that came to its end."""

    store: Store
    begun: Begun
    tally: Tally
    failed: int  # runs without metrics, those that failed in earlier sweeps included


def sweep_into(
    folder: Path,
    plan: Plan,
    crew: Callable[[], Crew],
    recompute: bool = False,
    on_begun: Callable[[Begun], None] | None = None,
    on_rows: OnRows | None = None,
    retry_failed: bool = False,
    copies: Copies | None = None,
    patience: float | None = None,
) -> Swept:
    """Do the runs that a folder lacks. Raises InputError; what is done is kept in any case.

    `retry_failed`: runs that failed are lacking, too. `copies`: of the study's own files, to keep.
    `patience`: seconds that a Python strategy has for each decision.
    """
    arrow()
    with locked(folder):
        store, reanalysed = opened(folder, plan, recompute, copies)
        begun, done = stock_of(store, reanalysed, retry_failed, on_begun)
        writer = Writer(store)
        try:
            tally = carried_out(plan, crew, writer, done, on_rows, patience)
            if lacking(store):  # files were damaged meanwhile
                _, done = stock_of(store, False, False, on_begun)
                tally = tally.and_then(carried_out(plan, crew, writer, done, on_rows, patience))
            check_complete(store)
        finally:
            writer.release()
        return Swept(store, begun, tally, len(store.failed()))


def stock_of(
    store: Store, reanalysed: bool, retry_failed: bool, on_begun: Callable[[Begun], None] | None
) -> tuple[Begun, set[str]]:
    """What a folder holds, and the keys of the runs that are done; damaged files are set aside."""
    aside = tuple(set_damaged_aside(store))
    done = store.keys(with_failed=not retry_failed)
    begun = Begun(store.study.runs, len(done), aside, reanalysed)
    if on_begun is not None:
        on_begun(begun)
    return begun, done


def carried_out(
    plan: Plan,
    crew: Callable[[], Crew],
    writer: Writer,
    done: set[str],
    on_rows: OnRows | None,
    patience: float | None,
) -> Tally:
    """Do the runs that are not done, and put all rows into one file."""
    tally = Tally(0, 0, 0, 0)
    if len(done) < plan.study.runs:
        warm(plan, patience)
        tally = Coordinator(plan, crew(), writer, done, on_rows, patience).conduct()
    writer.close()
    return tally


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


def opened(
    folder: Path, plan: Plan, recompute: bool = False, copies: Copies | None = None
) -> tuple[Store, bool]:
    """The folder's results, if they are of this plan; whether its analysis was another one.

    What was declared before stays in the manifest where any of its runs count. Raises InputError if
    the results follow from anything else, unless they are to be computed again.
    """
    manifest = plan.manifest
    before = read_manifest(folder)
    if before is None:
        check_free(folder, copies or {})
        return declare(folder, manifest, copies), False
    objection = "" if recompute else difference(before, manifest)
    if objection:
        raise InputError(f"{objection}; {ADVICE}", str(folder))
    if not Store(folder, manifest).keys():
        return declare(folder, manifest, copies), False
    earlier, now = declared_by(declared_in(folder, before)), declared_by(plan.study)
    history = before.earlier if earlier == now else (*before.earlier, earlier)
    manifest = msgspec.structs.replace(manifest, earlier=history)
    return declare(folder, manifest, copies), not earlier.analysed_as(now)


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
        point = told(Point(number, old.scenario, old.levels))
        if (old.scenario, old.levels) != (new.scenario, new.levels):
            becomes = told(Point(number, new.scenario, new.levels))
            return f"holds results of other points: point {number} was {point}, is {becomes}"
        if old.fingerprint != new.fingerprint:
            return f"holds results of other scenarios: {point} changed (the file, or its floor)"
    if now.replications < before.replications:
        return f"holds {before.replications} replications; the study asks for fewer"
    return ""


def warm(plan: Plan, patience: float | None = None) -> None:
    """Compile, or find in the cache, what the workers will load, so that it is done once."""
    seen = set()
    for resolved in plan.scenarios:
        names = tuple(choice.name for choice in resolved.strategies.values())
        if names not in seen:
            seen.add(names)
            # Rows will say what a strategy raises.
            with contextlib.suppress(Exception), strategies_blamed(resolved):
                Simulation(resolved, patience=patience)
