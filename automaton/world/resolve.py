"""A scenario made ready to run: read with its files, checked against its floor, its strategies chosen."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from automaton.engine.distance_tables import UNREACHABLE, WEIGHT_UNIT, least_table_bytes
from automaton.errors import Finding, InputError, InvalidValueError, Keys, refuse
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.document import Override
from automaton.scenario.floor_section import Floor
from automaton.scenario.reading import Reading, document_of
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import LAYER_NAMES, Scenario
from automaton.scenario.streets import streets_on
from automaton.scenario.validation import dotted, validated, with_numbers
from automaton.strategy.lookup import files_of, resolve_paths, zoning_parameters_of
from automaton.units import bytes_of, memory
from automaton.world.capabilities import with_right_of_way
from automaton.world.feasibility import check_energy, feasible_fleet
from automaton.world.floor_parts import (
    check_speed_limits,
    streets_in_words,
    with_charger_blocks,
    with_open_places,
    with_shared_chargers,
    with_speed_limits,
    with_streets,
)
from automaton.world.resolved import Resolved as Resolved
from automaton.world.resolved import StrategyChoice, drawn_day, in_fine_ticks, objection_to

MAX_ALLOCATIONS = 4  # allocation strategies of a run
CHANGEABLE = (
    "strategy",
    "durations",
    "information",
    "world",
    "stop",
    "streets",
)  # while a run goes on


def resolve(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    overrides: Iterable[str | Override] = (),
    seed: int | None = None,
) -> Resolved:
    """Check a scenario completely: a path, a shipped name, a file's content, or a Scenario.

    `overrides`: KEY=VALUE texts, or values with their keys; `seed` replaces the scenario's seed. Raises
    InputError.
    """
    settings = tuple(overrides)
    seeded = () if seed is None else (Override(f"--seed {seed}", ("seed",), seed),)
    reading = Reading(document_of(scenario, (*settings, *seeded)), drawn_day)
    with reading.placing_errors():
        return _resolved(reading, settings)


def _resolved(reading: Reading, settings: tuple[str | Override, ...]) -> Resolved:
    """Read, check and build. Raises InvalidValueError for invalid values."""
    scenario = reading.scenario_with_files()
    floor = reading.floor(scenario.layout)
    scenario, floor_plan = with_open_places(scenario, floor.floor_plan)
    floor = floor._replace(floor_plan=floor_plan)
    scenario = with_charger_blocks(scenario, floor.floor_plan)
    floor = floor._replace(floor_plan=with_shared_chargers(floor.floor_plan))
    refuse(check_speed_limits(scenario, floor.floor_plan))
    limits = scenario.floor.speed_limits
    floor = floor._replace(floor_plan=with_speed_limits(floor.floor_plan, limits))
    own_streets, drawn = scenario.streets, floor.floor_plan
    if own_streets is not None:
        scenario, streets = reading.with_streets_on_floor(scenario, floor)
        floor = floor._replace(floor_plan=with_streets(scenario, streets.weights))
    scenario = reading.with_files_on_floor(scenario, floor)

    fleet = feasible_fleet(scenario, floor, pods_are_of_file=reading.pod_file is not None)
    refuse(check_table_memory(scenario, floor.floor_plan))
    refuse(check_street_costs(scenario, floor.floor_plan))

    scenario = with_right_of_way(scenario, fleet)
    strategies = choose_strategies(scenario, floor.floor_plan, folder=reading.folder)
    own_allocations = choose_own_allocations(scenario, floor.floor_plan, reading.folder)
    check_other_days(reading, scenario, floor)
    order_file = reading.days[reading.day].file if reading.days else None
    resolved = Resolved(
        scenario=naming_files(scenario, strategies, own_allocations),
        floor_plan=floor.floor_plan,
        strategies=strategies,
        start=fleet.start,
        source=reading.document.text,
        overrides=tuple(
            setting if isinstance(setting, str) else setting.argument for setting in settings
        ),
        files=reading.files,
        conversions=reading.conversions,
        file_notes=tuple(
            note
            for file in (reading.pod_file, order_file, reading.rate_file)
            if file is not None
            for note in file.notes
        ),
        days=reading.days,
        day=reading.day,
        day_pattern=reading.pattern,
        own_allocations=own_allocations,
        own_streets=own_streets,
        streets_in_words=streets_in_words(drawn, floor.floor_plan),
    )
    vars(resolved)["fleet"] = fleet  # with the results of the checks
    refuse(check_allocations(resolved))
    return in_fine_ticks(resolved)


def check_other_days(reading: Reading, scenario: Scenario, floor: Floor) -> None:
    """Check the listed orders of the files that the seed does not draw. Raises InputError."""
    drawn = reading.document
    for day, document in zip(reading.days, reading.of_days, strict=True):
        if day.orders.listed is not None and document is not drawn:
            reading.document = document  # so that errors name the file
            other = msgspec.structs.replace(scenario, orders=day.orders)
            feasible_fleet(other, floor, pods_are_of_file=reading.pod_file is not None)
    reading.document = drawn


def check_table_memory(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """One distance table of this floor fits into world.distance_tables."""
    text = scenario.world.distance_tables
    cells = int(np.count_nonzero(floor_plan.drivable))
    types = types_of(scenario)
    headings = max(one.headings for one in types)
    turns = [turn for one in types for turn in one.turns]
    moves = [ticks for one in types for ticks in one.moves]
    limits = np.flatnonzero(np.bincount(floor_plan.min_move_ticks.reshape(-1))).tolist()
    unit = math.gcd(*turns, *(max(move, limit) for move in moves for limit in (0, *limits)))
    size = least_table_bytes(cells, headings, max(turns) // unit)
    if size > bytes_of(text):
        yield Finding(
            ("world", "distance_tables"),
            f"world.distance_tables is {text}, but a table of the {cells:,} cells of this floor takes "
            f"{memory(size)}; set it to at least that",
        )


def check_street_costs(scenario: Scenario, floor_plan: FloorPlan) -> Iterator[Finding]:
    """No way costs UNREACHABLE: it leaves each cell once, by the dearest move after two turns."""
    weights, limits = floor_plan.move_weights, floor_plan.min_move_ticks
    if not len(weights):
        return
    types = types_of(scenario)
    move, turn = (max(max(getattr(one, name)) for one in types) for name in ("moves", "turns"))
    is_exit = (floor_plan.exits.reshape(-1, 1) >> np.arange(4)) & 1 > 0
    ticks = np.maximum(limits, move) if len(limits) else move
    moves = np.where(is_exit, weights.astype(np.int64) * ticks, 0).max(axis=1).sum()
    dearest = int(moves) + 2 * WEIGHT_UNIT * turn * int(np.count_nonzero(floor_plan.drivable))
    if dearest >= UNREACHABLE:
        text = "streets has weights that are too large for this floor and the durations of moves"
        yield Finding(("streets",), f"{text}; divide them by {dearest // UNREACHABLE + 1} or more")


# The strategies of the layers and of types of robots.


def choose_strategies(
    scenario: Scenario,
    floor_plan: FloorPlan,
    layers: Iterable[str] = LAYER_NAMES,
    folder: Path = Path(),
) -> dict[str, StrategyChoice]:
    """The strategies that a scenario names, by layer. Raises InvalidValueError.

    Parameters may have a method `check_scenario(scenario, floor_plan)` that returns None or a sentence
    about a conflict. `folder`: base of their file names.
    """
    specs = {layer: getattr(scenario.strategy, layer) for layer in layers}
    strategies = {
        layer: choose_strategy(scenario, layer, spec, ("strategy", layer), folder)
        for layer, spec in specs.items()
    }
    if "zoning" in strategies:
        try:
            zoning_parameters_of(strategies["zoning"].parameters)
        except InputError as error:
            raise InvalidValueError(("strategy", "zoning"), error.message) from None
    for layer, choice in strategies.items():
        refuse(check_choice(scenario, floor_plan, ("strategy", layer), choice))
    return strategies


def choose_own_allocations(
    scenario: Scenario, floor_plan: FloorPlan, folder: Path
) -> tuple[StrategyChoice | None, ...]:
    """The allocation of each type of robots that has its own, else None; () if no type has one.

    Raises InvalidValueError.
    """
    specs = [kind.strategy.allocation for kind in scenario.fleet.types]
    if all(spec is None for spec in specs):
        return ()
    choices: list[StrategyChoice | None] = []
    for number, spec in enumerate(specs):
        keys: Keys = ("fleet", "types", number, "strategy", "allocation")
        own = None
        if spec is not None:
            own = choose_strategy(scenario, "allocation", spec, keys, folder)
            refuse(check_choice(scenario, floor_plan, keys, own))
        choices.append(own)
    return tuple(choices)


def choose_strategy(
    scenario: Scenario, layer: str, choice: Any, at: Keys, folder: Path = Path()
) -> StrategyChoice:
    """The strategy at some keys of a scenario: its name, or {name: NAME, ...parameters}.

    Raises InvalidValueError.
    """
    from automaton.strategy import lookup

    keys = at
    parameters: dict[str, Any] = {}
    if isinstance(choice, dict):
        parameters = {key: value for key, value in choice.items() if key != "name"}
        choice = choice.get("name")
        if not isinstance(choice, str):
            raise InvalidValueError(keys, f"the key 'name' is missing in {dotted(at)}")
        keys = (*keys, "name")
    try:
        wanted = lookup.parameters_type(layer, choice)
    except InputError as error:
        raise InvalidValueError(keys, error.message) from None
    numbers, conversions = with_numbers(parameters, wanted, scenario.units.scale, at)
    given = validated(numbers, wanted, at)
    try:
        return StrategyChoice(choice, resolve_paths(given, folder), conversions)
    except InputError as error:
        raise InvalidValueError(at, error.message) from None


def check_choice(
    scenario: Scenario, floor_plan: FloorPlan, keys: Keys, choice: StrategyChoice
) -> Iterator[Finding]:
    """A strategy fits its scenario, by the check of its parameters."""
    if sentence := objection_to(choice, scenario, floor_plan):
        yield Finding(keys, f"{dotted(keys)} is {choice.name}: {sentence}")


def check_allocations(resolved: Resolved) -> Iterator[Finding]:
    """The number of allocation strategies is within the limit of a run."""
    number = len(resolved.allocations)
    if number > MAX_ALLOCATIONS:
        text = (
            f"fleet.types and strategy.allocation name {number} different allocation strategies; "
            f"at most {MAX_ALLOCATIONS} are allowed"
        )
        yield Finding(("fleet", "types"), text)


def naming_files(
    scenario: Scenario,
    strategies: dict[str, StrategyChoice],
    own_allocations: tuple[StrategyChoice | None, ...],
) -> Scenario:
    """The scenario with absolute paths of the files of its strategies."""
    change = msgspec.structs.replace
    specs = {
        layer: _naming_files(getattr(scenario.strategy, layer), choice)
        for layer, choice in strategies.items()
    }
    types = tuple(
        kind
        if own is None
        else change(
            kind,
            strategy=change(kind.strategy, allocation=_naming_files(kind.strategy.allocation, own)),
        )
        for kind, own in zip(scenario.fleet.types, own_allocations, strict=False)
    )
    fleet = change(scenario.fleet, types=types) if types else scenario.fleet
    return change(scenario, strategy=change(scenario.strategy, **specs), fleet=fleet)


def _naming_files(spec: Any, choice: StrategyChoice) -> Any:
    """The data of a strategy with absolute paths of its files."""
    if not files_of(choice.parameters) or not isinstance(spec, dict):
        return spec
    resolved_parameters = msgspec.to_builtins(choice.parameters)
    return {key: resolved_parameters.get(key, spec[key]) for key in spec}


# A resolved scenario with other settings, in the middle of a run.


def branched(resolved: Resolved, settings: tuple[str, ...]) -> Resolved:
    """The scenario with KEY=VALUE settings changed in the middle of a run.

    Floor, fleet, orders and seed cannot change. Raises InputError.
    """
    resolved = resolved.unrefined
    floor_plan = resolved.floor_plan
    reading = Reading(document_of(resolved.scenario, settings))
    with reading.placing_errors():
        scenario = reading.scenario()
        for name in Scenario.__struct_fields__:
            same = getattr(scenario, name) == getattr(resolved.scenario, name)
            if name not in CHANGEABLE and not same:
                text = f"{name} cannot change during a run; allowed: {', '.join(CHANGEABLE)}"
                raise InvalidValueError((name,), text)
        ends = {scenario.stop.when, resolved.scenario.stop.when}
        if "on-targets" in ends and len(ends) > 1:
            text = "when cannot change to on-targets or from it during a run"
            raise InvalidValueError(("stop", "when"), text)
        if scenario.streets != resolved.scenario.streets:
            scenario, floor_plan = with_other_weights(reading, scenario, resolved)
        refuse(check_energy(scenario, floor_plan))
        refuse(check_table_memory(scenario, floor_plan))
        refuse(check_street_costs(scenario, floor_plan))
        strategies = choose_strategies(scenario, floor_plan, folder=reading.folder)
        own_allocations = choose_own_allocations(scenario, floor_plan, reading.folder)
        changed = replace(
            resolved,
            scenario=naming_files(scenario, strategies, own_allocations),
            floor_plan=floor_plan,
            strategies=strategies,
            own_allocations=own_allocations,
        )
        refuse(check_allocations(changed))
        return in_fine_ticks(changed)


def with_other_weights(
    reading: Reading, scenario: Scenario, resolved: Resolved
) -> tuple[Scenario, FloorPlan]:
    """The scenario with its file of streets, and the floor with their weights.

    Closed and open moves and capacities cannot change during a run. Raises InvalidValueError.
    """
    floor = Floor(resolved.floor_plan)
    scenario, streets = reading.with_streets_on_floor(scenario, floor, is_closed=True)
    weights = streets.weights
    before = streets_on(resolved.floor_plan, resolved.scenario.streets, is_closed=True)
    if (weights.rules != before.rules).any():
        text = "streets may change weights during a run, but neither closed or open moves nor capacities"
        raise InvalidValueError(("streets",), text)
    return scenario, weights.floor()
