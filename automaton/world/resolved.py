"""The complete input of a run, made by `resolve`: scenario, floor, strategies, starts.

With `refine` it is in finer ticks, and has the version in coarse ticks as `coarse`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import msgspec

from automaton.errors import InvalidValueError
from automaton.floor.floor_plan import CHARGER, FloorPlan
from automaton.scenario.order_lines import Day, carries_pods, pod_cells, pod_names
from automaton.scenario.refinement import refined, refined_value, too_long
from automaton.scenario.schema import LAYER_NAMES, Scenario
from automaton.scenario.table_reader import ReadFile
from automaton.scenario.validation import Conversion
from automaton.strategy.lookup import NoParameters, ZoningParameters, zoning_parameters_of
from automaton.units import count
from automaton.world.capabilities import FleetOnFloor, Start
from automaton.world.floor_parts import all_station_names, with_speed_limits
from automaton.world.gate_cells import cells_of, gates_of


class StrategyChoice(NamedTuple):
    """The strategy of one layer."""

    name: str  # of the table of built-ins, of a plug-in, or "module:Class"
    parameters: msgspec.Struct
    conversions: tuple[Conversion, ...] = ()  # of texts in them


@dataclass(frozen=True)
class Resolved:
    """The complete input of a run."""

    scenario: Scenario
    floor_plan: FloorPlan
    strategies: dict[str, StrategyChoice]  # by layer
    start: Start
    source: str  # text of the scenario file; "" for a Scenario built in Python
    overrides: tuple[str, ...] = ()  # the --set arguments as typed
    files: tuple[tuple[str, str], ...] = ()  # read for the scenario: path, 16 hex digits of content
    conversions: tuple[Conversion, ...] = ()  # of texts with units, except those of strategies
    file_notes: tuple[str, ...] = ()  # about the file of orders, for `check`
    coarse: Resolved | None = None  # in coarse ticks, if this is in finer ones
    # The allocation of each type of robots that has its own; None: that of `strategies`.
    own_allocations: tuple[StrategyChoice | None, ...] = ()
    own_streets: Any = None  # Streets as the scenario has them, before their file was read
    streets_in_words: str = ""  # what they change on the floor, besides weights
    days: tuple[Day, ...] = ()  # files of orders or lines; a seed draws one of them
    day: int = 0  # the one whose orders the scenario has
    day_pattern: str = ""  # that the files match; "" if the scenario names a single one
    observed: bool = False  # what real robots did: nothing is decided

    @cached_property
    def fleet(self) -> FleetOnFloor:
        """The robots on the floor: types, starts, reachable cells."""
        return FleetOnFloor(self.scenario, self.floor_plan, self.start)

    def with_rule_of(self, base: Resolved, settings: Mapping[str, Any]) -> dict[str, Any]:
        """The settings of a change of `base` that gave this scenario, with the right of way of `base`.

        The default depends on durations and on the floor, so two things might change at once. A change
        that sets a strategy itself is not altered.
        """
        rule = base.scenario.strategy.right_of_way
        is_own = any(key.partition(".")[0] == "strategy" for key in settings)
        is_same = self.scenario.strategy.right_of_way == rule
        return {**settings, **({} if is_own or is_same else {"strategy.right_of_way": rule})}

    @property
    def order_file(self) -> ReadFile | None:
        """The file of its orders or lines."""
        return self.days[self.day].file if self.days else None

    @property
    def has_same_orders(self) -> bool:
        """Whether runs with any seeds have the same listed orders."""
        return self.scenario.orders.listed is not None and len(self.days) < 2

    @property
    def day_in_words(self) -> str:
        """The file that was drawn, such as "tag03.csv, 1 of 10 files of days/*.csv"; "" without them."""
        if not self.day_pattern:
            return ""
        many = count(len(self.days), "file")
        return f"{self.days[self.day].name}, 1 of {many} of {self.day_pattern}"

    @property
    def skipped_rows(self) -> dict[str, Any] | None:
        """The skipped rows of the file of orders, for JSON output; None if none was."""
        file = self.order_file
        if file is None or not file.skipped:
            return None
        skipped = {"skipped": sum(file.skipped.values()), "reasons": dict(file.skipped)}
        return {"file": self.days[self.day].name, "rows": file.rows, **skipped}

    def of_seed(self, seed: int) -> Resolved:
        """The scenario with the orders of the file that a seed draws; itself if it has them."""
        number = drawn_day(seed, len(self.days))
        if number == self.day:
            return self
        if self.coarse is not None:
            fine = in_fine_ticks(self.coarse.of_seed(seed))
            return replace(fine, overrides=self.overrides)
        orders = self.days[number].orders
        scenario = msgspec.structs.replace(self.scenario, orders=orders)
        return replace(self, scenario=scenario, day=number)

    @cached_property
    def pod_names(self) -> tuple[str, ...]:
        """The name of each pod, or its number from 1 if it has no name; () if no pods are carried."""
        if not carries_pods(self.scenario, self.floor_plan):
            return ()
        return tuple(pod_names(self.scenario, len(pod_cells(self.scenario, self.floor_plan))))

    @cached_property
    def station_names(self) -> tuple[str, ...]:
        """The name of each station, or its number from 1 if it has no name; () if no pods are carried."""
        if not carries_pods(self.scenario, self.floor_plan):
            return ()
        return all_station_names(self.scenario, self.floor_plan)

    @cached_property
    def place_names(self) -> dict[int, str]:
        """The names of stations, chargers, doors, lifts and closings, such as "door 1", by flat cell."""
        plan = self.floor_plan
        stations = all_station_names(self.scenario, plan)
        names = {
            cell: f"station {name}"
            for cell, name in zip(plan.stations.tolist(), stations, strict=True)
        }
        chargers = (plan.kind.reshape(-1) == CHARGER).nonzero()[0].tolist()
        names |= {cell: f"charger {number}" for number, cell in enumerate(chargers, 1)}
        for gate in gates_of(self.scenario.floor):
            if not gate.name.startswith("block"):
                names |= dict.fromkeys(cells_of(gate, plan), gate.name)
        return names

    @property
    def level_corners(self) -> tuple[tuple[str, int], ...]:
        """The names of levels, and their first cells as flat indices."""
        levels = self.scenario.floor.levels
        return tuple((name, self.floor_plan.cell(*one.first)) for name, one in levels.items())

    def __reduce__(self) -> Any:
        """Unpickling refines the coarse scenario again: fine values would not pass the checks."""
        if self.coarse is None:
            return object.__new__, (Resolved,), self.__getstate__()
        return in_fine_ticks, (replace(self.coarse, overrides=self.overrides),)

    def __getstate__(self) -> dict[str, Any]:
        """All fields except the fleet, which is derived and may be larger than the rest."""
        return {name: value for name, value in vars(self).items() if name != "fleet"}

    @property
    def unrefined(self) -> Resolved:
        """The scenario in the ticks in which it was read."""
        return self if self.coarse is None else self.coarse

    @property
    def allocations(self) -> tuple[StrategyChoice, ...]:
        """The strategies that allocate orders, each once: those of types, and that of `strategies` unless
        all types have their own.
        """
        is_used = self.strategies and (None in self.own_allocations or not self.own_allocations)
        choices = [self.strategies["allocation"]] if is_used else []
        for own in self.own_allocations:
            if own is not None and all(own[:2] != other[:2] for other in choices):
                choices.append(own)
        return tuple(choices)

    @property
    def allocation_of_types(self) -> list[int]:
        """The index in `allocations` for each type of robots; empty if no type has its own allocation."""
        known = [choice[:2] for choice in self.allocations]
        return [0 if own is None else known.index(own[:2]) for own in self.own_allocations]

    @property
    def may_stay(self) -> bool:
        """Whether robots without an order stay in their cells."""
        return any(
            getattr(choice.parameters, "idle", "park") == "stay" for choice in self.allocations
        )

    @property
    def choices(self) -> tuple[tuple[str, StrategyChoice], ...]:
        """The layer and the choice of all strategies, by number: layers, then types."""
        first, *further = self.allocations or (None,)
        strategies = self.strategies | ({"allocation": first} if first else {})
        of_layers = ((name, strategies[name]) for name in LAYER_NAMES if strategies)
        return (*of_layers, *(("allocation", choice) for choice in further))

    @property
    def zoning(self) -> ZoningParameters:
        """The zones of the zoning strategy at the start. Raises InputError."""
        choice = self.strategies.get("zoning")  # a story has no strategies
        return zoning_parameters_of(choice.parameters if choice else NoParameters())


def drawn_day(seed: int, files: int) -> int:
    """The number from 0 of the file of orders that a seed draws, each equally likely."""
    if files < 2:
        return 0
    from automaton.engine.random_numbers import STREAM_DAYS  # needs Numba, unlike most checks
    from automaton.world.draws import integers

    return int(integers(1, files, seed, STREAM_DAYS)[0])


def objection_to(choice: StrategyChoice, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
    """The objection of the parameters of a strategy to a scenario, or None."""
    check = getattr(choice.parameters, "check_scenario", None)
    sentence: str | None = check(scenario, floor_plan) if check else None
    return sentence


def in_fine_ticks(resolved: Resolved) -> Resolved:
    """A scenario in finer ticks by its `refine`; itself if that is 1. Raises InvalidValueError."""
    scenario = resolved.scenario
    if scenario.refine == 1:
        return resolved
    wrong = too_long(scenario)
    if wrong:
        raise InvalidValueError(("refine",), wrong)
    fine = refined(scenario)
    floor_plan = with_speed_limits(resolved.floor_plan, fine.floor.speed_limits)

    def in_fine(choice: StrategyChoice) -> StrategyChoice:
        return choice._replace(parameters=refined_value(choice.parameters, scenario.refine))

    strategies = {layer: in_fine(choice) for layer, choice in resolved.strategies.items()}
    own_allocations = tuple(own and in_fine(own) for own in resolved.own_allocations)
    further = (("fleet.types: allocation", own) for own in own_allocations if own is not None)
    of_layers = ((f"strategy.{layer}", choice) for layer, choice in strategies.items())
    for key, choice in (*of_layers, *further):
        if sentence := objection_to(choice, fine, floor_plan):
            text = f"with refine {scenario.refine} {key} is {choice.name}: {sentence}"
            raise InvalidValueError(("refine",), text)
    return replace(
        resolved,
        scenario=fine,
        floor_plan=floor_plan,
        strategies=strategies,
        own_allocations=own_allocations,
        coarse=resolved,
    )
