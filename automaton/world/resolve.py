"""Whether there is memory for distance tables at all."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from automaton.engine.distance_tables import least_table_bytes
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.carried_pods import carries_pods, pod_cells, pod_names
from automaton.scenario.document import (
    SHIPPED_FOLDER,
    STUDIES_ARE_SWEPT,
    Document,
    Keys,
    Override,
    is_study,
    override,
    read,
)
from automaton.scenario.floor_section import floor_of
from automaton.scenario.order_files import (
    with_lines_of_file,
    with_orders_of_file,
    with_tasks_of_file,
)
from automaton.scenario.order_lines import plain_data
from automaton.scenario.refinement import refined, refined_value, too_long
from automaton.scenario.robot_types import types_of
from automaton.scenario.schema import LAYER_NAMES, Scenario, Units
from automaton.scenario.table_files import (
    names_of_cells,
    with_durations_of_files,
    with_locations_of_file,
    with_pods_of_file,
    with_starts_of_file,
)
from automaton.scenario.validation import Conversion, dotted, validated, with_numbers
from automaton.strategy.lookup import (
    NoParameters,
    ZoningParameters,
    files_of,
    resolve_paths,
    zoning_parameters_of,
)
from automaton.units import bytes_of, memory
from automaton.world.capabilities import FleetOnFloor, Start, with_right_of_way
from automaton.world.feasibility import check_energy, check_feasible
from automaton.world.floor_parts import (
    check_speed_limits,
    with_charger_blocks,
    with_shared_chargers,
    with_speed_limits,
)


def check_table_memory(document: Document, scenario: Scenario, floor_plan: FloorPlan) -> None:
    """A table of this floor fits world.distance_tables. Raises InputError."""
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
        raise document.error(
            ("world", "distance_tables"),
            f"world.distance_tables is {text}, but a table of the {cells:,} cells of this floor takes "
            f"{memory(size)}; set it to at least that",
        )


# A scenario made ready to run: floor built, strategies found, contradictions refused.


MAX_ALLOCATIONS = 4  # strategies that a run asks for allocations
CHANGEABLE = ("strategy", "durations", "information", "world", "stop")  # while a run goes on


class StrategyChoice(NamedTuple):
    """The strategy of one layer."""

    name: str  # of the table of built-ins, of a plug-in, or "module:Class"
    parameters: msgspec.Struct
    conversions: tuple[Conversion, ...] = ()  # of texts in them


@dataclass(frozen=True)
class Resolved:
    """Everything that a run follows from."""

    scenario: Scenario
    floor_plan: FloorPlan
    strategies: dict[str, StrategyChoice]  # by layer
    start: Start
    source: str  # text of the scenario file; "" for a Scenario built in Python
    overrides: tuple[str, ...] = ()  # the --set arguments as typed
    files: tuple[tuple[str, str], ...] = ()  # read for the scenario: path, 16 hex digits of content
    conversions: tuple[Conversion, ...] = ()  # of texts with units, but for those of strategies
    file_notes: tuple[str, ...] = ()  # what was read of a file of orders, for `check`
    file_warnings: tuple[str, ...] = ()  # and what is odd in it
    coarse: Resolved | None = None  # as it was read, where this is in finer ticks
    # Of each type of robots the allocation that it has to itself; None: that of `strategies`.
    own_allocations: tuple[StrategyChoice | None, ...] = ()
    orders_of_file: bool = False  # whether its orders, or their lines, come from a file

    @cached_property
    def fleet(self) -> FleetOnFloor:
        """The robots on the floor: types, starts, what they reach."""
        return FleetOnFloor(self.scenario, self.floor_plan, self.start)

    @cached_property
    def pod_names(self) -> tuple[str, ...]:
        """The name of each pod, its number from 1 where it has none; () where none is carried."""
        if not carries_pods(self.scenario, self.floor_plan):
            return ()
        return tuple(pod_names(self.scenario, len(pod_cells(self.scenario, self.floor_plan))))

    def __reduce__(self) -> Any:
        """A refined scenario is refined again: made from its parts, it would be checked as read."""
        if self.coarse is None:
            return object.__new__, (Resolved,), self.__getstate__()
        return in_fine_ticks, (replace(self.coarse, overrides=self.overrides),)

    def __getstate__(self) -> dict[str, Any]:
        """All but the fleet, which follows from the rest and may be larger than all of it."""
        return {name: value for name, value in vars(self).items() if name != "fleet"}

    @property
    def unrefined(self) -> Resolved:
        """The scenario in the ticks in which it was read."""
        return self if self.coarse is None else self.coarse

    @property
    def allocations(self) -> tuple[StrategyChoice, ...]:
        """The strategies that allocate orders, each once: that of `strategies`, unless all types have
        their own, then these."""
        is_used = self.strategies and (None in self.own_allocations or not self.own_allocations)
        choices = [self.strategies["allocation"]] if is_used else []
        for own in self.own_allocations:
            if own is not None and all(own[:2] != other[:2] for other in choices):
                choices.append(own)
        return tuple(choices)

    @property
    def allocation_of_types(self) -> list[int]:
        """Of each type of robots, which of `allocations` is its own; empty where no type has one."""
        known = [choice[:2] for choice in self.allocations]
        return [0 if own is None else known.index(own[:2]) for own in self.own_allocations]

    @property
    def may_stay(self) -> bool:
        """Whether robots without an order stay where they are."""
        return any(
            getattr(choice.parameters, "idle", "park") == "stay" for choice in self.allocations
        )

    @property
    def choices(self) -> tuple[tuple[str, StrategyChoice], ...]:
        """The layer and the choice of all strategies, by number: those of layers, then of types."""
        first, *further = self.allocations or (None,)
        strategies = self.strategies | ({"allocation": first} if first else {})
        of_layers = ((name, strategies[name]) for name in LAYER_NAMES if strategies)
        return (*of_layers, *(("allocation", choice) for choice in further))

    @property
    def zoning(self) -> ZoningParameters:
        """What the zoning strategy says of the zones at the start. Raises InputError."""
        choice = self.strategies.get("zoning")  # a story has no strategies
        return zoning_parameters_of(choice.parameters if choice else NoParameters())


def resolve(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    overrides: Iterable[str | Override] = (),
    seed: int | None = None,
) -> Resolved:
    """Check a scenario completely: a path, the name of a shipped one, a file's content, or a Scenario.

    `overrides` are KEY=VALUE texts, or values with their places; `seed` replaces the scenario's
    own. Raises InputError.
    """
    settings = tuple(overrides)
    document = document_of(scenario, settings)
    if seed is not None:
        seeded = Override(f"--seed {seed}", ("seed",), seed)
        data = {**document.data, "seed": seed}
        document = replace(document, data=data, overrides=(*document.overrides, seeded))
    document, location_file = with_locations_of_file(document)
    document, pod_file = with_pods_of_file(document)
    document, checked, conversions = checked_scenario(document)
    document, checked, order_file = with_orders_of_file(document, checked)
    document, checked, start_file = with_starts_of_file(document, checked)
    checked, handling_files = with_durations_of_files(document, checked)
    floor = floor_of(document, checked.layout)
    checked = with_charger_blocks(checked, floor.floor_plan)
    floor = floor._replace(floor_plan=with_shared_chargers(floor.floor_plan))
    check_speed_limits(document, checked, floor.floor_plan)
    limits = checked.floor.speed_limits
    floor = floor._replace(floor_plan=with_speed_limits(floor.floor_plan, limits))
    document, checked, task_file = with_tasks_of_file(document, checked, floor.floor_plan)
    document, checked, line_file = with_lines_of_file(document, checked, floor.floor_plan)
    order_file = order_file or line_file
    fleet = check_feasible(document, checked, floor)
    check_table_memory(document, checked, floor.floor_plan)
    checked = with_right_of_way(checked, fleet)
    strategies = choose_strategies(document, checked, floor.floor_plan)
    own_allocations = choose_own_allocations(document, checked, floor.floor_plan)
    resolved = Resolved(
        scenario=naming_files(checked, strategies, own_allocations),
        floor_plan=floor.floor_plan,
        strategies=strategies,
        start=fleet.start,
        source=document.text,
        overrides=tuple(
            setting if isinstance(setting, str) else setting.argument for setting in settings
        ),
        files=tuple(
            (file.path, file.content_hash)
            for file in (
                location_file,
                pod_file,
                order_file,
                start_file,
                task_file,
                *handling_files,
            )
            if file is not None
        ),
        conversions=conversions,
        file_notes=tuple(
            note for file in (pod_file, order_file) if file is not None for note in file.notes
        ),
        orders_of_file=order_file is not None,
        own_allocations=own_allocations,
        file_warnings=() if order_file is None else order_file.warnings,
    )
    vars(resolved)["fleet"] = fleet  # with the facts that the checks have found
    check_allocations(document, resolved)
    return in_fine_ticks(resolved, document)


def in_fine_ticks(resolved: Resolved, document: Document | None = None) -> Resolved:
    """A scenario as `refine` says, in finer ticks; itself if that is 1. Raises InputError."""
    scenario = resolved.scenario
    if scenario.refine == 1:
        return resolved
    document = document or Document({})
    wrong = too_long(scenario)
    if wrong:
        raise document.error(("refine",), wrong)
    fine = refined(scenario)
    floor_plan = with_speed_limits(resolved.floor_plan, fine.floor.speed_limits)

    def in_fine(choice: StrategyChoice) -> StrategyChoice:
        return choice._replace(parameters=refined_value(choice.parameters, scenario.refine))

    strategies = {layer: in_fine(choice) for layer, choice in resolved.strategies.items()}
    own_allocations = tuple(own and in_fine(own) for own in resolved.own_allocations)
    further = (("fleet.types: allocation", own) for own in own_allocations if own is not None)
    of_layers = ((f"strategy.{layer}", choice) for layer, choice in strategies.items())
    for key, choice in (*of_layers, *further):
        objection = getattr(choice.parameters, "check_scenario", None)
        sentence = objection(fine, floor_plan) if objection else None
        if sentence:
            text = f"with refine {scenario.refine} {key} is {choice.name}: {sentence}"
            raise document.error(("refine",), text)
    return replace(
        resolved,
        scenario=fine,
        floor_plan=floor_plan,
        strategies=strategies,
        own_allocations=own_allocations,
        coarse=resolved,
    )


def checked_scenario(document: Document) -> tuple[Document, Scenario, tuple[Conversion, ...]]:
    """What a document says, with numbers and cells for its texts. Raises InputError."""
    units = validated(document, document.data.get("units", {}), Units, ("units",))
    names = names_of_cells(document)
    data, conversions = with_numbers(document, document.data, Scenario, units.scale, names=names)
    document = replace(document, data=data)
    return document, validated(document, data, Scenario), conversions


def choose_strategies(
    document: Document,
    scenario: Scenario,
    floor_plan: FloorPlan,
    layers: Iterable[str] = LAYER_NAMES,
) -> dict[str, StrategyChoice]:
    """The strategies that a scenario names, by layer. Raises InputError.

    Parameters may have a method `check_scenario(scenario, floor_plan)`: one sentence on what they
    do not go with, or None.
    """
    strategies = {
        layer: choose_strategy(
            document, scenario, layer, getattr(scenario.strategy, layer), ("strategy", layer)
        )
        for layer in layers
    }
    if "zoning" in strategies:
        try:
            zoning_parameters_of(strategies["zoning"].parameters)
        except InputError as error:
            raise document.error(("strategy", "zoning"), error.message) from None
    for layer, choice in strategies.items():
        _check_choice(document, scenario, floor_plan, ("strategy", layer), choice)
    return strategies


def choose_own_allocations(
    document: Document, scenario: Scenario, floor_plan: FloorPlan
) -> tuple[StrategyChoice | None, ...]:
    """Of each type of robots the allocation that it has to itself; () if none has. Raises InputError."""
    specs = [kind.strategy.allocation for kind in scenario.fleet.types]
    if all(spec is None for spec in specs):
        return ()
    choices: list[StrategyChoice | None] = []
    for number, spec in enumerate(specs):
        keys: Keys = ("fleet", "types", number, "strategy", "allocation")
        own = None
        if spec is not None:
            own = choose_strategy(document, scenario, "allocation", spec, keys)
            _check_choice(document, scenario, floor_plan, keys, own)
        choices.append(own)
    return tuple(choices)


def check_allocations(document: Document, resolved: Resolved) -> None:
    """Raises InputError for more strategies of allocation than a run asks."""
    number = len(resolved.allocations)
    if number > MAX_ALLOCATIONS:
        text = (
            f"fleet.types and strategy.allocation name {number} different allocation strategies; "
            f"at most {MAX_ALLOCATIONS} are allowed"
        )
        raise document.error(("fleet", "types"), text)


def _check_choice(
    document: Document,
    scenario: Scenario,
    floor_plan: FloorPlan,
    keys: Keys,
    choice: StrategyChoice,
) -> None:
    objection = getattr(choice.parameters, "check_scenario", None)
    sentence = objection(scenario, floor_plan) if objection else None
    if sentence:
        raise document.error(keys, f"{dotted(keys)} is {choice.name}: {sentence}")


def naming_files(
    scenario: Scenario,
    strategies: dict[str, StrategyChoice],
    own_allocations: tuple[StrategyChoice | None, ...],
) -> Scenario:
    """The scenario with the files of its strategies named as they are found from anywhere."""
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
    """What a scenario says of a strategy, with the files as they are found from anywhere."""
    if not files_of(choice.parameters) or not isinstance(spec, dict):
        return spec
    resolved_parameters = msgspec.to_builtins(choice.parameters)
    return {key: resolved_parameters.get(key, spec[key]) for key in spec}


def branched(resolved: Resolved, settings: tuple[str, ...]) -> Resolved:
    """The scenario with KEY=VALUE settings changed in the middle of a run.

    Floor, fleet, orders and seed are what the run began with. Raises InputError.
    """
    resolved = resolved.unrefined
    document, scenario, _ = checked_scenario(document_of(resolved.scenario, settings))
    for name in Scenario.__struct_fields__:
        if name not in CHANGEABLE and getattr(scenario, name) != getattr(resolved.scenario, name):
            can = ", ".join(CHANGEABLE)
            raise document.error(
                (name,), f"{name} cannot change while a run goes on; what can: {can}"
            )
    check_energy(document, scenario, resolved.floor_plan)
    check_table_memory(document, scenario, resolved.floor_plan)
    strategies = choose_strategies(document, scenario, resolved.floor_plan)
    own_allocations = choose_own_allocations(document, scenario, resolved.floor_plan)
    changed = replace(
        resolved,
        scenario=naming_files(scenario, strategies, own_allocations),
        strategies=strategies,
        own_allocations=own_allocations,
    )
    check_allocations(document, changed)
    return in_fine_ticks(changed, document)


def document_of(
    scenario: str | Path | Mapping[str, Any] | Scenario, settings: Iterable[str | Override] = ()
) -> Document:
    """What a scenario says, unchecked, with KEY=VALUE texts over it. Raises InputError."""
    if isinstance(scenario, Mapping):
        return override(Document(data=copy.deepcopy(dict(scenario))), settings)
    if not isinstance(scenario, Scenario):
        found = read(scenario)
        if is_study(found.data):
            raise InputError(f"this is a study; {STUDIES_ARE_SWEPT}", found.file)
        return override(found, settings)
    return override(Document(data=copy.deepcopy(plain_data(scenario))), settings)


def choose_strategy(
    document: Document, scenario: Scenario, layer: str, choice: Any, at: Keys
) -> StrategyChoice:
    """The strategy that stands at a place of a scenario: its name, or {name: NAME, ...parameters}."""
    from automaton.strategy import lookup

    keys = at
    parameters: dict[str, Any] = {}
    if isinstance(choice, dict):
        parameters = {key: value for key, value in choice.items() if key != "name"}
        choice = choice.get("name")
        if not isinstance(choice, str):
            raise document.error(keys, f"the key 'name' is missing in {dotted(at)}")
        keys = (*keys, "name")
    try:
        wanted = lookup.parameters_type(layer, choice)
    except InputError as error:
        raise document.error(keys, error.message) from None
    numbers, conversions = with_numbers(document, parameters, wanted, scenario.units.scale, at)
    given = validated(document, numbers, wanted, at)
    # Nobody keeps files beside the shipped scenarios.
    own = document.folder.resolve() != SHIPPED_FOLDER
    try:
        parameters_with_files = resolve_paths(given, document.folder if own else Path())
        return StrategyChoice(choice, parameters_with_files, conversions)
    except InputError as error:
        raise document.error(at, error.message) from None
