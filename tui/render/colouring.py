"""Robots coloured by something else than their state: order, type, service zone, battery, wait.

Shapes go on to show the state, and robots in wait cycles or down keep the colour of that. Kinds have
eight colours in turn, amounts five that grow brighter (darker in the light theme).
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.drawings.looks import STATE_COLOURS
from automaton.engine.observation import is_waiting, waited_ticks
from automaton.engine.robot_states import BATTERY_FULL
from automaton.engine.state import NIL
from tui.render import styles
from tui.render.glyphs import Entries, code
from tui.render.scene import Scene
from tui.render.styles import style

COLOURINGS: Final = {  # by name, and what it is called in the palette and in messages
    "state": "what they do",
    "order": "the order they work on",
    "type": "their type",
    "zone": "their service zone",
    "battery": "the charge of their battery",
    "waiting": "how long they have waited",
}
WAITED: Final = (1, 10, 50, 200)  # ticks from which on levels 1 to 4 of a wait begin
CLASS_COUNT: Final = len(styles.CLASSES)
LEVEL_COUNT: Final = len(styles.LEVELS)
# Rows of tui.render.robot_marks.BODY_COLOURS behind those of the states.
DRAW_CLASS: Final = len(STATE_COLOURS)
DRAW_LEVEL: Final = DRAW_CLASS + CLASS_COUNT
DRAW_ALARM: Final = DRAW_LEVEL + LEVEL_COUNT  # in a wait cycle, or down
OTHER_COLOURS: Final = (*styles.CLASSES, *styles.LEVELS, styles.COLOUR_FAULT)


def is_possible(scene: Scene, colouring: str) -> bool:
    """Whether the robots of a floor differ in it."""
    if colouring == "type":
        return bool(scene.floor.type_names)
    if colouring == "zone":
        return scene.service_zones is not None
    return colouring != "battery" or scene.floor.battery


def coloured(scene: Scene, state: NDArray[np.uint8], rest: int, alarm: int) -> NDArray[np.uint8]:
    """(n,) what gives each robot its colour; `rest`: the state of one without, `alarm`: that stays."""
    if scene.colouring == "state" or not is_possible(scene, scene.colouring):
        return state
    values = _values(scene)
    first = DRAW_LEVEL if scene.colouring in ("battery", "waiting") else DRAW_CLASS
    drawn = np.where(values == NIL, rest, first + values).astype(np.uint8)
    drawn[state == alarm] = DRAW_ALARM
    return drawn


def _values(scene: Scene) -> NDArray[np.int64]:
    """(n,) the colour of each robot among those of its kind, or NIL."""
    assert scene.snapshot is not None
    fleet = scene.snapshot.robots
    if scene.colouring == "battery":
        return np.clip(
            fleet.charge.astype(np.int64) * LEVEL_COUNT // BATTERY_FULL, 0, LEVEL_COUNT - 1
        )
    if scene.colouring == "waiting":
        waited = waited_ticks(fleet.cause, fleet.since, scene.snapshot.tick)
        waited = np.where(is_waiting(fleet.cause), waited, 0)
        return np.searchsorted(WAITED, waited, "right").astype(np.int64)
    if scene.colouring == "type":  # a robot with a load has another row of durations
        return (fleet.type.astype(np.int64) % len(scene.floor.type_names)) % CLASS_COUNT
    number = fleet.order if scene.colouring == "order" else fleet.service_zone
    return np.where(number == NIL, NIL, number % CLASS_COUNT).astype(np.int64)


def colour_entries(scene: Scene, sign: int) -> Entries:
    """What the colours mean, for the legend; each is shown with this glyph."""

    def shown(colours: range) -> tuple[int, ...]:
        return tuple(int(code(style(one, styles.COLOUR_FLOOR), sign)) for one in colours)

    if scene.colouring in ("order", "zone"):
        half = CLASS_COUNT // 2
        none = shown(range(styles.COLOUR_PARKED, styles.COLOUR_PARKED + 1))
        return [
            (shown(styles.CLASSES[:half]), f"by {scene.colouring}: {CLASS_COUNT} colours in turn,"),
            (shown(styles.CLASSES[half:]), "those of one number always the same"),
            (none, f"no {scene.colouring}"),
        ]
    if scene.colouring == "type":
        names = [*enumerate(scene.floor.type_names)]
        return [(shown(styles.CLASSES[n % CLASS_COUNT :][:1]), f"type {name}") for n, name in names]
    return [(shown(styles.LEVELS[n : n + 1]), words) for n, words in enumerate(_level_words(scene))]


def _level_words(scene: Scene) -> list[str]:
    """What each of the levels means."""
    if scene.colouring == "battery":
        step = 100 // LEVEL_COUNT
        return [f"battery {step * n} to {step * (n + 1)} %" for n in range(LEVEL_COUNT)]
    ends = [f"{begin} to {end - 1}" for begin, end in pairwise(WAITED)]
    waited = [*ends, f"{WAITED[-1]} or more"]
    return ["does not wait", *(f"has waited {ticks} ticks" for ticks in waited)]
