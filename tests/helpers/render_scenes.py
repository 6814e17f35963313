"""Scenes for the tests of pictures: a floor, and robots that stand where a test wants them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from automaton.engine.facilities import Gates
from automaton.engine.state import BATTERY_FULL, NIL
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import DESTINATION, FLOOR, FloorPlan, make_floor_plan
from automaton.world.gates import NO_GATES
from automaton.world.resolve import resolve
from tui.render import styles
from tui.render.camera import Camera
from tui.render.compose import compose
from tui.render.scene import Scene, ShownFloor
from tui.render.styles import UNICODE, Codes, GlyphSet

NEAR = ["3x1", "2x1", "1x1"]  # steps of the ladder
DRAWN = ["4x2", "6x3", "8x4"]  # at which robots are drawn
ALL = [*NEAR, "half", "quadrants", "braille 1"]
FIELDS = {  # of a robot that stands still and does nothing
    **dict.fromkeys(("cell", "claim", "load", "order", "slot", "bay", "blocker"), NIL),
    "type": 0,
    **dict.fromkeys(("heading", "travel", "action", "parked", "cause", "wait_cycle_ticks"), 0),
    **{
        "goal_type": 0,
        "goal_cell": NIL,
        "charge": BATTERY_FULL,
        "charge_target": 0,
        "status": 0,
        "ticket": 0,
        "type": 0,
        "since": 0,
        "service_zone": NIL,
    },
}


def make_scene(
    floor_plan: FloorPlan, *robots: dict[str, int], headings: int = 4, **more: Any
) -> Scene:
    """A scene with robots as given, for instance {"cell": 12, "heading": 1}."""
    fleet = SimpleNamespace(
        **{
            name: np.array([robot.get(name, rest) for robot in robots], np.int32)
            for name, rest in FIELDS.items()
        }
    )
    cells = floor_plan.slots
    endless = (floor_plan.kind.reshape(-1)[cells] == DESTINATION).astype(np.uint8)
    loaded = floor_plan.loads.reshape(-1)[cells] != 0
    content = np.where(loaded, np.cumsum(loaded) - 1, NIL)
    left = more.pop("left", {})  # cell: the load that lies there
    orders = int(loaded.sum())
    snapshot = SimpleNamespace(
        tick=1,
        robots=fleet,
        slots=SimpleNamespace(
            cell=np.array([*cells, *left], np.int32),
            unbounded=np.array([*endless, *[0] * len(left)], np.uint8),
            content=np.array([*content, *left.values()]),
            reserved_by=np.full(len(cells) + len(left), NIL),
        ),
        pods=SimpleNamespace(slot=np.zeros(0, np.int32)),
        gates=Gates.sized(NO_GATES),
        orders=SimpleNamespace(
            current_slot=np.flatnonzero(loaded),
            target=np.full(orders, len(cells) - 1),
            reserved_by=np.full(orders, NIL),
            state=np.zeros(orders, np.uint8),
        ),
        heat=more.pop("heat", None),
        flow=more.pop("flow", None),
        service_zones=more.pop("zoning", None),
    )
    kinds = {name: more.pop(name, False) for name in ("battery", "faults")}
    floor = ShownFloor(floor_plan, cells, (headings,), more.pop("zones", None), **kinds)
    return Scene(floor, snapshot, **more)  # type: ignore[arg-type]


def drawn(picture: str) -> FloorPlan:
    return draw_floor(picture)


def shipped(name: str) -> FloorPlan:
    return resolve(name).floor_plan


def camera_at(floor_plan: FloorPlan, zoom: str, rows: int = 0, columns: int = 0) -> Camera:
    """A camera on that step of the ladder, of the size of the floor unless said."""
    camera = Camera(floor_plan, rows or 1, columns or 1)
    camera.zoom = next(step for step in camera.ladder if step.name == zoom)
    size = camera.size()
    camera.resize(rows or size[0], columns or size[1])
    return camera


def signs(codes: Codes, glyphs: GlyphSet = UNICODE) -> np.ndarray:
    """The characters of a picture."""
    return np.array(list(glyphs.characters))[codes & 0xFFFF]


def text(codes: Codes, glyphs: GlyphSet = UNICODE) -> str:
    return "\n".join("".join(row).rstrip() for row in signs(codes, glyphs))


def fg(code: int) -> int:
    return (int(code) >> 16) // len(styles.COLOUR_TABLE)


def bg(code: int) -> int:
    return (int(code) >> 16) % len(styles.COLOUR_TABLE)


def body(code: int) -> int:
    """The colour of a robot: behind its sign, or of its block or dots."""
    return bg(code) if fg(code) in styles.GROUNDS else fg(code)


def open_floor(width: int, height: int) -> FloorPlan:
    kind = np.zeros((height + 2, width + 2), np.uint8)
    kind[1:-1, 1:-1] = FLOOR
    return make_floor_plan(kind, np.full_like(kind, 15))


def crossing() -> Scene:
    """Three robots: one parked in its parking bay, one with a load, one that faces west."""
    floor_plan = shipped("crossing")
    return make_scene(
        floor_plan,
        {"bay": floor_plan.cell(-1, 0), "parked": 1},
        {"cell": floor_plan.cell(3, 0), "load": 4},
        {"cell": floor_plan.cell(5, 5), "heading": 2},
    )


def mini() -> Scene:
    """Two robots on rails: one has come north with a load, one has turned on its turntable."""
    floor_plan = shipped("tabletop-mini")
    return make_scene(
        floor_plan,
        {"cell": floor_plan.cell(2, 3), "heading": 1, "travel": 3, "load": 0},
        {"cell": floor_plan.cell(4, 0), "heading": 1, "travel": 0},
        headings=2,
    )


def composed(scene: Scene, zoom: str, rows: int = 0, columns: int = 0) -> tuple[Codes, Camera]:
    camera = camera_at(scene.floor.floor_plan, zoom, rows, columns)
    return compose(scene, camera, UNICODE), camera


def at(scene: Scene, zoom: str, cell: int) -> int:
    """The code in the first character of a cell."""
    codes, camera = composed(scene, zoom)
    place = camera.place_of(cell)
    assert place is not None
    return int(codes[place])
