"""What a panel is: a tab beside the map, its key, and the widget behind it.

Each panel is registered as an entry point of the group `automaton.panels`; the name of the entry is
that of the panel. The entry point is loaded before the first picture, the widget after it: so the
former should import little.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from automaton.engine.state import Array
    from tui.playback.panel_view import View


@dataclass
class Panel:
    """A tab and how to get there."""

    tab: str  # on the tab
    widget: str  # "module:Class" of a PanelWidget, built by Class(signs, id=...)
    key: str = ""  # as Textual names keys
    label: str = ""  # in footer, palette and help
    meaning: str = ""  # in the help
    position: int = 1000  # where its tab stands: ours are below 100
    listed: int = 1000  # where its key stands in the help: ours are below 100
    shown: bool = False  # in the footer
    action: str = ""  # of ours in the table of bindings; of others it is "panel_" and the name
    name: str = ""  # that of its entry point


class PanelWidget:
    """What the viewer asks of the widget of a panel; a widget of Textual as well."""

    def show(self, view: View) -> None:
        """Show this, which is something else than before."""
        raise NotImplementedError

    def show_order(self, order: int) -> bool:
        """An order was clicked: show it; whether this panel does."""
        return False

    def listed_events(self, view: View) -> Array | None:
        """(M,) int64 indices of the events that it lists, ascending; None: it lists none."""
        return None

    @property
    def focused_part(self) -> Any:
        """What gets the focus when the panel is opened in place of the map."""
        return self


# A panel that tells something in lines; up and down go from link to link.
