"""Streets on the map: arrows where one direction is cheaper, other heads where the way back is closed."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from render_scenes import ALL, DRAWN, at, camera_at, drawn, fg, make_scene, open_floor, text
from viewer_harness import viewing

from automaton.commands import main
from automaton.drawings.street_arrows import ONE_WAY_SIGNS, WAY_SIGNS, arrows_of, wait_steps
from automaton.floor.floor_plan import FloorPlan
from automaton.pytest_plugin import GridSnapshot
from automaton.scenario.changing_floor import Street, StreetPlan
from automaton.scenario.streets import Streets, StreetWeights, streets_on
from automaton.world.resolve import resolve
from tui.layers.streets import WAIT_LEVELS, StreetWaits, arrow_codes
from tui.playback.run_source import live
from tui.render import styles
from tui.render.camera import (
    ZOOM_ENLARGED,
    ZOOM_ONE_TO_ONE,
    ZOOM_ROW_AND_HALF,
    Camera,
    shown_rectangle,
)
from tui.render.compose import compose
from tui.render.layer import scale_line
from tui.render.scene import Scene
from tui.render.styles import ASCII, UNICODE, Depth, GlyphSet, Look
from tui.widgets.legend_panel import legend

RING = "......\n.####.\n......\n.####.\n......"
(SOFT, _), (HEADS, _), DOT = WAY_SIGNS, ONE_WAY_SIGNS, "."
STREETS = (
    Street(row=0, east=0.5, west=2),
    Street(row=4, east="closed"),
    Street(column=0, rows=(1, 3), north=0.5),
    Street(column=5, south=0.25, north=8),
    Street(at=(2, 2), wait=2),
    Street(at=(3, 2), wait=0),
)
CRISSCROSS = StreetPlan(preset="crisscross")


def floor_of(picture: str, streets: Streets = STREETS) -> FloorPlan:
    return streets_on(drawn(picture), streets).floor()


def picture(scene: Scene, zoom: str = "1x1", glyphs: GlyphSet = UNICODE) -> list[str]:
    camera = camera_at(scene.floor.floor_plan, zoom)
    return text(compose(scene, camera, glyphs), glyphs).split("\n")


def street_scene(floor_plan: FloorPlan, layer: str = "streets") -> Scene:
    return make_scene(floor_plan, layer=layer, heat=WAIT_LEVELS[wait_steps(floor_plan)])


def test_a_cell_shows_its_cheaper_direction_and_another_head_where_the_way_back_is_closed() -> None:
    """The last cell of a street shows nothing: no move of it is cheaper than the one back."""
    scene = street_scene(floor_of(RING))
    assert picture(scene) == ["⇢⇢⇢⇢⇢⇣", "⇡░░░░⇣", "⇡....⇣", "⇡░░░░⇣", ".↞↞↞↞↞"]
    assert picture(scene, glyphs=ASCII) == ["eeeees", "n%%%%s", "n....s", "n%%%%s", ".WWWWW"]
    assert not set(ONE_WAY_SIGNS[1]) & {ASCII.characters[glyph] for glyph in ASCII.robot}


@pytest.mark.parametrize("height", range(1, 7))
def test_a_floor_of_any_height_shows_its_streets_at_every_zoom(height: int) -> None:
    """A last character may extend beyond the last cell."""
    floor_plan = streets_on(open_floor(5, height), (Street(row=0, east=0.5, west=2),)).floor()
    for step in (ZOOM_ONE_TO_ONE, ZOOM_ENLARGED, ZOOM_ROW_AND_HALF):
        rows = picture(street_scene(floor_plan), step.name)
        if step.name in ("1x1", "1.5x0.75"):
            assert "⇢" in rows[0] and "⇢" not in "".join(rows[1:])


def test_weights_and_closed_moves_differ_in_shape_not_in_colour_alone() -> None:
    """The same floor, once with weights of 10,000 against the streets, once with these moves closed."""
    floors = [
        floor_of(RING, (Street(row=0, west=against), Street(column=5, north=against)))
        for against in (10_000, "closed")
    ]
    for glyphs, signs in ((UNICODE, ("⇢⇣", "↠↡")), (ASCII, ("es", "ES"))):
        pictures = ["".join(picture(street_scene(one), glyphs=glyphs)) for one in floors]
        for shown, own, other in zip(pictures, signs, signs[::-1], strict=True):
            assert set(own) <= set(shown) and not set(other) & set(shown)


def test_crossing_streets_of_equal_strength_are_shown_in_turn() -> None:
    scene = street_scene(floor_of("....\n" * 3, CRISSCROSS))
    assert picture(scene) == ["⇢⇣⇢⇣", "⇡⇠⇡⇠", "⇢⇢⇢."]


@pytest.mark.parametrize("factor", [1.24, 1.25, 2, 3, 5, 8, 100])
def test_five_colours_say_how_much_more_the_way_back_costs(factor: float) -> None:
    floor_plan = floor_of("...", (Street(row=0, west=factor),))
    code = at(street_scene(floor_plan), "1x1", floor_plan.cell(0, 0))
    step = sum(factor >= begin for begin in (1.25, 2, 3, 5, 8)) - 1
    assert (UNICODE.characters[code & 0xFFFF] == "⇢") == (step >= 0)
    if step >= 0:
        assert fg(code) == styles.COLOUR_LEVEL_0 + step


@pytest.mark.parametrize("theme", ["dark", "light"])
@pytest.mark.parametrize("depth", [Depth.SIXTEEN, Depth.INDEXED, Depth.TRUE])
def test_the_five_colours_differ_in_both_themes(theme: styles.Theme, depth: Depth) -> None:
    look = Look(depth, theme)
    levels = range(styles.COLOUR_LEVEL_0, styles.COLOUR_LEVEL_4 + 1)
    assert len({look.pair(styles.style(level, styles.COLOUR_FLOOR)) for level in levels}) == 5


@pytest.mark.parametrize("zoom", [*DRAWN, *ALL])
def test_each_zoom_shows_the_streets_and_robots_on_them(zoom: str) -> None:
    weights = StreetWeights(open_floor(8, 8))
    floor_plan = weights.floor_plan
    for cell in np.flatnonzero(floor_plan.drivable).tolist():
        weights.set_move(cell, 0, 0.25)
    robot = floor_plan.cell(4, 4)
    scene = make_scene(weights.floor(), {"cell": robot}, layer="streets")
    drawn_signs = "".join(picture(scene, zoom))
    assert "⇢" in drawn_signs and not set(drawn_signs) & set("⇣⇠⇡↠")
    assert UNICODE.characters[at(scene, zoom, robot) & 0xFFFF] != "⇢"


def test_zoomed_out_a_character_shows_the_mean_of_its_cells() -> None:
    """Left, all rows run east; in the middle, rows run east and west in turn; right, there are none."""
    weights = StreetWeights(open_floor(8, 4))
    for x, y in np.ndindex(6, 4):
        direction = 0 if x < 3 or y % 2 == 0 else 2
        weights.set_move(weights.floor_plan.cell(x, y), direction, 0.5)
    assert picture(street_scene(weights.floor()), "braille 1") == ["⇢⇢.."]
    closed = floor_of("........\n" * 4, (Street(row=0, west="closed"),))
    assert picture(street_scene(closed), "braille 1") == ["↠↠↠↠"], "one row of four"
    assert fg(at(street_scene(closed), "braille 1", closed.cell(0, 0))) == styles.COLOUR_LEVEL_4
    turns = [Street(row=y, **{side: "closed"}) for y, side in enumerate(["west", "east"] * 2)]
    (shown,) = picture(street_scene(floor_of("........\n" * 4, turns)), "braille 1")
    assert shown[:3] == "↠↠↠", "they cancel out, and are closed all the same"


def test_storage_has_no_arrows() -> None:
    """No way leads through it."""
    floor_plan = floor_of("...\n.q.\n...", CRISSCROSS)
    pull = arrows_of(floor_plan).pull
    assert pull[floor_plan.cell(1, 0)].any() and not pull[floor_plan.cell(1, 1)].any()


@settings(max_examples=30)
@given(st.lists(st.integers(1, 1000), min_size=48, max_size=48), st.integers(0, 11))
def test_no_arrow_points_to_the_dearer_side(weights: list[int], shut: int) -> None:
    """On a floor of 4 x 3 cells with weights from 0.01 to 10; one move is closed."""
    streets = StreetWeights(open_floor(4, 3))
    floor_plan = streets.floor_plan
    cells = [floor_plan.cell(x, y) for y in range(3) for x in range(4)]
    for cell, four in zip(cells, np.reshape(weights, (12, 4)).tolist(), strict=True):
        for direction, weight in enumerate(four):
            streets.set_move(cell, direction, weight / 100)
    streets.set_move(cells[shut], 0, "closed")
    floor_plan = streets.floor()
    floor = street_scene(floor_plan).floor
    codes = arrow_codes(floor, shown_rectangle(floor_plan), 1, 1, UNICODE).reshape(-1)
    for cell, code in zip(cells, codes.tolist(), strict=True):
        sign = UNICODE.characters[code & 0xFFFF] if code else DOT
        if sign == DOT:
            continue
        direction = (SOFT + HEADS).index(sign) % 4
        beside = cell + floor_plan.offsets[direction]
        assert floor_plan.exits.flat[cell] >> direction & 1
        closed = not floor_plan.exits.flat[beside] >> (direction ^ 2) & 1
        assert closed == (sign in HEADS)
        back = floor_plan.move_weights[beside, direction ^ 2]
        assert closed or back >= 1.25 * floor_plan.move_weights[cell, direction]


def test_weights_of_waiting_are_heat_and_those_of_1_are_none() -> None:
    floor_plan = floor_of(RING)
    scene = street_scene(floor_plan, "street-waits")
    assert picture(scene, glyphs=styles.SHADED)[2] == "..+..."
    levels = WAIT_LEVELS[wait_steps(floor_plan)]
    assert [int(levels[floor_plan.cell(x, 2)]) for x in (1, 2, 3)] == [0, 5, 1]
    camera = camera_at(floor_plan, "1x1")
    words = [entry.meaning for entry in legend(scene, camera.zoom, UNICODE)[:2]]
    assert words == ["waiting counts 0 to 0.5", "waiting counts 2 to 3"]
    assert StreetWaits().value_words(5) == ["waiting counts 2 to 3"]


def test_the_legend_and_the_line_under_the_map_name_what_is_there() -> None:
    for streets, closed in ((STREETS, True), (CRISSCROSS, False)):
        scene = street_scene(floor_of(RING, streets))
        said = [
            entry.meaning for entry in legend(scene, camera_at(drawn(RING), "1x1").zoom, UNICODE)
        ]
        assert said[0] == "back costs 1.25 to 2 times"
        assert ("the move back is closed" in said) == closed
        assert ("closed" in scale_line(scene, UNICODE)) == closed


@pytest.mark.parametrize("size", [(24, 80), (60, 200)], ids=["80x24", "200x60"])
@pytest.mark.parametrize("glyphs", [UNICODE, ASCII], ids=["unicode", "ascii"])
def test_pictures(size: tuple[int, int], glyphs: GlyphSet, grid_snapshot: GridSnapshot) -> None:
    """A hall of shelves under crisscross, with an aisle that is closed one way: drawn, and in braille."""
    shelf = ".".join(["####"] * 12)
    hall = "\n".join([("." * 61), f".{shelf}."] * 12)
    one_way = Street(row=2, west="closed")
    weights = streets_on(drawn(hall), CRISSCROSS)
    floor_plan = streets_on(weights.floor(), (one_way,)).floor()
    floor_plan = floor_plan.with_weights(weights.moves, weights.waits)
    scene = street_scene(floor_plan)
    near, far = (Camera(floor_plan, *size) for _ in range(2))
    far.zoom = next(zoom for zoom in far.ladder if zoom.name == "braille 1")
    far.resize(6, 40)
    pictures = (text(compose(scene, camera, glyphs), glyphs) for camera in (near, far))
    grid_snapshot("\n\n".join(pictures))


def test_the_key_shows_streets_then_weights_of_waiting() -> None:
    data = {
        "name": "streets",
        "layout": {"picture": RING},
        "fleet": {"robots": 1, "start": [[0, 0]]},
        "orders": {"generator": "tours", "count": 9},
        "strategy": {"right_of_way": "pibt"},
        "streets": [{"row": 0, "east": 0.5}, {"at": [2, 2], "wait": 2}],
    }

    async def story() -> None:
        async with viewing(live(resolve(data), None)) as user:
            await user.at(1)
            for layer in ("streets", "street-waits", "streets"):
                await user.press("W")
                await user.until(lambda: user.session.scene().layer == layer)  # noqa: B023

    asyncio.run(story())


def test_run_and_cast_draw_the_layer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "streets.yaml"
    rows = "".join(f"    {row}\n" for row in RING.split("\n"))
    path.write_text(
        f"name: ring\nlayout:\n  picture: |\n{rows}fleet: {{robots: 1, start: [[1, 2]]}}\n"
        "orders: {generator: tours, count: 1}\n"
        "streets: [{row: 0, east: 0.5}, {row: 4, east: closed}]\n"
    )
    recording, picture = str(tmp_path / "run.rec"), tmp_path / "picture.txt"
    options = ["--picture", "--layer", "streets", "--record", recording]
    assert main(["run", str(path), *options]) == 0
    drawn_rows = capsys.readouterr().out.split("\n")
    assert drawn_rows[0] == "⇢⇢⇢⇢⇢." and drawn_rows[4] == ".↞↞↞↞↞"
    assert "⇢⇣⇠⇡ cheaper this way" in drawn_rows and "↠↡↞↟ the move back is closed" in drawn_rows
    options = ["--layer", "streets", "--zoom", "1x1", "--picture", str(picture)]
    assert main(["cast", recording, *options]) == 0
    shown = picture.read_text()
    assert "⇢⇢⇢⇢⇢." in shown and ".↞↞↞↞↞" in shown
    assert "⇢⇣⇠⇡ cheaper this way  ↠↡↞↟ the move back is closed" in shown
    assert main(["run", str(path), "--layer", "streets"]) == 2
    assert main(["run", str(path), "--picture", "--layer", "street"]) == 2
    assert "unknown layer 'street'" in capsys.readouterr().err
