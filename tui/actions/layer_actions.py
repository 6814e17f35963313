"""Actions on what is laid over the floor."""

from __future__ import annotations

from typing import Final

from automaton.engine.state import NIL
from tui.actions.viewer_base import ViewerBase
from tui.render.scene import MAP_LAYERS

MAX_PREDICTED_PATHS: Final = 5  # paths through a cell of the layer "predicted"


class LayerActions(ViewerBase):
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
        """The zones that robots serve; again, or where they serve none: those of the floor."""
        if self._serve_zones() and self.choice.layer != "service-zones":
            self.show_layer("service-zones")
        elif self._zones():
            self.show_layer("traffic-zones")
        else:
            self.notify("this floor has no zones: all of it is intersections")

    def action_layer_explored(self) -> None:
        self.show_layer("explored")
        if self.choice.robot == NIL:
            self.notify_of_layer("select a robot, and the search for its way is shown")

    def action_layer_predicted(self) -> None:
        """Again: where one more robot will drive, up to MAX_PREDICTED_PATHS; then one again."""
        if self.choice.layer == "predicted":
            self.choice.least = self.choice.least % MAX_PREDICTED_PATHS + 1
        others = "other robots" if self.choice.robot != NIL else "robots"
        self.show_layer("predicted")
        self.notify_of_layer(f"cells through which {self.choice.least} or more {others} will drive")

    def action_layer_route(self) -> None:
        self.choice.route = not self.choice.route
        self.notify(f"routes are {'shown' if self.choice.route else 'hidden'}", timeout=2)
        self.changed()

    def action_next_layer(self) -> None:
        absent = {"traffic-zones"} if not self._zones() else set()
        absent |= {"service-zones"} if not self._serve_zones() else set()
        there = [name for name in MAP_LAYERS if name not in absent]
        name = there[(there.index(self.choice.layer) + 1) % len(there)]
        if name == "explored":  # which may have to say something
            self.action_layer_explored()
        else:
            self.show_layer(name)

    def _zones(self) -> bool:
        traffic_zones = self.pictures.floors[self.choice.side].traffic_zones
        return traffic_zones is not None and traffic_zones.count > 0

    def _serve_zones(self) -> bool:
        """Whether there are zones that robots serve."""
        return (
            self.pictures.scene(self.playback, self.choice, self.choice.side).service_zones
            is not None
        )

    def show_layer(self, name: str) -> None:
        """One of MAP_LAYERS."""
        if self.ready() and self.player is not None:
            self.choice.layer = name
            self.player.show_layer(name)
            self.ordered()
            self.changed()
