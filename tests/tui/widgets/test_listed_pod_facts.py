"""Orders of a list that carry pods, as the panels of the viewer tell of them."""

from __future__ import annotations

import pytest
from panel_harness import WIDE, moment, of_cell, of_robot, shown

from automaton.errors import InputError
from tui.playback.panel_view import View
from tui.render.scene import Scene, floor_of
from tui.screens.find_dialog import find
from tui.widgets.event_list import Events
from tui.widgets.inspector import Inspector
from tui.widgets.status import describe

VISIT = "stops: [{at: [5, 3], for: 20}]"
LISTED = (
    "pods={list: [{at: [2, 1], name: A-1}, {at: [3, 1], name: A-2}, {at: [4, 1]}, {at: [5, 1]}]}",
    f"orders={{list: [{{from: [2, 1], {VISIT}}}, {{from: [2, 1], to: [7, 1]}}, "
    f"{{from: [3, 1], {VISIT}}}]}}",
)


def listed(tick: int) -> View:
    return moment(tick, "goods-mini", *LISTED)


def waiting() -> View:
    """Robots have just set out for the pods."""
    return moment(1, "goods-mini", *LISTED, "fleet.start=[[0, 3], [0, 2]]")


def test_a_storage_cell_tells_of_its_pod_by_its_name() -> None:
    full = shown(Inspector(), of_cell(waiting(), 2, 1), WIDE)
    for words in ("pod A-1", "order order 0", "fetched by robot 0", "waiting 1 order after it"):
        assert words in full, full
    assert "stood here pod A-1" in shown(Inspector(), of_cell(listed(30), 2, 1), WIDE)


def test_a_robot_and_a_station_tell_of_orders_not_trips() -> None:
    told = shown(Inspector(), of_robot(listed(30), 0), WIDE)
    assert "load pod A-1" in told and "order 0" in told and "trip" not in told, told
    told = shown(Inspector(), of_cell(listed(30), 5, 3), WIDE)
    assert "serves robot 1 is served there for" in told and "open lines" not in told, told
    assert "order 0" in shown(Events(), listed(75), WIDE)


def test_an_order_names_its_pod() -> None:
    panel = Inspector()
    panel.show_order(2)
    view = of_robot(listed(60), 1)
    panel._chosen = (view.robot, view.cell, view.zone)
    told = shown(panel, view, WIDE)
    assert "order 2 delivered" in told and "pod A-2" in told, told


def test_pods_are_found_by_their_names() -> None:
    view, plan = listed(30), listed(30).floor_plan
    assert find("pod 3", view).cells == (plan.cell(4, 1),)
    assert find("pod A-1", view).robots == (0,)
    with pytest.raises(InputError, match=r"no pod b-2 \(did you mean 'A-2'\?\)"):
        find("pod B-2", view)


def test_the_line_about_a_cell() -> None:
    view = waiting()
    scene = Scene(floor_of(view.run.resolved), view.snapshot)

    def words(x: int, y: int) -> str:
        return describe(scene, view.floor_plan.cell(x, y))

    assert words(2, 1).startswith("(2, 1) storage with pod A-1, wanted by order 0")
    assert words(5, 3).startswith("(5, 3) station P1 with 0 in its queue")
