"""The columns of the table of robots: what they sort by and what they say."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from automaton.engine.observation import CAUSE_REDUCED_SPEED, CAUSES, is_waiting, waited_ticks
from automaton.engine.robot_states import (
    BATTERY_FULL,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_REMOVED,
    STATUS_TOWED,
    is_queueing,
)
from automaton.engine.state import ACTION_NAMES, ACTION_SERVE, NIL, Array
from automaton.history.explanation import carries_pods
from automaton.history.snapshot import Fleet
from automaton.units import percent
from tui.playback.panel_view import View
from tui.widgets.charge_facts import has_batteries
from tui.widgets.robot_type_facts import has_types, type_of
from tui.widgets.service_zone_facts import partition_of, queued

DOWN_WORDS: Final = {
    STATUS_DEPLETED: "empty",
    STATUS_FAILED: "broken",
    STATUS_TOWED: "towed",
    STATUS_REMOVED: "towed",
}
ACTION_WORDS: Final = ("idle", "drives", "turns", "picks", "drops", "tries", "waits", "charges")
SERVED_WORD: Final = "served"
PARKED_WORD: Final = "parked"
SHORT_CAUSES: Final = {
    "driving ahead": "driving",
    "following conflict": "following",
    "illegal decision": "illegal",
    "no drop-off slot": "no slot",
    "none": "",
    "reduced speed": "slow",
    "station break": "break",
    "station queue": "for station",
    "vertex conflict": "conflict",
    "working ahead": "working",
}


class Column(NamedTuple):
    """One column; `keys` and `text` are by robot."""

    title: str
    width: int  # without the sign of the order
    keys: Callable[[View], Array]  # (n,) what the table is sorted by
    text: Callable[[View, int], str]
    greatest_first: bool  # at the first click
    right: bool = True
    there: Callable[[View], bool] = lambda view: True  # whether it has anything to say


def doing(fleet: Fleet, robot: int) -> str:
    """What a robot does, in a word."""
    if int(fleet.status[robot]) in DOWN_WORDS:
        return DOWN_WORDS[int(fleet.status[robot])]
    if fleet.parked[robot]:
        return PARKED_WORD
    if is_queueing(fleet)[robot]:
        return "queues"
    if is_waiting(fleet.cause[robot]):
        return "waits"
    if fleet.action[robot] == ACTION_SERVE:
        return SERVED_WORD
    return ACTION_WORDS[min(int(fleet.action[robot]), len(ACTION_WORDS) - 1)]


def _doing_keys(view: View) -> Array:
    """In the order of ACTION_WORDS: idle, at work, waiting; then parked, last down and towed."""
    fleet = view.snapshot.robots
    keys = np.minimum(fleet.action, len(ACTION_WORDS) - 1).astype(np.int64)
    keys[fleet.action == ACTION_SERVE] = len(ACTION_WORDS)
    keys[is_waiting(fleet.cause)] = ACTION_NAMES.index("wait")
    keys[is_queueing(fleet)] = len(ACTION_WORDS) + 1
    keys[fleet.parked != 0] = len(ACTION_WORDS) + 2
    out = fleet.status >= STATUS_DEPLETED
    keys[out] = len(ACTION_WORDS) + 1 + fleet.status[out]
    return keys


def _waited(view: View) -> Array:
    fleet = view.snapshot.robots
    waited = waited_ticks(fleet.cause, fleet.since, view.snapshot.tick)
    ticks: Array = np.where(is_waiting(fleet.cause), waited, 0)
    return ticks


def _cause(view: View, robot: int) -> str:
    name = CAUSES[int(view.snapshot.robots.cause[robot])].name
    return SHORT_CAUSES.get(name, name)


def _load(view: View, robot: int) -> str:
    """Its load, or its pod."""
    load = int(view.snapshot.robots.load[robot])
    if load != NIL and carries_pods(view.snapshot):
        return view.snapshot.pod_names[int(view.snapshot.trips.pod[load])]
    return _or_blank(load, NIL)


def _cell(view: View, robot: int) -> str:
    fleet = view.snapshot.robots
    if fleet.cell[robot] != NIL:
        return ",".join(map(str, view.floor_plan.xy(int(fleet.cell[robot]))))
    return "in bay" if fleet.bay[robot] != NIL else "off"


def _queue(view: View, robot: int) -> list[int]:
    """The orders that wait in the zones that a robot serves."""
    if partition_of(view) is None:
        return []
    served = np.flatnonzero(view.snapshot.service_zones.server == robot).tolist()
    return queued(view, served)


def _or_blank(value: int, absent: int) -> str:
    return "" if value == absent else f"{value:,}"


ROBOT_TABLE_COLUMNS: Final = (
    Column("#", 1, lambda v: np.arange(len(v.snapshot.robots)), lambda v, r: str(r), False),
    Column(
        "type",
        8,
        lambda v: v.run.resolved.fleet.type_of,
        lambda v, r: kind.name[:8] if (kind := type_of(v, r)) else "",
        False,
        right=False,
        there=has_types,
    ),
    Column("doing", 6, _doing_keys, lambda v, r: doing(v.snapshot.robots, r), False, right=False),
    Column("waits", 5, _waited, lambda v, r: _or_blank(int(_waited_of(v, r)), 0), True),
    Column("cause", 12, lambda v: v.snapshot.robots.cause, _cause, True, right=False),
    Column(
        "battery",
        7,
        lambda v: v.snapshot.robots.charge,
        lambda v, r: percent(int(v.snapshot.robots.charge[r]) / BATTERY_FULL),
        False,
        there=has_batteries,
    ),
    Column(
        "load",
        5,
        lambda v: v.snapshot.robots.load,
        _load,
        True,
    ),
    Column(
        "order",
        5,
        lambda v: v.snapshot.robots.order,
        lambda v, r: _or_blank(int(v.snapshot.robots.order[r]), NIL),
        True,
    ),
    Column(
        "ahead",
        5,
        lambda v: v.snapshot.robots.order_queue_length,
        lambda v, r: _or_blank(int(v.snapshot.robots.order_queue_length[r]), 0),
        True,
        there=lambda v: bool(v.snapshot.robots.order_queue_length.any()),
    ),
    Column(
        "zone",
        4,
        lambda v: v.snapshot.robots.service_zone,
        lambda v, r: _or_blank(int(v.snapshot.robots.service_zone[r]) + 1, 0),
        False,
        there=lambda v: partition_of(v) is not None,
    ),
    Column(
        "queue",
        5,
        lambda v: np.array([len(_queue(v, r)) for r in range(len(v.snapshot.robots))]),
        lambda v, r: _or_blank(len(_queue(v, r)), 0),
        True,
        there=lambda v: partition_of(v) is not None,
    ),
    Column("cell", 7, lambda v: v.snapshot.robots.cell, _cell, False),
    Column(
        "slowed",
        6,
        lambda v: v.snapshot.robots.lost[:, CAUSE_REDUCED_SPEED],
        lambda v, r: _or_blank(int(v.snapshot.robots.lost[r, CAUSE_REDUCED_SPEED]), 0),
        True,
    ),
    Column(
        "active",
        6,
        lambda v: v.playback.figures[v.side].active,
        lambda v, r: percent(float(v.playback.figures[v.side].active[r]), 0),
        True,
    ),
    Column(
        "ops",
        6,
        lambda v: v.playback.figures[v.side].operations,
        lambda v, r: f"{int(v.playback.figures[v.side].operations[r]):,}",
        True,
    ),
)


def _waited_of(view: View, robot: int) -> int:
    fleet = view.snapshot.robots
    if not is_waiting(fleet.cause[robot]):
        return 0
    return int(waited_ticks(fleet.cause[robot], fleet.since[robot], view.snapshot.tick))


def ordered(view: View, column: Column, greatest_first: bool) -> Array:
    """(n,) robots in the order of a column; ties by number."""
    keys = column.keys(view).astype(np.float64)  # unsigned ones have no negatives
    order: Array = np.argsort(-keys if greatest_first else keys, kind="stable")
    return order
