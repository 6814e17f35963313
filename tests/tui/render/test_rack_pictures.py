"""Racks and docks on the screen: shapes of their own, near and far, and what they hold in words."""

from __future__ import annotations

import numpy as np
import pytest
from panel_harness import moment, of_cell, shown
from render_scenes import camera_at, composed, drawn, fg, make_scene, signs, text

from automaton.engine.state import NIL, ORDER_DELIVERED, ORDER_WAITING
from automaton.floor.floor_plan import DOCK, RACK
from layouts.racks import Racks
from tui.render import styles
from tui.render.compose import compose
from tui.render.styles import ASCII, UNICODE
from tui.widgets.inspector import Inspector
from tui.widgets.legend_panel import legend
from tui.widgets.metrics_panel import Figures
from tui.widgets.robot_table import Robots
from tui.widgets.status import describe

SMALL = (
    *("layout.rows=9", "layout.columns=16", "layout.block=3", "layout.last_row=0"),
    *("orders.count=30", "stop.max_duration=400", "measure.warm_up=20", "fleet.robots=3"),
)


def small():
    return make_scene(Racks(rows=6, columns=12, block=3, last_row=0).build())


def running(tick):
    return moment(tick, "warehouse-100", *SMALL)


def test_racks_and_docks_have_shapes_of_their_own():
    scene = small()
    codes, camera = composed(scene, "1x1")
    assert text(codes).split("\n") == [
        "..........",
        ".⊏.◫◫◫.◫◫◫",
        ".⊏.◫◫◫.◫◫◫",
        "..........",
    ]
    assert text(compose(scene, camera, ASCII), ASCII).split("\n")[1] == ".[.HHH.HHH"


def test_floor_for_any_number_is_marked_only_among_other_floor():
    codes, _ = composed(make_scene(drawn("~~~")), "1x1")
    assert text(codes) == "..."
    codes, _ = composed(make_scene(drawn("~=.")), "1x1")
    assert text(codes) == "~⇄."


@pytest.mark.parametrize("zoom", ["half", "braille 1", "braille 2"])
def test_from_afar_docks_are_stations_and_racks_are_faint(zoom):
    scene = make_scene(Racks(rows=30, columns=60, block=13, last_row=0).build())
    codes, _ = composed(scene, zoom)
    foregrounds = {fg(code) for code in codes.reshape(-1) if signs(np.array([code]))[0] not in " ⠀"}
    assert (
        {styles.COLOUR_DOCK, styles.COLOUR_FAR_SHELF}
        <= foregrounds
        <= {styles.COLOUR_DOCK, styles.COLOUR_FAR_SHELF, styles.COLOUR_WALL}
    )


@pytest.mark.parametrize("zoom", ["1x1", "half", "braille 1"])
def test_the_legend_names_racks_and_docks(zoom):
    scene = small()
    entries = legend(scene, camera_at(scene.floor.floor_plan, zoom).zoom, UNICODE)
    words = [entry.meaning for entry in entries]
    assert {"rack", "dock"} < set(words) and not {"shelf", "empty shelf"} & set(words)
    assert len({entry.signs for entry in entries if entry.meaning in ("rack", "dock")}) == 2


def test_stations_are_seen_near_and_far_and_named():
    scene = make_scene(drawn("t.." + "." * 37 + "t"))
    for zoom, sign in (("3x1", "⌂"), ("1x1", "⌂"), ("half", "⠛"), ("braille 1", "⠁")):
        codes, camera = composed(scene, zoom)
        assert (text(codes)[0], fg(codes[0, 0])) == (sign, styles.COLOUR_STATION), zoom
        entries = {entry.meaning: entry for entry in legend(scene, camera.zoom, UNICODE)}
        assert signs(np.array(entries["station"].signs)).tolist()[0] in (sign, "⣿")
    codes, camera = composed(scene, "1x1")
    assert text(compose(scene, camera, ASCII), ASCII)[:3] == "t.."


def places(view):
    """A dock at which loads wait, a rack that holds loads, as (x, y) with their numbers."""
    orders, slots = view.snapshot.orders, view.snapshot.slots
    kind = view.floor_plan.kind.reshape(-1)[slots.cell]
    waiting = np.bincount(orders.current_slot[orders.state == ORDER_WAITING], minlength=len(kind))
    arrived = np.bincount(orders.target[orders.state == ORDER_DELIVERED], minlength=len(kind))
    dock = int(np.flatnonzero((kind == DOCK) & (waiting > 0))[0])
    rack = int(np.flatnonzero((kind == RACK) & (arrived > 0))[0])
    return (dock, waiting[dock]), (rack, arrived[rack])


def test_a_line_and_the_inspector_say_what_docks_and_racks_hold():
    view = running(120)
    (dock, waiting), (rack, arrived) = places(view)
    floor_plan = view.floor_plan
    cells = [int(view.snapshot.slots.cell[slot]) for slot in (dock, rack)]
    scene = small().with_(snapshot=view.snapshot, floor=make_scene(floor_plan).floor)
    at_dock, at_rack = (f"{floor_plan.xy(cell)}" for cell in cells)
    assert describe(scene, cells[0]) == f"{at_dock} dock with {waiting} loads"
    assert describe(scene, cells[1]) == f"{at_rack} rack with {arrived} loads"
    told = shown(Inspector(), of_cell(view, *floor_plan.xy(cells[0])))
    assert f"waiting {waiting} load" in told and "the next load" in told and "fetched" in told
    told = shown(Inspector(), of_cell(view, *floor_plan.xy(cells[1])))
    assert f"received {arrived} load" in told and "the last load" in told


def test_figures_have_those_of_tasks():
    told = shown(Figures(), running(120), height=90)
    for name in ("task_time", "delay", "throughput_per_robot"):
        assert name in told


def test_who_is_off_the_floor_is_told_so_and_not_drawn():
    settings = ("orders.count=3", "fleet.robots=3", "stop.when=never", "stop.max_duration=100")
    view = moment(100, "warehouse-100-trial", *SMALL[:4], *settings)
    fleet = view.snapshot.robots
    assert fleet.parked.all() and (fleet.cell == NIL).all() and (fleet.bay == NIL).all()
    scene = small().with_(snapshot=view.snapshot, floor=make_scene(view.floor_plan).floor)
    for zoom in ("3x1", "1x1", "half", "braille 1"):
        codes, camera = composed(scene, zoom)
        empty = compose(scene.with_(snapshot=None), camera, UNICODE)
        assert np.array_equal(codes, empty), zoom
    assert "off" in shown(Robots(), view, width=80)
