"""What belongs to a run as a whole, beside its tables: its metrics, and its scenario as it was run."""

from __future__ import annotations

from collections.abc import Container, Iterator
from typing import Any, Final

import msgspec
import yaml

from automaton.errors import InputError
from automaton.floor.floor_drawing import floor_drawing, legend_entry
from automaton.runs.asked_orders import asked_orders
from automaton.runs.headless import is_finished
from automaton.runs.metric_catalogue import to_scenario_units, units_of
from automaton.runs.metrics import metrics_by_type, metrics_of
from automaton.runs.provenance import versions
from automaton.runs.simulation import Simulation
from automaton.scenario.orders import LineTable

LISTS: Final = ("listed", "lines", "tasks")  # of orders, which may have a million entries
WIDTH: Final = 100


def metrics_document(simulation: Simulation) -> dict[str, Any]:
    """What `run --json` has of the whole run."""
    resolved, metrics = simulation.resolved, metrics_of(simulation)
    orders = asked_orders(simulation.world)
    in_units = to_scenario_units(metrics, *units_of(resolved))
    types = metrics_by_type(simulation)
    return {
        "scenario": resolved.scenario.name,
        "seed": simulation.seed,
        "finished": is_finished(simulation),
        "ticks": simulation.tick,
        "orders": len(orders.done),
        "delivered": int((orders.done >= 0).sum()),
        "digest": simulation.digest,
        "metrics": metrics,
        **({"types": types} if types else {}),
        **({"metrics_in_units": in_units} if in_units else {}),
    }


def scenario_lines(simulation: Simulation) -> Iterator[str]:
    """The scenario with all its defaults, numbers in ticks, and its seed; versions above it."""
    orders = simulation.resolved.scenario.orders
    values = {name: getattr(orders, name) for name in LISTS}
    lists = {name: value for name, value in values.items() if isinstance(value, tuple | LineTable)}
    data = _sections(simulation.resolved.scenario)
    data["orders"] = _sections(orders, lists)
    data["seed"] = simulation.seed
    data["layout"] = _layout(simulation)
    used = ", ".join(f"{name} {version}" for name, version in versions().items())
    yield f"# As it was run, with {used}.\n"
    keys = {f"  {_key_of(orders, name)}: []": entries for name, entries in lists.items()}
    text = yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=WIDTH)
    for line in text.splitlines():
        if line not in keys:
            yield line + "\n"
            continue
        yield line.removesuffix(" []") + "\n"
        for entry in keys[line]:
            values = msgspec.to_builtins(entry)
            if isinstance(values, dict):
                values = {name: value for name, value in values.items() if value is not None}
            yield f"    - {msgspec.json.encode(values).decode()}\n"


def _sections(struct: msgspec.Struct, lists: Container[str] = ("orders",)) -> dict[str, Any]:
    """The fields of a struct by their keys; an empty list for each of `lists`."""
    return {
        field.encode_name: []
        if field.name in lists
        else msgspec.to_builtins(getattr(struct, field.name))
        for field in msgspec.structs.fields(struct)
    }


def _key_of(struct: msgspec.Struct, name: str) -> str:
    """The key of a field."""
    fields = msgspec.structs.fields(struct)
    return next(field.encode_name for field in fields if field.name == name)


def _layout(simulation: Simulation) -> dict[str, Any]:
    """The floor; one of a file is drawn, if it can be."""
    layout: dict[str, Any] = dict(simulation.resolved.scenario.layout)
    if "file" not in layout:
        return layout
    try:
        drawing = floor_drawing(simulation.resolved.floor_plan)
    except InputError:
        return layout
    legend = {mark: legend_entry(symbol) for mark, symbol in drawing.legend}
    others = {name: value for name, value in layout.items() if name not in ("file", "legend")}
    return {"picture": drawing.picture + "\n", "legend": legend, **others}


class _Dumper(yaml.SafeDumper):
    """Writes texts of several lines as they are."""


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = "|" if "\n" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style)


_Dumper.add_representer(str, _text)
