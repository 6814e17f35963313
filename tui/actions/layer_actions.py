"""Actions on what is laid over the floor."""

from __future__ import annotations

from functools import partial

from tui.actions import Command
from tui.registration import layer_named, layers
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
