"""What panels say of orders that have a due time."""

from __future__ import annotations

from pathlib import Path

import pytest
from panel_harness import NARROW, WIDE, moment, of_robot, shown

from tui.playback.panel_view import View
from tui.widgets.inspector import Inspector, order_lines
from tui.widgets.metrics_panel import Figures
from tui.widgets.panel import Line
from tui.widgets.pod_facts import due_facts

SCENARIO = """name: late
layout:
  picture: |
    ........
fleet: {robots: 2, kinematics: omni, start: [[0, 0], [7, 0]]}
UNITS
orders:
  list:
    - {stops: [[3, 0]], due: 2}
    - {stops: [{at: [6, 0], for: 90}], due: 600}
    - {stops: [[0, 0]], due: 9}
    - {stops: [[3, 0]]}
    - {stops: [[3, 0]], due: {at: -4}, release: 70}
strategy: {allocation: first-come, right_of_way: wait}
stop: {when: delivered, max_duration: 500}
"""
UNITS = 'units: {tick: 0.5 s, clock: "06:00"}'


def late(folder: Path, tick: int, units: str = UNITS) -> View:
    path = folder / "late.yaml"
    path.write_text(SCENARIO.replace("UNITS", units))
    return moment(tick, str(path))


def said(lines: list[Line]) -> str:
    return "\n".join("".join(span.text for span in line) for line in lines)


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_a_robot_shows_when_its_order_is_due(width: int, tmp_path: Path) -> None:
    view = late(tmp_path, 5)
    on_time = shown(Inspector(), of_robot(view, 1), width)
    assert "due tick 600 (5 min, 06:05): in 595 ticks (4.958 min)" in on_time
    undated = shown(Inspector(), of_robot(late(tmp_path, 8), 0), width)
    assert "order order 3" in undated and "due tick" not in undated
    assert "late 50.0 %" in shown(Figures(), late(tmp_path, 7), width)


def test_an_order_shows_how_late_it_is(tmp_path: Path) -> None:
    view = late(tmp_path, 11)
    orders = ["".join(str(part) for part in _texts(view, order)) for order in range(5)]
    assert orders == [
        "tick 2 (1 s, 06:00:01): late by 1 tick (0.5 s)",
        "tick 600 (5 min, 06:05): in 589 ticks (4.908 min)",
        "tick 9 (4.5 s, 06:00:04): done in time",
        "",
        "tick -4 (-2 s, 05:59:58): late by 15 ticks (7.5 s)",
    ]
    assert "due        tick 2 (1 s, 06:00:01)" in said(order_lines(view, 0, 56))
    assert "due" not in said(order_lines(view, 3, 56))
    assert [span.look for span in due_facts(view, 0) if not isinstance(span, str)][-1] == "warn"
    assert [span.look for span in due_facts(view, 2) if not isinstance(span, str)][-1] == "plain"


def test_where_a_tick_is_no_time_ticks_are_enough(tmp_path: Path) -> None:
    view = late(tmp_path, 5, "units: {tick: 1 cycle}")
    assert "".join(_texts(view, 0)) == "tick 2: late by 1 tick"
    assert "".join(_texts(view, 1)) == "tick 600: in 595 ticks"


def test_without_due_times_nothing_is_late() -> None:
    view = moment(600, "tabletop-1", "fleet.robots=5")
    assert due_facts(view, 0) == [] and "late" not in shown(Figures(), view, WIDE, 80)


def _texts(view: View, order: int) -> list[str]:
    return [part if isinstance(part, str) else part.text for part in due_facts(view, order)]
