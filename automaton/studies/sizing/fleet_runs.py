"""The runs of the fleets of one scenario, spread over the cores, and what is measured in each.

Replication r has the same seed, hash(seed, r), and so the same demand, for every fleet and strategy.
"""

from __future__ import annotations

import contextlib
import json
import math
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.engine.state import ACTION_CHARGE, ACTION_DROP, ACTION_PICK, ACTION_TRY_DROP
from automaton.errors import InputError, nearest
from automaton.floor.floor_plan import STATION
from automaton.runs.headless import run_marked
from automaton.runs.metric_catalogue import in_coarse_ticks, time_shares
from automaton.runs.metrics import counted, metrics_of, uses_of_run
from automaton.runs.provenance import sources_of
from automaton.runs.run_diagnosis import JamWatch, note_jam
from automaton.runs.simulation import Simulation
from automaton.scenario.document import Override, keys_of, parse_setting
from automaton.scenario.fleet import Fleet
from automaton.scenario.schema import Scenario
from automaton.scenario.unavailable_metrics import (
    OF_DUE_TIMES,
    OF_TIMES,
    TASK_METRICS,
    not_measured,
    warm_up_of,
)
from automaton.studies.process_pool import PersistentPool
from automaton.studies.sizing.fleet_search import (
    ROBOT_COUNT,
    FleetConfig,
    FleetRun,
    InfeasibleFleetError,
    Question,
    SearchQuantity,
    Target,
)
from automaton.studies.sweeps.result_store import ROWS_FOLDER, lock_folder
from automaton.studies.sweeps.run_keys import (
    digest,
    fingerprint,
    hashed,
    plugins_of,
    replication_seeds,
)
from automaton.units import Unit, count, ticks_and_time, unit
from automaton.world.bounds import bounds, least_ticks, most_throughput
from automaton.world.floor_parts import places_of_chargers
from automaton.world.resolve import Resolved, resolve

PERCENTS_OFF: Final = (-10, 10)  # changes of durations in percent
MOVES_LATE: Final = "world.extra_tick_probability"  # lengthens moves that take only a few ticks
ORDER_METRICS = (*OF_TIMES, "legs_per_order")  # metrics that exist once an order is delivered
STATION_USE = "station_use"  # share of the time of all stations in which they serve a robot
CHARGER_USE = "charger_use"  # share of the time of all charging places in which a robot charges
TIME_OF = "time of "  # before the parts of the robots' time in the whole run, which are shares
FLEET_TICKS = "robot_ticks"  # ticks that the metrics cover, summed over the robots
MOVE_KEY = re.compile(r"durations\.move[.=]")
PLAIN_KEY = re.compile(r"[\w-]+")  # a name that can be part of a dotted key
MIX = re.compile(r"([^=]+)=\s*(\d{1,7}(?:\s*:\s*\d{1,7})*)\s*")
KEPT_FILE: Final = "size.jsonl"


def run_and_measure_use(simulation: Simulation) -> dict[str, float | int]:
    """Run to the end; return metrics after the warm-up, with the use of stations and chargers."""
    resolved = simulation.resolved
    fleet = count(resolved.scenario.fleet.robots, "robot")
    allocation = resolved.strategies["allocation"].name
    where = f"{resolved.scenario.name}, {fleet}, {allocation}, seed {simulation.seed}"
    since = run_marked(simulation, watch=JamWatch(partial(note_jam, where))).warm_up
    figures, now = metrics_of(simulation, since), counted(simulation)
    since = now.none() if since is None else since
    ticks, elapsed = now.actions - since.actions, max(1, now.tick - since.tick)
    figures[FLEET_TICKS] = resolved.scenario.fleet.robots * elapsed // resolved.scenario.refine
    world, floor_plan = simulation.world, simulation.resolved.floor_plan
    stations = int(np.count_nonzero(floor_plan.kind == STATION))
    places = sum(places_of_chargers(resolved.scenario, floor_plan).values())
    if stations:
        handling = int(ticks[[ACTION_PICK, ACTION_DROP, ACTION_TRY_DROP]].sum())
        # Pods are picked and dropped in storage.
        served = int((now.station_busy - since.station_busy).sum())
        used = served if len(world.trips.pod) else handling
        figures[STATION_USE] = used / (stations * elapsed)
    if places and world.rules.battery:
        figures[CHARGER_USE] = float(ticks[ACTION_CHARGE].sum()) / (places * elapsed)
    figures |= {
        f"{TIME_OF}{name}": share for name, share, _ in time_shares(uses_of_run(simulation))
    }
    return in_coarse_ticks(figures, simulation.resolved.scenario.refine)


def read_mix(text: str, fleet: Fleet) -> Callable[[int], dict[str, int | None]]:
    """Read how the types of a fleet follow its size: "slow=12", or "slow:fast=1:3".

    Returns the settings of a fleet size: the number of robots by key. Raises InputError.
    """
    names, match = [kind.name for kind in fleet.types], MIX.fullmatch(text)
    if match is None:
        raise InputError(f"--mix '{text}': expected TYPE=NUMBER or A:B=1:3, such as slow:fast=1:3")
    listed = [one.strip() for one in match[1].split(":")]
    numbers = [int(one) for one in match[2].split(":")]
    for name in listed:
        if name not in names:
            there = f"; there are {', '.join(names)}" if names else "; fleet.types is empty"
            raise InputError(
                f"--mix '{text}': no type is called '{name}'{nearest(name, names)}{there}"
            )
    if len(listed) != len(numbers) or len(set(listed)) < len(listed):
        raise InputError(f"--mix '{text}': give each type once and one number for each")
    parts = dict(zip(listed, numbers, strict=True))
    if len(listed) == 1:
        if len(names) != 2:
            raise InputError(
                f"--mix '{text}': which of the other types gets the rest? Give a ratio of all types, "
                f"such as {':'.join(names)}={':'.join('1' for _ in names)}"
            )
        return lambda size: {
            f"fleet.types.{at}.robots": parts.get(name) for at, name in enumerate(names)
        }
    if len(listed) < len(names) or not sum(numbers):
        raise InputError(f"--mix '{text}': a ratio has all types: {':'.join(names)}")
    return lambda size: {
        f"fleet.types.{at}.robots": number
        for at, number in enumerate(in_ratio(size, [parts[name] for name in names]))
    }


def in_ratio(size: int, parts: Sequence[int]) -> list[int]:
    """Whole numbers in a ratio with the sum `size`, by largest remainders; ties to the first."""
    shares = [divmod(size * part, sum(parts)) for part in parts]
    left = size - sum(least for least, _ in shares)
    order = sorted(range(len(parts)), key=lambda at: -shares[at][1])
    return [least + (at in order[:left]) for at, (least, _) in enumerate(shares)]


class KeptRun(NamedTuple):
    """A line of the file of runs."""

    key: str  # as in a sweep: hash of the code, the resolved scenario and the seed
    finished: bool
    figures: dict[str, float | int]


class KeptRuns:
    """Runs that a folder keeps, one line each, so that the same question finds them again.

    A line that is damaged, such as the last one of a killed process, is skipped: its run is repeated.
    """

    def __init__(self, folder: Path) -> None:
        self._file = folder / ROWS_FOLDER / KEPT_FILE
        self.known: dict[str, FleetRun] = {}
        lines = self._file.read_bytes().split(b"\n") if self._file.exists() else []
        for line in lines:
            with contextlib.suppress(msgspec.DecodeError):
                one = msgspec.json.decode(line, type=KeptRun)
                self.known[one.key] = FleetRun(one.finished, one.figures)
        if lines and lines[-1]:
            self._append("\n")  # ends the line that a killed process left

    def keep(self, runs: Mapping[str, FleetRun]) -> None:
        """Add runs to the file. Raises InputError if it cannot be written."""
        self.known |= runs
        lines = (json.dumps(KeptRun(key, *run)) for key, run in runs.items())
        self._append("".join(f"{line}\n" for line in lines))

    def _append(self, text: str) -> None:
        try:
            with self._file.open("a", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            why = (error.strerror or str(error)).lower()
            raise InputError(f"cannot write results: {why}", str(self._file)) from error


@contextlib.contextmanager
def kept_in(folder: Path | None) -> Iterator[KeptRuns | None]:
    """The runs that a folder keeps, locked meanwhile; None without a folder. Raises InputError."""
    if folder is None:
        yield None
        return
    with lock_folder(folder):
        yield KeptRuns(folder)


class Fleets:
    """A `Runner` of one scenario. Raises InfeasibleFleetError for a fleet that cannot be run.

    `quantity`: what a search varies; `mix`: how the types of robots follow the size of the fleet.
    """

    def __init__(
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario,
        settings: Sequence[str | Override],
        seed: int | None,
        rounds: PersistentPool,
        quantity: SearchQuantity = ROBOT_COUNT,
        mix: str | None = None,
        run_store: KeptRuns | None = None,
    ) -> None:
        self._scenario, self._settings, self._rounds = scenario, tuple(settings), rounds
        self.base = resolve(scenario, settings).unrefined
        self.seed = self.base.scenario.seed if seed is None else seed
        self.quantity, self.mix, self._kept = quantity, mix, run_store
        self._mixed = read_mix(mix, self.base.scenario.fleet) if mix is not None else None
        self.resolved = cache(self._resolved)  # by fleet
        self._key = cache(self._key_of)
        self._code = cache(lambda plugins: hashed(sources_of(plugins)))

    def __call__(self, place: FleetConfig, first: int, number: int) -> list[FleetRun]:
        """Run replications first .. first + number - 1, except those that are kept."""
        resolved = self.resolved(place)
        seeds = replication_seeds(self.seed, first, number)
        if self._kept is None:
            return self._run(resolved, seeds)
        keys = {seed: digest(f"{self._key(place)} {seed}")[:32] for seed in seeds}
        missing = [seed for seed in seeds if keys[seed] not in self._kept.known]
        runs = self._run(resolved, missing)
        self._kept.keep({keys[seed]: run for seed, run in zip(missing, runs, strict=True)})
        return [self._kept.known[keys[seed]] for seed in seeds]

    def _run(self, resolved: Resolved, seeds: Sequence[int]) -> list[FleetRun]:
        results = self._rounds.run([(resolved, seed) for seed in seeds])
        return [FleetRun(result.finished, result.metrics) for result in results]

    def _key_of(self, place: FleetConfig) -> str:
        resolved = self.resolved(place)
        return f"{self._code(tuple(sorted(plugins_of(resolved))))} {fingerprint(resolved)}"

    def _resolved(self, place: FleetConfig) -> Resolved:
        changes = longer(self.base, place.percent) if place.percent else []
        try:
            return resolve(self._scenario, (*self._settings, *self._typed(place), *changes))
        except InputError as error:
            raise InfeasibleFleetError(error.message, error.file, error.line) from None

    def _typed(self, place: FleetConfig) -> Iterator[Override]:
        """The settings of a fleet, with the options that errors name as their source."""
        key, option = self.quantity.key, f"{self.quantity.option} {place.size}"
        yield Override(option, keys_of(key), place.size)
        if self._mixed is not None:
            for key, number in self._mixed(place.size).items():
                yield Override(f"--mix {self.mix}", keys_of(key), number)
        if place.strategy:
            option = f"--strategies {place.strategy.removeprefix('strategy.')}"
            yield replace(parse_setting(place.strategy), argument=option)

    def watch(self, place: FleetConfig, replication: int) -> str:
        """The command that shows a replication; "" if the scenario is not one of the command line."""
        if not isinstance(self._scenario, str | Path):
            return ""
        [seed] = replication_seeds(self.seed, replication, 1)
        words = ["automaton", "watch", str(self._scenario), "--seed", str(seed)]
        for one in (*self._settings, *self._typed(place)):
            if isinstance(one, Override):
                one = f"{'.'.join(map(str, one.keys))}={json.dumps(one.value)}"
            words += ["--set", one]
        return shlex.join(words)

    def check(self, question: Question) -> None:
        """Check that the question suits the scenario, and that smallest and largest fleets can be run.

        Raises InputError.
        """
        self.check_stop(question)
        for strategy in question.strategies:
            for size in sorted({question.first, question.last}):
                try:
                    self.resolved(FleetConfig(size, strategy))
                except InputError as error:
                    hint = self._hint(error.message)
                    raise InputError(error.message + hint, error.file, error.line) from None

    def check_stop(self, question: Question) -> None:
        """Check that the metric of runs that end at a given tick depends on the fleet.

        Raises InputError.
        """
        if self.ends_with_orders:
            return
        ends = "--target: runs end at a given tick (stop: {when: never}), so"
        if self.is_steady and not question.warm_up:
            raise InputError(
                f"{ends} their metrics would include the start-up; set a warm-up period in ticks, "
                "--set measure.warm_up=N, or units.clock if a run is a working day"
            )
        if question.target.metric == "makespan":
            raise InputError(
                f"{ends} makespan is the same for every fleet; use throughput or a time of orders"
            )

    def _hint(self, objection: str) -> str:
        """What frees the scenario from its number of robots, if that is varied."""
        if self.quantity != ROBOT_COUNT:
            return ""
        types = self.base.scenario.fleet.types
        if self.mix is None and types and all(kind.robots for kind in types):
            return f"; for other fleet sizes use --mix, such as --mix {types[0].name}={types[0].robots}"
        unsaid = (one for one in for_any_fleet(self.base) if one not in objection)
        settings = " ".join(f"--set {setting}" for setting in unsaid)
        return f"; for other fleet sizes use {settings}" if settings else ""

    def excluded(self, question: Question) -> dict[int, str]:
        """The fleet sizes that fail with any strategy, each with the bound that excludes it."""
        if self.quantity != ROBOT_COUNT:
            return {}
        limits = bounds(self.base)
        reasons = {}
        for robots in question.sizes:
            target, why = question.target, ""
            if target.metric == "makespan" and target.at_most and self.ends_with_orders:
                least, reason = least_ticks(limits, robots)
                if least > target.value:
                    many = "infinite"
                    if math.isfinite(least):
                        many = f"at least {ticks_and_time(math.ceil(least), self.tick)}"
                    why = f"makespan is {many}: {reason}"
            if target.metric == "throughput" and not target.at_most:
                most, reason = most_throughput(limits, robots, self.measured or math.inf)
                if most < target.value:
                    why = f"throughput is at most {most:,.3g}: {reason}"
            if why:
                reasons[robots] = why
        return reasons

    @property
    def changes(self) -> dict[int, list[str]]:
        """The settings that change durations by each of PERCENTS_OFF, where this is possible."""
        changes = {percent: longer(self.base, percent) for percent in PERCENTS_OFF}
        return {percent: settings for percent, settings in changes.items() if settings}

    @property
    def tick(self) -> Unit:
        """The unit of a tick."""
        return unit(self.base.scenario.units.tick)

    @property
    def warm_up(self) -> int | None:
        """Ticks that metrics exclude; None for runs that count whole."""
        return warm_up_of(self.base.scenario) if self.is_steady else None

    @property
    def measured(self) -> int:
        """Ticks that metrics of a steady state cover; 0 for runs that count whole."""
        return 0 if self.warm_up is None else self.base.scenario.stop.max_duration - self.warm_up

    @property
    def is_steady(self) -> bool:
        """Whether runs show a steady state: they end at a given tick, and none is a working day."""
        is_day = self.base.scenario.units.clock is not None and not warm_up_of(self.base.scenario)
        return not self.ends_with_orders and not is_day

    @property
    def ends_with_orders(self) -> bool:
        """Whether runs end when all orders are delivered, not at a given tick."""
        return self.base.scenario.stop.when != "never"


class Checked:
    """A runner that checks that the first run has the metric of the target.

    `on_round` is called before each round with the fleet and the number of runs made so far.
    """

    def __init__(self, fleets: Fleets, question: Question) -> None:
        self.fleets, self.question, self.runs = fleets, question, 0
        self.on_round: Callable[[FleetConfig, int], None] = lambda place, runs: None

    def __call__(self, place: FleetConfig, first: int, number: int) -> Sequence[FleetRun]:
        """Run replications like Fleets. Raises InputError if the target's metric is not measured."""
        self.on_round(place, self.runs)
        if self.runs == 0:
            run = self.fleets(place, 0, 1)[0]
            check_measured(self.question.target, run, self.fleets.base.scenario)
        self.runs += number
        return self.fleets(place, first, number)


def for_any_fleet(resolved: Resolved) -> list[str]:
    """Settings that remove what ties a scenario to its number of robots."""
    settings = []
    if isinstance(resolved.scenario.fleet.start, tuple):
        settings.append("fleet.start=random")
    if isinstance(resolved.scenario.fleet.heading, tuple):
        settings.append("fleet.heading=null")
    if resolved.zoning.design is not None:
        settings.append("strategy.zoning.design=null")
    return settings


def check_measured(target: Target, run: FleetRun, scenario: Scenario) -> None:
    """Raise InputError if runs of a scenario cannot have the metric of the target.

    A run without finished orders or tasks has no times, but other runs may have them.
    """
    nothing_yet = {
        **dict.fromkeys(TASK_METRICS, scenario.measure is not None),
        **dict.fromkeys(ORDER_METRICS, not run.figures["delivered"]),
        **dict.fromkeys(OF_DUE_TIMES, "not_yet_due" in run.figures),
        "part_flow_time": "parts_finished" in run.figures,
    }
    if target.metric not in run.figures and not nothing_yet.get(target.metric):
        known = ", ".join(name for name in run.figures if not name.startswith(("lost_", TIME_OF)))
        need = not_measured(scenario).get(target.metric)
        hint = f"; it needs {need}" if need else ""
        raise InputError(
            f"--target: this scenario does not measure {target.metric}{hint}; it has {known}"
        )


def longer(resolved: Resolved, percent: int) -> list[str]:
    """Settings that change all durations by some percent; in whole ticks except visits at stations.

    Moves of a few ticks become longer by a random extra tick; they cannot become shorter.
    """
    scenario = resolved.scenario
    settings = []
    for key, ticks in ticks_by_key(scenario).items():
        other = round(ticks * (1 + percent / 100))
        if other != ticks:
            settings.append(f"{key}={other}")
    for key, duration in handling_by_key(scenario).items():
        settings.append(f"{key}={duration * (1 + percent / 100):g}")
    chance = max(scenario.durations.moves) * percent / 100
    moves_as_before = not any(MOVE_KEY.search(setting) for setting in settings)
    if (
        moves_as_before
        and percent > 0
        and not scenario.world.extra_tick_probability
        and chance <= 1
    ):
        settings.append(f"{MOVES_LATE}={chance:g}")
    return settings


def ticks_by_key(scenario: Scenario) -> dict[str, int]:
    """All durations of operations in a scenario and its robot types, by key."""
    ticks: dict[str, int] = {}
    sections = [("durations", scenario.durations)] + [
        (f"fleet.types.{number}.durations", kind.durations)
        for number, kind in enumerate(scenario.fleet.types)
    ]
    for key, durations in sections:
        for name, value in msgspec.to_builtins(durations).items():
            if isinstance(value, int):
                ticks[f"{key}.{name}"] = value
            elif name in ("move", "turn") and value is not None:
                ticks |= {f"{key}.{name}.{load}": one for load, one in value.items()}
    return ticks


def handling_by_key(scenario: Scenario) -> dict[str, float]:
    """All durations of visits at stations in a scenario, in unrounded ticks, by key.

    Measured distributions are not included.
    """
    sections = {"durations.handling": scenario.durations.handling} | {
        f"stations.{name}.handling": station.handling
        for name, station in scenario.stations.items()
        if PLAIN_KEY.fullmatch(name)
    }
    return {
        key: duration
        for section, handling in sections.items()
        for key, duration in _numbers(section, msgspec.to_builtins(handling))
    }


def _numbers(key: str, value: Any) -> Iterator[tuple[str, float]]:
    """The numbers above 0 of a section, by key."""
    if isinstance(value, dict):
        for name, one in value.items():
            yield from _numbers(f"{key}.{name}", one)
    elif isinstance(value, int | float) and value > 0:
        yield key, value
