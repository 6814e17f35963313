"""The header of a recording: what a run follows from, and what a validator has to know of it.

Nothing in it needs the scenario's file, the generator of its floor, or Numba to be read again.
"""

from __future__ import annotations

import hashlib
import importlib.util
import platform
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from automaton.errors import InputError
from automaton.recording.contents import Content
from automaton.scenario.reading import content_hash
from automaton.scenario.resolve import Pick, Resolved
from automaton.scenario.schema import LAYERS, Scenario
from automaton.strategy import lookup
from automaton.strategy.entry import AsRecorded, files_of
from automaton.world.plan import FloorPlan

PACKAGES = ("automaton", "strategies", "layouts")
DECIDING = (".py", ".npz")  # files of these packages from which runs follow: code and networks
LIBRARIES = ("fleet-automaton", "numpy", "numba", "msgspec")
FLOOR_ARRAYS = ("kind", "exits", "capacity", "bays", "loads")


def header_of(resolved: Resolved, seed: int, world: Any, digest_names: tuple[str, ...]) -> Content:
    """The header of a run; `world` is its state at tick 0 with robots stored by identity."""
    plan, robots = resolved.plan, world.robots
    closed = resolved.scenario.orders.in_system
    weighs = bool((world.orders.weight != 1).any())
    plugins = tuple(pick.name for pick in resolved.picks.values() if ":" in pick.name)
    return {
        "scenario": msgspec.to_builtins(resolved.scenario),
        "seed": seed,
        "picks": _picks(resolved),
        "start": resolved.start,
        "overrides": resolved.overrides,
        "text": resolved.source,
        "sources": source_hash(plugins),
        **recorded_files(resolved),
        "versions": versions(),
        "digest_names": digest_names,
        "floor": {
            "width": plan.width,
            "height": plan.height,
            "starts": plan.starts,
            "numbered": plan.numbered,
            **{name: getattr(plan, name) for name in FLOOR_ARRAYS},
        },
        "robots": {
            name: getattr(robots, name).copy()
            for name in ("home", "bay", "cell", "heading", "charge")
        },
        "orders": {
            name: getattr(world.orders, name).copy()
            for name in (
                *("source", "target", "released"),
                *(["coming"] if closed else []),
                *(["weight"] if weighs else []),
            )
        },
        "works": {name: getattr(world.stations, name).copy() for name in ("ticks", "came")},
        "slots": {"cell": world.slots.cell.copy(), "spare": world.slots.spare},
    }


def rules_of(simulation: Any, settings: tuple[str, ...] = ()) -> Content:
    """What holds after the current tick of a simulation; `settings` were changed here."""
    resolved, rules = simulation.resolved, simulation.world.rules
    return {
        "tick": simulation.tick,
        "settings": settings,
        "scenario": msgspec.to_builtins(resolved.scenario),
        "picks": _picks(resolved),
        **file_hashes(resolved),
        "every": rules.every.copy(),
        "wait": rules.wait.copy(),
    }


def _picks(resolved: Resolved) -> Content:
    return {
        layer: {"name": pick.name, "parameters": msgspec.to_builtins(pick.parameters)}
        for layer, pick in resolved.picks.items()
    }


def changed(header: Content, rules: Content) -> Content:
    """The header with the scenario and the strategies that hold after a CONDITIONS frame."""
    return {**header, "scenario": rules["scenario"], "picks": rules["picks"]}


def resolved_of(header: Content, with_strategies: bool = True) -> Resolved:
    """The scenario of a recording, ready to run again.

    Raises InputError when a strategy is not installed here or takes other parameters now. Without
    its strategies, which a replay does not need, plug-ins keep their parameters as recorded.
    """
    start = header["start"]
    return Resolved(
        scenario=msgspec.convert(header["scenario"], Scenario),
        plan=plan_of(header["floor"]),
        picks={
            layer: _pick(layer, **given)
            if with_strategies or lookup.is_built_in(layer, given["name"])
            else Pick(given["name"], AsRecorded(given["parameters"]))
            for layer, given in ((layer, header["picks"][layer]) for layer in LAYERS)
        },
        start=start if isinstance(start, str) else tuple(start),  # type: ignore[arg-type]
        source=header["text"],
        overrides=tuple(header["overrides"]),
    )


def plan_of(floor: Content) -> FloorPlan:
    """The floor that a header tells of."""
    return FloorPlan(
        width=floor["width"],
        height=floor["height"],
        starts=tuple(floor["starts"]),
        numbered=tuple(floor["numbered"]),
        **{name: floor[name] for name in FLOOR_ARRAYS},
    )


def _pick(layer: str, name: str, parameters: Content) -> Pick:
    wanted = lookup.parameters_type(layer, name)
    try:
        return Pick(name, msgspec.convert(parameters, wanted))
    except msgspec.ValidationError as error:
        raise InputError(
            f"the recorded parameters of the {layer} strategy {name!r} do not fit it now: {error}"
        ) from None


@cache
def source_hash(plugins: tuple[str, ...] = ()) -> str:
    """16 hex digits of all that is installed and decides; `plugins`: "module:Class" names.

    Where the packages are installed does not matter.
    """
    digest = hashlib.sha256()
    for package in PACKAGES:
        spec = importlib.util.find_spec(package)
        if spec is not None and spec.origin is not None:
            root = Path(spec.origin).parent
            found = (path for path in root.rglob("*") if path.suffix in DECIDING)
            for path in sorted(path for path in found if path.is_file()):
                digest.update(path.relative_to(root.parent).as_posix().encode())
                digest.update(path.read_bytes())
    for plugin in sorted(plugins):
        spec = importlib.util.find_spec(plugin.partition(":")[0])
        if spec is not None and spec.origin is not None:
            digest.update(plugin.encode() + Path(spec.origin).read_bytes())
    return digest.hexdigest()[:16]


def file_hashes(resolved: Resolved) -> Content:
    """{"files": {file: 16 hex digits of its content}} of those that strategies read, if any do."""
    files = [file for pick in resolved.picks.values() for file in files_of(pick.parameters)]
    return {"files": {str(file): content_hash(file) for file in files}} if files else {}


def recorded_files(resolved: Resolved) -> Content:
    """The files of strategies, and of orders as they were when the scenario was read."""
    found = {**file_hashes(resolved).get("files", {}), **dict(resolved.files)}
    return {"files": found} if found else {}


@cache
def versions() -> dict[str, str]:
    """The versions of what computed the run, by name; what is not installed is left out."""
    found = {"python": platform.python_version()}
    for library in LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found


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
