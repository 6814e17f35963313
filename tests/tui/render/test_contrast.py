"""Contrast of all that the map draws: text 4.5, signs 3 (WCAG 2.2), at every depth in both themes.

Of 16 colours each terminal has its own; these are xterm's. There robots and their numbers count as
signs: only five of the 16 have a contrast of 4.5 with white, and robots have eight states.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import pytest
from render_scenes import ALL, DRAWN, composed, drawn, make_scene
from zone_pictures import two_zones

from automaton.engine.observation import CAUSE_NO_ORDER
from automaton.engine.state import ACTION_CHARGE, BATTERY_FULL, GOAL_CHARGE, STATUS_FAILED
from automaton.floor.traffic_zones import traffic_zones_of
from automaton.scenario.changing_floor import Street
from automaton.scenario.streets import streets_on
from tui.render import styles
from tui.render.drawn_robots import BODY_COLOURS, DRAW_CLASS
from tui.render.scene import Scene
from tui.render.styles import COLOUR_TABLE, GLYPHS, STYLE_COUNT, UNICODE, Depth, Look, contrast

COLOURED = [
    Look(depth, theme)
    for depth in (Depth.SIXTEEN, Depth.INDEXED, Depth.TRUE)
    for theme in ("dark", "light")
]
every_look = pytest.mark.parametrize(
    "look", COLOURED, ids=lambda look: f"{look.depth.name}-{look.theme}"
)
MARKS = [colour for colour in range(len(COLOUR_TABLE)) if colour not in styles.GROUNDS]
CHARGES = {"action": ACTION_CHARGE, "goal_type": GOAL_CHARGE}
STATES = (
    *({}, {"load": 1}, {"cause": 1}, {"wait_cycle_ticks": 9}, {"charge": BATTERY_FULL // 10}),
    *({"charge": 1, "load": 1}, CHARGES, {"status": STATUS_FAILED}, {"parked": 1}),
    {"cause": CAUSE_NO_ORDER},
)
PICTURE = """
................
.$s$.###.d.+.c.b
................
................
................
"""
LADDER = (*DRAWN, "3x1.5", "1.5x0.75", *ALL)
LAYERS = (
    *("", "visits", "flow", "traffic-zones", "service-zones", "explored", "predicted"),
    *("streets", "street-waits"),
)


def least(look: Look, fg: int, character: str) -> float:
    robot_of_16 = look.depth == Depth.SIXTEEN and fg in styles.ROBOT_COLOURS
    return 4.5 if character.isalnum() and not robot_of_16 else 3.0


@every_look
def test_what_stands_on_any_ground_is_seen(look: Look) -> None:
    for fg in MARKS:
        for bg in styles.BACKGROUNDS:
            text = fg in styles.WORD_COLOURS or bg == styles.COLOUR_VOID
            text = text or (fg in styles.ROBOT_COLOURS and look.depth != Depth.SIXTEEN)
            values = look.pair(styles.style(fg, bg))
            if fg != bg:
                names = COLOUR_TABLE[fg].name, COLOUR_TABLE[bg].name, values
                assert contrast(*values, look.depth) >= (4.5 if text else 3.0), names


@every_look
def test_on_the_plain_floor_no_colour_gives_way_to_black_or_white(look: Look) -> None:
    index = 3 - look.depth
    for fg in (colour for colour in MARKS if colour not in styles.BACKGROUNDS):
        own = COLOUR_TABLE[fg].dark if look.theme == "dark" else COLOUR_TABLE[fg].light
        value, _ = look.pair(styles.style(fg, styles.COLOUR_FLOOR))
        assert value == own[index], COLOUR_TABLE[fg].name


@every_look
def test_a_number_cut_out_of_a_robot_is_read(look: Look) -> None:
    for colour in styles.ROBOT_COLOURS:
        values = look.pair(styles.style(styles.COLOUR_FLOOR, colour))
        assert contrast(*values, look.depth) >= 4.5, COLOUR_TABLE[colour].name


@lru_cache
def scene_with(layer: str) -> Scene:
    """Robots in all states on cells of all levels of heat or of several zones, some of them chosen."""
    if layer == "service-zones":
        floor_plan, zoning = two_zones().floor.floor_plan, two_zones().snapshot.service_zones
    else:
        floor_plan, zoning = drawn(PICTURE), None
    if layer.startswith("street"):
        rows = [Street(row=y, west=2 * y, wait=y) for y in (1, 3, 4, 5)]
        floor_plan = streets_on(floor_plan, (*rows, Street(column=0, north="closed"))).floor()
    cells = np.flatnonzero(floor_plan.drivable.reshape(-1))
    robots = [
        {"cell": int(cell), "goal_cell": int(cell), **STATES[n % len(STATES)]}
        for n, cell in enumerate(cells[::2])
    ]
    robots += [{"cell": int(cells[0])}] * 2  # several in one cell
    heat = np.zeros(floor_plan.kind.size, np.int32)
    heat[cells] = np.arange(len(cells)) ** 2
    heat = np.minimum(heat, {"explored": 2, "street-waits": 8}.get(layer, heat.max()))
    flow = np.stack([heat, heat // 2, heat // 3, heat * 0], axis=1)
    zones = traffic_zones_of(floor_plan, "with-intersections") if zoning is None else None
    more = {"zoning": zoning, "zones": zones, "battery": True, "faults": True}
    scene = make_scene(floor_plan, *robots, heat=heat, flow=flow, layer=layer, **more)
    marked, route = np.array([3, 4], np.int32), cells[-4:].astype(np.int32)
    return scene.with_(marked=marked, selected=5, route=route, cursor=int(cells[-6]))


def drawn_styles(layer: str, zoom: str) -> Iterator[tuple[int, int, str]]:
    """Foreground, background and character of all that is in a picture and meant to be seen.

    A shade is seen without colours only, and not on the plain floor; of two halves of a character
    each is a pixel, and what pixels have between them is no border of a sign.
    """
    codes, _ = composed(scene_with(layer), zoom)
    for code in np.unique(codes).tolist():
        (fg, bg), character = (
            divmod(code >> 16, len(COLOUR_TABLE)),
            UNICODE.characters[code & GLYPHS],
        )
        halves = character in "▀▄█" and (fg in styles.GROUNDS or bg not in styles.BACKGROUNDS)
        shade = fg in styles.GROUNDS and fg != styles.COLOUR_FLOOR != bg
        if fg != bg and not halves and not shade and character not in " \u2800":
            yield fg, bg, character


@pytest.mark.parametrize("layer", LAYERS)
def test_all_that_a_picture_shows_is_legible_in_every_theme_at_every_depth(layer: str) -> None:
    for zoom in LADDER:
        for fg, bg, character in drawn_styles(layer, zoom):
            for look in COLOURED:
                values = look.pair(styles.style(fg, bg))
                said = (
                    zoom,
                    look.depth.name,
                    look.theme,
                    COLOUR_TABLE[fg].name,
                    COLOUR_TABLE[bg].name,
                )
                clear = contrast(*values, look.depth)
                assert clear >= least(look, fg, character), (*said, character, round(clear, 2))


def test_there_are_styles_of_every_kind_in_the_pictures_that_are_measured() -> None:
    pictures = [drawn_styles(layer, zoom) for layer in LAYERS for zoom in LADDER]
    seen = {styles.style(fg, bg) for picture in pictures for fg, bg, _ in picture}
    foregrounds, backgrounds = zip(*(divmod(one, len(COLOUR_TABLE)) for one in seen), strict=True)
    states = {*BODY_COLOURS[:DRAW_CLASS].tolist()}
    assert states <= {*foregrounds, *backgrounds}
    assert {styles.COLOUR_HEAT_1, styles.COLOUR_HEAT_8, styles.COLOUR_ZONE_0} <= {*backgrounds}
    assert len(seen) > 110 and max(seen) < STYLE_COUNT
