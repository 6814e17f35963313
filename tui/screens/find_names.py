"""What a scenario gives names or numbers: locations, doors and lifts, orders, their lines, SKUs.

packing, door 2, lifts, block 1, closing 3, order A-17, line 12, sku B4
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from automaton.engine.state import NIL, Array
from automaton.errors import InputError, nearest
from automaton.scenario.orders import line_texts, listed_lines
from automaton.world.gate_cells import cells_of, gates_of
from tui.playback.panel_view import View
from tui.widgets.pod_facts import makes_trips

GATES: Final = re.compile(r"(door|lift|block|closing)(?:s| (\d{1,9}))")
Places = tuple[tuple[int, ...], tuple[int, ...]]  # robots, or else cells
NOTHING: Final = ((), ())


def named_places(words: str, view: View) -> Places | None:
    """Robots, or cells, of what these words name; None: they name nothing. Raises InputError."""
    location = _location(words, view)
    if location:
        return (), location
    if gate := GATES.fullmatch(words):
        return (), _gates(gate[1], gate[2], view)
    if makes_trips(view):
        kind, _, name = words.partition(" ")
        if kind in ("order", "line", "sku") and name:
            lines = _lines(kind, name, view)
            return places_of_pods(np.unique(_pods_of_lines(lines, view)).tolist(), view)
    return None


def places_of_pods(pods: Iterable[int], view: View) -> Places:
    """Who carries them or, if no robot does, where they stand."""
    snapshot = view.snapshot
    slots = {pod: int(snapshot.pods.slot[pod]) for pod in pods if pod != NIL}
    carried = [pod for pod, slot in slots.items() if slot == NIL]
    robots = {int(snapshot.orders.reserved_by[snapshot.pods.trip[pod]]) for pod in carried}
    if robots:
        return tuple(sorted(robots)), ()
    return (), tuple(int(snapshot.slots.cell[slot]) for slot in slots.values())


def _location(words: str, view: View) -> tuple[int, ...]:
    locations = view.run.resolved.scenario.locations
    assert not isinstance(locations, str), "its file has been read"
    cells = (cell for name, cell in locations.items() if name.lower() == words)
    return tuple(view.floor_plan.cell(*cell) for cell in cells)


def _gates(kind: str, number: str | None, view: View) -> tuple[int, ...]:
    """The cells of one of the gates of a kind, or of all."""
    floor = view.run.resolved.scenario.floor
    gates = [gate for gate in gates_of(floor) if gate.name.startswith(kind)]
    if number is not None:
        there = f"{kind}s are numbered from 1 to {len(gates)}" if gates else f"there are no {kind}s"
        chosen = [gate for gate in gates if gate.name == f"{kind} {int(number)}"]
        if not chosen:
            raise InputError(f"there is no {kind} {int(number)}; {there}")
        gates = chosen
    return tuple(cell for gate in gates for cell in cells_of(gate, view.floor_plan))


def _lines(kind: str, name: str, view: View) -> Array:
    """(k,) the lines of an order or of a SKU, or one of them. Raises InputError."""
    of_order = view.snapshot.lines.order
    listed = listed_lines(view.run.resolved.scenario.orders)
    texts: Sequence[str] = ()
    if kind != "line" and listed:
        places, texts = line_texts(listed, kind)
        named = [at for at, text in enumerate(texts) if text.lower() == name]
        if named:
            return np.flatnonzero(np.isin(places, named))
    count = {"line": len(of_order), "order": int(of_order.max()) + 1, "sku": 0}[kind]
    if not name.isdecimal() or int(name) >= count:
        numbered = f"{kind}s are numbered from 0 to {count - 1}" if count else "no line names it"
        raise InputError(f"there is no {kind} {name}{nearest(name, texts) or f'; {numbered}'}")
    if kind == "line":
        return np.array([int(name)])
    return np.flatnonzero(of_order == int(name))


def _pods_of_lines(lines: Array, view: View) -> Array:
    """(k,) the pod of each line, as far as it is known; of a SKU all pods that hold it."""
    table, pods = view.snapshot.lines, view.snapshot.pods
    pod = np.where(table.pod[lines] == NIL, table.taken_from[lines], table.pod[lines])
    open_skus = np.unique(table.sku[lines[pod == NIL]])
    held = [pods.sku_pod[pods.sku_first[sku] : pods.sku_first[sku + 1]] for sku in open_skus]
    return np.concatenate([pod[pod != NIL], *held])
