"""The inspector: everything about the robot, the cell or the order that was chosen last."""

from __future__ import annotations

from automaton.engine.state import NIL
from tui.playback.panel_view import OrderChosen, View
from tui.widgets.cell_facts import cell_lines, order_lines
from tui.widgets.robot_facts import robot_lines
from tui.widgets.styled_lines import Line, Link, dim, line, robot_link, title, wrapped
from tui.widgets.text_panel import TextPanel
from tui.widgets.traffic_zone_facts import zone_lines

GUIDE = (
    "Click a robot, a shelf or any other cell of the map.",
    "/ finds robots, loads, cells and zones; ( and ) go to the previous and the next robot.",
    "i looks at the cell under the cursor, or in the middle of the map.",
    "What is underlined leads on: click it, or go to it with up and down and press enter.",
)


class Inspector(TextPanel):
    """A zone or a robot goes before a cell; an order that was asked for goes before all, until then."""

    order = NIL
    _chosen = (NIL, NIL, NIL)

    def panel_lines(self, view: View, width: int) -> list[Line]:
        chosen = (view.robot, view.cell, view.zone)
        if chosen != self._chosen:
            self._chosen, self.order = chosen, NIL
        if self.order != NIL:
            return [*order_lines(view, self.order, width), (), *_way_back(view)]
        if view.zone != NIL:
            return zone_lines(view, view.zone, width)
        if view.robot != NIL:
            return robot_lines(view, view.robot, width, self.signs)
        if view.cell != NIL:
            return cell_lines(view, view.cell, width)
        told = [made for text in GUIDE for made in wrapped(line(dim(text)), width)]
        return [line(title("nothing is selected")), *told]

    def cache_key(self, view: View) -> tuple[object, ...]:
        return (*super().cache_key(view), self.order)

    def show_order(self, order: int) -> bool:
        """Show an order, until another robot or cell is chosen."""
        self.order = order
        if self.view is not None:
            self.show(self.view)
        return True

    def follow(self, link: Link, column: int = 0) -> None:
        """An order is shown here; a robot or cell that is chosen already comes back."""
        kind, number = link
        if kind == "order":
            self.show_order(number)
            self.post_message(OrderChosen(number))
            return
        if kind in ("robot", "cell", "zone"):
            self.show_order(NIL)
        super().follow(link, column)


def _way_back(view: View) -> list[Line]:
    if view.robot == NIL:
        return []
    return [line("back to ", robot_link(view.robot))]
