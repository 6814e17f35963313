"""Runs of designs of streets: the workers of a sweep, and a row for each run in a results folder.

A run is known by the scenario with its weights, its seed and the code, so a row counts whatever
search made it. Workers fill the distance tables of a design once.
"""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from automaton.scenario.streets import StreetWeights
from automaton.studies.street_search.designs import Row, StreetDesign
from automaton.studies.sweeps.result_store import Writer, lock_folder
from automaton.studies.sweeps.run_keys import Manifest, PlannedPoint, SweepRun, Windows, run_key
from automaton.studies.sweeps.run_keys import Row as StoredRow
from automaton.studies.sweeps.run_keys import fingerprint as fingerprint_of
from automaton.studies.sweeps.sweep_plan import SweepPlan
from automaton.studies.sweeps.sweep_session import (
    Coordinator,
    OnRows,
    SweepStart,
    load_existing,
    open_results,
)
from automaton.world.resolved import Resolved, in_fine_ticks


class SeededRuns(Manifest, frozen=True):
    """The manifest of some designs, each run with the same listed seeds."""

    seeds: tuple[int, ...] = ()

    def run(self, version: str, point: int, replication: int) -> SweepRun:
        """One run, with a listed seed."""
        seed = self.seeds[replication]
        key = run_key(version, self.points[point].fingerprint, seed)
        return SweepRun(key, point, replication, seed)


class DesignWriter(Writer):
    """Writes rows of designs, which all belong to the only point of a folder's study."""

    def hold(self, rows: list[StoredRow]) -> None:
        super().hold([{**row, "point": 0} for row in rows])

    def close(self) -> None:
        """Write the pending rows; files are merged at the end of the search."""
        self.flush()


def with_design(resolved: Resolved, design: StreetDesign, has_detours: bool = False) -> Resolved:
    """A scenario without streets, in its own ticks, with the streets of a design.

    `has_detours`: its runs measure detour_share.
    """
    if has_detours:
        scenario = msgspec.structs.replace(resolved.scenario, streets=())
        resolved = replace(resolved, scenario=scenario)
    weights = StreetWeights(resolved.floor_plan)
    weights.moves[:], weights.waits[:] = design.moves, design.waits
    weights.closed[:] = design.closed
    return in_fine_ticks(replace(resolved, floor_plan=weights.floor()))


class DesignRuns:
    """The runs of designs. Those that have a row already are not repeated.

    `base`: the scenario without streets with a number of robots, in its own ticks; None: its own number.
    """

    def __init__(
        self,
        plan: SweepPlan,
        base: Callable[[int | None], Resolved],
        coordinator: Coordinator,
        rows: dict[str, Row],
    ) -> None:
        self.plan, self.base, self.coordinator, self.rows = plan, base, coordinator, rows
        self.version = plan.manifest.version
        self.has_detours = False

    def with_detours(self) -> DesignRuns:
        """Runs that measure detour_share, which takes other tables; for one design, not a search."""
        runs = copy.copy(self)
        runs.has_detours = True
        return runs

    def __call__(
        self, designs: Sequence[StreetDesign], seeds: Sequence[int], robots: int | None = None
    ) -> list[list[Row]]:
        """A row for each design and seed, in this order."""
        base = self.base(robots)
        scenarios = [with_design(base, design, self.has_detours) for design in designs]
        marks = [fingerprint_of(one) for one in scenarios]
        keys = [[run_key(self.version, mark, seed) for seed in seeds] for mark in marks]
        first = {mark: number for number, mark in reversed(list(enumerate(marks)))}
        if lacking := [number for number in first.values() if keys[number] not in self]:
            plan = self._plan([scenarios[one] for one in lacking], [marks[one] for one in lacking])
            plan = plan._replace(
                manifest=msgspec.structs.replace(
                    plan.manifest, seeds=tuple(seeds), replications=len(seeds)
                )
            )
            done = {key for one in lacking for key in keys[one] if key in self.rows}
            self.coordinator.run_missing(plan, done)
        return [[self.rows[key] for key in of_design] for of_design in keys]

    def __contains__(self, keys: Sequence[str]) -> bool:
        """Whether all these runs have rows."""
        return all(key in self.rows for key in keys)

    def _plan(self, scenarios: Sequence[Resolved], marks: Sequence[str]) -> SweepPlan:
        """The plan of some designs; its manifest has no seeds yet."""
        usual = self.plan.manifest
        first = self.plan.points[0]
        fields = {key: getattr(usual, key) for key in Manifest.__struct_fields__}
        fields["points"] = tuple(
            PlannedPoint(first.scenario, {}, mark, Windows(), 0) for mark in marks
        )
        points = tuple(
            first._replace(
                number=number, levels=dict.fromkeys(first.levels, f"design {number + 1}")
            )
            for number in range(len(marks))
        )
        return self.plan._replace(
            points=points, scenarios=tuple(scenarios), manifest=SeededRuns(**fields)
        )


def by_name(row: StoredRow, names: Sequence[str]) -> Row:
    """The metrics and results of a run by name; None for those that it does not have."""
    return {**dict.fromkeys(names), **row, **row.get("metrics", {})}


@contextlib.contextmanager
def design_runs(
    folder: Path,
    plan: SweepPlan,
    base: Callable[[int | None], Resolved],
    backend: Callable[[], Any],
    recompute: bool,
    on_begun: Callable[[SweepStart], None],
    on_rows: OnRows,
    patience: float | None = None,
) -> Iterator[DesignRuns]:
    """The runs of designs, stored in a folder that is locked meanwhile. Raises InputError.

    `plan`: the study of the scenario as it is, with which the folder must agree.
    """
    rows: dict[str, Row] = {}

    def keep(finished: list[StoredRow]) -> None:
        rows.update((row["key"], by_name(row, store.schema.names)) for row in finished)
        on_rows(finished)

    with lock_folder(folder):
        store, _ = open_results(folder, plan, recompute)
        begun, _ = load_existing(store, False, False, None)
        for row in store.every_row():
            if row["key"] not in rows or row["error"] is None:
                rows[row["key"]] = row
        on_begun(begun._replace(done=len(rows)))
        writer = DesignWriter(store)
        try:
            with Coordinator(backend, writer, keep, patience) as coordinator:
                yield DesignRuns(plan, base, coordinator, rows)
            writer.merge()
        finally:
            writer.release()
