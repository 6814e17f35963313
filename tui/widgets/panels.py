"""The built-in panels, registered in pyproject.toml like any other panel."""

from __future__ import annotations

from typing import Final

from tui.widgets.panel import Panel

INSPECTOR: Final = Panel(
    "info",
    "tui.widgets.inspector:Inspector",
    key="i",
    label="Inspect",
    meaning="the robot, or the cell under the mouse",
    position=10,
    listed=30,
    action="inspect",
)
WHY: Final = Panel(
    "why",
    "tui.widgets.why_panel:Why",
    key="w",
    label="Why",
    meaning="why the robot waits; again: the next one",
    position=20,
    listed=10,
    shown=True,
)
EVENTS: Final = Panel(
    "events",
    "tui.widgets.event_list:Events",
    key="e",
    label="Events",
    meaning="events: what happened",
    position=30,
    listed=40,
)
ROBOTS: Final = Panel(
    "robots",
    "tui.widgets.robot_table:Robots",
    key="t",
    label="Robots",
    meaning="all robots in a table",
    position=40,
    listed=50,
)
LEGEND: Final = Panel(
    "legend",
    "tui.widgets.legend_panel:Legend",
    key="K",
    label="Legend",
    meaning="legend: what the signs mean",
    position=50,
    listed=60,
)
