"""Actions on the panels: off, beside the map, or in its place."""

from __future__ import annotations

from typing import Final

from tui.actions.clock_actions import TimeActions

WIDE: Final = 100  # columns from which panels have room beside the map


class PanelActions(TimeActions):
    """Panels, and the two runs they can tell of."""

    panels = "side"  # off, side or full; on a narrow screen "side" counts as off

    def action_panels(self) -> None:
        self.show_panels({"off": "side", "side": "full", "full": "off"}[self._panels_seen()])

    def action_compare_side(self) -> None:
        if self._alone():
            return
        self.choice.side = (self.choice.side + 1) % len(self.maps)
        self.changed()
        side = self.choice.side
        self.notify(f"panels tell of {'AB'[side]} {self.opening.heads[side].own}", timeout=3)

    def action_next_difference(self) -> None:
        if self._alone():
            return
        if self.divergence is None:
            self.notify("the runs are still being compared")
        elif self.divergence.tick is None:
            self.notify(self.divergence.text)
        else:
            self.go_to_tick(self.divergence.tick)

    def _alone(self) -> bool:
        """Whether no other run is beside this one; if so, says how to compare two."""
        if not self.opening.comparing:
            self.notify("two recordings are compared by: automaton replay A B")
        return not self.opening.comparing

    def show_panels(self, panels: str) -> None:
        """Off, side or full."""
        if panels == "side" and self.size.width < WIDE:
            panels = "full"
        self.panels = panels
        for name in ("off", "side", "full"):
            self.screen_stack[0].set_class(name == panels, f"-panels-{name}")
        if self.column is not None:
            self.column.set_class(panels == "full", "full")
        if panels != "full" or self.column is None:
            self.maps[0].focus()
        self._panels_know = None
        self.changed()

    def open_panel(self, name: str) -> None:
        """Show this panel; if it is what is shown in place of the map, go back to the map."""
        if not self.ready() or self.column is None:
            return
        seen = self._panels_seen()
        if seen == "full" and self.column.name_open == name:
            self.leave_full_panels()
            return
        self.screen.remove_class("-map-alone")
        if seen == "off":
            self.show_panels("side")
        self.column.open(name, focus=self.panels == "full")
        self._panels_know = None
        self.changed()

    def leave_full_panels(self) -> None:
        """Show the map again."""
        if self.panels == "full":
            self.show_panels("side" if self.size.width >= WIDE else "off")

    def _panels_seen(self) -> str:
        return "off" if self.panels == "side" and self.size.width < WIDE else self.panels
