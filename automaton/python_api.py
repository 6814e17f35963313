"""The Python API of `import automaton`: runs, studies and recordings.

    import automaton

    automaton.simulate("tabletop-1", fleet__robots=3).metrics["makespan"]

Importing this needs no Numba; `sweep` and all tables need pyarrow (extra `experiments`).
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from automaton.errors import InputError, alternatives, refuse
from automaton.floor.floor_plan import NIL
from automaton.studies.sweeps.study import Study

if TYPE_CHECKING:
    import pyarrow as pa

    from automaton.drawings.floor_svg import FloorPicture
    from automaton.drawings.looks import Theme
    from automaton.engine.state import World
    from automaton.films.film_page import NotebookFilm
    from automaton.history.playback import Playback
    from automaton.runs.headless import Outcome, PastRules, Sampling
    from automaton.runs.simulation import Simulation as CompiledRun
    from automaton.runs.state_copy import RunState
    from automaton.scenario.document import Override
    from automaton.scenario.schema import Scenario
    from automaton.studies.sizing.sizing_figures import SizingResult
    from automaton.studies.sweeps.result_store import Store
    from automaton.tables.table_files import Tables
    from automaton.tables.table_run import TableRun
    from automaton.world.resolved import Resolved

# A path, the name of a shipped scenario, the content of a scenario file as a dict, or a Scenario.
ScenarioLike: TypeAlias = "str | Path | Mapping[str, Any] | Scenario"
# By layer: a name, {name: NAME, PARAMETER: VALUE}, a class, or an instance.
Strategies = Mapping[str, Any]


def settings_of(overrides: dict[str, Any], strategies: Strategies | None = None) -> list[Override]:
    """Keyword arguments as settings of a scenario: `fleet__robots` is fleet.robots.

    The class of a strategy is registered by name for the rest of this process. Raises InputError.
    """
    from automaton.scenario.document import Override, keys_of
    from automaton.strategy.lookup import spec_of

    values = overrides | {f"strategy.{layer}": one for layer, one in (strategies or {}).items()}
    settings = []
    for name, value in values.items():
        key = name.replace("__", ".")
        plain = spec_of(value)
        settings.append(Override(f"{key}={plain!r}", keys_of(key), plain))
    return settings


def load(scenario: ScenarioLike, seed: int | None = None, **overrides: Any) -> Scenario:
    """Read a scenario and check it completely, without compiling anything.

    `scenario`: a path, the name of a shipped one, the content of a scenario file as a dict, or a
    Scenario; `seed` and `overrides` replace its values, as in `simulate`. Returns the Scenario, with
    times in ticks and lengths in cells. Raises InputError, whose text is one sentence.

        scenario = automaton.load("tabletop-1", fleet__robots=3)
        scenario.fleet.robots, scenario.units.tick
    """
    return _resolved(scenario, seed, None, overrides).unrefined.scenario


def check(scenario: ScenarioLike, seed: int | None = None, **overrides: Any) -> tuple[str, ...]:
    """Check a scenario like `automaton check`, and return the warnings, one sentence each.

    Arguments as for `load`. Raises InputError for a scenario that cannot run.

        for warning in automaton.check("goods-60x40"):
            print(warning)
    """
    from automaton.scenario.reading import Reading, document_of
    from automaton.world.scenario_warnings import misfits, scenario_warnings

    resolved = _resolved(scenario, seed, None, overrides)
    with Reading(document_of(scenario, settings_of(overrides))).placing_errors():
        refuse(misfits(resolved))
    return tuple(scenario_warnings(resolved))


def simulate(
    scenario: ScenarioLike,
    seed: int | None = None,
    *,
    strategies: Strategies | None = None,
    tables: bool = False,
    states: str | int | None = None,
    events: bool = False,
    folder: str | Path | None = None,
    record: str | Path | None = None,
    **overrides: Any,
) -> Outcome:
    """Run a scenario once, in this process, to its end.

    `scenario`, `seed`: as for `load`. `strategies`: for each layer that changes a name, a dict of a
    name and parameters, a class, or an instance, of which each run gets a copy; a function decorated
    with `per_robot` is such a class. `overrides`: keys of the scenario, `fleet__robots=3` or
    `**{"fleet.robots": 3}`.
    With `tables` the outcome has `tables.orders`, `lines`, `trips`, `robots` and `stations`, each a
    pyarrow Table; `states` (a period such as "10 s", or a number of ticks) adds the table `states`,
    and `events=True` adds the table `events`; each also adds the table `cells`. `folder`: a new
    folder; tables are written to it as Parquet during the run, and not held in memory. `record`: a
    file for the recording. Returns an Outcome: `metrics` by name, `robots`, `digest`, `ticks`, and
    `picture` and `headline`, which a notebook shows. Raises InputError for bad input and for a
    strategy that raises.

        outcome = automaton.simulate("tabletop-mini", seed=7)
        outcome.finished, outcome.metrics["makespan"]
    """
    resolved = _resolved(scenario, seed, strategies, overrides)
    if not tables:
        if states is not None or events or folder is not None:
            raise InputError("states, events and folder need tables=True")
        return _run_shown(resolved, record)
    from automaton.tables.table_run import WantedTables, table_run

    where = None if folder is None else Path(folder)
    with table_run(resolved, WantedTables(states, events, folder=where)) as run:
        outcome = _run_shown(resolved, record, run)
    return outcome._replace(tables=run.tables())


def _resolved(
    scenario: ScenarioLike,
    seed: int | None,
    strategies: Strategies | None,
    overrides: dict[str, Any],
) -> Resolved:
    from automaton.world.resolve import resolve

    return resolve(scenario, settings_of(overrides, strategies), seed)


def _run_shown(
    resolved: Resolved, record: str | Path | None, tables: TableRun | None = None
) -> Outcome:
    """Run a scenario once, with a picture, its main metrics and, if requested, its recording."""
    from automaton.recording.recorder import Recorder
    from automaton.runs.headless import BusyPicture, run_once
    from automaton.runs.metric_catalogue import units_of
    from automaton.runs.run_report import headline_table

    watch = BusyPicture()
    on_end, sampling = (None, None) if tables is None else (tables.finish, tables.sampling)
    if record is None:
        outcome = run_once(resolved, on_end=on_end, sampling=sampling, watch=watch)
    else:
        try:
            with Recorder(record, resolved, resolved.scenario.seed) as recorder:
                outcome = run_once(
                    resolved, recorder, on_end=on_end, sampling=sampling, watch=watch
                )
        except OSError as error:
            raise InputError(
                f"cannot write the recording: {error.strerror}", str(record)
            ) from error
        outcome = outcome._replace(recording=read(record))
    headline = headline_table(resolved, outcome, units_of(resolved)[0]).rows
    return outcome._replace(picture=watch.picture, headline=headline)


def sweep(
    study: str | Path | Study,
    out: str | Path | None = None,
    executor: Executor | None = None,
    *,
    workers: int | None = None,
    scheduler: str | Path | None = None,
    recompute: bool = False,
    retry_failed: bool = False,
) -> pa.Table:
    """Make the missing runs of a study in the folder `out`, and return all rows as an Arrow table.

    `study`: a path, the name of a shipped one, or a Study. Without `out` no files remain. `executor`: an
    executor of concurrent.futures, which is left open; `scheduler`: a Dask cluster, by its address or
    the file that its scheduler wrote; by default `workers` spawned processes, one per core (a script
    needs the usual `if __name__ == "__main__":`). `recompute`, `retry_failed`: as in `automaton sweep`.
    Raises InputError like that command; finished runs remain in `out`.

        with open("fleets.yaml", "w") as file:
            file.write(
                "{name: two, scenario: tabletop-mini, replications: 3, factors: {fleet.robots: [1, 2]}}"
            )
        automaton.sweep("fleets.yaml", workers=1).select(["fleet.robots", "makespan"])
    """
    from automaton.studies.reports.comparisons import next_replications
    from automaton.studies.sweeps.pools import MAX_WORKERS, Backend, ExternalExecutor, LocalPool
    from automaton.studies.sweeps.sweep_plan import make_sweep_plan
    from automaton.studies.sweeps.sweep_session import sweep_into

    if sum(option is not None for option in (executor, workers, scheduler)) > 1:
        raise InputError("sweep() takes one of executor, workers and scheduler")
    if workers is not None and not 1 <= workers <= MAX_WORKERS:
        raise InputError(f"workers must be from 1 to {MAX_WORKERS:,}, found {workers}")

    def backend() -> Backend:
        if scheduler is not None:
            from automaton.studies.sweeps.pools import DaskCluster

            return DaskCluster(str(scheduler))
        return LocalPool(workers) if executor is None else ExternalExecutor(executor)

    def decide(store: Store) -> int | None:
        following = next_replications(store)
        return None if following is None else following.replications

    plan = make_sweep_plan(study)
    if out is not None:
        swept = sweep_into(
            Path(out),
            plan,
            backend,
            recompute,
            retry_failed=retry_failed,
            decide=decide,
        )
        return swept.store.rows()
    with tempfile.TemporaryDirectory(prefix="automaton-sweep-") as folder:
        return sweep_into(Path(folder), plan, backend, decide=decide).store.rows()


def size(
    scenario: ScenarioLike,
    target: str,
    robots: str | int | tuple[int, int] | list[int],
    *,
    strategies: str | Sequence[str] | None = None,
    success_share: float | None = None,
    mean: bool | None = None,
    indifference: float | None = None,
    alpha: float = 0.05,
    budget: int = 20_000,
    assure: bool = False,
    step: int = 1,
    mix: str | None = None,
    seed: int | None = None,
    workers: int | None = None,
    **overrides: Any,
) -> SizingResult:
    """Find the smallest fleet that meets a target such as "makespan<=2400", like `automaton size`.

    `robots`: the range of fleet sizes to test, as (1, 6) or "1..6", or a single size; `strategies`:
    allocations to compare, as "a,b" or ["a", "b"]; the other arguments are the options of the command.
    `workers`: spawned processes, by default one per core; 1: none. `overrides`: as in `simulate`. Raises
    InputError, and WorkerDied if a process dies.

        automaton.size("tabletop-mini", "makespan<=2000", robots=(1, 3), budget=400, workers=1).robots
    """
    from automaton.studies.process_pool import PersistentPool
    from automaton.studies.sizing.fleet_runs import Checked, Fleets, run_and_measure_use
    from automaton.studies.sizing.fleet_search import (
        make_question,
        read_target,
        robots_of,
        strategies_of,
    )
    from automaton.studies.sizing.sizing_figures import sized
    from automaton.studies.sizing.sizing_session import session_of

    fleet, compared = robots_of(robots), strategies_of(strategies)
    with PersistentPool(workers, run_and_measure_use) as rounds:
        fleets = Fleets(scenario, settings_of(overrides), seed, rounds, mix=mix)
        wanted = read_target(target, fleets.tick)
        asked = make_question(
            wanted,
            fleet,
            compared,
            success_share,
            indifference,
            alpha,
            budget,
            mean,
            fleets.warm_up,
            assure,
            step,
        )
        session = session_of(fleets, Checked(fleets, asked))
        session.go()
    return sized(session, fleets.base.scenario.name, fleets.seed)


class Simulation:
    """A run that you continue tick by tick, inspect, branch, save and pickle.

    `scenario`, `seed`, `strategies` and `overrides`: as for `simulate`. Raises InputError.

        run = automaton.Simulation("tabletop-mini", seed=7)
        run.step(100)
        run.tick, run.digest, run.world.robots.cell
    """

    def __init__(
        self,
        scenario: ScenarioLike,
        seed: int | None = None,
        *,
        strategies: Strategies | None = None,
        **overrides: Any,
    ) -> None:
        from automaton.runs.headless import PastRules, computed

        resolved = _resolved(scenario, seed, strategies, overrides)
        self._past, self._seed = [PastRules(0, resolved, ())], resolved.scenario.seed
        self._run = computed(self._past, self._seed, 0)

    @classmethod
    def _of(cls, past: list[PastRules], seed: int, run: CompiledRun) -> Simulation:
        simulation = cls.__new__(cls)
        simulation._past, simulation._seed, simulation._run = past, seed, run
        return simulation

    @property
    def scenario(self) -> Scenario:
        """The checked scenario, times in ticks and lengths in cells; a branch has its own."""
        return self._past[-1].resolved.scenario

    @property
    def seed(self) -> int:
        """The seed of all random numbers of the run."""
        return self._seed

    @property
    def tick(self) -> int:
        """The number of executed ticks."""
        return self._run.tick

    @property
    def finished(self) -> bool:
        """Whether the scenario's stop condition holds."""
        return self._run.finished

    @property
    def digest(self) -> str:
        """The digest of the whole state, 16 hex digits: equal digests mean equal states."""
        return self._run.digest

    @property
    def metrics(self) -> dict[str, float | int]:
        """The metrics of the run so far, by name; times are in ticks."""
        from automaton.runs.metrics import metrics_of

        return metrics_of(self._run)

    @property
    def world(self) -> World:
        """The state as structs of read-only NumPy arrays: `world.robots.cell`, (n,) int32.

        The arrays change with each step; copy what you want to keep.
        """
        return self._run.world.read_only()

    def step(self, ticks: int = 1) -> Simulation:
        """Execute a number of ticks, fewer if the run ends before; returns the simulation.

        Raises InputError for a number below 0 and for a strategy that raises.
        """
        if ticks < 0:
            raise InputError(f"ticks must be at least 0, found {ticks}")
        return self.run(self.tick + ticks)

    def run(self, until: int | None = None) -> Simulation:
        """Run to a tick, or to the end: the stop condition or `stop.max_duration`; returns itself.

        Raises InputError for a strategy that raises.
        """
        from automaton.runs.headless import attribute_strategy_errors

        with attribute_strategy_errors(self._past[-1].resolved):
            self._run.run(until)
        return self

    def branch(self, *, strategies: Strategies | None = None, **overrides: Any) -> Simulation:
        """Return another simulation that continues from this state, and leave this one unchanged.

        `overrides` and `strategies` take effect in the next tick: keys of strategy, durations,
        information, world, stop and streets. Unchanged strategies keep their memory, but routing
        and right of way not if durations, world or streets change; new ones begin with the current
        state. Raises InputError.
        """
        from automaton.runs.headless import PastRules, attribute_strategy_errors
        from automaton.world.resolve import branched

        other = Simulation._from(list(self._past), self._seed, self._state())
        settings = tuple(
            f"{'.'.join(map(str, one.keys))}={json.dumps(one.value)}"
            for one in settings_of(overrides, strategies)
        )
        if settings:
            resolved = branched(self._past[-1].resolved, settings)
            with attribute_strategy_errors(resolved):
                other._run = other._run.continue_with(resolved)
            other._past.append(PastRules(self.tick, resolved, settings))
        return other

    def save(self, path: str | Path) -> RecordedRun:
        """Write the run so far as a recording and return the recording; `read(path).simulation()`
        continues it.

        The run is computed again from its start to record it. Raises InputError if the file cannot be
        written, or if a strategy decides differently this time.
        """
        from automaton.recording.recorder import Recorder
        from automaton.runs.headless import computed

        try:
            with Recorder(path, self._past[0].resolved, self._seed) as recorder:
                run = computed(self._past, self._seed, self.tick, recorder)
                if run.digest != self.digest:
                    raise InputError(
                        f"computed again, the run differs at tick {self.tick:,}: a strategy decides "
                        "differently this time"
                    )
                if run.finished or self.tick >= self.scenario.stop.max_duration:
                    recorder.end()
        except OSError as error:
            raise InputError(f"cannot write the recording: {error.strerror}", str(path)) from error
        except BaseException:
            Path(f"{path}.part").unlink(missing_ok=True)
            raise
        return read(path)

    def picture(self, theme: Theme = "light", follow: int = NIL) -> FloorPicture:
        """The current floor and robots, as a drawing that a notebook shows; `follow`: a robot to mark.

        Raises InputError.
        """
        return self._run.picture(theme, follow)

    def _repr_html_(self) -> str:
        """Show it in a notebook."""
        return self.picture()._repr_html_()

    def _state(self) -> RunState:
        from automaton.runs.state_copy import captured

        run = self._run
        return captured(run.world, run.observation, run.states, run.strategies)

    @classmethod
    def _from(cls, past: list[PastRules], seed: int, state: RunState) -> Simulation:
        """A simulation that continues from a state."""
        from automaton.runs.headless import made
        from automaton.runs.state_copy import restore

        run = made(past, seed)
        restore(state, run.world, run.observation, run.states, run.strategies)
        return cls._of(past, seed, run)

    def __reduce__(self) -> Any:
        """A pickle holds the state and the scenario."""
        return Simulation._from, (self._past, self._seed, self._state())


class RecordedRun:
    """A complete or truncated recording, opened by `read`: the source of tables, pictures and films.

        automaton.simulate("tabletop-mini", record="run.rec")
        run = automaton.read("run.rec")
        run.ticks, run.simulation(at=50).digest

    A notebook shows its last tick.
    """

    def __init__(self, path: str | Path) -> None:
        from automaton.recording.recording_reader import read_recording

        self.path, self._recording = Path(path), read_recording(path)

    @property
    def ticks(self) -> int:
        """The number of recorded ticks."""
        return self._recording.ticks

    @property
    def is_complete(self) -> bool:
        """Whether the recording is complete."""
        return self._recording.complete

    def simulation(self, at: int | None = None) -> Simulation:
        """A simulation that continues from a tick of the run, by default the last one.

        The strategies compute the past again, which restores their memory; the result is compared
        with the recording. Raises InputError if there is no such tick, or if this version computes
        a different past.
        """
        from automaton.history.playback import Playback
        from automaton.recording.frames import changed, check_simulated, resolved_of
        from automaton.runs.headless import PastRules, computed

        check_simulated(self._recording.header, "a simulation", self.path)
        tick = self._tick(at)
        header, frames = self._recording.header, self._recording.stored()
        try:
            playback = Playback(header, frames)
            playback.go_to(tick)
            past = [PastRules(0, resolved_of(header), ())]
            since: int | None = 0
            while since is not None and since <= tick:
                rules = frames.rules_at(since)
                if rules["settings"]:
                    resolved = resolved_of(changed(header, rules))
                    past.append(PastRules(since, resolved, tuple(rules["settings"])))
                since = frames.next_rules(since)
            simulation = Simulation._of(past, header["seed"], computed(past, header["seed"], tick))
            if simulation.digest != playback.simulation.digest:
                raise InputError(
                    f"computed again with its strategies, the run differs at tick {tick:,}: "
                    "it was recorded by another version"
                )
        except InputError as error:
            raise error.at(str(self.path)) from None
        return simulation

    def tables(
        self,
        states: str | int | None = None,
        events: bool = False,
        robots: Sequence[int] | None = None,
        folder: str | Path | None = None,
    ) -> Tables:
        """The tables of the run, as in `simulate(tables=True)`.

        `states`: a period such as "1 s", or ticks; `robots`: limits events and states to these robots;
        `folder`: a new folder to which the tables are written as Parquet. Raises InputError.
        """
        from automaton.history.playback import Playback
        from automaton.recording.frames import resolved_of
        from automaton.tables.table_run import WantedTables, table_run

        recording = self._recording
        where = None if folder is None else Path(folder)
        options = WantedTables(states, events, robots, where)
        try:
            resolved = resolved_of(recording.header, with_strategies=False)
            with table_run(resolved, options, self.ticks) as run:
                sampling = run.sampling
                frames = recording.stored()
                playback = Playback(recording.header, frames, on_observe=sampling.on_observe)
                _play(playback, sampling, self.ticks)
                run.finish(playback.simulation)
        except InputError as error:
            raise error.at(str(self.path)) from None
        return run.tables()

    def picture(
        self, at: int | None = None, theme: Theme = "light", follow: int = NIL
    ) -> FloorPicture:
        """The floor and its robots after a tick, by default the last one; `follow`: a robot to mark.

        Raises InputError.
        """
        from automaton.history.playback import Playback

        tick = self._tick(at)
        try:
            playback = Playback(self._recording.header, self._recording.stored())
            playback.go_to(tick)
            return playback.simulation.picture(theme, follow)
        except InputError as error:
            raise error.at(str(self.path)) from None

    def film(
        self,
        first: int | None = None,
        last: int | None = None,
        *,
        speed: float = 1,
        follow: int = NIL,
        theme: Theme = "light",
        height: int = 600,
    ) -> NotebookFilm:
        """The ticks from `first` (default 0) to `last` (default: the last tick) as a film for a
        notebook.

        `speed`: 1 is ten ticks a second; `follow`: a robot; `height`: pixels. Raises InputError.
        """
        from automaton.drawings.looks import THEMES
        from automaton.films.film_page import NotebookFilm, film_page
        from automaton.films.recorded_stretch import play_stretch

        if theme not in THEMES:
            raise InputError(f"unknown theme {theme!r}: allowed are {alternatives(THEMES)}")
        stretch = play_stretch(self._recording, first, last, follow)
        page = film_page(stretch, speed=speed, follow=follow, theme=theme)
        return NotebookFilm(page, stretch.title, height)

    def _repr_html_(self) -> str:
        """Show the last tick in a notebook."""
        return self.picture()._repr_html_()

    def _tick(self, at: int | None) -> int:
        tick = self.ticks if at is None else at
        if not 0 <= tick <= self.ticks:
            raise InputError(
                f"there is no tick {tick:,}: the recording ends at tick {self.ticks:,}"
            )
        return tick


def _play(playback: Playback, sampling: Sampling, until: int) -> None:
    """Play a recording to a tick, with samples on the way."""
    period = sampling.period or until or 1
    if sampling.period:
        sampling.on_sample(playback.simulation)
    while playback.tick < until:
        playback.go_to(min((playback.tick // period + 1) * period, until))
        if sampling.period and playback.tick % period == 0:
            sampling.on_sample(playback.simulation)


def read(path: str | Path) -> RecordedRun:
    """Open a recording.

        automaton.simulate("tabletop-mini", record="run.rec")
        automaton.read("run.rec").picture(at=50)

    Returns a RecordedRun. Raises InputError for a file that is damaged or not a recording.
    """
    return RecordedRun(path)
