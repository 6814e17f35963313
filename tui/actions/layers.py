"""Actions on what is laid over the floor."""

from __future__ import annotations

from tui.render.scene import LAYERS
from tui.stage import Stage


class LayerActions(Stage):
    """Layers."""

    def action_layer_none(self) -> None:
        self.show_layer("")

    def action_layer_visits(self) -> None:
        self.show_layer("visits")

    def action_layer_waiting(self) -> None:
        self.show_layer("waiting")

    def action_layer_congestion(self) -> None:
        self.show_layer("congestion")

    def action_layer_flow(self) -> None:
        self.show_layer("flow")

    def action_layer_zones(self) -> None:
        if self.pictures.floors[self.choice.side].zones is None:
            self.notify("this floor has no zones")
        else:
            self.show_layer("zones")

    def action_layer_route(self) -> None:
        self.choice.route = not self.choice.route
        self.notify(f"routes are {'shown' if self.choice.route else 'hidden'}", timeout=2)
        self.changed()

    def action_next_layer(self) -> None:
        there = [name for name in LAYERS if name != "zones" or self._zones()]
        self.show_layer(there[(there.index(self.choice.layer) + 1) % len(there)])

    def _zones(self) -> bool:
        return self.pictures.floors[self.choice.side].zones is not None

    def show_layer(self, name: str) -> None:
        """One of LAYERS."""
        if self.ready() and self.player is not None:
            self.choice.layer = name
            self.player.show_layer(name)
            self.ordered()
            self.changed()
