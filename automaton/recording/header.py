"""The header of a recording: the inputs of a run, and the data that a validator needs.

Reading it does not need the scenario's file, the generator of its floor, or Numba.
"""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import msgspec
import numpy as np

from automaton.engine.jit.structs import Struct
from automaton.engine.state import NEVER, NIL
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.recording.contents import IN_HEADER, OF_SKUS, Content
from automaton.runs.provenance import file_hashes, loaded_sources, recorded_files, versions
from automaton.scenario.order_lines import plain_data
from automaton.scenario.schema import LAYER_NAMES, Scenario
from automaton.strategy import lookup
from automaton.strategy.lookup import AsRecorded
from automaton.world.floor_parts import with_speed_limits
from automaton.world.resolved import Resolved, StrategyChoice, in_fine_ticks

FLOOR_ARRAYS = ("kind", "exits", "capacity", "bays", "loads", "opens")


def header_of(resolved: Resolved, seed: int, world: Any, digest_names: tuple[str, ...]) -> Content:
    """The header of a run; `world` is its state at tick 0 with robots stored by identity."""
    floor_plan = resolved.floor_plan
    left_out = set() if world.rules.in_system else {"release_sequence"}
    if not (world.orders.weight != 1).any():
        left_out.add("weight")
    if not world.orders.priority.any():
        left_out.add("priority")
    if not (world.orders.due != NEVER).any():
        left_out.add("due")
    tours = len(world.stops.cell) > 0
    if not tours:
        left_out.add("first_stop")
    plugins = tuple(choice.name for _, choice in resolved.choices if ":" in choice.name)
    return {
        "scenario": plain_data(resolved.unrefined.scenario),
        "seed": seed,
        "strategies": _strategies(resolved),
        "start": resolved.start,
        "overrides": resolved.overrides,
        "text": resolved.source,
        "sources": loaded_sources(plugins),
        **recorded_files(resolved),
        "versions": versions(),
        "digest_names": digest_names,
        "floor": {
            "width": floor_plan.width,
            "height": floor_plan.height,
            "starts": floor_plan.starts,
            "numbered": floor_plan.numbered,
            **{name: getattr(floor_plan, name) for name in FLOOR_ARRAYS},
        },
        "robots": _copies(world.robots),
        "orders": _copies(world.orders, left_out),
        **({"stops": _copies(world.stops)} if tours else {}),
        **_of_pods(world),
        **({"gates": _copies(world.gates)} if len(world.gates.closings) else {}),
        "jobs": _copies(world.stations),
        "slots": {**_copies(world.slots), "first_spare": world.slots.first_spare},
    }


def _of_pods(world: Any) -> Content:
    """The fields of a header for pods, lines and their stations."""
    if not len(world.pods.slot):
        return {}
    left_out = {name: set(arrays) for name, arrays in OF_SKUS.items()}
    if (world.lines.sku != NIL).any():
        left_out = {part: set() for part in OF_SKUS}
    if not (world.pods.weight != 1).any():
        left_out["pods"] = {*left_out["pods"], "weight"}
    parts = OF_SKUS if len(world.lines.order) else ("pods", "pod_stations")
    return {name: _copies(getattr(world, name), left_out[name]) for name in parts}


def _copies(struct: Struct, left_out: Container[str] = ()) -> Content:
    """Copies of the arrays of a struct that belong in a header."""
    names = [name for name in struct.fields_where(IN_HEADER) if name not in left_out]
    return {name: getattr(struct, name).copy() for name in names}


def rules_of(simulation: Any, settings: tuple[str, ...] = ()) -> Content:
    """The conditions after the current tick of a simulation; `settings`: those changed here."""
    resolved, rules = simulation.resolved, simulation.world.rules
    return {
        "tick": simulation.tick,
        "settings": settings,
        "scenario": plain_data(resolved.unrefined.scenario),
        "strategies": _strategies(resolved),
        **file_hashes(resolved),
        "period": rules.period.copy(),
        "wait": rules.wait.copy(),
        "steered": rules.steered.copy(),
        "watches_chargers": rules.watches_chargers.copy(),
    }


def _strategies(resolved: Resolved) -> Content:
    """Strategies by layer, then the allocations of single robot types."""
    resolved = resolved.unrefined
    types = zip(resolved.scenario.fleet.types, resolved.own_allocations, strict=False)
    own = {own_allocation_of(kind.name): choice for kind, choice in types if choice is not None}
    return {
        key: {"name": choice.name, "parameters": msgspec.to_builtins(choice.parameters)}
        for key, choice in (resolved.strategies | own).items()
    }


def own_allocation_of(robot_type: str) -> str:
    """The key of the allocation of a single robot type, among recorded strategies."""
    return f"allocation of {robot_type}"


def changed(header: Content, rules: Content) -> Content:
    """The header with the scenario and the strategies that apply after a CONDITIONS frame."""
    return {**header, "scenario": rules["scenario"], "strategies": rules["strategies"]}


def resolved_of(header: Content, with_strategies: bool = True) -> Resolved:
    """The scenario of a recording, ready to run again.

    Raises InputError if a strategy is not installed or now takes other parameters. Without its
    strategies, which a replay does not need, plug-ins keep their recorded parameters.
    """

    def choice_of(layer: str, given: Content) -> StrategyChoice:
        if with_strategies or lookup.is_built_in(layer, given["name"]):
            return _strategy_choice(layer, **given)
        return StrategyChoice(given["name"], AsRecorded(given["parameters"]))

    start = header["start"]
    scenario = msgspec.convert(header["scenario"], Scenario)
    keys = (own_allocation_of(kind.name) for kind in scenario.fleet.types)
    recorded = [header["strategies"].get(key) for key in keys]
    own = tuple(one and choice_of("allocation", one) for one in recorded)
    resolved = Resolved(
        scenario=scenario,
        floor_plan=with_speed_limits(floor_plan_of(header["floor"]), scenario.floor.speed_limits),
        strategies={layer: choice_of(layer, header["strategies"][layer]) for layer in LAYER_NAMES},
        own_allocations=own if any(own) else (),
        start=start if isinstance(start, str) else tuple(start),  # type: ignore[arg-type]
        source=header["text"],
        overrides=tuple(header["overrides"]),
    )
    return in_fine_ticks(resolved)


def floor_plan_of(floor: Content) -> FloorPlan:
    """The floor of a header."""
    return FloorPlan(
        width=floor["width"],
        height=floor["height"],
        starts=tuple(floor["starts"]),
        numbered=tuple(floor["numbered"]),
        **{name: floor[name] for name in FLOOR_ARRAYS},
    )


def _strategy_choice(layer: str, name: str, parameters: Content) -> StrategyChoice:
    wanted = lookup.parameters_type(layer, name)
    try:
        return StrategyChoice(name, msgspec.convert(parameters, wanted))
    except msgspec.ValidationError as error:
        raise InputError(
            f"the recorded parameters of the {layer} strategy {name!r} are not valid for it now: "
            f"{error}"
        ) from None


def state_of(world: Any, names: dict[str, tuple[str, ...]]) -> Content:
    """Copies of arrays of a world, robots by identity: {"robots": {"cell": ...}, ...}."""
    state: Content = {}
    for part, fields in names.items():
        arrays = {name: getattr(getattr(world, part), name) for name in fields}
        if part == "robots":
            by_identity = world.robots.at_index
            arrays = {name: array[by_identity] for name, array in arrays.items()}
        state[part] = {name: np.array(array) for name, array in arrays.items()}
    return state
