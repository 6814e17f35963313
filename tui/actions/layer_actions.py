"""Actions on what is laid over the floor."""

from __future__ import annotations

from functools import partial

from tui.actions import Command
from tui.registration import layer_named, layers
from tui.render.colouring import COLOURINGS, is_possible
from tui.render.depth import Depth
from tui.render.trails import LINES
from tui.session.notices import Notices
from tui.session.session import Session


class LayerActions:
    """Layers: those that are registered."""

    def __init__(self, session: Session, notices: Notices) -> None:
        self._session, self._notices, self._choice = session, notices, session.choice

    def commands(self) -> dict[str, Command]:
        ids: dict[str, list[str]] = {}
        for name, layer in layers().by_name.items():
            ids.setdefault(layer.action, []).append(name)
        return {
            "layer_none": partial(self.show, ""),
            **{id: partial(self._press, names) for id, names in ids.items()},
            "layer_route": self._turn_route,
            "next_layer": self._next,
            "next_colouring": self._next_colouring,
            "trails": self._turn_trails,
            "goal_lines": self._next_lines,
        }

    def show(self, name: str) -> None:
        """A layer by its name; "" for the plain floor."""
        session = self._session
        if session.ready() and session.player is not None:
            again = bool(name) and name == self._choice.layer
            self._choice.layer = name
            said = layer_named(name).shown(self._choice, again)
            session.player.show_layer(name)
            session.ordered()
            session.changed()
            if said:
                self._notices.say_of_layer(said)

    def colour_by(self, name: str) -> None:
        """Robots get their colours by one of COLOURINGS, if there are colours and they differ in it."""
        session = self._session
        if session.look.depth == Depth.NONE:
            session.notify("there are no colours here: shapes alone distinguish robots")
        elif not is_possible(session.scene(), name):
            session.notify(f"robots cannot be coloured by {name} here: they have none")
        else:
            self._choice.colouring = name
            self._notices.say(f"robots are coloured by {COLOURINGS[name]}", timeout=2)
            session.changed()

    def colourings(self) -> list[tuple[str, str, Command]]:
        """What the palette has beside the table of bindings: names, meanings, and what is done."""
        scene = self._session.scene()
        return [
            (f"Colours: {name}", f"robots coloured by {words}", partial(self.colour_by, name))
            for name, words in COLOURINGS.items()
            if is_possible(scene, name)
        ]

    def _next_colouring(self) -> None:
        there = [name for name in COLOURINGS if is_possible(self._session.scene(), name)]
        now = self._choice.colouring
        self.colour_by(there[(there.index(now) + 1) % len(there)] if now in there else there[0])

    def _turn_trails(self) -> None:
        session = self._session
        if session.ready() and session.player is not None:
            self._choice.trails = not self._choice.trails
            session.player.show_trails(self._choice.trails)
            session.ordered()
            session.changed()
            shown = "shown" if self._choice.trails else "hidden"
            self._notices.say(f"trails are {shown}", timeout=2)

    def _next_lines(self) -> None:
        at = LINES.index(self._choice.lines) + 1
        self._choice.lines = LINES[at % len(LINES)]
        whose = {"": "none", "selected": "the selected robot's", "all": "all robots'"}
        self._notices.say(f"lines to goals: {whose[self._choice.lines]}", timeout=2)
        self._session.changed()

    def _press(self, names: list[str]) -> None:
        """The key of layers that take turns: the first that is there, or the one after that shown."""
        there = [name for name in names if self._is_there(name)]
        if not there:
            self._session.notify(layer_named(names[-1]).absent)
            return
        shown = self._choice.layer
        if there == [shown] != names:
            self._session.notify(layer_named(names[-1]).absent)
            return
        self.show(there[(there.index(shown) + 1) % len(there)] if shown in there else there[0])

    def _turn_route(self) -> None:
        self._choice.route = not self._choice.route
        shown = "shown" if self._choice.route else "hidden"
        self._notices.say(f"routes are {shown}", timeout=2)
        self._session.changed()

    def _next(self) -> None:
        there = ["", *(name for name in layers().by_name if self._is_there(name))]
        shown = self._choice.layer
        self.show(there[(there.index(shown) + 1) % len(there)] if shown in there else "")

    def _is_there(self, name: str) -> bool:
        return bool(layer_named(name).is_there(self._session.scene()))
